#include "engine/discrepancy/HistoryModel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include "engine/linalg/constants.hpp"
#include "engine/linalg/triangular.hpp"
#include "engine/parallel/parallel_for.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kBlock = 2048;     // rows of a long record that are whitened at once
constexpr double kLargest = 1e75;  // of values, also beside the noise: their fourth powers are numbers
// Of the noise variance: below, its quantiles leave the range of numbers; above, they take seconds.
constexpr double kLeastShape = 0.01, kLargestShape = 1e8;
constexpr double kFaintest = 1e-4;  // of kappa sigma_0^2: directions with less are withheld by 1e-8 of them

// Gram matrix of W [K / norms, Phi, directions, r] in blocks of rows.
MatrixXd whitened_gram(const MatrixXd& basis, const VectorXd& norms, const MatrixXd& responses,
                       const MatrixXd& directions, const VectorXd& residual, const Whitener& whitener) {
  const Index n = residual.size(), q = basis.cols(), columns = q + responses.cols() + directions.cols() + 1;
  MatrixXd gram = MatrixXd::Zero(columns, columns), block, state;
  for (Index first = 0; first < n; first += kBlock) {
    const Index rows = std::min(kBlock, n - first);
    block.resize(rows, columns);
    block << basis.middleRows(first, rows), responses.middleRows(first, rows),
        directions.middleRows(first, rows), residual.segment(first, rows);
    block.leftCols(q).array().rowwise() /= norms.transpose().array();
    block = whitener.rows(block, first, state);
    gram.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
  }
  return gram.selfadjointView<Eigen::Lower>();
}

VectorXd column_norms(const MatrixXd& basis) { return basis.colwise().norm().transpose(); }

}  // namespace

// The setting without restraint, and the products of the directions with all of it.
struct HistoryModel::FreeGram {
  WhitenedData data;
  MatrixXd directions;  // U' W'W U
  MatrixXd mixed;       // [K, Phi]' W'W U
  VectorXd cross;       // U' W'W r0

  // Psi = Phi - U X in place of Phi.
  WhitenedData restrained(const MatrixXd& x) const {
    WhitenedData out = data;
    if (x.isZero(0.0)) return out;
    const Index q = data.coefficients, p = data.cross.size() - q;
    const MatrixXd left = mixed.topRows(q) * x, half = mixed.bottomRows(p) * x;
    const MatrixXd left_over =
        data.gram.bottomRightCorner(p, p) - half - half.transpose() + x.transpose() * directions * x;
    out.gram.bottomRightCorner(p, p) = 0.5 * (left_over + left_over.transpose());
    out.gram.topRightCorner(q, p) -= left;
    out.gram.bottomLeftCorner(p, q) = out.gram.topRightCorner(q, p).transpose();
    out.cross.tail(p) -= x.transpose() * cross;
    return out;
  }
};

int HistoryData::conditions() const {
  return condition.empty() ? 0 : 1 + *std::max_element(condition.begin(), condition.end());
}

void HistoryData::check(double noise_sd) const {
  axis.check();
  const Index n = y.size();
  if (basis.rows() != n || responses.rows() != n || axis.size() != n)
    throw std::invalid_argument("history: lengths differ");
  if (static_cast<Index>(condition.size()) != responses.cols())
    throw std::invalid_argument("history: a condition is needed for each column");
  if (!condition.empty() && *std::min_element(condition.begin(), condition.end()) < 0)
    throw std::invalid_argument("history: negative condition");
  if (basis.cols() >= n)
    throw std::invalid_argument("history: the record has " + std::to_string(n) + " rows, no more than the " +
                                std::to_string(basis.cols()) + " basis vectors");
  if (basis.cols() > 0 && !(column_norms(basis).minCoeff() > 0))
    throw std::invalid_argument("history: a column of the basis is zero");
  if (moves.size() > 0 && moves.rows() != n)
    throw std::invalid_argument("history: the simulator's moves need one row for each of the record");
  const double largest = kLargest * std::min(1.0, noise_sd);
  const auto in_range = [&](const auto& values) { return (values.array().abs() <= largest).all(); };
  if (!in_range(y) || !in_range(basis) || !in_range(responses) || !in_range(moves))
    throw std::invalid_argument(
        "history: record, basis, responses and moves must be finite, at most 1e75 and 1e75 noise_sd");
}

void HistoryPriors::check() const {
  if (!(noise_sd >= 1.0 / kLargest && noise_sd <= kLargest))
    throw std::invalid_argument("history: noise_sd must lie in [1e-75, 1e75]");
  if (!(noise_shape >= kLeastShape && noise_shape <= kLargestShape))
    throw std::invalid_argument("history: noise_shape must lie in [0.01, 1e8]");
  if (!(discarded_variance >= 0))
    throw std::invalid_argument("history: discarded_variance must not be negative");
  if (!std::isfinite(discarded_variance) || !std::isfinite(amplitude))
    throw std::invalid_argument("history: discarded_variance and amplitude must be finite");
  if (!(inclusion > 0 && inclusion <= 1))
    throw std::invalid_argument("history: inclusion must lie in (0, 1]");
  if (!(amplitude > 0)) throw std::invalid_argument("history: amplitude must be positive");
  if (reach.empty() || !std::all_of(reach.begin(), reach.end(), [](double k) { return k > 0; }))
    throw std::invalid_argument("history: reach needs positive values");
  error.check();
}

WhitenedData WhitenedData::in_terms_of(const VectorXd& shift, const MatrixXd& root) const {
  const Index q = coefficients, p = cross.size() - q, r = root.cols();
  WhitenedData out;
  out.coefficients = r;
  out.size = size;
  out.log_det = log_det;
  out.gram.resize(r + p, r + p);
  const MatrixXd mixed = gram.leftCols(q) * root;  // (Q + p) x r
  out.gram.topLeftCorner(r, r).noalias() = root.transpose() * mixed.topRows(q);
  out.gram.bottomLeftCorner(p, r) = mixed.bottomRows(p);
  out.gram.topRightCorner(r, p) = mixed.bottomRows(p).transpose();
  out.gram.bottomRightCorner(p, p) = gram.bottomRightCorner(p, p);
  const VectorXd left = cross - gram.leftCols(q) * shift;
  out.cross.resize(r + p);
  out.cross << root.transpose() * left.head(q), left.tail(p);
  out.square = square - shift.dot(cross.head(q) + left.head(q));
  return out;
}

HistoryModel::HistoryModel(HistoryData data, HistoryPriors priors, const Context& context,
                           const std::vector<int>& only)
    : data_(std::move(data)), priors_(std::move(priors)), conditions_(data_.conditions()) {
  priors_.check();
  data_.check(priors_.noise_sd);
  if (data_.moves.size() == 0) data_.moves.resize(data_.y.size(), 0);
  find_directions();
  columns_ = VectorXd::Zero(conditions_);
  for (int s : data_.condition) columns_[s] += 1.0;
  centre_ = data_.responses.colwise().mean();
  data_.responses.rowwise() -= centre_;
  scale_ = (data_.responses.colwise().squaredNorm() / static_cast<double>(std::max<Index>(1, data_.y.size())))
               .cwiseSqrt();
  VectorXd size = VectorXd::Zero(conditions_);  // of each condition, in its own unit
  for (Index j = 0; j < scale_.size(); ++j) {
    double& largest = size[data_.condition[static_cast<std::size_t>(j)]];
    largest = std::max(largest, std::abs(centre_[j]) + scale_[j]);
  }
  for (Index j = 0; j < scale_.size(); ++j) {
    const double largest = size[data_.condition[static_cast<std::size_t>(j)]];
    if (!(scale_[j] > 1e-12 * largest)) scale_[j] = 1.0;  // constant: its column is zero
  }
  data_.responses.array().rowwise() /= scale_.array();
  norms_ = column_norms(data_.basis);
  const MatrixXd scaled = data_.basis * norms_.cwiseInverse().asDiagonal();
  reference_ = norms_.cwiseInverse().cwiseProduct(VectorXd(scaled.householderQr().solve(data_.y)));
  residual_ = data_.y - data_.basis * reference_;
  const int errors = error_settings(), reaches = static_cast<int>(priors_.reach.size());
  std::vector<MatrixXd> held;
  for (double reach : priors_.reach) held.push_back(along_directions(reach, data_.responses));
  settings_.resize(static_cast<std::size_t>(errors * reaches));
  std::vector<bool> wanted(static_cast<std::size_t>(errors), only.empty());
  for (int setting : only) wanted[static_cast<std::size_t>(error_of(setting))] = true;
  parallel_for(errors, context, [&](int g) {
    if (!wanted[static_cast<std::size_t>(g)]) return;
    const FreeGram free = whiten_freely(g, data_.responses);
    for (int k = 0; k < reaches; ++k)
      settings_[static_cast<std::size_t>(k * errors + g)] =
          free.restrained(held[static_cast<std::size_t>(k)]);
  });
}

// The directions in which the simulator moves enough that some reach of the grid withholds them.
void HistoryModel::find_directions() {
  const double least = *std::min_element(priors_.reach.begin(), priors_.reach.end());
  const double c = least * priors_.noise_sd * priors_.noise_sd;
  std::vector<Index> kept;
  Eigen::SelfAdjointEigenSolver<MatrixXd> eigen;
  if (data_.moves.cols() > 0 && std::isfinite(c)) {
    eigen.compute(data_.moves.transpose() * data_.moves);
    for (Index j = data_.moves.cols() - 1; j >= 0; --j) {
      if (eigen.eigenvalues()[j] > kFaintest * c) kept.push_back(j);
    }
  }
  const Index r = static_cast<Index>(kept.size());
  of_moves_.resize(data_.moves.cols(), r);
  energy_.resize(r);
  for (Index j = 0; j < r; ++j) {
    energy_[j] = eigen.eigenvalues()[kept[static_cast<std::size_t>(j)]];
    of_moves_.col(j) = eigen.eigenvectors().col(kept[static_cast<std::size_t>(j)]) / std::sqrt(energy_[j]);
  }
  directions_ = data_.moves * of_moves_;
}

// With the left singular vectors U of E and its squared singular values lambda,
//     (I + (E E' / c)^2)^-1 = I - U diag(lambda^2 / (lambda^2 + c^2)) U',   c = kappa sigma_0^2.
MatrixXd HistoryModel::along_directions(double reach, const MatrixXd& responses) const {
  if (std::isinf(reach)) return MatrixXd::Zero(energy_.size(), responses.cols());
  const double c = reach * priors_.noise_sd * priors_.noise_sd;
  const VectorXd share = energy_.square() / (energy_.square() + c * c);
  return share.asDiagonal() * (directions_.transpose() * responses);
}

MatrixXd HistoryModel::withheld(int setting) const {
  return of_moves_ * along_directions(reach_of(setting), data_.responses);
}

HistoryModel::FreeGram HistoryModel::whiten_freely(int error, const MatrixXd& responses) const {
  const Whitener whitener(data_.axis, priors_.error.correlation_times, priors_.error.setting(error));
  const Index q = data_.basis.cols(), p = responses.cols(), r = directions_.cols();
  // Columns of the basis scaled to unit norm first, so that their very different sizes do not cost accuracy.
  MatrixXd gram = whitened_gram(data_.basis, norms_, responses, directions_, residual_, whitener);
  gram.topRows(q).array().colwise() *= norms_.array();
  gram.leftCols(q).array().rowwise() *= norms_.transpose().array();
  FreeGram out;
  out.data.gram = gram.topLeftCorner(q + p, q + p);
  out.data.cross = gram.col(q + p + r).head(q + p);
  out.data.square = gram(q + p + r, q + p + r);
  out.data.log_det = whitener.log_det();
  out.data.size = data_.y.size();
  out.data.coefficients = q;
  out.mixed = gram.block(0, q + p, q + p, r);
  out.directions = gram.block(q + p, q + p, r, r);
  out.cross = gram.col(q + p + r).segment(q + p, r);
  return out;
}

WhitenedData HistoryModel::whiten(int setting, const MatrixXd& responses) const {
  return whiten_freely(error_of(setting), responses)
      .restrained(along_directions(reach_of(setting), responses));
}

// Runs of one setting share the whitened responses. With r = y - run in place of r0 and no coefficients.
VectorXd HistoryModel::log_likelihood_of_runs(const std::vector<HistoryParameters>& points,
                                              const MatrixXd& runs, const Context& context) const {
  std::map<int, std::vector<Index>> of_setting;
  for (std::size_t i = 0; i < points.size(); ++i)
    of_setting[points[i].setting].push_back(static_cast<Index>(i));
  const std::vector<std::pair<int, std::vector<Index>>> groups(of_setting.begin(), of_setting.end());
  const Index p = data_.responses.cols();
  const Index of_each = static_cast<Index>(points.size()) / std::max<Index>(1, runs.cols());
  VectorXd values(static_cast<Index>(points.size()));
  parallel_for(static_cast<int>(groups.size()), context, [&](int k) {
    const auto& [setting, members] = groups[static_cast<std::size_t>(k)];
    const Whitener whitener(data_.axis, priors_.error.correlation_times,
                            priors_.error.setting(error_of(setting)));
    const MatrixXd responses = data_.responses - data_.moves * withheld(setting);
    const MatrixXd white = whitener(responses);
    WhitenedData seen;
    seen.gram = whitened(setting).gram.bottomRightCorner(p, p);
    seen.log_det = whitener.log_det();
    seen.size = data_.y.size();
    for (Index i : members) {
      const VectorXd left = whitener(data_.y - runs.col(i / of_each));
      seen.cross = white.transpose() * left;
      seen.square = left.squaredNorm();
      const HistoryParameters& point = points[static_cast<std::size_t>(i)];
      values[i] = log_likelihood(seen, std::log(point.variance), point.t);
    }
  });
  return values;
}

// F = LL' and L^-1 b of the columns that act: all of the simulator's, and the responses with t_s > 0.
struct HistoryModel::Factor {
  std::vector<Index> kept;
  VectorXd root;                             // D^1/2
  Eigen::LLT<MatrixXd, Eigen::Lower> lower;  // L
  VectorXd half;                             // L^-1 b
  double largest = 1.0;                      // on the diagonal of F
};

HistoryModel::Factor HistoryModel::factorise(const WhitenedData& whitened, double precision,
                                             const VectorXd& t, const VectorXd& root,
                                             const VectorXd& cross) const {
  const Index q = whitened.coefficients;
  Factor out;
  for (Index j = 0; j < q; ++j) out.kept.push_back(j);
  for (std::size_t j = 0; j < data_.condition.size(); ++j) {
    if (t[data_.condition[j]] > 0) out.kept.push_back(q + static_cast<Index>(j));
  }
  const Index n = static_cast<Index>(out.kept.size());
  out.root.resize(n);
  VectorXd b(n);
  MatrixXd matrix(n, n);
  for (Index j = 0; j < n; ++j) {
    const Index column = out.kept[j];
    if (column < q) {
      out.root[j] = root[column];
    } else {
      const int s = data_.condition[static_cast<std::size_t>(column - q)];
      out.root[j] = std::sqrt(t[s] / columns_[s]);
    }
    b[j] = out.root[j] * cross[column];
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i)
      matrix(i, j) = precision * out.root[i] * out.root[j] * whitened.gram(out.kept[i], out.kept[j]);
    matrix(j, j) += 1.0;
  }
  if (n > 0) out.largest = matrix.diagonal().maxCoeff();
  out.lower.compute(matrix);
  out.half = out.lower.matrixL().solve(b);
  return out;
}

// Cross products and square of r0 - K shift in place of r0.
VectorXd HistoryModel::shifted_cross(const WhitenedData& whitened, const VectorXd& shift,
                                     double& square) const {
  const Index q = whitened.coefficients;
  const VectorXd cross = whitened.cross - whitened.gram.leftCols(q) * shift;
  square = whitened.square - shift.dot(whitened.cross.head(q) + cross.head(q));
  return cross;
}

namespace {

// Beyond it the unit of I + ... is lost to rounding, and with it the factor: far out in the tail of an
// amplitude.
constexpr double kLargestPivot = 1e12;

double log_density(const WhitenedData& whitened, double log_variance, double square, const MatrixXd& lower,
                   const VectorXd& half, double largest) {
  if (!(largest < kLargestPivot)) return -std::numeric_limits<double>::infinity();
  const double precision = std::exp(-log_variance);
  const double log_det = 2.0 * lower.diagonal().array().log().sum();
  const double quadratic = precision * (square - precision * half.squaredNorm());
  if (!(quadratic >= 0)) return -std::numeric_limits<double>::infinity();
  const double n = static_cast<double>(whitened.size);
  return whitened.log_det - 0.5 * (n * (kLogTwoPi + log_variance) + log_det + quadratic);
}

}  // namespace

double HistoryModel::log_likelihood(const HistoryParameters& point, const VectorXd& mean,
                                    const VectorXd& variance) const {
  const WhitenedData& seen = whitened(point.setting);
  double square = 0.0;
  const VectorXd cross = shifted_cross(seen, mean - reference_, square);
  const Factor factor = factorise(seen, 1.0 / point.variance, point.t, variance.cwiseSqrt(), cross);
  return log_density(seen, std::log(point.variance), square, factor.lower.matrixLLT(), factor.half,
                     factor.largest);
}

// With r = F^-1 b / sigma^2, d/d log t_s = 1/2 [r_s'r_s + tr(F^-1)_ss - p_s]; it holds at t_s = 0 too.
double HistoryModel::log_likelihood(const WhitenedData& whitened, double log_variance, const VectorXd& t,
                                    VectorXd* gradient) const {
  const double precision = std::exp(-log_variance);
  const Index q = whitened.coefficients;
  const Factor factor = factorise(whitened, precision, t, VectorXd::Ones(q), whitened.cross);
  const double value = log_density(whitened, log_variance, whitened.square, factor.lower.matrixLLT(),
                                   factor.half, factor.largest);
  if (gradient == nullptr) return value;
  const Index n = factor.half.size();
  MatrixXd root_inverse = factor.lower.matrixL();
  invert_lower(root_inverse);
  const VectorXd inverse_diagonal = root_inverse.colwise().squaredNorm().transpose();
  const VectorXd r = precision * (root_inverse.transpose() * factor.half);
  gradient->setZero(1 + conditions_);
  for (Index j = q; j < n; ++j) {
    const int s = data_.condition[static_cast<std::size_t>(factor.kept[j] - q)];
    (*gradient)[1 + s] += 0.5 * (r[j] * r[j] + inverse_diagonal[j] - 1.0);
  }
  // sigma^2 |Sigma^-1 y|^2 = (quadratic form) - r'r: the residual sum of squares over sigma^2.
  const double quadratic = precision * (whitened.square - precision * factor.half.squaredNorm());
  (*gradient)[0] = -0.5 * (static_cast<double>(whitened.size - n) + inverse_diagonal.sum() -
                           (quadratic - r.squaredNorm()));
  return value;
}

double HistoryModel::quadratic(const WhitenedData& whitened, double log_variance, const VectorXd& t) const {
  const double precision = std::exp(-log_variance);
  const Factor factor =
      factorise(whitened, precision, t, VectorXd::Ones(whitened.coefficients), whitened.cross);
  return precision * (whitened.square - precision * factor.half.squaredNorm());
}

// With G_K the columns of the Gram matrix that belong to K and F the factor of the responses alone,
//     A = [G_KK - G_K' D^1/2 F^-1 D^1/2 G_K / sigma^2] / sigma^2, and c likewise.
CoefficientLikelihood HistoryModel::given(const HistoryParameters& point) const {
  const WhitenedData& seen = whitened(point.setting);
  const double precision = 1.0 / point.variance;
  const Index q = seen.coefficients;
  WhitenedData responses;  // the simulator's coefficients fixed at w0
  const Index p = seen.cross.size() - q;
  responses.gram = seen.gram.bottomRightCorner(p, p);
  responses.cross = seen.cross.tail(p);
  responses.square = seen.square;
  responses.log_det = seen.log_det;
  responses.size = seen.size;
  const Factor factor = factorise(responses, precision, point.t, VectorXd(), responses.cross);
  MatrixXd half(static_cast<Index>(factor.kept.size()), q);
  for (Index j = 0; j < half.rows(); ++j)
    half.row(j) = factor.root[j] * seen.gram.row(q + factor.kept[j]).head(q);
  if (half.size() > 0) factor.lower.matrixL().solveInPlace(half);  // Eigen looks at its first element
  const double squared = precision * precision;
  return {reference_, precision * seen.gram.topLeftCorner(q, q) - squared * (half.transpose() * half),
          precision * seen.cross.head(q) - squared * (half.transpose() * factor.half),
          log_density(responses, std::log(point.variance), seen.square, factor.lower.matrixLLT(), factor.half,
                      factor.largest)};
}

// The responses stand last in F, so that with the last rows and columns of L alone the covariance is
// D^1/2 L^-T L^-1 D^1/2.
HistoryModel::Coefficients HistoryModel::coefficients(const HistoryParameters& point, const VectorXd& mean,
                                                      const VectorXd& variance) const {
  const WhitenedData& seen = whitened(point.setting);
  double square = 0.0;
  const VectorXd cross = shifted_cross(seen, mean - reference_, square);
  const double precision = 1.0 / point.variance;
  const Factor factor = factorise(seen, precision, point.t, variance.cwiseSqrt(), cross);
  const VectorXd solved = factor.lower.matrixL().transpose().solve(factor.half);
  const Index q = seen.coefficients, acting = solved.size() - q;
  MatrixXd root = MatrixXd::Identity(acting, acting);
  if (acting > 0)  // Eigen looks at its first element
    factor.lower.matrixLLT()
        .bottomRightCorner(acting, acting)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace(root);
  const Index p = data_.responses.cols();
  Coefficients out{VectorXd::Zero(p), MatrixXd::Zero(p, acting)};
  for (Index j = 0; j < acting; ++j) {
    const Index column = factor.kept[static_cast<std::size_t>(q + j)] - q;
    out.mean[column] = precision * factor.root[q + j] * solved[q + j];
    out.root.row(column) = factor.root[q + j] * root.row(j);
  }
  return out;
}

}  // namespace amiss
