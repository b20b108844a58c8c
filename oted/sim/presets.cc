#include "oted/sim/presets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <span>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/residual_terms.h"

namespace oted {
namespace {

constexpr const char* kServo = "gain alone would move a servo's set point; see servo_stiffness";

constexpr PresetEntry kFriction = {"friction", "geom/*/friction[0]", {{0.3, 3.0}}, true};
constexpr PresetEntry kGain = {
    "gain", "actuator/*/gainprm[0]", {{0.5, 2.0}}, true, {}, {{"actuator/*/kp", "actuator/*/kv"}}, kServo};
constexpr PresetEntry kDamping = {"damping", "joint/@actuated/damping", {{0.1, 10.0}}, true, {{0.0, 2.0}}};
constexpr PresetEntry kFrictionLoss = {
    "frictionloss", "joint/@actuated/frictionloss", {{0.1, 10.0}}, true, {{0.0, 2.0}}};
constexpr PresetEntry kArmature = {"armature", "joint/@actuated/armature", {{0.2, 5.0}}, true, {{0.0, 0.5}}};
constexpr PresetEntry kStiffness = {"servo_stiffness", "actuator/*/kp", {{0.5, 2.0}}, true};
constexpr PresetEntry kMass = {"mass", "body/@actuated/mass + body/@actuated/inertia", {{0.5, 2.0}}, true};
constexpr PresetEntry kResidual = {"residual", "joint/@actuated/residual", {}, false, {}, {},
                                   "",         kResidualTerms.data()};
constexpr double kBelievedShare = 0.15;  // of the reach: the standard deviation of what is believed to be near 0
constexpr PresetEntry kDelay = {"delay", "action/delay", {}, false, {{0.0, 3.0}}};

}  // namespace

const std::vector<Preset>& Presets() {
  static const std::vector<Preset> presets = {
      {"arm",
       "joints and links of a manipulator, and the delay of its commands",
       {kDamping, kFrictionLoss, kArmature, kGain, kStiffness, kMass, kDelay}},
      {"legs",
       "contact, joints and motors of a walking robot, and the delay of its commands",
       {kFriction, kGain, kStiffness, kDamping, kArmature, kMass, kDelay}},
      {"gripper",
       "contact, fingers and drives of a hand, and the delay of its commands",
       {kFriction,
        kGain,
        kStiffness,
        kDamping,
        kFrictionLoss,
        kArmature,
        {"tendon_stiffness", "tendon/*/stiffness", {{0.2, 5.0}}, true},
        {"tendon_damping", "tendon/*/damping", {{0.1, 10.0}}, true},
        kDelay}},
      {"gym",
       "friction, gain and gravity as in the paper, for Gymnasium's locomotion tasks",
       {{"friction", "geom/*/friction[0]", {{0.2, 2.0}}},
        {"gain", "actuator/*/gainprm[0]", {{0.2, 2.0}}},
        {"gravity", "opt/gravity[2]", {{0.2, 2.0}}}}},
      {"residual",
       "a small torque on each driven joint for what no other parameter explains, believed to be near zero; beside "
       "parameters of your own",
       {kResidual}},
  };
  return presets;
}

std::vector<std::string> PresetNames() {
  std::vector<std::string> names;
  for (const Preset& preset : Presets()) names.emplace_back(preset.name);
  return names;
}

const Preset& FindPreset(const std::string& name) {
  for (const Preset& preset : Presets()) {
    if (name == preset.name) return preset;
  }
  throw UsageError(fmt::format("'{}' is not a preset{}; there are {}", name, DidYouMean(name, PresetNames()),
                               fmt::join(PresetNames(), ", ")));
}

namespace {

PathInfo Describe(const SimulatorFactory& simulator, const std::string& path) {
  return IsChannelPath(path) ? DescribeChannel(simulator.spec(), path) : simulator.Describe(path);
}

/// Whether one of the paths sets a number of those.
bool SharesNumbers(const SimulatorFactory& simulator, const PathInfo& info, std::span<const char* const> paths) {
  std::set<std::string> numbers;
  for (const ParameterPlace& place : info.places) numbers.insert(place.path);
  return std::ranges::any_of(paths, [&](const char* path) {
    if (path == nullptr) return false;
    try {
      return std::ranges::any_of(Describe(simulator, path).places,
                                 [&](const ParameterPlace& place) { return numbers.contains(place.path); });
    } catch (const UsageError&) {
      return false;  // the model has none
    }
  });
}

bool AllZero(const PathInfo& info) {
  return std::all_of(info.places.begin(), info.places.end(), [](const ParameterPlace& p) { return p.nominal == 0; });
}

/// Why an entry cannot be had, or "" with `spec` filled in.
std::string Restrict(const PresetEntry& entry, const SimulatorFactory& simulator, PathInfo& info, ParameterSpec& spec) {
  try {
    info = Describe(simulator, entry.field);
  } catch (const UsageError&) {
    return "the model has none";
  }
  if (SharesNumbers(simulator, info, entry.set_with_others)) return entry.otherwise;
  spec.name = entry.name;
  spec.field = entry.field;
  if (entry.terms != nullptr) return "";
  const bool zero = AllZero(info);
  if (zero && !entry.absolute) return "the nominal value is 0, which has no multiples";
  if (!zero && !entry.multiple) return "the nominal value is not 0";
  const PresetEntry::Bounds bounds = zero ? *entry.absolute : *entry.multiple;
  spec.low = bounds.low;
  spec.high = bounds.high;
  spec.logarithmic = entry.logarithmic && !zero;
  if (zero) spec.scale = ParameterScale::kAbsolute;
  return "";
}

/// "joint/elbow/residual[2]" is elbow, and 2.
std::pair<std::string, size_t> OwnerAndIndex(const std::string& place) {
  const size_t owner = place.find('/') + 1, bracket = place.find('[');
  return {place.substr(owner, place.rfind('/') - owner), std::stoul(place.substr(bracket + 1))};
}

std::vector<ParameterSpec> EachOf(const PresetEntry& entry, const PathInfo& info) {
  std::vector<ParameterSpec> specs;
  for (const ParameterPlace& place : info.places) {
    const auto [owner, index] = OwnerAndIndex(place.path);
    specs.push_back({.name = fmt::format("{}_{}_{}", entry.name, owner, entry.terms[index]),
                     .field = place.path,
                     .low = -info.reach,
                     .high = info.reach,
                     .scale = ParameterScale::kAbsolute,
                     .prior = ParameterSpec::Belief{0, kBelievedShare * info.reach}});
  }
  return specs;
}

}  // namespace

ExpandedPresets ExpandPresets(const std::vector<std::string>& names, const std::vector<ParameterSpec>& own,
                              const SimulatorFactory& simulator) {
  ExpandedPresets expanded;
  std::set<std::string> own_places, taken;
  for (const ParameterSpec& spec : own) {
    for (const ParameterPlace& place : Describe(simulator, spec.field).places) own_places.insert(place.path);
  }
  const auto named = [&](const char* name) {
    return std::find_if(own.begin(), own.end(), [&](const ParameterSpec& spec) { return spec.name == name; });
  };
  for (const std::string& name : names) {
    for (const PresetEntry& entry : FindPreset(name).entries) {
      if (taken.contains(entry.name)) continue;
      if (const auto mine = named(entry.name); mine != own.end()) {
        expanded.parameters.push_back(*mine);
        taken.insert(entry.name);
        continue;
      }
      PathInfo info;
      ParameterSpec spec;
      std::string why = Restrict(entry, simulator, info, spec);
      const bool clash = std::any_of(info.places.begin(), info.places.end(),
                                     [&](const ParameterPlace& place) { return own_places.contains(place.path); });
      if (why.empty() && clash) why = "a parameter of your own sets the same values";
      if (why.empty() && entry.terms != nullptr) {
        std::ranges::move(EachOf(entry, info), std::back_inserter(expanded.parameters));
        expanded.has_beliefs = true;
        taken.insert(entry.name);
        continue;
      }
      if (!why.empty()) {
        expanded.skipped.push_back(fmt::format("{} of preset {} ({}): {}", entry.name, name, entry.field, why));
        continue;
      }
      expanded.parameters.push_back(spec);
      taken.insert(entry.name);
    }
  }
  for (const ParameterSpec& spec : own) {
    if (!taken.contains(spec.name)) expanded.parameters.push_back(spec);
  }
  return expanded;
}

}  // namespace oted
