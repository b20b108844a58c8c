#include "oted/rl/policy_origin.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/nn/onnx_policy.h"
#include "oted/nn/planner_policy.h"
#include "oted/nn/policy.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {
namespace {

/// Two numbers that were meant to be one: ranges pass through single precision, and periods through text.
bool Same(double a, double b) { return std::abs(a - b) <= 1e-6 * std::max({std::abs(a), std::abs(b), 1e-9}); }

/// What a file says of its task; empty where it is silent.
struct Origin {
  std::vector<std::string> observation_names, action_names;
  std::vector<double> action_low, action_high;
  std::optional<double> control_period_s;
};

/// A list in a policy's metadata. Any program may have written it: what is no list of T says nothing.
template <class T>
std::vector<T> ListIn(const std::map<std::string, std::string>& metadata, const char* key) {
  const auto found = metadata.find(key);
  if (found == metadata.end()) return {};
  const nlohmann::json list = nlohmann::json::parse(found->second, nullptr, false);
  if (!list.is_array()) return {};
  std::vector<T> values;
  for (const nlohmann::json& value : list) {
    if (std::is_same_v<T, double> ? !value.is_number() : !value.is_string()) return {};
    values.push_back(value.get<T>());
  }
  return values;
}

Origin OriginOfOnnx(const std::filesystem::path& path) {
  const OnnxPolicy policy = OnnxPolicy::Load(path);
  const auto& metadata = policy.metadata();
  Origin origin{.observation_names = ListIn<std::string>(metadata, "observation_names"),
                .action_names = ListIn<std::string>(metadata, "action_names"),
                .action_low = ListIn<double>(metadata, "action_low"),
                .action_high = ListIn<double>(metadata, "action_high"),
                .control_period_s = {}};
  if (const auto period = metadata.find("control_period_s"); period != metadata.end()) {
    const nlohmann::json value = nlohmann::json::parse(period->second, nullptr, false);
    if (value.is_number()) origin.control_period_s = value.get<double>();
  }
  return origin;
}

Origin OriginOfNpz(const std::filesystem::path& path) {
  const std::unique_ptr<Policy> policy = LoadPolicy(path);
  Origin origin;
  if (const auto* gaussian = dynamic_cast<const TanhGaussianPolicy*>(policy.get())) {
    origin.action_low = gaussian->action_low();
    origin.action_high = gaussian->action_high();
  } else if (const auto* planner = dynamic_cast<const PlannerPolicy*>(policy.get())) {
    origin.action_low = planner->units().action_low;
    origin.action_high = planner->units().action_high;
  }
  return origin;
}

/// The first name that another stands for.
void CompareNames(const std::vector<std::string>& file, const std::vector<std::string>& task, const char* what,
                  std::vector<std::string>& differences) {
  if (file.size() != task.size()) return;
  for (size_t i = 0; i < file.size(); ++i) {
    if (file[i] == task[i]) continue;
    differences.push_back(
        fmt::format("{} {} is '{}' for the policy and '{}' in the task", what, i + 1, Printable(file[i]), task[i]));
    return;
  }
}

}  // namespace

std::vector<std::string> OtherThanItsTask(const std::filesystem::path& path, const SimulatorSpec& spec) {
  const Origin origin = path.extension() == ".onnx" ? OriginOfOnnx(path) : OriginOfNpz(path);
  std::vector<std::string> differences;
  CompareNames(origin.observation_names, spec.observation_names, "observation", differences);
  CompareNames(origin.action_names, spec.action_names, "action", differences);
  if (origin.control_period_s && !Same(*origin.control_period_s, spec.control_period_s)) {
    differences.push_back(fmt::format("the policy acts every {:g} s and the task every {:g} s",
                                      *origin.control_period_s, spec.control_period_s));
  }
  const bool has_ranges = spec.n_discrete_actions == 0 && origin.action_low.size() == spec.action_low.size() &&
                          origin.action_high.size() == spec.action_high.size();
  for (size_t j = 0; has_ranges && j < spec.action_low.size(); ++j) {
    if (Same(origin.action_low[j], spec.action_low[j]) && Same(origin.action_high[j], spec.action_high[j])) continue;
    differences.push_back(
        fmt::format("action {} ranges over [{:g}, {:g}] for the policy and over [{:g}, {:g}] in the task", j + 1,
                    origin.action_low[j], origin.action_high[j], spec.action_low[j], spec.action_high[j]));
    break;
  }
  return differences;
}

}  // namespace oted
