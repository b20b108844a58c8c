#pragma once
/// What a design's predictions leave more than the floor (HeldOutPrediction), channel by channel.

#include <Eigen/Dense>
#include <map>
#include <optional>
#include <vector>

#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/replay/prediction_ratios.h"

namespace oted {

struct OddEpisodes {
  std::vector<int> numbers;  ///< the farthest off first
  bool surely = false;       ///< one of them is, by more than chance
};

/// Episodes that are predicted far worse than most: their mean excess is that of twice the floor's error; or surely
/// that of 1.4 times it, by four standard errors more than the middle one's. None where that is 1.4 times, too.
/// @param excess  of the windows of each episode
OddEpisodes FindOddEpisodes(const std::map<int, std::vector<double>>& excess);

/// (channels, windows) each: mean squared errors. Channel c = channels is all of them together.
class ExcessOverFloor {
 public:
  struct Inputs {
    const Eigen::MatrixXd& designed;            ///< of all windows, those that judge first
    const std::vector<Eigen::MatrixXd>& draws;  ///< of the same windows as the design itself would have logged them
    const Eigen::MatrixXd& floor;               ///< AllBeside(draws)
    /// Draws of another simulator's; may be empty. Where it surely predicts logs of its own better than the design
    /// predicts those of its own, sensors leave no more than that.
    std::vector<Eigen::MatrixXd> draws_of_other;
    Eigen::Index n_judged = 0;       ///< windows that judge
    double times_scatter = 1;        ///< what the draws' scatter counts as an error
    Eigen::VectorXd error_of_noise;  ///< (channels): of the logarithm of the sensors' variance
  };
  ExcessOverFloor(const Inputs& in, const JudgedChannels& channels);

  /// In a typical window; of sums over all of them where some are far off (IsInSome).
  Estimated Of(Eigen::Index c) const { return IsInSome(c) ? in_sum_.OfChannel(c) : Typical(c); }
  /// Whether the sums surely say twice the floor's error or more, and more than a typical window does: what is far off
  /// in some drowns in what all others show.
  bool IsInSome(Eigen::Index c) const;
  /// By which logarithm the error of the windows that judge is told to exceed the floor: what is sure as it is in all
  /// windows, and else as it is in these.
  double Shown(Eigen::Index c) const { return IsSure(Typical(c)) ? Typical(c).value : in_judged_.OfChannel(c).value; }

 private:
  Estimated Typical(Eigen::Index c) const {
    return lower_ && IsSure(lower_->OfChannel(c)) ? over_lower_->OfChannel(c) : typical_.OfChannel(c);
  }

  PredictionRatios typical_, in_judged_, in_sum_;
  std::optional<PredictionRatios> lower_, over_lower_;
};

}  // namespace oted
