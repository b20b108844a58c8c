#include "oted/stages/design/trajectories/trajectories_config.h"

namespace oted {

FieldList TrajectoriesConfig::Fields() {
  FieldList fields("design.trajectories");
  fields.Add("window", &window, "control steps of the longest windows", AtLeast(2));
  fields.Add("rows", &rows, "maximum number of logged transitions matched per seed", AtLeast(2));
  fields.Add("starts", &starts, "starting points that are refined", AtLeast(1));
  fields.Add("coarse", &coarse, "draws of z from which the starting points are chosen", AtLeast(1));
  fields.Add("tried", &tried,
             "likeliest suspects that are freed in a trial, where the designs leave more than the sensors explain",
             Between(0, 20));
  return fields;
}

}  // namespace oted
