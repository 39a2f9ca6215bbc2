#include "engine/discrepancy/LowRankKernel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/linalg/GaussianKernel.hpp"
#include "engine/linalg/constants.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kExtensions = 3;  // of a factor whose certificate is not yet good enough
// Up to this share of N a low rank costs less than the dense factor, and in a short record hardly ever:
// measured.
constexpr double kCheap = 0.33;
constexpr Index kSmall = 600;
constexpr Index kRows = 1024;       // taken at a time
constexpr double kAccurate = 1e-3;  // share of the noise by which the discrepancy may be wrong

Index cheap_rank(const KernelModel& model) {
  return static_cast<Index>(kCheap * static_cast<double>(model.size()));
}

// Conditions times the root of their decays: zeta is a Gaussian kernel in them.
MatrixXd scaled(const MatrixXd& columns, const std::vector<int>& condition, const VectorXd& decay) {
  MatrixXd x = columns;
  for (Index j = 0; j < x.cols(); ++j) x.col(j) *= std::sqrt(decay[condition[static_cast<std::size_t>(j)]]);
  return x;
}

double log_density(double dimension, double lambda, double log_det, double quadratic) {
  return -0.5 * (dimension * (kLogTwoPi - std::log(lambda)) + log_det + lambda * quadratic);
}

// log|I + r G| and, given b, what the discrepancy explains: r b'(I + r G)^-1 b. Of G the lower triangle,
// which is overwritten.
struct Inside {
  double log_det, explained;
  VectorXd weights;  // r (I + r G)^-1 b
};

Inside inside(Eigen::Ref<MatrixXd> gram, const VectorXd& b, double ratio) {
  gram.triangularView<Eigen::Lower>() *= ratio;
  gram.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::Ref<MatrixXd>, Eigen::Lower> factor(gram);
  const VectorXd weights = ratio * factor.solve(b);
  return {2.0 * gram.diagonal().array().log().sum(), b.dot(weights), weights};
}

// Lower triangle of F'F, F = (I - OO') L, given L (`root`), O and O'L (`within`). Some rows at a time: F
// would need the memory of L once more.
MatrixXd gram_outside(const Eigen::Ref<const MatrixXd>& root, const MatrixXd& basis, const MatrixXd& within) {
  MatrixXd gram = MatrixXd::Zero(root.cols(), root.cols()), some;
  for (Index i = 0; i < root.rows(); i += kRows) {
    const Index n = std::min(kRows, root.rows() - i);
    some = root.middleRows(i, n);
    some.noalias() -= basis.middleRows(i, n) * within;
    gram.selfadjointView<Eigen::Lower>().rankUpdate(some.transpose());
  }
  return gram;
}

}  // namespace

std::optional<BoundedValue> low_rank_likelihood(const KernelModel& model, const KernelParameters& p,
                                                double tolerance, Certificate certificate, Index max_rank) {
  const double ratio = p.amplitude * p.lambda;
  const double infinity = std::numeric_limits<double>::infinity();
  if (!(ratio <= KernelModel::largest_ratio)) return BoundedValue{-infinity, 0.0, 0.0};
  PivotedCholesky cholesky(scaled(model.columns(), model.condition(), p.decay));
  const MatrixXd& basis = model.orthonormal();
  const double dimension = static_cast<double>(model.size() - basis.cols());
  double trace = 2.0 * tolerance / ratio;
  for (int i = 0;; ++i) {
    if (!cholesky.extend(trace, max_rank)) return std::nullopt;
    const auto root = cholesky.root();
    const MatrixXd within = basis.transpose() * root;
    MatrixXd gram = gram_outside(root, basis, within);
    const Inside part = inside(gram, root.transpose() * model.outside(), ratio);
    const VectorXd w = model.outside() - root * part.weights + basis * (within * part.weights);
    const double quadratic = model.outside().squaredNorm() - part.explained;
    const double below = 0.5 * ratio * cholesky.trace();
    const double above = p.lambda * below * w.squaredNorm();
    const double reached = certificate == Certificate::determinant ? below : below + above;
    // A remainder that is rounding cannot be brought down further.
    if (reached <= tolerance || i == kExtensions || cholesky.trace() < 1e-3 * trace)
      return BoundedValue{log_density(dimension, p.lambda, part.log_det, quadratic), below, above};
    trace *= 0.5 * tolerance / reached;
  }
}

std::optional<KernelDiscrepancy> low_rank_discrepancy(const KernelModel& model, const KernelParameters& p,
                                                      double tolerance, Index max_rank) {
  const double ratio = p.amplitude * p.lambda;
  PivotedCholesky cholesky(scaled(model.columns(), model.condition(), p.decay));
  if (!(ratio <= KernelModel::largest_ratio) || !cholesky.extend(tolerance / ratio, max_rank))
    return std::nullopt;
  const MatrixXd& basis = model.orthonormal();
  MatrixXd f = cholesky.root();
  f.noalias() -= basis * (basis.transpose() * cholesky.root()).eval();
  MatrixXd gram = MatrixXd::Identity(f.cols(), f.cols());
  gram.selfadjointView<Eigen::Lower>().rankUpdate(f.transpose(), ratio);
  const Eigen::LLT<Eigen::Ref<MatrixXd>, Eigen::Lower> factor(gram);
  const VectorXd mean = ratio * (f * factor.solve(f.transpose() * model.outside()));
  factor.matrixL().transpose().solveInPlace<Eigen::OnTheRight>(f);
  return KernelDiscrepancy{model.in_given_order(mean),
                           model.in_given_order(p.amplitude * f.rowwise().squaredNorm())};
}

std::vector<KernelDiscrepancy> discrepancies(const KernelModel& model,
                                             const std::vector<KernelParameters>& draws,
                                             const Context& context) {
  std::vector<KernelDiscrepancy> out(draws.size());
  parallel_for(static_cast<int>(draws.size()), context, [&](int k) {
    const auto at = static_cast<std::size_t>(k);
    std::optional<KernelDiscrepancy> found;
    if (model.size() >= kSmall) found = low_rank_discrepancy(model, draws[at], kAccurate, cheap_rank(model));
    out[at] = found ? std::move(*found) : model.discrepancy(draws[at]);
  });
  return out;
}

BoundedValue bounded_likelihood(const KernelModel& model, const KernelParameters& parameters,
                                double tolerance, Certificate certificate, KernelModel::Memory& memory) {
  if (model.size() >= kSmall) {
    if (const auto value = low_rank_likelihood(model, parameters, tolerance, certificate, cheap_rank(model)))
      return *value;
  }
  return {model.log_likelihood(parameters, memory), 0.0, 0.0};
}

std::optional<KernelSkeleton> KernelSkeleton::make(const KernelModel& model, const VectorXd& decay,
                                                   double ratio, double tolerance, Index max_rank) {
  PivotedCholesky cholesky(scaled(model.columns(), model.condition(), decay));
  if (!cholesky.extend(tolerance / ratio, max_rank)) return std::nullopt;
  return KernelSkeleton(model, decay, ratio, tolerance, std::move(cholesky));
}

KernelSkeleton::KernelSkeleton(const KernelModel& model, VectorXd decay, double ratio, double tolerance,
                               PivotedCholesky cholesky)
    : decay_(std::move(decay)), ratio_(ratio), tolerance_(tolerance), condition_(model.condition()) {
  const std::vector<Index> rows = cholesky.pivots();
  const Index m = cholesky.rank();
  VectorXd memory = std::move(cholesky).take_root();
  Eigen::Map<MatrixXd> u(memory.data(), model.size(), m);
  MatrixXd at_pivots(m, m);
  pivots_.resize(m, model.columns().cols());
  for (Index i = 0; i < m; ++i) {
    at_pivots.row(i) = u.row(rows[static_cast<std::size_t>(i)]);
    pivots_.row(i) = model.columns().row(rows[static_cast<std::size_t>(i)]);
  }
  // U = C_:I C_II^-1 = L L_I^-1, L_I lower triangular in the order of the pivots.
  at_pivots.triangularView<Eigen::Lower>().solveInPlace<Eigen::OnTheRight>(u);
  u.noalias() -= model.orthonormal() * (model.orthonormal().transpose() * u).eval();
  projected_ = u.transpose() * model.outside();
  // In the place of U, which is large for a long record.
  root_ = Eigen::HouseholderQR<Eigen::Ref<MatrixXd>>(u).matrixQR().topRows(m).triangularView<Eigen::Upper>();
  square_ = model.outside().squaredNorm();
  dimension_ = static_cast<double>(model.size() - model.orthonormal().cols());
}

bool KernelSkeleton::serves(const KernelParameters& p) const {
  return p.amplitude * p.lambda <= ratio_ && (p.decay.array() <= decay_.array()).all();
}

double KernelSkeleton::log_likelihood(const KernelParameters& p, Memory& memory) const {
  const double ratio = p.amplitude * p.lambda;
  memory.cholesky.start(scaled(pivots_, condition_, p.decay));
  memory.cholesky.extend(0.1 * tolerance_ / ratio, rank());
  const auto root = memory.cholesky.root();
  auto product = memory.product.matrix(rank(), root.cols());
  product.noalias() = root_.triangularView<Eigen::Upper>() * root;
  auto gram = memory.gram.matrix(root.cols(), root.cols());
  gram.triangularView<Eigen::Lower>().setZero();
  gram.selfadjointView<Eigen::Lower>().rankUpdate(product.transpose());
  const Inside part = inside(gram, root.transpose() * projected_, ratio);
  return log_density(dimension_, p.lambda, part.log_det, square_ - part.explained);
}

}  // namespace amiss
