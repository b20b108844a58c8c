#include "oted/proposal/column_words.h"

#include <algorithm>
#include <cctype>
#include <set>

namespace oted {
namespace {

using WordSet = std::set<std::string>;

const WordSet kPositionWords = {"q",      "qpos",  "pos", "position", "positions", "angle",
                                "angles", "theta", "enc", "encoder",  "jointpos"};
const WordSet kVelocityWords = {"qd",         "dq",    "qvel",  "qdot",     "vel",    "velocity",
                                "velocities", "speed", "omega", "thetadot", "dtheta", "jointvel",
                                "dot",        "vx",    "vy",    "vz",       "rate",   "rates"};
const WordSet kMovingWords = {"vx", "vy", "vz"};
const WordSet kOrientationWords = {"quat", "quaternion", "orientation", "qw", "qx", "qy", "qz"};
const WordSet kTurningWords = {"omega", "angvel", "angular", "gyro", "wx", "wy", "wz"};
const WordSet kCommandWords = {"act",      "action",    "actions", "actuator",  "cmd",      "command",
                               "commands", "commanded", "ctrl",    "control",   "u",        "target",
                               "desired",  "des",       "ref",     "reference", "setpoint", "goal"};
const WordSet kEffortWords = {"tau", "torque", "torques", "effort", "efforts", "force", "forces", "current"};
const WordSet kMeasuredWords = {"meas", "measured", "actual", "est", "estimated", "sensed", "feedback"};
const WordSet kAccelerationWords = {"acc", "acceleration", "qacc", "ddq", "qdd", "accel"};
const WordSet kKindWords = {"joint",       "joints",       "link",  "motor",  "drive",  "servo", "obs",
                            "observation", "observations", "state", "states", "sensor", "robot"};
const WordSet kDegreeWords = {"deg", "degs", "degree", "degrees"};
const WordSet kUnitWords = {"rad", "rads", "nm", "n", "m", "s", "si"};

bool IsNumber(const std::string& word) {
  return !word.empty() && std::ranges::all_of(word, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool SaysNothingOfOwner(const std::string& word) {
  for (const WordSet* set :
       {&kPositionWords, &kVelocityWords, &kOrientationWords, &kTurningWords, &kCommandWords, &kEffortWords,
        &kMeasuredWords, &kAccelerationWords, &kKindWords, &kDegreeWords, &kUnitWords}) {
    if (set->contains(word)) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> WordsOf(const std::string& name) {
  std::vector<std::string> words;
  const auto kind = [](unsigned char c) { return std::isdigit(c) != 0 ? 2 : std::isalpha(c) != 0 || c > 127 ? 1 : 0; };
  char last = 0;
  for (const char c : name) {
    const int is = kind(static_cast<unsigned char>(c)), was = kind(static_cast<unsigned char>(last));
    const bool capital = std::isupper(static_cast<unsigned char>(c)) && std::islower(static_cast<unsigned char>(last));
    if (is != 0 && (is != was || capital)) words.emplace_back();
    if (is != 0) words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    last = c;
  }
  return words;
}

ColumnMeaning MeaningOf(const std::vector<std::string>& words) {
  ColumnMeaning meaning;
  const auto any = [&](const WordSet& set) {
    return std::ranges::any_of(words, [&](const std::string& word) { return set.contains(word); });
  };
  meaning.of_orientation = any(kOrientationWords);
  meaning.of_turning = any(kTurningWords);
  for (const std::string& word : words) {
    // "x", and of "qx", "wx" and "vx" the second letter.
    const bool is_two = word.size() == 2 && (kOrientationWords.contains(word) || kTurningWords.contains(word) ||
                                             kMovingWords.contains(word));
    const char axis = word.size() == 1 || is_two ? word.back() : ' ';
    if (IsNumber(word) && word.size() < 4) {
      meaning.index = std::stoi(word);
    } else if (axis >= 'x' && axis <= 'z') {
      meaning.index = axis - 'x' + (meaning.of_orientation ? 1 : 0);
    } else if (axis == 'w' && meaning.of_orientation) {
      meaning.index = 0;
    } else if (!SaysNothingOfOwner(word)) {
      ++meaning.n_foreign;
    }
  }
  meaning.in_degrees = any(kDegreeWords);
  meaning.of_position = any(kPositionWords);
  const bool measured = any(kMeasuredWords), effort = any(kEffortWords);
  if (any(kAccelerationWords) || (measured && effort)) {
    meaning.role = ColumnRole::kMeasured;
  } else if (any(kCommandWords) && !measured) {
    meaning.role = ColumnRole::kCommand;
  } else if (any(kVelocityWords) || (meaning.of_turning && !meaning.of_position)) {
    meaning.role = ColumnRole::kVelocity;
  } else if (effort) {
    meaning.role = ColumnRole::kEffort;
  } else if (meaning.of_position || meaning.of_orientation) {
    meaning.role = ColumnRole::kPosition;
  }
  return meaning;
}

std::vector<std::string> BareWords(const std::vector<std::string>& words) {
  std::vector<std::string> bare;
  for (const std::string& word : words) {
    if (!SaysNothingOfOwner(word)) bare.push_back(word);
  }
  return bare;
}

int FindWords(const std::vector<std::string>& words, const std::vector<std::string>& part) {
  if (part.empty()) return -1;
  const auto found = std::search(words.begin(), words.end(), part.begin(), part.end());
  return found == words.end() ? -1 : static_cast<int>(found - words.begin());
}

}  // namespace oted
