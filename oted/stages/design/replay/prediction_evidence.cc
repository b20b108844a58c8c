#include "oted/stages/design/replay/prediction_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>

#include "oted/base/statistics.h"
#include "oted/matching/held_out.h"
#include "oted/matching/verdict.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/excess.h"
#include "oted/stages/design/replay/imitation.h"
#include "oted/stages/design/replay/judged_part.h"
#include "oted/stages/design/replay/longest_horizon.h"
#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/replay/prediction_ratios.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 3> kHorizons = {0.1, 0.5, 1.0};  // [s]
constexpr double kStepWithoutUnit = 0.05;                     // [s]
constexpr double kTailOfSix = 1.45;                           // Student's t of six draws over the normal, 99 %
constexpr int kFewestPredicted = 3;                           // windows of a part that judges
constexpr double kMoved = 0.25;                               // of the range: what an identified parameter is known to

/// Of recordings that something was learned from.
int NumberOfParts(const PredictionProblem& problem) {
  return static_cast<int>(problem.kept_aside.Episodes().size()) - problem.n_whole;
}

/// Counts what is done for the caller.
class Steps {
 public:
  explicit Steps(std::function<void(int done, int total)> tell) : tell_(std::move(tell)) {}
  void Expect(size_t n) { total_ += static_cast<int>(n); }
  void Tell() {
    ++done_;
    if (tell_) tell_(done_, std::max(done_, total_));
  }

 private:
  std::function<void(int done, int total)> tell_;
  int done_ = 0, total_ = 0;
};

/// The logs that were kept aside, and those that were learned from, predicted over all horizons at once.
class Evidence {
 public:
  /// @param other  z that the design is compared with
  Evidence(const PredictionProblem& problem, std::vector<double> other, const std::vector<int>& horizons,
           double period_s, Steps& steps)
      : problem_(problem), other_(std::move(other)), steps_(steps) {
    AddPart(problem.kept_aside, problem.JudgesByLearned(), horizons, period_s);
    if (problem.learned != nullptr) AddPart(*problem.learned, true, horizons, period_s);
    if (parts_.empty()) return;
    imitator_.emplace(problem_, parts_, [this] { steps_.Tell(); });
    for (const auto& part : parts_) designed_.push_back(part->judge().Predict(problem.z));
    of_other_.resize(parts_.size());
  }
  Evidence(const Evidence&) = delete;  // what imitates refers to it
  Evidence& operator=(const Evidence&) = delete;

  /// Compare knows of it from here on. It takes most of the time.
  /// @param of_other  how the other simulator predicts logs of its own counts as well (Compare)
  void FindFloor(bool of_other) {
    if (imitator_->IsExact()) {
      // The design's own logs would be predicted without error.
      imitated_ = {designed_};
      for (PredictionJudge::Squares& squares : imitated_.front()) {
        for (MatrixXd& predicted : squares.predicted) predicted.setZero();
      }
      return;  // of readings that are the state there is nothing to find
    }
    steps_.Expect(imitator_->Steps(problem_.as_likely.size()) + (of_other ? imitator_->Steps(0) : 0));
    std::vector<const PredictionJudge::Squares*> of_parts;
    for (const PredictionJudge::Squares& squares : designed_) of_parts.push_back(&squares);
    imitated_ = imitator_->Imitate(problem_.z, of_parts, problem_.as_likely);
    if (!of_other) return;
    for (size_t p = 0; p < parts_.size(); ++p) of_parts[p] = &Other(p);
    imitated_by_other_ = imitator_->Imitate(other_, of_parts, {});
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

  /// Whether the simulator at z surely predicts worse than the design, over some horizon: the logs kept aside, or those
  /// that were learned from, which are more.
  bool IsWorse(const std::vector<double>& z) const {
    for (size_t p = 0; p < parts_.size(); ++p) {
      if (parts_[p]->judge().n_windows(0) >= kFewestPredicted && IsWorse(z, p)) return true;
    }
    return false;
  }

 private:
  /// In one part.
  bool IsWorse(const std::vector<double>& z, size_t part) const {
    const PredictionJudge& judge = parts_[part]->judge();
    const PredictionJudge::Squares moved = judge.Predict(z);
    for (size_t h = 0; h < judge.horizons().size(); ++h) {
      const MatrixXd &off = moved.predicted[h], &designed = designed_[part].predicted[h];
      // Sums tell of effects that few windows show, but chance in few windows drowns what all others show.
      if (SaysWorse(judge, RatiosOfSums(off, designed, judge.channels())) ||
          SaysWorse(judge, TypicalRatios(off, designed, off.cols(), judge.channels()))) {
        return true;
      }
    }
    return false;
  }

  static bool SaysWorse(const PredictionJudge& judge, const PredictionRatios& gain) {
    HeldOutPrediction::Horizon compared;
    compared.gain = gain.OfAll();
    compared.channels.resize(static_cast<size_t>(judge.channels().spread.size()));
    for (size_t c = 0; c < compared.channels.size(); ++c) compared.channels[c].gain = IfJudged(judge, c, gain);
    return IsSurelyWorse(compared);
  }

  /// Logs in which some window can be predicted.
  void AddPart(const Dataset& logs, bool learned, const std::vector<int>& horizons, double period_s) {
    auto part = std::make_unique<JudgedPart>(problem_, logs, horizons, period_s);
    if (part->judge().n_windows() == 0) return;
    parts_.push_back(std::move(part));
    learned_.push_back(learned);
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
    HeldOutPrediction::Horizon horizon =
        ErrorsOver(judge, h, n_steps * problem_.factory.spec().control_period_s, of_judged, of_other);
    horizon.learned = learned_[judging];
    const Eigen::Index n_of_recordings =
        learned_[judging] || NumberOfParts(problem_) == 0 ? 0 : judge.n_windows(h, problem_.n_whole);
    if (n_of_recordings > 0) {
      horizon.n_of_recordings = static_cast<int>(n_of_recordings);
      horizon.gain_of_recordings =
          RatiosOfSums(of_other.leftCols(n_of_recordings), of_judged.leftCols(n_of_recordings), judge.channels())
              .OfAll();
    }
    if (imitated_.empty()) return horizon;
    const MatrixXd designed = all_of(designed_);
    const auto draws_of = [&](const Imitations& imitations) {
      std::vector<MatrixXd> draws;
      for (const auto& squares : imitations) draws.push_back(all_of(squares));
      return draws;
    };
    const std::vector<MatrixXd> draws = draws_of(imitated_);
    const MatrixXd floor = AllBeside(draws);
    const JudgedChannels& channels = judge.channels();
    // The design may be so wrong that it does not predict even its own logs. Where the other one predicts these logs no
    // worse, its floor counts.
    const bool other_counts = horizon.gain.value <= 0;
    const ExcessOverFloor excess(
        {.designed = designed,
         .draws = draws,
         .floor = floor,
         .draws_of_other = other_counts ? draws_of(imitated_by_other_) : std::vector<MatrixXd>(),
         .n_judged = of_judged.cols(),
         .times_scatter = imitator_->HasFewWindows() ? kTailOfSix : 1,
         .error_of_noise = imitator_->ErrorOfNoise()},
        channels);
    horizon.excess = excess.Of(designed.rows());
    const VectorXd of_draws = ErrorsOf(draws, of_judged.cols()).cwiseMax(kNoNoise * channels.spread);
    const OddEpisodes odd = FindOdd(LogRatios(designed, floor, designed.cols(), channels), parts, at);
    horizon.odd_episodes = odd.numbers;
    horizon.surely_odd = odd.surely;
    for (Eigen::Index c = 0; c < designed.rows(); ++c) {
      HeldOutPrediction::Channel& channel = horizon.channels[static_cast<size_t>(c)];
      if (channel.judged) channel.excess = excess.Of(c);
      channel.in_some = channel.judged && excess.IsInSome(c);
      // A ratio knows no error below what counts as visible, and the design's own may be that of one seam of a log.
      channel.floor = std::min(channel.designed * std::exp(-0.5 * excess.Shown(c)), of_draws[c]);
    }
    return horizon;
  }

  /// (channels): of the windows that judge, over all draws.
  static VectorXd ErrorsOf(const std::vector<MatrixXd>& draws, Eigen::Index n_judged) {
    std::vector<MatrixXd> judged;
    for (const MatrixXd& draw : draws) judged.push_back(draw.leftCols(n_judged));
    return RootMeanSquares(AllBeside(judged));
  }

  /// @param excess  of each window of these parts, one part behind the other
  OddEpisodes FindOdd(const VectorXd& excess, const std::vector<size_t>& parts, const std::vector<size_t>& at) const {
    std::map<int, std::vector<double>> of_episodes;
    Eigen::Index w = 0;
    for (size_t i = 0; i < parts.size(); ++i) {
      const std::vector<int> begins = parts_[parts[i]]->judge().Begins(at[i]);
      for (const int episode : LoggedEpisodesOf(begins, parts[i])) of_episodes[episode].push_back(excess[w++]);
    }
    return FindOddEpisodes(of_episodes);
  }

  /// The logged episodes that rows of a part are in.
  std::vector<int> LoggedEpisodesOf(const std::vector<int>& rows, size_t part) const {
    const bool is_learned = learned_[part] != 0 && problem_.learned != nullptr;
    const std::vector<int>& in = is_learned ? problem_.learned_in : problem_.kept_aside_in;
    if (in.empty()) return EpisodesOf(rows, (is_learned ? *problem_.learned : problem_.kept_aside).Episodes());
    std::vector<int> episodes;
    for (const int row : rows) episodes.push_back(in[static_cast<size_t>(row)]);
    return episodes;
  }

  const PredictionJudge::Squares& Other(size_t part) {
    auto& squares = of_other_[part];
    // No gain is made of starts that it cannot find.
    if (!squares) squares = parts_[part]->PredictNearest(other_);
    return *squares;
  }

  const PredictionProblem& problem_;
  std::vector<double> other_;
  Steps& steps_;
  std::vector<std::unique_ptr<JudgedPart>> parts_;  // kept aside, learned
  std::vector<char> learned_;                       // by part
  // By part, what PredictionJudge::Predict gave.
  std::vector<PredictionJudge::Squares> designed_;
  std::vector<std::optional<PredictionJudge::Squares>> of_other_;
  std::optional<Imitator> imitator_;  // none where there is no part
  Imitations imitated_, imitated_by_other_;
};

/// z with sensors that add no noise: a prediction is of what they would read without.
std::vector<double> WithoutNoise(const ParameterSpace& space, std::vector<double> z) {
  for (int i = 0; i < space.size(); ++i) {
    if (IsSensorNoise(space[i].field)) z[static_cast<size_t>(i)] = 0;
  }
  return z;
}

std::vector<HeldOutPrediction::OpenEnd> OpenEnds(const Evidence& evidence, const PredictionProblem& problem,
                                                 Steps& steps) {
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
      steps.Tell();
    }
  }
  return ends;
}

HeldOutPrediction CompareAll(Evidence& evidence, const std::vector<int>& horizons) {
  HeldOutPrediction prediction;
  for (const int n_steps : horizons) {
    auto horizon = evidence.Compare(n_steps, prediction.horizons.empty());
    if (!horizon) break;
    prediction.horizons.push_back(*std::move(horizon));
  }
  return prediction;
}

/// @param with_floor  whether the floor is asked for
std::optional<HeldOutPrediction> Predict(const PredictionProblem& asked, const std::vector<double>& other,
                                         bool with_floor) {
  const ParameterSpace& space = asked.factory.parameters();
  const std::vector<double> quiet = WithoutNoise(space, asked.z);
  PredictionProblem problem{.factory = asked.factory,
                            .kept_aside = asked.kept_aside,
                            .learned = asked.learned,
                            .z = quiet,
                            .noise = asked.noise,
                            .readings = asked.readings,
                            .narrow = asked.narrow,
                            .key = asked.key,
                            .n_threads = asked.n_threads,
                            .noise_rows = asked.noise_rows,
                            .noise_of_other_logs = asked.noise_of_other_logs,
                            .as_likely = asked.as_likely,
                            .kept_aside_in = asked.kept_aside_in,
                            .learned_in = asked.learned_in,
                            .n_whole = asked.n_whole};
  for (std::vector<double>& z : problem.as_likely) z = WithoutNoise(space, z);
  const double period = problem.factory.spec().control_period_s, step = period > 0 ? period : kStepWithoutUnit;
  std::vector<int> horizons;
  for (const double seconds : kHorizons) {
    const int n_steps = static_cast<int>(std::lround(seconds / step));
    if (n_steps > (horizons.empty() ? 0 : horizons.back())) horizons.push_back(n_steps);
  }
  if (horizons.empty()) return std::nullopt;
  Steps steps(asked.tell);
  Evidence evidence(problem, WithoutNoise(space, other), horizons, step, steps);
  HeldOutPrediction prediction = CompareAll(evidence, horizons);
  if (prediction.horizons.empty()) return std::nullopt;
  steps.Expect(2 * problem.narrow.size());
  if (with_floor) {
    evidence.FindFloor(!PredictsBetter(prediction));  // of gains alone
    prediction = CompareAll(evidence, horizons);
    prediction.longest = LongestPredicted(problem, WithoutNoise(space, other), horizons.back());
  }
  prediction.open_ends = OpenEnds(evidence, problem, steps);
  prediction.n_recordings = problem.n_whole;
  prediction.n_parts = problem.learned == nullptr ? 0 : NumberOfParts(problem);
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
