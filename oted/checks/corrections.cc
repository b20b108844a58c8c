#include "oted/checks/corrections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>

#include "oted/base/angle.h"
#include "oted/checks/correction.h"
#include "oted/checks/odd_recordings.h"
#include "oted/checks/parameter_rivals.h"
#include "oted/checks/short_replays.h"
#include "oted/data/checks_rates.h"

namespace oted {
namespace {

constexpr size_t kScreening = 5;       // a correction is tried on every so many windows first
constexpr double kNoHope = 0.7;        // and on all only where it leaves less than this of the squared error there
constexpr double kGood = 0.03;         // error of a channel, of its change: below it nothing is to be mended
constexpr double kHelps = 0.35;        // what a correction must leave of the squared error of its channels
constexpr double kZeroHelps = 0.2;     // the same for a zero, which wrong parameters can look like
constexpr double kActionHelps = 0.6;   // the same for an action, in the two channels that it helps most
constexpr double kMostLeft = 1.0;      // error of its channels, of their change, beside which a correction is none
constexpr double kLeftOfGuess = 0.55;  // the same of a zero, and of what one recording has for itself
constexpr double kTwoForOne = 0.7;     // what two changes must leave of what one does
constexpr double kAlike = 1.1, kOwnAlike = 1.5;  // corrections that leave within so much of the best are named beside
constexpr double kRivalAlike = 2.0;     // the same of a constant beside a zero: more than one constant may be off
constexpr double kSmallestZero = 0.02;  // [rad]; [m]: a tenth
constexpr size_t kMoved = 2, kMostJoints = 12;  // that an action may command: it moves them most; that fit worst
constexpr size_t kMostCorrections = 3, kMostRecordings = 50;  // with more recordings, few windows lie in each
constexpr int kMostOdd = 5, kFewestOwn = 10;  // recordings that are searched one by one; windows that each has to last
constexpr double kAsUsual = 2;                // what a correction of one recording must come down to
constexpr const char* kOfAll[] = {"rate_sign",        "rate_unit",          "control_rate", "swapped_columns",
                                  "quaternion_order", "quaternion_inverse", "turn_frame",   "velocity_frame",
                                  "quaternion_sign",  "shifted_actions"};
constexpr double kCorrelated = 0.6, kBeyond = 3;  // a velocity with its position; an action, times its bound
constexpr double kThousandth = 1e-3, kHundredth = 1e-2;

/// A position and its rate, where that is logged.
struct Joint {
  int position = 0;
  int velocity = -1;
  bool agree = true;
  bool correlated = true;  // one goes with the other, whatever the factor
  std::vector<int> Channels() const {
    return velocity < 0 ? std::vector<int>{position} : std::vector<int>{position, velocity};
  }
};

using Errors = ChannelErrors;

/// Whether a finding says that a body's numbers contradict each other.
bool IsOf(const TurningBody& body, const Finding& finding, const SimulatorSpec& spec) {
  constexpr const char* kContradictions[] = {"quaternion_order", "quaternion_inverse", "turn_frame",
                                             "velocity_frame",   "rate_sign",          "rate_unit",
                                             "swapped_columns"};
  if (std::ranges::find(kContradictions, finding.check) == std::end(kContradictions)) return false;
  const auto is_named = [&](int column) {
    return column >= 0 && std::ranges::find(finding.channels, spec.observation_names[static_cast<size_t>(column)]) !=
                              finding.channels.end();
  };
  return std::ranges::any_of(body.orientation, is_named) || std::ranges::any_of(body.turn, is_named) ||
         std::ranges::any_of(body.velocity, is_named);
}

class Search {
 public:
  Search(const SimulatorFactory& factory, int n_threads, std::vector<Finding>& findings)
      : factory_(factory), n_threads_(n_threads), findings_(findings), replays_(factory, n_threads) {}

  /// What all recordings have in common. @return whether there is something
  bool OfAll(const Dataset& dataset) {
    std::optional<Errors> now = Take(dataset);
    std::vector<Step> steps;
    while (steps.size() < kMostCorrections && now && *std::ranges::max_element(*now) > kGood * kGood) {
      std::vector<Trial> trials = Try(*now);
      if (trials.empty()) break;
      steps.push_back({trials, *now, windows_});
      Apply(trials.front().correction, windows_);
      now = trials.front().errors;
    }
    // One fault may hide behind another: what is left is told when all are mended.
    std::erase_if(steps, [&](const Step& step) {
      const Correction& c = step.trials.front().correction;
      return !MendsTo(c.kind == CorrectionKind::kZero ? kLeftOfGuess : kMostLeft, *now, c);
    });
    for (const Step& step : steps) {
      if (!Report(step, "")) break;  // what was found with a doubtful correction is more doubtful still
    }
    return !steps.empty();
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
    const Errors usual = UsualErrors(errors, kGood * kGood);
    int n_searched = 0;
    for (size_t e = 0; e < episodes.size() && n_searched < kMostOdd; ++e) {
      if (errors[e].empty() || !IsOdd(errors[e], usual)) continue;
      ++n_searched;
      const std::optional<Errors> now = Take(dataset.Select({episodes[e]}));
      if (episodes[e].size() < kFewestOwn * windows_.windows.front().n_steps) continue;
      std::vector<Trial> trials = Try(*now);
      std::erase_if(trials, [&](const Trial& t) {
        return MeanOf(t.errors, t.correction.judged) > kAsUsual * MeanOf(usual, t.correction.judged) ||
               !MendsTo(kLeftOfGuess, t.errors, t.correction);
      });
      if (trials.empty()) continue;
      const size_t n_found = findings_.size();
      Report({std::move(trials), *now, windows_}, fmt::format("in episode {} alone: ", e + 1));
      if (findings_.size() > n_found) findings_.back().row = episodes[e].begin;
    }
  }

 private:
  struct Trial {
    Correction correction;
    Errors errors;
    double total = 0, own = 0;
  };
  /// Corrections that are as good, and what there was without them.
  struct Step {
    std::vector<Trial> trials;
    Errors before;
    ReplayedWindows windows;
  };

  /// Chooses windows and measures them.
  std::optional<Errors> Take(const Dataset& dataset) {
    windows_ = replays_.Choose(dataset);
    joints_.clear();
    for (const RateAgreement& rate : CompareRates(dataset, spec_.rate_of, spec_.control_period_s)) {
      const double factor = spec_.control_period_s > 0 ? rate.slope / spec_.control_period_s : 1;
      const bool agree = rate.correlation > kCorrelated && std::abs(factor - 1) < 0.3;
      joints_.push_back({rate.position, rate.velocity, agree, std::abs(rate.correlation) > kCorrelated});
    }
    if (!windows_.states.empty()) {
      for (const HiddenCoordinate& hidden : spec_.hidden) {
        if (hidden.rate_of >= 0) joints_.push_back({.position = hidden.rate_of});
      }
    }
    if (static_cast<int>(windows_.windows.size()) < kFewestShortWindows) return std::nullopt;
    return replays_.Errors(windows_);
  }

  void Apply(const Correction& correction, ReplayedWindows& windows) const {
    correction.ApplyTo(windows.log);
    if (!windows.states.empty()) correction.ApplyToStates(windows.states, spec_);
  }

  static double Total(const Errors& errors) { return std::accumulate(errors.begin(), errors.end(), 0.0); }

  /// What could be wrong with channels that are predicted badly.
  std::vector<Correction> Candidates(const Errors& now) const {
    std::vector<Joint> bad;
    for (const Joint& joint : joints_) {
      if (MeanOf(now, joint.Channels()) > kGood * kGood) bad.push_back(joint);
    }
    std::ranges::sort(
        bad, [&](const Joint& x, const Joint& y) { return MeanOf(now, x.Channels()) > MeanOf(now, y.Channels()); });
    if (bad.size() > kMostJoints) bad.resize(kMostJoints);
    std::vector<Correction> all;
    for (const Joint& joint : bad) AddOfJoint(joint, all);
    AddDegrees(all);
    for (size_t i = 0; i < bad.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        const bool in_order = bad[k].position < bad[i].position;  // as the task names them
        AddSwaps(bad[in_order ? k : i], bad[in_order ? i : k], all);
      }
    }
    for (const TurningBody& body : spec_.bodies) {
      if (!windows_.states.empty() || std::ranges::any_of(body.orientation, [](int j) { return j < 0; })) continue;
      const std::vector<int> columns(body.orientation.begin(), body.orientation.end());
      all.push_back({CorrectionKind::kQuaternionOrder, columns, 0, columns});
    }
    if (spec_.n_discrete_actions > 0) return all;
    for (int a = 0; a < spec_.act_dim; ++a) {
      all.push_back({CorrectionKind::kActionSign, {a}});
      for (int b = 0; b < a; ++b) all.push_back({CorrectionKind::kActionSwap, {b, a}});
    }
    AddActionUnits(all);
    return all;
  }

  /// Of actions far beyond their range: degrees, thousandths or percent.
  void AddActionUnits(std::vector<Correction>& all) const {
    std::vector<int> beyond;
    for (int a = 0; a < spec_.act_dim; ++a) {
      const auto k = static_cast<size_t>(a);
      const double bound = std::max(std::abs(spec_.action_low[k]), std::abs(spec_.action_high[k]));
      double largest = 0;
      for (int i = 0; i < windows_.log.size(); ++i) largest = std::max(largest, std::abs(windows_.log.actions(i, a)));
      if (largest > kBeyond * bound) beyond.push_back(a);
    }
    if (beyond.empty()) return;
    for (const double unit : {kDegree, kThousandth, kHundredth}) {
      all.push_back({CorrectionKind::kActionUnit, beyond, unit});
    }
  }

  void AddOfJoint(const Joint& joint, std::vector<Correction>& all) const {
    const std::vector<int> both = joint.Channels();
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
      // No factors of a gear, such as 2: a motion twice as fast looks like half of the mass, or twice the gain.
      if (InMetres(joint)) all.push_back({CorrectionKind::kUnit, both, kHundredth, both});
    }
    for (const double size : {1.0, 2.5, 5.0, 10.0, 20.0}) {
      for (const double sign : {-1.0, 1.0}) {
        all.push_back({CorrectionKind::kZero, {joint.position}, sign * size * SmallestZero(joint), {both.back()}});
      }
    }
  }

  /// All turning joints in degrees: one alone that is put right still moves among others that are not.
  void AddDegrees(std::vector<Correction>& all) const {
    std::vector<int> turning;
    int n = 0;
    for (const Joint& joint : joints_) {
      if (InMetres(joint) || !joint.correlated) continue;
      std::ranges::copy(joint.Channels(), std::back_inserter(turning));
      ++n;
    }
    if (n > 1) all.push_back({CorrectionKind::kUnit, turning, kDegree, turning});
  }

  bool InMetres(const Joint& joint) const {
    const size_t p = static_cast<size_t>(joint.position);
    return p < spec_.observation_units.size() && spec_.observation_units[p] == "m";
  }
  double SmallestZero(const Joint& joint) const { return InMetres(joint) ? kSmallestZero / 10 : kSmallestZero; }

  static void AddSwaps(const Joint& x, const Joint& y, std::vector<Correction>& all) {
    if (x.velocity < 0 || y.velocity < 0) {
      if (x.velocity != y.velocity) return;
      all.push_back({CorrectionKind::kSwap, {x.position, y.position}, 0, {x.position, y.position}});
      return;
    }
    const std::vector<int> judged = {x.position, x.velocity, y.position, y.velocity};
    all.push_back({CorrectionKind::kSwap, {x.position, y.position, x.velocity, y.velocity}, 0, judged});
    if (x.agree || y.agree) return;
    all.push_back({CorrectionKind::kSwap, {x.position, y.position}, 0, judged});
    all.push_back({CorrectionKind::kSwap, {x.velocity, y.velocity}, 0, judged});
  }

  /// Nothing where it cannot be replayed or does not look as if it helped.
  std::optional<Trial> TryOne(const Correction& correction, const Errors& now, const Errors& screened) {
    ReplayedWindows windows = windows_;
    Apply(correction, windows);
    const std::optional<Errors> some = replays_.Errors(windows, kScreening);
    if (!some) return std::nullopt;
    // What an action moves is not known before.
    if (correction.IsOfActions() ? Total(*some) > Total(screened)
                                 : MeanOf(*some, correction.judged) > kNoHope * MeanOf(screened, correction.judged)) {
      return std::nullopt;
    }
    const std::optional<Errors> errors = replays_.Errors(windows);
    if (!errors) return std::nullopt;
    Correction judged = correction;
    if (correction.IsOfActions()) judged.judged = MostImproved(*errors, now);
    const double before = MeanOf(now, judged.judged);
    return Trial{judged, *errors, Total(*errors), before > 0 ? MeanOf(*errors, judged.judged) / before : 1};
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

  /// Whether its channels are then missed by less than `most` of their change. What halves a large error may be any
  /// change that moves the robot less: wrong springs look like a zero.
  static bool MendsTo(double most, const Errors& errors, const Correction& correction) {
    return MeanOf(errors, correction.judged) < most * most;
  }

  bool Helps(const Trial& trial, const Errors& now) const {
    const Correction& c = trial.correction;
    const double most = c.IsOfActions() ? kActionHelps : c.kind == CorrectionKind::kZero ? kZeroHelps : kHelps;
    return trial.own < most && trial.total < Total(now);
  }

  /// Corrections that help, the best first; those that help as much behind it.
  std::vector<Trial> Try(const Errors& now) {
    std::vector<Trial> trials;
    const std::optional<Errors> screened = replays_.Errors(windows_, kScreening);
    if (!screened) return trials;
    std::vector<Correction> candidates = Candidates(now);
    AddMirrored(*screened, candidates);
    for (const Correction& correction : candidates) {
      std::optional<Trial> trial = TryOne(correction, now, *screened);
      if (!trial) continue;
      if (correction.kind == CorrectionKind::kZero) *trial = Refined(*trial, now, *screened);
      if (Helps(*trial, now)) trials.push_back(*std::move(trial));
    }
    // One change before two.
    const auto cost = [](const Trial& t) {
      return t.correction.kind == CorrectionKind::kMirror ? t.total / kTwoForOne : t.total;
    };
    std::ranges::stable_sort(trials, {}, cost);
    if (trials.empty()) return trials;
    const Trial best = trials.front();
    std::erase_if(trials, [&](const Trial& t) {
      return t.total > kAlike * best.total || t.own > kOwnAlike * best.own ||
             (&t != trials.data() && t.correction.kind == best.correction.kind &&
              t.correction.kind == CorrectionKind::kZero);
    });
    return trials;
  }

  /// Joints that are turned round together with their commands. Whose command an action is shows where turning it round
  /// makes most difference.
  void AddMirrored(const Errors& screened, std::vector<Correction>& all) {
    if (spec_.n_discrete_actions > 0 || joints_.empty()) return;
    for (int a = 0; a < std::min(spec_.act_dim, static_cast<int>(kMostJoints)); ++a) {
      ReplayedWindows windows = windows_;
      Apply({CorrectionKind::kActionSign, {a}}, windows);
      const std::optional<Errors> turned = replays_.Errors(windows, kScreening);
      if (!turned) continue;
      const auto difference = [&](const Joint& joint) {
        double sum = 0;
        for (const int j : joint.Channels()) {
          sum += std::abs((*turned)[static_cast<size_t>(j)] - screened[static_cast<size_t>(j)]);
        }
        return sum;
      };
      std::vector<Joint> moved = joints_;
      std::ranges::stable_sort(moved, std::greater<>(), difference);
      moved.resize(std::min(moved.size(), kMoved));
      for (const Joint& joint : moved) {
        if (difference(joint) > 0) all.push_back({CorrectionKind::kMirror, joint.Channels(), 0, joint.Channels(), a});
      }
    }
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

  /// A constant of the model that predicts the logs, as they are, about as well as this zero does.
  std::optional<ParameterRival> RivalOf(const Step& step) {
    const Correction& zero = step.trials.front().correction;
    if (zero.kind != CorrectionKind::kZero) return std::nullopt;
    ReplayedWindows mended = step.windows;
    Apply(zero, mended);
    const std::optional<Errors> errors = replays_.Errors(mended, kScreening);
    if (!errors) return std::nullopt;
    if (!rivals_) rivals_.emplace(factory_, n_threads_);
    return rivals_->Best(step.windows, zero.judged, kRivalAlike * MeanOf(*errors, zero.judged), kScreening);
  }

  /// @param where  of the log, where not in all of it
  /// @return whether nothing else would do
  bool Report(const Step& step, const std::string& where) {
    const auto& [trials, now, windows] = step;
    const Trial& best = trials.front();
    const std::optional<ParameterRival> rival = RivalOf(step);
    const std::vector<int>& judged = best.correction.judged;
    // A zero comes and goes with no recording where a constant of the model, the same in all, explains more.
    if (rival && !where.empty() && rival->error <= MeanOf(best.errors, judged)) return false;
    auto [change, remedy] = best.correction.InWords(spec_);
    if (const char* setting = best.correction.Setting(); setting != nullptr && where.empty()) {
      remedy += fmt::format(" ({})", setting);
    }
    std::vector<std::string> others;
    for (size_t i = 1; i < trials.size(); ++i) others.push_back(trials[i].correction.InWords(spec_).remedy);
    const double period = spec_.control_period_s;
    findings_.push_back(
        {.check = best.correction.Check(),
         .severity = rival ? Severity::kNote : Severity::kWarning,
         .what = fmt::format(
             "{}with {} the nominal simulator misses {} by {:.2g} of the change, as logged by {:.2g} ({} windows{})",
             where, change, best.correction.IsOfActions() ? ChannelNames(judged) : "these channels",
             std::sqrt(MeanOf(best.errors, judged)), std::sqrt(MeanOf(now, judged)), windows.windows.size(),
             period > 0 ? fmt::format(" of {:.3g} s", replays_.n_steps() * period) : ""),
         .count = static_cast<int64_t>(best.correction.columns.size()),
         .channels = best.correction.Names(spec_),
         .meaning = rival ? fmt::format("a zero, or a constant of the model that is off: {} alone leaves {:.2g}",
                                        rival->words, std::sqrt(rival->error))
                          : "the columns are not what the model means by them; a design would bend parameters to fit "
                            "that",
         .remedy = where + (rival ? "design first, and where the zero itself is known to be off " : "") + remedy +
                   (others.empty() ? "" : fmt::format("; as good: {}", fmt::join(others, "; or ")))});
    return !rival;
  }

  const SimulatorFactory& factory_;
  const SimulatorSpec& spec_ = factory_.spec();
  int n_threads_;
  std::vector<Finding>& findings_;
  ShortReplays replays_;
  std::optional<ParameterRivals> rivals_;  // made where a zero is doubted
  ReplayedWindows windows_;
  std::vector<Joint> joints_;
};

}  // namespace

void CheckCorrections(const SimulatorFactory& factory, const Dataset& dataset, int n_threads,
                      std::vector<Finding>& findings) {
  // States of a body whose orientation and rates contradict each other are none: a replay from them blames the rest.
  const auto is_of_body = [&](const Finding& f) {
    return std::ranges::any_of(factory.spec().bodies,
                               [&](const TurningBody& body) { return IsOf(body, f, factory.spec()); });
  };
  if (std::ranges::any_of(findings, is_of_body)) return;
  Search search(factory, n_threads, findings);
  if (!search.OfAll(dataset)) search.OfEach(dataset);
}

}  // namespace oted
