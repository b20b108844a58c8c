#pragma once
/// What a check of logged data found, in words for the person who logged them.

#include <cstdint>
#include <string>
#include <vector>

namespace oted {

enum class Severity {
  kError,    ///< the data are not what they say: repair them before a design
  kWarning,  ///< the design can go wrong or lose much; read it
  kNote,     ///< worth knowing
};
/// "error", "warning", "note".
std::string ToString(Severity severity);

/// The designs that a finding concerns, each with those that the one before it concerns.
enum class Concern {
  kEveryMethod,
  kOtherMethods,          ///< than the default, which has an answer to it
  kDiscriminatingMethods  ///< that learn to tell logs from a simulator
};

/// One finding (docs/data_checks.md lists every check with its statistic and threshold).
struct Finding {
  std::string check;  ///< name of the check: "missed_boundary"
  Severity severity = Severity::kNote;
  std::string what;                        ///< what was measured, with its numbers
  int row = -1;                            ///< the first row concerned, from 0; -1: none in particular
  int64_t count = 0;                       ///< how many rows, channels or episodes are concerned
  std::vector<std::string> channels = {};  ///< those concerned; empty: none in particular
  std::string meaning;                     ///< for the design
  std::string remedy;
  bool may_be_parameter = false;  ///< a parameter of the simulator may do what the columns seem to have wrong: a zero
  Concern concern = Concern::kEveryMethod;
};

/// How many findings have this severity.
int CountOf(const std::vector<Finding>& findings, Severity severity);

}  // namespace oted
