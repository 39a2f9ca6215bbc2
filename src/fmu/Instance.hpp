#pragma once

#include <deque>
#include <memory>
#include <stdexcept>
#include <string>

#include "fmu/Library.hpp"
#include "fmu/Variable.hpp"

namespace amiss::fmu {

/// A run that the FMU ended. After a fatal failure its process must not be used again.
class Failure : public std::runtime_error {
 public:
  Failure(const std::string& why, bool fatal) : std::runtime_error(why), fatal_(fatal) {}
  bool fatal() const { return fatal_; }

 private:
  bool fatal_;
};

/// The last messages of an FMU, each cut to a length.
class Log {
 public:
  void add(const char* message);
  const std::deque<std::string>& messages() const { return messages_; }

 private:
  std::deque<std::string> messages_;
};

/// What an instance is made from.
struct Origin {
  int version = 2;        // of the standard: 2 or 3
  std::string token;      // `guid` of FMI 2.0, `instantiationToken` of FMI 3.0
  std::string resources;  // absolute path of the folder, without a separator at its end
  std::string name;       // of the instance
  bool logging = false;   // whether the FMU is asked for all its messages
};

/// Times in s; a tolerance that is not positive leaves it to the FMU.
struct Experiment {
  double start = 0.0;
  double stop = 0.0;
  double tolerance = 0.0;
};

/// An instance of an FMU for co-simulation. The order of calls is that of the standard: parameters,
/// initialise with the inputs, steps. Every function throws Failure if the FMU does not do what it is asked.
class Instance {
 public:
  Instance() = default;
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  virtual ~Instance() = default;

  virtual void set(const Variable& variable, double value) = 0;
  virtual void set(const Variable& variable, const std::string& value) = 0;
  virtual double get(const Variable& variable) = 0;
  virtual void enter_initialization(const Experiment& experiment) = 0;
  virtual void exit_initialization() = 0;
  /// From `time` on, s; both are > 0 and the FMU ends at `time + length`.
  virtual void step(double time, double length) = 0;
  virtual void terminate() = 0;
};

/// An instance by the functions of FMI 2.0 or 3.0. `library` and `log` outlive it. Throws Failure if the FMU
/// refuses, std::runtime_error if the library is not of the version that its description says.
std::unique_ptr<Instance> instantiate(const Library& library, const Origin& origin, Log& log);
std::unique_ptr<Instance> instantiate_2(const Library& library, const Origin& origin, Log& log);
std::unique_ptr<Instance> instantiate_3(const Library& library, const Origin& origin, Log& log);

/// Throws Failure for a status of the standard's that ends a run: from 2 (discard) on; `what` was asked.
void check_status(int status, const std::string& what);

/// A whole number of this type. Throws Failure if the value is none, or does not fit.
template <class Whole>
Whole whole_number(double value);

}  // namespace amiss::fmu
