#pragma once
#include <gtest/gtest.h>

#include "engine/ais/Sampler.hpp"
#include "helpers.hpp"

namespace amiss {
namespace test {

inline Context seeded(std::uint64_t seed, int threads = 1) {
  Context context;
  context.seed = seed;
  context.threads = threads;
  return context;
}

// y = A x + error of standard deviation s: evidence and posterior are known.
struct LinearGaussian {
  MatrixXd a;
  VectorXd y;
  double s;
  LinearGaussian(Index d, double sd) : a(normal_matrix(d + 4, d, 51)), s(sd) {
    y = a * normal_vector(d, 52) + s * normal_vector(d + 4, 53);
  }
  FunctionTarget target() const {
    return {a.cols(), [this](const VectorXd& x) {
              return -0.5 * (y - a * x).squaredNorm() / (s * s) -
                     static_cast<double>(y.size()) * (0.5 * kLogTwoPi + std::log(s));
            }};
  }
  double log_evidence() const {
    const MatrixXd noise = s * s * MatrixXd::Identity(y.size(), y.size());
    return log_normal_density(y, VectorXd::Zero(y.size()), a * a.transpose() + noise);
  }
  MatrixXd covariance() const {
    return (a.transpose() * a / (s * s) + MatrixXd::Identity(a.cols(), a.cols())).inverse();
  }
  VectorXd mean() const { return covariance() * a.transpose() * y / (s * s); }
};

// Four reported standard errors hold with certainty for practical purposes, and the error itself has to be
// far below a factor of two in a Bayes factor (0.69 nat).
inline void expect_evidence(const AisResult& result, double truth, double most = 0.15) {
  EXPECT_LT(std::abs(result.log_evidence - truth), 4 * result.standard_error);
  EXPECT_LT(std::abs(result.log_evidence - truth), most);
}

// The same posterior with its gradient.
class GradientTarget : public FunctionTarget {
 public:
  GradientTarget(const LinearGaussian& model, double slope)
      : FunctionTarget(model.target()), model_(model), slope_(slope) {}
  bool has_gradient() const override { return true; }
  using FunctionTarget::log_likelihood;
  VectorXd log_likelihood(const MatrixXd& x, MatrixXd& gradient) const override {
    gradient = slope_ * model_.a.transpose() * ((-model_.a * x).colwise() + model_.y) / (model_.s * model_.s);
    return log_likelihood(x);
  }

 private:
  const LinearGaussian& model_;
  double slope_;
};

}  // namespace test
}  // namespace amiss
