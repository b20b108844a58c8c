#pragma once
/// Settings of stage 2, the design.

#include <string>

#include "oted/base/fields.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/experience.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/images/ratio_matching.h"
#include "oted/stages/design/rivals/dropo.h"
#include "oted/stages/design/rivals/least_squares.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted {

/// How q(z) is found, from which evidence, how much of it, and how q(z) and g move. The form sets the rest together:
///   "auto"          trajectories where the simulator's state can be set from an observation, and where its answer is
///                   outside the family what held-out logs prefer (form_choice.h); otherwise paper; with parameters of
///                   the sensors (obs/...) transitions: their noise cannot be fitted step by step
///   "trajectories"  windows of the log replayed, their start states unknown too: least squares that weighs channels
///                   and windows by what they tell
///   "transitions"   Algorithm 1 with logged actions replayed from logged states, g(s, a, s'), short rollouts
///   "paper"         Algorithm 1 to the letter: the clone rolled out from the initial states, g(s, a)
///   "least-squares" predictions from logged states taken as exact: what identification tools do
///   "dropo"         Tiboni et al.'s likelihood of the logged next states
///   "images"        a convolutional g that is told z, trained in simulators alone; q is its posterior given the
///                   first steps of each episode. What auto is where observations are images
struct DesignConfig {
  std::string form = "auto";
  std::string starts = "dataset";
  std::string actions = "replayed";
  std::string discriminator = "sas";
  int horizon = 10;
  int n_steps = 60;
  double clone_noise = 1.0;
  int clone_updates = 0;
  double clone_replay = 0.1;
  double clone_rate = 1e-5;
  std::string rows = "all";
  int stack = 1;

  int trajectory_window = 16;
  int trajectory_rows = 960;
  int trajectory_starts = 3;
  int trajectory_coarse = 64;

  int least_squares_horizon = 2;
  int least_squares_rows = 1000;
  int least_squares_starts = 5;

  int dropo_horizon = 1;
  int dropo_transitions = 100;
  int dropo_samples = 20;
  int dropo_budget = 800;
  double dropo_epsilon = 1e-5;
  bool dropo_learn_epsilon = false;

  int n_iterations = 100;
  int n_sims = 32;
  double step_mean = 0.5;
  double step_log_std = 0.25;
  double lambda = 0.01;
  std::string prior = "uniform";
  double initial_std = 1.2;
  double reward_floor = 1e-6;
  std::string designer = "gaussian";
  double grid_step = 0.05;
  double average = 0.0;
  std::string reward = "paper";

  std::vector<int> discriminator_hidden = {256, 256};
  std::vector<int> discriminator_filters = {16};
  double discriminator_learning_rate = 3e-4;
  double discriminator_weight_decay = 1e-4;
  int discriminator_steps = 60;
  int discriminator_batch = 256;
  int replay_iterations = 10;

  bool by_auto = false;  ///< no setting: the form was left to auto, and is what Resolved made of it

  /// The defaults of a form. @throws UsageError for an unknown one.
  static DesignConfig ForForm(const std::string& form);
  /// For a simulator that cannot be set to logged states: rollouts begin at its own starts and the clone acts. A
  /// horizon and a number of steps still at the form's defaults become the paper form's. @return whether anything
  /// changed
  bool AdaptToFixedStarts();
  /// `auto` settled for a simulator and its parameters; what was set stays.
  /// @throws UsageError for a form that sets states where they cannot be set
  DesignConfig Resolved(const ParameterSpace& space, const SimulatorSpec& spec) const;
  /// The same in another form: what differs from the present form's defaults stays.
  DesignConfig InForm(const std::string& other) const;
  FieldList Fields();
  /// @throws UsageError when settings contradict each other.
  void Check() const;

  /// Whether the form finds q by replays of the log, without a discriminator.
  bool FitsByReplay() const;

  /// Complete with what the simulator adds: past actions and the image's shape.
  EvidenceConfig Evidence(const SimulatorSpec& spec) const;
  RatioMatchingOptions Ratios(const SimulatorSpec& spec) const;
  TrajectoryOptions Trajectories() const;
  LeastSquaresOptions LeastSquares() const;
  DropoOptions Dropo() const;
  DiscriminatorOptions Discriminator() const;
  /// What `prior` stands for. @throws UsageError, DataError (oted/stages/design/prior_source.h)
  Prior MakePrior(const ParameterSpace& space) const;
  /// q before the first iteration, at its prior. @throws UsageError where a categorical one has no two values of a
  /// parameter
  Designer Start(const ParameterSpace& space) const;
};

}  // namespace oted
