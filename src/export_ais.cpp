// Annealed importance sampling of a posterior whose likelihood is an R function: convert, call, convert.
#include <limits>

#include "export_convert.h"

#include "engine/random/transform.hpp"

using namespace amiss;  // NOLINT

namespace {

// R is not to be called from other threads: the context must ask for one.
class FunctionTarget : public Target {
 public:
  FunctionTarget(Rcpp::Function log_likelihood, Rcpp::Nullable<Rcpp::Function> gradient, int dimension)
      : log_likelihood_(log_likelihood), gradient_(gradient), dimension_(dimension) {}

  Eigen::Index dimension() const override { return dimension_; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override {
    const Eigen::MatrixXd unit = x.transpose().unaryExpr(&normal_cdf);
    const Eigen::VectorXd values = Rcpp::as<Eigen::VectorXd>(log_likelihood_(unit));
    if (values.size() != x.cols())
      throw std::invalid_argument("log_likelihood returned another number of values than it got points");
    return values;
  }
  // A call costs more than a value, and R has one thread.
  Eigen::Index block() const override { return std::numeric_limits<Eigen::Index>::max(); }
  bool has_gradient() const override { return gradient_.isNotNull(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const override {
    const Eigen::MatrixXd unit = x.transpose().unaryExpr(&normal_cdf);
    const Eigen::MatrixXd slope = Rcpp::as<Eigen::MatrixXd>(Rcpp::Function(gradient_)(unit));
    gradient = slope.transpose().cwiseProduct(x.unaryExpr(&normal_density));
    return log_likelihood(x);
  }

 private:
  Rcpp::Function log_likelihood_;
  Rcpp::Nullable<Rcpp::Function> gradient_;
  int dimension_;
};

}  // namespace

// [[Rcpp::export]]
Rcpp::List ais_(const Rcpp::Function& log_likelihood, const Rcpp::Nullable<Rcpp::Function>& gradient,
                int dimension, const Rcpp::List& control, const Rcpp::List& context_list) {
  Context context = convert::context(context_list);
  context.threads = 1;  // R is called from one only
  const AisResult result =
      sample_ais(FunctionTarget(log_likelihood, gradient, dimension), convert::ais_options(control), context);
  Rcpp::List out = convert::ais_list(result);
  out["unit"] = Eigen::MatrixXd(result.draws.transpose().unaryExpr(&normal_cdf));
  return out;
}

// What AisOptions says if nothing is given: the one place where the options of `control$ais` have their
// defaults.
// [[Rcpp::export]]
Rcpp::List ais_defaults_() {
  const AisOptions o;
  using Rcpp::Named;
  return Rcpp::List::create(
      Named("pilot_chains") = o.pilot_chains, Named("groups") = o.groups, Named("max_groups") = o.max_groups,
      Named("precision") = o.precision, Named("chains") = o.chains, Named("sweeps") = o.sweeps,
      Named("max_sweeps") = o.max_sweeps, Named("ess_drop") = o.ess_drop, Named("gradient") = o.gradient,
      Named("resample") = o.resample, Named("importance_draws") = o.importance_draws,
      Named("max_components") = o.max_components);
}
