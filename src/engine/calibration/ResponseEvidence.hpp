#pragma once
#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"

namespace amiss {

/// Evidence of the record if the simulator were its tangent plus what a change of it does,
///     y = K w + R a + discrepancy + error,   w ~ the tangent,   a ~ N(0, I),
/// with the responses R (N x k) to the change as some runs show them, in amounts that are free. Beside that
/// of the tangent alone (R of no columns) it says whether the record asks for anything the change could do,
/// before the change has an emulator.
AisResult response_evidence(HistoryData data, const HistoryPriors& priors, const GaussianSimulator& tangent,
                            const Eigen::MatrixXd& responses, const AisOptions& options,
                            const Context& context);

}  // namespace amiss
