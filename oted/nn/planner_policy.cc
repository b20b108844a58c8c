#include "oted/nn/planner_policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "oted/base/error.h"
#include "oted/nn/npz_fields.h"

namespace oted {
namespace {

const std::string kPlannerPrefix = "planner";

/// Trajectories of member k of n_members.
int CountOf(int k, int n_members, int trajectories) {
  return trajectories / n_members + (k < trajectories % n_members);
}

/// Plans for rows of observations. Scratch memory is kept from step to step.
class Planner : public PolicyActor {
 public:
  explicit Planner(const PlannerPolicy& policy)
      : policy_(policy),
        act_dim_(static_cast<size_t>(policy.act_dim())),
        plan_size_(static_cast<size_t>(policy.options().horizon) * act_dim_) {}

  void Begin(int n) override { plans_.assign(static_cast<size_t>(n) * plan_size_, 0.0f); }

  void Keep(std::span<const int> rows) override {
    std::vector<float> kept;
    for (const int row : rows) {
      const auto begin = plans_.begin() + static_cast<ptrdiff_t>(static_cast<size_t>(row) * plan_size_);
      kept.insert(kept.end(), begin, begin + static_cast<ptrdiff_t>(plan_size_));
    }
    plans_ = std::move(kept);
  }

  void Act(std::span<const double> observations, int n, ActionStreams streams, std::span<double> actions) override {
    const size_t n_rows = static_cast<size_t>(n), obs_dim = static_cast<size_t>(policy_.obs_dim());
    if (plans_.size() != n_rows * plan_size_) Begin(n);
    states_.resize(observations.size());
    for (size_t i = 0; i < n_rows; ++i) {
      policy_.units().observation.Apply(observations.subspan(i * obs_dim, obs_dim),
                                        {states_.data() + i * obs_dim, obs_dim});
    }
    const size_t n_trajectories = static_cast<size_t>(policy_.options().trajectories);
    planned_.resize(n_rows * n_trajectories * plan_size_);
    returns_.resize(n_rows * n_trajectories);
    size_t first = 0;
    for (size_t k = 0; k < policy_.members().size(); ++k) {
      const int count =
          CountOf(static_cast<int>(k), static_cast<int>(policy_.members().size()), policy_.options().trajectories);
      if (count > 0) Simulate(policy_.members()[k], n, first, count, streams);
      first += static_cast<size_t>(count);
    }
    for (size_t i = 0; i < n_rows; ++i) {
      Average(i);
      for (size_t j = 0; j < act_dim_; ++j) {
        const double low = policy_.units().action_low[j], high = policy_.units().action_high[j];
        actions[i * act_dim_ + j] = 0.5 * (low + high) + 0.5 * (high - low) * plans_[i * plan_size_ + j];
      }
    }
  }

 private:
  float* Planned(size_t row, size_t trajectory) {
    return planned_.data() + (row * static_cast<size_t>(policy_.options().trajectories) + trajectory) * plan_size_;
  }
  double& Return(size_t row, size_t trajectory) {
    return returns_[row * static_cast<size_t>(policy_.options().trajectories) + trajectory];
  }

  /// Trajectories [first, first + count) of every row, by one member.
  void Simulate(const PlannerMember& member, int n, size_t first, int count, ActionStreams streams) {
    const PlanOptions& options = policy_.options();
    const PlannerUnits& units = policy_.units();
    const size_t obs_dim = static_cast<size_t>(policy_.obs_dim()), width = obs_dim + act_dim_,
                 each = static_cast<size_t>(count), rows = static_cast<size_t>(n) * each;
    input_.resize(rows * width);
    noise_.resize(rows * act_dim_);
    for (size_t b = 0; b < rows; ++b) {
      std::copy_n(states_.data() + b / each * obs_dim, obs_dim, input_.data() + b * width);
      std::copy_n(plans_.data() + b / each * plan_size_, act_dim_, input_.data() + b * width + obs_dim);
      Return(b / each, first + b % each) = 0;
    }
    for (size_t t = 0; t < static_cast<size_t>(options.horizon); ++t) {
      streams.FillNormal({noise_.data(), noise_.size()}, n);
      const float* prior = pass_.Forward(member.prior, input_.data(), static_cast<int>(rows));
      for (size_t b = 0; b < rows; ++b) {
        const float* former = plans_.data() + b / each * plan_size_ + t * act_dim_;
        float* planned = Planned(b / each, first + b % each) + t * act_dim_;
        for (size_t j = 0; j < act_dim_; ++j) {
          const double drawn = prior[b * act_dim_ + j] + options.noise * noise_[b * act_dim_ + j];
          const double action = (1 - options.keep) * drawn + options.keep * former[j];
          planned[j] = std::isfinite(action) ? static_cast<float>(std::clamp(action, -1.0, 1.0)) : 0.0f;
          input_[b * width + obs_dim + j] = planned[j];
        }
      }
      const float* next = pass_.Forward(member.dynamics, input_.data(), static_cast<int>(rows));
      for (size_t b = 0; b < rows; ++b, next += obs_dim + 1) {
        Return(b / each, first + b % each) += units.reward_mean + units.reward_scale * next[obs_dim];
        std::copy_n(next, obs_dim, input_.data() + b * width);
      }
    }
    AddValues(first, each, rows);
  }

  /// The mean over all members of what follows at the plan's last state, with its last action.
  void AddValues(size_t first, size_t each, size_t rows) {
    const PlannerUnits& units = policy_.units();
    for (const PlannerMember& member : policy_.members()) {
      const float* value = value_pass_.Forward(member.value, input_.data(), static_cast<int>(rows));
      for (size_t b = 0; b < rows; ++b) {
        Return(b / each, first + b % each) +=
            (units.value_mean + units.value_scale * value[b]) / static_cast<double>(policy_.members().size());
      }
    }
  }

  /// The plan of a row: its trajectories' mean, weighted. A model that broke down has no say.
  void Average(size_t row) {
    const size_t n = static_cast<size_t>(policy_.options().trajectories);
    double best = -std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < n; ++k) {
      if (std::isfinite(Return(row, k))) best = std::max(best, Return(row, k));
    }
    const bool any = std::isfinite(best);
    std::vector<double> mean(plan_size_, 0.0);
    double sum = 0;
    for (size_t k = 0; k < n; ++k) {
      const double value = Return(row, k);
      if (any && !std::isfinite(value)) continue;
      const double weight = any ? std::exp(policy_.options().sharpness * (value - best)) : 1;
      sum += weight;
      for (size_t i = 0; i < plan_size_; ++i) mean[i] += weight * Planned(row, k)[i];
    }
    for (size_t i = 0; i < plan_size_; ++i) plans_[row * plan_size_ + i] = static_cast<float>(mean[i] / sum);
  }

  const PlannerPolicy& policy_;
  size_t act_dim_, plan_size_;
  std::vector<float> plans_;            // (rows, H, act_dim)
  AlignedVector<float> states_;         // (rows, obs_dim), normalised
  std::vector<float> planned_;          // (rows, N, H, act_dim)
  std::vector<double> returns_;         // (rows, N)
  AlignedVector<float> input_, noise_;  // of one member's trajectories
  MlpPass pass_, value_pass_;
};

void Append(std::vector<float>& all, const Mlp& net) {
  all.insert(all.end(), net.parameters().begin(), net.parameters().end());
}

/// Whether all are finite, and scales above 0; decided before anything is allocated by a file's word.
bool AreSound(const PlannerUnits& units) {
  const Normalizer& observation = units.observation;
  const auto finite = [](const std::vector<double>& values) {
    return !values.empty() && std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
  };
  if (!finite(observation.mean) || !finite(observation.scale) || observation.mean.size() != observation.scale.size()) {
    return false;
  }
  if (!finite(units.action_low) || !finite(units.action_high) || units.action_low.size() != units.action_high.size()) {
    return false;
  }
  for (size_t j = 0; j < units.action_low.size(); ++j) {
    if (units.action_low[j] >= units.action_high[j]) return false;
  }
  return finite({units.reward_mean, units.reward_scale, units.value_mean, units.value_scale}) &&
         units.reward_scale > 0 && units.value_scale > 0 &&
         std::ranges::all_of(observation.scale, [](double v) { return v > 0; });
}

/// What the array "plan" holds.
std::vector<double> PlanNumbers(const PlanOptions& options) {
  return {static_cast<double>(options.horizon), static_cast<double>(options.trajectories), options.noise, options.keep,
          options.sharpness};
}

/// Whether `value` is a whole number from 1 to `largest`.
bool IsCount(double value, double largest) { return value >= 1 && value <= largest && value == std::floor(value); }

}  // namespace

PlannerPolicy::PlannerPolicy(std::vector<PlannerMember> members, PlannerUnits units, const PlanOptions& options)
    : members_(std::move(members)), units_(std::move(units)), options_(options) {
  OTED_CHECK(!members_.empty() && options.horizon >= 1 && options.trajectories >= 1);
}

std::unique_ptr<PolicyActor> PlannerPolicy::MakeActor(ActionNoise, double) const {
  return std::make_unique<Planner>(*this);
}

void PlannerPolicy::Save(const std::filesystem::path& path) const {
  NpzArrays arrays;
  std::vector<float> dynamics, prior, value;
  for (const PlannerMember& member : members_) {
    Append(dynamics, member.dynamics);
    Append(prior, member.prior);
    Append(value, member.value);
  }
  const std::vector<int> hidden = members_[0].dynamics.hidden();
  arrays[kMark] = NpyArray(PlanNumbers(options_));
  arrays["planner/hidden"] = NpyArray(std::vector<int64_t>(hidden.begin(), hidden.end()));
  arrays["planner/dynamics"] = NpyArray(dynamics);
  arrays["planner/prior"] = NpyArray(prior);
  arrays["planner/value"] = NpyArray(value);
  arrays["planner/observation_mean"] = NpyArray(units_.observation.mean);
  arrays["planner/observation_scale"] = NpyArray(units_.observation.scale);
  arrays["planner/reward_units"] =
      NpyArray(std::vector<double>{units_.reward_mean, units_.reward_scale, units_.value_mean, units_.value_scale});
  arrays["planner/action_low"] = NpyArray(units_.action_low);
  arrays["planner/action_high"] = NpyArray(units_.action_high);
  WriteNpz(arrays, path);
}

PlannerPolicy PlannerPolicy::FromArrays(const NpzArrays& arrays, const std::filesystem::path& path) {
  const std::string where = path.string();
  const NpzFields fields{kPlannerPrefix, arrays, where};
  const std::vector<double> plan = fields.Get("plan"), hidden = fields.Get("hidden"),
                            rewards = fields.Get("reward_units");
  constexpr double kLargest = 1e5;
  if (plan.size() != 5 || !IsCount(plan[0], kLargest) || !IsCount(plan[1], kLargest) || !(plan[2] >= 0) ||
      !(plan[3] >= 0 && plan[3] < 1) || !(plan[4] >= 0) || !std::isfinite(plan[2] + plan[4])) {
    fields.Fail("plan");
  }
  if (rewards.size() != 4) fields.Fail("reward_units");
  PlannerUnits units{{fields.Get("observation_mean"), fields.Get("observation_scale")},
                     rewards[0],
                     rewards[1],
                     rewards[2],
                     rewards[3],
                     fields.Get("action_low"),
                     fields.Get("action_high")};
  if (!AreSound(units)) fields.Fail("observation_scale");
  for (const double width : hidden) {
    if (!IsCount(width, kLargest)) fields.Fail("hidden");
  }
  const std::vector<int> widths(hidden.begin(), hidden.end());
  const int obs_dim = static_cast<int>(units.observation.mean.size()),
            act_dim = static_cast<int>(units.action_low.size());
  const std::vector<double> values = fields.Get("value");
  // The size of one member before it is allocated.
  double size = 0, in = obs_dim + act_dim;
  for (const double width : hidden) size += std::exchange(in, width) * width + width;
  size += in + 1;
  const double n_members = static_cast<double>(values.size()) / size;
  if (!IsCount(n_members, 1000)) fields.Fail("value");
  std::vector<PlannerMember> members;
  for (int k = 0; k < static_cast<int>(n_members); ++k) {
    members.push_back({Mlp(obs_dim + act_dim, widths, obs_dim + 1), Mlp(obs_dim + act_dim, widths, act_dim),
                       Mlp(obs_dim + act_dim, widths, 1)});
  }
  const auto fill = [&](const char* name, Mlp PlannerMember::*net) {
    const std::vector<double> numbers = fields.Get(name);
    const size_t each = (members[0].*net).n_parameters();
    const bool finite = std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); });
    if (numbers.size() != each * members.size() || !finite) fields.Fail(name);
    for (size_t k = 0; k < members.size(); ++k) {
      std::transform(numbers.begin() + static_cast<ptrdiff_t>(k * each),
                     numbers.begin() + static_cast<ptrdiff_t>((k + 1) * each), (members[k].*net).parameters().begin(),
                     [](double v) { return static_cast<float>(v); });
    }
  };
  fill("dynamics", &PlannerMember::dynamics);
  fill("prior", &PlannerMember::prior);
  fill("value", &PlannerMember::value);
  return PlannerPolicy(std::move(members), std::move(units),
                       {static_cast<int>(plan[0]), static_cast<int>(plan[1]), plan[2], plan[3], plan[4]});
}

}  // namespace oted
