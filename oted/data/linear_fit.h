#pragma once
/// Linear least squares for the checks of data.

#include "oted/base/array2.h"

namespace oted {

/// The coefficients (p, q) that minimise |x b - y|^2 for x (n, p) and y (n, q), n >= p >= 1. A ridge of 1e-10 of each
/// column's own square keeps collinear columns (a constant, a channel given twice) from mattering.
Array2<double> LeastSquares(const Array2<double>& x, const Array2<double>& y);

}  // namespace oted
