#pragma once
/// Settings of trajectory matching: [design.trajectories].

#include "oted/base/fields.h"

namespace oted {

struct TrajectoriesConfig {
  int window = 16;  ///< control steps of the longest windows; levels 2, 4, ... up to it
  int rows = 960;   ///< logged transitions that are matched, at most
  int starts = 3;   ///< starting points that are refined at the first level
  int coarse = 64;  ///< draws of the parameters from the prior among which they are chosen
  int tried = 3;    ///< likeliest suspects that are freed, where the fit leaves more than the sensors explain

  FieldList Fields();
};

}  // namespace oted
