#include "oted/rl/multi_step.h"

#include "oted/base/error.h"

namespace oted {

MultiStepRows::MultiStepRows(int n_lanes, int n_steps, double gamma, ReplayBuffer& buffer)
    : n_steps_(static_cast<size_t>(n_steps)), gamma_(gamma), buffer_(buffer), lanes_(static_cast<size_t>(n_lanes)) {
  OTED_CHECK(n_steps >= 1);
}

void MultiStepRows::Add(int lane, std::span<const double> observation, std::span<const double> action, double reward,
                        std::span<const double> next_observation, bool terminated) {
  Lane& now = lanes_[static_cast<size_t>(lane)];
  now.open.push_back({{observation.begin(), observation.end()}, {action.begin(), action.end()}, reward});
  now.next_observation.assign(next_observation.begin(), next_observation.end());
  if (terminated) {
    while (!now.open.empty()) AddOldest(now, true);
  } else if (now.open.size() == n_steps_) {
    AddOldest(now, false);
  }
}

void MultiStepRows::Cut(int lane) {
  Lane& now = lanes_[static_cast<size_t>(lane)];
  while (!now.open.empty()) AddOldest(now, false);
}

void MultiStepRows::AddOldest(Lane& lane, bool terminated) {
  double reward = 0, discount = 1;
  for (const Step& step : lane.open) {
    reward += discount * step.reward;
    discount *= gamma_;
  }
  buffer_.Add(lane.open.front().observation, lane.open.front().action, reward, lane.next_observation,
              terminated ? 0 : discount);
  lane.open.erase(lane.open.begin());
}

}  // namespace oted
