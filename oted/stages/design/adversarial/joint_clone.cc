#include "oted/stages/design/adversarial/joint_clone.h"

#include <fmt/format.h>

namespace oted {
namespace {

constexpr int kBatch = 256;
const std::vector<int> kCriticHidden = {256, 256};

ValueDiceUpdate MakeUpdate(const TanhGaussianPolicy& clone, const AdversarialConfig& config, RngKey key) {
  Rng rng = key.MakeRng();
  return {clone, kCriticHidden, {.actor_learning_rate = config.clone_rate, .replay_share = config.clone_replay}, rng};
}

}  // namespace

JointClone::JointClone(const TanhGaussianPolicy& clone, const Dataset& logs, const AdversarialConfig& config,
                       RngKey key)
    : config_(config), logs_(logs, clone), update_(MakeUpdate(clone, config, key)), policy_(clone) {}

void JointClone::Add(const std::vector<LaneExperience>& experience) {
  Dataset steps;
  for (const LaneExperience& lane : experience) {
    if (lane.steps.size() == 0) continue;
    steps.Append(lane.steps);
    steps.timeouts.back() = 1;  // the next lane's steps are another rollout's
  }
  if (steps.size() == 0) return;
  replay_.emplace_back(steps, policy_);
  if (static_cast<int>(replay_.size()) > config_.replay_iterations) replay_.pop_front();
}

double JointClone::Update(Rng& rng, bool moves) {
  if (replay_.empty()) return 0;
  double objective = 0;
  for (int step = 0; step < config_.clone_updates; ++step) {
    DrawValueDiceBatch(logs_, &replay_, kBatch, update_.actor(), rng, batch_);
    objective += update_.Step(batch_, moves).objective / config_.clone_updates;
  }
  policy_ = update_.actor();
  return objective;
}

void JointClone::Save(NpzArrays& arrays) {
  update_.Save(arrays);
  for (size_t i = 0; i < replay_.size(); ++i) replay_[i].Save(fmt::format("imitation/{:03}", i), arrays);
}

void JointClone::Restore(const NpzArrays& arrays, const std::string& where) {
  update_.Restore(arrays, where);
  policy_ = update_.actor();
  replay_.clear();
  for (size_t i = 0;; ++i) {
    const std::string prefix = fmt::format("imitation/{:03}", i);
    if (!arrays.contains(prefix + "/states")) break;
    replay_.push_back(ImitationRows::FromArrays(prefix, arrays, where));
  }
}

}  // namespace oted
