#pragma once
#include <optional>
#include <vector>

#include "engine/Context.hpp"
#include "engine/ais/AisOptions.hpp"
#include "engine/ais/AnnealingPath.hpp"
#include "engine/ais/BentMap.hpp"
#include "engine/ais/StudentT.hpp"

namespace amiss {

/// Chains that are annealed side by side.
struct Chains {
  Eigen::MatrixXd x;          ///< dimension x n
  Eigen::VectorXd ll;         ///< log-likelihood
  Eigen::VectorXd reference;  ///< log density of the path's reference
  Eigen::VectorXd rise;       ///< of the path
  Eigen::VectorXd log_w;      ///< log weights since the last resampling

  /// n draws from the reference.
  static Chains start(const AnnealingPath& path, int n, Stream& stream, const Context& context);

  Eigen::Index size() const { return x.cols(); }

  double effective_size() const;  ///< by the weights

  /// Systematic resampling; all weights become equal.
  void resample(Stream& stream);
};

/// How chains move in one part of the coordinates: by steps that leave a Student t invariant, in coordinates
/// in which the part is straight.
struct PartMove {
  Eigen::Index first, size;
  BentMap bend;
  StudentT proposal;
  double step;
};

/// How chains of the posterior itself move along the last part where the target has a conditional: a
/// Hamiltonian move of this metric.
struct ConditionalMove {
  Eigen::MatrixXd root;  ///< of the part's covariance
  double step;
};

/// One temperature of the ladder, and how chains move there.
struct Level {
  double beta;  ///< inverse temperature
  std::vector<PartMove> parts;
  StudentT metric;  ///< of Hamiltonian moves
  double hamiltonian_step;
  std::optional<ConditionalMove> conditional;
  int sweeps;  ///< moves of every chain in every part
};

/// One Crank-Nicolson move of every chain in one part, reversible in its proposal; if the target has leaps, a
/// third of the chains leap in its first part instead. Returns the share of the former that was accepted.
double crank_nicolson_move(const AnnealingPath& path, Chains& chains, double beta, const PartMove& part,
                           Stream& stream, const Context& context);

/// Whether chains make Hamiltonian moves too.
bool hamiltonian(const Target& target, const AisOptions& options);

/// One Hamiltonian move of every chain: leapfrog steps in the coordinates in which the metric's scale is the
/// identity (Neal 2011); returns the share accepted.
double hamiltonian_move(const AnnealingPath& path, Chains& chains, const Level& level, Stream& stream,
                        const Context& context);

/// One Hamiltonian move of every chain along the last part, the others staying as they are, that leaves the
/// posterior itself invariant; returns the share accepted. Where the posterior is curved along the
/// parameters, it goes along the curve.
double conditional_move(const AnnealingPath& path, Chains& chains, const ConditionalMove& move,
                        Stream& stream, const Context& context);

/// Likelihood values that a sweep of one chain costs at a level: a Crank-Nicolson move in each part and,
/// where there are gradients, Hamiltonian ones.
int sweep_cost(const Target& target, const Level& level, const AisOptions& options);

}  // namespace amiss
