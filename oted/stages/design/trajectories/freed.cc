#include "oted/stages/design/trajectories/freed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "oted/matching/designer.h"
#include "oted/matching/verdict.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/replay/prediction_evidence.h"
#include "oted/stages/design/replay/reading_model.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/long_windows.h"
#include "oted/stages/design/trajectories/suspects.h"
#include "oted/stages/design/trajectories/unseen_likelihood.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFreedRows = 1600;           // of the windows that are fitted
constexpr double kFreedPhysics = 1.5e5;    // steps of a linearization of them
constexpr int kTellingRows = 4800;         // of the windows that tell which is likelier: their starts alone are fitted
constexpr double kTellingPhysics = 4.5e5;  // steps, as above
constexpr int kFreedIterations = 24, kJoinedIterations = 10, kProbeIterations = 3;
constexpr int kFewestFreedWindows = 4, kFewestFreedSteps = 4;
constexpr double kLargestStartX = 4.5;  // of what is freed: a start on a bound would hardly move
constexpr double kShownSeconds = 0.5;
constexpr int kScreenedRows = 960, kShortRows = 480, kScreenedIterations = 12;
constexpr double kLongScreenedSeconds = 0.25;
constexpr double kInsideRange = 0.2;  // of the range: where the fit of a value begins whose nominal one is its bound
constexpr int kFewestLongWindows = 16, kLongScreenedIterations = 6;
constexpr int kFewestScreenedSteps = 4, kMostScreenedSteps = 8;
constexpr double kScreenedSeconds = 0.06;
constexpr size_t kMostScreened = 8, kMostLongScreened = 12, kFewestNamed = 3;
constexpr double kNoWorse = 2.0;  // nats: the prior of one parameter more

struct Fitted {
  int n_steps;  // of the windows
  VectorXd x;
  double cost = 0;
  MatrixXd covariance;
  VectorXd variance;  // of the sensors' noise
};

class FreedTrials {
 public:
  explicit FreedTrials(const FreedProblem& problem)
      : problem_(problem),
        period_(problem.factory.spec().control_period_s),
        noise_(Eigen::Map<const VectorXd>(problem.fit.short_noise_std.data(),
                                          static_cast<Eigen::Index>(problem.fit.short_noise_std.size()))),
        parts_(KeepAside(problem.dataset, period_, problem.kept_aside)) {
    const bool has_unseen = problem.fit.unseen && !problem.fit.unseen->z.empty();
    const std::vector<double> x =
        ZToLogit(problem.factory.parameters(), has_unseen ? problem.fit.unseen->z : problem.z);
    x_ = Eigen::Map<const VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
  }

  /// The likeliest first. Where long windows took the place of short ones, those tell of little but noise.
  /// @param thoroughly  as TrySuspects has it
  std::vector<Suspect> Find(bool thoroughly) {
    if (problem_.fit.errors_grow) return FindBy(LongScreening());
    std::vector<Suspect> found = FindBy(ShortScreening());
    return found.empty() && thoroughly ? FindBy(GrownScreening()) : found;
  }

  std::optional<FreedTrial> Try(const Suspect& suspect) {
    const std::unique_ptr<SimulatorFactory> wider = problem_.factory.With({suspect.spec});
    if (wider == nullptr) return std::nullopt;
    const ParameterSpace& space = wider->parameters();
    const VectorXd x = Without();
    std::vector<double> before = ToZ(problem_.factory.parameters(), x);
    before.push_back(space[space.size() - 1].nominal);
    const Prior prior = PriorIn(space);
    const ReadingModel readings = ReadingsOf(*wider);
    std::optional<Fitted> best;
    std::vector<VectorXd> starts = {StartOf(*wider, x, suspect.value), StartOf(*wider, x, before.back())};
    // The other parameters have moved with it there.
    const auto screened = screened_.find(suspect.spec.name);
    if (screened != screened_.end()) starts.front() = screened->second;
    for (const VectorXd& start : starts) {
      if (best && !IsCaught(*best)) break;
      std::optional<Fitted> fitted = Fit(*wider, prior, readings, start);
      if (fitted && (!best || fitted->cost < best->cost)) best = std::move(fitted);
    }
    if (!best) return std::nullopt;
    const Designer q(space, best->x, best->covariance);
    const auto prediction = Beside(*wider, readings, q.Mode(), before);
    if (!prediction) return std::nullopt;
    const HeldOutPrediction::Horizon& told = ToldOf(prediction->horizons);
    const std::optional<Estimated> nats = NatsOf(suspect, *wider, readings, *best);
    const bool predicts_better = PredictsBetter(*prediction) && told.gain.value > kSureErrors * told.gain.error;
    // Likelier windows of real logs may go with worse predictions of other motions: there the error has to fall.
    const bool is_no_worse = !PredictsWorse(*prediction) && (!problem_.fit.errors_grow || told.gain.value > 0);
    // At an end of its range it stands in for something else. And what leaves another one at its bound is not what put
    // it there.
    const double value = q.Mode().back();
    const bool is_at_bound = EndsAtBound(space[space.size() - 1], value, value) || !ParametersAtBounds(q).empty();
    FreedTrial trial{.value = value,
                     .std = q.Std().back(),
                     .intervals90 = q.CentralInterval(kIntervalMass),
                     .kept = false,
                     .seconds = told.seconds,
                     .n_steps = told.n_steps,
                     .n_windows = told.n_windows,
                     .learned = told.learned || LearnsFromAll(),
                     .gain = told.gain,
                     .nats = nats,
                     .led_by = {},
                     .before = {},
                     .after = {}};
    trial.kept = !is_at_bound && (predicts_better || (IsLikelier(trial) && is_no_worse));
    trial.intervals90.pop_back();  // of what was freed
    for (const HeldOutPrediction::Channel& channel : told.channels) {
      trial.before.push_back(channel.nominal);
      trial.after.push_back(channel.designed);
    }
    return trial;
  }

  /// Names, of those that were tried, which surely lead this one (FreedTrial::led_by).
  std::vector<std::string> LeadersOf(const Suspect& one, const std::vector<Suspect>& suspects) const {
    std::vector<std::string> leaders;
    for (const Suspect& other : suspects) {
      if (!other.trial || other.spec.name == one.spec.name) continue;
      const Estimated lead = LeadOf(other, one);
      if (lead.value > kSureErrors * lead.error) leaders.push_back(other.spec.name);
    }
    return leaders;
  }

 private:
  /// By how many nats one of two that were tried makes the same windows likelier than the other, each by the noise that
  /// it leaves; or by how much more it gains, where that is not known of both.
  Estimated LeadOf(const Suspect& one, const Suspect& other) const {
    const auto ours = costs_.find(one.spec.name), theirs = costs_.find(other.spec.name);
    if (ours != costs_.end() && theirs != costs_.end()) {
      if (const std::optional<Estimated> nats = NatsGained(ours->second, theirs->second)) return *nats;
    }
    const Estimated &a = one.trial->gain, &b = other.trial->gain;
    return {.value = a.value - b.value, .error = std::hypot(a.error, b.error)};
  }

  /// Whether a fit with one parameter more ends above the fit without it, where it could be as well.
  bool IsCaught(const Fitted& with) const {
    return !fitted_without_ || with.n_steps != fitted_without_->n_steps || with.cost > fitted_without_->cost + kNoWorse;
  }

  bool LearnsFromAll() const { return parts_.judge.size() == problem_.dataset.size(); }

  ReadingModel ReadingsOf(const SimulatorFactory& factory) const {
    return ::oted::ReadingsOf(factory.spec(), problem_.dataset, problem_.fit.unseen);
  }

  /// The windows that suspects are screened by.
  struct Screening {
    int n_steps, n_rows, n_iterations;
    bool errors_grow;
    bool asks_all;   ///< no score is sure: suspects without one are fitted as well
    int begins = 0;  ///< the windows grow from so many steps; 0: they do not
  };

  Screening ShortScreening() const {
    const int n_steps = std::max(ReadingsOf(problem_.factory).ShortestWindow(),
                                 std::clamp(static_cast<int>(std::lround(kScreenedSeconds / period_)),
                                            kFewestScreenedSteps, kMostScreenedSteps));
    return {n_steps, kScreenedRows, kScreenedIterations, false, false};
  }

  /// Windows as long as the design's, up to a quarter second: where noise hides in short ones what adds up.
  Screening GrownScreening() const {
    Screening grown = ShortScreening();
    grown.begins = grown.n_steps;
    grown.n_steps = std::min(problem_.fit.window, static_cast<int>(std::lround(kLongScreenedSeconds / period_)));
    grown.n_rows = kFreedRows;
    grown.asks_all = true;
    return grown;
  }

  Screening LongScreening() const {
    const int longest = static_cast<int>(std::lround(kLongScreenedSeconds / period_));
    const int n_steps = std::max(std::min(problem_.fit.window, longest),
                                 ReadingsOf(problem_.factory).longest_age() + kFewestFreedSteps);
    return {n_steps, std::max(kScreenedRows, kFewestLongWindows * n_steps), kLongScreenedIterations, true, true};
  }

  std::vector<Suspect> FindBy(const Screening& by) {
    // A sensor that may lag shows the state itself at a window's start: all fits hold the same readings.
    const ReadingModel readings = ReadingsOf(problem_.factory);
    std::vector<ParameterSpec> specs = problem_.factory.Suspects();
    std::erase_if(specs, [&](const ParameterSpec& spec) { return IsOfReadingsLeftOut(spec, readings); });
    const std::unique_ptr<SimulatorFactory> wide = specs.empty() ? nullptr : problem_.factory.With(specs);
    if (wide == nullptr) return {};
    WindowReplayer every = Replayer(*wide, readings), alone = Replayer(problem_.factory, readings);
    const VectorXd scale = ChannelScales(parts_.learn);
    const auto make = [&](Level windows, VectorXd x) {
      return std::make_unique<LevelFit>(alone, problem_.factory.parameters(), problem_.prior, scale, std::move(windows),
                                        std::move(x));
    };
    const auto descend = [&](LevelFit& fit, bool) {
      if (by.errors_grow) fit.LetErrorsGrow(noise_.cwiseAbs2());
      Descend(fit, by.n_iterations);
    };
    const int begins = by.begins > 0 ? by.begins : by.n_steps;
    const std::unique_ptr<LevelFit> grown =
        FitGrowing(GrowingWindows(every, parts_.learn, begins, by.n_steps, by.n_rows, period_), x_, by.n_steps,
                   kFewestFreedWindows, make, descend);
    if (grown == nullptr) return {};
    LevelFit& fit = *grown;
    const double cost = fit.FinalCost();
    auto [suspects, undirected] = ScoreSuspects(specs, fit, every, problem_.prior);
    if (by.asks_all) {
      for (const ParameterSpec& spec : undirected) suspects.push_back(Undirected(spec));
    }
    suspects.resize(std::min(suspects.size(), by.asks_all ? kMostLongScreened : kMostScreened));
    for (size_t k = 0; k < suspects.size(); ++k) {
      Suspect& suspect = suspects[k];
      problem_.context.log->Progress("suspects", "asked", static_cast<int64_t>(k),
                                     static_cast<int64_t>(suspects.size()), suspect.spec.name);
      const std::unique_ptr<SimulatorFactory> wider = problem_.factory.With({suspect.spec});
      WindowReplayer replayer = Replayer(*wider, readings);
      const Prior prior = PriorIn(wider->parameters());
      LevelFit with(replayer, wider->parameters(), prior, scale, fit.level(), StartOf(*wider, fit.x(), suspect.value));
      descend(with, true);
      suspect.explains = cost - with.FinalCost();
      suspect.value = ToZ(wider->parameters(), with.x()).back();
      screened_[suspect.spec.name] = with.x();
    }
    const auto n_asked = static_cast<int64_t>(suspects.size());
    if (n_asked > 0) {
      problem_.context.log->Progress("suspects", "asked", n_asked, n_asked, suspects.back().spec.name);
    }
    std::erase_if(suspects,
                  [](const Suspect& s) { return !(s.explains > kFewestSureNats) || !IsNoticeable(s.spec, s.value); });
    std::ranges::stable_sort(suspects, [](const Suspect& a, const Suspect& b) { return a.explains > b.explains; });
    return suspects;
  }

  /// Whether it acts on readings alone that the fit leaves out: nothing tells of it.
  bool IsOfReadingsLeftOut(const ParameterSpec& spec, const ReadingModel& readings) const {
    if (!IsChannelPath(spec.field)) return false;
    const ChannelField field = ResolveChannel(problem_.factory.spec(), spec.field);
    return field.quantity != ChannelQuantity::kActionDelay && std::ranges::all_of(field.observations, [&](int c) {
             return readings.computed[static_cast<size_t>(c)] != 0;
           });
  }

  /// One that no score favours, and where its fit begins.
  static Suspect Undirected(const ParameterSpec& spec) {
    const bool at_bound = spec.nominal == spec.low;
    return {.spec = spec, .value = at_bound ? spec.low + kInsideRange * (spec.high - spec.low) : spec.nominal};
  }

  /// Rows of so long windows: what makes enough of them, and what the physics affords.
  int FreedRows(int n_steps) const {
    const int enough = problem_.fit.errors_grow ? std::max(kFreedRows, kFewestLongWindows * n_steps) : kFreedRows;
    return AffordableRows(enough, kFreedPhysics, problem_.factory, ReadingsOf(problem_.factory));
  }
  /// The same of windows that tell which simulator is likelier. Where noise is all that they leave, more tell more.
  int TellingRows(int n_steps) const {
    if (problem_.fit.errors_grow) return FreedRows(n_steps);
    return AffordableRows(kTellingRows, kTellingPhysics, problem_.factory, ReadingsOf(problem_.factory));
  }

  /// x, and behind it what a further parameter of this value has.
  static VectorXd StartOf(const SimulatorFactory& wider, const VectorXd& x, double value) {
    const ParameterSpace& space = wider.parameters();
    std::vector<double> z = space.Nominal();
    z.back() = value;
    VectorXd start(x.size() + 1);
    start << x, std::clamp(ZToLogit(space, z).back(), -kLargestStartX, kLargestStartX);
    return start;
  }

  /// Of x and of the further parameter, which has the prior of those that are searched.
  Prior PriorIn(const ParameterSpace& space) const {
    const Prior of_nominal = ForTrajectories(Prior::Uniform(space.size()), space);
    return WithOneMore(problem_.prior, of_nominal.mean[space.size() - 1]);
  }

  WindowReplayer Replayer(const SimulatorFactory& factory, const ReadingModel& readings) const {
    return MakeReplayer(factory, factory.parameters().size(), parts_.learn, readings, problem_.context.n_threads);
  }

  void Descend(LevelFit& fit, int n_iterations) const {
    fit.Descend(n_iterations, [&](const VectorXd&) { problem_.context.ThrowIfStopped(); });
  }

  /// x by the shortest windows and those twice as long, their errors taken for noise.
  VectorXd FitShort(WindowReplayer& replayer, const ParameterSpace& space, const Prior& prior,
                    const VectorXd& from) const {
    const VectorXd scale = ChannelScales(parts_.learn);
    const int begins = replayer.readings().ShortestWindow(), n_steps = 2 * begins;
    const auto make = [&](Level windows, VectorXd x) {
      return std::make_unique<LevelFit>(replayer, space, prior, scale, std::move(windows), std::move(x));
    };
    const auto descend = [&](LevelFit& fit, bool is_first) {
      Descend(fit, is_first ? kScreenedIterations : kLongScreenedIterations);
    };
    const std::unique_ptr<LevelFit> fit =
        FitGrowing(GrowingWindows(replayer, parts_.learn, begins, n_steps, kShortRows, period_), from, n_steps,
                   kFewestFreedWindows, make, descend);
    return fit == nullptr ? from : fit->x();
  }

  std::optional<Fitted> Fit(const SimulatorFactory& factory, const Prior& prior, const ReadingModel& readings,
                            const VectorXd& from) const {
    const ParameterSpace& space = factory.parameters();
    WindowReplayer replayer = Replayer(factory, readings);
    const int told = static_cast<int>(std::lround(kShownSeconds / period_));
    const int n_steps =
        std::max({std::min(problem_.fit.window, told), static_cast<int>(std::lround(kShortestLongWindow / period_)),
                  readings.longest_age() + kFewestFreedSteps});
    const VectorXd scale = ChannelScales(parts_.learn);
    // As the design itself: where long windows were taken, x stays where the descent came to; elsewhere windows grow
    // from short ones.
    const bool is_long = problem_.fit.errors_grow;
    const Level level = GrowingWindows(replayer, parts_.learn, is_long ? n_steps : ShortScreening().n_steps, n_steps,
                                       FreedRows(n_steps), period_);
    const auto make = [&](Level windows, VectorXd x) {
      auto fit = std::make_unique<LevelFit>(replayer, space, prior, scale, std::move(windows), std::move(x));
      if (is_long) fit->LetErrorsGrow(noise_.cwiseAbs2());
      return fit;
    };
    const auto descend = [&](LevelFit& fit, bool is_first) {
      Descend(fit, is_first ? kFreedIterations : kJoinedIterations);
    };
    VectorXd x = from;
    if (is_long && space.size() > x_.size() && !level.windows.empty()) {
      // Long windows whose x is far off are soon caught, and short ones come from farther.
      const auto cost_near = [&](const VectorXd& start) {
        const std::unique_ptr<LevelFit> near = make(level, start);
        Descend(*near, kProbeIterations);
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

  /// Nats by which windows of the logs become likelier: of those that were kept aside and, where windows are noise's
  /// and those agree, of the others too. One number more cannot follow hundreds of windows, so that these tell as
  /// honestly, and they are four times as many. None where nothing was kept aside, and where the fit without it is of
  /// other windows.
  std::optional<Estimated> NatsOf(const Suspect& suspect, const SimulatorFactory& wider, const ReadingModel& readings,
                                  const Fitted& with) {
    if (LearnsFromAll() || !fitted_without_ || fitted_without_->n_steps != with.n_steps) return std::nullopt;
    const ParameterSpace& space = wider.parameters();
    std::vector<double> nominal = ToZ(problem_.factory.parameters(), fitted_without_->x);
    nominal.push_back(space[space.size() - 1].nominal);
    const bool is_long = problem_.fit.errors_grow;
    const WindowNoise noise{with.variance, is_long ? noise_.cwiseAbs2().eval() : VectorXd()};
    WindowCosts freed, without;
    const auto ask = [&](const Dataset& logs) {
      WindowReplayer replayer = MakeReplayer(wider, 0, logs, readings, problem_.context.n_threads);
      const Level level = GrowingWindows(replayer, logs, is_long ? with.n_steps : ShortScreening().n_steps,
                                         with.n_steps, TellingRows(with.n_steps), period_);
      const auto of = [&](const std::vector<double>& z) {
        return CostsOf(replayer, level, with.n_steps, noise, z).parts.front();
      };
      freed.parts.push_back(of(ToZ(space, with.x)));
      without.parts.push_back(of(nominal));
      return *NatsGained(freed, without);
    };
    Estimated nats = ask(parts_.judge);
    if (!std::isfinite(nats.error)) return std::nullopt;
    if (!is_long && nats.value > 0) nats = ask(parts_.learn);
    costs_[suspect.spec.name] = freed;
    return nats;
  }

  /// Of what the design found in the part of the logs that learns, and what that part gives in the windows that freed
  /// suspects are fitted to, what predicts better.
  const VectorXd& Without() {
    if (without_) return *without_;
    without_ = x_;
    const ReadingModel readings = ReadingsOf(problem_.factory);
    fitted_without_ = Fit(problem_.factory, problem_.prior, readings, x_);
    if (!fitted_without_) return *without_;
    const ParameterSpace& space = problem_.factory.parameters();
    const auto prediction = Beside(problem_.factory, readings, ToZ(space, fitted_without_->x), ToZ(space, x_));
    if (prediction && ToldOf(prediction->horizons).gain.value > 0) without_ = fitted_without_->x;
    return *without_;
  }

  std::optional<HeldOutPrediction> Beside(const SimulatorFactory& factory, const ReadingModel& readings,
                                          const std::vector<double>& z, const std::vector<double>& other) const {
    return PredictBeside({.factory = factory,
                          .kept_aside = parts_.judge,
                          .learned = LearnsFromAll() ? nullptr : &parts_.learn,
                          .z = z,
                          .noise = noise_,
                          .readings = readings,
                          .narrow = {},
                          .key = problem_.kept_aside,
                          .n_threads = problem_.context.n_threads},
                         other);
  }

  const FreedProblem& problem_;
  double period_;
  VectorXd noise_;
  HeldOutParts parts_;
  VectorXd x_;                                ///< what the design found without the part that judges
  std::map<std::string, VectorXd> screened_;  ///< what short windows gave with each suspect
  std::optional<VectorXd> without_;
  std::optional<Fitted> fitted_without_;      ///< in the windows that freed suspects are fitted to
  std::map<std::string, WindowCosts> costs_;  ///< with each suspect that was tried, where they are known
};

/// Of `suspects`, the likeliest first, as many as are named; the first `n` of them are freed.
std::vector<Suspect> TryFirst(const FreedProblem& problem, FreedTrials& trials, std::vector<Suspect> suspects, int n) {
  suspects.resize(std::min(suspects.size(), std::max(kFewestNamed, static_cast<size_t>(n))));
  const auto n_tried = static_cast<int64_t>(std::min(suspects.size(), static_cast<size_t>(n)));
  for (int64_t k = 0; k < n_tried; ++k) {
    Suspect& suspect = suspects[static_cast<size_t>(k)];
    problem.context.log->Progress("freed", "tried", k, n_tried, suspect.spec.name);
    suspect.trial = trials.Try(suspect);
  }
  if (n_tried > 0) problem.context.log->Progress("freed", "tried", n_tried, n_tried, "");
  for (Suspect& suspect : suspects) {
    if (suspect.trial) suspect.trial->led_by = trials.LeadersOf(suspect, suspects);
  }
  return suspects;
}

}  // namespace

std::vector<Suspect> TrySuspects(const FreedProblem& problem, int n) {
  if (!(problem.factory.spec().control_period_s > 0)) return {};
  FreedTrials trials(problem);
  return TryFirst(problem, trials, trials.Find(n > 0), n);
}

std::vector<Suspect> TryAsked(const FreedProblem& problem, int n) {
  if (problem.fit.asked.empty() || !(problem.factory.spec().control_period_s > 0)) return {};
  FreedTrials trials(problem);
  return TryFirst(problem, trials, problem.fit.asked, n);
}

}  // namespace oted
