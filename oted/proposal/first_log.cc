#include "oted/proposal/first_log.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <span>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/data/dataset_files.h"
#include "oted/data/time_column.h"

namespace oted {
namespace {

constexpr double kSlowest_s = 0.5;  // a time column with longer rows is not in seconds
constexpr size_t kShown = 12;
constexpr size_t kRowsOfRecording = 100;  // on average at least, between two changes of what is known of recordings

template <class T>
std::vector<std::string> NamesOf(const std::vector<T>& owners) {
  std::vector<std::string> names;
  for (const T& owner : owners) names.push_back(owner.name);
  return names;
}

/// Whether a column keeps a value for many rows and takes others later, as what is known of a recording does.
bool IsOfRecordings(const std::vector<double>& values) {
  size_t changes = 0;
  for (size_t i = 1; i < values.size(); ++i) {
    if (std::isnan(values[i])) return false;
    changes += values[i] != values[i - 1];
  }
  return changes > 0 && changes * kRowsOfRecording <= values.size();
}

}  // namespace

bool IsCsv(const std::string& path) { return path.ends_with(".csv") || path.ends_with(".csv.gz"); }

std::string Some(const std::vector<std::string>& names) {
  const std::span<const std::string> first(names.data(), std::min(names.size(), kShown));
  return fmt::format("{}{}", fmt::join(first, ", "),
                     names.size() > kShown ? fmt::format(" and {} more", names.size() - kShown) : "");
}

FirstLog::FirstLog(std::string path) : path_(std::move(path)) {
  if (is_csv()) {
    for (const LogColumn& column : ReadLogColumns(path_)) {
      (column.is_numeric() ? columns_ : text_columns_).push_back(column);
    }
    names_ = NamesOf(columns_);
    return;
  }
  DataOptions options;
  options.check = false;
  arrays_ = ReadDataset(path_, options);
  names_ = arrays_->observation_names;
  const bool is_named = !names_.empty();
  for (int i = 0; !is_named && i < arrays_->obs_dim(); ++i) names_.push_back(fmt::format("obs_{}", i));
  n_observations_ = names_.size();
  const std::vector<std::string>& actions = arrays_->action_names;
  for (int i = 0; i < arrays_->act_dim(); ++i) {
    names_.push_back(actions.empty() ? fmt::format("act_{}", i) : actions[static_cast<size_t>(i)]);
  }
}

ColumnMap FirstLog::Map(const ModelOutline& model, const std::string& model_path) const {
  ColumnMap map = MapColumns(names_, model);
  for (const LogColumn& column : text_columns_) {
    if (column.is_damaged) RefuseWhereKnown(column, model);
    const ColumnMap alone = MapColumns({column.name}, model);
    if (map.episode.empty()) map.episode = alone.episode;
    if (!alone.observations.empty() || !alone.actions.empty()) {
      map.unused.push_back(fmt::format("'{}': it holds text ('{}' in line {}), wanted numbers", column.name,
                                       column.text_field.substr(0, 40), column.text_line));
    }
  }
  const auto fail = [&](const char* what, const std::vector<std::string>& wanted, const char* more = "") {
    for (const LogColumn& column : text_columns_) RefuseWhereKnown(column, model);
    throw DataError(
        fmt::format("'{}': no column is {} of model '{}'. The columns are {}; the model has {}; rename columns after "
                    "these ('hip_pos', 'hip_vel', 'hip_cmd'){}",
                    path_, what, model_path, Some(names_), wanted.empty() ? "none" : Some(wanted), more));
  };
  if (map.observations.empty()) fail("a position, velocity or sensor", NamesOf(model.joints));
  if (map.actions.empty()) {
    fail("a command", model.actuators.empty() ? NamesOf(model.joints) : NamesOf(model.actuators),
         "; where nothing drove the robot, add a command of zeros");
  }
  if (!is_csv()) InFileOrder(map, model, model_path);
  for (std::string& unused : map.unused) {
    const auto column = std::ranges::find_if(
        columns_, [&](const LogColumn& c) { return unused.starts_with(fmt::format("'{}': ", c.name)); });
    if (column == columns_.end() || !IsOfRecordings(column->values)) continue;
    unused +=
        "; it differs between recordings: where it is known of them, as a load or a gain is, make it a constant "
        "([task.constants], docs/task_files.md)";
  }
  return map;
}

/// Words where the model asks for numbers.
void FirstLog::RefuseWhereKnown(const LogColumn& column, const ModelOutline& model) const {
  if (MapColumns({column.name}, model).IsEmpty()) return;
  throw DataError(
      fmt::format("'{}' line {}, column '{}': '{}' is no number, wanted digits with a decimal point; "
                  "repair or remove the row",
                  path_, column.text_line, column.name, column.text_field.substr(0, 40)));
}

/// Arrays have no columns to choose from: each must be something, in the order of the file.
void FirstLog::InFileOrder(ColumnMap& map, const ModelOutline& model, const std::string& model_path) const {
  const auto sort = [&](std::vector<ColumnMap::Entry>& entries) {
    std::ranges::sort(entries, {}, [&](const ColumnMap::Entry& entry) {
      return std::ranges::find(names_, entry.column) - names_.begin();
    });
  };
  sort(map.observations);
  sort(map.actions);
  const size_t n_actions = names_.size() - n_observations_;
  if (map.observations.size() == n_observations_ && map.actions.size() == n_actions) return;
  throw DataError(
      fmt::format("'{}' has {} numbers per observation and {} per action, and of these {} and {} are in model '{}', "
                  "whose state has {} positions and {} velocities, with {} actuators; write a CSV with named columns",
                  path_, n_observations_, n_actions, map.observations.size(), map.actions.size(), model_path,
                  model.qpos.size(), model.qvel.size(), model.actuators.size()));
}

double FirstLog::LargestAction(const ColumnMap& map) const {
  double most = 0;
  const auto take = [&](double value) { most = std::isfinite(value) ? std::max(most, std::abs(value)) : most; };
  if (arrays_) std::ranges::for_each(arrays_->actions.values(), take);
  for (const ColumnMap::Entry& entry : map.actions) {
    for (const LogColumn& column : columns_) {
      if (column.name == entry.column) std::ranges::for_each(column.values, take);
    }
  }
  return most;
}

double FirstLog::RowPeriod(const ColumnMap& map) const {
  const auto time = std::ranges::find(columns_, TimeName(map), &LogColumn::name);
  if (time == columns_.end()) FailPeriod();
  const double per_second = UnitsPerSecond(time->name);
  std::vector<double> steps;
  size_t n_down = 0;
  for (size_t i = 1; i < time->values.size(); ++i) {
    const double rows = (time->values[i] - time->values[i - 1]) / per_second;
    if (rows > 0) steps.push_back(rows);
    n_down += rows < 0 ? 1 : 0;
  }
  if (n_down >= steps.size()) {
    throw DataError(
        fmt::format("'{}': column '{}' goes up in {} rows and down in {}; sort the rows by time, or repair the clock",
                    path_, time->name, steps.size(), n_down));
  }
  const double step = Median(std::move(steps));
  if (step > kSlowest_s) {
    throw DataError(
        fmt::format("'{}': column '{}' goes up by {:.6g} per row, wanted seconds; divide it, or rename it by "
                    "its unit (time_ms, time_us, time_ns)",
                    path_, time->name, step * per_second));
  }
  return step;
}

/// Of the time column, as the reader finds it.
std::string FirstLog::TimeName(const ColumnMap& map) const {
  if (!map.time.empty()) return map.time;
  std::vector<std::string> names;
  for (const LogColumn& column : columns_) names.push_back(column.name);
  const int found = FindTimeColumn(names);
  return found < 0 ? "" : names[static_cast<size_t>(found)];
}

void FirstLog::FailPeriod() const {
  throw UsageError(fmt::format("'{}' does not say how far apart its rows are; give it with --period [s]", path_));
}

}  // namespace oted
