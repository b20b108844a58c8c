#include "oted/data/checks_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

#include "oted/data/copied_rows.h"
#include "oted/data/standing_rows.h"

namespace oted {
namespace {

constexpr double kDuplicateShare = 0.05;    // of rows: above it a warning
constexpr double kStandingShare = 0.01;     // the same
constexpr double kInconsistentShare = 0.2;  // of rows: more is no missed boundary but another origin of s'
constexpr double kJump = 3;                 // times the 95 % quantile of a channel's change, in half of the channels
constexpr double kFarthest = 2;  // of a period at a joint's fastest rate about a row: how far it goes in that row
constexpr int kRowsForJumps = 100;

std::string_view Bytes(std::span<const double> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)};
}

/// Rows [begin, end) of a matrix, as bytes.
std::string_view Bytes(const Array2<double>& m, int begin, int end) {
  const size_t cols = static_cast<size_t>(m.cols());
  return Bytes(m.values().subspan(static_cast<size_t>(begin) * cols, static_cast<size_t>(end - begin) * cols));
}

/// Of `n` things, those that equal an earlier one, ascending.
template <class Hash, class Equal>
std::vector<int> Repeats(int n, const Hash& hash, const Equal& equal) {
  std::vector<std::pair<size_t, int>> order;
  for (int i = 0; i < n; ++i) order.emplace_back(hash(i), i);
  std::sort(order.begin(), order.end());
  std::vector<int> repeats;
  for (size_t i = 0; i < order.size(); ++i) {
    // Back over the run of equal hashes: its first member is nearly always the one that is repeated.
    for (size_t k = i; k > 0 && order[k - 1].first == order[i].first; --k) {
      if (!equal(order[k - 1].second, order[i].second)) continue;
      repeats.push_back(order[i].second);
      break;
    }
  }
  std::sort(repeats.begin(), repeats.end());
  return repeats;
}

/// Episodes that equal an earlier one, of a world of few states.
void CheckEqualEpisodes(const Dataset& d, const std::vector<Episode>& episodes, std::vector<Finding>& findings) {
  const auto bytes = [&](const Array2<double>& m, int e) {
    return Bytes(m, episodes[static_cast<size_t>(e)].begin, episodes[static_cast<size_t>(e)].end);
  };
  const std::vector<int> again = Repeats(
      static_cast<int>(episodes.size()), [&](int e) { return std::hash<std::string_view>()(bytes(d.observations, e)); },
      [&](int a, int b) {
        return bytes(d.observations, a) == bytes(d.observations, b) && bytes(d.actions, a) == bytes(d.actions, b);
      });
  if (again.empty()) return;
  findings.push_back(
      {.check = "duplicated_episodes",
       .severity = Severity::kWarning,
       .what = fmt::format("{} of {} episodes repeat an earlier one to the last bit", again.size(), episodes.size()),
       .row = episodes[static_cast<size_t>(again[0])].begin,
       .count = static_cast<int64_t>(again.size()),
       .meaning = "they weigh twice, and what is held out for scores is then not unseen",
       .remedy = "remove the copies"});
}

void CheckDuplicates(const Dataset& d, std::vector<Finding>& findings) {
  const auto equal = [](std::string_view a, std::string_view b) { return a == b; };
  std::vector<char> explained(static_cast<size_t>(d.size()), 0);
  int n_copied = 0;
  const std::vector<CopiedStretch> copies = FindCopiedStretches(d);
  for (const CopiedStretch& copy : copies) {
    n_copied += copy.end - copy.begin;
    std::fill(explained.begin() + copy.begin, explained.begin() + copy.end, 1);
  }
  if (n_copied > 0) {
    findings.push_back(
        {.check = "duplicated_episodes",
         .severity = Severity::kWarning,
         .what = fmt::format("{} rows ({:.1f} %) repeat rows of an earlier episode, up to rounding", n_copied,
                             100.0 * n_copied / d.size()),
         .row = copies[0].begin,
         .count = n_copied,
         .meaning = "one recording given twice, exported twice, or cut in pieces that overlap; a copy tells nothing "
                    "new, so other commands leave these rows out",
         .remedy = "remove the copies"});
  }
  std::vector<int> rows = Repeats(
      d.size(),
      [&](int i) {
        const std::hash<std::string_view> hash;
        return 31 * hash(Bytes(d.observations.row(i))) + hash(Bytes(d.actions.row(i)));
      },
      [&](int a, int b) {
        return equal(Bytes(d.observations.row(a)), Bytes(d.observations.row(b))) &&
               equal(Bytes(d.actions.row(a)), Bytes(d.actions.row(b))) &&
               equal(Bytes(d.next_observations.row(a)), Bytes(d.next_observations.row(b)));
      });
  std::erase_if(rows, [&](int i) { return explained[static_cast<size_t>(i)] != 0 || Stands(d, i); });
  if (rows.empty()) return;
  const double share = static_cast<double>(rows.size()) / d.size();
  findings.push_back(
      {.check = "duplicated_rows",
       .severity = share > kDuplicateShare ? Severity::kWarning : Severity::kNote,
       .what = fmt::format("{} rows ({:.1f} %) repeat an earlier transition to the last bit", rows.size(), 100 * share),
       .row = rows[0],
       .count = static_cast<int64_t>(rows.size()),
       .meaning = "a log that was written twice weighs twice; coarse sensors of a slow robot show equal rows, too",
       .remedy = "remove what was written twice; leave what coarse sensors repeat"});
}

void CheckStanding(const Dataset& d, const std::vector<Episode>& episodes, std::vector<Finding>& findings) {
  const StandingRows standing = CountStandingRows(d, episodes);
  const int n = standing.n;
  if (n == 0) return;
  const double share = static_cast<double>(n) / d.size();
  const bool is_old = n - standing.n_at_rest > kStandingShare * d.size();
  findings.push_back(
      {.check = "standing_rows",
       .severity = is_old ? Severity::kWarning : Severity::kNote,
       .what = fmt::format("in {} rows ({:.1f} %) the next observation equals the observation to the last bit", n,
                           100 * share),
       .row = standing.first,
       .count = n,
       .meaning = is_old ? "the log is written faster than the sensors are read, or the robot was off: no simulator "
                           "stands still so exactly, and the gap is closed with wrong parameters"
                         : "the robot rests, or moves less than a step of its sensors",
       .remedy =
           is_old ? "log at the sensors' rate, or keep only rows in which a new reading arrived" : "none needed"});
}

/// Root mean square and 95 % quantile of each channel's change from s to s'.
struct Changes {
  std::vector<double> rms, q95;
};
Changes MeasureChanges(const Dataset& d) {
  Changes changes;
  std::vector<double> column(static_cast<size_t>(d.size()));
  for (int j = 0; j < d.obs_dim(); ++j) {
    double square = 0;
    for (int i = 0; i < d.size(); ++i) {
      column[static_cast<size_t>(i)] = std::abs(d.next_observations(i, j) - d.observations(i, j));
      square += column[static_cast<size_t>(i)] * column[static_cast<size_t>(i)] / d.size();
    }
    const auto at = column.begin() + static_cast<std::ptrdiff_t>(0.95 * (d.size() - 1));
    std::nth_element(column.begin(), at, column.end());
    changes.rms.push_back(std::sqrt(square));
    changes.q95.push_back(*at);
  }
  return changes;
}

/// s' of a row against s of the next, inside an episode.
void CheckNextObservations(const Dataset& d, const Changes& changes, std::vector<Finding>& findings) {
  int n_inside = 0, n = 0, n_jumps = 0, first = -1, first_jump = -1;
  for (int i = 0; i + 1 < d.size(); ++i) {
    if (d.terminals[static_cast<size_t>(i)] || d.timeouts[static_cast<size_t>(i)]) continue;
    ++n_inside;
    int n_large = 0, n_moving = 0;
    bool differs = false;
    for (int j = 0; j < d.obs_dim(); ++j) {
      const double scale = changes.rms[static_cast<size_t>(j)];
      const double gap = std::abs(d.next_observations(i, j) - d.observations(i + 1, j));
      differs = differs || gap > 1e-6 * std::abs(d.observations(i + 1, j)) + 1e-5 * scale;
      n_moving += scale > 0;
      n_large += scale > 0 && gap > kJump * scale;
    }
    if (differs && n++ == 0) first = i;
    if (2 * n_large > n_moving && n_jumps++ == 0) first_jump = i;
  }
  if (n == 0) return;
  const bool mostly = n > kInconsistentShare * n_inside;
  if (mostly) {
    findings.push_back(
        {.check = "inconsistent_next",
         .severity = Severity::kWarning,
         .what = fmt::format("in {} of {} rows inside episodes next_observations is not the next row's observations", n,
                             n_inside),
         .row = first,
         .count = n,
         .meaning = "s' and the following s were measured or rounded apart, or rows are missing or shuffled: replayed "
                    "windows do not follow the log",
         .remedy = "write each measured state once, in order; leave next_observations out and it is taken from the "
                   "next row"});
  }
  const int missed = mostly ? n_jumps : n;
  if (missed == 0) return;
  const int where = mostly ? first_jump : first;
  findings.push_back(
      {.check = "missed_boundary",
       .severity = Severity::kError,
       .what = fmt::format("after {} rows the next row starts elsewhere than next_observations says, and no terminal "
                           "or timeout marks an end there",
                           missed),
       .row = where,
       .count = missed,
       .meaning = "episodes run into each other: windows are replayed across the seam, and the design fits the jump",
       .remedy = "set timeouts to 1 in the last row of every episode that did not end in a terminal state"});
}

/// Whether a position moves by no more than its rate allows: a hit moves a joint that was at rest, and no reset did.
class ToldByRate {
 public:
  ToldByRate(const Dataset& d, const TaskFacts& facts)
      : d_(d),
        period_(facts.control_period_s > 0 ? facts.control_period_s : d.period_s),
        rate_of_position_(static_cast<size_t>(d.obs_dim()), -1) {
    for (int v = 0; v < std::min(d.obs_dim(), static_cast<int>(facts.rate_of.size())); ++v) {
      const int position = facts.rate_of[static_cast<size_t>(v)];
      if (position >= 0) rate_of_position_[static_cast<size_t>(position)] = v;
    }
  }

  bool operator()(int row, int channel) const {
    const int v = rate_of_position_[static_cast<size_t>(channel)];
    if (v < 0) return false;
    const double fastest = std::max(std::abs(d_.observations(row, v)), std::abs(d_.next_observations(row, v)));
    return std::abs(d_.next_observations(row, channel) - d_.observations(row, channel)) <=
           kFarthest * period_ * fastest;
  }

 private:
  const Dataset& d_;
  double period_;
  std::vector<int> rate_of_position_;
};

/// Rows that lead far away at once in most channels: what a missed boundary looks like when s' is the next row.
void CheckJumps(const Dataset& d, const TaskFacts& facts, const Changes& changes, std::vector<Finding>& findings) {
  if (d.size() < kRowsForJumps) return;
  const ToldByRate told_by_rate(d, facts);
  int n = 0, first = -1;
  bool any_timeout = false;
  for (int i = 0; i < d.size(); ++i) {
    int n_large = 0, n_moving = 0;
    for (int j = 0; j < d.obs_dim(); ++j) {
      const double q95 = changes.q95[static_cast<size_t>(j)];
      if (q95 <= 0) continue;
      ++n_moving;
      const double change = std::abs(d.next_observations(i, j) - d.observations(i, j));
      n_large += change > kJump * q95 && !told_by_rate(i, j);
    }
    any_timeout = any_timeout || d.timeouts[static_cast<size_t>(i)];
    if (2 * n_large > n_moving && n++ == 0) first = i;
  }
  if (n == 0) return;
  findings.push_back(
      {.check = "state_jumps",
       .severity = Severity::kWarning,
       .what = fmt::format("in {} rows more than half of the channels jump by over {} times their usual largest change "
                           "(95 % quantile){}",
                           n, kJump, any_timeout ? "" : "; no row is marked as a timeout"),
       .row = first,
       .count = n,
       .meaning =
           "resets that no terminal or timeout marks, or dropped samples, of which the design would fit the jump; or "
           "a few rows of a motion that is fast and real",
       .remedy =
           "look at these rows; mark the last one before a reset as a timeout, and give its own next_observations "
           "where known"});
}

void CheckEpisodes(const Dataset& d, const std::vector<Episode>& episodes, const TaskFacts& facts,
                   std::vector<Finding>& findings) {
  int n_long = 0, first_long = -1, n_short = 0, first_short = -1, n_continued = 0, first_continued = -1;
  for (const Episode& e : episodes) {
    if (facts.max_episode_steps > 0 && e.size() > facts.max_episode_steps && n_long++ == 0) first_long = e.begin;
    if (e.size() < 2 && n_short++ == 0) first_short = e.begin;
    const bool cut = !e.terminated && e.end < d.size();
    if (cut && Bytes(d.next_observations.row(e.end - 1)) == Bytes(d.observations.row(e.end)) && n_continued++ == 0) {
      first_continued = e.end - 1;
    }
  }
  if (n_long > 0) {
    findings.push_back({.check = "long_episodes",
                        .severity = Severity::kWarning,
                        .what = fmt::format("{} episodes are longer than the task's time limit of {} steps", n_long,
                                            facts.max_episode_steps),
                        .row = first_long,
                        .count = n_long,
                        .meaning = "a boundary is missing, or the target has another time limit or control rate",
                        .remedy = "check timeouts and the control period of the log"});
  }
  if (n_short > 0) {
    findings.push_back(
        {.check = "short_episodes",
         .severity = 2 * n_short > static_cast<int>(episodes.size()) ? Severity::kWarning : Severity::kNote,
         .what = fmt::format("{} of {} episodes have a single row", n_short, episodes.size()),
         .row = first_short,
         .count = n_short,
         .meaning = "nothing can be replayed from there on; many of them mean that a flag is set in every row or means "
                    "something else",
         .remedy = "check that terminals and timeouts are 1 in an episode's last row alone"});
  }
  if (n_continued > 0) {
    findings.push_back(
        {.check = "continued_episodes",
         .severity = Severity::kNote,
         .what = fmt::format("{} timeouts are followed by the same state: one recording, cut in pieces", n_continued),
         .row = first_continued,
         .count = n_continued,
         .meaning = "harmless: windows are not replayed across the cut",
         .remedy = "none needed; without these timeouts the recording is one episode"});
  }
  if (d.size() < kFewTransitions || episodes.size() < 2) {
    findings.push_back({.check = "little_data",
                        .severity = Severity::kNote,
                        .what = fmt::format("{} transitions in {} episodes", d.size(), episodes.size()),
                        .row = -1,
                        .count = d.size(),
                        .meaning = "scores are measured on held-out halves (of episodes, where there are two): the "
                                   "less there is, the less they mean",
                        .remedy = "log a few episodes more, from different starts"});
  }
}

}  // namespace

void CheckRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (!facts.flat_observations || !facts.continuous_actions) CheckEqualEpisodes(dataset, episodes, findings);
  if (facts.flat_observations && facts.continuous_actions) {
    CheckDuplicates(dataset, findings);
    const Changes changes = MeasureChanges(dataset);
    CheckStanding(dataset, episodes, findings);
    CheckNextObservations(dataset, changes, findings);
    CheckJumps(dataset, facts, changes, findings);
  }
  CheckEpisodes(dataset, episodes, facts, findings);
}

}  // namespace oted
