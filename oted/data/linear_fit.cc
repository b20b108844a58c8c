#include "oted/data/linear_fit.h"

#include <cmath>
#include <vector>

#include "oted/base/error.h"

namespace oted {

Array2<double> LeastSquares(const Array2<double>& x, const Array2<double>& y) {
  const int n = x.rows(), p = x.cols(), q = y.cols();
  OTED_CHECK(y.rows() == n && n >= p && p >= 1);
  // Columns of unit length: the normal equations are then as well conditioned as a scaling can make them.
  std::vector<double> length(static_cast<size_t>(p), 0.0);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < p; ++j) length[static_cast<size_t>(j)] += x(i, j) * x(i, j);
  }
  for (double& l : length) l = l > 0 ? std::sqrt(l) : 1.0;
  Array2<double> a(p, p), b(p, q);
  std::vector<double> row(static_cast<size_t>(p));
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < p; ++j) row[static_cast<size_t>(j)] = x(i, j) / length[static_cast<size_t>(j)];
    for (int j = 0; j < p; ++j) {
      for (int k = 0; k <= j; ++k) a(j, k) += row[static_cast<size_t>(j)] * row[static_cast<size_t>(k)];
      for (int k = 0; k < q; ++k) b(j, k) += row[static_cast<size_t>(j)] * y(i, k);
    }
  }
  // Cholesky, a = l l^T, in place.
  for (int j = 0; j < p; ++j) {
    a(j, j) += 1e-10;
    for (int k = 0; k < j; ++k) {
      double sum = a(j, k);
      for (int m = 0; m < k; ++m) sum -= a(j, m) * a(k, m);
      a(j, k) = sum / a(k, k);
    }
    double diagonal = a(j, j);
    for (int m = 0; m < j; ++m) diagonal -= a(j, m) * a(j, m);
    a(j, j) = std::sqrt(std::max(diagonal, 1e-12));
  }
  for (int c = 0; c < q; ++c) {
    for (int j = 0; j < p; ++j) {
      for (int m = 0; m < j; ++m) b(j, c) -= a(j, m) * b(m, c);
      b(j, c) /= a(j, j);
    }
    for (int j = p - 1; j >= 0; --j) {
      for (int m = j + 1; m < p; ++m) b(j, c) -= a(m, j) * b(m, c);
      b(j, c) /= a(j, j);
    }
  }
  for (int j = 0; j < p; ++j) {
    for (int c = 0; c < q; ++c) b(j, c) /= length[static_cast<size_t>(j)];
  }
  return b;
}

}  // namespace oted
