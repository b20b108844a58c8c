#include "oted/proposal/parameter_candidates.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/proposal/log_facts.h"
#include "oted/proposal/widened_fit.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/suspect_name.h"

namespace oted {
namespace {

constexpr size_t kFewJoints = 3;      // that get parameters of their own
constexpr size_t kMostOwnJoints = 8;  // the same of values: joints of different sizes have no common friction
constexpr double kMoves = 1e-3;       // [rad, m], standard deviation of a joint that moves
constexpr double kLongestDelay_s = 0.03;
constexpr double kMostSpringOff = 0.5;  // [rad, m], of where it rests

/// The value below which 95 % of the sizes lie.
double MostOf(std::vector<double> values) {
  if (values.empty()) return 0;
  for (double& value : values) value = std::abs(value);
  const auto at = values.begin() + static_cast<ptrdiff_t>(0.95 * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

std::vector<double> Column(const Array2<double>& rows, int column) {
  std::vector<double> values;
  for (int i = 0; i < rows.rows(); ++i) values.push_back(rows(i, column));
  return values;
}

/// A joint as the logs show it.
struct Moving {
  const ModelOutline::Joint* joint = nullptr;
  double speed = 0;  ///< [rad/s, m/s] that is rarely exceeded
  double force = 0;  ///< [N m, N] that acted on it, roughly
  bool driven = true;
};

class CandidateList {
 public:
  CandidateList(const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model,
                std::vector<std::string>& left_out)
      : nominal_(nominal), spec_(nominal.spec()), dataset_(dataset), model_(model), left_out_(left_out) {
    for (size_t j = 0; j < model.joints.size(); ++j) AddJoint(j);
  }

  std::vector<ParameterSpec> All() {
    if (moving_.empty() && floating_.empty()) {
      left_out_.emplace_back("joints: none of those in the logs moves");
    }
    Tendons();
    if (!moving_.empty()) {
      PerJoint("frictionloss", [](const Moving& m) { return 0.5 * m.force; }, {0, 10});
      PerJoint("damping", [](const Moving& m) { return m.force / m.speed; }, {0, 10});
      // In an arm of many joints a drive's rotor behind its gears weighs as much as the arm, however light its link.
      const double inertia =
          moving_.size() > kFewJoints ? Typical([](const Moving& m) { return m.joint->inertia; }) : 0;
      PerJoint("armature", [&](const Moving& m) { return std::max(m.joint->inertia, inertia); }, {0.2, 5, true});
    }
    if (!moving_.empty() || !floating_.empty()) {
      Drives();
      Masses();
      Surroundings();
    }
    Add({"friction", "geom/*/friction[0]", 0.3, 3, ParameterScale::kNominal, true});
    const double steps = std::clamp(std::round(kLongestDelay_s / spec_.control_period_s), 1.0, kMostDelay);
    Add({"delay", kDelayPath, 0, steps, ParameterScale::kAbsolute});
    return std::move(candidates_);
  }

 private:
  int ChannelOf(const std::string& path) const {
    const auto at = std::ranges::find(spec_.observation_names, path);
    return at == spec_.observation_names.end() ? -1 : static_cast<int>(at - spec_.observation_names.begin());
  }

  void AddJoint(size_t j) {
    const ModelOutline::Joint& joint = model_.joints[j];
    if (!joint.has_one_number()) {
      if (Floats(joint)) floating_.push_back(&joint);
      return;
    }
    const int q = ChannelOf(fmt::format("joint/{}/qpos", joint.name));
    if (q < 0) return;
    if (StandardDeviation(Column(dataset_.observations, q)) < kMoves) {
      left_out_.push_back(fmt::format("joint {}: it hardly moves in the logs", joint.name));
      return;
    }
    Moving moving{.joint = &joint, .driven = IsDriven(joint)};
    std::vector<double> speeds;
    for (int i = 0; i < dataset_.size(); ++i) {
      speeds.push_back((dataset_.next_observations(i, q) - dataset_.observations(i, q)) / spec_.control_period_s);
    }
    moving.speed = MostOf(speeds);
    // Without a force in the logs: what it takes to bring its inertia to that speed in a fifth of a second.
    moving.force = 5 * joint.inertia * moving.speed;
    for (const ModelOutline::Actuator& actuator : model_.actuators) {
      if (actuator.joint == static_cast<int>(j)) moving.force = std::max(moving.force, ForceOf(actuator));
      if (actuator.tendon < 0) continue;
      for (const auto& part : model_.tendons[static_cast<size_t>(actuator.tendon)].joints) {
        if (part.joint != static_cast<int>(j)) continue;
        moving.force = std::max(moving.force, std::abs(part.length) * ForceOf(actuator));
      }
    }
    if (model_.actuators.empty()) {
      moving.force = std::max(moving.force, LoggedForce(fmt::format("actuator/{}", joint.name)));
    }
    if (moving.speed > 0 && moving.force > 0) moving_.push_back(moving);
  }

  /// Where nothing drives the model, joints have motors if the logs have their torques; without any, all count.
  bool IsDriven(const ModelOutline::Joint& joint) const {
    if (!model_.actuators.empty()) return joint.actuated;
    return spec_.action_names.empty() ||
           std::ranges::find(spec_.action_names, "actuator/" + joint.name) != spec_.action_names.end();
  }

  /// Whether the logs show a free or ball joint that moves.
  bool Floats(const ModelOutline::Joint& joint) const {
    for (size_t j = 0; j < spec_.observation_names.size(); ++j) {
      if (!spec_.observation_names[j].starts_with(fmt::format("joint/{}/qpos[", joint.name))) continue;
      if (StandardDeviation(Column(dataset_.observations, static_cast<int>(j))) >= kMoves) return true;
    }
    return false;
  }

  double LoggedForce(const std::string& action) const {
    const auto at = std::ranges::find(spec_.action_names, action);
    if (at == spec_.action_names.end()) return 0;
    return MostOf(Column(dataset_.actions, static_cast<int>(at - spec_.action_names.begin())));
  }

  double ForceOf(const ModelOutline::Actuator& actuator) const {
    if (actuator.drive == DriveKind::kMotor) {
      return std::min(actuator.most_force, actuator.force_per_control * LoggedForce("actuator/" + actuator.name));
    }
    return std::isfinite(actuator.most_force) ? actuator.most_force / 2 : 0;
  }

  bool Exists(const std::string& path) const {
    try {
      if (!IsChannelPath(path)) nominal_.Describe(path);
      return true;
    } catch (const UsageError&) {
      return false;  // this model has none
    }
  }

  void Add(ParameterSpec spec) {
    if (!Exists(spec.field)) return;
    std::erase(spec.name, '#');
    spec.name = BareKey(std::move(spec.name));
    candidates_.push_back(std::move(spec));
  }

  struct Multiple {
    double low, high;        ///< searched as a logarithm, unless there may be none of it
    bool of_drives = false;  ///< as a rotor's inertia: joints that nothing drives have what the model says alone
  };

  /// A field of joints: multiples of what the model has, or up to `most` where it has next to nothing.
  template <class Most>
  void PerJoint(const std::string& field, Most most, Multiple multiple) {
    const double typical = Typical(most);
    const std::string shared = fmt::format("joint/{}/{}", Shared(), field);
    const bool are_values =
        moving_.size() <= kMostOwnJoints && Exists(shared) && HasNextToNothing(shared, typical, multiple);
    if (moving_.size() <= kFewJoints || are_values) {
      for (const Moving& m : moving_) {
        const std::string name = moving_.size() == 1 ? field : fmt::format("{}_{}", field, m.joint->name);
        const std::string path = fmt::format("joint/{}/{}", m.joint->name, field);
        if (multiple.of_drives && !m.driven && HasNextToNothing(path, most(m), multiple)) continue;
        AddField(name, path, most(m), multiple);
      }
      return;
    }
    AddField(field, shared, typical, multiple);
    if (Shared() != "*") PerPassiveJoint(field, most, multiple);
  }

  /// The same of a few joints that nothing drives, such as a load on a rope, where the model has some of it: the driven
  /// ones' multiple is that of their gears.
  template <class Most>
  void PerPassiveJoint(const std::string& field, Most most, Multiple multiple) {
    const auto path = [&](const Moving& m) { return fmt::format("joint/{}/{}", m.joint->name, field); };
    std::vector<const Moving*> passive;
    for (const Moving& m : moving_) {
      const bool is_shared = SharedHas("joint", field, m.joint->name);
      if (!is_shared && !HasNextToNothing(path(m), most(m), multiple)) passive.push_back(&m);
    }
    if (passive.size() > kFewJoints) return;
    for (const Moving* m : passive) AddField(fmt::format("{}_{}", field, m->joint->name), path(*m), most(*m), multiple);
  }

  /// The middle one of what `of` says of the joints that move.
  template <class Of>
  double Typical(Of of) const {
    std::vector<double> each;
    for (const Moving& m : moving_) each.push_back(of(m));
    std::ranges::sort(each);
    return each[each.size() / 2];
  }

  std::string Shared() const {
    const bool driven = model_.actuators.empty() ||
                        std::ranges::any_of(model_.joints, [](const auto& joint) { return joint.actuated; });
    return driven ? "@actuated" : "*";
  }

  /// Whether what Shared names has this one: a joint that is driven through a tendon is one of them.
  bool SharedHas(const std::string& kind, const std::string& field, const std::string& name) const {
    const PathInfo info = nominal_.Describe(fmt::format("{}/{}/{}", kind, Shared(), field));
    return std::ranges::any_of(info.places, [path = fmt::format("{}/{}/{}", kind, name, field)](const auto& place) {
      return place.path == path;
    });
  }

  /// Whether the model has so little of a field that multiples of it lead nowhere, beside `most` of it.
  bool HasNextToNothing(const std::string& path, double most, Multiple multiple) const {
    double largest = 0;
    bool equal = true;
    const PathInfo info = nominal_.Describe(path);
    for (const ParameterPlace& place : info.places) {
      largest = std::max(largest, place.nominal);
      equal = equal && place.nominal == info.places.front().nominal;
    }
    return equal && multiple.high * largest < 0.1 * most;
  }

  void AddField(const std::string& name, const std::string& path, double most, Multiple multiple) {
    if (!Exists(path)) return;
    if (HasNextToNothing(path, most, multiple)) {
      Add({name, path, 0, RoundedUp(most), ParameterScale::kAbsolute});
    } else {
      Add({name, path, multiple.low, multiple.high, ParameterScale::kNominal, multiple.low > 0});
    }
  }

  /// Friction and damping of a gearbox that turns one part against another: of the tendon, not of the joints.
  void Tendons() {
    std::vector<const ModelOutline::Actuator*> drives;
    for (const ModelOutline::Actuator& actuator : model_.actuators) {
      if (actuator.tendon >= 0 && SpeedOf(TendonOf(actuator)) > 0) drives.push_back(&actuator);
    }
    if (drives.size() > kFewJoints) {
      const auto by_force = [&](const auto* drive) { return ForceOf(*drive); };
      AddTendon("*", "tendon", **std::ranges::max_element(drives, {}, by_force));
      return;
    }
    for (const ModelOutline::Actuator* drive : drives) {
      const std::string& tendon = TendonOf(*drive).name;
      AddTendon(tendon, drives.size() == 1 ? "tendon" : tendon, *drive);
    }
  }

  /// @param which  tendons, as a path names them
  void AddTendon(const std::string& which, const std::string& name, const ModelOutline::Actuator& drive) {
    const double force = ForceOf(drive);
    if (!(force > 0)) return;
    AddField(name + "_frictionloss", fmt::format("tendon/{}/frictionloss", which), 0.5 * force, {0, 10});
    AddField(name + "_damping", fmt::format("tendon/{}/damping", which), force / SpeedOf(TendonOf(drive)), {0, 10});
  }

  const ModelOutline::Tendon& TendonOf(const ModelOutline::Actuator& actuator) const {
    return model_.tendons[static_cast<size_t>(actuator.tendon)];
  }

  /// At most, by the joints of a fixed tendon that move in the logs; 0: none does.
  double SpeedOf(const ModelOutline::Tendon& tendon) const {
    double speed = 0;
    for (const auto& part : tendon.joints) {
      for (const Moving& m : moving_) {
        if (m.joint == &model_.joints[static_cast<size_t>(part.joint)]) speed += std::abs(part.length) * m.speed;
      }
    }
    return speed;
  }

  void Drives() {
    std::vector<std::string> motors, servos, speed_servos;
    bool all_motors = true;
    for (const ModelOutline::Actuator& actuator : model_.actuators) {
      all_motors = all_motors && actuator.drive == DriveKind::kMotor;
      if (actuator.drive == DriveKind::kPositionServo) servos.push_back(actuator.name);
      if (actuator.drive == DriveKind::kVelocityServo) speed_servos.push_back(actuator.name);
      const bool logged =
          std::ranges::find(spec_.action_names, "actuator/" + actuator.name) != spec_.action_names.end();
      if (actuator.drive == DriveKind::kMotor && logged) motors.push_back(actuator.name);
      if (actuator.drive == DriveKind::kOther && logged) {
        left_out_.push_back(fmt::format(
            "actuator {}: neither a motor nor a servo; 'oted params list' shows its numbers", actuator.name));
      }
    }
    if (model_.actuators.empty()) {
      for (const std::string& name : spec_.action_names) motors.push_back(name.substr(name.find('/') + 1));
    }
    PerDrive("servo_stiffness", servos, "kp");
    // No log tells it from the joints' own damping, which is a candidate.
    const auto leave_out_damping = [&](DriveKind kind, const char* what) {
      if (std::ranges::none_of(model_.actuators, [&](const auto& a) { return a.drive == kind && a.damping != 0; })) {
        return;
      }
      left_out_.push_back(
          fmt::format("{} (actuator/*/kv): it acts as the damping of what they drive does; it stays as in the model; "
                      "or free it in the place of that damping",
                      what));
    };
    leave_out_damping(DriveKind::kPositionServo, "damping of servos");
    leave_out_damping(DriveKind::kMotor, "back-EMF of motors");
    PerDrive("servo_gain", speed_servos, "kv");
    if (all_motors || motors.size() <= kFewJoints) PerDrive("gain", motors, "gainprm[0]");
    if (model_.has_activations) AddMultiple("drive_lag", "actuator/*/dynprm[0]");
  }

  /// What else the model has of springs, and of what it moves in.
  void Surroundings() {
    Springs();
    AddMultiple("tendon_stiffness", "tendon/*/stiffness");
    const auto is_tendon_damping = [](const ParameterSpec& spec) {
      return spec.field.starts_with("tendon/") && spec.field.ends_with("/damping");
    };
    if (std::ranges::none_of(candidates_, is_tendon_damping)) AddMultiple("tendon_damping", "tendon/*/damping");
    AddMultiple("viscosity", "opt/viscosity");
    AddMultiple("density", "opt/density");
  }

  /// How stiff springs are and where they rest, of each of few joints that move; of many, one multiple of all.
  void Springs() {
    std::vector<const Moving*> sprung;
    for (const Moving& m : moving_) {
      if (HasSome(fmt::format("joint/{}/stiffness", m.joint->name))) sprung.push_back(&m);
    }
    if (sprung.empty() || sprung.size() > kFewJoints) {
      AddMultiple("stiffness", "joint/*/stiffness");
      return;
    }
    const auto named = [&](const char* field, const Moving& m) {
      return sprung.size() == 1 ? std::string(field) : fmt::format("{}_{}", field, m.joint->name);
    };
    for (const Moving* m : sprung) {
      AddMultiple(named("stiffness", *m), fmt::format("joint/{}/stiffness", m->joint->name));
    }
    for (const Moving* m : sprung) {
      const std::string path = fmt::format("joint/{}/springref", m->joint->name);
      const double rests = nominal_.Describe(path).places.front().nominal;
      Add({named("springref", *m), path, rests - kMostSpringOff, rests + kMostSpringOff, ParameterScale::kAbsolute});
    }
  }

  bool HasSome(const std::string& path) const {
    if (!Exists(path)) return false;
    const PathInfo info = nominal_.Describe(path);
    return std::ranges::any_of(info.places, [](const ParameterPlace& place) { return place.nominal != 0; });
  }

  /// Multiples of a field, where the model has any of it.
  void AddMultiple(const std::string& name, const std::string& path) {
    if (HasSome(path)) Add({name, path, 0.3, 3, ParameterScale::kNominal, true});
  }

  /// One for each of few drives, one for all of many.
  void PerDrive(const std::string& name, const std::vector<std::string>& drives, const std::string& field) {
    if (drives.size() > kFewJoints) {
      Add({name, "actuator/*/" + field, 0.5, 2, ParameterScale::kNominal, true});
      return;
    }
    for (const std::string& drive : drives) {
      Add({drives.size() == 1 ? name : name + "_" + drive, fmt::format("actuator/{}/{}", drive, field), 0.5, 2,
           ParameterScale::kNominal, true});
    }
  }

  /// @param most  multiple of it
  void AddMass(const std::string& name, const std::string& body, double most) {
    Add({name, fmt::format("body/{0}/mass + body/{0}/inertia", body), 0.5, most, ParameterScale::kNominal, true});
  }

  /// Bodies of joints that nothing drives, such as the trunk of what hops in a plane: "@actuated" leaves them out.
  std::set<std::string> Undriven() const {
    std::set<std::string> bodies;
    if (Shared() == "*") return bodies;
    for (const Moving& m : moving_) {
      if (!SharedHas("body", "mass", m.joint->body)) bodies.insert(m.joint->body);
    }
    return bodies;
  }

  void Masses() {
    constexpr double kMost = 2, kMostOfHand = 5;  // a light hand may carry several times its own mass
    for (const ModelOutline::Joint* joint : floating_) {
      // What flies, drives or walks carries most of its mass, and its payload, there.
      AddMass(moving_.empty() && floating_.size() == 1 ? "mass" : "mass_" + joint->body, joint->body, kMost);
    }
    if (moving_.empty()) return;
    std::vector<std::string> bodies;
    std::set<std::string> fastened;
    for (const Moving& m : moving_) {
      if (std::ranges::find(bodies, m.joint->body) != bodies.end()) continue;
      bodies.push_back(m.joint->body);
      std::ranges::copy(m.joint->fastened, std::back_inserter(bodies));
      fastened.insert(m.joint->fastened.begin(), m.joint->fastened.end());
    }
    const bool are_many = moving_.size() > kFewJoints;
    if (are_many) {
      AddMass("mass", Shared(), kMost);
      const std::set<std::string> undriven = Undriven();
      std::erase_if(bodies, [&](const auto& body) { return !fastened.contains(body) && !undriven.contains(body); });
      if (bodies.size() > kFewJoints) {
        left_out_.push_back(
            fmt::format("masses of {}: each needs a parameter of its own, and they are many", fmt::join(bodies, ", ")));
        return;
      }
    }
    // The last first: what it carries is known least.
    std::ranges::reverse(bodies);
    for (const std::string& body : bodies) {
      AddMass(bodies.size() == 1 && !are_many ? "mass" : "mass_" + body, body,
              fastened.contains(body) ? kMostOfHand : kMost);
    }
  }

  const SimulatorFactory& nominal_;
  const SimulatorSpec& spec_;
  const Dataset& dataset_;
  const ModelOutline& model_;
  std::vector<Moving> moving_;
  std::vector<const ModelOutline::Joint*> floating_;  ///< joints of more than one number that move
  std::vector<ParameterSpec> candidates_;
  std::vector<std::string>& left_out_;
};

}  // namespace

std::vector<ParameterSpec> ParameterCandidates(const SimulatorFactory& nominal, const Dataset& dataset,
                                               const ModelOutline& model, std::vector<std::string>& left_out) {
  return CandidateList(nominal, dataset, model, left_out).All();
}

}  // namespace oted
