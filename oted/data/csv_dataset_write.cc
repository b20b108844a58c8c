#include "oted/data/csv_dataset_write.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/csv.h"
#include "oted/data/csv_columns.h"
#include "oted/data/gzip.h"

namespace oted {
namespace {

std::vector<std::string> ColumnNames(const std::string& prefix, const std::vector<std::string>& names, int n) {
  std::vector<std::string> columns;
  for (int j = 0; j < n; ++j) {
    // Names that are still whole columns ("obs_0") need no second prefix; "actuator/hip" is none.
    const std::string name = names.empty() ? std::to_string(j) : names[static_cast<size_t>(j)];
    columns.push_back(CsvField(BeginsWithPrefix(name, prefix) ? name : prefix + "." + name));
  }
  return columns;
}

std::span<const double> ConstantsOf(const Dataset& dataset, int row) {
  return dataset.constants.empty() ? std::span<const double>() : dataset.constants.row(row);
}

}  // namespace

std::string CsvBytes(const Dataset& dataset, const std::string& path) {
  dataset.Check();
  std::string text = "episode";
  const bool has_rewards = !dataset.rewards.empty();
  if (dataset.period_s > 0) text += ",time";
  const auto header = [&](const std::vector<std::string>& names) {
    for (const std::string& name : names) text += "," + name;
  };
  header(ColumnNames("obs", dataset.observation_names, dataset.obs_dim()));
  header(ColumnNames("act", dataset.action_names, dataset.act_dim()));
  if (has_rewards) text += ",reward";
  text += ",terminal,timeout";
  if (dataset.has_states()) {
    header(ColumnNames("infos/qpos", {}, dataset.qpos.cols()));
    header(ColumnNames("infos/qvel", {}, dataset.qvel.cols()));
  }
  for (const std::string& name : dataset.constant_names) text += "," + CsvField(name);
  text += '\n';
  const auto numbers = [&](std::span<const double> values) {
    for (const double value : values) fmt::format_to(std::back_inserter(text), ",{}", value);
  };
  const auto none = [&](int n) { text.append(static_cast<size_t>(n), ','); };
  const std::vector<Episode> episodes = dataset.Episodes();
  for (size_t e = 0; e < episodes.size(); ++e) {
    const auto [begin, end, terminated] = episodes[e];
    for (int i = begin; i < end; ++i) {
      if (i + 1 < end && !std::ranges::equal(dataset.next_observations.row(i), dataset.observations.row(i + 1))) {
        throw DataError(
            fmt::format("'{}': next_observations[{}] is not observations[{}] of the same episode, and a CSV "
                        "holds each state once; write .hdf5 or .npz, or mark a timeout there",
                        path, i, i + 1));
      }
      text += std::to_string(e);
      if (dataset.period_s > 0) numbers(std::vector<double>{(i - begin) * dataset.period_s});
      numbers(dataset.observations.row(i));
      numbers(dataset.actions.row(i));
      if (has_rewards) numbers({&dataset.rewards[static_cast<size_t>(i)], 1});
      text += fmt::format(",{:d},{:d}", dataset.terminals[i] != 0, i + 1 == end && !terminated);
      if (dataset.has_states()) {
        numbers(dataset.qpos.row(i));
        numbers(dataset.qvel.row(i));
      }
      for (const double value : ConstantsOf(dataset, i)) text += std::isnan(value) ? "," : fmt::format(",{}", value);
      text += '\n';
    }
    text += std::to_string(e);
    if (dataset.period_s > 0) numbers(std::vector<double>{(end - begin) * dataset.period_s});
    numbers(dataset.next_observations.row(end - 1));
    none(dataset.act_dim() + has_rewards + 2 + dataset.qpos.cols() + dataset.qvel.cols() + dataset.constants.cols());
    text += '\n';
  }
  return path.ends_with(".gz") ? Gzip(text) : text;
}

void WriteCsv(const Dataset& dataset, const std::string& path) { WriteFileAtomically(path, CsvBytes(dataset, path)); }

}  // namespace oted
