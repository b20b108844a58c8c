#include "oted/checks/corrections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "oted/checks/correction.h"
#include "oted/data/checks_rates.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

constexpr int kWindows = 300;
constexpr int kFewestWindows = 20;
constexpr size_t kScreening = 5;  // a correction is tried on every so many windows first
constexpr double kNoHope = 0.7;   // and on all only where it leaves less than this of the squared error there
constexpr int kLanes = 50;
constexpr double kWindow_s = 0.05;
constexpr int kLongestWindow = 10;    // rows
constexpr double kCap = 2;            // an error counts as so many times the usual change at most
constexpr double kGood = 0.03;        // error of a channel, of its change: below it nothing is to be mended
constexpr double kHelps = 0.35;       // what a correction must leave of the squared error of its channels
constexpr double kZeroHelps = 0.2;    // the same for a zero, which wrong parameters can look like
constexpr double kFasterHelps = 0.1;  // and for a motion made twice as fast, which hides half of what moves it
constexpr double kActionHelps = 0.6;  // the same for an action, in the two channels that it helps most
constexpr double kAlike = 1.1;        // corrections that leave within so much of the best are named beside it
constexpr double kOwnAlike = 1.5;
constexpr double kSmallestZero = 0.02;  // [rad]; [m]: a tenth
constexpr size_t kMostJoints = 12;      // those that fit worst
constexpr int kMostCorrections = 3;
constexpr size_t kMostRecordings = 50;  // with more of them, too few windows lie in each
constexpr size_t kMostOdd = 5;          // recordings that are searched one by one
constexpr double kOdd = 4;              // squared error of a channel, of what is usual
constexpr double kAsUsual = 2;          // what a correction of one recording must come down to
constexpr const char* kOfAll[] = {"rate_sign",        "rate_unit",          "control_rate", "swapped_columns",
                                  "quaternion_order", "quaternion_inverse", "turn_frame",   "velocity_frame",
                                  "quaternion_sign",  "shifted_actions"};
constexpr double kCorrelated = 0.6;  // of a velocity with its position
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kThousandth = 1e-3, kHundredth = 1e-2;

/// A position and its rate.
struct Joint {
  int position = 0, velocity = 0;
  bool agree = true;
  bool correlated = true;  // one goes with the other, whatever the factor
};

using Errors = std::vector<double>;  // per channel: mean of the squared error over the squared change

double Mean(const Errors& errors, const std::vector<int>& channels) {
  double sum = 0;
  for (const int j : channels) sum += errors[static_cast<size_t>(j)];
  return channels.empty() ? 0 : sum / static_cast<double>(channels.size());
}

class Search {
 public:
  Search(const SimulatorFactory& factory, int n_threads, std::vector<Finding>& findings)
      : spec_(factory.spec()), findings_(findings), simulator_(factory.Make(kLanes, n_threads)) {
    for (int lane = 0; lane < kLanes; ++lane) simulator_->SetParameters(lane, factory.parameters().Nominal());
    n_steps_ = spec_.control_period_s > 0
                   ? std::clamp(static_cast<int>(std::lround(kWindow_s / spec_.control_period_s)), 1, kLongestWindow)
                   : 1;
  }

  /// What all recordings have in common. @return whether there is something
  bool OfAll(const Dataset& dataset) {
    std::optional<Errors> now = Take(dataset);
    const size_t before = findings_.size();
    for (int i = 0; i < kMostCorrections && now && Worst(*now) > kGood * kGood; ++i) {
      const std::vector<Trial> trials = Try(*now);
      if (trials.empty()) break;
      Report(trials, *now, "");
      trials.front().correction.ApplyTo(log_);
      now = trials.front().errors;
    }
    return findings_.size() > before;
  }

  /// What single recordings have for themselves: those that are predicted far worse than the rest, and as well as it
  /// with a correction.
  void OfEach(const Dataset& dataset) {
    const std::vector<Episode> episodes = dataset.Episodes();
    if (episodes.size() < 2 || episodes.size() > kMostRecordings) return;
    // Columns that are wrong throughout have to be mended first: what is left then tells recordings apart.
    const auto is_of_all = [](const Finding& f) { return std::ranges::find(kOfAll, f.check) != std::end(kOfAll); };
    if (std::ranges::any_of(findings_, is_of_all)) return;
    std::vector<Errors> errors(episodes.size());
    for (size_t e = 0; e < episodes.size(); ++e) {
      errors[e] = Take(dataset.Select({episodes[e]})).value_or(Errors{});
    }
    const Errors usual = UsualOf(errors);
    size_t n_searched = 0;
    for (size_t e = 0; e < episodes.size() && n_searched < kMostOdd; ++e) {
      if (errors[e].empty() || !IsOdd(errors[e], usual)) continue;
      ++n_searched;
      const std::optional<Errors> now = Take(dataset.Select({episodes[e]}));
      std::vector<Trial> trials = Try(*now);
      std::erase_if(trials, [&](const Trial& t) {
        return Mean(t.errors, t.correction.judged) > kAsUsual * Mean(usual, t.correction.judged);
      });
      if (trials.empty()) continue;
      Report(trials, *now, fmt::format("in episode {} alone: ", e + 1));
      findings_.back().row = episodes[e].begin;
    }
  }

 private:
  struct Trial {
    Correction correction;
    Errors errors;
    double total = 0, own = 0;
  };

  /// Copies windows, each with what a simulator with delays reaches back to, into a log of their own, and measures it.
  std::optional<Errors> Take(const Dataset& dataset) {
    starts_.clear();
    Choose(dataset);
    joints_.clear();
    for (const RateAgreement& rate : CompareRates(dataset, spec_.rate_of, spec_.control_period_s)) {
      const double factor = spec_.control_period_s > 0 ? rate.slope / spec_.control_period_s : 1;
      const bool agree = rate.correlation > kCorrelated && std::abs(factor - 1) < 0.3;
      joints_.push_back({rate.position, rate.velocity, agree, std::abs(rate.correlation) > kCorrelated});
    }
    if (static_cast<int>(starts_.size()) < kFewestWindows) return std::nullopt;
    return Measure(log_, 1);
  }

  /// Of each channel the error in the better recordings: that a quarter of them stay below.
  static Errors UsualOf(const std::vector<Errors>& errors) {
    Errors usual;
    for (const Errors& some : errors) usual.resize(std::max(usual.size(), some.size()));
    for (size_t j = 0; j < usual.size(); ++j) {
      std::vector<double> values;
      for (const Errors& some : errors) {
        if (!some.empty()) values.push_back(some[j]);
      }
      const auto at = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 4);
      std::nth_element(values.begin(), at, values.end());
      usual[j] = std::max(*at, kGood * kGood);
    }
    return usual;
  }

  static bool IsOdd(const Errors& errors, const Errors& usual) {
    for (size_t j = 0; j < errors.size(); ++j) {
      if (errors[j] > kOdd * usual[j]) return true;
    }
    return false;
  }

  void Choose(const Dataset& dataset) {
    int before = spec_.n_past_actions;
    for (const int age : spec_.reading_ages) before = std::max(before, age);
    std::vector<int> rows;
    for (const Episode& e : dataset.Episodes()) {
      for (int i = e.begin; i + n_steps_ <= e.end; ++i) rows.push_back(i);
    }
    const size_t every = std::max<size_t>(1, rows.size() / kWindows);
    std::vector<Episode> windows;
    int at = 0;
    for (size_t k = every / 2; k < rows.size(); k += every) {
      const int history = std::min(before, rows[k] - WindowAt(dataset, rows[k], n_steps_).episode_begin);
      windows.push_back({rows[k] - history, rows[k] + n_steps_, false});
      starts_.push_back({at + history, n_steps_, at});
      at += history + n_steps_;
    }
    if (!windows.empty()) log_ = dataset.Select(windows);
  }

  /// Of every `stride`-th window. Nothing where too few can be replayed.
  std::optional<Errors> Measure(const Dataset& log, size_t stride) {
    const size_t d = static_cast<size_t>(spec_.obs_dim()), a = static_cast<size_t>(spec_.act_dim);
    Errors change(d, 0.0), sum(d, 0.0);
    std::vector<LogWindow> starts;
    for (size_t k = 0; k < starts_.size(); k += stride) starts.push_back(starts_[k]);
    for (const LogWindow& w : starts) {
      for (size_t j = 0; j < d; ++j) {
        const int c = static_cast<int>(j);
        change[j] += std::pow(log.next_observations(w.begin + n_steps_ - 1, c) - log.observations(w.begin, c), 2);
      }
    }
    int n = 0;
    std::vector<double> actions(static_cast<size_t>(kLanes) * a);
    for (size_t first = 0; first < starts.size(); first += kLanes) {
      std::vector<int> lanes;
      std::vector<LogWindow> windows;
      for (size_t k = first; k < std::min(starts.size(), first + kLanes); ++k) {
        const int lane = static_cast<int>(lanes.size());
        if (!simulator_->SetStateFromLog(lane, log.observations.row(starts[k].begin), HistoryBefore(log, starts[k])))
          continue;
        lanes.push_back(lane);
        windows.push_back(starts[k]);
      }
      std::vector<int> running = lanes;
      for (int t = 0; t < n_steps_; ++t) {
        for (const int lane : running) {
          const auto action = log.actions.row(windows[static_cast<size_t>(lane)].begin + t);
          std::copy(action.begin(), action.end(),
                    actions.begin() + static_cast<std::ptrdiff_t>(static_cast<size_t>(lane) * a));
        }
        simulator_->Step(running, actions);
        std::erase_if(running, [&](int lane) { return simulator_->status(lane) == LaneStatus::kDiverged; });
      }
      for (const int lane : lanes) {
        const bool diverged = simulator_->status(lane) == LaneStatus::kDiverged;
        for (size_t j = 0; j < d; ++j) {
          if (change[j] <= 0) continue;
          const double logged =
              log.next_observations(windows[static_cast<size_t>(lane)].begin + n_steps_ - 1, static_cast<int>(j));
          const double squared =
              std::pow(simulator_->observation(lane)[j] - logged, 2) * static_cast<double>(starts.size()) / change[j];
          sum[j] += diverged ? kCap * kCap : std::min(squared, kCap * kCap);
        }
        ++n;
      }
    }
    if (n < kFewestWindows / static_cast<int>(stride)) return std::nullopt;
    for (double& s : sum) s /= n;
    return sum;
  }

  double Total(const Errors& errors) const {
    double total = 0;
    for (const double e : errors) total += e;
    return total;
  }
  static double Worst(const Errors& errors) { return *std::ranges::max_element(errors); }

  /// What could be wrong with channels that are predicted badly.
  std::vector<Correction> Candidates(const Errors& now) const {
    std::vector<Joint> bad;
    for (const Joint& joint : joints_) {
      if (Mean(now, {joint.position, joint.velocity}) > kGood * kGood) bad.push_back(joint);
    }
    std::ranges::sort(bad, [&](const Joint& x, const Joint& y) {
      return Mean(now, {x.position, x.velocity}) > Mean(now, {y.position, y.velocity});
    });
    if (bad.size() > kMostJoints) bad.resize(kMostJoints);
    std::vector<Correction> all;
    for (const Joint& joint : bad) AddOfJoint(joint, all);
    for (size_t i = 0; i < bad.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        const bool in_order = bad[k].position < bad[i].position;  // as the task names them
        AddSwaps(bad[in_order ? k : i], bad[in_order ? i : k], all);
      }
    }
    for (const TurningBody& body : spec_.bodies) {
      if (std::ranges::any_of(body.orientation, [](int j) { return j < 0; })) continue;
      const std::vector<int> columns(body.orientation.begin(), body.orientation.end());
      all.push_back({CorrectionKind::kQuaternionOrder, columns, 0, columns});
    }
    if (spec_.n_discrete_actions > 0) return all;
    for (int a = 0; a < spec_.act_dim; ++a) {
      all.push_back({CorrectionKind::kActionSign, {a}});
      for (int b = 0; b < a; ++b) all.push_back({CorrectionKind::kActionSwap, {b, a}});
    }
    return all;
  }

  void AddOfJoint(const Joint& joint, std::vector<Correction>& all) const {
    const std::vector<int> both = {joint.position, joint.velocity};
    std::vector<std::vector<int>> sets;
    if (joint.agree) {
      sets = {both};
    } else {
      sets = {{joint.position}, {joint.velocity}, both};
    }
    const double unit = InMetres(joint) ? kThousandth : kDegree;
    for (const auto& columns : sets) {
      all.push_back({CorrectionKind::kSign, columns, 0, both});
      // Never the reverse: a motion made 57 times as fast hides what moves it, and so every other defect. The unit of
      // one of the two shows only where they move together: what stands still is predicted better the smaller it is.
      if (joint.correlated) all.push_back({CorrectionKind::kUnit, columns, unit, both});
    }
    if (joint.agree) {
      // A gear or a belt between encoder and joint; the width of a gripper in place of a finger's way.
      for (const double gear : {0.5, 2.0}) all.push_back({CorrectionKind::kUnit, both, gear, both});
      if (InMetres(joint)) all.push_back({CorrectionKind::kUnit, both, kHundredth, both});
    }
    for (const double size : {1.0, 2.5, 5.0, 10.0, 20.0}) {
      for (const double sign : {-1.0, 1.0}) {
        all.push_back({CorrectionKind::kZero, {joint.position}, sign * size * SmallestZero(joint), {joint.velocity}});
      }
    }
  }

  bool InMetres(const Joint& joint) const {
    const size_t p = static_cast<size_t>(joint.position);
    return p < spec_.observation_units.size() && spec_.observation_units[p] == "m";
  }
  double SmallestZero(const Joint& joint) const { return InMetres(joint) ? kSmallestZero / 10 : kSmallestZero; }

  static void AddSwaps(const Joint& x, const Joint& y, std::vector<Correction>& all) {
    const std::vector<int> judged = {x.position, x.velocity, y.position, y.velocity};
    all.push_back({CorrectionKind::kSwap, {x.position, y.position, x.velocity, y.velocity}, 0, judged});
    if (x.agree || y.agree) return;
    all.push_back({CorrectionKind::kSwap, {x.position, y.position}, 0, judged});
    all.push_back({CorrectionKind::kSwap, {x.velocity, y.velocity}, 0, judged});
  }

  /// Nothing where it cannot be replayed or does not look as if it helped.
  std::optional<Trial> TryOne(const Correction& correction, const Errors& now, const Errors& screened) {
    Dataset log = log_;
    correction.ApplyTo(log);
    const std::optional<Errors> some = Measure(log, kScreening);
    if (!some) return std::nullopt;
    // What an action moves is not known before.
    if (correction.IsOfActions() ? Total(*some) > Total(screened)
                                 : Mean(*some, correction.judged) > kNoHope * Mean(screened, correction.judged)) {
      return std::nullopt;
    }
    const std::optional<Errors> errors = Measure(log, 1);
    if (!errors) return std::nullopt;
    Correction judged = correction;
    if (correction.IsOfActions()) judged.judged = MostImproved(*errors, now);
    const double before = Mean(now, judged.judged);
    return Trial{judged, *errors, Total(*errors), before > 0 ? Mean(*errors, judged.judged) / before : 1};
  }

  /// The two channels whose error falls most.
  static std::vector<int> MostImproved(const Errors& errors, const Errors& now) {
    std::vector<int> order(errors.size());
    for (size_t j = 0; j < order.size(); ++j) order[j] = static_cast<int>(j);
    std::ranges::stable_sort(order, std::greater<>(),
                             [&](int j) { return now[static_cast<size_t>(j)] - errors[static_cast<size_t>(j)]; });
    order.resize(std::min<size_t>(order.size(), 2));
    return order;
  }

  bool Helps(const Trial& trial, const Errors& now) const {
    const Correction& c = trial.correction;
    const double most = c.IsOfActions()                                  ? kActionHelps
                        : c.kind == CorrectionKind::kZero                ? kZeroHelps
                        : c.kind == CorrectionKind::kUnit && c.value > 1 ? kFasterHelps
                                                                         : kHelps;
    return trial.own < most && trial.total < Total(now);
  }

  /// Corrections that help, the best first; those that help as much behind it.
  std::vector<Trial> Try(const Errors& now) {
    std::vector<Trial> trials;
    const std::optional<Errors> screened = Measure(log_, kScreening);
    if (!screened) return trials;
    for (const Correction& correction : Candidates(now)) {
      std::optional<Trial> trial = TryOne(correction, now, *screened);
      if (!trial) continue;
      if (correction.kind == CorrectionKind::kZero) *trial = Refined(*trial, now, *screened);
      if (Helps(*trial, now)) trials.push_back(*std::move(trial));
    }
    std::ranges::stable_sort(trials, {}, &Trial::total);
    if (trials.empty()) return trials;
    const Trial best = trials.front();
    std::erase_if(trials, [&](const Trial& t) {
      return t.total > kAlike * best.total || t.own > kOwnAlike * best.own ||
             (&t != trials.data() && t.correction.kind == best.correction.kind &&
              t.correction.kind == CorrectionKind::kZero);
    });
    return trials;
  }

  /// Halves the distance to the best zero a few times.
  Trial Refined(Trial trial, const Errors& now, const Errors& screened) {
    for (double step = trial.correction.value / 2; std::abs(step) > std::abs(trial.correction.value) / 40; step /= 2) {
      for (const double sign : {-1.0, 1.0}) {
        Correction moved = trial.correction;
        moved.value += sign * step;
        const std::optional<Trial> other = TryOne(moved, now, screened);
        if (other && other->total < trial.total) {
          trial = *other;
          break;
        }
      }
    }
    return trial;
  }

  std::string ChannelNames(const std::vector<int>& channels) const {
    std::vector<std::string> names;
    for (const int j : channels) names.push_back(spec_.observation_names[static_cast<size_t>(j)]);
    return fmt::format("{}", fmt::join(names, " and "));
  }

  /// @param where  of the log, where not in all of it
  void Report(const std::vector<Trial>& trials, const Errors& now, const std::string& where) {
    const Trial& best = trials.front();
    const std::vector<int>& judged = best.correction.judged;
    const auto [change, remedy] = best.correction.InWords(spec_);
    std::vector<std::string> others;
    for (size_t i = 1; i < trials.size(); ++i) others.push_back(trials[i].correction.InWords(spec_).remedy);
    const double period = spec_.control_period_s;
    findings_.push_back(
        {.check = best.correction.Check(),
         .severity = Severity::kWarning,
         .what = fmt::format(
             "{}with {} the nominal {} misses {} by {:.2g} of the change, as logged by {:.2g} ({} windows{})", where,
             change, spec_.task, best.correction.IsOfActions() ? ChannelNames(judged) : "these channels",
             std::sqrt(Mean(best.errors, judged)), std::sqrt(Mean(now, judged)), starts_.size(),
             period > 0 ? fmt::format(" of {:.3g} s", n_steps_ * period) : ""),
         .count = static_cast<int64_t>(best.correction.columns.size()),
         .channels = best.correction.Names(spec_),
         .meaning = "the columns are not what the model means by them; a design would bend parameters to fit that",
         .remedy = where + remedy + (others.empty() ? "" : fmt::format("; as good: {}", fmt::join(others, "; or ")))});
  }

  const SimulatorSpec& spec_;
  std::vector<Finding>& findings_;
  std::unique_ptr<Simulator> simulator_;
  int n_steps_ = 1;
  Dataset log_;
  std::vector<LogWindow> starts_;
  std::vector<Joint> joints_;
};

}  // namespace

void CheckCorrections(const SimulatorFactory& factory, const Dataset& dataset, int n_threads,
                      std::vector<Finding>& findings) {
  Search search(factory, n_threads, findings);
  if (!search.OfAll(dataset)) search.OfEach(dataset);
}

}  // namespace oted
