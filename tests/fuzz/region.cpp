// Any centre, root and radius: refused, or a region that holds its centre and the points that it places.
#include "engine/emulator/Region.hpp"

#include "input.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace amiss;
  fuzz::Input in(data, size);
  const Eigen::Index d = in.integer(0, 4);
  const Eigen::VectorXd centre = in.vector(d);
  const Eigen::MatrixXd root = in.matrix(in.byte() == 255 ? d + 1 : d, d);
  double radius = 2.0;
  in.perhaps(radius);
  const Eigen::MatrixXd normal = in.matrix(d, in.integer(1, 3));
  std::vector<bool> uniform(static_cast<std::size_t>(in.byte() == 255 ? d + 1 : d));
  for (std::size_t i = 0; i < uniform.size(); ++i) uniform[i] = in.byte() % 2 == 1;
  fuzz::refusable([&] {
    const Region region(centre, root, radius, uniform);
    fuzz::require(region.contains(centre), "the centre is inside");
    if (!fuzz::ordinary(centre) || !fuzz::ordinary(root) || radius > 1e100 || !fuzz::ordinary(normal)) return;
    const Eigen::MatrixXd placed = region.place(normal);
    fuzz::require(placed.allFinite(), "places are finite");
    const Eigen::MatrixXd inputs = region.inputs(placed);
    fuzz::require(inputs.rows() == normal.cols() && inputs.cols() == d, "inputs of each");
    region.pulled_back(placed, Eigen::MatrixXd::Ones(normal.cols(), d));
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(root);
    if (svd.singularValues()[d - 1] < 1e-3 * svd.singularValues()[0] ||
        centre.cwiseAbs().maxCoeff() > 1e3 * radius * svd.singularValues()[d - 1])
      return;
    for (Eigen::Index i = 0; i < placed.cols(); ++i)
      fuzz::require(region.contains(placed.col(i)), "what is placed is inside");
  });
  return 0;
}
