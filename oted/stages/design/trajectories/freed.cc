#include "oted/stages/design/trajectories/freed.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "oted/base/picked.h"
#include "oted/matching/designer.h"
#include "oted/matching/verdict.h"
#include "oted/stages/design/replay/prediction_evidence.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/long_windows.h"
#include "oted/stages/design/trajectories/screening.h"
#include "oted/stages/design/trajectories/suspect_fits.h"
#include "oted/stages/design/trajectories/unseen_likelihood.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFreedPhysics = 1.5e5;    // steps of a linearization of them
constexpr int kTellingRows = 4800;         // of the windows that tell which is likelier: their starts alone are fitted
constexpr double kTellingPhysics = 4.5e5;  // steps, as above
constexpr int kFreedIterations = 24, kJoinedIterations = 10, kProbeIterations = 3;
constexpr double kShownSeconds = 0.5;
constexpr int kShortRows = 480;
constexpr size_t kFewestNamed = 3;
constexpr double kNearEnd = 0.015;  // of the range: a value so near its bound may be beyond, like one at it
constexpr double kNoWorse = 2.0;    // nats: the prior of one parameter more

/// Whether a value lies at an end of its range, or next to it.
bool IsNearBound(const ParameterSpec& spec, double value) {
  const ParameterSpace space({spec});
  const double u = space.ToUnit(std::vector<double>{value})[0];
  const auto at = [&](double unit) { return space.FromUnit(std::vector<double>{std::clamp(unit, 0.0, 1.0)})[0]; };
  return EndsAtBound(spec, at(u - kNearEnd), at(u + kNearEnd));
}

struct Fitted {
  int n_steps;  // of the windows
  VectorXd x;
  double cost = 0;
  MatrixXd covariance;
  VectorXd variance;  // of the sensors' noise
};

class FreedTrials {
 public:
  explicit FreedTrials(const FreedProblem& problem) : problem_(problem), fits_(problem), screening_(fits_) {}

  /// @param thoroughly  as TrySuspects has it
  ScreenedSuspects Find(bool thoroughly) { return screening_.Find(thoroughly); }

  /// @param screened_x  of the parameters and the suspect, by the windows that screened it; null where none did
  TriedSuspect Try(const Suspect& suspect, const VectorXd* screened_x) {
    const std::unique_ptr<SimulatorFactory> wider = problem_.factory.With({suspect.spec});
    if (wider == nullptr) return {};
    const ParameterSpace& space = wider->parameters();
    const VectorXd x = Without();
    std::vector<double> before = ToZ(problem_.factory.parameters(), x);
    before.push_back(space[space.size() - 1].nominal);
    const Prior prior = fits_.PriorIn(space);
    const ReadingModel readings = fits_.ReadingsOf(*wider);
    std::optional<Fitted> best;
    std::vector<VectorXd> starts = {fits_.StartOf(*wider, x, suspect.value), fits_.StartOf(*wider, x, before.back())};
    // The other parameters have moved with it there.
    if (screened_x != nullptr) starts.front() = *screened_x;
    for (const VectorXd& start : starts) {
      if (best && !IsCaught(*best)) break;
      std::optional<Fitted> fitted = Fit(*wider, prior, readings, start);
      if (fitted && (!best || fitted->cost < best->cost)) best = std::move(fitted);
    }
    if (!best) return {};
    const Designer q(space, best->x, best->covariance);
    const auto prediction = Beside(*wider, readings, q.Mode(), before);
    if (!prediction) return {};
    const HeldOutPrediction::Horizon& told = ToldOf(prediction->horizons);
    std::optional<Likelier> likelier = LikelierWith(*wider, readings, *best);
    const bool predicts_better = PredictsBetter(*prediction) && told.gain.value > kSureErrors * told.gain.error;
    // Likelier windows of real logs may go with worse predictions of other motions: there the error has to fall.
    const bool is_no_worse = !PredictsWorse(*prediction) && (!problem_.fit.errors_grow || told.gain.value > 0);
    // At an end of its range it stands in for something else. And what leaves another one at its bound is not what put
    // it there.
    const double value = q.Mode().back();
    const bool is_at_bound = IsNearBound(space[space.size() - 1], value) || !ParametersAtBounds(q).empty();
    FreedTrial trial{.value = value,
                     .std = q.Std().back(),
                     .intervals90 = q.CentralInterval(kIntervalMass),
                     .kept = false,
                     .seconds = told.seconds,
                     .n_steps = told.n_steps,
                     .n_windows = told.n_windows,
                     .learned = told.learned || fits_.LearnsFromAll(),
                     .gain = told.gain,
                     .nats = likelier ? std::optional(likelier->nats) : std::nullopt,
                     .led_by = {},
                     .before = {},
                     .after = {}};
    trial.kept = !is_at_bound && (predicts_better || (IsLikelier(trial) && is_no_worse));
    trial.intervals90.pop_back();  // of what was freed
    for (const HeldOutPrediction::Channel& channel : told.channels) {
      trial.before.push_back(channel.nominal);
      trial.after.push_back(channel.designed);
    }
    return {std::move(trial), likelier ? std::optional(std::move(likelier->costs)) : std::nullopt};
  }

  /// Of a suspect that was tried, now or before.
  void Know(const std::string& name, const std::optional<TrialCosts>& costs) {
    if (costs) costs_[name] = *costs;
  }

  /// What is kept first; of these the likeliest, where the same windows tell of all that were tried.
  void PutInOrder(std::span<Suspect> tried) const {
    const auto is_kept = [](const Suspect& suspect) { return suspect.trial && suspect.trial->kept; };
    std::vector<std::pair<bool, double>> ranks;
    for (const Suspect& suspect : tried) {
      const std::optional<Estimated> nats = NatsBeside(tried.front(), suspect);
      if (!nats) {
        std::ranges::stable_partition(tried, is_kept);
        return;
      }
      ranks.emplace_back(is_kept(suspect), nats->value);
    }
    std::vector<size_t> order(tried.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::ranges::stable_sort(order, std::ranges::greater(), [&](size_t k) { return ranks[k]; });
    std::ranges::move(Picked(std::vector<Suspect>(tried.begin(), tried.end()), order), tried.begin());
  }

  /// Names, of those that were tried, which surely lead this one (FreedTrial::led_by).
  std::vector<std::string> LeadersOf(const Suspect& one, const std::vector<Suspect>& suspects) const {
    std::vector<std::string> leaders;
    for (const Suspect& other : suspects) {
      if (!other.trial || other.spec.name == one.spec.name) continue;
      if (Leads(other, one)) leaders.push_back(other.spec.name);
    }
    return leaders;
  }

 private:
  /// Whether one of two that were tried makes the same windows surely likelier than the other, each by the noise that
  /// it leaves; or surely gains more, where that is not known of both. A few nats tell nothing, however sure: where two
  /// are one to the logs, as a servo's kv and all that it moves, the fits end that near each other.
  bool Leads(const Suspect& one, const Suspect& other) const {
    if (const std::optional<Estimated> nats = NatsBeside(other, one)) {
      return nats->value > std::max(kFewestSureNats, kSureErrors * nats->error);
    }
    const Estimated &a = one.trial->gain, &b = other.trial->gain;
    return a.value - b.value > kSureErrors * std::hypot(a.error, b.error);
  }

  /// By how many nats the same windows are likelier with `other` than with `one`, each by the noise that it leaves;
  /// none where that is not known of both.
  std::optional<Estimated> NatsBeside(const Suspect& one, const Suspect& other) const {
    const auto ours = costs_.find(one.spec.name), theirs = costs_.find(other.spec.name);
    // Fits with other sensors late held other readings.
    if (ours == costs_.end() || theirs == costs_.end() || ours->second.ages != theirs->second.ages) return std::nullopt;
    return NatsGained(theirs->second.of_windows, ours->second.of_windows);
  }

  /// Whether a fit with one parameter more ends above the fit without it, where it could be as well.
  bool IsCaught(const Fitted& with) const {
    return !fitted_without_ || with.n_steps != fitted_without_->n_steps || with.cost > fitted_without_->cost + kNoWorse;
  }

  /// Rows of so long windows: what makes enough of them, and what the physics affords.
  int FreedRows(int n_steps) const {
    const int enough = problem_.fit.errors_grow ? std::max(kFreedRows, kFewestLongWindows * n_steps) : kFreedRows;
    return AffordableRows(enough, kFreedPhysics, problem_.factory, fits_.ReadingsOf(problem_.factory));
  }
  /// The same of windows that tell which simulator is likelier. Where noise is all that they leave, more tell more.
  int TellingRows(int n_steps) const {
    if (problem_.fit.errors_grow) return FreedRows(n_steps);
    return AffordableRows(kTellingRows, kTellingPhysics, problem_.factory, fits_.ReadingsOf(problem_.factory));
  }

  /// x by the shortest windows and those twice as long, their errors taken for noise.
  VectorXd FitShort(WindowReplayer& replayer, const ParameterSpace& space, const Prior& prior,
                    const VectorXd& from) const {
    const VectorXd scale = ChannelScales(fits_.parts().learn);
    const int begins = replayer.readings().ShortestWindow(), n_steps = 2 * begins;
    const auto make = [&](Level windows, VectorXd x) {
      return std::make_unique<LevelFit>(replayer, space, prior, scale, std::move(windows), std::move(x));
    };
    const auto descend = [&](LevelFit& fit, bool is_first) {
      fits_.Descend(fit, is_first ? kFirstIterations : kLaterIterations);
    };
    const std::unique_ptr<LevelFit> fit =
        FitGrowing(GrowingWindows(replayer, fits_.parts().learn, begins, n_steps, kShortRows, fits_.period_s()), from,
                   n_steps, kFewestFreedWindows, make, descend);
    return fit == nullptr ? from : fit->x();
  }

  std::optional<Fitted> Fit(const SimulatorFactory& factory, const Prior& prior, const ReadingModel& readings,
                            const VectorXd& from) const {
    const ParameterSpace& space = factory.parameters();
    WindowReplayer replayer = fits_.Replayer(factory, readings);
    const int told = static_cast<int>(std::lround(kShownSeconds / fits_.period_s()));
    const int n_steps = std::max({std::min(problem_.fit.window, told),
                                  static_cast<int>(std::lround(kShortestLongWindow / fits_.period_s())),
                                  readings.longest_age() + kFewestFreedSteps});
    const VectorXd scale = ChannelScales(fits_.parts().learn);
    // As the design itself: where long windows were taken, x stays where the descent came to; elsewhere windows grow
    // from short ones.
    const bool is_long = problem_.fit.errors_grow;
    const Level level = GrowingWindows(replayer, fits_.parts().learn, is_long ? n_steps : fits_.ShortSteps(), n_steps,
                                       FreedRows(n_steps), fits_.period_s());
    const auto make = [&](Level windows, VectorXd x) {
      auto fit = std::make_unique<LevelFit>(replayer, space, prior, scale, std::move(windows), std::move(x));
      if (is_long) fit->LetErrorsGrow(fits_.noise().cwiseAbs2());
      return fit;
    };
    const auto descend = [&](LevelFit& fit, bool is_first) {
      fits_.Descend(fit, is_first ? kFreedIterations : kJoinedIterations);
    };
    VectorXd x = from;
    if (is_long && space.size() > fits_.x().size() && !level.windows.empty()) {
      // Long windows whose x is far off are soon caught, and short ones come from farther.
      const auto cost_near = [&](const VectorXd& start) {
        const std::unique_ptr<LevelFit> near = make(level, start);
        fits_.Descend(*near, kProbeIterations);
        return near->FinalCost();
      };
      const VectorXd by_short = FitShort(replayer, space, prior, from);
      if (cost_near(by_short) < cost_near(from)) x = by_short;
    }
    const std::unique_ptr<LevelFit> fit = FitGrowing(level, x, n_steps, kFewestFreedWindows, make, descend);
    if (fit == nullptr) return std::nullopt;
    const double cost = fit->FinalCost();
    if (!std::isfinite(cost)) return std::nullopt;
    const MatrixXd covariance = is_long ? fit->CovarianceOfParts() : fit->Finish();
    return Fitted{fit->level().windows.front().n_steps, fit->x(), cost, covariance, fit->noise_variance()};
  }

  struct Likelier {
    Estimated nats;
    TrialCosts costs;
  };

  /// Nats by which windows of the logs become likelier: of those that were kept aside and, where windows are noise's
  /// and those agree, of the others too; of the others alone where fewer than two such windows were kept aside. One
  /// number more cannot follow hundreds of windows, so that these tell as honestly, and they are four times as many.
  /// None where nothing was kept aside, and where the fit without it is of other windows.
  std::optional<Likelier> LikelierWith(const SimulatorFactory& wider, const ReadingModel& readings,
                                       const Fitted& with) {
    if (fits_.LearnsFromAll() || !fitted_without_ || fitted_without_->n_steps != with.n_steps) return std::nullopt;
    const ParameterSpace& space = wider.parameters();
    std::vector<double> nominal = ToZ(problem_.factory.parameters(), fitted_without_->x);
    nominal.push_back(space[space.size() - 1].nominal);
    const bool is_long = problem_.fit.errors_grow;
    const WindowNoise noise{with.variance, is_long ? fits_.noise().cwiseAbs2().eval() : VectorXd()};
    WindowCosts freed, without;
    const auto ask = [&](const Dataset& logs) {
      WindowReplayer replayer = MakeReplayer(wider, logs, readings, problem_.context.n_threads);
      const Level level = GrowingWindows(replayer, logs, is_long ? with.n_steps : fits_.ShortSteps(), with.n_steps,
                                         TellingRows(with.n_steps), fits_.period_s());
      const auto of = [&](const std::vector<double>& z) {
        return CostsOf(replayer, level, with.n_steps, noise, z).parts.front();
      };
      freed.parts.push_back(of(ToZ(space, with.x)));
      without.parts.push_back(of(nominal));
      return *NatsGained(freed, without);
    };
    Estimated nats = ask(fits_.parts().judge);
    const bool can_tell = std::isfinite(nats.error);
    if (!can_tell) freed = without = {};
    if (!can_tell || (!is_long && nats.value > 0)) nats = ask(fits_.parts().learn);
    if (!std::isfinite(nats.error)) return std::nullopt;
    return Likelier{nats, {freed, readings.ages}};
  }

  /// Of what the design found in the part of the logs that learns, and what that part gives in the windows that freed
  /// suspects are fitted to, what predicts better.
  const VectorXd& Without() {
    if (without_) return *without_;
    without_ = fits_.x();
    const ReadingModel readings = fits_.ReadingsOf(problem_.factory);
    fitted_without_ = Fit(problem_.factory, problem_.prior, readings, fits_.x());
    if (!fitted_without_) return *without_;
    const ParameterSpace& space = problem_.factory.parameters();
    const auto prediction = Beside(problem_.factory, readings, ToZ(space, fitted_without_->x), ToZ(space, fits_.x()));
    if (prediction && ToldOf(prediction->horizons).gain.value > 0) without_ = fitted_without_->x;
    return *without_;
  }

  std::optional<HeldOutPrediction> Beside(const SimulatorFactory& factory, const ReadingModel& readings,
                                          const std::vector<double>& z, const std::vector<double>& other) const {
    return PredictBeside({.factory = factory,
                          .kept_aside = fits_.parts().judge,
                          .learned = fits_.LearnsFromAll() ? nullptr : &fits_.parts().learn,
                          .z = z,
                          .noise = fits_.noise(),
                          .readings = readings,
                          .narrow = {},
                          .key = problem_.kept_aside,
                          .n_threads = problem_.context.n_threads},
                         other);
  }

  const FreedProblem& problem_;
  SuspectFits fits_;
  SuspectScreening screening_;
  std::optional<VectorXd> without_;
  std::optional<Fitted> fitted_without_;     ///< in the windows that freed suspects are fitted to
  std::map<std::string, TrialCosts> costs_;  ///< with each suspect that was tried, where they are known
};

/// Of those that were screened, the likeliest first, as many as are named; the first `n` of them are freed.
std::vector<Suspect> TryFirst(const FreedProblem& problem, FreedTrials& trials, ScreenedSuspects screened, int n) {
  std::vector<Suspect> suspects = std::move(screened.suspects);
  suspects.resize(std::min(suspects.size(), std::max(kFewestNamed, static_cast<size_t>(n))));
  const auto n_tried = static_cast<int64_t>(std::min(suspects.size(), static_cast<size_t>(n)));
  for (int64_t k = 0; k < n_tried; ++k) {
    Suspect& suspect = suspects[static_cast<size_t>(k)];
    problem.context.log->Progress("freed", "tried", k, n_tried, suspect.spec.name);
    const auto x = screened.x_with.find(suspect.spec.name);
    const VectorXd* screened_x = x == screened.x_with.end() ? nullptr : &x->second;
    TriedSuspect tried = problem.keeper.Tried(static_cast<int>(k) + 1, [&] { return trials.Try(suspect, screened_x); });
    suspect.trial = std::move(tried.trial);
    trials.Know(suspect.spec.name, tried.costs);
  }
  if (n_tried > 0) problem.context.log->Progress("freed", "tried", n_tried, n_tried, "");
  trials.PutInOrder(std::span(suspects).first(static_cast<size_t>(n_tried)));
  for (Suspect& suspect : suspects) {
    if (suspect.trial) suspect.trial->led_by = trials.LeadersOf(suspect, suspects);
  }
  return suspects;
}

}  // namespace

std::vector<Suspect> TrySuspects(const FreedProblem& problem, int n) {
  if (!(problem.factory.spec().control_period_s > 0)) return {};
  FreedTrials trials(problem);
  return TryFirst(problem, trials, problem.keeper.Screened([&] { return trials.Find(n > 0); }), n);
}

std::vector<Suspect> TryAsked(const FreedProblem& problem, int n) {
  if (problem.fit.asked.empty() || !(problem.factory.spec().control_period_s > 0)) return {};
  FreedTrials trials(problem);
  return TryFirst(problem, trials, {problem.fit.asked, {}}, n);
}

}  // namespace oted
