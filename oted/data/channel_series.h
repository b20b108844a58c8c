#pragma once
/// One channel over time, episode by episode.

#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// For each episode the channel's values at its rows and after its last action.
std::vector<std::vector<double>> SeriesOf(const Dataset& dataset, int channel);

/// A channel's value where a clip shows: the largest magnitude, where it occurs at least three times; else infinity.
double ClipOf(const Dataset& dataset, int channel);

}  // namespace oted
