// Any boundary conditions and time axis: refused, or responses that stay between the values that they answer.
#include "engine/discrepancy/FilterBank.hpp"

#include "input.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace amiss;
  fuzz::Input in(data, size);
  const Eigen::Index n = in.integer(0, 12), columns = in.integer(0, 3);
  const TimeAxis axis = in.axis(in.byte() == 255 ? n + 1 : n);
  const Eigen::VectorXd constants = in.vector(in.integer(0, 3));
  const std::vector<int> condition(static_cast<std::size_t>(in.byte() == 255 ? columns + 1 : columns), 0);
  const Eigen::MatrixXd x = in.matrix(n, columns);
  fuzz::refusable([&] {
    const FilterBank bank(x, condition, constants, axis);
    fuzz::require(bank.responses.rows() == n && bank.responses.cols() == columns * constants.size(),
                  "one each");
    if (!fuzz::ordinary(x) || n == 0) return;
    for (Eigen::Index j = 0; j < bank.responses.cols(); ++j) {
      const auto answered = x.col(j / constants.size());
      const double slack = 1e-12 * answered.cwiseAbs().maxCoeff();
      fuzz::require((bank.responses.col(j).array() >= answered.minCoeff() - slack).all(), "not below them");
      fuzz::require((bank.responses.col(j).array() <= answered.maxCoeff() + slack).all(), "not above them");
    }
  });
  return 0;
}
