#pragma once
/// Orientations and axes that parameters set in part: whatever one of their numbers is, their length stays one.

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "oted/sim/mujoco/model_field.h"

namespace oted {

class UnitVectors {
 public:
  /// Those that `field` sets numbers of; none where its array holds none. To be called before anything is set.
  /// @param values  of all lanes, as MuJoCo has them: nominal  @param size  numbers of one lane
  void Add(const ModelField& field, double* values, int size);
  /// As in the model: what Normalize changed was not the parameter's alone.
  void Reset(int lane) const;
  void Normalize(int lane) const;

 private:
  struct Vector {
    double* values;  // of all lanes
    int size;        // of one lane
    int begin, width;
    std::array<double, 4> nominal;
    double* In(int lane) const { return values + static_cast<std::ptrdiff_t>(lane) * size + begin; }
  };
  std::vector<Vector> vectors_;
};

}  // namespace oted
