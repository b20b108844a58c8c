#pragma once
/// What fits with a suspect share: the logs that learn, how their readings are held, where x begins. Not in the paper.

#include <Eigen/Dense>

#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/replay/reading_model.h"
#include "oted/stages/design/trajectories/freed.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

constexpr int kFreedRows = 1600;  // of the windows that are fitted
constexpr int kFewestFreedWindows = 4, kFewestFreedSteps = 4, kFewestLongWindows = 16;
constexpr int kFirstIterations = 12, kLaterIterations = 6;  // of short windows, and as they grow

class SuspectFits {
 public:
  explicit SuspectFits(const FreedProblem& problem);

  const FreedProblem& problem() const { return problem_; }
  double period_s() const { return period_; }
  const Eigen::VectorXd& noise() const { return noise_; }
  const HeldOutParts& parts() const { return parts_; }
  /// What the design found without the part that judges.
  const Eigen::VectorXd& x() const { return x_; }
  bool LearnsFromAll() const { return parts_.judge.size() == problem_.dataset.size(); }

  ReadingModel ReadingsOf(const SimulatorFactory& factory) const;
  WindowReplayer Replayer(const SimulatorFactory& factory, const ReadingModel& readings) const;
  /// Steps of short windows.
  int ShortSteps() const;
  /// Of x and of the further parameter, which has the prior of those that are searched.
  Prior PriorIn(const ParameterSpace& space) const;
  /// x, and behind it what a further parameter of this value has.
  static Eigen::VectorXd StartOf(const SimulatorFactory& wider, const Eigen::VectorXd& x, double value);
  /// @throws Interrupted when a stop was requested
  void Descend(LevelFit& fit, int n_iterations) const;

 private:
  const FreedProblem& problem_;
  double period_;
  Eigen::VectorXd noise_;
  HeldOutParts parts_;
  Eigen::VectorXd x_;
};

}  // namespace oted
