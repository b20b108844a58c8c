#include "oted/sim/mujoco/unit_vectors.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace oted {
namespace {

/// 0: the array holds no vectors of length one.
int WidthOf(const std::string& array) {
  if (array == "jnt_axis") return 3;
  const std::set<std::string> orientations = {"body_quat", "body_iquat", "geom_quat", "site_quat", "cam_quat"};
  return orientations.contains(array) ? 4 : 0;
}

}  // namespace

void UnitVectors::Add(const ModelField& field, double* values, int size) {
  const int width = WidthOf(field.array);
  if (width == 0) return;
  std::set<int> rows;
  for (const int at : field.indices) rows.insert(at / width);
  for (const int row : rows) {
    vectors_.push_back({.values = values, .size = size, .begin = row * width, .width = width, .nominal = {}});
    std::copy_n(vectors_.back().In(0), width, vectors_.back().nominal.begin());
  }
}

void UnitVectors::Reset(int lane) const {
  for (const Vector& vector : vectors_) std::copy_n(vector.nominal.begin(), vector.width, vector.In(lane));
}

void UnitVectors::Normalize(int lane) const {
  for (const Vector& vector : vectors_) {
    double* const numbers = vector.In(lane);
    const double length = mju_norm(numbers, vector.width);
    if (length < mjMINVAL) {  // no direction: as in the model
      std::copy_n(vector.nominal.begin(), vector.width, numbers);
      continue;
    }
    // What has it already keeps its bits.
    if (std::abs(length - 1) > mjMINVAL) mju_scl(numbers, numbers, 1 / length, vector.width);
  }
}

}  // namespace oted
