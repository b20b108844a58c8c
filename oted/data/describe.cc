#include "oted/data/describe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {
namespace {

ChannelSummary Summarize(const Array2<double>& m, int j, std::string name) {
  ChannelSummary s{.name = std::move(name), .low = m(0, j), .high = m(0, j)};
  for (int i = 0; i < m.rows(); ++i) {
    s.low = std::min(s.low, m(i, j));
    s.high = std::max(s.high, m(i, j));
    s.mean += m(i, j) / m.rows();
  }
  double square = 0;
  for (int i = 0; i < m.rows(); ++i) square += (m(i, j) - s.mean) * (m(i, j) - s.mean) / m.rows();
  s.std = std::sqrt(square);
  if (!std::isfinite(s.mean)) s.low = s.high = s.mean = s.std = NAN;
  return s;
}

}  // namespace

DatasetSummary Describe(const Dataset& d, const TaskFacts& facts) {
  if (d.size() == 0) throw DataError(fmt::format("dataset '{}' holds no transition; record at least one", d.path));
  DatasetSummary s;
  s.n_transitions = d.size();
  std::vector<int> lengths;
  for (const Episode& e : d.Episodes()) lengths.push_back(e.size());
  std::sort(lengths.begin(), lengths.end());
  const size_t n = lengths.size();
  s.n_episodes = static_cast<int>(n);
  s.shortest = lengths.front();
  s.longest = lengths.back();
  s.median_length = 0.5 * (lengths[(n - 1) / 2] + lengths[n / 2]);
  s.n_terminals = static_cast<int>(std::count(d.terminals.begin(), d.terminals.end(), 1));
  s.n_timeouts = static_cast<int>(std::count(d.timeouts.begin(), d.timeouts.end(), 1));
  s.returns = d.EpisodeReturns();
  for (int j = 0; j < d.obs_dim(); ++j)
    s.observations.push_back(Summarize(d.observations, j, facts.ObservationName(j)));
  for (int j = 0; j < d.act_dim(); ++j) s.actions.push_back(Summarize(d.actions, j, facts.ActionName(j)));
  s.nq = d.qpos.cols();
  s.nv = d.qvel.cols();
  return s;
}

}  // namespace oted
