#include "oted/nn/policy.h"

#include "oted/data/npz.h"
#include "oted/nn/categorical_policy.h"
#include "oted/nn/planner_policy.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {

std::unique_ptr<Policy> LoadPolicy(const std::filesystem::path& path) {
  const NpzArrays arrays = ReadNpz(path);
  if (arrays.contains(CategoricalPolicy::kMark)) {
    return std::make_unique<CategoricalPolicy>(CategoricalPolicy::FromArrays(arrays, path));
  }
  if (arrays.contains(PlannerPolicy::kMark)) {
    return std::make_unique<PlannerPolicy>(PlannerPolicy::FromArrays(arrays, path));
  }
  return std::make_unique<TanhGaussianPolicy>(TanhGaussianPolicy::FromArrays(arrays, path));
}

}  // namespace oted
