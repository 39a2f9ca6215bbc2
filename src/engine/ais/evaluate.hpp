#pragma once
#include <functional>

#include "engine/Context.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// Columns 0 ... n-1 in blocks of at most target.block() that the threads share: task(first, count). Their
/// size is fixed, so that no result depends on the number of threads.
void for_blocks(const Target& target, Eigen::Index n, const Context& context,
                const std::function<void(Eigen::Index, Eigen::Index)>& task);

/// Not a number, and infinity, count as likelihood zero.
double finite_or_zero(double log_likelihood);

/// Log-likelihoods of the columns of x, in blocks that the threads share; what is not finite is -infinity.
/// also(first, count) is what else the threads can do for the columns of a block.
Eigen::VectorXd evaluate(const Target& target, const Eigen::MatrixXd& x, const Context& context,
                         const std::function<void(Eigen::Index, Eigen::Index)>& also = {});

/// With gradients (dimension x n), whose memory is given; also() comes after the gradients of its columns.
Eigen::VectorXd evaluate(const Target& target, const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient,
                         const Context& context,
                         const std::function<void(Eigen::Index, Eigen::Index)>& also = {});

}  // namespace amiss
