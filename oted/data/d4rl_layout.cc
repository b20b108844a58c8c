#include "oted/data/d4rl_layout.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "oted/base/error.h"

namespace oted {
namespace {

class Reader {
 public:
  Reader(const ArraySource& source, const std::string& file) : source_(source), file_(file) {}

  /// (N, d) with N that of the first matrix read.
  Array2<double> Matrix(const std::string& name) {
    const std::vector<int64_t> shape = source_.Shape(name);
    if (shape.empty() || shape.size() > 2) {
      Fail(name, shape, "(N, d), one row of numbers per transition; flatten images and nested spaces first");
    }
    const int64_t cols = shape.size() == 2 ? shape[1] : 1;
    CheckRows(name, shape);
    if (cols < 1 || cols > kMaxColumns) Fail(name, shape, fmt::format("1 to {} columns", kMaxColumns));
    Array2<double> matrix(static_cast<int>(shape[0]), static_cast<int>(cols));
    source_.Read(name, matrix.values());
    return matrix;
  }

  /// (N) or (N, 1).
  std::vector<double> Vector(const std::string& name) {
    const std::vector<int64_t> shape = source_.Shape(name);
    if (shape.empty() || shape.size() > 2 || (shape.size() == 2 && shape[1] != 1)) {
      Fail(name, shape, "(N) or (N, 1), one number per transition");
    }
    CheckRows(name, shape);
    std::vector<double> vector(static_cast<size_t>(shape[0]));
    source_.Read(name, vector);
    return vector;
  }

  std::vector<uint8_t> Flags(const std::string& name) {
    const std::vector<double> values = Vector(name);
    std::vector<uint8_t> flags(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
      if (values[i] != 0 && values[i] != 1) {
        throw DataError(fmt::format("'{}': {}[{}] is {}, wanted 0 or 1; repair the flag", file_, name, i, values[i]));
      }
      flags[i] = values[i] != 0;
    }
    return flags;
  }

 private:
  static constexpr int64_t kMaxColumns = 1 << 20;

  [[noreturn]] void Fail(const std::string& name, const std::vector<int64_t>& shape, const std::string& wanted) const {
    throw DataError(fmt::format("'{}': {} has shape ({}), wanted {}", file_, name, fmt::join(shape, ", "), wanted));
  }

  void CheckRows(const std::string& name, const std::vector<int64_t>& shape) {
    if (shape[0] < 1 || shape[0] > std::numeric_limits<int>::max()) Fail(name, shape, "1 to 2^31 - 1 transitions");
    if (n_ == 0) n_ = shape[0];
    if (shape[0] != n_) {
      Fail(name, shape, fmt::format("{} rows, as many as observations; write the file again", n_));
    }
  }

  const ArraySource& source_;
  const std::string& file_;
  int64_t n_ = 0;
};

std::vector<uint8_t> InferTimeouts(const std::vector<uint8_t>& terminals, int time_limit) {
  std::vector<uint8_t> timeouts(terminals.size(), 0);
  int steps = 0;
  for (size_t i = 0; i < terminals.size(); ++i) {
    ++steps;
    timeouts[i] = !terminals[i] && steps == time_limit;
    if (terminals[i] || timeouts[i]) steps = 0;
  }
  return timeouts;
}

/// Moves row `from` of every array that is there to row `to` <= `from`.
void MoveRow(Dataset& dataset, int from, int to) {
  for (Array2<double>* m : {&dataset.observations, &dataset.actions, &dataset.qpos, &dataset.qvel}) {
    if (!m->empty()) std::ranges::copy(m->row(from), m->row(to).begin());
  }
  if (!dataset.rewards.empty()) dataset.rewards[to] = dataset.rewards[from];
  dataset.terminals[to] = dataset.terminals[from];
  dataset.timeouts[to] = dataset.timeouts[from];
}

void InferNextObservations(Dataset& dataset) {
  const int n = dataset.size();
  dataset.next_observations = Array2<double>(n, dataset.obs_dim());
  int kept = 0;
  int kept_of_episode = 0;
  int n_episodes = 0;
  for (int i = 0; i < n; ++i) {
    if (dataset.terminals[i] || dataset.timeouts[i] || i + 1 == n) {
      if (kept_of_episode > 0) dataset.timeouts[kept - 1] = 1;
      kept_of_episode = 0;
      ++n_episodes;
      continue;
    }
    std::ranges::copy(dataset.observations.row(i + 1), dataset.next_observations.row(kept).begin());
    MoveRow(dataset, i, kept++);
    ++kept_of_episode;
  }
  for (Array2<double>* m :
       {&dataset.observations, &dataset.actions, &dataset.next_observations, &dataset.qpos, &dataset.qvel}) {
    if (!m->empty()) m->ResizeRows(kept);
  }
  if (!dataset.rewards.empty()) dataset.rewards.resize(static_cast<size_t>(kept));
  dataset.terminals.resize(static_cast<size_t>(kept));
  dataset.timeouts.resize(static_cast<size_t>(kept));
  dataset.remarks.push_back(
      fmt::format("no next_observations: s' is the next row of the same episode, and the last row of each of the {} "
                  "episodes, whose "
                  "successor is not in the file, was dropped",
                  n_episodes));
}

}  // namespace

Dataset ReadD4rlArrays(const ArraySource& source, const std::string& file, int max_episode_steps) {
  for (const char* name : {"observations", "actions", "terminals"}) {
    if (source.Has(name)) continue;
    throw DataError(
        fmt::format("'{}' has no '{}'; D4RL's layout needs observations (N, d), actions (N, m) and "
                    "terminals (N) at the top of the file",
                    file, name));
  }
  if (source.Has("infos/qpos") != source.Has("infos/qvel")) {
    throw DataError(fmt::format("'{}' has only one of infos/qpos and infos/qvel; write both or neither", file));
  }
  Reader reader(source, file);
  Dataset dataset;
  dataset.observations = reader.Matrix("observations");
  dataset.actions = reader.Matrix("actions");
  dataset.terminals = reader.Flags("terminals");
  if (source.Has("rewards")) dataset.rewards = reader.Vector("rewards");
  if (source.Has("infos/qpos")) {
    dataset.qpos = reader.Matrix("infos/qpos");
    dataset.qvel = reader.Matrix("infos/qvel");
  }
  if (source.Has("timeouts")) {
    dataset.timeouts = reader.Flags("timeouts");
  } else {
    const int time_limit = max_episode_steps > 0 ? max_episode_steps : kD4rlTimeLimit;
    dataset.timeouts = InferTimeouts(dataset.terminals, time_limit);
    dataset.remarks.push_back(fmt::format("no timeouts: episodes were cut after {} rows", time_limit));
  }
  if (source.Has("next_observations")) {
    dataset.next_observations = reader.Matrix("next_observations");
    if (dataset.next_observations.cols() != dataset.obs_dim()) {
      throw DataError(
          fmt::format("'{}': next_observations has {} columns but observations has {}; write the file again", file,
                      dataset.next_observations.cols(), dataset.obs_dim()));
    }
  } else {
    InferNextObservations(dataset);
  }
  return dataset;
}

}  // namespace oted
