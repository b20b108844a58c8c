#include "oted/checks/corrections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>

#include "oted/checks/correction.h"
#include "oted/checks/correction_candidates.h"
#include "oted/checks/odd_recordings.h"
#include "oted/checks/parameter_rivals.h"
#include "oted/checks/short_replays.h"

namespace oted {
namespace {

constexpr size_t kScreening = 5;       // a correction is tried on every so many windows first
constexpr double kNoHope = 0.7;        // and on all only where it leaves less than this of the squared error there
constexpr double kHelps = 0.35;        // what a correction must leave of the squared error of its channels
constexpr double kZeroHelps = 0.2;     // the same for a zero, which wrong parameters can look like
constexpr double kActionHelps = 0.6;   // the same for an action, in the two channels that it helps most
constexpr double kMostLeft = 1.0;      // error of its channels, of their change, beside which a correction is none
constexpr double kLeftOfGuess = 0.55;  // the same of a zero, and of what one recording has for itself
constexpr double kTwoForOne = 0.7;     // what two changes must leave of what one does
constexpr double kAlike = 1.1, kOwnAlike = 1.5;  // corrections that leave within so much of the best are named beside
constexpr double kRivalAlike = 2.0;     // the same of a constant beside a zero: more than one constant may be off
constexpr double kRivalOfAction = 1.0;  // beside a change of actions
constexpr size_t kMoved = 2;            // joints that an action may command: it moves them most
constexpr size_t kMostCorrections = 3, kMostRecordings = 50;  // with more recordings, few windows lie in each
constexpr int kMostOdd = 5, kFewestOwn = 10;  // recordings that are searched one by one; windows that each has to last
constexpr double kAsUsual = 2;                // what a correction of one recording must come down to
constexpr const char* kOfAll[] = {"rate_sign",        "rate_unit",          "control_rate", "swapped_columns",
                                  "quaternion_order", "quaternion_inverse", "turn_frame",   "velocity_frame",
                                  "quaternion_sign",  "shifted_actions"};

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
  Search(const SimulatorFactory& factory, const RunContext& context, std::vector<Finding>& findings)
      : factory_(factory), context_(context), findings_(findings), replays_(factory, context.n_threads) {}

  /// What all recordings have in common. @return whether there is something
  bool OfAll(const Dataset& dataset) {
    std::optional<Errors> now = Take(dataset);
    std::vector<Step> steps;
    while (steps.size() < kMostCorrections && now && *std::ranges::max_element(*now) > kGoodError * kGoodError) {
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
    const Errors usual = UsualErrors(errors, kGoodError * kGoodError);
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
    joints_ = JointsOf(dataset, spec_, !windows_.states.empty());
    if (static_cast<int>(windows_.windows.size()) < kFewestShortWindows) return std::nullopt;
    return replays_.Errors(windows_);
  }

  void Apply(const Correction& correction, ReplayedWindows& windows) const {
    correction.ApplyTo(windows.log);
    if (!windows.states.empty()) correction.ApplyToStates(windows.states, spec_);
  }

  static double Total(const Errors& errors) { return std::accumulate(errors.begin(), errors.end(), 0.0); }

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
    std::vector<Correction> candidates = CandidateCorrections(spec_, windows_, joints_, now);
    AddMirrored(*screened, candidates);
    for (size_t k = 0; k < candidates.size(); ++k) {
      context_.ThrowIfStopped();
      context_.log->Progress("check", "", static_cast<int64_t>(k), static_cast<int64_t>(candidates.size()),
                             "whether a changed column would fit the model");
      const Correction& correction = candidates[k];
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
    for (int a = 0; a < std::min(spec_.act_dim, static_cast<int>(kMostAskedJoints)); ++a) {
      ReplayedWindows windows = windows_;
      Apply({CorrectionKind::kActionSign, {a}}, windows);
      const std::optional<Errors> turned = replays_.Errors(windows, kScreening);
      if (!turned) continue;
      const auto difference = [&](const LoggedJoint& joint) {
        double sum = 0;
        for (const int j : joint.Channels()) {
          sum += std::abs((*turned)[static_cast<size_t>(j)] - screened[static_cast<size_t>(j)]);
        }
        return sum;
      };
      std::vector<LoggedJoint> moved = joints_;
      std::ranges::stable_sort(moved, std::greater<>(), difference);
      moved.resize(std::min(moved.size(), kMoved));
      for (const LoggedJoint& joint : moved) {
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

  /// A constant of the model that predicts the logs, as they are, about as well as this zero does, or as this change of
  /// actions.
  std::optional<ParameterRival> RivalOf(const Step& step) {
    const Correction& best = step.trials.front().correction;
    if (best.kind != CorrectionKind::kZero && !best.IsOfActions()) return std::nullopt;
    ReplayedWindows mended = step.windows;
    Apply(best, mended);
    const std::optional<Errors> errors = replays_.Errors(mended, kScreening);
    if (!errors) return std::nullopt;
    if (!rivals_) rivals_.emplace(factory_, context_.n_threads);
    const double alike = best.IsOfActions() ? kRivalOfAction : kRivalAlike;
    return rivals_->Best(step.windows, best.judged, alike * MeanOf(*errors, best.judged), kScreening);
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
    if (const std::string setting = best.correction.Setting(spec_); !setting.empty() && where.empty()) {
      remedy += fmt::format(" ({})", setting);
    }
    std::vector<std::string> others;
    for (size_t i = 1; i < trials.size(); ++i) others.push_back(trials[i].correction.InWords(spec_).remedy);
    const double period = spec_.control_period_s;
    const bool may_be_parameter = best.correction.kind == CorrectionKind::kZero;
    findings_.push_back(
        {.check = best.correction.Check(),
         .severity = rival ? Severity::kNote : Severity::kWarning,
         .what = fmt::format(
             "{}with {} the nominal simulator misses {} by {:.2g} of the change, as logged by {:.2g} ({} windows{})",
             where, change, ChannelNames(judged), std::sqrt(MeanOf(best.errors, judged)),
             std::sqrt(MeanOf(now, judged)), windows.windows.size(),
             period > 0 ? fmt::format(" of {:.3g} s", replays_.n_steps() * period) : ""),
         .count = static_cast<int64_t>(best.correction.columns.size()),
         .channels = best.correction.Names(spec_),
         .meaning =
             rival ? fmt::format("{}, or a constant of the model that is off: {} alone leaves {:.2g}",
                                 may_be_parameter ? "a zero" : "wrong columns", rival->words, std::sqrt(rival->error))
                   : "the columns are not what the model means by them; a design would bend parameters to fit "
                     "that",
         .remedy = where +
                   (rival ? fmt::format("design first, and where the {} known to be off ",
                                        may_be_parameter ? "zero itself is" : "columns are")
                          : "") +
                   remedy + (others.empty() ? "" : fmt::format("; as good: {}", fmt::join(others, "; or "))),
         .may_be_parameter = may_be_parameter});
    return !rival;
  }

  const SimulatorFactory& factory_;
  const SimulatorSpec& spec_ = factory_.spec();
  const RunContext& context_;
  std::vector<Finding>& findings_;
  ShortReplays replays_;
  std::optional<ParameterRivals> rivals_;  // made where a zero is doubted
  ReplayedWindows windows_;
  std::vector<LoggedJoint> joints_;
};

}  // namespace

void CheckCorrections(const SimulatorFactory& factory, const Dataset& dataset, const RunContext& context,
                      std::vector<Finding>& findings) {
  // States of a body whose orientation and rates contradict each other are none: a replay from them blames the rest.
  const auto is_of_body = [&](const Finding& f) {
    return std::ranges::any_of(factory.spec().bodies,
                               [&](const TurningBody& body) { return IsOf(body, f, factory.spec()); });
  };
  if (std::ranges::any_of(findings, is_of_body)) return;
  Search search(factory, context, findings);
  if (!search.OfAll(dataset)) search.OfEach(dataset);
}

}  // namespace oted
