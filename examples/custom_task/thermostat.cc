#include "examples/custom_task/thermostat.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace oted {
namespace {

constexpr double kNominal[] = {100.0, 3000.0};  // loss [W/K], power [W]
constexpr double kCapacity = 5e5;               // [J/K]
constexpr double kOutside = 5, kWanted = 21;    // [deg C]
constexpr double kControlPeriod = 60;           // [s]

}  // namespace

Thermostat::Thermostat(std::shared_ptr<const Shared> shared, int n_lanes)
    : shared_(std::move(shared)), lanes_(static_cast<size_t>(n_lanes)) {
  for (Lane& lane : lanes_) std::copy(std::begin(kNominal), std::end(kNominal), lane.constants);
}

// From the pristine values: twice is once.
void Thermostat::SetParameters(int lane, std::span<const double> z) {
  shared_->parameters.CheckInside(z);
  for (size_t i = 0; i < z.size(); ++i)
    At(lane).constants[shared_->constants[i]] = kNominal[shared_->constants[i]] * z[i];
}

void Thermostat::Start(int lane, double temperature) {
  Lane& l = At(lane);
  l.temperature = temperature;
  l.reward = 0;
  l.status = LaneStatus::kRunning;
  l.step = 0;
}

void Thermostat::Reset(int lane, Rng& rng) { Start(lane, rng.Uniform(14, 24)); }

bool Thermostat::SetStateFromObservation(int lane, std::span<const double> observation) {
  if (observation.size() != 1) throw UsageError("got an observation of another length than 1");
  if (!std::isfinite(observation[0])) return false;
  Start(lane, observation[0]);
  return true;
}

void Thermostat::Step(std::span<const int> lanes, std::span<const double> actions) {
  for (const int lane : lanes) {
    Lane& l = At(lane);
    const double heating = l.constants[1] * (std::clamp(actions[static_cast<size_t>(lane)], -1.0, 1.0) + 1) / 2;
    // The exact solution over one control period: the temperature relaxes towards its balance.
    const double balance = kOutside + heating / l.constants[0];
    l.temperature = balance + (l.temperature - balance) * std::exp(-l.constants[0] * kControlPeriod / kCapacity);
    l.reward = -std::abs(l.temperature - kWanted);
    ++l.step;
    const bool ended = l.temperature < 0 || l.temperature > 100;
    l.status = ended                                       ? LaneStatus::kTerminated
               : l.step >= shared_->spec.max_episode_steps ? LaneStatus::kTruncated
                                                           : LaneStatus::kRunning;
  }
}

ThermostatFactory::ThermostatFactory(std::vector<ParameterSpec> parameters) {
  auto shared = std::make_shared<Thermostat::Shared>();
  const std::vector<std::string> fields = {"env/loss", "env/power"};
  for (const ParameterSpec& p : parameters) {
    const auto found = std::find(fields.begin(), fields.end(), p.field);
    if (found == fields.end() || p.scale != ParameterScale::kNominal) {
      throw UsageError(
          fmt::format("parameter '{}': '{}'{} is no parameter of Thermostat-v0; it has {}, as multiples of "
                      "nominal",
                      p.name, p.field, DidYouMean(p.field, fields), fmt::join(fields, ", ")));
    }
    shared->constants.push_back(static_cast<int>(found - fields.begin()));
  }
  shared->parameters = ParameterSpace(std::move(parameters));
  shared->spec.task = "Thermostat-v0";
  shared->spec.observation_shape = {1};
  shared->spec.observation_names = {"temperature"};
  shared->spec.act_dim = 1;
  shared->spec.action_names = {"heater"};
  shared->spec.action_low = {-1};
  shared->spec.action_high = {1};
  shared->spec.control_period_s = kControlPeriod;
  shared->spec.max_episode_steps = 120;
  shared->spec.can_set_state = true;
  shared_ = std::move(shared);
}

// One step costs next to nothing: threads would only be in the way.
std::unique_ptr<Simulator> ThermostatFactory::Make(int n_lanes, int /*n_threads*/) const {
  return std::make_unique<Thermostat>(shared_, n_lanes);
}

}  // namespace oted
