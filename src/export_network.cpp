#include <cmath>
#include <limits>
#include <vector>

#include "engine/parallel/parallel_for.hpp"
#include "export_convert.h"
#include "network/Simulation.hpp"

// The network simulator for R: convert, run, convert. Numbers of nodes, drivers and elements are from 0, -1
// for none.

// In a namespace of its own: the exports are compiled together.
namespace network_export {

using namespace amiss::network;
using Eigen::Index;

// Columns: into, node, driver, sign, element, by.
std::vector<Term> read_terms(const Eigen::MatrixXd& table) {
  std::vector<Term> terms;
  const auto number = [&](Index row, Index column) { return static_cast<int>(table(row, column)); };
  for (Index i = 0; i < table.rows(); ++i) {
    terms.push_back({number(i, 0), {number(i, 1), number(i, 2)}, table(i, 3), number(i, 4), number(i, 5)});
  }
  return terms;
}

Network read_network(const Rcpp::List& from) {
  Network network;
  network.nodes = from["nodes"];
  network.elements = from["elements"];
  network.drivers = from["drivers"];
  network.balance = read_terms(from["balance"]);
  network.output = read_terms(from["output"]);
  return network;
}

// Elements, capacities, starts and drivers before the start, one after the other.
Coefficients read_coefficients(const Network& network, const Eigen::Ref<const Eigen::VectorXd>& all) {
  const Index n = network.nodes, k = network.elements;
  return {all.head(k), all.segment(k, n), all.segment(k + n, n), all.tail(network.drivers)};
}

Options read_options(const Rcpp::List& from) {
  Options options;
  options.step_h = from["step_h"];
  options.linear = from["linear"];
  options.mean = from["mean"];
  options.start_hours = from["start_hours"];
  return options;
}

void run_all(const Network& network, const Eigen::MatrixXd& coefficients, const Eigen::MatrixXd& drivers,
             const Eigen::VectorXd& hold, const Options& options, const amiss::Context& context,
             Eigen::Map<Eigen::MatrixXd> output) {
  amiss::parallel_for(static_cast<int>(coefficients.cols()), context, [&](int run) {
    const Coefficients read = read_coefficients(network, coefficients.col(run));
    output.col(run) = simulate(network, read, {}, drivers, hold, options).output;
    if (!output.col(run).allFinite()) output.col(run).setConstant(std::numeric_limits<double>::quiet_NaN());
  });
}

Eigen::MatrixXd slopes_of(const Network& network, const Eigen::VectorXd& coefficients,
                          const Eigen::MatrixXd& directions, const Eigen::MatrixXd& drivers,
                          const Eigen::VectorXd& hold, const Options& options) {
  std::vector<Coefficients> along;
  for (Index p = 0; p < directions.cols(); ++p)
    along.push_back(read_coefficients(network, directions.col(p)));
  return simulate(network, read_coefficients(network, coefficients), along, drivers, hold, options).slopes;
}

}  // namespace network_export

// N x M outputs of a network; `coefficients` has a column for each run.
// [[Rcpp::export]]
Rcpp::NumericMatrix network_simulate_(Rcpp::List network, Eigen::MatrixXd coefficients,
                                      Eigen::MatrixXd drivers, Eigen::VectorXd hold, Rcpp::List options,
                                      Rcpp::List context) {
  Rcpp::NumericMatrix output(Rcpp::no_init(drivers.rows(), coefficients.cols()));
  network_export::run_all(network_export::read_network(network), coefficients, drivers, hold,
                          network_export::read_options(options), amiss::convert::context(context),
                          {output.begin(), output.nrow(), output.ncol()});
  return output;
}

// N x P slopes of one run; `directions` has a column for each parameter.
// [[Rcpp::export]]
Eigen::MatrixXd network_slopes_(Rcpp::List network, Eigen::VectorXd coefficients, Eigen::MatrixXd directions,
                                Eigen::MatrixXd drivers, Eigen::VectorXd hold, Rcpp::List options) {
  return network_export::slopes_of(network_export::read_network(network), coefficients, directions, drivers,
                                   hold, network_export::read_options(options));
}
