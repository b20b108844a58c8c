#include "oted/data/dataset_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/files.h"
#include "oted/data/csv_dataset.h"
#include "oted/data/csv_dataset_write.h"
#include "oted/data/d4rl_hdf5.h"
#include "oted/data/minari.h"
#include "oted/data/npz.h"
#include "oted/data/rescale.h"
#include "oted/data/unwrap.h"

namespace oted {
namespace {

/// The format that a file's ending stands for, if any.
std::optional<DataFormat> FormatOfEnding(const std::string& path) {
  struct Ending {
    std::string_view ending;
    DataFormat format;
  };
  static constexpr std::array<Ending, 5> kEndings = {{{".hdf5", DataFormat::kD4rl},
                                                      {".h5", DataFormat::kD4rl},
                                                      {".npz", DataFormat::kNpz},
                                                      {".csv", DataFormat::kCsv},
                                                      {".csv.gz", DataFormat::kCsv}}};
  for (const Ending& e : kEndings) {
    if (path.ends_with(e.ending)) return e.format;
  }
  return std::nullopt;
}

[[noreturn]] void FailEnding(const std::string& path) {
  throw DataError(
      fmt::format("'{}': no dataset format ends in '{}'; use .hdf5 or .h5 (D4RL layout), .npz, .csv or .csv.gz, or the "
                  "folder of a Minari dataset (NAME-v0)",
                  path, std::filesystem::path(path).extension().string()));
}

DataFormat FormatToRead(const std::string& path, const DataOptions& options) {
  if (options.format) return *options.format;
  if (std::filesystem::path(path).filename() == "main_data.hdf5") return DataFormat::kMinari;
  if (const auto format = FormatOfEnding(path)) return *format;
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return DataFormat::kMinari;
  if (IsMinariName(path)) return DataFormat::kMinari;  // which is missing: its reader says so
  if (!std::filesystem::path(path).has_extension() && !std::filesystem::exists(path, error)) {
    throw DataError(fmt::format("'{}' does not exist; check the path", path));
  }
  FailEnding(path);
}

/// All that a dataset is read from.
std::vector<std::string> FilesOf(const std::string& path, DataFormat format) {
  if (format != DataFormat::kMinari) return {path};
  const MinariFiles minari = FindMinari(path);
  if (minari.metadata.empty()) return {minari.data};
  return {minari.data, minari.metadata};
}

std::string Sha256OfAll(const std::vector<std::string>& files) {
  if (files.size() == 1) return Sha256OfFile(files[0]);
  std::string hashes;
  for (const std::string& file : files) hashes += Sha256OfFile(file) + "\n";
  return Sha256(hashes);
}

/// What changes where somebody writes to a file, as a logger that is still at work.
struct FileState {
  uintmax_t size = 0;
  std::filesystem::file_time_type written = {};
  bool operator==(const FileState&) const = default;
};

FileState StateOf(const std::string& file) {
  std::error_code error;  // where it is gone, too, its state is another
  return {std::filesystem::file_size(file, error), std::filesystem::last_write_time(file, error)};
}

/// Puts columns into the order of the wanted names. @return remarks
void Reorder(const std::string& path, const char* what, const char* setting, const std::vector<std::string>& wanted,
             std::vector<std::string>& names, std::vector<Array2<double>*> arrays, std::vector<std::string>& remarks) {
  if (names.empty() || wanted.empty() || names == wanted) return;
  std::vector<int> columns;
  std::vector<std::string> missing;
  for (const std::string& name : wanted) {
    const auto found = std::ranges::find(names, name);
    if (found == names.end()) {
      missing.push_back(name);
    } else {
      columns.push_back(static_cast<int>(found - names.begin()));
    }
  }
  // Names that mean nothing to the task ("obs_0") are places.
  if (columns.empty()) return;
  if (!missing.empty()) {
    throw DataError(
        fmt::format("'{}': of the task's {} {} are not among the columns ({}); the columns have {}. Rename them, or "
                    "list all columns "
                    "in the task's order under names that the task does not use (data.{})",
                    path, what, fmt::join(missing, ", "), missing.size(), fmt::join(names, ", "), setting));
  }
  if (wanted.size() < names.size()) {
    remarks.push_back(
        fmt::format("{} of {} {} are the task's; the others are not used", wanted.size(), names.size(), what));
  } else {
    remarks.push_back(fmt::format("{} put into the task's order by name", what));
  }
  for (Array2<double>* array : arrays) {
    Array2<double> ordered(array->rows(), static_cast<int>(columns.size()));
    for (int i = 0; i < array->rows(); ++i) {
      for (size_t j = 0; j < columns.size(); ++j) ordered(i, static_cast<int>(j)) = (*array)(i, columns[j]);
    }
    *array = std::move(ordered);
  }
  names = wanted;
}

}  // namespace

const NamedValues<std::optional<DataFormat>>& DataFormatNames() {
  static const NamedValues<std::optional<DataFormat>> names = {{std::nullopt, "auto"},
                                                               {DataFormat::kD4rl, "d4rl"},
                                                               {DataFormat::kMinari, "minari"},
                                                               {DataFormat::kNpz, "npz"},
                                                               {DataFormat::kCsv, "csv"}};
  return names;
}

void MatchNames(Dataset& dataset, const std::vector<std::string>& observation_names,
                const std::vector<std::string>& action_names) {
  Reorder(dataset.path, "observations", "observations", observation_names, dataset.observation_names,
          {&dataset.observations, &dataset.next_observations}, dataset.remarks);
  Reorder(dataset.path, "actions", "actions", action_names, dataset.action_names, {&dataset.actions}, dataset.remarks);
}

void DelayActions(Dataset& dataset, int delay) {
  if (delay == 0) return;
  OTED_CHECK(delay > 0);
  std::vector<Episode> kept;
  int n_lost = 0;
  for (const Episode& episode : dataset.Episodes()) {
    // From the end, so that each row still finds the action that it gets.
    for (int i = episode.end - 1; i >= episode.begin + delay; --i) {
      std::ranges::copy(dataset.actions.row(i - delay), dataset.actions.row(i).begin());
    }
    n_lost += episode.size() <= delay;
    if (episode.size() > delay) kept.push_back({episode.begin + delay, episode.end, episode.terminated});
  }
  if (kept.empty()) {
    throw DataError(fmt::format("'{}': no episode is longer than data.action_delay ({} control steps); lower it",
                                dataset.path, delay));
  }
  dataset = dataset.Select(kept);
  dataset.remarks.push_back(
      fmt::format("actions act {} control steps after they were logged: each episode lost its first {} rows{}", delay,
                  delay, n_lost > 0 ? fmt::format(", and {} shorter ones are gone", n_lost) : ""));
}

std::string Sha256OfDataset(const std::string& path, const DataOptions& options) {
  return Sha256OfAll(FilesOf(path, FormatToRead(path, options)));
}

Dataset ReadDataset(const std::string& path) { return ReadDataset(path, DataOptions{}); }

Dataset ReadDataset(const std::string& path, const DataOptions& options) {
  if (options.action_delay < 0) {
    throw UsageError(fmt::format("data.action_delay is {}, wanted 0 or more control steps", options.action_delay));
  }
  CheckIsFile(path);
  const DataFormat format = FormatToRead(path, options);
  std::error_code error;
  if (format != DataFormat::kMinari && !std::filesystem::is_regular_file(path, error)) {
    throw DataError(
        fmt::format("dataset '{}' is not a file; check the path (in a file it is relative to that file)", path));
  }
  const TaskNames task{options.observation_names, options.action_names};
  const std::vector<std::string> files = FilesOf(path, format);
  std::vector<FileState> before;
  for (const std::string& file : files) before.push_back(StateOf(file));
  Dataset dataset;
  if (format == DataFormat::kMinari) {
    dataset = ReadMinari(path, options);
  } else if (format == DataFormat::kD4rl) {
    dataset = ReadHdf5(path, options);
  } else if (format == DataFormat::kNpz) {
    dataset = ReadDatasetNpz(path, options);
  } else {
    Recording recording = ReadCsv(path, options);
    Rescale(recording, options.rescaling, task);
    Unwrap(recording, options.unwrap, options.observation_names);
    const double period = options.control_period_s > 0 ? options.control_period_s : recording.period_s;
    if (period > 0) recording = Resample(recording, period);
    dataset = ToDataset(recording);
  }
  dataset.path = path;
  dataset.sha256 = Sha256OfAll(files);
  for (size_t i = 0; i < files.size(); ++i) {
    if (StateOf(files[i]) == before[i]) continue;
    throw DataError(fmt::format("'{}' changed while it was read; run the command again when it is whole", files[i]));
  }
  if (options.check) dataset.Check();
  if (format != DataFormat::kCsv) {
    Rescale(dataset, options.rescaling, task);
    if (!options.unwrap.empty()) Unwrap(dataset, options.unwrap, options.observation_names);
  }
  MatchNames(dataset, options.observation_names, options.action_names);
  DelayActions(dataset, options.action_delay);
  return dataset;
}

void WriteDataset(const Dataset& dataset, const std::string& path) { WriteDataset(dataset, path, WriteOptions{}); }

void WriteDataset(const Dataset& dataset, const std::string& path, const WriteOptions& options) {
  if (!FormatOfEnding(path) && !IsMinariName(path)) FailEnding(path);
  const DataFormat format = FormatOfEnding(path).value_or(DataFormat::kMinari);
  if (format != DataFormat::kCsv && !dataset.constants.empty()) {
    throw DataError(fmt::format("'{}': only a CSV holds constants of recordings ({}); write .csv or .csv.gz", path,
                                fmt::join(dataset.constant_names, ", ")));
  }
  if (format == DataFormat::kD4rl) {
    WriteD4rlHdf5(dataset, path);
  } else if (format == DataFormat::kMinari) {
    WriteMinari(dataset, path, options);
  } else if (format == DataFormat::kNpz) {
    WriteDatasetNpz(dataset, path);
  } else {
    WriteCsv(dataset, path);
  }
}

}  // namespace oted
