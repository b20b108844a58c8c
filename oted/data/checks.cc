#include "oted/data/checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "oted/base/error.h"
#include "oted/data/checks_channels.h"
#include "oted/data/checks_copies.h"
#include "oted/data/checks_dynamics.h"
#include "oted/data/checks_frozen.h"
#include "oted/data/checks_missing.h"
#include "oted/data/checks_rates.h"
#include "oted/data/checks_rows.h"
#include "oted/data/checks_spikes.h"
#include "oted/data/checks_states.h"
#include "oted/data/checks_turning.h"
#include "oted/data/loggable.h"

namespace oted {
namespace {

std::string NameOf(const std::vector<std::string>& names, const char* array, int j) {
  const bool named = j < static_cast<int>(names.size()) && !names[static_cast<size_t>(j)].empty();
  return named ? names[static_cast<size_t>(j)] : fmt::format("{}[{}]", array, j);
}

/// Looks at each array on its own, so that arrays of different lengths are no danger.
void CheckFinite(const Dataset& dataset, std::vector<Finding>& findings) {
  const auto check = [&](const char* name, std::span<const double> values, int cols) {
    Finding f;
    int64_t n_values = 0;
    int last_row = -1;
    double first = 0;
    for (size_t i = 0; i < values.size(); ++i) {
      if (IsLoggable(values[i])) continue;
      const int row = static_cast<int>(i / static_cast<size_t>(cols));
      if (n_values++ == 0) {
        f.row = row;
        first = values[i];
      }
      f.count += row != last_row;
      last_row = row;
    }
    if (n_values == 0) return;
    f.check = "not_finite";
    f.severity = Severity::kError;
    f.what = fmt::format("{}: {} of {} numbers in {} rows are NaN, infinite or above 1e20, the first ({}) in row {}",
                         name, n_values, values.size(), f.count, first, f.row);
    f.meaning = "no stage reads such a file, and the other checks were not made";
    f.remedy = "cut the episodes at these rows (a timeout before each, the row itself removed) or repair the values";
    findings.push_back(f);
  };
  check("observations", dataset.observations.values(), std::max(1, dataset.observations.cols()));
  check("actions", dataset.actions.values(), std::max(1, dataset.actions.cols()));
  check("next_observations", dataset.next_observations.values(), std::max(1, dataset.next_observations.cols()));
  check("rewards", dataset.rewards, 1);
  check("infos/qpos", dataset.qpos.values(), std::max(1, dataset.qpos.cols()));
  check("infos/qvel", dataset.qvel.values(), std::max(1, dataset.qvel.cols()));
}

}  // namespace

std::string TaskFacts::ObservationName(int j) const { return NameOf(observation_names, "observations", j); }
std::string TaskFacts::ActionName(int j) const { return NameOf(action_names, "actions", j); }

std::set<int> TaskFacts::States() const {
  std::set<int> states(positions.begin(), positions.end());
  for (int j = 0; j < static_cast<int>(rate_of.size()); ++j) {
    if (rate_of[static_cast<size_t>(j)] >= 0) states.insert({j, rate_of[static_cast<size_t>(j)]});
  }
  return states;
}

std::vector<Finding> CheckDataset(const Dataset& dataset, const TaskFacts& facts) {
  std::vector<Finding> findings;
  CheckFinite(dataset, findings);
  if (!findings.empty()) return findings;
  try {
    dataset.Check();
  } catch (const DataError& e) {
    findings.push_back({.check = "malformed",
                        .severity = Severity::kError,
                        .what = e.what(),
                        .meaning = "no stage reads such data, and the other checks were not made",
                        .remedy = "write the file again, with one row per transition in every array"});
    return findings;
  }
  CheckRows(dataset, facts, findings);
  CheckChannels(dataset, facts, findings);
  CheckFrozen(dataset, facts, findings);
  CheckSpikes(dataset, facts, findings);
  CheckCopies(dataset, facts, findings);
  CheckMissingRows(dataset, facts, findings);
  CheckStates(dataset, facts, findings);
  CheckWraps(dataset, facts, findings);
  CheckJumps(dataset, facts, findings);
  CheckTurns(dataset, facts, findings);
  CheckRates(dataset, facts, CheckTurning(dataset, facts, findings), findings);
  // No linear map explains numbers whose signs change.
  if (std::ranges::none_of(findings, [](const Finding& f) { return f.check == "quaternion_sign"; })) {
    CheckDynamics(dataset, facts, findings);
  }
  return findings;
}

}  // namespace oted
