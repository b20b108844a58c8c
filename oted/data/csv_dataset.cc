#include "oted/data/csv_dataset.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <span>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/csv.h"
#include "oted/data/csv_columns.h"
#include "oted/data/field_text.h"
#include "oted/data/gzip.h"
#include "oted/data/loggable.h"
#include "oted/data/resample.h"
#include "oted/data/time_column.h"

namespace oted {
namespace {

constexpr size_t kShownUnused = 20;

/// The rows of a file and what cuts them into episodes.
class CsvReader {
 public:
  CsvReader(const std::string& path, const DataOptions& options) : path_(path), options_(options) {
    recording_.file = path;
  }

  Recording Read() {
    std::string text = ReadFile(path_);
    if (IsGzip(text)) text = Gunzip(text, path_);
    CsvParser parser(text, path_);
    if (!parser.Next(header_)) {
      throw DataError(fmt::format("'{}' is empty, wanted a header and one row per control step", path_));
    }
    for (std::string& name : header_) {
      name = std::string(Trimmed(name));
      if (!IsUtf8(name))
        throw DataError(fmt::format("'{}' line 1: a column's name is not UTF-8; save it as UTF-8", path_));
    }
    columns_ = FindColumns(header_, options_, path_);
    if (columns_.time >= 0) units_per_second_ = UnitsPerSecond(header_[static_cast<size_t>(columns_.time)]);
    recording_.observation_names = columns_.observation_names;
    recording_.action_names = columns_.action_names;
    if (!columns_.constants.empty()) recording_.constant_names = options_.constant_names;
    if (!columns_.unused.empty()) {
      const size_t n = std::min(columns_.unused.size(), kShownUnused);
      const std::span<const std::string> shown(columns_.unused.data(), n);
      recording_.remarks.push_back(
          fmt::format("columns not used: {}{}", fmt::join(shown, ", "),
                      n < columns_.unused.size() ? fmt::format(" and {} more", columns_.unused.size() - n) : ""));
    }
    std::vector<std::string> fields;
    while (parser.Next(fields)) AddRow(fields, parser.line());
    if (rows() == 0) throw DataError(fmt::format("'{}' has a header and no rows; record at least one episode", path_));
    CheckTwice();
    MeasurePeriod();
    CutEpisodes();
    return std::move(recording_);
  }

 private:
  int rows() const { return recording_.observations.rows(); }

  [[noreturn]] void Fail(int row, const std::string& what, const char* remedy) const {
    throw DataError(fmt::format("'{}' line {}: {}; {}", path_, lines_[static_cast<size_t>(row)], what, remedy));
  }

  double Number(const std::vector<std::string>& fields, int column) const {
    const std::optional<double> value = ParseNumber(fields[static_cast<size_t>(column)]);
    if (!value.has_value() || !IsLoggable(*value)) {
      throw DataError(fmt::format(
          "'{}' line {}, column '{}': '{}' is no finite number below 1e20; repair or remove the row", path_,
          lines_.back(), header_[static_cast<size_t>(column)], fields[static_cast<size_t>(column)].substr(0, 40)));
    }
    return *value;
  }

  /// [s].
  double Time(const std::vector<std::string>& fields) const {
    return Number(fields, columns_.time) / units_per_second_;
  }

  bool Flag(const std::vector<std::string>& fields, int column) const {
    const std::string_view text = Trimmed(fields[static_cast<size_t>(column)]);
    for (const char* no : {"", "0", "0.0", "false", "False", "FALSE"}) {
      if (text == no) return false;
    }
    for (const char* yes : {"1", "1.0", "true", "True", "TRUE"}) {
      if (text == yes) return true;
    }
    throw DataError(fmt::format("'{}' line {}, column '{}': '{}' is no flag, wanted 0, 1, true or false; repair it",
                                path_, lines_.back(), header_[static_cast<size_t>(column)], text.substr(0, 40)));
  }

  /// Whether a row says nothing but once more what the last one said of its moment.
  bool IsTwice(const std::vector<std::string>& fields) const {
    if (columns_.time < 0 || rows() == 0) return false;
    if (columns_.episode >= 0 && fields[static_cast<size_t>(columns_.episode)] != episodes_.back()) return false;
    const bool ends = (columns_.terminal >= 0 && Flag(fields, columns_.terminal)) ||
                      (columns_.timeout >= 0 && Flag(fields, columns_.timeout));
    const auto is_empty = [&](int column) { return Trimmed(fields[static_cast<size_t>(column)]).empty(); };
    return !ends && !std::ranges::all_of(columns_.actions, is_empty) && Time(fields) == recording_.times.back();
  }

  void CheckTwice() {
    if (n_twice_ == 0) return;
    if (n_twice_ > kMostTwice * (rows() + n_twice_)) {
      throw DataError(
          fmt::format("'{}' line {}: time {} stands there twice, as do those of {} of {} rows; remove one of "
                      "each, or repair the clock",
                      path_, first_twice_, time_of_first_twice_, n_twice_, rows() + n_twice_));
    }
    recording_.warnings.push_back(fmt::format(
        "{} rows whose time stood there already were left out, the first in line {}", n_twice_, first_twice_));
  }

  void AddRow(const std::vector<std::string>& fields, int64_t line) {
    lines_.push_back(line);
    if (fields.size() != header_.size()) {
      throw DataError(fmt::format("'{}' line {}: {} fields, but the header has {}; repair or remove the row", path_,
                                  line, fields.size(), header_.size()));
    }
    if (IsTwice(fields)) {
      lines_.pop_back();
      if (n_twice_++ == 0) {
        first_twice_ = line;
        time_of_first_twice_ = recording_.times.back();
      }
      return;
    }
    if (rows() == std::numeric_limits<int>::max()) throw DataError(fmt::format("'{}' has too many rows", path_));
    const auto is_empty = [&](int column) { return Trimmed(fields[static_cast<size_t>(column)]).empty(); };
    const auto append = [&](const std::vector<int>& columns, Array2<double>& to) {
      if (columns.empty()) return;
      row_.clear();
      for (const int column : columns) row_.push_back(Number(fields, column));
      to.AppendRow(row_);
    };
    append(columns_.observations, recording_.observations);
    const bool has_action = !std::ranges::all_of(columns_.actions, is_empty);
    has_action_.push_back(has_action);
    recording_.n_without_action += has_action ? 0 : 1;
    if (has_action) {
      append(columns_.actions, recording_.actions);
    } else {
      recording_.actions.AppendRow(std::vector<double>(columns_.actions.size(), 0.0));
    }
    const auto append_state = [&](const std::vector<int>& columns, Array2<double>& to) {
      if (has_action || !std::ranges::all_of(columns, is_empty)) {
        append(columns, to);
      } else if (!columns.empty()) {
        to.AppendRow(std::vector<double>(columns.size(), 0.0));
      }
    };
    append_state(columns_.qpos, recording_.qpos);
    append_state(columns_.qvel, recording_.qvel);
    AddConstants(fields);
    if (columns_.time >= 0) recording_.times.push_back(Time(fields));
    if (columns_.reward >= 0) {
      recording_.rewards.push_back(!has_action && is_empty(columns_.reward) ? 0 : Number(fields, columns_.reward));
    }
    terminals_.push_back(columns_.terminal >= 0 && Flag(fields, columns_.terminal));
    timeouts_.push_back(columns_.timeout >= 0 && Flag(fields, columns_.timeout));
    if (columns_.episode >= 0) episodes_.push_back(fields[static_cast<size_t>(columns_.episode)]);
  }

  /// An empty field says that the recording is as the model.
  void AddConstants(const std::vector<std::string>& fields) {
    if (columns_.constants.empty()) return;
    row_.clear();
    for (const int column : columns_.constants) {
      const bool is_given = column >= 0 && !Trimmed(fields[static_cast<size_t>(column)]).empty();
      row_.push_back(is_given ? Number(fields, column) : std::numeric_limits<double>::quiet_NaN());
    }
    recording_.constants.AppendRow(row_);
  }

  /// What is known of a recording holds for all of its episode; the last row, without an action, need not say it.
  void CheckConstants(int begin, int end) const {
    for (int row = begin + 1; row + 1 < end && !recording_.constants.empty(); ++row) {
      for (int k = 0; k < recording_.constants.cols(); ++k) {
        const double first = recording_.constants(begin, k), here = recording_.constants(row, k);
        if (here == first || (std::isnan(here) && std::isnan(first))) continue;
        Fail(row,
             fmt::format("constant '{}' changes from {} to {} within an episode", options_.constant_names[k], first,
                         here),
             "give what follows another episode number");
      }
    }
  }

  bool SameEpisodeNumber(int row) const {
    return columns_.episode < 0 || episodes_[static_cast<size_t>(row)] == episodes_[static_cast<size_t>(row) - 1];
  }

  /// Of the rows [begin, end). What runs backwards or lies in another episode does not count.
  double TypicalStep(int begin, int end) const {
    std::vector<double> steps;
    for (int i = begin + 1; i < end; ++i) {
      const double step = recording_.times[i] - recording_.times[i - 1];
      if (step > 0 && SameEpisodeNumber(i)) steps.push_back(step);
    }
    return oted::TypicalStep(std::move(steps));
  }

  void MeasurePeriod() {
    if (recording_.times.empty()) return;
    recording_.period_s = TypicalStep(0, rows());
    resolution_ = ResolutionOf(recording_.times);
  }

  /// Whether row i begins a new episode after row i - 1.
  bool Begins(int i) {
    if (!SameEpisodeNumber(i)) return true;
    const bool ended = terminals_[i - 1] || timeouts_[i - 1];
    // The row after the last action may hold the final observation.
    const bool is_final = !has_action_[i] && has_action_[i - 1];
    const bool ends = !has_action_[i - 1] || (ended && !is_final);
    if (ends && columns_.episode >= 0) {
      Fail(i,
           fmt::format("episode {} goes on after {}", episodes_[i],
                       has_action_[i - 1] ? "its terminal or timeout" : "a row without actions"),
           "give what follows another episode number");
    }
    if (ends) return true;
    if (recording_.times.empty()) return false;
    const double step = recording_.times[i] - recording_.times[i - 1];
    if (step > 0) return false;  // gaps are looked for when the episode's own rate is known
    if (step == 0) Fail(i, fmt::format("time {} stands there twice", recording_.times[i]), "remove one of the rows");
    if (columns_.episode >= 0) {
      Fail(i,
           fmt::format("time goes back from {} to {} s within episode {}", recording_.times[i - 1], recording_.times[i],
                       episodes_[i]),
           "repair the time that is wrong; or give what follows another episode number");
    }
    if (n_jumps_++ == 0) first_jump_ = i;
    return true;
  }

  void CutEpisodes() {
    int begin = 0;
    std::set<std::string> seen;
    for (int i = 1; i <= rows(); ++i) {
      if (i < rows() && !Begins(i)) continue;
      if (columns_.episode >= 0 && !seen.insert(episodes_[begin]).second) {
        Fail(begin, fmt::format("episode {} begins a second time", episodes_[begin]),
             "sort the rows by episode, or number the episodes anew");
      }
      AddBetweenGaps(begin, i);
      begin = i;
    }
    if (recording_.runs.empty() && n_jumps_ > 0) {
      Fail(first_jump_,
           fmt::format("time goes back from {} to {} s, and so often that no two rows follow one another",
                       recording_.times[first_jump_ - 1], recording_.times[first_jump_]),
           "sort the rows by time");
    }
    if (const double period = PeriodOfRuns(recording_); period > 0) recording_.period_s = period;
    if (n_jumps_ > 0) recording_.warnings.push_back(fmt::format("{} episodes begin where time starts again", n_jumps_));
    if (n_gaps_ > 0) {
      recording_.warnings.push_back(fmt::format("{} gaps of more than {} missing rows cut an episode in two", n_gaps_,
                                                static_cast<int>(kMostGap) - 1));
    }
    if (n_dropped_ > 0) {
      recording_.remarks.push_back(fmt::format(
          "the last row of {} episodes was dropped with its action: no next row tells where it led", n_dropped_));
    }
    if (n_single_ > 0) recording_.remarks.push_back(fmt::format("{} episodes of one row left out", n_single_));
    if (n_lost_ends_ > 0) {
      recording_.warnings.push_back(fmt::format(
          "{} dropped rows were terminal: their episodes count as cut; to keep a terminal state, log it in one "
          "more row without actions",
          n_lost_ends_));
    }
  }

  /// The rows of one episode, cut where too many are missing.
  void AddBetweenGaps(int begin, int end) {
    if (recording_.times.empty()) return AddRun(begin, end, 0);
    const double own = TypicalStep(begin, end), period = own > 0 ? own : recording_.period_s;
    for (int i = begin + 1; i < end; ++i) {
      if (recording_.times[i] - recording_.times[i - 1] <= kMostGap * period) continue;
      AddRun(begin, i, period);
      begin = i;
      ++n_gaps_;
    }
    AddRun(begin, end, period);
  }

  /// @param period  roughly, [s]; 0 without times
  void AddRun(int begin, int end, double period) {
    const int last = end - 1;
    bool terminated = false;
    if (has_action_[last]) {
      ++n_dropped_;
      n_lost_ends_ += terminals_[last];
    } else {
      // The flag stands with the action that ended the episode, or with the state that it led to.
      terminated = terminals_[last] || (last > begin && terminals_[last - 1]);
    }
    n_single_ += end - begin == 1;
    if (end - begin < 2) return;
    CheckConstants(begin, end);
    recording_.runs.push_back({begin, end, terminated});
    if (period > 0) MeasureRun(recording_.times, period, resolution_, recording_.runs.back());
  }

  const std::string& path_;
  const DataOptions& options_;
  std::vector<std::string> header_;
  CsvColumns columns_;
  double units_per_second_ = 1;  // of the times
  Recording recording_;
  std::vector<int64_t> lines_;
  std::vector<std::string> episodes_;
  std::vector<uint8_t> terminals_;
  std::vector<uint8_t> timeouts_;
  std::vector<uint8_t> has_action_;
  std::vector<double> row_;
  double resolution_ = 0;  // of the times
  int n_gaps_ = 0;
  int n_jumps_ = 0;
  int first_jump_ = 0;  // row
  int n_twice_ = 0;
  int64_t first_twice_ = 0;
  double time_of_first_twice_ = 0;
  int n_dropped_ = 0;
  int n_lost_ends_ = 0;
  int n_single_ = 0;
};

}  // namespace

Recording ReadCsv(const std::string& path, const DataOptions& options) { return CsvReader(path, options).Read(); }

}  // namespace oted
