#include "oted/sim/mujoco/object_path.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/glob.h"
#include "oted/sim/mujoco/tendon_joints.h"

namespace oted {

namespace {

// Joints that an actuator drives, itself or through a tendon.
std::vector<int> ActuatedJoints(const mjModel& model) {
  std::vector<int> joints;
  for (int i = 0; i < model.nactuator; ++i) {
    const int type = model.actuator_trntype[i], target = model.actuator_trnid[2 * i];
    if (type == mjTRN_JOINT || type == mjTRN_JOINTINPARENT) joints.push_back(target);
    if (type != mjTRN_TENDON) continue;
    for (const TendonJoint& joint : JointsOfTendon(model, target)) joints.push_back(joint.id);
  }
  return joints;
}

// "@actuated": what the actuators move, floating bases and loose objects left out.
std::vector<int> ActuatedObjects(const mjModel& model, mjtObj type, const std::string& what) {
  std::vector<int> ids;
  for (const int joint : ActuatedJoints(model)) ids.push_back(type == mjOBJ_JOINT ? joint : model.jnt_bodyid[joint]);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  if (ids.empty()) throw UsageError(fmt::format("{}: no actuator of this model drives a joint", what));
  return ids;
}

}  // namespace

FieldRef ParseField(std::string_view text, const std::string& what) {
  FieldRef ref{std::string(text)};
  const size_t open = text.find('[');
  if (open == std::string_view::npos) return ref;
  ref.name = text.substr(0, open);
  const std::string_view inside = text.substr(open + 1, text.size() - open - 2);
  if (text.back() != ']') throw UsageError(fmt::format("{}: '[' without a final ']'", what));
  if (inside == "*") return ref;
  const auto [end, error] = std::from_chars(inside.data(), inside.data() + inside.size(), ref.index);
  if (error != std::errc{} || end != inside.data() + inside.size() || ref.index < 0) {
    throw UsageError(fmt::format("{}: got index '{}', wanted a number from 0 on, or *", what, inside));
  }
  return ref;
}

std::string ObjectName(const mjModel& model, mjtObj type, int id) {
  const char* name = type == mjOBJ_UNKNOWN ? nullptr : mj_id2name(&model, type, id);
  return name == nullptr || *name == '\0' ? fmt::format("#{}", id) : name;
}

std::vector<int> MatchObjects(const mjModel& model, const ObjectKind& kind, std::string_view pattern,
                              const std::string& what) {
  if (pattern == "@actuated" && (kind.type == mjOBJ_JOINT || kind.type == mjOBJ_BODY)) {
    return ActuatedObjects(model, kind.type, what);
  }
  std::vector<int> ids;
  std::vector<std::string> candidates;
  for (int id = 0; id < kind.count; ++id) {
    const char* name = kind.type == mjOBJ_UNKNOWN ? nullptr : mj_id2name(&model, kind.type, id);
    const std::string by_id = fmt::format("#{}", id);
    if (pattern == by_id || MatchesGlob(pattern, name == nullptr ? "" : name)) ids.push_back(id);
    candidates.push_back(ObjectName(model, kind.type, id));
  }
  if (ids.empty()) {
    throw UsageError(fmt::format("{}: no {} matches '{}'{}; there are {}", what, kind.word, pattern,
                                 DidYouMean(pattern, candidates),
                                 candidates.empty() ? "none" : fmt::format("{}", fmt::join(candidates, ", "))));
  }
  return ids;
}

}  // namespace oted
