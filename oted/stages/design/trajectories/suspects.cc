#include "oted/stages/design/trajectories/suspects.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "oted/matching/verdict.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/distant_values.h"
#include "oted/stages/design/trajectories/stretch_estimate.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDirected = 2.0;      // standard deviations
constexpr double kAsked = 3.0;         // the same, where some thirty are asked at once: few are by chance
constexpr double kSurelyAsked = 5.0;   // the same, of what may be too little to be noticed
constexpr double kSuspectStep = 0.02;  // of the logarithm of a multiple, of the range of a value
constexpr double kLimitStep = -0.7;    // of a limit, to half of it: nothing tells of one that is not reached
constexpr int kStepRows = 240, kRefutingRows = 960;
constexpr double kStepOfStd = 0.5, kShortestStep = 1e-4, kSmallestSine = 1e-3;
constexpr double kNoticeableLog = 0.1, kNoticeableLength = 0.02, kNoticeableScale = 0.01, kNoticeableShare = 0.02;
constexpr double kNoticeableLoad = 0.005;  // of the range: some hundredths of the body's radius of gyration
constexpr double kLargestLog = 2.303;      // a linear model knows nothing of a change tenfold
constexpr double kOff = 0.1;               // of conditions: of a multiple, of the range of a value
constexpr double kOffOfRotor = 1.0;        // data sheets hardly have it, and it counts by the square of the gear
constexpr const char* kGravity = "opt/gravity[2]";
constexpr size_t kMostConditions = 3;  // of each parameter
constexpr double kTrace = 0.1;         // of a small change

/// Whether changes are of its logarithm.
bool ChangesByLog(const ParameterSpec& spec) { return spec.IsMultiple() || spec.logarithmic; }

/// z where the linear model has moved by `change`.
double At(const ParameterSpec& spec, double change) {
  if (ChangesByLog(spec)) return spec.nominal * std::exp(std::clamp(change, -kLargestLog, kLargestLog));
  return std::clamp(spec.nominal + change * (spec.high - spec.low), spec.low, spec.high);
}

/// The parts of x and of further parameter `k`.
std::vector<StretchEvidence> WithOne(const std::vector<StretchEvidence>& all, Eigen::Index n_x, Eigen::Index k) {
  std::vector<Eigen::Index> kept(static_cast<size_t>(n_x) + 1, n_x + k);
  for (Eigen::Index i = 0; i < n_x; ++i) kept[static_cast<size_t>(i)] = i;
  std::vector<StretchEvidence> part;
  for (const StretchEvidence& evidence : all) part.push_back({evidence.information(kept, kept), evidence.score(kept)});
  return part;
}

using Stretches = std::vector<StretchEvidence>;

/// @param steps  of each of `specs`
Stretches EvidenceOf(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                     const VectorXd& steps) {
  std::vector<double> nominal, moved;
  for (const ParameterSpec& spec : specs) {
    moved.push_back(At(spec, steps[static_cast<Eigen::Index>(nominal.size())]));
    nominal.push_back(spec.nominal);
  }
  return fit.EvidenceIn(wider, nominal, moved, steps);
}

/// Of all specs alike.
VectorXd SuspectSteps(const std::vector<ParameterSpec>& specs) {
  return VectorXd::Constant(static_cast<Eigen::Index>(specs.size()), kSuspectStep);
}

/// Down to where a limit of a force acts, too.
VectorXd StepsToLimits(const std::vector<ParameterSpec>& specs) {
  VectorXd steps = SuspectSteps(specs);
  for (size_t k = 0; k < specs.size(); ++k) {
    if (IsLimit(specs[k])) steps[static_cast<Eigen::Index>(k)] = kLimitStep;
  }
  return steps;
}

/// Steps as short as the logs tell each of them alone: over longer ones effects bend, and what goes with x would seem
/// to be told from it. Some of the rows say how short.
VectorXd NearbySteps(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider) {
  const auto n_more = static_cast<Eigen::Index>(specs.size());
  VectorXd information = VectorXd::Zero(n_more);
  const LevelFit some = fit.Sampled(kStepRows);
  const double times_fewer = static_cast<double>(fit.n_rows()) / some.n_rows();
  for (const StretchEvidence& s : EvidenceOf(specs, some, wider, SuspectSteps(specs)))
    information += times_fewer * s.information.diagonal().tail(n_more);
  const VectorXd std = information.cwiseMax(1e-12).cwiseSqrt().cwiseInverse();
  return (kStepOfStd * std).cwiseMax(kShortestStep).cwiseMin(kSuspectStep);
}

using FromStretches = StretchEstimate(const std::vector<StretchEvidence>&, const VectorXd& x, const Prior&);

/// What the logs say of x and one further parameter, which is at its nominal value; none where nothing depends on it.
class WithEachAlone {
 public:
  WithEachAlone(Stretches evidence, const VectorXd& x, const Prior& prior, const FromStretches& from_stretches)
      : from_stretches_(from_stretches),
        evidence_(std::move(evidence)),
        n_x_(x.size()),
        x_(n_x_ + 1),
        prior_(WithOneMore(prior, 0)) {
    x_ << x, 0;
    MatrixXd of_x = prior_.precision.topLeftCorner(n_x_, n_x_);
    for (const StretchEvidence& s : evidence_) of_x += s.information.topLeftCorner(n_x_, n_x_);
    of_x_.compute(of_x);
  }

  std::optional<StretchEstimate> Of(size_t k) const {
    const auto of_one = WithOne(evidence_, n_x_, static_cast<Eigen::Index>(k));
    if (std::ranges::all_of(of_one, [&](const auto& s) { return s.information(n_x_, n_x_) == 0; })) return std::nullopt;
    return from_stretches_(of_one, x_, prior_);
  }

  /// How x follows the further parameter, by a linear model, and what its effect has that no change of x has: the
  /// square of the sine of the angle between them.
  struct Following {
    VectorXd x_per_unit;
    double square_of_sine = 0;
  };
  Following FollowingOf(size_t k) const {
    const auto at = n_x_ + static_cast<Eigen::Index>(k);
    VectorXd with_x = VectorXd::Zero(n_x_);
    double alone = 0;
    for (const StretchEvidence& s : evidence_) {
      with_x += s.information.col(at).head(n_x_);
      alone += s.information(at, at);
    }
    const VectorXd follows = of_x_.solve(with_x);
    return {-follows, 1 - with_x.dot(follows) / alone};
  }

 private:
  const FromStretches& from_stretches_;
  Stretches evidence_;
  Eigen::Index n_x_;
  VectorXd x_;
  Prior prior_;
  Eigen::LDLT<MatrixXd> of_x_;  // the information on x alone
};

/// z where x has moved by `change`, to first order in z, or in its logarithm: a damping and a servo's kv add up, and
/// over so far the logit of a range bends.
std::vector<double> Followed(const ParameterSpace& space, const VectorXd& x, const VectorXd& change) {
  const std::vector<double> z = ToZ(space, x), nearby = ToZ(space, x + kShortestStep * change);
  std::vector<double> followed;
  for (size_t i = 0; i < z.size(); ++i) {
    const ParameterSpec& spec = space[static_cast<int>(i)];
    const double moved = spec.logarithmic ? z[i] * std::exp(std::log(nearby[i] / z[i]) / kShortestStep)
                                          : z[i] + (nearby[i] - z[i]) / kShortestStep;
    followed.push_back(std::clamp(moved, spec.low, spec.high));
  }
  return followed;
}

/// What a step says of the further parameter alone.
struct Step {
  double change, std;
};

Step LastOf(const StretchEstimate& estimate) {
  const auto last = estimate.step.size() - 1;
  return {estimate.step[last], std::sqrt(estimate.covariance(last, last))};
}

/// How much more than the model has of it a condition supposes, of what the logs leave open; none where they leave
/// nothing. @param is_alike  whether they cannot tell it from x at all
std::optional<double> FarthestOpen(const ParameterSpec& spec, const Step& asked, bool is_alike) {
  std::vector<double> offs = {ChangesByLog(spec) ? std::log(1 + kOff) : kOff};
  if (spec.IsMultiple() && spec.field.ends_with("/armature")) offs.insert(offs.begin(), std::log(1 + kOffOfRotor));
  for (const double off : offs) {
    if (is_alike || !IsExcluded(off, asked.change, asked.std)) return off;
  }
  return std::nullopt;
}

Suspect ScoreOf(const ParameterSpec& spec, const StretchEstimate& estimate) {
  const auto [change, std] = LastOf(estimate);
  return {.spec = spec, .value = At(spec, change), .explains = change * change / (2 * std * std)};
}

/// The surest first, and those that explain at least half as many nats.
void KeepSurest(std::vector<Suspect>& asked) {
  std::ranges::stable_sort(asked, std::ranges::greater(), &Suspect::explains);
  std::erase_if(asked, [least = asked.empty() ? 0 : asked.front().explains / 2](const Suspect& suspect) {
    return suspect.explains < least;
  });
}

/// Whether a parameter sets all that a suspect is: of a mass that is searched with its inertia, the mass alone.
bool IsPartOf(const ParameterSpec& suspect, const ParameterSpec& parameter) {
  const std::vector<std::string> set = TiedPaths(parameter.field);
  return std::ranges::all_of(TiedPaths(suspect.field),
                             [&](const std::string& path) { return std::ranges::find(set, path) != set.end(); });
}

/// How far a parameter moved, in small changes.
double MovedBy(const ParameterSpec& spec, double from, double to) {
  return std::abs(to - from) / SmallChange(spec, from);
}

/// Whether one of `others` has its first path.
bool SharesFirstPath(const Suspect& one, const std::vector<Suspect>& others) {
  const std::string path = TiedPaths(one.spec.field).front();
  return std::ranges::any_of(others, [&](const Suspect& other) { return TiedPaths(other.spec.field).front() == path; });
}

/// What a parameter's value rests on.
struct Named {
  double by = 0;  // how far it moves the value
  size_t suspect = 0;
  Condition condition;
};

/// Whether the logs say that something is not off, though derivatives do not: they tell too little of what is touched
/// farther away, or read as farther away. Asked of few, as each takes fits of starts.
class Refutation {
 public:
  Refutation(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider, std::vector<double> z)
      : some_(fit.Sampled(kRefutingRows)), wider_(wider), nominal_(std::move(z)), supposed_(specs.size()) {
    for (const ParameterSpec& spec : specs) nominal_.push_back(spec.nominal);
  }

  /// @param value  of suspect k; `moved`: where the searched parameters follow it
  void Suppose(size_t k, double value, const std::vector<double>& moved) {
    Supposed& of = supposed_[k];
    of.alone = nominal_;
    of.alone[nominal_.size() - supposed_.size() + k] = value;
    of.followed = of.alone;
    std::ranges::copy(moved, of.followed.begin());
  }

  bool IsRefuted(size_t k) {
    Supposed& of = supposed_[k];
    if (!of.is_refuted) of.is_refuted = IsUnlikely(of.followed) && IsUnlikely(of.alone);
    return *of.is_refuted;
  }

 private:
  struct Supposed {
    std::vector<double> alone, followed;
    std::optional<bool> is_refuted;
  };

  bool IsUnlikely(const std::vector<double>& z) {
    if (!nats_) nats_ = some_.NatsIn(wider_, nominal_);
    return some_.NatsIn(wider_, z) - *nats_ > kFewestSureNats;
  }

  LevelFit some_;
  WindowReplayer& wider_;
  std::vector<double> nominal_;  // of what is searched, and behind it of the suspects
  std::vector<Supposed> supposed_;
  std::optional<double> nats_;  // of the nominal values
};

}  // namespace

std::vector<Suspect> FirstApart(const std::vector<Suspect>& suspects, size_t n) {
  std::vector<Suspect> first;
  for (const Suspect& suspect : suspects) {
    if (first.size() < n && !SharesFirstPath(suspect, first)) first.push_back(suspect);
  }
  return first;
}

Prior WithOneMore(const Prior& prior, double mean) {
  const int n = prior.size();
  VectorXd means(n + 1);
  means << prior.mean, mean;
  MatrixXd covariance = Prior::Uniform(n + 1).Covariance();
  covariance.topLeftCorner(n, n) = prior.Covariance();
  return Prior::Gaussian(means, covariance);
}

bool IsExcluded(double off, double change, double std) {
  return off * (off - 2 * std::abs(change)) > kEndOfInterval * kEndOfInterval * std * std;
}

bool IsNoticeable(const ParameterSpec& spec, double z) {
  const bool is_centre = spec.field.find("/ipos") != std::string::npos;
  const bool is_length = is_centre || spec.field.ends_with("/pos");
  if (spec.IsMultiple()) {
    const double least = IsSensorScale(spec.field) ? kNoticeableScale : is_length ? kNoticeableLength : kNoticeableLog;
    return std::abs(std::log(z)) > least;
  }
  const double share = is_centre ? kNoticeableLoad : kNoticeableShare;
  return std::abs(z - spec.nominal) > share * (spec.high - spec.low);
}

bool IsDirected(const Suspect& scored) {
  return scored.explains > kDirected * kDirected / 2 && scored.value != scored.spec.nominal;
}

std::vector<Suspect> ScoreSuspects(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                                   const Prior& prior) {
  const WithEachAlone with(EvidenceOf(specs, fit, wider, StepsToLimits(specs)), fit.x(), prior, GuessFromStretches);
  std::vector<Suspect> scored;
  for (size_t k = 0; k < specs.size(); ++k) {
    if (const std::optional<StretchEstimate> estimate = with.Of(k)) scored.push_back(ScoreOf(specs[k], *estimate));
  }
  return scored;
}

RestsOn FindConditions(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                       const Prior& prior, const Designer& q) {
  const ParameterSpace& space = q.space();
  const std::vector<Designer::Interval> intervals = q.CentralInterval(0.9);
  const VectorXd steps = NearbySteps(specs, fit, wider);
  const WithEachAlone with(EvidenceOf(specs, fit, wider, steps), fit.x(), prior, EstimateFromStretches);
  const std::vector<double> z = ToZ(space, fit.x());
  std::vector<std::vector<Named>> of_each(z.size());
  RestsOn found;
  // Of a mass that is searched with its inertia, the mass alone would read as if it were not searched.
  const auto is_searched = [&](const ParameterSpec& spec) {
    return std::ranges::any_of(space.specs(), [&](const ParameterSpec& p) { return IsPartOf(spec, p); });
  };
  Refutation refutation(specs, fit, wider, z);
  for (size_t k = 0; k < specs.size(); ++k) {
    const std::optional<StretchEstimate> estimate = with.Of(k);
    if (!estimate) continue;
    const Suspect scored = ScoreOf(specs[k], *estimate);
    found.is_sure |= scored.explains > kSurelyAsked * kSurelyAsked / 2;
    if (scored.explains > kAsked * kAsked / 2 && IsNoticeable(specs[k], scored.value)) found.asked.push_back(scored);
    if (is_searched(specs[k])) continue;
    const WithEachAlone::Following following = with.FollowingOf(k);
    // By such a step an effect bends by half of it, and those of x by steps of their own: a smaller angle is none.
    const double bend = std::max(2 * steps[static_cast<Eigen::Index>(k)], kSmallestSine);
    const bool is_alike = following.square_of_sine <= bend * bend;
    const std::optional<double> open = FarthestOpen(specs[k], LastOf(*estimate), is_alike);
    if (!open) continue;
    const double off = *open;
    const std::vector<double> moved = Followed(space, fit.x(), off * following.x_per_unit);
    refutation.Suppose(k, At(specs[k], off), moved);
    for (size_t i = 0; i < z.size(); ++i) {
      const double by = MovedBy(space[static_cast<int>(i)], z[i], moved[i]);
      const bool is_outside = moved[i] < intervals[i].low || moved[i] > intervals[i].high;
      if (by > (is_alike || is_outside ? kTrace : 1))
        of_each[i].push_back({by, k, {static_cast<int>(i), specs[k], At(specs[k], off), moved[i]}});
    }
  }
  KeepSurest(found.asked);
  for (std::vector<Named>& of : of_each) {
    std::ranges::stable_sort(of, std::ranges::greater(), &Named::by);
    // How strong gravity is people know: what acts as it does, such as a mass or a length, comes first.
    std::ranges::stable_partition(of, [](const Named& named) { return named.condition.spec.field != kGravity; });
    size_t n = 0;
    for (Named& named : of) {
      if (n == kMostConditions) break;
      if (IsShift(named.condition.spec) && refutation.IsRefuted(named.suspect)) continue;
      found.conditions.push_back(std::move(named.condition));
      ++n;
    }
  }
  return found;
}

}  // namespace oted
