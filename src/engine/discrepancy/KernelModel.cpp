#include "engine/discrepancy/KernelModel.hpp"

#include <algorithm>
#include <boost/math/special_functions/beta.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/linalg/constants.hpp"
#include "engine/linalg/double_policy.hpp"
#include "engine/linalg/precedes.hpp"
#include "engine/random/Stream.hpp"
#include "engine/random/purposes.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kSmallestTail = 1e-15;  // of Phi; keeps logarithms finite
constexpr Index kColumnsAtOnce = 96;     // columns of the covariance built at once

double tail(double x) { return std::max(normal_cdf(x), kSmallestTail); }

// log(p) given both p and 1 - p.
double log_of(double p, double complement) { return p < 0.5 ? std::log(p) : std::log1p(-complement); }

// Columns of a condition are shifted and divided by the condition's largest range.
MatrixXd scale_to_unit(const MatrixXd& x, const std::vector<int>& condition) {
  const Eigen::RowVectorXd range = x.colwise().maxCoeff() - x.colwise().minCoeff();
  std::vector<double> width(condition.size(), 0.0);
  for (std::size_t j = 0; j < condition.size(); ++j) {
    double& widest = width[static_cast<std::size_t>(condition[j])];
    widest = std::max(widest, range[static_cast<Index>(j)]);
  }
  MatrixXd scaled = x.rowwise() - x.colwise().mean();
  for (std::size_t j = 0; j < condition.size(); ++j) {
    const double widest = width[static_cast<std::size_t>(condition[j])];
    if (widest > 0) scaled.col(static_cast<Index>(j)) /= widest;  // else constant: distances are zero
  }
  return scaled;
}

}  // namespace

void BetaPrior::check() const {
  if (!(a > 0) || !(b > 0) || !std::isfinite(a) || !std::isfinite(b))
    throw std::invalid_argument("kernel: both shapes of a beta prior must be positive");
}

double BetaPrior::Quantile::log() const { return log_of(value, complement); }

BetaPrior::Quantile BetaPrior::quantile(double x) const {
  const double lower = tail(x), upper = tail(-x);
  Quantile q;
  if (a == 1.0) {
    const double log_complement = log_of(upper, lower) / b;
    q.complement = std::exp(log_complement);
    q.value = -std::expm1(log_complement);
  } else if (b == 1.0) {
    const double log_value = log_of(lower, upper) / a;
    q.value = std::exp(log_value);
    q.complement = -std::expm1(log_value);
  } else if (lower < upper) {
    q.value = boost::math::ibeta_inv(a, b, lower, &q.complement, DoublePolicy());
  } else {
    q.value = boost::math::ibetac_inv(a, b, upper, &q.complement, DoublePolicy());
  }
  const double least = std::numeric_limits<double>::min();
  q.value = std::max(q.value, least);
  q.complement = std::max(q.complement, least);
  return q;
}

void NoisePrior::check() const {
  if (!(sd > 0) || !std::isfinite(sd)) throw std::invalid_argument("noise: sd must be positive");
  if (!(shape > 0) || !std::isfinite(shape)) throw std::invalid_argument("noise: shape must be positive");
}

double NoisePrior::precision(double x) const {
  const double lower = tail(x), upper = tail(-x);
  const double scaled = lower < upper ? boost::math::gamma_p_inv(shape, lower, DoublePolicy())
                                      : boost::math::gamma_q_inv(shape, upper, DoublePolicy());
  return std::max(scaled, std::numeric_limits<double>::min()) / (shape * sd * sd);
}

void KernelPriors::check() const {
  alpha.check();
  t2.check();
  if (!(unit > 0) || !std::isfinite(unit)) throw std::invalid_argument("kernel: unit must be positive");
  noise.check();
}

int KernelData::count() const {
  return condition.empty() ? 0 : 1 + *std::max_element(condition.begin(), condition.end());
}

void KernelData::check() const {
  const Index n = y.size();
  if (basis.rows() != n || conditions.rows() != n || fictitious.size() != n)
    throw std::invalid_argument("kernel: lengths differ");
  if (static_cast<Index>(condition.size()) != conditions.cols())
    throw std::invalid_argument("kernel: a condition is needed for each column");
  const int s = count();
  for (int i = 0; i < s; ++i) {
    if (std::find(condition.begin(), condition.end(), i) == condition.end())
      throw std::invalid_argument("kernel: conditions must be numbered 0 ... S-1");
  }
  if (!condition.empty() && *std::min_element(condition.begin(), condition.end()) < 0)
    throw std::invalid_argument("kernel: negative condition");
  if (basis.cols() >= n)
    throw std::invalid_argument("kernel: the basis spans the whole record, nothing is left outside it");
  if (!y.allFinite() || !basis.allFinite() || !conditions.allFinite() || !fictitious.allFinite())
    throw std::invalid_argument("kernel: every value must be finite");
}

VectorXd fictitious_condition(Index n, std::uint64_t seed) { return Stream(seed, kFictitious, 0).normals(n); }

KernelModel::KernelModel(KernelData data, KernelPriors priors) : priors_(priors), conditions_(data.count()) {
  data.check();
  priors_.check();
  const Index n = data.y.size(), q = data.basis.cols();
  sort_rows(data);
  condition_ = data.condition;
  condition_.push_back(conditions_);
  MatrixXd all(n, data.conditions.cols() + 1);
  all << data.conditions, data.fictitious;
  columns_ = scale_to_unit(all, condition_);
  squares_ = columns_.cwiseAbs2();
  sort_conditions();

  // Columns scaled to unit norm first, so that their very different sizes do not cost accuracy.
  data.basis.array().rowwise() /= data.basis.colwise().norm().array();
  const Eigen::HouseholderQR<MatrixXd> qr(data.basis);
  if (q > 0 && !(qr.matrixQR().diagonal().cwiseAbs().minCoeff() > 1e-10))
    throw std::invalid_argument("kernel: the columns of the basis are linearly dependent");
  orthonormal_ = qr.householderQ() * MatrixXd::Identity(n, q);
  outside_ = data.y - orthonormal_ * (orthonormal_.transpose() * data.y);
  outside_ -= orthonormal_ * (orthonormal_.transpose() * outside_);
}

KernelModel KernelModel::thinned(Index k) const {
  KernelModel out = *this;
  const Index n = (size() + k - 1) / k;
  MatrixXd basis(n, orthonormal_.cols());
  out.columns_.resize(n, columns_.cols());
  out.outside_.resize(n);
  for (Index i = 0; i < n; ++i) {
    out.columns_.row(i) = columns_.row(i * k);
    out.outside_[i] = outside_[i * k];
    basis.row(i) = orthonormal_.row(i * k);
  }
  out.squares_ = out.columns_.cwiseAbs2();
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(basis);
  const MatrixXd q = qr.householderQ() * MatrixXd::Identity(n, std::min(n, basis.cols()));
  out.orthonormal_ = q.leftCols(qr.rank());
  // What is measured differs from Hv by a vector of the simulation space alone.
  out.outside_ -= out.orthonormal_ * (out.orthonormal_.transpose() * out.outside_);
  out.row_.clear();
  for (Index i = 0; i < n; ++i) out.row_.push_back(i);
  return out;
}

// Time steps by what was measured.
void KernelModel::sort_rows(KernelData& data) {
  const Index n = data.y.size();
  row_.resize(static_cast<std::size_t>(n));
  std::iota(row_.begin(), row_.end(), Index{0});
  std::stable_sort(row_.begin(), row_.end(), [&](Index a, Index b) { return data.y[a] < data.y[b]; });
  const KernelData given = data;
  for (Index i = 0; i < n; ++i) {
    const Index from = row_[static_cast<std::size_t>(i)];
    data.y[i] = given.y[from];
    data.fictitious[i] = given.fictitious[from];
    data.basis.row(i) = given.basis.row(from);
    data.conditions.row(i) = given.conditions.row(from);
  }
}

// Conditions by their first columns, the fictitious one last.
void KernelModel::sort_conditions() {
  const auto column = [&](int s) {
    return columns_.col(std::find(condition_.begin(), condition_.end(), s) - condition_.begin());
  };
  order_.resize(static_cast<std::size_t>(conditions_));
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(),
                   [&](int a, int b) { return precedes(column(a), column(b)); });
  order_.push_back(conditions_);
}

bool KernelModel::factorise(const KernelParameters& p, Memory& work) const {
  const double ratio = p.amplitude * p.lambda;
  if (!(ratio <= largest_ratio)) return false;
  const Index n = size(), q = orthonormal_.cols(), c = columns_.cols();
  VectorXd decay(c);
  for (Index j = 0; j < c; ++j) decay[j] = p.decay[condition_[static_cast<std::size_t>(j)]];

  // log(ratio) - sum_s decay_s (x_is - x_js)^2 = left_i'right_j, one product; only the lower triangle is
  // made.
  MatrixXd left(n, c + 2), right(n, c + 2);
  left.leftCols(c) = columns_ * (2.0 * decay).asDiagonal();
  left.col(c) = -(squares_ * decay);
  left.col(c + 1).setOnes();
  right.leftCols(c) = columns_;
  right.col(c).setOnes();
  right.col(c + 1) = left.col(c).array() + std::log(ratio);
  work.b.resize(n, n);
  for (Index j = 0; j < n; j += kColumnsAtOnce) {
    const Index width = std::min(kColumnsAtOnce, n - j);
    auto block = work.b.block(j, j, n - j, width);
    block.noalias() = left.bottomRows(n - j) * right.middleRows(j, width).transpose();
    block.array() = block.array().exp();
  }
  work.b.diagonal().setConstant(1.0 + ratio);

  const Eigen::LLT<Eigen::Ref<MatrixXd>, Eigen::Lower> factor(work.b);
  if (factor.info() != Eigen::Success) return false;
  work.half.resize(n, q + 1);
  work.half << orthonormal_, outside_;
  factor.matrixL().solveInPlace(work.half);
  const MatrixXd gram = work.half.leftCols(q).transpose() * work.half.leftCols(q);
  const Eigen::LLT<MatrixXd, Eigen::Lower> small(gram);
  if (q > 0 && small.info() != Eigen::Success) return false;
  work.root = small.matrixL();
  work.project = work.half.leftCols(q).transpose() * work.half.col(q);
  if (q > 0) small.matrixL().solveInPlace(work.project);
  work.log_det = 2.0 * (work.b.diagonal().array().log().sum() + work.root.diagonal().array().log().sum());
  work.quadratic = work.half.col(q).squaredNorm() - work.project.squaredNorm();
  return true;
}

double KernelModel::log_likelihood(const KernelParameters& parameters) const {
  Memory memory;
  return log_likelihood(parameters, memory);
}

// |H'AH| = lambda*^-(N-Q) |H'BH|.
double KernelModel::log_likelihood(const KernelParameters& parameters, Memory& memory) const {
  if (!factorise(parameters, memory)) return -std::numeric_limits<double>::infinity();
  const double n = static_cast<double>(size() - orthonormal_.cols()), lambda = parameters.lambda;
  return -0.5 * (n * (kLogTwoPi - std::log(lambda)) + memory.log_det + lambda * memory.quadratic);
}

Eigen::VectorXd KernelModel::in_given_order(const VectorXd& by_row) const {
  VectorXd given(size());
  for (Index i = 0; i < size(); ++i) given[row_[static_cast<std::size_t>(i)]] = by_row[i];
  return given;
}

// H'zeta H (H'AH)^-1 v = v - (H'BH)^-1 v, and H (H'BH)^-1 v = B^-1 (Hv - O beta), beta = (O'B^-1 O)^-1 O'B^-1
// Hv. With B^-1 = L^-T L^-1 and W = L^-1 O, H (H'BH)^-1 H' = L^-T (I - W (W'W)^-1 W') L^-1.
KernelDiscrepancy KernelModel::discrepancy(const KernelParameters& parameters) const {
  Memory work;
  if (!factorise(parameters, work))
    throw std::runtime_error("kernel: covariance of the discrepancy is not positive definite");
  const Index n = size(), q = orthonormal_.cols();
  const VectorXd beta = work.root.transpose().triangularView<Eigen::Upper>().solve(work.project);
  VectorXd rest = work.half.col(q) - work.half.leftCols(q) * beta;
  work.b.triangularView<Eigen::Lower>().transpose().solveInPlace(rest);
  MatrixXd inverse = MatrixXd::Identity(n, n);
  work.b.triangularView<Eigen::Lower>().solveInPlace(inverse);
  MatrixXd within = work.half.leftCols(q).transpose() * inverse;
  work.root.triangularView<Eigen::Lower>().solveInPlace(within);
  const VectorXd unexplained = inverse.colwise().squaredNorm() - within.colwise().squaredNorm();
  const VectorXd outside = VectorXd::Ones(n) - orthonormal_.rowwise().squaredNorm();
  return {in_given_order(outside_ - rest),
          in_given_order((outside - unexplained).cwiseMax(0.0) / parameters.lambda)};
}

KernelParameters KernelTarget::parameters(const VectorXd& x) const {
  const KernelPriors& priors = model_.priors();
  const Index s = model_.conditions() + 1;
  KernelParameters p;
  p.decay.resize(s);
  for (Index i = 0; i < s; ++i)
    p.decay[model_.order()[static_cast<std::size_t>(i)]] = -4.0 * priors.alpha.quantile(x[i]).log();
  const BetaPrior::Quantile t2 = priors.t2.quantile(x[s]);
  p.amplitude = priors.unit * priors.unit * (t2.complement / t2.value);
  p.lambda = priors.noise.precision(x[s + 1]);
  return p;
}

VectorXd KernelTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values(x.cols());
  KernelModel::Memory memory;
  for (Index i = 0; i < x.cols(); ++i) values[i] = model_.log_likelihood(parameters(x.col(i)), memory);
  return values;
}

}  // namespace amiss
