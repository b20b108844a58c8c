#pragma once
/// What the name of a log's column says: whose number it is, and which.

#include <string>
#include <vector>

namespace oted {

/// "leftHip_vel[2]" -> {"left", "hip", "vel", "2"}: lower case, cut at signs, at capitals, and between letters and
/// digits.
std::vector<std::string> WordsOf(const std::string& name);

/// What a column is by the words beside its owner's name.
enum class ColumnRole {
  kUnknown,
  kPosition,
  kVelocity,
  kCommand,   ///< of whatever the actuator takes
  kEffort,    ///< a force or torque that may be the command
  kMeasured,  ///< a force or torque that was measured, or an acceleration: no command
};

struct ColumnMeaning {
  ColumnRole role = ColumnRole::kUnknown;
  bool of_position = false;     ///< of a command: it is called a position
  bool in_degrees = false;      ///< by its name
  int index = -1;               ///< the number among the words; x, y, z are 0, 1, 2; -1: none
  bool of_orientation = false;  ///< of a quaternion: w, x, y, z are 0, 1, 2, 3
  bool of_turning = false;      ///< an angular velocity by its name
  int n_foreign = 0;            ///< words that say nothing known
};

/// @param words  of the name without the owner's
ColumnMeaning MeaningOf(const std::vector<std::string>& words);

/// What is left of an object's or column's words once kinds ("joint", "motor"), roles and units are taken away.
std::vector<std::string> BareWords(const std::vector<std::string>& words);

/// Where `part` stands in `words`, without a gap; -1: nowhere, or it is empty.
int FindWords(const std::vector<std::string>& words, const std::vector<std::string>& part);

}  // namespace oted
