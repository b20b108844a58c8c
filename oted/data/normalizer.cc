#include "oted/data/normalizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/statistics.h"

namespace oted {

Normalizer Normalizer::Fit(const Array2<double>& rows) {
  if (rows.rows() == 0) throw DataError("cannot normalise a dataset without transitions; record at least one episode");
  const size_t d = static_cast<size_t>(rows.cols());
  const double n = rows.rows();
  std::vector<double> mean(d, 0.0), deviation(d, 0.0), magnitude(d, 0.0);
  for (int i = 0; i < rows.rows(); ++i) {
    for (size_t j = 0; j < d; ++j) {
      mean[j] += rows.row(i)[j] / n;
      magnitude[j] = std::max(magnitude[j], std::abs(rows.row(i)[j]));
    }
  }
  for (int i = 0; i < rows.rows(); ++i) {
    for (size_t j = 0; j < d; ++j) {
      const double difference = rows.row(i)[j] - mean[j];
      deviation[j] += difference * difference / n;
    }
  }
  for (double& value : deviation) value = std::sqrt(value);
  return FromMoments(std::move(mean), std::move(deviation), magnitude);
}

Normalizer Normalizer::FromMoments(std::vector<double> mean, std::vector<double> deviation,
                                   std::span<const double> magnitude) {
  OTED_CHECK(deviation.size() == mean.size() && magnitude.size() == mean.size());
  std::vector<double> varying;
  for (size_t j = 0; j < mean.size(); ++j) {
    // Below this the deviation is rounding of the mean, not data.
    if (deviation[j] > 1e-9 * magnitude[j]) varying.push_back(deviation[j]);
  }
  Normalizer result{std::move(mean), std::move(deviation)};
  if (varying.empty()) {
    result.scale.assign(result.mean.size(), 1.0);
    return result;
  }
  const double median = Median(std::move(varying));
  for (double& scale : result.scale) scale = std::max(scale, 1e-3 * median);
  return result;
}

void Normalizer::Apply(std::span<const double> in, std::span<float> out) const {
  OTED_CHECK(in.size() == mean.size() && out.size() == mean.size());
  for (size_t j = 0; j < in.size(); ++j) out[j] = static_cast<float>((in[j] - mean[j]) / scale[j]);
}

}  // namespace oted
