#include "oted/sim/mujoco/model_rules.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/base/error.h"

namespace oted {
namespace {

double SumOfSquares(std::span<const double> values) {
  return std::transform_reduce(values.begin(), values.end(), 0.0, std::plus<>(), [](double v) { return v * v; });
}

void Write(const std::vector<ModelPlan::Target>& targets, std::span<const double> values, const LaneState& state) {
  for (size_t i = 0; i < targets.size(); ++i) {
    const ModelPlan::Target& target = targets[i];
    if (target.part == StatePart::kQpos) state.qpos[target.index] = values[i];
    if (target.part == StatePart::kQvel) state.qvel[target.index] = values[i];
    if (target.part == StatePart::kAct) state.act[target.index] = values[i];
  }
}

std::string Numbered(const std::string& name, size_t i, size_t n) {
  return n == 1 ? name : fmt::format("{}[{}]", name, i);
}

}  // namespace

ModelPlan::Element ModelPlan::Add(const std::string& array, int index, int needed_stage) {
  stage = std::max(stage, needed_stage);
  auto found = std::find(arrays.begin(), arrays.end(), array);
  if (found == arrays.end()) found = arrays.insert(arrays.end(), array);
  return {static_cast<size_t>(found - arrays.begin()), static_cast<size_t>(index)};
}

ModelRules::ModelRules(std::shared_ptr<const ModelPlan> plan)
    : plan_(std::move(plan)), period_(plan_->control_period), action_(static_cast<size_t>(plan_->n_actions)) {
  if (plan_->reward.empty() && plan_->terminate.empty()) return;
  for (const ModelPlan::Quantity& q : plan_->quantities) n_numbers_ += static_cast<int>(q.elements.size());
  // No vector may move from here on: the expressions point into them.
  numbers_.resize(static_cast<size_t>(n_numbers_));
  rates_.resize(numbers_.size());
  sums_.resize(1 + plan_->quantities.size());
  const auto name = [&](const std::string& variable, double& value) {
    if (Expression::IsReserved(variable) || !variables_.emplace(variable, &value).second) {
      throw UsageError(
          fmt::format("task.quantities: '{}' is the name of something else in expressions; rename it", variable));
    }
  };
  name("t", time_);
  name("dt", period_);
  name("sum2_action", sums_[0]);
  for (size_t i = 0; i < action_.size(); ++i) name(fmt::format("action[{}]", i), action_[i]);
  size_t at = 0;
  for (size_t k = 0; k < plan_->quantities.size(); ++k) {
    const ModelPlan::Quantity& q = plan_->quantities[k];
    for (size_t i = 0; i < q.elements.size(); ++i, ++at) {
      name(Numbered(q.name, i, q.elements.size()), numbers_[at]);
      name(Numbered("d_" + q.name, i, q.elements.size()), rates_[at]);
    }
    name("sum2_" + q.name, sums_[1 + k]);
  }
  if (!plan_->reward.empty()) reward_.emplace(plan_->reward, variables_, "task.reward");
  if (!plan_->terminate.empty()) terminate_.emplace(plan_->terminate, variables_, "task.terminate");
}

void ModelRules::DrawStart(Rng& rng, const LaneState& state) const {
  if (plan_->logged_starts.rows() > 0) {
    SetState(plan_->logged_starts.row(static_cast<int>(rng.Below(static_cast<uint64_t>(plan_->logged_starts.rows())))),
             state);
  }
  const double noise = plan_->start_noise;
  if (noise == 0) return;
  std::vector<double> change(state.qvel.size());
  for (double& c : change) c = rng.Uniform(-noise, noise);
  mj_integratePos(plan_->model, state.qpos.data(), change.data(), 1);
  for (double& v : state.qvel) v += rng.Uniform(-noise, noise);
}

bool ModelRules::Determines(std::span<const double> observation) const {
  return std::all_of(plan_->quaternions.begin(), plan_->quaternions.end(), [&](const std::array<int, 4>& quaternion) {
    double sum = 0;
    for (const int i : quaternion) sum += observation[static_cast<size_t>(i)] * observation[static_cast<size_t>(i)];
    return sum > 1e-6;
  });
}

void ModelRules::SetState(std::span<const double> observation, const LaneState& state) const {
  Write(plan_->targets, observation, state);
  for (const Follower& follower : plan_->followers) Follow(follower, state);
  // Logged quaternions are rounded.
  mj_normalizeQuat(plan_->model, state.qpos.data());
}

void ModelRules::SetHidden(std::span<const double> hidden, const LaneState& state) const {
  Write(plan_->hidden, hidden, state);
}

void ModelRules::Measure(const LaneView& view, std::span<double> numbers) const {
  auto out = numbers.begin();
  for (const ModelPlan::Quantity& q : plan_->quantities) {
    for (const ModelPlan::Element& e : q.elements) *out++ = view[e.array][e.index];
  }
}

void ModelRules::Begin(const LaneView& view, std::span<double> memory) {
  if (n_numbers_ > 0) Measure(view, memory);
}

double ModelRules::Evaluate(const Expression& expression, const char* key) const {
  const double value = expression.Evaluate();
  if (std::isfinite(value)) return value;
  std::vector<std::string> values;
  for (const auto& [name, number] : variables_) values.push_back(fmt::format("{} = {:.4g}", name, *number));
  throw DataError(fmt::format("task '{}': {} \"{}\" is {} where {}; guard it, for example with max(...)", plan_->task,
                              key, expression.text(), value, fmt::join(values, ", ")));
}

StepOutcome ModelRules::Finish(const LaneView& view, std::span<const double> action, double time,
                               std::span<double> memory) {
  if (!reward_ && !terminate_) return {};
  time_ = time;
  std::copy(action.begin(), action.end(), action_.begin());
  sums_[0] = SumOfSquares(action_);
  Measure(view, numbers_);
  for (size_t i = 0; i < numbers_.size(); ++i) rates_[i] = (numbers_[i] - memory[i]) / period_;
  size_t at = 0;
  for (size_t k = 0; k < plan_->quantities.size(); ++k) {
    const size_t n = plan_->quantities[k].elements.size();
    sums_[1 + k] = SumOfSquares(std::span(numbers_).subspan(at, n));
    at += n;
  }
  std::copy(numbers_.begin(), numbers_.end(), memory.begin());
  StepOutcome outcome;
  if (reward_) outcome.reward = Evaluate(*reward_, "task.reward");
  if (terminate_) outcome.terminated = Evaluate(*terminate_, "task.terminate") != 0;
  return outcome;
}

void ModelRules::Observe(const LaneView& view, std::span<double> observation) const {
  for (size_t i = 0; i < observation.size(); ++i) {
    const ModelPlan::Element& e = plan_->observation[i];
    observation[i] = view[e.array][e.index];
  }
}

}  // namespace oted
