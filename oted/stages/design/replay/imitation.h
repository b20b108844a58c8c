#pragma once
/// The floor under a prediction's error (prediction_evidence.h): simulators predict logs that they made themselves,
/// with the sensors' noise.

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <vector>

#include "oted/stages/design/replay/judged_part.h"

namespace oted {

inline constexpr double kNoNoise = 1e-5;  ///< of a channel's spread: such noise is none, as of single precision

class Imitator {
 public:
  using Parts = std::vector<std::unique_ptr<JudgedPart>>;

  /// What it is given must outlive it. @param parts  at least one; @param tell  called after each step
  Imitator(const PredictionProblem& problem, const Parts& parts, std::function<void()> tell);

  /// Whether readings are the state, without noise: there is nothing to find in logs of its own.
  bool IsExact() const { return is_exact_; }
  /// Whether chance is told by more draws: few windows scatter more than a few blocks of them say.
  bool HasFewWindows() const;
  /// Of Imitate, at most. @param n_as_likely  how many z it is given beside z
  size_t Steps(size_t n_as_likely) const;
  /// What the simulator at z makes of the logs, with noise by which its own leads leave as much as the logs' do.
  /// @param of_parts   its prediction of each part
  /// @param as_likely  as PredictionProblem::as_likely, of this simulator
  Imitations Imitate(const std::vector<double>& z, const std::vector<const PredictionJudge::Squares*>& of_parts,
                     const std::vector<std::vector<double>>& as_likely) const;
  /// (channels): standard errors of the logarithm of the sensors' variance, which a median of squared residuals tells
  /// (NoiseVariance), where starts took freedom from these; beyond what the least excess that counts allows for.
  Eigen::VectorXd ErrorOfNoise() const;

 private:
  int Corrections() const;
  size_t FewestImitations() const;
  /// The noise with which a simulator's own logs leave as much in the leads as the logs do.
  /// @param logged, made  (channels, windows): what leads of the logs leave, and those of logs made with `noise`
  Eigen::VectorXd Corrected(const Eigen::VectorXd& noise, const Eigen::MatrixXd& logged,
                            const Eigen::MatrixXd& made) const;

  const PredictionProblem& problem_;
  const Parts& parts_;
  std::function<void()> tell_;
  Eigen::VectorXd largest_noise_, noise_;  // of the sensors
  bool is_exact_ = false;
};

}  // namespace oted
