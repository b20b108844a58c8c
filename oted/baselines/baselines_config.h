#pragma once
/// What the paper compares with (Sec. 5.1), as settings: which baselines are trained beside the agents of the design.

#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/baselines/bc_dr.h"
#include "oted/baselines/interval_search.h"

namespace oted {

struct BaselinesConfig {
  std::vector<std::string> run;  ///< of Known()
  IntervalSearchConfig is;
  BcDrConfig bc_dr;

  static const std::vector<std::string>& Known();
  bool Runs(const std::string& name) const;
  /// Those that are agents, in the order of Known(): with "bc_dr" also "dr", where its agent collects.
  std::vector<std::string> Agents() const;
  /// @throws UsageError for a name that is none of them, or given twice
  void Check() const;
  FieldList Fields();
};

}  // namespace oted
