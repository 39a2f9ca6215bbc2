#include "fmu/Instance.hpp"
#include "fmu/interface3.hpp"

namespace amiss::fmu {

namespace {

void log_message_3(void* environment, int, const char*, const char* message) {
  if (environment != nullptr) static_cast<Log*>(environment)->add(message);
}

class Instance3 : public Instance {
 public:
  Instance3(const Library& library, const Origin& origin, Log& log) : library_(library) {
    const std::string version = library.function<interface3::GetText>("fmi3GetVersion")();
    if (version.rfind("3.", 0) != 0)
      throw std::runtime_error("its library is of FMI " + version + ", its description of 3.0");
    const auto make = library.function<interface3::Instantiate>("fmi3InstantiateCoSimulation");
#ifdef _WIN32
    const std::string resources = origin.resources + "\\";
#else
    const std::string resources = origin.resources + "/";
#endif
    component_ = make(origin.name.c_str(), origin.token.c_str(), resources.c_str(), false, origin.logging,
                      false, false, nullptr, 0, &log, log_message_3, nullptr);
    if (component_ == nullptr) throw Failure("it could not be instantiated", false);
  }

  ~Instance3() override {
    if (component_ != nullptr) library_.function<interface3::Free>("fmi3FreeInstance")(component_);
  }

  void set(const Variable& variable, double value) override {
    switch (variable.type) {
      case Type::float64:
        return set_as(variable, "fmi3SetFloat64", value);
      case Type::float32:
        return set_as(variable, "fmi3SetFloat32", static_cast<float>(value));
      case Type::int8:
        return set_as(variable, "fmi3SetInt8", whole_number<std::int8_t>(value));
      case Type::uint8:
        return set_as(variable, "fmi3SetUInt8", whole_number<std::uint8_t>(value));
      case Type::int16:
        return set_as(variable, "fmi3SetInt16", whole_number<std::int16_t>(value));
      case Type::uint16:
        return set_as(variable, "fmi3SetUInt16", whole_number<std::uint16_t>(value));
      case Type::int32:
        return set_as(variable, "fmi3SetInt32", whole_number<std::int32_t>(value));
      case Type::uint32:
        return set_as(variable, "fmi3SetUInt32", whole_number<std::uint32_t>(value));
      case Type::int64:
        return set_as(variable, "fmi3SetInt64", whole_number<std::int64_t>(value));
      case Type::uint64:
        return set_as(variable, "fmi3SetUInt64", whole_number<std::uint64_t>(value));
      case Type::boolean:
        return set_as(variable, "fmi3SetBoolean", value != 0.0);
      case Type::string:
        throw std::invalid_argument("fmu: a number for a text");
    }
  }

  void set(const Variable& variable, const std::string& value) override {
    set_as(variable, "fmi3SetString", value.c_str());
  }

  double get(const Variable& variable) override {
    switch (variable.type) {
      case Type::float64:
        return get_as<double>(variable, "fmi3GetFloat64");
      case Type::float32:
        return get_as<float>(variable, "fmi3GetFloat32");
      case Type::int8:
        return get_as<std::int8_t>(variable, "fmi3GetInt8");
      case Type::uint8:
        return get_as<std::uint8_t>(variable, "fmi3GetUInt8");
      case Type::int16:
        return get_as<std::int16_t>(variable, "fmi3GetInt16");
      case Type::uint16:
        return get_as<std::uint16_t>(variable, "fmi3GetUInt16");
      case Type::int32:
        return get_as<std::int32_t>(variable, "fmi3GetInt32");
      case Type::uint32:
        return get_as<std::uint32_t>(variable, "fmi3GetUInt32");
      case Type::int64:
        return get_as<std::int64_t>(variable, "fmi3GetInt64");
      case Type::uint64:
        return get_as<std::uint64_t>(variable, "fmi3GetUInt64");
      case Type::boolean:
        return get_as<bool>(variable, "fmi3GetBoolean");
      case Type::string:
        break;
    }
    throw std::invalid_argument("fmu: a text is no number");
  }

  void enter_initialization(const Experiment& experiment) override {
    const auto enter = library_.function<interface3::EnterInitialization>("fmi3EnterInitializationMode");
    const double tolerance = experiment.tolerance;
    check(enter(component_, tolerance > 0.0, tolerance, experiment.start, true, experiment.stop),
          "its initialisation");
  }

  void exit_initialization() override { change("fmi3ExitInitializationMode", "its initialisation"); }

  void step(double time, double length) override {
    const auto go = library_.function<interface3::DoStep>("fmi3DoStep");
    bool event = false, ends = false, early = false;
    double reached = time;
    const std::string at = std::to_string(time) + " s";
    check(go(component_, time, length, true, &event, &ends, &early, &reached), "the step at " + at);
    if (ends) throw Failure("it asked to end the simulation in the step at " + at, false);
    if (early) throw Failure("it returned early from the step at " + at + ", unasked", false);
  }

  void terminate() override { change("fmi3Terminate", "its end"); }

 private:
  template <class Value>
  void set_as(const Variable& variable, const char* function, Value value) {
    check(library_.function<interface3::Set<Value>>(function)(component_, &variable.reference, 1, &value, 1),
          "a value");
  }

  template <class Value>
  double get_as(const Variable& variable, const char* function) {
    Value value{};
    check(library_.function<interface3::Get<Value>>(function)(component_, &variable.reference, 1, &value, 1),
          "its output");
    return static_cast<double>(value);
  }

  void change(const char* function, const char* what) {
    check(library_.function<interface3::Change>(function)(component_), what);
  }

  // After a fatal error nothing may be called any more.
  void check(int status, const std::string& what) {
    if (status >= 4) component_ = nullptr;
    check_status(status, what);
  }

  const Library& library_;
  interface3::Component component_ = nullptr;
};

}  // namespace

std::unique_ptr<Instance> instantiate_3(const Library& library, const Origin& origin, Log& log) {
  return std::make_unique<Instance3>(library, origin, log);
}

}  // namespace amiss::fmu
