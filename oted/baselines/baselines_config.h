#pragma once
/// What the paper compares with (Sec. 5.1), as settings: which baselines are trained beside the agents of the design.

#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/baselines/bc_dr.h"
#include "oted/baselines/interval_search.h"
#include "oted/baselines/offline_baselines.h"

namespace oted {

/// Those that need simulators. The others are OfflineBaseline's.
enum class Baseline {
  kDomainRandomization,  ///< "dr"
  kIntervalSearch,       ///< "is"
  kBcDr,                 ///< "bc_dr"
};
const NamedValues<Baseline>& BaselineNames();

struct BaselinesConfig {
  std::vector<std::string> run;  ///< names of baselines
  IntervalSearchConfig is;
  BcDrConfig bc_dr;
  OfflineSettings offline;  ///< sections of their own

  bool Runs(Baseline baseline) const;
  /// Those that are agents: with BC+DR also DR, where its agent collects.
  std::vector<Baseline> Agents() const;
  /// Those that learn from the logs alone, in the order of their table.
  std::vector<OfflineBaseline> Offline() const;
  /// @throws UsageError for a name that is none of them, or given twice
  void Check() const;
  FieldList Fields();
};

}  // namespace oted
