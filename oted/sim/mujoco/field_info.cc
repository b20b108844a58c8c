#include "oted/sim/mujoco/field_info.h"

#include <map>

namespace oted {
namespace {

/// Units of an object's numbers: one for all of them, or one each. "1" is none.
struct Row {
  std::vector<const char*> units;
  const char* meaning;
};

constexpr const char* kRotational = "m | rad";
constexpr const char* kSolverReference =
    "solver: time constant and damping ratio of a soft constraint (or minus its stiffness and damping)";
constexpr const char* kSolverImpedance = "solver: impedance of a soft constraint (dmin, dmax, width, midpoint, power)";
constexpr const char* kPolynomial = "coefficients of its higher-order terms";
constexpr const char* kOrientation = "orientation in the parent's frame, a quaternion";

// MuJoCo has no units of its own; these hold for a model in metres, kilograms, seconds and radians.
using Rows = std::map<std::string_view, Row>;

/// Of bodies, their geoms and sites, and of what holds them together.
Rows BodyFields() {
  return {
      {"geom_solmix", {{"1"}, "weight of its contact parameters where two geoms meet"}},
      {"geom_solref", {{"s", "1"}, kSolverReference}},
      {"geom_solimp", {{"1", "1", "m", "1", "1"}, kSolverImpedance}},
      {"geom_size", {{"m"}, "radius, half lengths: by the geom's shape"}},
      {"geom_pos", {{"m"}, "position in its body's frame"}},
      {"geom_quat", {{"1"}, kOrientation}},
      {"geom_friction",
       {{"1", "m", "m"}, "contact friction: sliding, torsional, rolling; the larger of two geoms counts"}},
      {"geom_margin", {{"m"}, "distance at which contact forces begin"}},
      {"geom_gap", {{"m"}, "part of the margin without force"}},
      {"geom_surfacevel",
       {{"m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s"}, "velocity of its surface: a conveyor belt"}},
      {"geom_adhesion", {{"N"}, "adhesive force of its contacts"}},
      {"geom_fluid", {{"1"}, "coefficients of its drag and lift in the medium"}},
      {"body_pos", {{"m"}, "position in the parent's frame: lengths of links"}},
      {"body_quat", {{"1"}, kOrientation}},
      {"body_ipos", {{"m"}, "centre of mass in the body's frame"}},
      {"body_iquat", {{"1"}, "orientation of its principal axes of inertia, a quaternion"}},
      {"body_mass", {{"kg"}, "mass"}},
      {"body_inertia", {{"kg m^2"}, "principal moments of inertia"}},
      {"body_gravcomp", {{"1"}, "part of its weight that is compensated"}},
      {"body_margin", {{"m"}, "largest margin of its geoms"}},
      {"site_size", {{"m"}, "size: of touch sensors the volume that they watch"}},
      {"site_pos", {{"m"}, "position in its body's frame: where a sensor sits"}},
      {"site_quat", {{"1"}, kOrientation}},
      {"eq_solref", {{"s", "1"}, kSolverReference}},
      {"eq_solimp", {{"1"}, kSolverImpedance}},
      {"eq_data", {{"1"}, "what the constraint holds: anchors, poses or coefficients"}},
      {"pair_solref", {{"s", "1"}, kSolverReference}},
      {"pair_solreffriction", {{"s", "1"}, kSolverReference}},
      {"pair_solimp", {{"1", "1", "m", "1", "1"}, kSolverImpedance}},
      {"pair_margin", {{"m"}, "distance at which contact forces begin"}},
      {"pair_gap", {{"m"}, "part of the margin without force"}},
      {"pair_adhesion", {{"N"}, "adhesive force of its contacts"}},
      {"pair_friction", {{"1", "1", "m", "m", "m"}, "friction of this pair: two sliding, torsional, two rolling"}},
  };
}

/// Of joints, and of what drives them.
Rows JointFields() {
  return {
      {"jnt_solref", {{"s", "1"}, kSolverReference}},
      {"jnt_solimp", {{"1", "1", "m | rad", "1", "1"}, kSolverImpedance}},
      {"jnt_pos", {{"m"}, "its anchor in the body's frame"}},
      {"jnt_axis", {{"1"}, "its axis in the body's frame"}},
      {"jnt_stiffness", {{"N/m | N m/rad"}, "stiffness of its spring"}},
      {"jnt_stiffnesspoly", {{"1"}, kPolynomial}},
      {"jnt_springyield", {{kRotational}, "deflection at which its spring yields"}},
      {"jnt_range", {{kRotational}, "its limits: low, high"}},
      {"jnt_actfrcrange", {{"N | N m"}, "limits of the actuators' force on it: low, high"}},
      {"jnt_margin", {{kRotational}, "distance from the limit at which its force begins"}},
      {"dof_solref", {{"s", "1"}, kSolverReference}},
      {"dof_solimp", {{"1"}, kSolverImpedance}},
      {"dof_frictionloss", {{"N | N m"}, "dry friction"}},
      {"dof_stribeck_torque", {{"N | N m"}, "dry friction at rest beyond frictionloss; not in MJCF"}},
      {"dof_stribeck_velocity",
       {{"m/s | rad/s"}, "speed at which a share 1/e of stribeck_torque is left; not in MJCF"}},
      {"dof_load_friction", {{"1"}, "dry friction per force of the joint's actuators; not in MJCF"}},
      {"dof_residual",
       {{"N | N m", "N | N m", "N | N m", "N | N m", "N | N m", "N | N m", "N s^2/m^2 | N m s^2/rad^2"},
        "a force that the model lacks: weights of 1, sin q, cos q, sin 2q, cos 2q, tanh v, v|v|; not in MJCF"}},
      {"dof_armature", {{"kg | kg m^2"}, "inertia of rotor and gearbox at the joint"}},
      {"dof_damping", {{"N s/m | N m s/rad"}, "viscous friction"}},
      {"dof_dampingpoly", {{"1"}, kPolynomial}},
      {"actuator_cranklength", {{"m"}, "crank of a slider-crank"}},
      {"actuator_dynprm", {{"1"}, "activation dynamics; [0] is a filter's time constant in s"}},
      {"actuator_gainprm", {{"1"}, "gain; [0] is force per control: a motor's strength, a position servo's kp"}},
      {"actuator_biasprm", {{"1"}, "bias: constant, per length ([1] = -kp), per velocity ([2] = -kv)"}},
      {"actuator_actrange", {{"1"}, "limits of its activation: low, high"}},
      {"actuator_delay", {{"s"}, "MuJoCo's own delay, for actuators that keep a history; else see action/delay"}},
      {"actuator_damping", {{"N s/m | N m s/rad"}, "viscous friction of the drive"}},
      {"actuator_dampingpoly", {{"1"}, kPolynomial}},
      {"actuator_armature", {{"kg | kg m^2"}, "inertia that the drive adds to its joint"}},
      {"actuator_forcerange", {{"N | N m"}, "limits of its force: low, high"}},
      {"actuator_ctrlrange", {{"1"}, "limits of its control: low, high"}},
      {"actuator_gear", {{"1"}, "transmission; [0] scales length and force"}},
      {"actuator_lengthrange", {{kRotational}, "range of its length: low, high"}},
      {"tendon_width", {{"m"}, "width, as it is drawn"}},
      {"tendon_solref_lim", {{"s", "1"}, kSolverReference}},
      {"tendon_solimp_lim", {{"1"}, kSolverImpedance}},
      {"tendon_solref_fri", {{"s", "1"}, kSolverReference}},
      {"tendon_solimp_fri", {{"1"}, kSolverImpedance}},
      {"tendon_range", {{kRotational}, "limits of its length: low, high"}},
      {"tendon_actfrcrange", {{"N | N m"}, "limits of the actuators' force on it: low, high"}},
      {"tendon_margin", {{kRotational}, "distance from the limit at which its force begins"}},
      {"tendon_stiffness", {{"N/m | N m/rad"}, "stiffness"}},
      {"tendon_stiffnesspoly", {{"1"}, kPolynomial}},
      {"tendon_damping", {{"N s/m | N m s/rad"}, "viscous friction"}},
      {"tendon_dampingpoly", {{"1"}, kPolynomial}},
      {"tendon_armature", {{"kg | kg m^2"}, "inertia that it moves with"}},
      {"tendon_frictionloss", {{"N | N m"}, "dry friction"}},
      {"tendon_lengthspring", {{kRotational}, "lengths between which its spring is slack: low, high"}},
      {"tendon_springyield", {{kRotational}, "deflection at which its spring yields"}},
  };
}

/// Of the whole model.
Rows OptionFields() {
  return {
      {"impratio", {{"1"}, "frictional over normal impedance of contacts: higher slips less"}},
      {"tolerance", {{"1"}, "solver: relative improvement at which it stops"}},
      {"ls_tolerance", {{"1"}, "solver: tolerance of its line search"}},
      {"noslip_tolerance", {{"1"}, "solver: tolerance of the pass against slip"}},
      {"ccd_tolerance", {{"m"}, "solver: tolerance of convex collision"}},
      {"sleep_tolerance", {{"m/s"}, "velocity below which bodies sleep"}},
      {"gravity", {{"m/s^2"}, "gravity along x, y, z"}},
      {"wind", {{"m/s"}, "velocity of the medium along x, y, z"}},
      {"magnetic", {{"T"}, "magnetic flux along x, y, z"}},
      {"density", {{"kg/m^3"}, "density of the medium"}},
      {"viscosity", {{"Pa s"}, "viscosity of the medium"}},
      {"o_margin", {{"m"}, "margin of all contacts, where override is on"}},
      {"o_solref", {{"s", "1"}, "contacts' solref, where override is on"}},
      {"o_solimp", {{"1", "1", "m", "1", "1"}, "contacts' solimp, where override is on"}},
      {"o_friction", {{"1", "1", "m", "m", "m"}, "contacts' friction, where override is on"}},
  };
}

const Rows& Table() {
  static const Rows table = [] {
    Rows all = BodyFields();
    all.merge(JointFields());
    all.merge(OptionFields());
    return all;
  }();
  return table;
}

}  // namespace

FieldInfo DescribeField(std::string_view name, int index) {
  const auto found = Table().find(name);
  if (found == Table().end()) return {};
  const std::vector<const char*>& units = found->second.units;
  FieldInfo info{"", found->second.meaning};
  if (units.size() == 1) {
    info.unit = units[0];
  } else if (index >= 0) {
    info.unit = static_cast<size_t>(index) < units.size() ? units[static_cast<size_t>(index)] : "1";
  } else {
    for (const char* unit : units) info.unit += (info.unit.empty() ? "" : ", ") + std::string(unit);
  }
  if (info.unit == "1") info.unit.clear();
  return info;
}

std::vector<std::string> DescribedFields() {
  std::vector<std::string> names;
  for (const auto& [name, row] : Table()) names.emplace_back(name);
  return names;
}

std::string PickUnit(const std::string& unit, bool slides) {
  constexpr std::string_view kOr = " | ";
  const size_t at = unit.find(kOr);
  if (at == std::string::npos || unit.find(',') != std::string::npos) return unit;
  return slides ? unit.substr(0, at) : unit.substr(at + kOr.size());
}

}  // namespace oted
