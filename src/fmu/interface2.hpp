#pragma once

#include <cstddef>

/// The functions of FMI 2.0 for co-simulation that the package calls, declared from the standard (FMI 2.0.4,
/// sections 2.1 and 4.2). Booleans are int, value references unsigned int, and a status is 0 ok, 1 warning, 2
/// discard, 3 error, 4 fatal, 5 pending.
namespace amiss::fmu::interface2 {

using Component = void*;
using Reference = unsigned int;

/// Printf-style; the arguments of `message` follow.
using Logger = void(void* environment, const char* instance, int status, const char* category,
                    const char* message, ...);

struct Callbacks {
  Logger* logger;
  void* (*allocate)(std::size_t count, std::size_t size);
  void (*release)(void* memory);
  void (*step_finished)(void* environment, int status);
  void* environment;
};

constexpr int co_simulation = 1;

using GetText = const char*();
using Instantiate = Component(const char* name, int kind, const char* guid, const char* resources,
                              const Callbacks* callbacks, int visible, int logging);
using Free = void(Component);
using SetupExperiment = int(Component, int tolerance_defined, double tolerance, double start,
                            int stop_defined, double stop);
using Change = int(Component);
using SetReal = int(Component, const Reference*, std::size_t, const double*);
using SetWhole = int(Component, const Reference*, std::size_t, const int*);
using SetText = int(Component, const Reference*, std::size_t, const char* const*);
using GetReal = int(Component, const Reference*, std::size_t, double*);
using GetWhole = int(Component, const Reference*, std::size_t, int*);
using DoStep = int(Component, double time, double length, int no_return);

}  // namespace amiss::fmu::interface2
