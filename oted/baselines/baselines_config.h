#pragma once
/// What the paper compares with (Sec. 5.1), as settings: which baselines are trained beside the agents of the design.

#include <string>
#include <vector>

#include "oted/base/fields.h"

namespace oted {

struct BaselinesConfig {
  std::vector<std::string> run;  ///< of Known()

  static const std::vector<std::string>& Known();
  bool Runs(const std::string& name) const;
  /// @throws UsageError for a name that is none of them, or given twice
  void Check() const;
  FieldList Fields();
};

}  // namespace oted
