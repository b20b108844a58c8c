#include "oted/stages/design/replay/imitation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/matching/verdict.h"
#include "oted/stages/design/replay/noise_bound.h"
#include "oted/stages/design/replay/noise_estimate.h"
#include "oted/stages/design/replay/prediction_ratios.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of few windows more, whose scatter tells of chance what few blocks do not.
constexpr size_t kFewestImitations = 2, kFewestOfFew = 6;
constexpr int kFewWindows = 30;
constexpr double kSurely = 2.0;  // standard errors, of one channel
constexpr int kNoiseCorrections = 2, kCorrectionsOfOthers = 4;
constexpr double kVarianceOfMedian = 5.44;  // of the logarithm of a median of n squared normal numbers, times n
constexpr double kLeastFreedomOfRow = 0.2;  // starts take the rest
constexpr double kNoiseAllowed = 0.1;       // the least excess of a channel that counts is four such errors already
// Of the noise's standard deviation. Short windows take some of a simulator's error for noise, and leads take as much:
// hardly ever is the guess too low.
constexpr double kLeastCorrection = 1 / 3.0, kLargestCorrection = 1.25;

/// (obs_dim): what the sensors' noise does not exceed in any part of the logs.
VectorXd LargestNoiseOf(const PredictionProblem& problem) {
  const VectorXd largest = LargestNoise(problem.kept_aside);
  return problem.learned == nullptr ? largest : largest.cwiseMax(LargestNoise(*problem.learned)).eval();
}

}  // namespace

Imitator::Imitator(const PredictionProblem& problem, const Parts& parts, std::function<void()> tell)
    : problem_(problem),
      parts_(parts),
      tell_(std::move(tell)),
      largest_noise_(LargestNoiseOf(problem)),
      noise_(problem.noise) {
  const VectorXd& spread = parts.front()->judge().channels().spread;
  if (problem.noise_of_other_logs) {  // from none at all nothing can be corrected
    noise_ = (noise_.array() > kNoNoise * spread.array()).select(noise_, kNoiseGuess * spread).eval();
  }
  noise_ = noise_.cwiseMin(largest_noise_).eval();
  is_exact_ = (noise_.array() <= kNoNoise * spread.array()).all() && problem.readings.ShowsState();
}

bool Imitator::HasFewWindows() const {
  int n_windows = 0;
  for (const auto& part : parts_) n_windows += part->judge().n_windows();
  return n_windows < kFewWindows;
}

int Imitator::Corrections() const { return problem_.noise_of_other_logs ? kCorrectionsOfOthers : kNoiseCorrections; }

size_t Imitator::FewestImitations() const { return HasFewWindows() ? kFewestOfFew : kFewestImitations; }

size_t Imitator::Steps(size_t n_as_likely) const {
  size_t n = static_cast<size_t>(Corrections()) + std::max(FewestImitations(), n_as_likely);
  for (const auto& part : parts_) n += static_cast<size_t>(part->judge().FollowSteps());
  return n;
}

Imitations Imitator::Imitate(const std::vector<double>& z, const std::vector<const PredictionJudge::Squares*>& of_parts,
                             const std::vector<std::vector<double>>& as_likely) const {
  std::vector<std::vector<VectorXd>> followed;
  MatrixXd logged(problem_.noise.size(), 0);
  for (size_t p = 0; p < parts_.size(); ++p) {
    followed.push_back(parts_[p]->judge().Follow(z, of_parts[p]->starts, tell_));
    logged = Beside(logged, of_parts[p]->lead);
  }
  const auto imitate = [&](const std::vector<double>& by, const VectorXd& noise, Rng& rng) {
    std::vector<PredictionJudge::Squares> imitation;
    for (size_t p = 0; p < parts_.size(); ++p) {
      imitation.push_back(parts_[p]->PredictItself(by, followed[p], noise, rng));
    }
    tell_();
    return imitation;
  };
  VectorXd noise = noise_;
  for (int round = 0; round < Corrections(); ++round) {
    Rng rng = problem_.key.Stage("noise").Index(static_cast<uint64_t>(round)).MakeRng();
    MatrixXd made(noise.size(), 0);
    for (const PredictionJudge::Squares& squares : imitate(z, noise, rng)) made = Beside(made, squares.lead);
    const VectorXd corrected = Corrected(noise, logged, made);
    if (corrected == noise) break;
    noise = corrected;
  }
  Rng rng = problem_.key.Stage("imitations").MakeRng();
  Imitations imitations;
  for (const std::vector<double>& off : as_likely) imitations.push_back(imitate(off, noise, rng));
  while (imitations.size() < FewestImitations()) imitations.push_back(imitate(z, noise, rng));
  return imitations;
}

VectorXd Imitator::Corrected(const VectorXd& noise, const MatrixXd& logged, const MatrixXd& made) const {
  if (logged.cols() == 0) return noise;
  const VectorXd factor = (Medians(logged).array() / Medians(made).array()).sqrt();
  const PredictionRatios leads = TypicalRatios(logged, made, logged.cols(), parts_.front()->judge().channels());
  VectorXd corrected = noise;
  // The farthest of n normal numbers lies at some sqrt(2 log n): among many channels one is always two errors off.
  const double surely = std::sqrt(kSurely * kSurely + 2 * std::log(static_cast<double>(noise.size())));
  for (Eigen::Index c = 0; c < noise.size(); ++c) {
    // Leads are few: chance alone does not move what a fit of all windows told.
    const bool is_sure = std::abs(2 * std::log(factor[c])) > surely * leads.OfChannel(c).error;
    if (is_sure && std::isfinite(factor[c])) {
      corrected[c] *=
          problem_.noise_of_other_logs ? factor[c] : std::clamp(factor[c], kLeastCorrection, kLargestCorrection);
      corrected[c] = std::min(corrected[c], largest_noise_[c]);
    }
  }
  return corrected;
}

VectorXd Imitator::ErrorOfNoise() const {
  const Eigen::Index n_channels = noise_.size();
  if (is_exact_ || problem_.noise_rows == 0) return VectorXd::Zero(n_channels);
  const double n_steps = problem_.readings.ShortestWindow();
  const double of_starts = problem_.readings.state_dim() / static_cast<double>(n_channels);
  const double freedom = problem_.noise_rows * std::max(kLeastFreedomOfRow, (n_steps + 1 - of_starts) / n_steps);
  const double error = std::sqrt(kVarianceOfMedian / freedom);
  return VectorXd::Constant(n_channels, std::max(0.0, error - kNoiseAllowed));
}

}  // namespace oted
