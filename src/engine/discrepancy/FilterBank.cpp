#include "engine/discrepancy/FilterBank.hpp"

#include <cmath>
#include <stdexcept>

namespace amiss {

FilterBank::FilterBank(const Eigen::Ref<const Eigen::MatrixXd>& x,
                       const std::vector<int>& condition_of_column, const Eigen::VectorXd& time_constants,
                       const TimeAxis& axis) {
  axis.check();
  if (x.rows() != axis.size())
    throw std::invalid_argument("filter bank: boundary conditions and time differ in length");
  if (static_cast<Eigen::Index>(condition_of_column.size()) != x.cols())
    throw std::invalid_argument("filter bank: a condition is needed for each column");
  if (!time_constants.allFinite() || (time_constants.array() < 0).any())
    throw std::invalid_argument("filter bank: time constants must be finite and not negative");
  const Eigen::Index filters = time_constants.size();
  responses.resize(x.rows(), x.cols() * filters);
  for (Eigen::Index c = 0; c < x.cols(); ++c) {
    for (Eigen::Index k = 0; k < filters; ++k) {
      auto response = responses.col(c * filters + k);
      condition.push_back(condition_of_column[c]);
      for (Eigen::Index i = 0; i < x.rows(); ++i) {
        const bool at_once = axis.new_segment[i] || time_constants[k] == 0;
        const double weight =
            at_once ? 1.0 : -std::expm1(-(axis.time[i] - axis.time[i - 1]) / time_constants[k]);
        response[i] = at_once ? x(i, c) : response[i - 1] + weight * (x(i, c) - response[i - 1]);
      }
    }
  }
}

}  // namespace amiss
