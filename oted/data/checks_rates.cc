#include "oted/data/checks_rates.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "oted/base/angle.h"
#include "oted/base/statistics.h"
#include "oted/data/channel_series.h"
#include "oted/data/checks_missing.h"
#include "oted/data/stretch_period.h"

namespace oted {
namespace {

constexpr double kImpossiblePerRow = 1000;             // [rad], [m]
constexpr double kMostPerRow = 1.0;                    // [rad]
constexpr double kVague = 0.6;                         // below it is not
constexpr double kExactlyClear = 0.95, kFactor = 1.5;  // the same for a factor that no unit explains
constexpr size_t kMostEpisodes = 50;                   // that are looked at one by one
constexpr double kOtherRate = 1.4;                     // of the usual period
constexpr double kAgree = 0.05;                        // among the channels of a log with another rate
constexpr double kExactPeriod = 0.02;                  // of the period: so far off it bends parameters
constexpr double kFewestCarry = 20;                    // rows that must carry a correlation or factor for a finding

/// How far a channel moves from row to row.
struct RowSteps {
  int64_t count = 0;
  double typical = 0;  ///< median size; 0 without any

  explicit RowSteps(const std::vector<std::vector<double>>& recordings) {
    std::vector<double> sizes;
    for (const std::vector<double>& series : recordings) {
      for (size_t i = 1; i < series.size(); ++i) sizes.push_back(std::abs(series[i] - series[i - 1]));
    }
    count = static_cast<int64_t>(sizes.size());
    if (count > 0) typical = Median(sizes);
  }
};

/// What else positions are logged in.
struct Unit {
  const char* name;
  const char* of_rate;
  double size;
};
constexpr Unit kUnits[] = {{"degrees", "degrees per second", kDegree},
                           {"thousandths (millimetres)", "thousandths (millimetres per second)", 1e-3}};

/// The unit in which a position is `factor` times as large as in the task's; null: none.
const Unit* UnitOf(double factor) {
  const auto unit = std::ranges::find_if(kUnits, [&](const Unit& u) { return Near(factor, 1 / u.size, kUnitSlack); });
  return unit == std::end(kUnits) ? nullptr : unit;
}

class Rates {
 public:
  Rates(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings)
      : dataset_(dataset),
        facts_(facts),
        findings_(findings),
        period_(facts.control_period_s > 0 ? facts.control_period_s : dataset.period_s),
        rates_(CompareRates(dataset, facts.rate_of, period_)) {}

  void Check(const std::vector<int>& elsewhere) {
    std::erase_if(rates_,
                  [&](const RateAgreement& r) { return std::ranges::find(elsewhere, r.velocity) != elsewhere.end(); });
    std::erase_if(rates_, [](const RateAgreement& r) { return r.support < kFewestCarry; });
    AddOwnSwaps();
    AddSwaps();
    if (!AddOtherRates() && !AddControlRate()) {
      AddOfEpisodes();
      for (const RateAgreement& rate : rates_) AddFactor(rate);
      AddPeriod();
    }
    AddLags();
    AddOffsets();
  }

 private:
  std::string Position(const RateAgreement& rate) const { return facts_.ObservationName(rate.position); }
  std::string Velocity(const RateAgreement& rate) const { return facts_.ObservationName(rate.velocity); }

  Finding& Add(const char* check, std::string what, std::vector<std::string> channels, std::string meaning,
               std::string remedy) {
    findings_.push_back({.check = check,
                         .severity = Severity::kWarning,
                         .what = std::move(what),
                         .count = static_cast<int64_t>(channels.size()),
                         .channels = std::move(channels),
                         .meaning = std::move(meaning),
                         .remedy = std::move(remedy)});
    return findings_.back();
  }

  void Forget(const std::vector<int>& velocities) {
    std::erase_if(
        rates_, [&](const RateAgreement& r) { return std::ranges::find(velocities, r.velocity) != velocities.end(); });
  }

  /// Positions that are the rates of what stands as their velocities.
  void AddOwnSwaps() {
    std::vector<int> swapped;
    for (const RateAgreement& rate : rates_) {
      if (period_ <= 0 || Near(rate.slope, period_, kUnitSlack)) continue;
      const RateAgreement back = CompareRate(dataset_, rate.velocity, rate.position, period_);
      if (back.correlation < kClearCorrelation || !Near(back.slope, period_, kUnitSlack)) continue;
      swapped.push_back(rate.velocity);
      Add("swapped_columns", fmt::format("{} is the rate of {}", Position(rate), Velocity(rate)),
          {Position(rate), Velocity(rate)}, "two columns stand in each other's place",
          fmt::format("swap {} and {}", Position(rate), Velocity(rate)));
    }
    Forget(swapped);
  }

  /// Velocities that go with the position of another joint.
  void AddSwaps() {
    std::vector<RateAgreement> left;
    std::vector<const RateAgreement*> lost;
    for (const RateAgreement& rate : rates_) {
      if (std::abs(rate.correlation) < kVague) lost.push_back(&rate);
    }
    std::vector<int> swapped;
    for (const RateAgreement* a : lost) {
      for (const RateAgreement* b : lost) {
        if (a->velocity >= b->velocity) continue;
        const RateAgreement ab = CompareRate(dataset_, a->position, b->velocity, period_);
        const RateAgreement ba = CompareRate(dataset_, b->position, a->velocity, period_);
        if (std::abs(ab.correlation) < kClearCorrelation || std::abs(ba.correlation) < kClearCorrelation) continue;
        swapped.insert(swapped.end(), {a->velocity, b->velocity});
        Add("swapped_columns",
            fmt::format("{} is the rate of {}, and {} that of {}", Velocity(*b), Position(*a), Velocity(*a),
                        Position(*b)),
            {Position(*a), Position(*b), Velocity(*a), Velocity(*b)}, "two columns stand in each other's place",
            fmt::format("swap {} and {}, or {} and {}", Position(*a), Position(*b), Velocity(*a), Velocity(*b)));
      }
    }
    Forget(swapped);
  }

  /// The same of each episode alone; none where there are too many, or one.
  const std::vector<std::vector<RateAgreement>>& OfEpisodes() {
    const std::vector<Episode> episodes = dataset_.Episodes();
    if (!of_episodes_.empty() || episodes.size() < 2 || episodes.size() > kMostEpisodes) return of_episodes_;
    for (const Episode& episode : episodes) {
      of_episodes_.push_back(CompareRates(dataset_.Select({episode}), facts_.rate_of, period_));
      std::erase_if(of_episodes_.back(), [](const RateAgreement& r) { return r.support < kFewestCarry; });
    }
    return of_episodes_;
  }

  /// By which factor a position changes faster than its velocity says in each episode; 0 where one does not tell.
  std::vector<double> FactorsOf(int velocity) {
    std::vector<double> factors;
    for (const std::vector<RateAgreement>& rates : OfEpisodes()) {
      const auto rate = std::ranges::find(rates, velocity, &RateAgreement::velocity);
      const bool tells = rate != rates.end() && std::abs(rate->correlation) >= kClearCorrelation;
      factors.push_back(tells ? rate->slope / period_ : 0);
    }
    return factors;
  }

  /// Joints of which most episodes have position and velocity as they belong together, and others in another sign or
  /// unit. What is told of all rows together mixes them.
  void AddOfEpisodes() {
    if (period_ <= 0) return;
    std::vector<int> told;
    for (const RateAgreement& rate : rates_) {
      const std::vector<double> factors = FactorsOf(rate.velocity);
      std::vector<std::string> turned, other;
      size_t n_right = 0;
      double factor = 0;
      for (size_t e = 0; e < factors.size(); ++e) {
        if (Near(factors[e], 1, kUnitSlack)) ++n_right;
        if (Near(factors[e], -1, kUnitSlack)) turned.push_back(fmt::format("{}", e + 1));
        if (factors[e] == 0 || std::max(std::abs(factors[e]), 1 / std::abs(factors[e])) < kFactor) continue;
        other.push_back(fmt::format("{}", e + 1));
        factor = factors[e];
      }
      if (n_right <= turned.size() + other.size() || turned.size() + other.size() == 0) continue;
      const std::string position = Position(rate), velocity = Velocity(rate);
      if (!turned.empty()) {
        Add("rate_sign",
            fmt::format("in episode {} {} and {} have opposite signs, in the others they have not",
                        fmt::join(turned, ", "), position, velocity),
            {position, velocity}, "one of the two has the other sign in that recording",
            "turn it round in that recording's file: data.scale acts on all of them");
      }
      if (!other.empty()) {
        Add("rate_unit",
            fmt::format("in episode {} {} changes {:.3g} times as fast as {} says, in the others as fast",
                        fmt::join(other, ", "), position, factor, velocity),
            {position, velocity}, "that recording has another unit or another control rate",
            "bring it to the unit and the rate of the others");
      }
      told.push_back(rate.velocity);
    }
    Forget(told);
  }

  /// Episodes whose rows are further apart, or closer, than those of the rest: one rate for all is true of none.
  bool AddOtherRates() {
    if (rates_.size() < 2) return false;
    const std::vector<Episode> episodes = dataset_.Episodes();
    std::vector<double> periods;  // [s], 0 where an episode does not tell
    for (const std::vector<RateAgreement>& rates : OfEpisodes()) periods.push_back(PeriodByRates(rates));
    std::vector<double> told = periods;
    std::erase(told, 0.0);
    if (told.size() < 2) return false;
    const double usual = Median(told);
    std::vector<double> others;
    std::vector<std::string> numbers;
    int first = -1;
    for (size_t e = 0; e < periods.size(); ++e) {
      if (periods[e] <= 0 || std::max(periods[e] / usual, usual / periods[e]) < kOtherRate) continue;
      numbers.push_back(fmt::format("{}", e + 1));
      others.push_back(periods[e]);
      if (first < 0) first = episodes[e].begin;
    }
    if (numbers.empty()) return false;
    const auto [least, most] = std::ranges::minmax(others);
    const std::string apart = most < kOtherRate * least ? fmt::format("{:.2g}", Median(others))
                                                        : fmt::format("{:.2g} to {:.2g}", least, most);
    Add("control_rate",
        fmt::format("by positions and velocities the rows of episode {} are {} s apart, those of the others {:.2g} s",
                    fmt::join(numbers, ", "), apart, usual),
        {}, "recordings of several rates stand as one, and a design would take their rows for equally far apart",
        fmt::format("bring episode {} to the rate of the others: with a time column that is done for you",
                    fmt::join(numbers, ", ")));
    findings_.back().row = first;
    findings_.back().count = static_cast<int64_t>(numbers.size());
    return true;
  }

  /// All channels off by one factor: the rows are not as far apart as was said.
  bool AddControlRate() {
    if (period_ <= 0 || rates_.size() < 2) return false;
    const double seconds = PeriodByRates(rates_);
    if (seconds <= 0 || Near(seconds, period_, kUnitSlack)) return false;
    if (UnitOf(seconds / period_) != nullptr || UnitOf(period_ / seconds) != nullptr) return false;
    const auto agrees = [&](const RateAgreement& r) {
      if (r.correlation < kClearCorrelation) return true;
      const double spread =
          std::sqrt((1 / (r.correlation * r.correlation) - 1) / r.support);  // of the slope, as a share
      return Near(r.slope, seconds, std::max(2 * kAgree, 2 * spread));
    };
    if (!std::ranges::all_of(rates_, agrees)) return false;
    Add("control_rate",
        fmt::format("by positions and velocities the rows are {:.2g} s apart, not {:.3g} s", seconds, period_), {},
        "the log has another rate than the task",
        "set the control period to the log's, or bring the log to the task's");
    return true;
  }

  /// All channels off by the same few percent. Over lost rows positions move farther as well.
  void AddPeriod() {
    if (period_ <= 0 || std::ranges::find(findings_, kMissingRows, &Finding::check) != findings_.end()) return;
    std::vector<int> velocities;
    for (const RateAgreement& rate : rates_) velocities.push_back(rate.velocity);
    const std::optional<double> seconds = PeriodByStretches(dataset_, facts_.rate_of, velocities);
    if (!seconds || Near(*seconds, period_, kExactPeriod) || !Near(*seconds, period_, kUnitSlack)) return;
    Add("control_period",
        fmt::format("over many rows positions move as if these were {:.4g} s apart, not {:.4g} s", *seconds, period_),
        {}, "masses, friction and gains take up a period that is a few percent off",
        fmt::format("set the control period to {:.4g} s where that is the log's, or give the log its column of times; "
                    "where all velocities are in another unit, correct these",
                    *seconds));
  }

  void AddFactor(const RateAgreement& rate) {
    if (period_ <= 0 || std::abs(rate.correlation) < kClearCorrelation) return;
    const double factor = rate.slope / period_;
    if (Near(factor, 1, kUnitSlack)) return;
    const std::string position = Position(rate), velocity = Velocity(rate);
    const std::string what = fmt::format("{} changes {:.3g} times as fast as {} says", position, factor, velocity);
    const bool turned = factor < 0;
    const double size = std::abs(factor);
    const std::string sign = turned ? " and turn its sign round" : "";
    if (Near(size, 1, kUnitSlack)) {
      Add("rate_sign", what, {position, velocity}, "one of the two has the other sign",
          fmt::format("turn round the sign of {} or of {}, whichever is not the model's", position, velocity));
    } else if (const Unit* unit = UnitOf(size)) {
      Add("rate_unit", what, {position, velocity}, fmt::format("the position is in {}", unit->name),
          fmt::format("multiply {} by {:.6g}{}", position, unit->size, sign));
    } else if (const Unit* unit_of_rate = UnitOf(1 / size)) {
      Add("rate_unit", what, {position, velocity}, fmt::format("the velocity is in {}", unit_of_rate->of_rate),
          fmt::format("multiply {} by {:.6g}{}", velocity, unit_of_rate->size, sign));
    } else if (std::abs(rate.correlation) > kExactlyClear && std::max(size, 1 / size) > kFactor) {
      Add("rate_unit", what, {position, velocity},
          "units of the two differ, or the rows are not as far apart as was said",
          fmt::format("multiply {} by {:.3g}, or correct {} or the control period", velocity, factor, position));
    }
  }

  /// Sensors of one kind that are late. They usually are together: one finding for all.
  struct Late {
    std::vector<std::string> channels, shown;
    double longest = 0;  // [rows]

    void Add(const std::string& channel, double rows) {
      channels.push_back(channel);
      shown.push_back(fmt::format("{} by {:g} rows", channel, rows));
      longest = std::max(longest, rows);
    }
    std::string Line() const {
      return fmt::format("lag = {{ field = \"obs/{}/delay\", range = [0, {:g}], scale = \"absolute\" }}", channels[0],
                         std::max(1.0, std::ceil(2 * longest)));
    }
  };

  void AddLags() {
    Late rates, positions;
    for (const RateAgreement& rate : rates_) {
      if (!rate.IsShifted()) continue;
      if (rate.lag > 0) {
        rates.Add(Velocity(rate), rate.lag);
      } else {
        positions.Add(Position(rate), -rate.lag);
      }
    }
    constexpr const char* kMeaning = "a filter or another clock: no state of the robot has the numbers of one row";
    if (!rates.channels.empty()) {
      Add("velocity_lag",
          fmt::format("velocities come later than their positions move: {}", fmt::join(rates.shown, ", ")),
          rates.channels, kMeaning,
          fmt::format("none needed for the default method, which finds velocities from positions; for the others leave "
                      "these columns out, shift them by so much, or search the lag: {}",
                      rates.Line()))
          .concern = Concern::kOtherMethods;
    }
    if (!positions.channels.empty()) {
      Add("position_lag",
          fmt::format("positions come later than their velocities say: {}", fmt::join(positions.shown, ", ")),
          positions.channels, kMeaning,
          fmt::format("search the lag: {}{}; or shift the columns by so much", positions.Line(),
                      positions.channels.size() > 1 ? ", and that of the others" : ""));
    }
  }

  void AddOffsets() {
    for (const RateAgreement& rate : rates_) {
      if (rate.offset == 0) continue;
      const std::string name = Velocity(rate);
      Add("velocity_zero", fmt::format("{} is {:.2g} more than {} moves", name, rate.offset, Position(rate)), {name},
          "the sensor reads this at rest, as a gyroscope may: a design would bend parameters to fit that",
          fmt::format("add {0:.3g} to {1} (data.offset = {{ \"{1}\" = {0:.3g} }}), or make its zero a parameter: "
                      "obs/{1}/bias",
                      -rate.offset, name))
          .may_be_parameter = true;
    }
  }

  const Dataset& dataset_;
  const TaskFacts& facts_;
  std::vector<Finding>& findings_;
  const double period_;
  std::vector<RateAgreement> rates_;
  std::vector<std::vector<RateAgreement>> of_episodes_;  // OfEpisodes
};

}  // namespace

void CheckWraps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations) return;
  for (const int position : facts.positions) {
    if (position >= dataset.obs_dim()) continue;
    int n_wraps = 0;
    for (const std::vector<double>& series : SeriesOf(dataset, position)) {
      // Between steps that are small: degrees move by as much in every row.
      const auto is_small = [&](size_t i) {
        return i == 0 || i == series.size() || std::abs(series[i] - series[i - 1]) < std::numbers::pi / 2;
      };
      for (size_t i = 1; i < series.size(); ++i) {
        n_wraps += Wraps(series[i] - series[i - 1]) && is_small(i - 1) && is_small(i + 1);
      }
    }
    if (n_wraps == 0) continue;
    const std::string name = facts.ObservationName(position);
    findings.push_back({.check = "wrapped_angle",
                        .severity = Severity::kWarning,
                        .what = fmt::format("{} jumps by a whole turn in {} rows", name, n_wraps),
                        .count = n_wraps,
                        .channels = {name},
                        .meaning = "the angle is kept within one turn; replays compare it with one that is not",
                        .remedy = fmt::format("name it in data.unwrap, in Python unwrap=[\"{}\"]", name)});
  }
}

void CheckJumps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  for (const int position : facts.positions) {
    if (position >= dataset.obs_dim()) continue;
    const std::vector<std::vector<double>> recordings = SeriesOf(dataset, position);
    for (size_t k = 0; k < recordings.size(); ++k) {
      const RowSteps steps({recordings[k]});
      const double typical = steps.typical;
      if (!(typical > kImpossiblePerRow)) continue;
      const std::string name = facts.ObservationName(position);
      findings.push_back(
          {.check = kImpossibleMotion,
           .severity = Severity::kError,
           .what = fmt::format("{} moves by {:.2g} in a typical row of episode {}, wanted at most {:g} (rad or m)",
                               name, typical, k + 1, kImpossiblePerRow),
           .count = steps.count,
           .channels = {name},
           .meaning =
               "no robot moves so: beside such readings all others seem to stand still, and predictions of these "
               "mean nothing",
           .remedy = fmt::format("leave the recording out, or give its unit: data.scale = {{ \"{}\" = ... }}", name)});
      break;
    }
  }
}

void CheckTurns(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  for (const int position : facts.radians) {
    if (position >= dataset.obs_dim()) continue;
    const RowSteps steps(SeriesOf(dataset, position));
    const double typical = steps.typical;
    if (!(typical > kMostPerRow)) continue;
    const std::string name = facts.ObservationName(position);
    findings.push_back(
        {.check = "large_turns",
         .severity = Severity::kWarning,
         .what = fmt::format("{} moves by {:.2g} rad in a typical row", name, typical),
         .count = steps.count,
         .channels = {name},
         .meaning =
             "the column is in degrees, or this joint turns too fast for so few rows: a fit takes it for another "
             "motion, and other joints for the cause",
         .remedy =
             fmt::format("where it is in degrees, as its velocity is then: data.scale = {{ \"{}\" = 0.0174533 }}; "
                         "else log faster",
                         name)});
  }
}

void CheckRates(const Dataset& dataset, const TaskFacts& facts, const std::vector<int>& elsewhere,
                std::vector<Finding>& findings) {
  if (!facts.flat_observations || facts.rate_of.empty()) return;
  Rates(dataset, facts, findings).Check(elsewhere);
}

}  // namespace oted
