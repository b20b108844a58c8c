#include "oted/data/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/base/error.h"
#include "oted/data/csv.h"
#include "oted/data/loggable.h"

namespace oted {
namespace {

constexpr double kSamePeriod = 1e-3;  // times are written with few digits

template <class T>
void AppendRows(Array2<T>& to, const Array2<T>& from, int begin, int end) {
  for (int i = begin; i < end; ++i) to.AppendRow(from.row(i));
}

template <class T>
void AppendValues(std::vector<T>& to, const std::vector<T>& from, int begin, int end) {
  if (!from.empty()) to.insert(to.end(), from.begin() + begin, from.begin() + end);
}

void AppendRange(Dataset& to, const Dataset& from, int begin, int end) {
  AppendRows(to.observations, from.observations, begin, end);
  AppendRows(to.actions, from.actions, begin, end);
  AppendRows(to.next_observations, from.next_observations, begin, end);
  AppendValues(to.rewards, from.rewards, begin, end);
  AppendValues(to.terminals, from.terminals, begin, end);
  AppendValues(to.timeouts, from.timeouts, begin, end);
  if (from.has_states()) {
    AppendRows(to.qpos, from.qpos, begin, end);
    AppendRows(to.qvel, from.qvel, begin, end);
  }
  if (!from.constants.empty()) AppendRows(to.constants, from.constants, begin, end);
}

}  // namespace

std::vector<Episode> Dataset::Episodes() const {
  std::vector<Episode> episodes;
  int begin = 0;
  for (int i = 0; i < size(); ++i) {
    if (terminals[i] || timeouts[i] || i + 1 == size()) {
      episodes.push_back({begin, i + 1, terminals[i] != 0});
      begin = i + 1;
    }
  }
  return episodes;
}

Array2<double> Dataset::EpisodeStarts() const {
  Array2<double> starts;
  for (const Episode& episode : Episodes()) starts.AppendRow(observations.row(episode.begin));
  return starts;
}

std::vector<double> Dataset::EpisodeReturns() const {
  std::vector<double> returns;
  if (rewards.empty()) return returns;
  for (const Episode& e : Episodes()) {
    returns.push_back(std::accumulate(rewards.begin() + e.begin, rewards.begin() + e.end, 0.0));
  }
  return returns;
}

Dataset Dataset::Select(const std::vector<Episode>& episodes) const {
  Dataset selected;
  for (const Episode& e : episodes) {
    OTED_CHECK(0 <= e.begin && e.begin < e.end && e.end <= size());
    AppendRange(selected, *this, e.begin, e.end);
    // An episode that the file's end cut off stays an episode of its own.
    if (!selected.terminals.back()) selected.timeouts.back() = 1;
  }
  selected.period_s = period_s;
  selected.observation_names = observation_names;
  selected.action_names = action_names;
  selected.constant_names = constant_names;
  selected.remarks = remarks;
  selected.warnings = warnings;
  selected.path = path;
  selected.sha256 = sha256;
  return selected;
}

void Dataset::Append(const Dataset& other) {
  if (other.size() == 0) return;
  if (size() == 0) {
    *this = other;
    return;
  }
  OTED_CHECK(&other != this);
  OTED_CHECK(obs_dim() == other.obs_dim() && act_dim() == other.act_dim());
  OTED_CHECK(has_states() == other.has_states() && rewards.empty() == other.rewards.empty());
  OTED_CHECK(qpos.cols() == other.qpos.cols() && qvel.cols() == other.qvel.cols());
  OTED_CHECK(constant_names == other.constant_names);
  // An episode that this dataset's end cut off must not go on in the other's first.
  if (!terminals.back()) timeouts.back() = 1;
  AppendRange(*this, other, 0, other.size());
  if (std::abs(period_s - other.period_s) > kSamePeriod * period_s) period_s = 0;
  if (observation_names != other.observation_names) observation_names.clear();
  if (action_names != other.action_names) action_names.clear();
  const auto add_new = [](std::vector<std::string>& to, const std::vector<std::string>& from) {
    for (const std::string& text : from) {
      if (std::ranges::find(to, text) == to.end()) to.push_back(text);
    }
  };
  add_new(remarks, other.remarks);
  add_new(warnings, other.warnings);
  if (sha256 != other.sha256 || path != other.path) {
    path.clear();
    sha256.clear();
  }
}

void Dataset::Check() const {
  const std::string where = path.empty() ? "dataset" : fmt::format("dataset '{}'", path);
  if (size() == 0) throw DataError(where + " holds no transition; record at least one episode");
  const auto check_rows = [&](const char* name, int rows) {
    if (rows != size()) {
      throw DataError(
          fmt::format("{}: {} has {} rows but observations has {}; every array needs one row per transition", where,
                      name, rows, size()));
    }
  };
  if (obs_dim() < 1 || act_dim() < 1) {
    throw DataError(fmt::format("{}: observations have {} and actions {} numbers; each needs at least one", where,
                                obs_dim(), act_dim()));
  }
  if (next_observations.cols() != obs_dim()) {
    throw DataError(fmt::format("{}: next_observations has {} columns but observations has {}; write the file again",
                                where, next_observations.cols(), obs_dim()));
  }
  const auto check_names = [&](const char* name, const std::vector<std::string>& names, int cols) {
    for (const std::string& text : names) {
      if (!IsUtf8(text)) throw DataError(fmt::format("{}: a name of its {} is not UTF-8; rename it", where, name));
    }
    if (names.empty() || static_cast<int>(names.size()) == cols) return;
    throw DataError(fmt::format("{}: {} names for {} {}; name every column or none", where, names.size(), cols, name));
  };
  check_names("observations", observation_names, obs_dim());
  check_names("actions", action_names, act_dim());
  if (qpos.empty() != qvel.empty()) {
    throw DataError(where + " has only one of infos/qpos and infos/qvel; give both or neither");
  }
  check_rows("actions", actions.rows());
  check_rows("next_observations", next_observations.rows());
  check_rows("terminals", static_cast<int>(terminals.size()));
  check_rows("timeouts", static_cast<int>(timeouts.size()));
  if (!rewards.empty()) check_rows("rewards", static_cast<int>(rewards.size()));
  if (has_states()) {
    check_rows("infos/qpos", qpos.rows());
    check_rows("infos/qvel", qvel.rows());
  }
  // cols 0: a vector
  const auto check_finite = [&](const char* name, std::span<const double> values, int cols,
                                const std::vector<std::string>& names = {}) {
    for (size_t i = 0; i < values.size(); ++i) {
      if (IsLoggable(values[i])) continue;
      const size_t width = static_cast<size_t>(cols);
      const std::string index = cols == 0 ? fmt::format("{}", i) : fmt::format("{}, {}", i / width, i % width);
      const int row = static_cast<int>(cols == 0 ? i : i / width);
      const bool is_named = cols > 0 && names.size() == width;
      const std::vector<Episode> episodes = Episodes();
      const auto in = std::ranges::find_if(episodes, [&](const Episode& e) { return row < e.end; });
      throw DataError(
          fmt::format("{}: {}[{}] ({}episode {}) is {}, wanted numbers up to {}; remove or repair that transition",
                      where, name, index, is_named ? fmt::format("'{}', ", names[i % width]) : "",
                      in - episodes.begin() + 1, values[i], kLargestLogged));
    }
  };
  check_finite("observations", observations.values(), obs_dim(), observation_names);
  check_finite("actions", actions.values(), act_dim(), action_names);
  check_finite("next_observations", next_observations.values(), obs_dim(), observation_names);
  check_finite("rewards", rewards, 0);
  if (has_states()) {
    check_finite("infos/qpos", qpos.values(), qpos.cols());
    check_finite("infos/qvel", qvel.values(), qvel.cols());
  }
}

void Dataset::CheckFits(const std::string& task, int task_obs_dim, int task_act_dim) const {
  if (obs_dim() == task_obs_dim && act_dim() == task_act_dim) return;
  throw DataError(
      fmt::format("dataset '{}' has observations of {} and actions of {} numbers, but task '{}' has {} and {}; "
                  "name the task that the data were logged from",
                  path, obs_dim(), act_dim(), task, task_obs_dim, task_act_dim));
}

}  // namespace oted
