#pragma once
#include <vector>

#include "engine/linalg/Scratch.hpp"

namespace amiss {

/// Gamma(shape, rate) prior of the noise precision lambda_q; shape = 0 leaves lambda_q out (no such noise).
struct GammaPrior {
  double shape = 0.0;
  double rate = 0.0;
};

/// Beta(a, b) prior of a hyper-parameter in (0, 1). With a shape below 1 the density has no greatest value.
struct BetaShapes {
  double a = 1.0;
  double b = 1.0;
};

struct HyperPriors {
  GammaPrior lambda;
  BetaShapes s2, eta2;
  BetaShapes beta;  ///< of each beta that is searched

  void check() const;  ///< @throws std::invalid_argument
};

struct SearchOptions {
  int starts = 3;              ///< starting points screened; the search runs from the best of them
  int searches = 1;            ///< how many of them are searched
  int max_evaluations = 120;   ///< per search
  bool forward = false;        ///< parameters get their own beta by forward selection, not all at once
  double significance = 0.05;  ///< of a step of the forward selection

  void check() const;
};

/// A step of the forward selection: this parameter got its own beta, which raised the log density by `gain`.
struct SelectionStep {
  int parameter = 0;
  double gain = 0.0;
};

/// Hyper-parameters of equation (2) on the scales on which they are searched:
///     cov(w_i, w_j) = amplitude prod_p beta_p^(4 (u_ip - u_jp)^2) + delta_ij (nugget + 1 / lambda),
/// amplitude = (1 - s2) / s2, nugget = (1 - eta2) / eta2. With s2 and eta2 uniform on (0, 1), log amplitude =
/// -logit(s2) and log nugget = -logit(eta2).
struct GaussianProcessParameters {
  double log_amplitude = 0.0;
  double log_nugget = -10.0;
  double log_lambda = 0.0;
  Eigen::VectorXd logit_beta;  ///< P

  Eigen::VectorXd pack() const;
  static GaussianProcessParameters unpack(const Eigen::VectorXd& x);
};

/// Gaussian-process emulator of one coefficient over the unit cube, of values centred and scaled to unit
/// variance.
class GaussianProcess {
 public:
  /// @param inputs M x P in the unit cube. @param values M, standardised.
  GaussianProcess(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                  const GaussianProcessParameters& parameters);

  /// Mode of the joint density (3) of values and hyper-parameters, by gradient search; all betas at once, or
  /// by forward selection.
  static GaussianProcess fit(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                             const HyperPriors& priors, const SearchOptions& options);

  /// What values of (3) are computed in, kept from one to the next.
  struct Memory {
    Scratch covariance, inverse;
  };

  /// Logarithm of the joint density (3), up to a constant, and its gradient in pack()'s coordinates. It is
  /// the density of s2, eta2, beta and lambda themselves: the coordinates only carry the search, no Jacobian
  /// enters, so that uniform priors leave the likelihood as it is.
  static double log_density(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                            const HyperPriors& priors, const Eigen::VectorXd& packed,
                            Eigen::Ref<Eigen::VectorXd> gradient);

  /// The same, with betas that several parameters share: parameter p has the beta number beta_of[p] of those
  /// in x (log_amplitude, log_nugget, log_lambda, then the logits), and each counts once in the prior.
  static double log_density(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values,
                            const HyperPriors& priors, const std::vector<int>& beta_of,
                            const Eigen::VectorXd& x, Eigen::Ref<Eigen::VectorXd> gradient, Memory& memory);

  /// Mean and variance of the smooth part at points (n x P); a value seen there varies by noise() more.
  void predict(const Eigen::MatrixXd& points, Eigen::Ref<Eigen::VectorXd> mean,
               Eigen::Ref<Eigen::VectorXd> variance) const;
  /// The mean alone, which costs a small part of it.
  void predict(const Eigen::MatrixXd& points, Eigen::Ref<Eigen::VectorXd> mean) const;

  /// The mean and its gradient with respect to the points (n x P).
  void predict(const Eigen::MatrixXd& points, Eigen::Ref<Eigen::VectorXd> mean,
               Eigen::MatrixXd& slopes) const;
  /// Leave-one-out prediction of each value, closed form (Rasmussen and Williams 2006, equation 5.12).
  void leave_one_out(Eigen::VectorXd& mean, Eigen::VectorXd& variance) const;

  /// Leave-one-out prediction of each value by hyper-parameters that have not seen it either: those of the
  /// mode, less what value i draws them by. With t the hyper-parameters in pack()'s coordinates, e_i = y_i -
  /// mean_i and v_i error and variance of leave_one_out(), a_i = de_i/dt and b = d log v_i/dt (for its mean
  /// over the runs, from which it differs little), the density of value i given the others has the slope
  ///     g_i = -a_i e_i / v_i - b (1 - e_i^2 / v_i) / 2,
  /// and one Newton step away from it, t_i = -(H - a_i a_i' / v_i)^-1 g_i, gives
  ///     y_i - mean_i = e_i + a_i't_i,   variance_i = v_i exp(b't_i).
  /// H is the average information (1/2) q_j' C^-1 q_k, q_j = (dC/dt_j) C^-1 y, about the mean of the observed
  /// and the expected information of the likelihood (Gilmour, Thompson and Cullis 1995, Biometrics 51), plus
  /// the prior precisions: 1 / variance of logit and logarithm under the priors. The step is the
  /// infinitesimal jackknife (Giordano et al. 2019, A Swiss army infinitesimal jackknife) with the leverage
  /// a_i'H^-1 a_i / v_i of value i, at most 0.9; all of them cost as much as one or two values of
  /// log_density().
  void leave_one_out(const HyperPriors& priors, Eigen::VectorXd& mean, Eigen::VectorXd& variance) const;

  /// Multiplies all variances by the mean square of the errors of leave_one_out(priors) in units of their own
  /// standard deviations (Bachoc 2013, Computational Statistics and Data Analysis 66, but with
  /// hyper-parameters that have not seen the value left out), where that exceeds 1; means stay as they are.
  /// The mode of the hyper-parameters ignores their uncertainty and that the covariance function is only a
  /// model: its intervals tend to be too narrow, and so do those of leave_one_out() at the mode.
  void widen(const HyperPriors& priors);

  const GaussianProcessParameters& parameters() const { return parameters_; }
  /// Variance of a value about the smooth part: nugget + 1 / lambda.
  double noise() const;
  double log_joint = 0.0;  ///< value of (3) at the mode, if fitted; before widen()
  double widened = 1.0;    ///< what widen() multiplied the variances by
  int evaluations = 0;     ///< of (3), while fitting
  /// leave_one_out(priors) with the widened variances, if widen() was called.
  Eigen::VectorXd left_out_mean, left_out_variance;
  std::vector<SelectionStep> selection;  ///< if fitted by forward selection
  std::vector<int> beta_of;  ///< inputs of the same number share a beta; P numbers, as in log_density()

 private:
  struct Slopes;
  Slopes slopes(const HyperPriors& priors, const Eigen::VectorXd& error) const;

  Eigen::VectorXd input_scale_;    // sqrt(-4 log beta_p)
  Eigen::MatrixXd scaled_inputs_;  // M x P: input p times sqrt(-4 log beta_p)
  Eigen::VectorXd values_;
  GaussianProcessParameters parameters_;
  Eigen::MatrixXd inverse_;       // of the covariance
  Eigen::MatrixXd root_inverse_;  // inverse of its Cholesky factor
  Eigen::VectorXd weights_;       // inverse times values
};

}  // namespace amiss
