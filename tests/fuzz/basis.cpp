// Any runs: refused, or a finite basis in which they are approximated as well as is said.
#include "engine/basis/Basis.hpp"

#include "input.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace amiss;
  fuzz::Input in(data, size);
  BasisOptions options;
  for (double* field : {&options.explained, &options.noise_sd, &options.noise_fraction}) in.perhaps(*field);
  in.perhaps(options.max_vectors, 0, 40);
  const Eigen::MatrixXd outputs = in.matrix(in.integer(0, 12), in.integer(0, 8));
  fuzz::refusable([&] {
    const Basis basis = make_basis(outputs, options);
    fuzz::require(outputs.allFinite(), "runs that are not finite are refused");
    fuzz::require(basis.vectors.allFinite() && basis.coefficients.allFinite(), "the basis is finite");
    fuzz::require(basis.singular_values.allFinite() && std::isfinite(basis.discarded_rms), "so is its size");
    fuzz::require(basis.explained >= 0 && basis.explained <= 1, "a share is one");
    const Eigen::MatrixXd rest = outputs - basis.vectors * basis.coefficients.transpose();
    const double largest = basis.singular_values[0] + outputs.norm();
    fuzz::require(std::abs(rest.norm() - std::sqrt(basis.discarded_ss)) <= 1e-6 * largest,
                  "what is left out");
  });
  return 0;
}
