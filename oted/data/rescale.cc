#include "oted/data/rescale.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/data/named_columns.h"

namespace oted {
namespace {

/// A column's numbers, by column.
using Numbers = std::map<int, double>;

struct Rescaled {
  Numbers observations, actions;
};

template <class Log>
Rescaled Find(const char* setting, const std::map<std::string, double>& numbers, const Log& log,
              const std::string& file, const TaskNames& task) {
  Rescaled columns;
  for (const auto& [pattern, number] : numbers) {
    const auto observations = MatchingColumns(pattern, log.observation_names, task.observations);
    const auto actions = MatchingColumns(pattern, log.action_names, task.actions);
    if (observations.empty() && actions.empty()) {
      std::vector<std::string> names = log.observation_names, of_task = task.observations;
      names.insert(names.end(), log.action_names.begin(), log.action_names.end());
      of_task.insert(of_task.end(), task.actions.begin(), task.actions.end());
      throw UsageError(
          fmt::format("{}: {}", setting, NoSuchColumn(file, "observation or action", pattern, names, of_task)));
    }
    const auto take = [&](const std::map<int, std::string>& found, Numbers& into) {
      for (const auto& [column, name] : found) {
        if (into.emplace(column, number).second) continue;
        throw UsageError(fmt::format("{}: '{}' is named twice, by '{}' too; name it once", setting, name, pattern));
      }
    };
    take(observations, columns.observations);
    take(actions, columns.actions);
  }
  return columns;
}

void Multiply(Array2<double>& rows, const Numbers& scale, const Numbers& offset) {
  for (int i = 0; i < rows.rows(); ++i) {
    for (const auto& [column, factor] : scale) {
      if (column < rows.cols()) rows(i, column) *= factor;
    }
    for (const auto& [column, more] : offset) {
      if (column < rows.cols()) rows(i, column) += more;
    }
  }
}

void CheckFactors(const std::map<std::string, double>& factors) {
  for (const auto& [pattern, factor] : factors) {
    if (factor != 0 && std::isfinite(factor)) continue;
    throw UsageError(
        fmt::format("data.scale: the factor of '{}' is {}, wanted a unit or a sign, such as 0.001 or -1; nothing would "
                    "be left of it",
                    pattern, factor));
  }
}

template <class Log>
void RescaleLog(Log& log, const std::string& file, const Rescaling& rescaling, const TaskNames& task) {
  if (rescaling.empty()) return;
  CheckFactors(rescaling.scale);
  const Rescaled scale = Find("data.scale", rescaling.scale, log, file, task);
  const Rescaled offset = Find("data.offset", rescaling.offset, log, file, task);
  if (!log.qpos.empty() && !(scale.observations.empty() && offset.observations.empty())) {
    throw UsageError(fmt::format(
        "data.scale: '{}' also holds qpos, which would stay as it is; correct both in the log, or leave qpos out",
        file));
  }
  Multiply(log.observations, scale.observations, offset.observations);
  Multiply(log.actions, scale.actions, offset.actions);
  if constexpr (requires { log.next_observations; }) {
    Multiply(log.next_observations, scale.observations, offset.observations);
  }
}

}  // namespace

void Rescale(Recording& recording, const Rescaling& rescaling, const TaskNames& task) {
  RescaleLog(recording, recording.file, rescaling, task);
}

void Rescale(Dataset& dataset, const Rescaling& rescaling, const TaskNames& task) {
  RescaleLog(dataset, dataset.path, rescaling, task);
}

}  // namespace oted
