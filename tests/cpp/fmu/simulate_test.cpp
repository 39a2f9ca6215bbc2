#include "fmu/simulate.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

// FMUs that CMake builds from inst/examples/fmu and tests/testthat/fmu. The house is held against a closed
// form in tests/testthat/test-fmu.R; here it is how a run asks it.

namespace amiss::fmu {
namespace {

Library house_library(int version) { return Library(version == 2 ? HOUSE_2 : HOUSE_3); }

// Tests run side by side: each process has a folder of its own, written once.
const std::string& house_resources() {
  static const std::string folder = [] {
    const std::string made = testing::TempDir() + "amiss_house_" + std::to_string(getpid());
    std::filesystem::create_directories(made);
    std::ofstream(made + "/start.txt") << "20\n";
    return made;
  }();
  return folder;
}

Origin house_origin(int version) {
  const std::string& folder = house_resources();
  return {version, "{house}", folder, "house", false};
}

// References in inst/examples/fmu/house.h.
constexpr std::uint32_t r_out = 4, fault = 9, outdoor = 10, power = 12, air = 13;

Request house_request() {
  Request request;
  request.settings = {{{r_out, Type::float64}, 0.012, ""}};
  request.inputs = {{outdoor, Type::float64}, {power, Type::float64}};
  request.drivers.resize(3, 2);
  request.drivers << 4, 1000, 6, 1000, 6, 0;
  request.output = {air, Type::float64};
  request.row_s = 3600;
  return request;
}

Eigen::VectorXd run(const Request& request, int version, Log& log) {
  const Library library = house_library(version);
  const auto instance = instantiate(library, house_origin(version), log);
  return simulate(*instance, request);
}

Eigen::VectorXd run(const Request& request, int version = 2) {
  Log log;
  return run(request, version, log);
}

TEST(Simulate, MeansAreThoseOfTheTrapezoidalRuleOverTheCommunicationPoints) {
  Request ends = house_request();
  ends.averaged = false;
  ends.row_s = 900;
  const Eigen::MatrixXd rows = ends.drivers;
  ends.drivers.resize(12, 2);
  for (Eigen::Index row = 0; row < 12; ++row) ends.drivers.row(row) = rows.row(row / 4);
  const Eigen::VectorXd value = run(ends);
  Request means = house_request();
  means.steps = 4;
  const Eigen::VectorXd mean = run(means);
  double before = 20.0;
  for (Eigen::Index row = 0; row < 3; ++row) {
    const double after = value[4 * row + 3];
    const double expected = (0.5 * (before + after) + value.segment(4 * row, 3).sum()) / 4.0;
    EXPECT_NEAR(mean[row], expected, 1e-12);
    before = after;
  }
}

TEST(Simulate, BothVersionsGiveTheSame) { EXPECT_EQ(run(house_request(), 2), run(house_request(), 3)); }

TEST(Simulate, SaysWhyTheFmuEndedARunAndWhetherItsProcessIsSpent) {
  const auto failure = [](double value, int version) {
    Request request = house_request();
    request.settings.push_back({{fault, Type::float64}, value, ""});
    try {
      run(request, version);
    } catch (const Failure& failure) {
      return std::string(failure.what()) + (failure.fatal() ? ", fatal" : "");
    }
    return std::string();
  };
  EXPECT_EQ(failure(5, 2), "its output is not finite in row 1");
  EXPECT_EQ(failure(6, 2), "it discarded the step at 0.000000 s");
  EXPECT_EQ(failure(6, 3), "it asked to end the simulation in the step at 0.000000 s");
  EXPECT_EQ(failure(7, 2), "it returned a fatal error for the step at 0.000000 s, fatal");
  EXPECT_EQ(failure(7, 3), "it returned a fatal error for the step at 0.000000 s, fatal");
}

TEST(Simulate, RefusesReferencesThatTheFmuDoesNotHave) {
  Request request = house_request();
  request.output.reference = 1000;
  EXPECT_THROW(run(request, 2), Failure);
  EXPECT_THROW(run(request, 3), Failure);
}

TEST(Instantiate, PassesOnWhatTheFmuSaysWhenItRefuses) {
  for (const int version : {2, 3}) {
    Log log;
    const Library library = house_library(version);
    Origin origin = house_origin(version);
    origin.resources += "/nowhere";
    EXPECT_THROW(instantiate(library, origin, log), Failure);
    ASSERT_EQ(log.messages().size(), 1u);
    EXPECT_EQ(log.messages()[0].rfind("no start in ", 0), 0u);
  }
}

TEST(Instantiate, RefusesALibraryOfTheOtherVersion) {
  Log log;
  EXPECT_THROW(instantiate(house_library(3), house_origin(2), log), std::runtime_error);
  EXPECT_THROW(instantiate(house_library(2), house_origin(3), log), std::runtime_error);
}

TEST(Instance, EveryTypeArrivesAsItIs) {
  const Library library(TYPES);
  Log log;
  const auto instance = instantiate(library, {3, "", "", "types", false}, log);
  const std::pair<Type, double> sizes[] = {{Type::float32, 0.5},
                                           {Type::int8, -128},
                                           {Type::uint8, 255},
                                           {Type::int16, -32768},
                                           {Type::uint16, 65535},
                                           {Type::uint32, 4294967295.0},
                                           {Type::int64, -1125899906842624.0},
                                           {Type::uint64, 1125899906842624.0}};
  double sum = 0.0;
  for (const auto& [type, value] : sizes) {
    instance->set({50, type}, value);
    sum += value;
  }
  EXPECT_EQ(instance->get({2, Type::float64}), sum);
  instance->set({0, Type::float64}, 0.25);
  instance->set({0, Type::int32}, -7.0);
  instance->set({30, Type::boolean}, 1.0);
  instance->set({40, Type::string}, "abc");
  EXPECT_EQ(instance->get({1, Type::float64}), 0.25 - 7.0 + 1000.0 + 3.0);
  EXPECT_EQ(instance->get({0, Type::int32}), -7.0);
  EXPECT_THROW(instance->set({0, Type::string}, 1.0), std::invalid_argument);
  EXPECT_THROW(instance->get({0, Type::string}), std::invalid_argument);
  EXPECT_THROW(instance->get({0, Type::int8}), std::runtime_error);  // its library has no function for it
}

TEST(WholeNumber, TakesWhatFitsAndNothingElse) {
  EXPECT_EQ(whole_number<std::int8_t>(-128), -128);
  EXPECT_EQ(whole_number<std::uint64_t>(9007199254740992.0), 9007199254740992u);
  EXPECT_THROW(whole_number<std::int8_t>(128), Failure);
  EXPECT_THROW(whole_number<std::uint8_t>(-1), Failure);
  EXPECT_THROW(whole_number<std::int32_t>(0.5), Failure);
  EXPECT_THROW(whole_number<std::int64_t>(9223372036854775808.0), Failure);
  EXPECT_THROW(whole_number<std::int32_t>(std::nan("")), Failure);
}

TEST(CheckStatus, LetsOkAndWarningsPass) {
  EXPECT_NO_THROW(check_status(0, "a step"));
  EXPECT_NO_THROW(check_status(1, "a step"));
  for (const int status : {2, 3, 4, 5, 6}) EXPECT_THROW(check_status(status, "a step"), Failure);
}

TEST(Library, SaysWhatCannotBeLoadedOrFound) {
  EXPECT_THROW(Library("/nowhere/house.so"), std::runtime_error);
  EXPECT_THROW(house_library(2).function<void()>("fmi3DoStep"), std::runtime_error);
}

TEST(Log, KeepsTheLastMessagesAndCutsThem) {
  Log log;
  for (int i = 0; i < 30; ++i) log.add(std::to_string(i).c_str());
  log.add(nullptr);
  log.add(std::string(10000, 'a').c_str());
  ASSERT_EQ(log.messages().size(), 10u);
  EXPECT_EQ(log.messages()[7], "29");
  EXPECT_EQ(log.messages()[9].size(), 500u);
}

}  // namespace
}  // namespace amiss::fmu
