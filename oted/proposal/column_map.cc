#include "oted/proposal/column_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>

#include "oted/base/fields.h"
#include "oted/data/time_column.h"
#include "oted/proposal/column_words.h"

namespace oted {
namespace {

constexpr int kOnlyOne = 50, kByOrder = 100;  // penalties of columns that their names do not place

using Words = std::vector<std::string>;

/// What the reader finds by itself (docs/file_formats.md).
bool IsConventional(const std::string& lower) {
  static const std::set<std::string> kNames = {"episode",  "episode_id", "episode_index", "time",        "time_s",
                                               "time [s]", "t",          "timestamp",     "reward",      "rewards",
                                               "terminal", "terminals",  "terminated",    "termination", "timeout",
                                               "timeouts", "truncated",  "truncation"};
  return kNames.contains(lower) || lower.starts_with("infos/");
}

struct Named {
  Words words, bare;
};

std::vector<Named> NamesOf(const Words& names) {
  std::vector<Named> named;
  for (const std::string& name : names) {
    // "#3" has no name.
    const Words words = name.starts_with('#') ? Words() : WordsOf(name);
    named.push_back({words, BareWords(words)});
  }
  return named;
}

/// The object that a column's words name, and which words that are.
struct Owner {
  int object = -1;
  Words rest;  ///< the words beside the name
  size_t length = 0;
};

Words Without(const Words& words, size_t at, size_t n) {
  Words rest(words.begin(), words.begin() + static_cast<ptrdiff_t>(at));
  rest.insert(rest.end(), words.begin() + static_cast<ptrdiff_t>(at + n), words.end());
  return rest;
}

Words WithoutAll(const Words& words, const Words& gone) {
  Words rest;
  for (const std::string& word : words) {
    if (std::ranges::find(gone, word) == gone.end()) rest.push_back(word);
  }
  return rest;
}

Owner FindOwner(const Words& words, const std::vector<Named>& objects) {
  Owner best;
  for (size_t i = 0; i < objects.size(); ++i) {
    const int at = FindWords(words, objects[i].words);
    if (at < 0 || objects[i].words.size() <= best.length) continue;
    best = {static_cast<int>(i), Without(words, static_cast<size_t>(at), objects[i].words.size()),
            objects[i].words.size()};
  }
  if (best.object >= 0) return best;
  const Words bare = BareWords(words);
  if (bare.empty()) return best;
  std::vector<int> fits;
  const auto ends_with = [](const Words& text, const Words& end) {
    return !end.empty() && text.size() >= end.size() && std::equal(end.rbegin(), end.rend(), text.rbegin());
  };
  for (const bool whole : {true, false}) {
    for (size_t i = 0; i < objects.size(); ++i) {
      const Words& name = objects[i].bare;
      const bool fit = whole ? name == bare : FindWords(bare, name) >= 0 || ends_with(name, bare);
      // A number alone is no name: it is a place.
      const bool is_number = bare.size() == 1 && std::isdigit(static_cast<unsigned char>(bare[0][0])) != 0;
      if (fit && !name.empty() && !is_number) fits.push_back(static_cast<int>(i));
    }
    if (!fits.empty()) break;
  }
  if (fits.size() == 1) {
    const Words& name = objects[static_cast<size_t>(fits[0])].bare;
    best = {fits[0], WithoutAll(words, name), std::min(name.size(), bare.size())};
  }
  return best;
}

/// A number of the model that a column may be.
struct Claim {
  size_t column = 0;
  int penalty = 0;  ///< foreign words, and roles that only may fit
  bool in_degrees = false;
};

class Mapper {
 public:
  Mapper(const Words& columns, const ModelOutline& model) : columns_(columns), model_(model) {
    Words names;
    for (const auto& joint : model.joints) names.push_back(joint.name);
    joints_ = NamesOf(names);
    names.clear();
    for (const auto& sensor : model.sensors) names.push_back(sensor.name);
    sensors_ = NamesOf(names);
    names.clear();
    for (const auto& actuator : model.actuators) names.push_back(actuator.name);
    for (size_t i = 0; model.actuators.empty() && i < model.joints.size(); ++i) {
      if (!model.joints[i].has_one_number()) continue;
      names.push_back(model.joints[i].name);  // of the motor that it would get
    }
    actuator_names_ = names;
    actuators_ = NamesOf(names);
  }

  ColumnMap Map() {
    for (size_t i = 0; i < columns_.size(); ++i) Classify(i);
    Numbered(position_places_, model_.qpos, "positions");
    Numbered(velocity_places_, model_.qvel, "velocities");
    NumberedStates();
    Numbered(command_places_, ActionPaths(), "commands");
    Take(model_.qpos, map_.observations);
    Take(model_.qvel, map_.observations);
    Take(SensorPaths(), map_.observations);
    Take(ActionPaths(), map_.actions);
    if (model_.actuators.empty()) {
      for (const ColumnMap::Entry& entry : map_.actions) map_.motors.push_back("joint" + entry.path.substr(8));
    }
    return std::move(map_);
  }

 private:
  Words ActionPaths() const {
    Words paths;
    for (size_t i = 0; i < actuator_names_.size(); ++i) {
      const int n = model_.actuators.empty() ? 1 : model_.actuators[i].n_controls;
      for (int k = 0; k < n; ++k) {
        paths.push_back("actuator/" + actuator_names_[i] + (n == 1 ? "" : fmt::format("[{}]", k)));
      }
    }
    return paths;
  }

  Words SensorPaths() const {
    Words paths;
    for (const auto& sensor : model_.sensors) {
      for (int k = 0; k < sensor.size; ++k) {
        paths.push_back("sensor/" + sensor.name + (sensor.size == 1 ? "" : fmt::format("[{}]", k)));
      }
    }
    return paths;
  }

  void Unused(size_t column, const std::string& why) {
    map_.unused.push_back(fmt::format("'{}': {}", columns_[column], why));
  }

  /// Columns that stand beside the robot's numbers.
  bool IsBookkeeping(size_t column, const Words& words) {
    std::string lower = columns_[column];
    std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const int times = FindTimeColumn(columns_);
    if (IsConventional(lower) || (times >= 0 && static_cast<size_t>(times) == column)) return true;
    const auto has = [&](std::initializer_list<const char*> any) {
      return std::ranges::any_of(any, [&](const char* word) { return std::ranges::find(words, word) != words.end(); });
    };
    if (has({"time", "timestamp", "stamp", "secs"}) && map_.time.empty()) {
      if (times < 0) map_.time = columns_[column];
      return true;
    }
    if (map_.episode.empty() && has({"episode", "trial", "run", "traj", "trajectory", "rollout", "segment"})) {
      map_.episode = columns_[column];
      return true;
    }
    return false;
  }

  /// The position and velocity of a joint, or nothing for one that has several and an index that is none of them.
  std::optional<std::string> StatePath(int joint, const ColumnMeaning& meaning, bool velocity) const {
    const auto& its = model_.joints[static_cast<size_t>(joint)];
    const std::string path = fmt::format("joint/{}/{}", its.name, velocity ? "qvel" : "qpos");
    if (its.has_one_number()) return path;
    const bool is_free = its.kind != JointKind::kBall;
    const int n = is_free ? (velocity ? 6 : 7) : (velocity ? 3 : 4);
    const bool turns = velocity ? meaning.of_turning : meaning.of_orientation;
    const int index = meaning.index + (is_free && turns ? 3 : 0);  // behind the place, or its velocity
    if (meaning.index < 0 || index >= n) return std::nullopt;
    return fmt::format("{}[{}]", path, index);
  }

  void Classify(size_t column) {
    const Words words = WordsOf(columns_[column]);
    const Owner joint = FindOwner(words, joints_), actuator = FindOwner(words, actuators_),
                sensor = FindOwner(words, sensors_);
    const size_t longest = std::max({joint.length, actuator.length, sensor.length});
    if (longest == 0) {
      if (!IsBookkeeping(column, words)) Place(column, words);
      return;
    }
    if (sensor.length == longest && sensor.length > joint.length && sensor.length > actuator.length) {
      return ClaimSensor(column, sensor);
    }
    const Owner& owner = joint.length == longest ? joint : actuator;
    const ColumnMeaning meaning = MeaningOf(owner.rest);
    Claim claim{column, meaning.n_foreign, meaning.in_degrees};
    switch (meaning.role) {
      case ColumnRole::kMeasured:
        return Unused(column, "measured, no command");
      case ColumnRole::kCommand:
      case ColumnRole::kEffort:
        return ClaimAction(claim, meaning, joint, actuator, longest);
      default:
        break;
    }
    if (joint.length < longest && meaning.role == ColumnRole::kUnknown) {
      return ClaimAction(claim, meaning, joint, actuator, longest);
    }
    // An actuator's own name may stand for its joint: "motor1_pos".
    const int moved = joint.length == longest ? joint.object : JointOf(actuator.object);
    if (joint.length < longest) ++claim.penalty;  // a column with the joint's name comes first
    const auto path = moved < 0 ? std::nullopt : StatePath(moved, meaning, meaning.role == ColumnRole::kVelocity);
    if (!path) {
      return Unused(column,
                    "it does not say which number of its joint it is: x, quat_w, vel_x, omega_x and the like do, or "
                    "the number itself");
    }
    claims_[*path].push_back(claim);
  }

  void ClaimSensor(size_t column, const Owner& sensor) {
    const auto& its = model_.sensors[static_cast<size_t>(sensor.object)];
    const ColumnMeaning meaning = MeaningOf(sensor.rest);
    if (its.joint >= 0) {  // the state itself, which parameters of joints act on
      const std::string& joint = model_.joints[static_cast<size_t>(its.joint)].name;
      claims_[fmt::format("joint/{}/{}", joint, its.velocity ? "qvel" : "qpos")].push_back(
          {column, meaning.n_foreign, meaning.in_degrees});
      return;
    }
    if (its.size > 1 && (meaning.index < 0 || meaning.index >= its.size)) {
      return Unused(column, fmt::format("which of the {} numbers of sensor '{}' is it?", its.size, its.name));
    }
    claims_["sensor/" + its.name + (its.size > 1 ? fmt::format("[{}]", meaning.index) : "")].push_back(
        {column, meaning.n_foreign, false});
  }

  int JointOf(int actuator) const {
    return model_.actuators.empty() ? -1 : model_.actuators[static_cast<size_t>(actuator)].joint;
  }

  void ClaimAction(Claim claim, const ColumnMeaning& meaning, const Owner& joint, const Owner& actuator,
                   size_t longest) {
    std::vector<int> candidates;
    if (actuator.length == longest) {
      candidates = {actuator.object};
    } else {
      for (size_t i = 0; i < model_.actuators.size(); ++i) {
        if (model_.actuators[i].joint == joint.object) candidates.push_back(static_cast<int>(i));
      }
    }
    if (candidates.empty()) return Unused(claim.column, "no actuator drives its joint");
    if (candidates.size() > 1) return Unused(claim.column, "several actuators drive its joint");
    const int which = candidates[0];
    if (!model_.actuators.empty()) {
      const auto& drive = model_.actuators[static_cast<size_t>(which)];
      const bool servo = drive.drive == DriveKind::kPositionServo || drive.drive == DriveKind::kVelocityServo;
      if (servo && meaning.role == ColumnRole::kEffort) {
        return Unused(claim.column, fmt::format("a force, and actuator '{}' is a servo", drive.name));
      }
      if (drive.drive == DriveKind::kMotor && meaning.of_position) {
        return Unused(claim.column, fmt::format("a position, and actuator '{}' takes a force", drive.name));
      }
    }
    claim.penalty += meaning.role == ColumnRole::kEffort ? 2 : 0;
    claims_["actuator/" + actuator_names_[static_cast<size_t>(which)]].push_back(claim);
  }

  /// A column whose name has no object in it: a place among its kind.
  void Place(size_t column, const Words& words) {
    const ColumnMeaning meaning = MeaningOf(words);
    if (meaning.n_foreign > 0) return NotInModel(column, words);
    switch (meaning.role) {
      case ColumnRole::kPosition:
        return position_places_.push_back({meaning.index, column});
      case ColumnRole::kVelocity:
        return velocity_places_.push_back({meaning.index, column});
      case ColumnRole::kCommand:
      case ColumnRole::kEffort:
        return command_places_.push_back({meaning.index, column});
      case ColumnRole::kUnknown:
        return meaning.index < 0 ? NotInModel(column, words) : state_places_.push_back({meaning.index, column});
      case ColumnRole::kMeasured:
        return Unused(column, "measured, no command");
    }
  }

  void NotInModel(size_t column, const Words& words) {
    const auto joined = [](const Words& some) { return fmt::format("{}", fmt::join(some, "_")); };
    Words names;
    const auto add = [&](const std::string& name) {
      if (const Words bare = BareWords(WordsOf(name)); !bare.empty()) names.push_back(joined(bare));
    };
    for (const auto& joint : model_.joints) add(joint.name);
    for (const auto& actuator : model_.actuators) add(actuator.name);
    for (const auto& sensor : model_.sensors) add(sensor.name);
    Unused(column, "nothing in the model has such a name" + DidYouMean(joined(BareWords(words)), names));
  }

  using Places = std::vector<std::pair<int, size_t>>;  // index, column

  /// Gives the numbered columns the model's numbers, in order, where there are as many, or as many as one-number
  /// joints.
  void Numbered(Places& places, Words paths, const char* what) {
    if (places.empty()) return;
    std::ranges::sort(places);
    if (places.size() != paths.size() && what != std::string("commands")) {
      std::erase_if(paths, [](const std::string& path) { return path.back() == ']'; });
    }
    bool in_order = places.size() == paths.size();
    for (size_t i = 1; i < places.size(); ++i) in_order = in_order && places[i].first == places[i - 1].first + 1;
    for (size_t i = 0; i < places.size(); ++i) {
      if (in_order) {
        const bool is_only = places.size() == 1 && places[0].first < 0;  // no number: the one column of its kind
        claims_[paths[i]].push_back({places[i].second, is_only ? kOnlyOne : kByOrder,
                                     MeaningOf(WordsOf(columns_[places[i].second])).in_degrees});
      } else {
        Unused(places[i].second,
               fmt::format("{} numbered {}, and the model has {}", places.size(), what, paths.size()));
      }
    }
  }

  /// "obs_0", "obs_1", ...: all positions, or all positions and then all velocities.
  void NumberedStates() {
    Words paths = model_.qpos;
    if (state_places_.size() != paths.size()) paths.insert(paths.end(), model_.qvel.begin(), model_.qvel.end());
    // Gymnasium's walkers leave out how far they have gone.
    if (state_places_.size() + 1 == paths.size()) paths.erase(paths.begin());
    Numbered(state_places_, paths, "numbers of the state");
  }

  /// Of each path the column with the plainest name.
  void Take(const Words& paths, std::vector<ColumnMap::Entry>& entries) {
    for (const std::string& path : paths) {
      const auto found = claims_.find(path);
      if (found == claims_.end()) continue;
      for (Claim& claim : found->second) {
        const std::string& column = columns_[claim.column];
        if (column == path || column.ends_with("." + path)) claim.penalty = -1;  // the path itself
      }
      std::ranges::stable_sort(found->second, {}, &Claim::penalty);
      const Claim& best = found->second.front();
      entries.push_back({columns_[best.column], path, best.penalty >= kByOrder, best.in_degrees});
      for (size_t i = 1; i < found->second.size(); ++i) {
        Unused(found->second[i].column, fmt::format("'{}' is {} already", columns_[best.column], path));
      }
    }
  }

  const Words& columns_;
  const ModelOutline& model_;
  Words actuator_names_;
  std::vector<Named> joints_, actuators_, sensors_;
  std::map<std::string, std::vector<Claim>> claims_;
  Places position_places_, velocity_places_, command_places_, state_places_;
  ColumnMap map_;
};

}  // namespace

ColumnMap MapColumns(const std::vector<std::string>& columns, const ModelOutline& model) {
  return Mapper(columns, model).Map();
}

}  // namespace oted
