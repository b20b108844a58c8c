#include "oted/sim/mujoco/force_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/object_path.h"

namespace oted {
namespace {

constexpr double kBeyond = 100;  // times the largest force

double LargestOf(const mjtNum* range) { return std::max(std::abs(range[0]), std::abs(range[1])); }

/// How long the drive's transmission becomes within the range of its joint; 0 without one.
double LongestWithinJoint(const mjModel& model, int actuator) {
  const int type = model.actuator_trntype[actuator], joint = model.actuator_trnid[2 * actuator];
  if ((type != mjTRN_JOINT && type != mjTRN_JOINTINPARENT) || model.jnt_limited[joint] == 0) return 0;
  return std::abs(model.actuator_gear[6 * model.actuator_outadr[actuator]]) * LargestOf(model.jnt_range + 2 * joint);
}

void SetLimit(mjModel& model, int actuator, double force) {
  model.actuator_forcelimited[actuator] = 1;
  model.actuator_forcerange[2 * actuator] = -force;
  model.actuator_forcerange[2 * actuator + 1] = force;
}

}  // namespace

double UnreachedForce(const mjModel& model, int actuator) {
  const int control = model.actuator_ctrladr[actuator], bias_type = model.actuator_biastype[actuator];
  const bool is_affine = model.actuator_gaintype[actuator] == mjGAIN_FIXED &&
                         (bias_type == mjBIAS_NONE || bias_type == mjBIAS_AFFINE) &&
                         model.actuator_dyntype[actuator] != mjDYN_INTEGRATOR;
  const bool has_range = model.actuator_ctrlnum[actuator] == 1 && model.actuator_ctrllimited[control] != 0;
  if (model.actuator_forcelimited[actuator] != 0 || !is_affine || !has_range) return 0;
  const double commanded = LargestOf(model.actuator_ctrlrange + 2 * control);
  double force = std::abs(model.actuator_gainprm[actuator * mjNGAIN]) * commanded;
  if (bias_type == mjBIAS_AFFINE) {
    const mjtNum* bias = model.actuator_biasprm + actuator * mjNBIAS;
    // A servo's joint is about where it is told to be, and turns about as fast.
    const double longest = std::max(commanded, LongestWithinJoint(model, actuator));
    force += std::abs(bias[0]) + (bias[1] != 0 ? std::abs(bias[1]) * longest : std::abs(bias[2]) * commanded);
  }
  return kBeyond * force;
}

void LetForcesBeLimited(const std::vector<ParameterSpec>& specs, LoadedModel& loaded) {
  std::map<int, double> limits;  // of actuators
  for (const ParameterSpec& spec : specs) {
    for (const ModelField& field : ResolvePath(*loaded.model, spec.field)) {
      if (field.array != "actuator_forcerange") continue;
      for (const int at : field.indices) {
        const int actuator = at / 2;
        if (loaded.model->actuator_forcelimited[actuator] != 0) continue;
        const double unreached = UnreachedForce(*loaded.model, actuator);
        if (unreached == 0) {
          throw UsageError(fmt::format(
              "parameter '{}': actuator '{}' has no force limit, and how large its force may become is not known (a "
              "control without ctrlrange, a muscle, an integrating drive); give it a forcerange in the model",
              spec.name, ObjectName(*loaded.model, mjOBJ_ACTUATOR, actuator)));
        }
        limits[actuator] = spec.IsMultiple() ? unreached : std::min(unreached, spec.high);
      }
    }
  }
  for (mjsElement* e = mjs_firstElement(loaded.spec.get(), mjOBJ_ACTUATOR); e != nullptr;
       e = mjs_nextElement(loaded.spec.get(), e)) {
    const auto limit = limits.find(mjs_getId(e));
    if (limit == limits.end()) continue;
    SetLimit(*loaded.model, limit->first, limit->second);
    mjsActuator& actuator = *mjs_asActuator(e);
    actuator.forcelimited = mjLIMITED_TRUE;
    actuator.forcerange[0] = -limit->second;
    actuator.forcerange[1] = limit->second;
  }
}

}  // namespace oted
