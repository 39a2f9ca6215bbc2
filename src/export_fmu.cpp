#include <string>
#include <vector>

#include <RcppEigen.h>

#include "fmu/process.hpp"
#include "fmu/simulate.hpp"

// FMUs for R: convert, run, convert. Called in a process of the FMU's own only.

namespace {

using namespace amiss::fmu;

// `type` counts from 0 in the order of Type; references are numbers, as they may need all 32 bits.
std::vector<Variable> read_variables(const Rcpp::List& from) {
  const Rcpp::NumericVector reference = from["reference"];
  const Rcpp::IntegerVector type = from["type"];
  std::vector<Variable> variables;
  for (R_xlen_t k = 0; k < reference.size(); ++k)
    variables.push_back({static_cast<std::uint32_t>(reference[k]), static_cast<Type>(type[k])});
  return variables;
}

std::vector<Setting> read_settings(const Rcpp::List& from) {
  const Rcpp::NumericVector number = from["number"];
  const Rcpp::CharacterVector text = from["text"];
  std::vector<Setting> settings;
  for (const Variable& variable : read_variables(from)) {
    const auto k = static_cast<R_xlen_t>(settings.size());
    settings.push_back({variable, number[k], Rcpp::as<std::string>(text[k])});
  }
  return settings;
}

Request read_request(const Rcpp::List& from) {
  Request request;
  request.settings = read_settings(from["settings"]);
  request.inputs = read_variables(from["inputs"]);
  request.drivers = Rcpp::as<Eigen::MatrixXd>(from["drivers"]);
  request.output = read_variables(from["output"]).at(0);
  request.start = Rcpp::as<double>(from["start_s"]);
  request.row_s = Rcpp::as<double>(from["row_s"]);
  request.steps = Rcpp::as<int>(from["steps"]);
  request.averaged = Rcpp::as<bool>(from["averaged"]);
  request.tolerance = Rcpp::as<double>(from["tolerance"]);
  return request;
}

Origin read_origin(const Rcpp::List& from) {
  return {Rcpp::as<int>(from["version"]), Rcpp::as<std::string>(from["token"]),
          Rcpp::as<std::string>(from["resources"]), Rcpp::as<std::string>(from["name"]),
          Rcpp::as<bool>(from["logging"])};
}

}  // namespace

// One run of the FMU whose library is the file `origin$library`: list(value), one number for each row of
// `request$drivers`; or list(why, fatal, said), `said` being its last messages. The fields are those of
// Origin and Request.
// [[Rcpp::export]]
Rcpp::List fmu_run_(Rcpp::List origin, Rcpp::List request) {
  const Request asked = read_request(request);
  Log log;
  const auto failed = [&log](const char* why, bool fatal) {
    return Rcpp::List::create(
        Rcpp::Named("why") = why, Rcpp::Named("fatal") = fatal,
        Rcpp::Named("said") = std::vector<std::string>(log.messages().begin(), log.messages().end()));
  };
  try {
    const Library library(Rcpp::as<std::string>(origin["library"]));
    const std::unique_ptr<Instance> instance = instantiate(library, read_origin(origin), log);
    return Rcpp::List::create(Rcpp::Named("value") = simulate(*instance, asked));
  } catch (const Failure& failure) {
    return failed(failure.what(), failure.fatal());
  } catch (const std::exception& error) {
    return failed(error.what(), true);
  }
}

// Ends this process when its parent, of this number, ends; the number of the descriptor that leads to the
// parent.
// [[Rcpp::export]]
int fmu_serve_(int parent) {
  end_with_parent(parent);
  end_when_crashed();
  return separate_output();
}

// [[Rcpp::export]]
void fmu_say_(int descriptor, std::string line) { write_line(descriptor, line); }

// [[Rcpp::export]]
void fmu_forget_errors_() { empty_standard_error(); }
