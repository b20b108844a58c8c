#include "oted/nn/policy.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/data/npz.h"
#include "oted/nn/categorical_policy.h"
#include "oted/nn/planner_policy.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {

std::unique_ptr<Policy> LoadPolicy(const std::filesystem::path& path) {
  if (path.extension() == ".onnx") {
    throw UsageError(
        fmt::format("'{}' is an ONNX model, which 'oted evaluate' alone takes; name a policy.npz", path.string()));
  }
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
