#include "oted/data/copied_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "oted/base/statistics.h"

namespace oted {
namespace {

constexpr double kShareOfNoise = 0.05;
constexpr double kRounding = 2e-7;  // of a channel's largest value: single precision
constexpr int kRowsOfCopy = 20, kRowsOfWhole = 5, kMovingRows = 10;
constexpr int kStride = 10;            // between rows that are looked up: a stretch of kRowsOfCopy holds one
constexpr size_t kMostKeys = 3;        // channels by which rows are found
constexpr size_t kMostLookedAt = 500;  // rows of one key: coarse sensors show the same many times

/// How far two readings of each channel may be apart and still be one: its noise from row to row is told by third
/// differences, which leave nothing of a smooth motion.
std::vector<double> Tolerances(const Array2<double>& m, const std::vector<Episode>& episodes) {
  std::vector<double> tolerances;
  for (int j = 0; j < m.cols(); ++j) {
    std::vector<double> thirds;
    double largest = 0;
    for (const Episode& e : episodes) {
      for (int i = e.begin; i < e.end; ++i) {
        largest = std::max(largest, std::abs(m(i, j)));
        if (i < e.begin + 3) continue;
        thirds.push_back(std::abs(m(i, j) - 3 * m(i - 1, j) + 3 * m(i - 2, j) - m(i - 3, j)));
      }
    }
    const double noise = 1.4826 * Median(std::move(thirds)) / std::sqrt(20.0);  // 1 + 9 + 9 + 1
    tolerances.push_back(std::max(kShareOfNoise * noise, kRounding * largest));
  }
  return tolerances;
}

class CopyFinder {
 public:
  explicit CopyFinder(const Dataset& dataset)
      : d_(dataset),
        episodes_(dataset.Episodes()),
        of_observations_(Tolerances(dataset.observations, episodes_)),
        of_actions_(Tolerances(dataset.actions, episodes_)),
        episode_of_(static_cast<size_t>(dataset.size())) {
    for (size_t e = 0; e < episodes_.size(); ++e) {
      std::fill(episode_of_.begin() + episodes_[e].begin, episode_of_.begin() + episodes_[e].end, e);
    }
    ChooseKeys();
  }

  std::vector<CopiedStretch> Find() {
    std::vector<CopiedStretch> found;
    for (const Episode& episode : episodes_) {
      for (int i = episode.begin, from = i; i < episode.end;) {
        const CopiedStretch longest = LongestAt(i, from, episode);
        if (!Counts(longest, episode)) {
          i += kStride;
          continue;
        }
        found.push_back(longest);
        i = from = longest.end;
      }
      for (int i = episode.begin; i < episode.end; ++i) rows_of_[KeyOf(i)].push_back(i);
    }
    return found;
  }

 private:
  using Cell = std::array<int64_t, kMostKeys>;
  struct HashOfCell {
    size_t operator()(const Cell& cell) const {
      uint64_t hash = 0;
      for (const int64_t part : cell) hash = (hash ^ static_cast<uint64_t>(part)) * 0x9E3779B97F4A7C15ULL;
      return static_cast<size_t>(hash ^ (hash >> 32));
    }
  };

  /// The observations that tell rows apart best: of the largest spread beside what is one reading.
  void ChooseKeys() {
    std::vector<double> levels;
    for (int j = 0; j < d_.obs_dim(); ++j) {
      double low = d_.observations(0, j), high = low;
      for (int i = 1; i < d_.size(); ++i) {
        low = std::min(low, d_.observations(i, j));
        high = std::max(high, d_.observations(i, j));
      }
      const double tolerance = of_observations_[static_cast<size_t>(j)];
      levels.push_back(tolerance > 0 ? (high - low) / tolerance : 0);
    }
    keys_.resize(levels.size());
    std::iota(keys_.begin(), keys_.end(), 0);
    std::ranges::stable_sort(
        keys_, [&](int a, int b) { return levels[static_cast<size_t>(a)] > levels[static_cast<size_t>(b)]; });
    keys_.resize(std::min(keys_.size(), kMostKeys));
  }

  /// Cells are two tolerances wide: what may be one reading is in the same or in the next.
  Cell KeyOf(int row) const {
    Cell cell{};
    for (size_t k = 0; k < keys_.size(); ++k) {
      const double width = 2 * of_observations_[static_cast<size_t>(keys_[k])];
      cell[k] = width > 0 ? static_cast<int64_t>(std::floor(d_.observations(row, keys_[k]) / width)) : 0;
    }
    return cell;
  }

  static bool Near(std::span<const double> a, std::span<const double> b, const std::vector<double>& tolerances) {
    for (size_t j = 0; j < a.size(); ++j) {
      if (std::abs(a[j] - b[j]) > tolerances[j]) return false;
    }
    return true;
  }

  bool Same(int a, int b) const {
    if (!Near(d_.observations.row(a), d_.observations.row(b), of_observations_)) return false;
    if (!Near(d_.actions.row(a), d_.actions.row(b), of_actions_)) return false;
    // Of another recording's constants: another robot.
    return d_.constants.empty() || std::ranges::equal(d_.constants.row(a), d_.constants.row(b), [](double x, double y) {
             return x == y || (std::isnan(x) && std::isnan(y));
           });
  }

  bool Moves(int row) const {
    const int begin = episodes_[episode_of_[static_cast<size_t>(row)]].begin;
    return row > begin && !Near(d_.observations.row(row), d_.observations.row(row - 1), of_observations_);
  }

  bool Counts(const CopiedStretch& stretch, const Episode& episode) const {
    const int size = stretch.end - stretch.begin;
    if (size < std::clamp(episode.size(), kRowsOfWhole, kRowsOfCopy)) return false;
    int n_moving = 0;
    for (int i = stretch.begin; i < stretch.end; ++i) n_moving += Moves(i);
    return n_moving >= std::min(kMovingRows, size / 2);
  }

  /// Of the stretches that hold `row` and begin at `from` or later.
  CopiedStretch LongestAt(int row, int from, const Episode& episode) const {
    CopiedStretch longest{row, row, row};
    if (episode.size() > kRowsOfCopy && !Moves(row)) return longest;
    const Cell here = KeyOf(row);
    const int n_cells = static_cast<int>(std::pow(3, keys_.size()));
    for (int n = 0; n < n_cells; ++n) {
      Cell cell = here;
      for (int k = 0, left = n; k < static_cast<int>(keys_.size()); ++k, left /= 3)
        cell[static_cast<size_t>(k)] += left % 3 - 1;
      const auto rows = rows_of_.find(cell);
      if (rows == rows_of_.end()) continue;
      for (size_t k = 0; k < std::min(kMostLookedAt, rows->second.size()); ++k) {
        const int other = rows->second[k];
        if (!Same(row, other)) continue;
        const Episode& source = episodes_[episode_of_[static_cast<size_t>(other)]];
        CopiedStretch stretch{row, row + 1, other};
        while (stretch.begin > from && stretch.original > source.begin &&
               Same(stretch.begin - 1, stretch.original - 1)) {
          --stretch.begin;
          --stretch.original;
        }
        for (int at = other + 1; stretch.end < episode.end && at < source.end && Same(stretch.end, at); ++at) {
          ++stretch.end;
        }
        if (stretch.end - stretch.begin > longest.end - longest.begin) longest = stretch;
      }
    }
    return longest;
  }

  const Dataset& d_;
  std::vector<Episode> episodes_;
  std::vector<double> of_observations_, of_actions_;
  std::vector<size_t> episode_of_;
  std::vector<int> keys_;
  std::unordered_map<Cell, std::vector<int>, HashOfCell> rows_of_;  // of the episodes before the present one
};

}  // namespace

std::vector<CopiedStretch> FindCopiedStretches(const Dataset& dataset) { return CopyFinder(dataset).Find(); }

Dataset WithoutCopies(Dataset dataset) {
  const std::vector<CopiedStretch> copies = FindCopiedStretches(dataset);
  if (copies.empty()) return dataset;
  std::vector<Episode> left;
  int n_gone = 0;
  auto copy = copies.begin();
  for (const Episode& episode : dataset.Episodes()) {
    int begin = episode.begin;
    const auto keep = [&](int end, bool terminated) {
      if (end - begin > 1 || (end - begin == 1 && episode.size() == 1)) left.push_back({begin, end, terminated});
    };
    for (; copy != copies.end() && copy->begin < episode.end; ++copy) {
      keep(copy->begin, false);
      n_gone += copy->end - copy->begin;
      begin = copy->end;
    }
    keep(episode.end, episode.terminated);
  }
  const int n = dataset.size();
  dataset = dataset.Select(left);
  dataset.warnings.push_back(fmt::format(
      "{} of {} rows ({:.1f} %) repeat rows of an earlier recording, up to rounding, the first in row {} that "
      "of row {}: they are left out, as a copy tells nothing new",
      n_gone, n, 100.0 * n_gone / n, copies.front().begin, copies.front().original));
  return dataset;
}

}  // namespace oted
