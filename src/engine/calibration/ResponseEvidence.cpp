#include "engine/calibration/ResponseEvidence.hpp"

#include <numeric>
#include <stdexcept>
#include <utility>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

AisResult response_evidence(HistoryData data, const HistoryPriors& priors, const GaussianSimulator& tangent,
                            const MatrixXd& responses, const AisOptions& options, const Context& context) {
  const Index n = data.y.size(), k = responses.cols(), q = tangent.root.rows(), r = tangent.root.cols();
  if (responses.rows() != n || data.basis.cols() != q) throw std::invalid_argument("response: lengths differ");
  const GaussianSimulator changed{(VectorXd(q + k) << tangent.mean, VectorXd::Zero(k)).finished(),
                                  (MatrixXd(q + k, r + k) << tangent.root, MatrixXd::Zero(q, k),
                                   MatrixXd::Zero(k, r), MatrixXd::Identity(k, k))
                                      .finished()};
  data.basis = (MatrixXd(n, q + k) << data.basis, responses).finished();
  data.moves = (MatrixXd(n, data.moves.cols() + k) << data.moves, responses).finished();
  const HistoryModel model(std::move(data), priors, context);
  std::vector<int> active(static_cast<std::size_t>(model.conditions()));
  std::iota(active.begin(), active.end(), 0);
  return sample_ais(HistoryTarget(model, active, changed), options, context);
}

}  // namespace amiss
