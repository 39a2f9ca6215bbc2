#include "network/Balance.hpp"

#include <limits>

namespace amiss::network {

namespace {

// Sums of the terms, before they are divided by capacities.
Balance sums(const Network& network, const Eigen::VectorXd& element, const Eigen::VectorXd& drivers,
             double without_element) {
  Balance sum{Eigen::MatrixXd::Zero(network.nodes, network.nodes),
              Eigen::MatrixXd::Zero(network.nodes, network.drivers + 1),
              Eigen::RowVectorXd::Zero(network.nodes), Eigen::RowVectorXd::Zero(network.drivers + 1)};
  const auto size = [&](const Term& term) {
    return term.sign * (term.element < 0 ? without_element : element[term.element]) *
           (term.by < 0 ? 1.0 : drivers[term.by]);
  };
  const auto input = [&](const Term& term) { return term.of.driver < 0 ? network.drivers : term.of.driver; };
  for (const Term& term : network.balance) {
    if (term.of.node >= 0)
      sum.states(term.into, term.of.node) += size(term);
    else
      sum.inputs(term.into, input(term)) += size(term);
  }
  for (const Term& term : network.output) {
    if (term.of.node >= 0)
      sum.output_states[term.of.node] += size(term);
    else
      sum.output_inputs[input(term)] += size(term);
  }
  return sum;
}

// 1 / capacity, of nodes no faster than `fastest`.
Eigen::ArrayXd inverse_capacity(const Balance& sum, const Eigen::VectorXd& capacity, double fastest) {
  const Eigen::ArrayXd least = sum.states.diagonal().array().abs() / fastest;
  return capacity.array().max(least.max(std::numeric_limits<double>::min())).inverse();
}

}  // namespace

Balance balance(const Network& network, const Coefficients& coefficients, const Eigen::VectorXd& drivers,
                double fastest) {
  Balance out = sums(network, coefficients.element, drivers, 1.0);
  const Eigen::VectorXd inverse = inverse_capacity(out, coefficients.capacity, fastest);
  out.states = inverse.asDiagonal() * out.states;
  out.inputs = inverse.asDiagonal() * out.inputs;
  return out;
}

// d(S / C) = dS / C - (S / C) dC / C.
Balance derivative(const Network& network, const Coefficients& coefficients, const Coefficients& direction,
                   const Eigen::VectorXd& drivers, double fastest) {
  const Balance sum = sums(network, coefficients.element, drivers, 1.0);
  Balance out = sums(network, direction.element, drivers, 0.0);
  const Eigen::VectorXd inverse = inverse_capacity(sum, coefficients.capacity, fastest);
  const Eigen::VectorXd loss = inverse.cwiseProduct(inverse).cwiseProduct(direction.capacity);
  out.states = inverse.asDiagonal() * out.states - loss.asDiagonal() * sum.states;
  out.inputs = inverse.asDiagonal() * out.inputs - loss.asDiagonal() * sum.inputs;
  return out;
}

}  // namespace amiss::network
