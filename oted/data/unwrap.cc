#include "oted/data/unwrap.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <numbers>

#include "oted/base/error.h"
#include "oted/data/named_columns.h"

namespace oted {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

/// By number, with the name that the pattern meant.
using Angles = std::map<int, std::string>;

Angles FindAngles(const std::vector<std::string>& patterns, const std::vector<std::string>& names,
                  const std::vector<std::string>& task_names, const std::string& file) {
  Angles angles;
  for (const std::string& pattern : patterns) {
    Angles found = MatchingColumns(pattern, names, task_names);
    if (found.empty()) throw UsageError("unwrap: " + NoSuchColumn(file, "observation", pattern, names, task_names));
    angles.merge(found);
  }
  return angles;
}

/// Of a whole log.
template <class Log>
Angles AnglesOf(const Log& log, const std::string& file, const std::vector<std::string>& patterns,
                const std::vector<std::string>& task_names) {
  if (!patterns.empty() && !log.qpos.empty()) {
    throw UsageError(fmt::format(
        "unwrap: '{}' also holds qpos, which would stay wrapped; unwrap both in the log, or leave qpos out", file));
  }
  Angles angles = FindAngles(patterns, log.observation_names, task_names, file);
  // Of a log with fewer columns than the task the task itself will tell.
  std::erase_if(angles, [&](const auto& angle) { return angle.first >= log.observations.cols(); });
  return angles;
}

void Tell(const std::string& name, int n_jumps, std::vector<std::string>& remarks) {
  if (n_jumps > 0) remarks.push_back(fmt::format("{} jumps of '{}' by a whole turn taken out", n_jumps, name));
}

}  // namespace

double Unwrapper::operator()(double value) {
  if (!std::isfinite(value)) return value;
  const double jump = has_begun_ ? std::round((value - logged_) / kTurn) : 0;
  has_begun_ = true;
  logged_ = value;
  n_jumps_ += jump != 0;
  turns_ -= jump;
  return turns_ == 0 ? value : value + turns_ * kTurn;
}

void Unwrap(Recording& recording, const std::vector<std::string>& patterns,
            const std::vector<std::string>& task_names) {
  for (const auto& [column, name] : AnglesOf(recording, recording.file, patterns, task_names)) {
    int n_jumps = 0;
    for (const Recording::Run& run : recording.runs) {
      Unwrapper unwrap;
      for (int i = run.begin; i < run.end; ++i) {
        recording.observations(i, column) = unwrap(recording.observations(i, column));
      }
      n_jumps += unwrap.n_jumps();
    }
    Tell(name, n_jumps, recording.remarks);
  }
}

void Unwrap(Dataset& dataset, const std::vector<std::string>& patterns, const std::vector<std::string>& task_names) {
  const auto n = static_cast<size_t>(dataset.size());
  if (dataset.terminals.size() != n || dataset.timeouts.size() != n ||
      dataset.next_observations.rows() != dataset.size()) {
    dataset.Check();  // throws
  }
  for (const auto& [column, name] : AnglesOf(dataset, dataset.path, patterns, task_names)) {
    int n_jumps = 0;
    for (const Episode& episode : dataset.Episodes()) {
      Unwrapper unwrap;
      for (int i = episode.begin; i < episode.end; ++i) {
        dataset.observations(i, column) = unwrap(dataset.observations(i, column));
        // The next row goes on from this one, not from what the action led to: a log may have measured that apart.
        Unwrapper after = unwrap;
        dataset.next_observations(i, column) = after(dataset.next_observations(i, column));
        if (i + 1 == episode.end) unwrap = after;
      }
      n_jumps += unwrap.n_jumps();
    }
    Tell(name, n_jumps, dataset.remarks);
  }
}

std::vector<std::string> Unwrap(std::vector<Stream>& states, const std::vector<std::string>& patterns) {
  std::vector<std::string> names, remarks;
  for (const Stream& state : states) names.push_back(state.name);
  for (const auto& [column, name] : FindAngles(patterns, names, {}, "logs")) {
    Unwrapper unwrap;
    for (double& value : states[static_cast<size_t>(column)].values) value = unwrap(value);
    Tell(name, unwrap.n_jumps(), remarks);
  }
  return remarks;
}

}  // namespace oted
