#pragma once
/// Parameter paths: from "geom/*/friction[0]" to places in an mjModel.
///
/// A path is owner/objects/field or opt/field. Owners: geom, body, joint, actuator, site, tendon, equality, pair.
/// Objects are matched by name with * and ?, or by "#id"; * matches unnamed ones too. "@actuated" stands for the joints
/// that an actuator drives, itself or through a tendon, and of bodies for those that such a joint moves. The field is
/// mjModel's name without its prefix ("friction" of geom_friction; a joint also owns dof_damping, dof_armature,
/// dof_frictionloss). An index in brackets picks one number per object; [*] or none takes all of them.
///
/// A joint also has stribeck_torque, stribeck_velocity and load_friction (joint_friction.h) and residual
/// (joint_residual.h), which no mjModel holds.
/// An actuator also has kp and kv, the stiffness and the damping of a servo, which MuJoCo keeps in several places (kv
/// is a motor's back-EMF, too), and force_limit, the largest force in either direction; a joint springref, where its
/// spring rests: qpos_spring. "PATH + PATH" ties paths together: one z drives them all.

#include <mujoco/mujoco.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// What one parameter writes into one array.
struct ModelField {
  size_t parameter = 0;             ///< whose place in the parameter space
  std::string array;                ///< as mjb_expand names it: "geom_friction", "opt.gravity"
  std::vector<int> indices;         ///< into that array, ascending, at least one
  std::vector<double> nominal;      ///< the pristine values at those indices
  double sign = 1;                  ///< -1 where the array holds the negative of what the path names (a servo's bias)
  std::string unit;                 ///< of these values; "" where they have none
  std::vector<std::string> places;  ///< the path of each index alone: "geom/foot_geom/friction[0]"
  bool changes_constants =
      false;  ///< constants that MuJoCo derives at compilation depend on it: mjb_setConst is needed
};

/// Finds what `path` names, at least one. @throws UsageError saying which part matches nothing, with the nearest name.
std::vector<ModelField> ResolvePath(const mjModel& model, const std::string& path);

/// Whether both write some number.
bool SharePlace(const ModelField& a, const ModelField& b);

/// The numbers that all of these write: array and index.
using Places = std::set<std::pair<std::string, int>>;
Places PlacesOf(const std::vector<ModelField>& fields);
/// Whether `whole` has all of them, and more.
bool IsPartOf(const Places& part, const Places& whole);

/// The radius of the sphere around a geom's centre that contains it, as MuJoCo's compiler computes geom_rbound, for the
/// shapes that geom_size alone describes; `otherwise` for planes, meshes and height fields. `size` has 3 numbers [m].
double BoundingRadius(int geom_type, const double* size, double otherwise);

/// Resolves a parameter and completes it: an absolute one gets its nominal value and unit from the model.
/// @throws UsageError also when a multiple of 0 was asked for, or an absolute value for places that differ.
std::vector<ModelField> ResolveParameter(const mjModel& model, ParameterSpec& spec);

}  // namespace oted
