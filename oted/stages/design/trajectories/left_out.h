#pragma once
/// Fits judged by recordings that they leave out, each in its turn. A design is for motions that it has not seen; other
/// parts of a recording that it learned from are more of the same motion, and hardly tell fits apart.

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/held_out.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

inline constexpr int kMostLeftOut = 6;
/// Steps of a fit that goes on without a part of its logs.
inline constexpr int kStepsWithoutPart = 1;

/// Logs in up to kMostLeftOut parts. Of three recordings or more no part has less than a whole one; fewer are cut in
/// time. Logs that give no two parts of 1.4 s have none.
class LeftOutRecordings {
 public:
  struct Logs {
    const SimulatorFactory& factory;
    const HeldOutParts& parts;  ///< whose part that learns is meant
    const ReadingModel& readings;
    const Eigen::VectorXd& noise;  ///< (obs_dim): standard deviations
    double predicted_s;            ///< what is predicted, open loop [s]
  };
  LeftOutRecordings(const Logs& logs, int n_threads);

  /// How each part is predicted beside the nominal simulator. @param errors  ErrorsAt's or ErrorsOf's
  LeftOutInTurn BesideNominal(const Eigen::MatrixXd& errors, const Eigen::MatrixXd& of_nominal) const;

  int n_parts() const { return static_cast<int>(parts_.size()); }
  int n_windows() const;
  /// Which part a window of the logs touches: flags of windows that have to go where it is left out.
  std::vector<char> Touches(const std::vector<LogWindow>& windows, int part) const;
  /// (channels, windows): PredictionJudge::MeanSquares of all parts.
  Eigen::MatrixXd ErrorsAt(const Eigen::VectorXd& x) const;
  /// The same, each part predicted by a fit that goes on without it from where `fit` is.
  /// @param tell  called after every step
  Eigen::MatrixXd ErrorsOf(const LevelFit& fit, const std::function<void()>& tell) const;

 private:
  struct Part {
    Dataset logs;
    std::vector<int> episodes;  ///< LeftOutPart::episodes
    std::unique_ptr<WindowReplayer> replayer;
    std::unique_ptr<PredictionJudge> judge;
  };
  Eigen::MatrixXd Errors(const std::function<Eigen::VectorXd(int)>& x_of) const;

  const ParameterSpace& space_;
  bool recordings_ = false;
  std::vector<int> part_of_row_;
  std::vector<Part> parts_;
};

}  // namespace oted
