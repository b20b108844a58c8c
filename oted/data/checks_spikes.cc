#include "oted/data/checks_spikes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "oted/data/channel_series.h"

namespace oted {
namespace {

constexpr double kUsual = 0.95;        // share of the readings that are no farther off their neighbours' mean
constexpr double kTimesTheUsual = 30;  // from which on one is a spike
constexpr double kHalf = 0.1;          // how far the neighbours may be from half of it, on the other side
constexpr size_t kFewestReadings = 100;

struct Spike {
  int row;  // its observation
  double value, before, after;
};

/// How far each reading is from the mean of its neighbours; 0 at either end.
std::vector<double> Off(const std::vector<double>& series) {
  std::vector<double> off(series.size(), 0.0);
  for (size_t i = 1; i + 1 < series.size(); ++i) off[i] = series[i] - (series[i - 1] + series[i + 1]) / 2;
  return off;
}

/// Whether neighbours are off by half as much on the other side, as beside one wrong reading: after a jump they are
/// not.
bool IsAlone(const std::vector<double>& off, size_t i) {
  const auto is_half = [&](double neighbour) { return std::abs(-neighbour / off[i] - 0.5) < kHalf; };
  return i >= 2 && i + 2 < off.size() && is_half(off[i - 1]) && is_half(off[i + 1]);
}

std::vector<Spike> SpikesOf(const Dataset& dataset, int channel) {
  const std::vector<std::vector<double>> all = SeriesOf(dataset, channel);
  std::vector<std::vector<double>> off;
  std::vector<double> sizes;
  for (const std::vector<double>& series : all) {
    off.push_back(Off(series));
    for (const double v : off.back()) sizes.push_back(std::abs(v));
  }
  if (sizes.size() < kFewestReadings) return {};
  const auto usual = sizes.begin() + static_cast<std::ptrdiff_t>(kUsual * static_cast<double>(sizes.size()));
  std::nth_element(sizes.begin(), usual, sizes.end());
  std::vector<Spike> spikes;
  int begin = 0;
  for (size_t e = 0; e < all.size(); ++e) {
    for (size_t i = 0; i < all[e].size(); ++i) {
      if (!(*usual > 0) || std::abs(off[e][i]) < kTimesTheUsual * *usual || !IsAlone(off[e], i)) continue;
      spikes.push_back({begin + static_cast<int>(i), all[e][i], all[e][i - 1], all[e][i + 1]});
    }
    begin += static_cast<int>(all[e].size()) - 1;
  }
  return spikes;
}

/// Whether the channel is frozen for a while, or is the rate of one that is: what it missed comes in one row.
bool IsOfFrozen(int channel, const TaskFacts& facts, const std::vector<Finding>& findings) {
  const auto frozen = std::ranges::find(findings, "frozen_channels", &Finding::check);
  if (frozen == findings.end()) return false;
  const auto is_named = [&](int j) { return std::ranges::count(frozen->channels, facts.ObservationName(j)) > 0; };
  const auto at = static_cast<size_t>(channel);
  return is_named(channel) || (at < facts.rate_of.size() && facts.rate_of[at] >= 0 && is_named(facts.rate_of[at]));
}

}  // namespace

void CheckSpikes(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations) return;
  std::vector<std::string> shown, channels;
  int first = -1;
  int64_t n = 0;
  for (const int j : facts.States()) {
    if (j >= dataset.obs_dim() || IsOfFrozen(j, facts, findings)) continue;
    const std::vector<Spike> spikes = SpikesOf(dataset, j);
    if (spikes.empty()) continue;
    const std::string name = facts.ObservationName(j);
    const Spike& one = spikes.front();
    shown.push_back(fmt::format("{} ({}in row {} it is {:.4g}, between {:.4g} and {:.4g})", name,
                                spikes.size() == 1 ? "" : fmt::format("{} times; ", spikes.size()), one.row, one.value,
                                one.before, one.after));
    channels.push_back(name);
    n += static_cast<int64_t>(spikes.size());
    first = first < 0 ? one.row : std::min(first, one.row);
  }
  if (channels.empty()) return;
  findings.push_back({.check = "spikes",
                      .severity = Severity::kWarning,
                      .what = fmt::format("single readings are far off: {}", fmt::join(shown, "; ")),
                      .row = first,
                      .count = n,
                      .channels = channels,
                      .meaning = "a transmission error: no robot goes there and back in two rows; the default method "
                                 "lets such rows count little, others fit them",
                      .remedy = "end the episode before these rows and go on after them"});
}

}  // namespace oted
