#pragma once
/// Rows whose next observation is the same to the last bit: old readings, or a robot at rest.

#include <vector>

#include "oted/data/dataset.h"

namespace oted {

struct StandingRows {
  int n = 0;
  int first = -1;
  /// Of a robot that rests or moves less than a step of its sensors. Where nothing has steps: those with which an
  /// episode begins or ends.
  int n_at_rest = 0;
};

bool Stands(const Dataset& dataset, int row);
StandingRows CountStandingRows(const Dataset& dataset, const std::vector<Episode>& episodes);

}  // namespace oted
