#include "engine/linalg/triangular.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Ref;

namespace {

constexpr Index kSmall = 24;  // below which columns are taken one by one

void invert_small(Ref<MatrixXd> l) {
  const Index n = l.rows();
  for (Index j = n - 1; j >= 0; --j) {
    l(j, j) = 1.0 / l(j, j);
    const Index below = n - 1 - j;
    if (below == 0) continue;
    l.col(j).tail(below) = l.bottomRightCorner(below, below).triangularView<Eigen::Lower>() *
                           (-l(j, j) * l.col(j).tail(below)).eval();
  }
}

void square_small(Ref<MatrixXd> l) {
  const Index n = l.rows();
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) l(i, j) = l.col(i).tail(n - i).dot(l.col(j).tail(n - i));
  }
}

}  // namespace

// The inverse of [A, 0; B, C] is [A^-1, 0; -C^-1 B A^-1, C^-1].
void invert_lower(Ref<MatrixXd> l) {
  const Index n = l.rows(), h = n / 2;
  if (n <= kSmall) return invert_small(l);
  auto a = l.topLeftCorner(h, h), b = l.bottomLeftCorner(n - h, h), c = l.bottomRightCorner(n - h, n - h);
  invert_lower(a);
  invert_lower(c);
  b = (c.triangularView<Eigen::Lower>() * b).eval();
  b = (b * (-a).eval().triangularView<Eigen::Lower>()).eval();
}

// With L = [A, 0; B, C], L'L = [A'A + B'B, B'C; C'B, C'C].
void square_lower(Ref<MatrixXd> l) {
  const Index n = l.rows(), h = n / 2;
  if (n <= kSmall) return square_small(l);
  auto a = l.topLeftCorner(h, h), b = l.bottomLeftCorner(n - h, h), c = l.bottomRightCorner(n - h, n - h);
  square_lower(a);
  a.selfadjointView<Eigen::Lower>().rankUpdate(b.transpose());
  b = (c.transpose().triangularView<Eigen::Upper>() * b).eval();
  square_lower(c);
}

void symmetrise(Ref<MatrixXd> a) { a.triangularView<Eigen::StrictlyUpper>() = a.transpose(); }

}  // namespace amiss
