#pragma once
/// Brings each channel of observations or actions to zero mean and unit scale before a network sees it.

#include <span>
#include <vector>

#include "oted/base/array2.h"

namespace oted {

/// x -> (x - mean) / scale, channel by channel.
struct Normalizer {
  std::vector<double> mean;   ///< (d), the channels' units
  std::vector<double> scale;  ///< (d), > 0, the channels' units

  /// The mean and standard deviation (divided by N) of each column of `rows` (N, d), N >= 1, all finite. The scale is
  /// not below a thousandth of the median standard deviation of the channels that vary, so that noise in a nearly
  /// constant channel cannot drown the others; it is 1 for all channels when none varies.
  /// @throws DataError without rows
  static Normalizer Fit(const Array2<double>& rows);
  /// The same from the columns' means, standard deviations and largest magnitudes.
  static Normalizer FromMoments(std::vector<double> mean, std::vector<double> deviation,
                                std::span<const double> magnitude);
  /// `in` and `out` (d).
  void Apply(std::span<const double> in, std::span<float> out) const;
};

}  // namespace oted
