#include "network/Network.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace amiss::network {

namespace {

void check_number(int number, int count, const char* what) {
  if (number < -1 || number >= count) {
    throw std::invalid_argument(std::string("network: no ") + what + " has the number " +
                                std::to_string(number));
  }
}

void check_term(const Term& term, const Network& network) {
  check_number(term.of.node, network.nodes, "node");
  check_number(term.of.driver, network.drivers, "driver");
  check_number(term.by, network.drivers, "driver");
  check_number(term.element, network.elements, "element");
}

}  // namespace

void Network::check() const {
  if (nodes < 1) throw std::invalid_argument("network: no nodes");
  if (output.empty()) throw std::invalid_argument("network: no output");
  for (const Term& term : balance) {
    check_term(term, *this);
    if (term.into < 0 || term.into >= nodes) throw std::invalid_argument("network: a term enters no node");
  }
  for (const Term& term : output) check_term(term, *this);
}

int Network::output_node() const {
  return output.size() == 1 && output[0].element < 0 && output[0].by < 0 ? output[0].of.node : -1;
}

std::vector<int> Network::modulators() const {
  std::vector<int> found;
  for (const auto* terms : {&balance, &output}) {
    for (const Term& term : *terms) {
      if (term.by >= 0) found.push_back(term.by);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace amiss::network
