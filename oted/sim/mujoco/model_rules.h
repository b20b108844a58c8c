#pragma once
/// A task file's observations, reward, termination and starts as TaskRules.

#include <mujoco/mujoco.h>

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/mujoco/expression.h"
#include "oted/sim/mujoco/followers.h"
#include "oted/sim/mujoco/observables.h"
#include "oted/sim/mujoco/task_rules.h"

namespace oted {

/// A task file resolved against its model; shared by all simulators of a factory, read-only.
struct ModelPlan {
  /// Entry `index` of array `array` of `arrays`.
  struct Element {
    size_t array = 0;
    size_t index = 0;
  };
  struct Quantity {
    std::string name;
    std::vector<Element> elements;
  };
  /// Where an observed number goes when the state is set from an observation.
  struct Target {
    StatePart part = StatePart::kNone;
    size_t index = 0;
  };

  const mjModel* model = nullptr;
  std::string task;                 ///< for messages
  std::vector<std::string> arrays;  ///< as TaskRules::arrays() gives them
  int stage = mjSTAGE_NONE;
  std::vector<Element> observation;
  std::vector<Target> targets;                  ///< parallel to `observation`
  std::vector<Target> hidden;                   ///< parallel to the spec's hidden coordinates
  std::vector<Follower> followers;              ///< of what is observed or hidden
  std::vector<std::array<int, 4>> quaternions;  ///< positions in the observation of those that are seen as a whole
  std::vector<Quantity> quantities;
  std::string reward, terminate;  ///< "" for none
  double control_period = 0;      ///< [s]
  int n_actions = 0;
  double start_noise = 0;
  Array2<double> logged_starts;  ///< (n, obs_dim), or empty

  /// Adds what an observable needs and says where it is.
  Element Add(const std::string& array, int index, int needed_stage);
};

/// Names in expressions: `t` [s], `dt` [s], `action[i]`, `sum2_action`, and for every quantity q: `q`, `d_q` (its rate
/// of change over the last control step) and `sum2_q`; q[i] and d_q[i] where it has several numbers.
class ModelRules : public TaskRules {
 public:
  /// @throws UsageError for an expression that does not read.
  explicit ModelRules(std::shared_ptr<const ModelPlan> plan);

  const ModelPlan& plan() const { return *plan_; }
  const std::vector<std::string>& arrays() const override { return plan_->arrays; }
  int stage() const override { return plan_->stage; }
  int memory_size() const override { return n_numbers_; }  // the quantities after the last control step
  /// A logged start, drawn uniformly, or the fixed one; noise on top. Rotations turn by a random rotation vector.
  void DrawStart(Rng& rng, const LaneState& state) const override;
  bool Determines(std::span<const double> observation) const override;
  void SetState(std::span<const double> observation, const LaneState& state) const override;
  void SetHidden(std::span<const double> hidden, const LaneState& state) const override;
  void Begin(const LaneView& view, std::span<double> memory) override;
  /// @throws DataError when an expression gives no finite number.
  StepOutcome Finish(const LaneView& view, std::span<const double> action, double time,
                     std::span<double> memory) override;
  void Observe(const LaneView& view, std::span<double> observation) const override;

 private:
  void Measure(const LaneView& view, std::span<double> numbers) const;
  double Evaluate(const Expression& expression, const char* key) const;

  std::shared_ptr<const ModelPlan> plan_;
  int n_numbers_ = 0;  // of all quantities together; 0 where no expression reads them
  double time_ = 0, period_ = 0;
  std::vector<double> action_, numbers_, rates_;
  std::vector<double> sums_;                  // of squares: of the action, then of each quantity
  std::map<std::string, double*> variables_;  // into the above
  std::optional<Expression> reward_, terminate_;
};

}  // namespace oted
