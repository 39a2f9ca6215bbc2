#pragma once

#include <cstddef>
#include <cstdint>

/// The functions of FMI 3.0 for co-simulation that the package calls, declared from the standard (FMI 3.0.1,
/// sections 2.2 and 4.2). Booleans are bool, value references 32 bits, and a status is 0 ok, 1 warning, 2
/// discard, 3 error, 4 fatal.
namespace amiss::fmu::interface3 {

using Component = void*;
using Reference = std::uint32_t;
using LogMessage = void(void* environment, int status, const char* category, const char* message);

/// Never called: no variables are asked for within a step.
using IntermediateUpdate = void(void* environment, double time, bool set_requested, bool get_allowed,
                                bool step_finished, bool can_return_early, bool* returns_early,
                                double* return_time);

using GetText = const char*();
using Instantiate = Component(const char* name, const char* token, const char* resources, bool visible,
                              bool logging, bool event_mode, bool early_return, const Reference* required,
                              std::size_t n_required, void* environment, LogMessage* log,
                              IntermediateUpdate* update);
using Free = void(Component);
using EnterInitialization = int(Component, bool tolerance_defined, double tolerance, double start,
                                bool stop_defined, double stop);
using Change = int(Component);
template <class Value>
using Set = int(Component, const Reference*, std::size_t, const Value*, std::size_t);
template <class Value>
using Get = int(Component, const Reference*, std::size_t, Value*, std::size_t);
using DoStep = int(Component, double time, double length, bool no_return, bool* event, bool* terminate,
                   bool* early, double* last_time);

}  // namespace amiss::fmu::interface3
