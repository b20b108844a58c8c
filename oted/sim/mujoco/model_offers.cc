#include "oted/sim/mujoco/model_offers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

#include "oted/base/error.h"
#include "oted/sim/mujoco/field_info.h"
#include "oted/sim/mujoco/joint_residual.h"
#include "oted/sim/mujoco/model_field.h"

namespace oted {
namespace {

struct Kind {
  const char* prefix;
  const char* owner;
};
constexpr Kind kKinds[] = {{"opt.", "opt"},     {"geom_", "geom"},         {"body_", "body"}, {"jnt_", "joint"},
                           {"dof_", "joint"},   {"actuator_", "actuator"}, {"site_", "site"}, {"tendon_", "tendon"},
                           {"eq_", "equality"}, {"pair_", "pair"}};

const Kind& KindOf(const std::string& array) {
  const auto found = std::find_if(std::begin(kKinds), std::end(kKinds),
                                  [&](const Kind& kind) { return array.starts_with(kind.prefix); });
  return found == std::end(kKinds) ? kKinds[0] : *found;
}

/// "geom_friction" of "geom_friction", "gravity" of "opt.gravity".
std::string TableName(const std::string& array) {
  constexpr std::string_view kOption = "opt.";
  return array.starts_with(kOption) ? array.substr(kOption.size()) : array;
}

/// The index that every path ends with, or -1: "geom/a/friction[0]", "geom/b/friction[0]" -> 0.
int CommonIndex(const std::vector<std::string>& places) {
  int common = -1;
  for (const std::string& place : places) {
    const size_t open = place.rfind('[');
    if (open == std::string::npos || place.back() != ']') return -1;
    const int index = std::stoi(place.substr(open + 1));
    if (common >= 0 && index != common) return -1;
    common = index;
  }
  return common;
}

/// What an object has beside its arrays (model_field.h).
struct Beside {
  const char* owner;
  std::string_view ending;
  const char* meaning;
};
constexpr Beside kBeside[] = {
    {"actuator", "/kp", "stiffness of a position servo: gainprm[0], and -biasprm[1]"},
    {"actuator", "/kv", "damping of a servo, back-EMF of a motor: -biasprm[2], and gainprm[0] of a velocity servo"},
    {"actuator", "/force_limit", "largest force in either direction: -forcerange[0], and forcerange[1]"},
    {"joint", "/springref", "where its spring rests"}};

}  // namespace

PathInfo DescribeModelPath(const mjModel& model, const std::string& path) {
  PathInfo info;
  for (const ModelField& field : ResolvePath(model, path)) {
    for (size_t i = 0; i < field.places.size(); ++i)
      info.places.push_back({field.places[i], field.sign * field.nominal[i]});
    if (field.array == kResidualArray) info.reach = ResidualReach(model);
    if (!info.meaning.empty()) continue;
    info.unit = field.unit;
    info.meaning = DescribeField(TableName(field.array), CommonIndex(field.places)).meaning;
  }
  for (const Beside& beside : kBeside) {
    if (path.ends_with(beside.ending)) info.meaning = beside.meaning;
  }
  return info;
}

std::vector<ParameterOffer> ModelOffers(const mjModel& model) {
  std::vector<ParameterOffer> offers;
  for (const Kind& kind : kKinds) {
    for (const std::string& array : DescribedFields()) {
      const Kind& its = KindOf(array);
      if (&its != &kind) continue;
      const bool option = &kind == &kKinds[0];
      const std::string field = option ? array : array.substr(std::string_view(kind.prefix).size());
      const std::string every = option ? "opt/" + field : fmt::format("{}/*/{}", kind.owner, field);
      PathInfo info;
      try {
        info = DescribeModelPath(model, every);
      } catch (const UsageError&) {
        continue;  // this model has none
      }
      ParameterOffer offer;
      offer.owner = kind.owner;
      offer.path = option ? every : fmt::format("{}/NAME/{}", kind.owner, field);
      if (info.places.front().path.ends_with(']')) offer.path += "[k]";
      const bool listed =
          std::any_of(offers.begin(), offers.end(), [&](const ParameterOffer& o) { return o.path == offer.path; });
      if (listed) continue;  // a joint's limits and its friction both have a solref; the path reaches the first
      offer.unit = info.unit;
      offer.meaning = info.meaning;
      offer.places = std::move(info.places);
      offers.push_back(std::move(offer));
    }
  }
  for (const auto& [owner, ending, meaning] : kBeside) {
    try {
      PathInfo info = DescribeModelPath(model, fmt::format("{}/*{}", owner, ending));
      offers.push_back({owner, fmt::format("{}/NAME{}", owner, ending), info.unit, meaning, std::move(info.places)});
    } catch (const UsageError&) {
      // this model has none
    }
  }
  return offers;
}

}  // namespace oted
