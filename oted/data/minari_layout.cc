#include "oted/data/minari_layout.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int kMaxDepth = 16;
constexpr int64_t kMaxColumns = 1 << 20;

/// The number behind `prefix`, when the rest of the name is one.
std::optional<int64_t> NumberAfter(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  int64_t number = -1;
  const auto [rest, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || rest != name.data() + name.size() || number < 0) return std::nullopt;
  return number;
}

/// Tuple spaces are groups of _index_0, _index_1, ...: 2 comes before 10.
void SortNames(std::vector<std::string>& names, std::string_view prefix) {
  std::ranges::stable_sort(names, [&](const std::string& a, const std::string& b) {
    const auto i = NumberAfter(a, prefix), j = NumberAfter(b, prefix);
    if (i && j && *i != *j) return *i < *j;
    return a < b;
  });
}

/// The columns of one array or of a nested space.
struct Columns {
  Array2<double> values;
  std::vector<std::string> names;  ///< empty for a plain array
};

class EpisodeReader {
 public:
  EpisodeReader(const Hdf5Reader& source, std::string group) : source_(source), group_(std::move(group)) {}

  std::string Path(const std::string& name) const { return group_ + "/" + name; }

  bool Has(const std::string& name) const { return source_.Has(Path(name)); }

  /// `rows` -1: as many as the array has.
  Columns Read(const std::string& name, int64_t rows) const {
    if (!Has(name)) {
      source_.Fail(Path(name), "is missing",
                   "Minari's episodes have observations, actions, rewards, terminations, "
                   "truncations: write the dataset again");
    }
    std::vector<Leaf> leaves;
    Collect(Path(name), "", 0, leaves);
    if (leaves.empty()) source_.Fail(Path(name), "is empty", "write the dataset again");
    // An image comes before what goes with it, as the grid worlds here have it.
    std::ranges::stable_partition(leaves, [](const Leaf& leaf) { return leaf.shape.size() == 4; });
    int64_t cols = 0;
    for (Leaf& leaf : leaves) {
      if (rows < 0) rows = leaf.shape[0];
      if (leaf.shape[0] != rows || rows > std::numeric_limits<int>::max()) {
        FailShape(leaf, fmt::format("{} rows (T + 1 observations for T actions, rewards and flags)", rows));
      }
      leaf.cols = 1;
      for (size_t d = 1; d < leaf.shape.size(); ++d) {
        if (leaf.shape[d] < 1 || leaf.shape[d] > kMaxColumns / leaf.cols) FailShape(leaf, "at least one column");
        leaf.cols *= leaf.shape[d];
      }
      cols += leaf.cols;
      if (cols > kMaxColumns) FailShape(leaf, fmt::format("at most {} columns in all", kMaxColumns));
    }
    Columns columns;
    columns.values = Array2<double>(static_cast<int>(rows), static_cast<int>(cols));
    int64_t at = 0;
    for (const Leaf& leaf : leaves) {
      std::vector<double> values(static_cast<size_t>(rows * leaf.cols));
      source_.Read(leaf.path, values);
      for (int64_t i = 0; i < rows; ++i) {
        const std::span<double> row = columns.values.row(static_cast<int>(i));
        std::copy_n(values.begin() + i * leaf.cols, leaf.cols, row.begin() + at);
      }
      at += leaf.cols;
      if (leaf.name.empty()) continue;
      for (int64_t j = 0; j < leaf.cols; ++j) {
        columns.names.push_back(leaf.shape.size() == 1 ? leaf.name : fmt::format("{}[{}]", leaf.name, j));
      }
    }
    return columns;
  }

  /// (T) or (T, 1).
  std::vector<double> Vector(const std::string& name, int64_t rows) const {
    const Columns columns = Read(name, rows);
    if (columns.values.cols() != 1) source_.Fail(Path(name), "has several columns", "give one number per step");
    return {columns.values.values().begin(), columns.values.values().end()};
  }

  std::vector<uint8_t> Flags(const std::string& name, int64_t rows) const {
    const std::vector<double> values = Vector(name, rows);
    std::vector<uint8_t> flags(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
      if (values[i] != 0 && values[i] != 1) {
        source_.Fail(Path(name), fmt::format("[{}] is {}, wanted 0 or 1", i, values[i]), "repair the flag");
      }
      flags[i] = values[i] != 0;
    }
    return flags;
  }

  void FailSmall(const std::string& name) const {
    source_.Fail(Path(name), "has no row", "an episode of T actions has T + 1 observations: write it again");
  }

 private:
  struct Leaf {
    std::string path;
    std::string name;  ///< below the space, "a.b"; empty for a plain array
    std::vector<int64_t> shape;
    int64_t cols = 1;
  };

  [[noreturn]] void FailShape(const Leaf& leaf, const std::string& wanted) const {
    source_.Fail(leaf.path, fmt::format("has shape ({}), wanted {}", fmt::join(leaf.shape, ", "), wanted),
                 "write the dataset again");
  }

  void Collect(const std::string& path, const std::string& name, int depth, std::vector<Leaf>& leaves) const {
    if (depth > kMaxDepth) source_.Fail(path, "is nested too deep", "flatten the space");
    if (!source_.IsGroup(path)) {
      if (name == "mission") return;  // the text of a grid world's task: nothing that is seen
      if (source_.HoldsBytes(path) && source_.Shape(path).size() != 4) {
        source_.Fail(path, "holds bytes and is no stack of images (JPEG where the metadata say so)",
                     "oted reads numbers, and images as (T, height, width, channels): write it again without JPEG");
      }
      leaves.push_back({path, name, source_.Shape(path), 1});
      return;
    }
    std::vector<std::string> members = source_.Names(path);
    SortNames(members, "_index_");
    for (const std::string& member : members) {
      // Has refuses links to other files.
      if (!source_.Has(path + "/" + member)) source_.Fail(path + "/" + member, "leads nowhere", "write it again");
      Collect(path + "/" + member, name.empty() ? member : name + "." + member, depth + 1, leaves);
    }
  }

  const Hdf5Reader& source_;
  std::string group_;
};

void Append(Array2<double>& to, const Array2<double>& from, int rows) {
  for (int i = 0; i < rows; ++i) to.AppendRow(from.row(i));
}

}  // namespace

Dataset ReadMinariEpisodes(const Hdf5Reader& source, const std::string& file, int64_t promised) {
  std::vector<std::string> groups;
  for (const std::string& name : source.Names("/")) {
    if (NumberAfter(name, "episode_")) groups.push_back(name);
  }
  SortNames(groups, "episode_");
  if (groups.empty()) {
    throw DataError(
        fmt::format("'{}' has no group episode_0, as Minari's main_data.hdf5 does; is it D4RL's layout?", file));
  }
  if (promised >= 0 && promised != static_cast<int64_t>(groups.size())) {
    throw DataError(fmt::format("'{}' holds {} episodes but its metadata.json says {}; download or write it again",
                                file, groups.size(), promised));
  }
  Dataset dataset;
  int n_empty = 0;
  int n_cut = 0;
  bool has_states = true;
  bool has_rewards = true;
  for (size_t e = 0; e < groups.size(); ++e) {
    if (!source.Has(groups[e])) source.Fail(groups[e], "cannot be opened", "write the dataset again");
    const EpisodeReader episode(source, groups[e]);
    const Columns observations = episode.Read("observations", -1);
    const int rows = observations.values.rows() - 1;
    if (rows < 0) episode.FailSmall("observations");
    if (rows == 0) {
      ++n_empty;
      continue;
    }
    const Columns actions = episode.Read("actions", rows);
    if (dataset.size() > 0 &&
        (observations.values.cols() != dataset.obs_dim() || actions.values.cols() != dataset.act_dim())) {
      source.Fail(groups[e],
                  fmt::format("has observations of {} and actions of {} numbers, the episodes before it {} and {}",
                              observations.values.cols(), actions.values.cols(), dataset.obs_dim(), dataset.act_dim()),
                  "all episodes need the same spaces");
    }
    if (dataset.size() > std::numeric_limits<int>::max() - rows) source.Fail(groups[e], "is one too many", "split");
    dataset.observation_names = observations.names;
    dataset.action_names = actions.names;
    Append(dataset.observations, observations.values, rows);
    for (int i = 1; i <= rows; ++i) dataset.next_observations.AppendRow(observations.values.row(i));
    Append(dataset.actions, actions.values, rows);
    const std::vector<uint8_t> terminals = episode.Flags("terminations", rows);
    std::vector<uint8_t> timeouts = episode.Flags("truncations", rows);
    if (!terminals.back() && !timeouts.back()) {
      timeouts.back() = 1;
      ++n_cut;
    }
    dataset.terminals.insert(dataset.terminals.end(), terminals.begin(), terminals.end());
    dataset.timeouts.insert(dataset.timeouts.end(), timeouts.begin(), timeouts.end());
    if (!episode.Has("rewards")) has_rewards = false;
    if (has_rewards) {
      const std::vector<double> rewards = episode.Vector("rewards", rows);
      dataset.rewards.insert(dataset.rewards.end(), rewards.begin(), rewards.end());
    }
    has_states = has_states && episode.Has("infos/qpos") && episode.Has("infos/qvel");
    if (!has_states) continue;
    const Columns qpos = episode.Read("infos/qpos", -1);
    const Columns qvel = episode.Read("infos/qvel", -1);
    const bool fits = qpos.values.rows() >= rows && qvel.values.rows() >= rows &&
                      (dataset.qpos.empty() ||
                       (qpos.values.cols() == dataset.qpos.cols() && qvel.values.cols() == dataset.qvel.cols()));
    if (!fits) source.Fail(groups[e] + "/infos", "has a qpos or qvel of another shape", "write the dataset again");
    Append(dataset.qpos, qpos.values, rows);
    Append(dataset.qvel, qvel.values, rows);
  }
  if (!has_states) dataset.qpos = dataset.qvel = Array2<double>();
  // A reward-free log is written with NaN: Minari wants the array.
  const bool no_reward = std::ranges::all_of(dataset.rewards, [](double r) { return std::isnan(r); });
  if (!has_rewards || no_reward) dataset.rewards.clear();
  if (n_empty > 0) dataset.remarks.push_back(fmt::format("{} episodes without an action were left out", n_empty));
  if (n_cut > 0) {
    dataset.remarks.push_back(
        fmt::format("{} episodes neither terminate nor are truncated: read as cut after their last row", n_cut));
  }
  return dataset;
}

}  // namespace oted
