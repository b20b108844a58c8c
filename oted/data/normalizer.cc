#include "oted/data/normalizer.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {

Normalizer Normalizer::Fit(const Array2<double>& rows) {
  if (rows.rows() == 0) throw DataError("cannot normalise a dataset without transitions; record at least one episode");
  const size_t d = static_cast<size_t>(rows.cols());
  const double n = rows.rows();
  Normalizer fit;
  fit.mean.assign(d, 0.0);
  fit.scale.assign(d, 0.0);
  std::vector<double> magnitude(d, 0.0);
  for (int i = 0; i < rows.rows(); ++i) {
    for (size_t j = 0; j < d; ++j) {
      fit.mean[j] += rows.row(i)[j] / n;
      magnitude[j] = std::max(magnitude[j], std::abs(rows.row(i)[j]));
    }
  }
  for (int i = 0; i < rows.rows(); ++i) {
    for (size_t j = 0; j < d; ++j) {
      const double deviation = rows.row(i)[j] - fit.mean[j];
      fit.scale[j] += deviation * deviation / n;
    }
  }
  std::vector<double> varying;
  for (size_t j = 0; j < d; ++j) {
    fit.scale[j] = std::sqrt(fit.scale[j]);
    // Below this the deviation is rounding of the mean, not data.
    if (fit.scale[j] > 1e-9 * magnitude[j]) varying.push_back(fit.scale[j]);
  }
  if (varying.empty()) {
    fit.scale.assign(d, 1.0);
    return fit;
  }
  const auto median = varying.begin() + static_cast<std::ptrdiff_t>(varying.size() / 2);
  std::nth_element(varying.begin(), median, varying.end());
  for (double& scale : fit.scale) scale = std::max(scale, 1e-3 * *median);
  return fit;
}

void Normalizer::Apply(std::span<const double> in, std::span<float> out) const {
  OTED_CHECK(in.size() == mean.size() && out.size() == mean.size());
  for (size_t j = 0; j < in.size(); ++j) out[j] = static_cast<float>((in[j] - mean[j]) / scale[j]);
}

}  // namespace oted
