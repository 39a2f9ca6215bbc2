#include "engine/discrepancy/HistoryModel.hpp"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <stdexcept>

#include "engine/linalg/constants.hpp"
#include "engine/linalg/double_policy.hpp"
#include "engine/linalg/precedes.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/transform.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kBlock = 2048;  // rows of a long record that are whitened at once

double clamp_unit(double u) { return std::min(std::max(u, 1e-12), 1.0 - 1e-12); }

// Whitened rows of the basis (columns divided by `norms`) and of [Phi, y], block after block, as often as
// asked.
class WhitenedBlocks {
 public:
  WhitenedBlocks(const HistoryData& data, const Whitener& whitener, const VectorXd& norms)
      : data_(data), whitener_(whitener), norms_(norms) {}

  template <class Visit>
  void visit(const Visit& visit) {
    const Index n = data_.y.size(), q = data_.basis.cols(), p = data_.responses.cols();
    if (n <= kBlock && all_.size() > 0) return visit(basis_, all_);
    MatrixXd state;
    for (Index first = 0; first < n; first += kBlock) {
      const Index rows = std::min(kBlock, n - first);
      MatrixXd block(rows, q + p + 1);
      block << data_.basis.middleRows(first, rows), data_.responses.middleRows(first, rows),
          data_.y.segment(first, rows);
      block.leftCols(q).array().rowwise() /= norms_.transpose().array();
      block = whitener_.rows(block, first, state);
      basis_ = block.leftCols(q);
      all_ = block.rightCols(p + 1);
      visit(basis_, all_);
    }
  }

 private:
  const HistoryData& data_;
  const Whitener& whitener_;
  const VectorXd& norms_;
  MatrixXd basis_, all_;  // the last block; the only one of a short record
};

}  // namespace

int HistoryData::conditions() const {
  return condition.empty() ? 0 : 1 + *std::max_element(condition.begin(), condition.end());
}

void HistoryData::check() const {
  axis.check();
  const Index n = y.size();
  if (basis.rows() != n || responses.rows() != n || axis.size() != n)
    throw std::invalid_argument("history: lengths differ");
  if (static_cast<Index>(condition.size()) != responses.cols())
    throw std::invalid_argument("history: a condition is needed for each column");
  if (!condition.empty() && *std::min_element(condition.begin(), condition.end()) < 0)
    throw std::invalid_argument("history: negative condition");
  if (basis.cols() >= n)
    throw std::invalid_argument("history: the basis spans the whole record, nothing is left outside it");
}

void HistoryPriors::check() const {
  if (!(noise_sd > 0)) throw std::invalid_argument("history: noise_sd must be positive");
  if (!(noise_shape > 0)) throw std::invalid_argument("history: noise_shape must be positive");
  if (!(inclusion > 0 && inclusion <= 1))
    throw std::invalid_argument("history: inclusion must lie in (0, 1]");
  if (!(amplitude > 0)) throw std::invalid_argument("history: amplitude must be positive");
  error.check();
}

WhitenedData whiten(const HistoryData& data, const VectorXd& correlation_times, const VectorXd& ratios) {
  const Whitener whitener(data.axis, correlation_times, ratios);
  const Index n = data.y.size(), q = data.basis.cols(), p = data.responses.cols();
  // Columns scaled to unit norm first, so that their very different sizes do not cost accuracy.
  const VectorXd norms = data.basis.colwise().norm().transpose();
  WhitenedBlocks blocks(data, whitener, norms);

  // First pass: W K = O R in blocks, and what lies inside.
  MatrixXd root = MatrixXd::Zero(q, q), inside = MatrixXd::Zero(q, p + 1);
  blocks.visit([&](const MatrixXd& basis, const MatrixXd& series) {
    if (q == 0) return;
    MatrixXd stacked(q + basis.rows(), q);
    stacked << root, basis;
    const Eigen::HouseholderQR<MatrixXd> qr(stacked);
    root = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
    inside.noalias() += basis.transpose() * series;
  });
  root.triangularView<Eigen::Upper>().transpose().solveInPlace(inside);  // O'W [Phi, y]

  // Second pass: what lies outside.
  MatrixXd gram = MatrixXd::Zero(p + 1, p + 1);
  blocks.visit([&](const MatrixXd& basis, const MatrixXd& series) {
    MatrixXd o = basis;
    root.triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(o);
    MatrixXd outside = series;
    outside.noalias() -= o * inside;
    gram.selfadjointView<Eigen::Lower>().rankUpdate(outside.transpose());
  });

  WhitenedData out;
  out.gram = MatrixXd(gram.topLeftCorner(p, p)).selfadjointView<Eigen::Lower>();
  out.cross = gram.row(p).head(p).transpose();
  out.square = gram(p, p);
  out.estimate = norms.cwiseInverse().cwiseProduct(root.triangularView<Eigen::Upper>().solve(inside.col(p)));
  out.root = root * norms.asDiagonal();
  out.log_det =
      whitener.log_det() + log_volume(data.basis) - out.root.diagonal().cwiseAbs().array().log().sum();
  out.residual_dimension = n - q;
  return out;
}

double log_volume(const MatrixXd& basis) {
  const VectorXd norms = basis.colwise().norm().transpose();
  const Eigen::HouseholderQR<MatrixXd> qr(basis * norms.cwiseInverse().asDiagonal());
  return norms.array().log().sum() + qr.matrixQR().diagonal().cwiseAbs().array().log().sum();
}

HistoryModel::HistoryModel(HistoryData data, HistoryPriors priors, const Context& context)
    : data_(std::move(data)), priors_(std::move(priors)), conditions_(data_.conditions()) {
  data_.check();
  priors_.check();
  columns_ = VectorXd::Zero(conditions_);
  for (int s : data_.condition) columns_[s] += 1.0;
  centre_ = data_.responses.colwise().mean();
  data_.responses.rowwise() -= centre_;
  scale_ = (data_.responses.colwise().squaredNorm() / static_cast<double>(std::max<Index>(1, data_.y.size())))
               .cwiseSqrt();
  for (Index j = 0; j < scale_.size(); ++j) {
    if (!(scale_[j] > 1e-12 * (1.0 + std::abs(centre_[j])))) scale_[j] = 1.0;  // constant: its column is zero
  }
  data_.responses.array().rowwise() /= scale_.array();
  settings_.resize(static_cast<std::size_t>(priors_.error.settings()));
  parallel_for(static_cast<int>(settings_.size()), context, [&](int g) {
    settings_[g] = whiten(data_, priors_.error.correlation_times, priors_.error.setting(g));
  });
}

double HistoryModel::log_likelihood(int setting, double log_variance, const VectorXd& t,
                                    VectorXd* gradient) const {
  return log_likelihood(settings_[setting], log_variance, t, gradient);
}

// With D = diag(t_s / p_s), B = I + D^1/2 G D^1/2 / sigma^2 = LL' and b = D^1/2 g, columns with t_s > 0 only.
struct HistoryModel::Factor {
  std::vector<Index> kept;
  Eigen::LLT<MatrixXd, Eigen::Lower> root;  // L
  VectorXd half;                            // L^-1 b
};

HistoryModel::Factor HistoryModel::factorise(const WhitenedData& whitened, double precision,
                                             const VectorXd& t) const {
  Factor out;
  for (std::size_t j = 0; j < data_.condition.size(); ++j) {
    if (t[data_.condition[j]] > 0) out.kept.push_back(static_cast<Index>(j));
  }
  const Index p = static_cast<Index>(out.kept.size());
  VectorXd root(p), b(p);
  for (Index j = 0; j < p; ++j) {
    const int s = data_.condition[out.kept[j]];
    root[j] = std::sqrt(t[s] / columns_[s]);
    b[j] = root[j] * whitened.cross[out.kept[j]];
  }
  MatrixXd matrix(p, p);
  for (Index j = 0; j < p; ++j) {
    for (Index i = j; i < p; ++i)
      matrix(i, j) = precision * root[i] * root[j] * whitened.gram(out.kept[i], out.kept[j]);
    matrix(j, j) += 1.0;
  }
  out.root.compute(matrix);
  if (p > 0) out.half = out.root.matrixL().solve(b);
  return out;
}

double HistoryModel::explained(const WhitenedData& whitened, double log_variance, const VectorXd& t) const {
  if (!(whitened.square > 0)) return 0.0;
  const double precision = std::exp(-log_variance);
  return precision * factorise(whitened, precision, t).half.squaredNorm() / whitened.square;
}

//   log |H~'AH~| = (N - Q) log sigma^2 + log |B|,   quadratic form = (y'y - b' B^-1 b / sigma^2) / sigma^2.
// With r = B^-1 b / sigma^2, d/d log t_s = 1/2 [r_s'r_s + tr(B^-1)_ss - p_s]; it holds at t_s = 0 too.
double HistoryModel::log_likelihood(const WhitenedData& whitened, double log_variance, const VectorXd& t,
                                    VectorXd* gradient) const {
  const double precision = std::exp(-log_variance);
  const Factor factor = factorise(whitened, precision, t);
  const std::vector<Index>& kept = factor.kept;
  const VectorXd& half = factor.half;
  const Index p = half.size();
  const double n = static_cast<double>(whitened.residual_dimension);
  const double log_det = p == 0 ? 0.0 : 2.0 * factor.root.matrixLLT().diagonal().array().log().sum();
  const double quadratic = precision * (whitened.square - precision * half.squaredNorm());
  const double value = whitened.log_det - 0.5 * (n * (kLogTwoPi + log_variance) + log_det + quadratic);

  if (gradient != nullptr) {
    gradient->setZero(1 + conditions_);
    MatrixXd root_inverse = MatrixXd::Identity(p, p);
    if (p > 0) factor.root.matrixL().solveInPlace(root_inverse);
    const VectorXd inverse_diagonal = root_inverse.colwise().squaredNorm().transpose();
    const VectorXd r = precision * (root_inverse.transpose() * half);
    for (Index j = 0; j < p; ++j) {
      (*gradient)[1 + data_.condition[kept[j]]] += 0.5 * (r[j] * r[j] + inverse_diagonal[j] - 1.0);
    }
    // sigma^2 |Sigma^-1 y|^2 = (quadratic form) - r'r: the residual sum of squares over sigma^2.
    (*gradient)[0] =
        -0.5 * (n - static_cast<double>(p) + inverse_diagonal.sum() - (quadratic - r.squaredNorm()));
  }
  return value;
}

VectorXd HistoryModel::coefficients(const WhitenedData& whitened, double log_variance,
                                    const VectorXd& t) const {
  const double precision = std::exp(-log_variance);
  const Index p = static_cast<Index>(data_.condition.size());
  VectorXd root(p);
  for (Index j = 0; j < p; ++j) root[j] = std::sqrt(t[data_.condition[j]] / columns_[data_.condition[j]]);
  MatrixXd matrix = precision * (root.asDiagonal() * whitened.gram * root.asDiagonal());
  matrix.diagonal().array() += 1.0;
  return root.asDiagonal() * matrix.llt().solve(precision * root.cwiseProduct(whitened.cross));
}

HistoryTarget::HistoryTarget(const HistoryModel& model, std::vector<int> active)
    : model_(model), active_(std::move(active)) {
  const HistoryData& data = model_.data();
  const auto column = [&](int s) {
    return data.responses.col(std::find(data.condition.begin(), data.condition.end(), s) -
                              data.condition.begin());
  };
  std::stable_sort(active_.begin(), active_.end(),
                   [&](int a, int b) { return precedes(column(a), column(b)); });
}

Index HistoryTarget::dimension() const {
  return 1 + model_.priors().error.correlation_times.size() + static_cast<Index>(active_.size());
}

HistoryParameters HistoryTarget::parameters(const VectorXd& x) const {
  const HistoryPriors& priors = model_.priors();
  HistoryParameters point;
  const double shape = priors.noise_shape;
  const double scaled = boost::math::gamma_p_inv(shape, clamp_unit(normal_cdf(x[0])), DoublePolicy());
  point.variance = shape * priors.noise_sd * priors.noise_sd / scaled;
  const Index components = priors.error.correlation_times.size();
  const int levels = static_cast<int>(priors.error.ratios.size());
  for (Index k = components - 1; k >= 0; --k) {
    const int level = std::min(levels - 1, static_cast<int>(normal_cdf(x[1 + k]) * levels));
    point.setting = point.setting * levels + level;
  }
  point.t = VectorXd::Zero(model_.conditions());
  for (std::size_t a = 0; a < active_.size(); ++a) {
    // The lower part of the unit interval is the spike at zero; the likelihood is continuous where the slab
    // begins.
    const double u =
        (normal_cdf(x[1 + components + static_cast<Index>(a)]) - (1.0 - priors.inclusion)) / priors.inclusion;
    if (u > 0) point.t[active_[a]] = std::pow(priors.amplitude * std::tan(0.5 * kPi * clamp_unit(u)), 2);
  }
  return point;
}

VectorXd HistoryTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters point = parameters(x.col(i));
    values[i] = model_.log_likelihood(point.setting, std::log(point.variance), point.t);
  }
  return values;
}

// d log sigma^2 / dx and d log t / dx of the maps in parameters(): with u uniform and x = Phi^-1(u), du / dx
// is the normal density.
VectorXd HistoryTarget::log_likelihood(const MatrixXd& x, MatrixXd& gradient) const {
  const HistoryPriors& priors = model_.priors();
  const Index first = 1 + priors.error.correlation_times.size();
  gradient.setZero(x.rows(), x.cols());
  VectorXd values(x.cols()), natural;
  for (Index i = 0; i < x.cols(); ++i) {
    const HistoryParameters point = parameters(x.col(i));
    values[i] = model_.log_likelihood(point.setting, std::log(point.variance), point.t, &natural);
    const double scaled = priors.noise_shape * priors.noise_sd * priors.noise_sd / point.variance;
    gradient(0, i) = -natural[0] * normal_density(x(0, i)) /
                     (scaled * boost::math::gamma_p_derivative(priors.noise_shape, scaled, DoublePolicy()));
    for (std::size_t a = 0; a < active_.size(); ++a) {
      const Index row = first + static_cast<Index>(a);
      if (!(point.t[active_[a]] > 0)) continue;
      const double root = std::sqrt(point.t[active_[a]]) / priors.amplitude;  // tan(pi u / 2)
      gradient(row, i) = natural[1 + active_[a]] * normal_density(x(row, i)) / priors.inclusion * kPi *
                         (1.0 + root * root) / root;
    }
  }
  return values;
}

}  // namespace amiss
