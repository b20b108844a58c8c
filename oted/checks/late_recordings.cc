#include "oted/checks/late_recordings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace oted {
namespace {

constexpr size_t kMostLate = 50;      // recordings: with more of them, too few rows lie in each
constexpr double kLateGain = 0.5;     // another row's action must leave less than this of the error
constexpr double kRatherGain = 0.95;  // the same where it is rather another row's, be it sure or not
constexpr double kLateShare = 0.5;    // of the recordings: where more are late, it is no fault of single ones

}  // namespace

std::string ShiftInWords(const ActionShift& better) {
  return fmt::format("the action {} row(s) {} explains a row better than its own: error {:.2g} instead of {:.2g}",
                     std::abs(better.shift), better.shift < 0 ? "before" : "later", better.error, better.own);
}

void CheckLateRecordings(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads,
                         std::vector<Finding>& findings) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() < 2 || episodes.size() > kMostLate) return;
  std::vector<Finding> late;
  int n_rather_late = 0;
  for (size_t e = 0; e < episodes.size(); ++e) {
    const int rows = std::max(1, max_rows / static_cast<int>(episodes.size()));
    const OneStepError error = MeasureOneStep(factory, dataset.Select({episodes[e]}), rows, n_threads);
    const std::optional<ActionShift> better = BetterShift(error, kLateGain);
    n_rather_late += BetterShift(error, kRatherGain).has_value();
    if (!better) continue;
    late.push_back({.check = "shifted_actions",
                    .severity = Severity::kWarning,
                    .what = fmt::format("in episode {} alone {}", e + 1, ShiftInWords(*better)),
                    .row = episodes[e].begin,
                    .count = std::abs(better->shift),
                    .meaning = "its actions were logged with other rows than those of the other recordings",
                    .remedy = fmt::format("in episode {} alone: shift the actions by this number of rows", e + 1)});
  }
  if (static_cast<double>(n_rather_late) > kLateShare * static_cast<double>(episodes.size())) return;
  findings.insert(findings.end(), late.begin(), late.end());
}

}  // namespace oted
