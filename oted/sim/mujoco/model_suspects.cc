#include "oted/sim/mujoco/model_suspects.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model_field.h"

namespace oted {
namespace {

constexpr int kMostBodies = 12;  // whose masses are suspected one by one
constexpr double kLow = 0.1, kHigh = 10.0;

std::vector<std::string> SuspectPaths(const mjModel& model) {
  std::vector<std::string> paths = {"joint/*/damping",   "joint/*/armature",   "joint/*/frictionloss",
                                    "joint/*/stiffness", "actuator/*/gear[0]", "geom/*/friction[0]",
                                    "opt/gravity[2]"};
  if (model.nbody - 1 > kMostBodies) {
    paths.push_back("body/*/mass");
    return paths;
  }
  for (int body = 1; body < model.nbody; ++body) {
    const char* name = model.names + model.name_bodyadr[body];
    paths.push_back(*name == 0 ? fmt::format("body/#{}/mass", body) : fmt::format("body/{}/mass", name));
  }
  return paths;
}

bool Overlap(const ModelField& a, const ModelField& b) {
  if (a.array != b.array) return false;
  return std::ranges::any_of(a.indices, [&](int i) { return std::ranges::find(b.indices, i) != b.indices.end(); });
}

}  // namespace

std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& searched) {
  std::vector<ModelField> taken;
  for (const ParameterSpec& spec : searched.specs()) taken.push_back(ResolvePath(model, spec.field));
  std::vector<ParameterSpec> suspects;
  for (const std::string& path : SuspectPaths(model)) {
    ParameterSpec spec = {.name = path, .field = path, .low = kLow, .high = kHigh, .logarithmic = true};
    try {
      const ModelField field = ResolveParameter(model, spec);
      if (std::ranges::any_of(taken, [&](const ModelField& other) { return Overlap(field, other); })) continue;
    } catch (const UsageError&) {
      continue;  // this model has none, or only zeros
    }
    suspects.push_back(spec);
  }
  return suspects;
}

}  // namespace oted
