#include "oted/stages/design/replay/prediction_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "oted/matching/verdict.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/replay/prediction_ratios.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 3> kHorizons = {0.1, 0.5, 1.0};  // [s]
constexpr double kStepWithoutUnit = 0.05;                     // [s]
constexpr int kImitations = 2;
constexpr int kFewestPredicted = 3, kMostPredicted = 60;  // windows of each part at each horizon
constexpr double kSurely = 2.0;                           // standard errors
constexpr int kNoiseCorrections = 2;
constexpr double kNoNoise = 1e-6;  // of a channel's spread: such noise is none
constexpr double kMoved = 0.25;    // of the range: what an identified parameter is known to
// Of the noise's standard deviation. Short windows take some of a simulator's error for noise, and leads take as much:
// hardly ever is the guess too low.
constexpr double kLeastCorrection = 1 / 3.0, kLargestCorrection = 1.25;

/// One part of the logs: how it is predicted, and how the design's own logs of the same windows are.
class JudgedPart {
 public:
  JudgedPart(const PredictionProblem& problem, const Dataset& logs, const std::vector<int>& horizons, double period_s)
      : problem_(problem),
        replayer_(Replayer(logs)),
        judge_(replayer_, logs, problem.noise, horizons, period_s, kMostPredicted) {}

  const PredictionJudge& judge() const { return judge_; }

  /// Where `n_steps` stand among the horizons; none where too few windows are that long.
  std::optional<size_t> Find(int n_steps, int fewest) const {
    const auto found = std::ranges::find(judge_.horizons(), n_steps);
    const auto h = static_cast<size_t>(found - judge_.horizons().begin());
    if (found == judge_.horizons().end() || judge_.n_windows(h) < fewest) return std::nullopt;
    return h;
  }

  /// As PredictionJudge::Predict, of logs that the design made itself. @param designed  its prediction of the logs
  PredictionJudge::Squares PredictItself(const PredictionJudge::Squares& designed, const VectorXd& noise, Rng& rng) {
    if (followed_.empty()) followed_ = judge_.Follow(problem_.z, designed.starts);
    const Dataset made = judge_.Imitate(followed_, noise, rng);
    WindowReplayer replayer = Replayer(made);
    return PredictionJudge(replayer, made, judge_).Predict(problem_.z);
  }

 private:
  WindowReplayer Replayer(const Dataset& logs) const {
    return MakeReplayer(problem_.factory, 0, logs, problem_.readings, problem_.n_threads);
  }

  const PredictionProblem& problem_;
  WindowReplayer replayer_;
  PredictionJudge judge_;
  std::vector<VectorXd> followed_;
};

MatrixXd Beside(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd both(a.rows(), a.cols() + b.cols());
  both << a, b;
  return both;
}

/// Of each channel, the median over windows; those that broke down count as the largest.
VectorXd Medians(const MatrixXd& squares) {
  VectorXd medians(squares.rows());
  for (Eigen::Index c = 0; c < squares.rows(); ++c) {
    std::vector<double> values;
    for (Eigen::Index w = 0; w < squares.cols(); ++w) {
      values.push_back(std::isnan(squares(c, w)) ? std::numeric_limits<double>::infinity() : squares(c, w));
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    medians[c] = *middle;
  }
  return medians;
}

VectorXd RootMeanSquares(const MatrixXd& squares) {
  VectorXd sum = VectorXd::Zero(squares.rows());
  double n = 0;
  for (Eigen::Index w = 0; w < squares.cols(); ++w) {
    if (squares.col(w).hasNaN()) continue;
    sum += squares.col(w);
    ++n;
  }
  return (sum / n).cwiseSqrt();
}

/// The logs that were kept aside, and those that were learned from, predicted over all horizons at once.
class Evidence {
 public:
  /// @param other  z that the design is compared with
  Evidence(const PredictionProblem& problem, std::vector<double> other, const std::vector<int>& horizons,
           double period_s)
      : problem_(problem), other_(std::move(other)), noise_(problem.noise) {
    AddPart(problem.kept_aside, problem.learned == nullptr, horizons, period_s);
    if (problem.learned != nullptr) AddPart(*problem.learned, true, horizons, period_s);
    if (parts_.empty()) return;
    for (const auto& part : parts_) designed_.push_back(part->judge().Predict(problem.z));
    of_other_.resize(parts_.size());
  }

  /// Before Compare, where the floor is asked for: it takes most of the time.
  void FindFloor() {
    if (parts_.empty()) return;
    if ((noise_.array() <= kNoNoise * parts_.front()->judge().channels().spread.array()).all()) {
      // Readings are the state. The design's own logs would be predicted without error.
      imitated_ = {designed_};
      for (PredictionJudge::Squares& squares : imitated_.front()) {
        for (MatrixXd& predicted : squares.predicted) predicted.setZero();
      }
      return;
    }
    for (int round = 0; round < kNoiseCorrections; ++round) {
      const RngKey key = problem_.key.Stage("noise").Index(static_cast<uint64_t>(round));
      const VectorXd corrected = CorrectedNoise(key.MakeRng());
      if (corrected == noise_) break;
      noise_ = corrected;
    }
    Rng rng = problem_.key.Stage("imitations").MakeRng();
    for (int k = 0; k < kImitations; ++k) {
      imitated_.emplace_back();
      for (size_t p = 0; p < parts_.size(); ++p) {
        imitated_.back().push_back(parts_[p]->PredictItself(designed_[p], noise_, rng));
      }
    }
  }

  /// How errors compare over this many control steps. @param is_first  shorter episodes are then predicted to their end
  std::optional<HeldOutPrediction::Horizon> Compare(int n_steps, bool is_first) {
    std::vector<size_t> parts, at;  // the part that judges, and one that tells more of the floor; their horizons
    for (const int fewest : {kFewestPredicted, 1}) {
      for (size_t p = 0; p < parts_.size() && (fewest > 1 || parts.empty()); ++p) {
        const auto found = parts_[p]->Find(n_steps, fewest);
        if (!found) continue;
        parts.push_back(p);
        at.push_back(*found);
      }
    }
    if (parts.empty()) {
      if (parts_.empty()) return std::nullopt;
      const std::vector<int>& shorter = parts_.front()->judge().horizons();
      if (!is_first || shorter.empty() || parts_.front()->judge().n_windows(0) == 0) return std::nullopt;
      parts = {0};
      at = {0};
      n_steps = shorter.front();
    }
    return Compare(n_steps, parts, at);
  }

  /// Whether the simulator at z surely predicts worse than the design, over some horizon.
  bool IsWorse(const std::vector<double>& z) const {
    const auto can_judge = [](const auto& part) { return part->judge().n_windows(0) >= kFewestPredicted; };
    const size_t p = can_judge(parts_.front()) ? 0 : parts_.size() - 1;
    const PredictionJudge& judge = parts_[p]->judge();
    const PredictionJudge::Squares moved = judge.Predict(z);
    for (size_t h = 0; h < judge.horizons().size(); ++h) {
      const PredictionRatios gain = RatiosOfSums(moved.predicted[h], designed_[p].predicted[h], judge.channels());
      HeldOutPrediction::Horizon compared;
      compared.gain = gain.OfAll();
      compared.channels.resize(static_cast<size_t>(judge.channels().spread.size()));
      for (size_t c = 0; c < compared.channels.size(); ++c) {
        compared.channels[c].gain = IfJudged(judge, c, gain);
      }
      if (IsSurelyWorse(compared)) return true;
    }
    return false;
  }

 private:
  /// Logs in which some window can be predicted.
  void AddPart(const Dataset& logs, bool learned, const std::vector<int>& horizons, double period_s) {
    auto part = std::make_unique<JudgedPart>(problem_, logs, horizons, period_s);
    if (part->judge().n_windows() == 0) return;
    parts_.push_back(std::move(part));
    learned_.push_back(learned);
  }

  /// The noise with which the design's own logs leave as much in the leads as the logs do.
  VectorXd CorrectedNoise(Rng rng) {
    MatrixXd logged(noise_.size(), 0), made = logged;
    for (size_t p = 0; p < parts_.size(); ++p) {
      logged = Beside(logged, designed_[p].lead);
      made = Beside(made, parts_[p]->PredictItself(designed_[p], noise_, rng).lead);
    }
    if (logged.cols() == 0) return noise_;
    const VectorXd factor = (Medians(logged).array() / Medians(made).array()).sqrt();
    const PredictionRatios leads = TypicalRatios(logged, made, logged.cols(), parts_.front()->judge().channels());
    VectorXd corrected = noise_;
    for (Eigen::Index c = 0; c < noise_.size(); ++c) {
      // Leads are few: chance alone does not move what a fit of all windows told.
      const bool surely = std::abs(2 * std::log(factor[c])) > kSurely * leads.OfChannel(c).error;
      if (surely && std::isfinite(factor[c])) {
        corrected[c] *= std::clamp(factor[c], kLeastCorrection, kLargestCorrection);
      }
    }
    return corrected;
  }

  HeldOutPrediction::Horizon Compare(int n_steps, const std::vector<size_t>& parts, const std::vector<size_t>& at) {
    const size_t judging = parts.front(), h = at.front();
    const auto all_of = [&](const std::vector<PredictionJudge::Squares>& squares) {
      MatrixXd all = squares[judging].predicted[h];
      for (size_t i = 1; i < parts.size(); ++i) all = Beside(all, squares[parts[i]].predicted[at[i]]);
      return all;
    };
    const MatrixXd &of_judged = designed_[judging].predicted[h], of_other = Other(judging).predicted[h];
    const PredictionJudge& judge = parts_[judging]->judge();
    const PredictionRatios gain = RatiosOfSums(of_other, of_judged, judge.channels());
    const VectorXd designed_rms = RootMeanSquares(of_judged), other_rms = RootMeanSquares(of_other);
    HeldOutPrediction::Horizon horizon;
    horizon.seconds = n_steps * problem_.factory.spec().control_period_s;
    horizon.n_steps = n_steps;
    horizon.n_windows = judge.n_windows(h);
    horizon.learned = learned_[judging];
    horizon.gain = gain.OfAll();
    for (Eigen::Index c = 0; c < designed_rms.size(); ++c) {
      horizon.channels.push_back({.nominal = other_rms[c],
                                  .designed = designed_rms[c],
                                  .floor = 0,
                                  .spread = judge.channels().spread[c],
                                  .judged = judge.channels().weight[c] > 0,
                                  .excess = {},
                                  .gain = IfJudged(judge, static_cast<size_t>(c), gain)});
    }
    if (imitated_.empty()) return horizon;
    const MatrixXd designed = all_of(designed_);
    MatrixXd floor(designed.rows(), 0);
    for (const auto& squares : imitated_) floor = Beside(floor, all_of(squares));
    const PredictionRatios excess = TypicalRatios(designed, floor, designed.cols(), judge.channels());
    horizon.excess = excess.OfAll();
    for (size_t c = 0; c < horizon.channels.size(); ++c) {
      HeldOutPrediction::Channel& channel = horizon.channels[c];
      channel.excess = IfJudged(judge, c, excess);
      channel.floor = channel.designed * std::exp(-0.5 * excess.OfChannel(static_cast<Eigen::Index>(c)).value);
    }
    return horizon;
  }

  /// Nothing of a channel that is not judged.
  static Estimated IfJudged(const PredictionJudge& judge, size_t c, const PredictionRatios& ratios) {
    const auto row = static_cast<Eigen::Index>(c);
    return judge.channels().weight[row] > 0 ? ratios.OfChannel(row) : Estimated{};
  }

  const PredictionJudge::Squares& Other(size_t part) {
    auto& squares = of_other_[part];
    if (!squares) squares = parts_[part]->judge().Predict(other_);
    return *squares;
  }

  const PredictionProblem& problem_;
  std::vector<double> other_;
  std::vector<std::unique_ptr<JudgedPart>> parts_;  // kept aside, learned
  std::vector<char> learned_;                       // by part
  // By part, what PredictionJudge::Predict gave.
  std::vector<PredictionJudge::Squares> designed_;
  std::vector<std::optional<PredictionJudge::Squares>> of_other_;
  std::vector<std::vector<PredictionJudge::Squares>> imitated_;  // by imitation, by part
  VectorXd noise_;                                               // of the sensors
};

/// z with sensors that add no noise: a prediction is of what they would read without.
std::vector<double> WithoutNoise(const ParameterSpace& space, std::vector<double> z) {
  for (int i = 0; i < space.size(); ++i) {
    if (IsSensorNoise(space[i].field)) z[static_cast<size_t>(i)] = 0;
  }
  return z;
}

std::vector<HeldOutPrediction::OpenEnd> OpenEnds(const Evidence& evidence, const PredictionProblem& problem) {
  const ParameterSpace& space = problem.factory.parameters();
  const std::vector<double> unit = space.ToUnit(problem.z);
  std::vector<HeldOutPrediction::OpenEnd> ends;
  for (const int i : problem.narrow) {
    if (IsSensorNoise(space[i].field)) continue;  // no prediction is of noise
    for (const bool above : {false, true}) {
      std::vector<double> moved = unit;
      double& u = moved[static_cast<size_t>(i)];
      u += above ? kMoved : -kMoved;
      if (u < 0 || u > 1) continue;  // the interval ends at the range anyhow
      if (!evidence.IsWorse(space.FromUnit(moved))) ends.push_back({i, above});
    }
  }
  return ends;
}

/// @param with_floor  whether the floor is asked for
std::optional<HeldOutPrediction> Predict(const PredictionProblem& asked, const std::vector<double>& other,
                                         bool with_floor) {
  const ParameterSpace& space = asked.factory.parameters();
  const std::vector<double> quiet = WithoutNoise(space, asked.z);
  const PredictionProblem problem{asked.factory,  asked.kept_aside, asked.learned, quiet,          asked.noise,
                                  asked.readings, asked.narrow,     asked.key,     asked.n_threads};
  const double period = problem.factory.spec().control_period_s, step = period > 0 ? period : kStepWithoutUnit;
  std::vector<int> horizons;
  for (const double seconds : kHorizons) {
    const int n_steps = static_cast<int>(std::lround(seconds / step));
    if (n_steps > (horizons.empty() ? 0 : horizons.back())) horizons.push_back(n_steps);
  }
  if (horizons.empty()) return std::nullopt;
  Evidence evidence(problem, WithoutNoise(space, other), horizons, step);
  if (with_floor) evidence.FindFloor();
  HeldOutPrediction prediction;
  for (const int n_steps : horizons) {
    auto horizon = evidence.Compare(n_steps, prediction.horizons.empty());
    if (!horizon) break;
    prediction.horizons.push_back(*std::move(horizon));
  }
  if (prediction.horizons.empty()) return std::nullopt;
  prediction.open_ends = OpenEnds(evidence, problem);
  return prediction;
}

}  // namespace

std::optional<HeldOutPrediction> PredictLogs(const PredictionProblem& problem) {
  return Predict(problem, problem.factory.parameters().Nominal(), true);
}

std::optional<HeldOutPrediction> PredictBeside(const PredictionProblem& problem, const std::vector<double>& other) {
  return Predict(problem, other, false);
}

}  // namespace oted
