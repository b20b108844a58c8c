#include "oted/data/channel_series.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace oted {

std::vector<std::vector<double>> SeriesOf(const Dataset& dataset, int channel) {
  std::vector<std::vector<double>> series;
  for (const Episode& episode : dataset.Episodes()) {
    std::vector<double>& values = series.emplace_back();
    for (int i = episode.begin; i < episode.end; ++i) values.push_back(dataset.observations(i, channel));
    values.push_back(dataset.next_observations(episode.end - 1, channel));
  }
  return series;
}

double ClipOf(const Dataset& dataset, int channel) {
  constexpr int kFewest = 3;
  double largest = 0;
  int count = 0;
  for (int i = 0; i < dataset.size(); ++i) {
    const double value = std::abs(dataset.observations(i, channel));
    if (value == largest) ++count;
    if (value > largest) {
      largest = value;
      count = 1;
    }
  }
  return count >= kFewest ? largest : std::numeric_limits<double>::infinity();
}

}  // namespace oted
