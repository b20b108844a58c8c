#pragma once
/// One part of the logs that a simulator is judged by (prediction_evidence.h).

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/replay/prediction_evidence.h"

namespace oted {

/// How a part of the logs is predicted, and how a simulator's own logs of the same windows are.
class JudgedPart {
 public:
  /// @param problem  what it refers to must outlive this object, as `logs` must
  JudgedPart(const PredictionProblem& problem, const Dataset& logs, const std::vector<int>& horizons, double period_s);

  /// Of stretches of the caller's choice. @param rows  where they begin; @param n_steps  predicted behind the lead
  JudgedPart(const PredictionProblem& problem, const Dataset& logs, const std::vector<int>& rows, int n_steps,
             double period_s);

  const PredictionJudge& judge() const { return judge_; }

  /// How the simulator at z predicts the windows, as near as the ways to find their starts allow: fitted to the leads,
  /// or what the readings alone say, whichever is nearer at a horizon. Where a lag of readings is searched, and z has
  /// none, the first readings of a lead tell of its start as well.
  PredictionJudge::Squares PredictNearest(const std::vector<double>& z) const;

  /// Where `n_steps` stand among the horizons; none where too few windows are that long.
  std::optional<size_t> Find(int n_steps, int fewest) const;

  /// As PredictionJudge::Predict, of logs that the simulator at z made itself.
  /// @param followed  its PredictionJudge::Follow
  PredictionJudge::Squares PredictItself(const std::vector<double>& z, const std::vector<Eigen::VectorXd>& followed,
                                         const Eigen::VectorXd& noise, Rng& rng) const;

 private:
  WindowReplayer Replayer(const Dataset& logs) const;
  /// Whether readings may be late, and none is at z.
  bool IsPrompt(const std::vector<double>& z) const;

  const PredictionProblem& problem_;
  const Dataset& logs_;
  WindowReplayer replayer_;
  PredictionJudge judge_;
};

/// How errors over one of the judge's horizons compare, without a floor. @param h  into its horizons
/// @param designed, other  (channels, windows): mean squared errors over it
HeldOutPrediction::Horizon ErrorsOver(const PredictionJudge& judge, size_t h, double seconds,
                                      const Eigen::MatrixXd& designed, const Eigen::MatrixXd& other);

/// Nothing of a channel that is not judged.
Estimated IfJudged(const PredictionJudge& judge, size_t c, const PredictionRatios& ratios);

/// A simulator's predictions of logs that it made itself: by draw of the noise, by part.
using Imitations = std::vector<std::vector<PredictionJudge::Squares>>;

/// (channels), of (channels, windows): windows in which the physics broke down do not count.
Eigen::VectorXd RootMeanSquares(const Eigen::MatrixXd& squares);
/// The windows of `a`, and behind them those of `b`.
Eigen::MatrixXd Beside(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// Several draws of the same windows, one behind the other; and their mean. At least one.
Eigen::MatrixXd AllBeside(const std::vector<Eigen::MatrixXd>& draws);
Eigen::MatrixXd MeanOf(const std::vector<Eigen::MatrixXd>& draws);

/// Of each channel, the median over windows; those that broke down count as the largest.
Eigen::VectorXd Medians(const Eigen::MatrixXd& squares);

}  // namespace oted
