#include <cstdarg>
#include <cstdio>
#include <cstdlib>

#include "fmu/Instance.hpp"
#include "fmu/interface2.hpp"
#include "fmu/resource_uri.hpp"

namespace amiss::fmu {

namespace {

void log_message_2(void* environment, const char*, int, const char*, const char* message, ...) {
  if (environment == nullptr || message == nullptr) return;
  char text[1024];
  std::va_list arguments;
  va_start(arguments, message);
  std::vsnprintf(text, sizeof text, message, arguments);
  va_end(arguments);
  static_cast<Log*>(environment)->add(text);
}

class Instance2 : public Instance {
 public:
  Instance2(const Library& library, const Origin& origin, Log& log)
      : library_(library), callbacks_{log_message_2, std::calloc, std::free, nullptr, &log} {
    const std::string version = library.function<interface2::GetText>("fmi2GetVersion")();
    if (version != "2.0")
      throw std::runtime_error("its library is of FMI " + version + ", its description of 2.0");
    const auto make = library.function<interface2::Instantiate>("fmi2Instantiate");
    const std::string resources = resource_uri(origin.resources);
    component_ = make(origin.name.c_str(), interface2::co_simulation, origin.token.c_str(), resources.c_str(),
                      &callbacks_, 0, origin.logging);
    if (component_ == nullptr) throw Failure("it could not be instantiated", false);
  }

  ~Instance2() override {
    if (component_ != nullptr) library_.function<interface2::Free>("fmi2FreeInstance")(component_);
  }

  void set(const Variable& variable, double value) override {
    const char* what = "a value";
    if (variable.type == Type::float64) {
      check(library_.function<interface2::SetReal>("fmi2SetReal")(component_, &variable.reference, 1, &value),
            what);
    } else {
      const bool flag = variable.type == Type::boolean;
      const int whole = flag ? value != 0.0 : whole_number<std::int32_t>(value);
      const char* name = flag ? "fmi2SetBoolean" : "fmi2SetInteger";
      check(library_.function<interface2::SetWhole>(name)(component_, &variable.reference, 1, &whole), what);
    }
  }

  void set(const Variable& variable, const std::string& value) override {
    const char* text = value.c_str();
    check(library_.function<interface2::SetText>("fmi2SetString")(component_, &variable.reference, 1, &text),
          "a text");
  }

  double get(const Variable& variable) override {
    if (variable.type == Type::float64) {
      double value = 0.0;
      check(library_.function<interface2::GetReal>("fmi2GetReal")(component_, &variable.reference, 1, &value),
            output);
      return value;
    }
    int value = 0;
    const char* name = variable.type == Type::boolean ? "fmi2GetBoolean" : "fmi2GetInteger";
    check(library_.function<interface2::GetWhole>(name)(component_, &variable.reference, 1, &value), output);
    return value;
  }

  void enter_initialization(const Experiment& experiment) override {
    const auto setup = library_.function<interface2::SetupExperiment>("fmi2SetupExperiment");
    const double tolerance = experiment.tolerance;
    check(setup(component_, tolerance > 0.0, tolerance, experiment.start, 1, experiment.stop), "its times");
    change("fmi2EnterInitializationMode", "its initialisation");
  }

  void exit_initialization() override { change("fmi2ExitInitializationMode", "its initialisation"); }

  void step(double time, double length) override {
    const auto go = library_.function<interface2::DoStep>("fmi2DoStep");
    check(go(component_, time, length, 1), "the step at " + std::to_string(time) + " s");
  }

  void terminate() override { change("fmi2Terminate", "its end"); }

 private:
  static constexpr const char* output = "its output";

  void change(const char* function, const char* what) {
    check(library_.function<interface2::Change>(function)(component_), what);
  }

  // After a fatal error nothing may be called any more.
  void check(int status, const std::string& what) {
    if (status >= 4) component_ = nullptr;
    check_status(status, what);
  }

  const Library& library_;
  const interface2::Callbacks callbacks_;
  interface2::Component component_ = nullptr;
};

}  // namespace

std::unique_ptr<Instance> instantiate_2(const Library& library, const Origin& origin, Log& log) {
  return std::make_unique<Instance2>(library, origin, log);
}

}  // namespace amiss::fmu
