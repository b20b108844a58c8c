#include "oted/stages/design/trajectories/screening.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "oted/matching/verdict.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/suspect_name.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/distant_values.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/suspects.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr int kScreenedRows = 960;
constexpr double kLongScreenedSeconds = 0.25;
constexpr double kInsideRange = 0.2;  // of the range: where the fit of a value begins that the model has none of
constexpr double kAtRangeTop = 0.9, kWiderRange = 4;  // of a range, and times it
constexpr int kRangeWidenings = 2;
constexpr double kSlowContact = 2;  // times the model's: there, and at its inverse, fits of contacts begin, too
constexpr int kToldOfWindows = 4;   // fitted, all of a kind scored, each alone, at a distance
constexpr const char* kFitted = "windows";
constexpr size_t kMostScreened = 8, kMostLongScreened = 12, kMostOutstanding = 4, kMostDistant = 3;

/// One that no score favours, and where its fit begins.
Suspect Undirected(const ParameterSpec& spec) {
  const double inside = spec.low + kInsideRange * (spec.high - spec.low);
  return {.spec = spec, .value = IsAtLowEnd(spec) ? inside : spec.nominal};
}

/// Whether the fit of a value that the model has next to none of ended where its range does: how much there may be of a
/// friction, say, the model tells roughly.
bool EndsAtTop(const Suspect& suspect) {
  const ParameterSpec& spec = suspect.spec;
  return !spec.IsMultiple() && spec.low == 0 && !IsChannelPath(spec.field) && suspect.value > kAtRangeTop * spec.high;
}

/// Whether it is how late a sensor is.
bool IsLag(const ParameterSpec& spec) { return spec.field.starts_with("obs/") && spec.nominal == spec.low; }

/// That of `suspects` which is `one`; null where it is not among them.
const Suspect* FindIn(const std::vector<Suspect>& suspects, const Suspect& one) {
  const auto found = std::ranges::find_if(suspects, [&](const Suspect& s) { return s.spec.field == one.spec.field; });
  return found == suspects.end() ? nullptr : &*found;
}

/// Where its fit begins, beside where its score says: where it was found at a distance; of how stiff or damped contacts
/// are, far from the model, as starts that were found by a wrong one hold the fit near it.
/// @param distant  null where it was not
std::vector<double> OtherBeginnings(const ParameterSpec& spec, const Suspect* distant) {
  if (distant != nullptr) return {distant->value};
  const bool is_contact = spec.field.starts_with("geom/") && spec.field.find("/solref[") != std::string::npos;
  if (spec.IsMultiple() && is_contact) return {1 / kSlowContact, kSlowContact};
  return {};
}

/// Of what "body/foot/mass" and "body/leg/mass + body/leg/inertia" are: "body", "mass".
std::pair<std::string, std::string> KindOf(const Suspect& suspect) {
  const std::string path = TiedPaths(suspect.spec.field).front();
  return {path.substr(0, path.find('/')), path.substr(path.rfind('/') + 1)};
}

/// As no score tells them apart, one of a kind.
void AddUndirected(std::span<const Suspect> undirected, std::vector<Suspect>& suspects) {
  std::set<std::pair<std::string, std::string>> kinds;
  for (const Suspect& suspect : undirected) {
    if (kinds.insert(KindOf(suspect)).second) suspects.push_back(Undirected(suspect.spec));
  }
}

}  // namespace

/// The surest first.
struct SuspectScreening::Scored {
  std::vector<Suspect> wholes, parts;

  /// Those that stand out: favoured, and by half as much at least as the surest of all, or by `sure` nats. There are
  /// many parts, and of many some seem likely by chance.
  std::vector<Suspect> Outstanding(double sure = std::numeric_limits<double>::infinity()) const {
    std::vector<Suspect> all = wholes;
    all.insert(all.end(), parts.begin(), parts.end());
    std::ranges::stable_sort(all, std::ranges::greater(), &Suspect::explains);
    std::erase_if(all, [least = all.empty() ? 0 : std::min(all.front().explains / 2, sure)](const Suspect& suspect) {
      return !IsDirected(suspect) || suspect.explains < least;
    });
    return FirstApart(all, kMostOutstanding);
  }
};

/// That suspects are screened by.
struct SuspectScreening::Windows {
  int n_steps, n_rows, n_iterations;
  size_t n_asked;  ///< suspects, at most
  bool errors_grow;
  bool asks_all;   ///< no score is sure: suspects without one are fitted as well
  int begins = 0;  ///< they grow from so many steps; 0: they do not
};

/// The parameters, fitted to windows of the logs that learn.
class SuspectScreening::Fit {
 public:
  // A sensor that may lag shows the state itself at a window's start: all fits hold the same readings.
  Fit(const SuspectFits& fits, const Windows& by) : Fit(fits, by, fits.ReadingsOf(fits.problem().factory)) {}
  Fit(const SuspectFits& fits, const Windows& by, ReadingModel readings)
      : fits_(fits),
        by_(by),
        readings_(std::move(readings)),
        alone_(fits.Replayer(fits.problem().factory, readings_)),
        scale_(ChannelScales(fits.parts().learn)) {
    const FreedProblem& problem = fits.problem();
    const auto make = [&](Level windows, VectorXd x) {
      return std::make_unique<LevelFit>(alone_, problem.factory.parameters(), problem.prior, scale_, std::move(windows),
                                        std::move(x));
    };
    const int begins = by.begins > 0 ? by.begins : by.n_steps;
    fit_ = FitGrowing(GrowingWindows(alone_, fits.parts().learn, begins, by.n_steps, by.n_rows, fits.period_s()),
                      fits.x(), by.n_steps, kFewestFreedWindows, make, [this](LevelFit& fit, bool) { Descend(fit); });
    if (fit_ == nullptr) return;
    fit_->FinalCost();
    // Fits with a suspect go on from here: what as many steps gain without one no suspect explains.
    const std::unique_ptr<LevelFit> without = make(fit_->level(), fit_->x());
    Descend(*without);
    cost_ = without->FinalCost();
  }

  /// Whether there are windows enough.
  explicit operator bool() const { return fit_ != nullptr; }
  const LevelFit& operator*() const { return *fit_; }
  const ReadingModel& readings() const { return readings_; }

  /// The same windows, fitted with the suspect as well, from where it stands and from `values`. Where it is a sensor's
  /// lag, fits with it and without leave out what tells of the time before a window.
  /// @return x and the suspect's coordinate; value and nats go to the suspect
  VectorXd With(Suspect& suspect, std::vector<double> values = {}) const {
    const std::unique_ptr<SimulatorFactory> wider = fits_.problem().factory.With({suspect.spec});
    if (std::ranges::find(values, suspect.value) == values.end()) values.push_back(suspect.value);
    // A sensor that is late by rows is far from one that is late by a part of one.
    if (const double inside = Undirected(suspect.spec).value; IsLag(suspect.spec) && suspect.value != inside) {
      values.push_back(inside);
    }
    ReadingModel readings = fits_.ReadingsOf(*wider);
    if (readings.ages == readings_.ages) return With(suspect, *wider, values);
    const Fit of_later(fits_, by_, std::move(readings));
    return of_later ? of_later.With(suspect, *wider, values) : With(suspect, *wider, values);
  }

 private:
  VectorXd With(Suspect& suspect, const SimulatorFactory& wider, const std::vector<double>& values) const {
    WindowReplayer replayer = fits_.Replayer(wider, readings_);
    const Prior prior = fits_.PriorIn(wider.parameters());
    VectorXd best;
    suspect.explains = -std::numeric_limits<double>::infinity();
    for (const double value : values) {
      LevelFit with(replayer, wider.parameters(), prior, scale_, fit_->level(),
                    SuspectFits::StartOf(wider, fit_->x(), value));
      Descend(with);
      const double explains = cost_ - with.FinalCost();
      if (best.size() > 0 && !(explains > suspect.explains)) continue;
      best = with.x();
      suspect.explains = explains;
      suspect.value = ToZ(wider.parameters(), best).back();
    }
    return best;
  }

  void Descend(LevelFit& fit) const {
    if (by_.errors_grow) fit.LetErrorsGrow(fits_.noise().cwiseAbs2());
    fits_.Descend(fit, by_.n_iterations);
  }

  const SuspectFits& fits_;
  Windows by_;
  ReadingModel readings_;
  WindowReplayer alone_;
  VectorXd scale_;
  std::unique_ptr<LevelFit> fit_;
  double cost_ = 0;
};

SuspectScreening::Windows SuspectScreening::ShortWindows() const {
  return {fits_.ShortSteps(), kScreenedRows, kFirstIterations, kMostScreened, false, false};
}

/// As long as the design's, up to a quarter second: where noise hides in short ones what adds up.
SuspectScreening::Windows SuspectScreening::GrownWindows() const {
  const int longest = static_cast<int>(std::lround(kLongScreenedSeconds / fits_.period_s()));
  return {std::min(fits_.problem().fit.window, longest),
          kFreedRows,
          kFirstIterations,
          kMostLongScreened,
          false,
          true,
          fits_.ShortSteps()};
}

SuspectScreening::Windows SuspectScreening::LongWindows() const {
  const int longest = static_cast<int>(std::lround(kLongScreenedSeconds / fits_.period_s()));
  const int n_steps = std::max(std::min(fits_.problem().fit.window, longest),
                               fits_.ReadingsOf(fits_.problem().factory).longest_age() + kFewestFreedSteps);
  return {n_steps, std::max(kScreenedRows, kFewestLongWindows * n_steps), kLaterIterations, kMostLongScreened, true,
          true};
}

void SuspectScreening::Tell(const char* what) {
  fits_.problem().context.log->Progress("suspects", "scored", n_told_++, n_to_tell_, what);
}

ScreenedSuspects SuspectScreening::Find(bool thoroughly) {
  std::vector<Suspect> found = FindAll(thoroughly);
  return {std::move(found), std::move(fitted_)};
}

std::vector<Suspect> SuspectScreening::FindAll(bool thoroughly) {
  if (fits_.problem().factory.Suspects().empty()) return {};
  n_to_tell_ = kToldOfWindows;
  if (fits_.problem().fit.errors_grow) {
    n_to_tell_ *= 2;
    // On clean logs short windows tell what long ones, over which effects bend, do not.
    Tell(kFitted);
    const Fit brief(fits_, ShortWindows());
    return FindBy(LongWindows(), brief ? Score(brief).Outstanding(kFewestSureNats) : std::vector<Suspect>());
  }
  std::vector<Suspect> found = FindBy(ShortWindows());
  if (!found.empty() || !thoroughly) return found;
  n_to_tell_ = n_told_ + kToldOfWindows;
  return FindBy(GrownWindows());
}

/// @param outstanding  by other windows: fitted as well
std::vector<Suspect> SuspectScreening::FindBy(const Windows& by, const std::vector<Suspect>& outstanding) {
  Tell(kFitted);
  const Fit fit(fits_, by);
  if (!fit) return {};
  Scored scored = Score(fit);
  const auto undirected = std::ranges::stable_partition(scored.wholes, IsDirected);
  std::vector<Suspect> favoured(scored.wholes.begin(), undirected.begin());
  if (by.asks_all) AddUndirected(undirected, favoured);
  std::vector<Suspect> suspects = FirstApart(favoured, by.n_asked);
  const std::vector<Suspect> distant = FindDistantSuspects(fit);
  for (const auto& more : {scored.Outstanding(), outstanding, FirstApart(distant, kMostDistant)}) {
    for (const Suspect& suspect : more) {
      if (FindIn(suspects, suspect) == nullptr) suspects.push_back(suspect);
    }
  }
  const auto n_asked = static_cast<int64_t>(suspects.size());
  const auto tell = [&](int64_t n_done, const Suspect& suspect) {
    fits_.problem().context.log->Progress("suspects", "asked", n_done, n_asked, suspect.spec.name);
  };
  for (int64_t k = 0; k < n_asked; ++k) {
    Suspect& suspect = suspects[static_cast<size_t>(k)];
    tell(k, suspect);
    VectorXd& fitted = fitted_[suspect.spec.name];
    fitted = fit.With(suspect, OtherBeginnings(suspect.spec, FindIn(distant, suspect)));
    for (int n = 0; n < kRangeWidenings && EndsAtTop(suspect); ++n) {
      suspect.spec.high *= kWiderRange;
      fitted = fit.With(suspect);
    }
  }
  if (n_asked > 0) tell(n_asked, suspects.back());
  std::ranges::stable_sort(suspects, std::ranges::greater(), &Suspect::explains);
  std::erase_if(suspects,
                [](const Suspect& s) { return !(s.explains > kFewestSureNats) || !IsNoticeable(s.spec, s.value); });
  return suspects;
}

std::vector<Suspect> SuspectScreening::FindDistantSuspects(const Fit& fit) {
  const SimulatorFactory& factory = fits_.problem().factory;
  std::vector<ParameterSpec> specs;
  for (const ParameterSpec& suspect : factory.Suspects()) {
    if (!IsDistant(suspect)) continue;
    specs.push_back(suspect);
    std::ranges::move(factory.PartsOf(suspect), std::back_inserter(specs));
  }
  NameApart(specs, factory.parameters());
  const std::unique_ptr<SimulatorFactory> wide = specs.empty() ? nullptr : factory.With(specs);
  if (wide == nullptr) return {};
  Tell("where things stand, and what drives can do");
  WindowReplayer with_distant = fits_.Replayer(*wide, fit.readings());
  return FindDistant(specs, *fit, with_distant);
}

/// Each suspect and, where it is of several joints, drives, tendons or bodies, each of these alone.
SuspectScreening::Scored SuspectScreening::Score(const Fit& fit) {
  const SimulatorFactory& factory = fits_.problem().factory;
  Scored scored;
  const auto score = [&](std::vector<ParameterSpec> specs, std::vector<Suspect>& into) {
    std::erase_if(specs, [&](const ParameterSpec& spec) { return IsOfReadingsLeftOut(spec, fit.readings()); });
    const std::unique_ptr<SimulatorFactory> wide = specs.empty() ? nullptr : factory.With(specs);
    if (wide == nullptr) return;
    WindowReplayer every = fits_.Replayer(*wide, fit.readings());
    for (Suspect& suspect : ScoreSuspects(specs, *fit, every, fits_.problem().prior)) {
      // A part of what is searched is one of many parts, too.
      (suspect.spec.MultipliesOthers() ? scored.parts : into).push_back(std::move(suspect));
    }
  };
  const std::vector<ParameterSpec> wholes = factory.Suspects();
  Tell("all joints, drives and bodies");
  score(wholes, scored.wholes);
  Tell("each alone");
  std::vector<ParameterSpec> parts;
  for (const ParameterSpec& whole : wholes) std::ranges::move(factory.PartsOf(whole), std::back_inserter(parts));
  NameApart(parts, factory.parameters(), wholes);
  score(parts, scored.parts);
  std::ranges::stable_sort(scored.wholes, std::ranges::greater(), &Suspect::explains);
  std::ranges::stable_sort(scored.parts, std::ranges::greater(), &Suspect::explains);
  return scored;
}

/// Whether it acts on readings alone that the fit leaves out: nothing tells of it.
bool SuspectScreening::IsOfReadingsLeftOut(const ParameterSpec& spec, const ReadingModel& readings) const {
  if (!IsChannelPath(spec.field)) return false;
  const ChannelField field = ResolveChannel(fits_.problem().factory.spec(), spec.field);
  return field.quantity != ChannelQuantity::kActionDelay &&
         std::ranges::all_of(field.channels, [&](int c) { return readings.computed[static_cast<size_t>(c)] != 0; });
}

}  // namespace oted
