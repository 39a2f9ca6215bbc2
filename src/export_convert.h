// Conversions that several export files share. Include after RcppEigen.h.
#pragma once
#include <RcppEigen.h>

#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss::convert {

inline Context context(const Rcpp::List& list) {
  Context out;
  out.seed = static_cast<std::uint64_t>(Rcpp::as<double>(list["seed"]));
  out.threads = Rcpp::as<int>(list["threads"]);
  out.poll = [] { Rcpp::checkUserInterrupt(); };
  return out;
}

inline AisOptions ais_options(const Rcpp::List& control) {
  AisOptions options;
  options.pilot_chains = control["pilot_chains"];
  options.groups = control["groups"];
  options.max_groups = control["max_groups"];
  options.precision = control["precision"];
  options.chains = control["chains"];
  options.sweeps = control["sweeps"];
  options.max_sweeps = control["max_sweeps"];
  options.ess_drop = control["ess_drop"];
  options.gradient = control["gradient"];
  options.resample = control["resample"];
  options.importance_draws = control["importance_draws"];
  options.max_components = control["max_components"];
  return options;
}

// NULL: none.
inline Eigen::MatrixXd matrix(const Rcpp::RObject& given) {
  return given.isNULL() ? Eigen::MatrixXd() : Rcpp::as<Eigen::MatrixXd>(given);
}

// NULL: everywhere.
inline Region region(const Rcpp::RObject& given) {
  if (given.isNULL()) return Region();
  const Rcpp::List list(given);
  return Region(Rcpp::as<Eigen::VectorXd>(list["centre"]), Rcpp::as<Eigen::MatrixXd>(list["root"]),
                Rcpp::as<double>(list["radius"]), Rcpp::as<std::vector<bool>>(list["uniform"]));
}

inline EmulatorState emulator_state(const Rcpp::List& emulator) {
  return {Rcpp::as<Eigen::MatrixXd>(emulator["inputs"]), Rcpp::as<Eigen::MatrixXd>(emulator["coefficients"]),
          Rcpp::as<Eigen::MatrixXd>(emulator["hyperparameters"]), region(emulator["region"]),
          emulator.containsElementNamed("trend") ? matrix(emulator["trend"]) : Eigen::MatrixXd()};
}

inline Rcpp::List ais_list(const AisResult& result) {
  const std::size_t levels = result.ladder.size();
  Rcpp::NumericVector beta(levels), step(levels), acceptance(levels), ess(levels);
  Rcpp::IntegerVector sweeps(levels);
  for (std::size_t k = 0; k < levels; ++k) {
    beta[k] = result.ladder[k].beta;
    step[k] = result.ladder[k].step;
    sweeps[k] = result.ladder[k].sweeps;
    acceptance[k] = result.ladder[k].acceptance;
    ess[k] = result.ladder[k].ess;
  }
  using Rcpp::_;
  Rcpp::List out = Rcpp::List::create(
      _["log_evidence"] = result.log_evidence, _["standard_error"] = result.standard_error,
      _["interval"] = Rcpp::NumericVector::create(result.lower, result.upper),
      _["estimator"] = in_words(result.estimator),
      _["annealed"] = Rcpp::NumericVector::create(result.annealed, result.annealed_se),
      _["second"] = Rcpp::NumericVector::create(result.second, result.second_se),
      _["second_ess"] = result.second_ess, _["ess"] = result.ess,
      _["log_weight_variance"] = result.log_weight_variance,
      _["ladder"] = Rcpp::DataFrame::create(_["beta"] = beta, _["step"] = step, _["sweeps"] = sweeps,
                                            _["acceptance"] = acceptance, _["ess"] = ess),
      _["evaluations"] = static_cast<double>(result.evaluations), _["trusted"] = trusted(result.outcome),
      _["why"] = in_words(result.outcome),
      _["verdict"] =
          (trusted(result.outcome) ? "trusted: " : "not trusted: ") + std::string(in_words(result.outcome)));
  out["weights"] = result.weights;
  out["log_likelihood"] = result.log_likelihood;
  return out;
}

// What the attribution needs of a posterior that ais_list() told.
inline AisResult ais_summary(const Rcpp::List& list) {
  AisResult out;
  out.log_evidence = list["log_evidence"];
  out.standard_error = list["standard_error"];
  out.ess = list["ess"];
  // Why it is not trusted does not matter to the attribution.
  out.outcome = Rcpp::as<bool>(list["trusted"]) ? Outcome::consistent : Outcome::inconsistent;
  out.weights = Rcpp::as<Eigen::VectorXd>(list["weights"]);
  out.log_likelihood = Rcpp::as<Eigen::VectorXd>(list["log_likelihood"]);
  return out;
}

inline Rcpp::List simulator_list(const GaussianSimulator& simulator) {
  return Rcpp::List::create(Rcpp::_["mean"] = simulator.mean, Rcpp::_["root"] = simulator.root);
}

inline GaussianSimulator simulator(const Rcpp::List& list) {
  return {Rcpp::as<Eigen::VectorXd>(list["mean"]), Rcpp::as<Eigen::MatrixXd>(list["root"])};
}

}  // namespace amiss::convert
