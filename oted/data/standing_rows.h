#pragma once
/// Rows whose next observation is the same to the last bit: old readings, or a robot at rest.

#include <vector>

#include "oted/data/dataset.h"

namespace oted {

struct StandingRows {
  int n = 0;
  int first = -1;
  int n_at_rest = 0;  ///< of a robot that rests or moves less than a step of its sensors; where nothing has steps: none
};

bool Stands(const Dataset& dataset, int row);
StandingRows CountStandingRows(const Dataset& dataset, const std::vector<Episode>& episodes);

}  // namespace oted
