#include "engine/calibration/ResponseEvidence.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "engine/calibration/Calibration.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kLeast = 1e-3;  // of the stated noise: what a direction must do over the record to count

// Moves V with moves a = moves V b, b ~ N(0, I) as a is: orthogonal columns, without those that do nothing.
MatrixXd along_axes(const MatrixXd& moves, double least) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(moves.transpose() * moves);
  const double idle = std::max(least * least, 1e-13 * eigen.eigenvalues().maxCoeff());
  return moves * eigen.eigenvectors().rightCols((eigen.eigenvalues().array() > idle).count());
}

}  // namespace

AisResult response_evidence(HistoryData data, const HistoryPriors& priors, const GaussianSimulator& tangent,
                            const MatrixXd& responses, const AisOptions& options, const Context& context) {
  const Index n = data.y.size(), k = responses.cols();
  if (responses.rows() != n || data.basis.cols() != tangent.root.rows())
    throw std::invalid_argument("response: lengths differ");
  data.y -= data.basis * tangent.mean;
  data.basis =
      along_axes((MatrixXd(n, tangent.root.cols() + k) << data.basis * tangent.root, responses).finished(),
                 kLeast * priors.noise_sd);
  data.moves = (MatrixXd(n, data.moves.cols() + k) << data.moves, responses).finished();
  const Index d = data.basis.cols();
  const HistoryModel model(std::move(data), priors, context);
  const HistoryTarget target(model, conditions_but(model, {}), {VectorXd::Zero(d), MatrixXd::Identity(d, d)});
  return sample_ais(target, options, context);
}

}  // namespace amiss
