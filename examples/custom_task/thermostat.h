#pragma once
/// A task to copy: a room that loses heat to the outside, and a heater. No MuJoCo, no files.
///
///   dT/dt = (power * (action + 1) / 2 - loss * (T - outside)) / capacity
///
/// Its parameters are `env/loss` and `env/power`, as multiples of the nominal value.

#include <memory>
#include <string>
#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

/// Shows the room's temperature [deg C] and pays for being near 21; an episode ends where the room freezes or boils
/// over.
class Thermostat : public Simulator {
 public:
  /// What the simulators of one factory share.
  struct Shared {
    SimulatorSpec spec;
    ParameterSpace parameters;
    std::vector<int> constants;  ///< per parameter: 0 loss, 1 power
  };

  Thermostat(std::shared_ptr<const Shared> shared, int n_lanes);

  const SimulatorSpec& spec() const override { return shared_->spec; }
  const ParameterSpace& parameters() const override { return shared_->parameters; }
  int n_lanes() const override { return static_cast<int>(lanes_.size()); }
  void SetParameters(int lane, std::span<const double> z) override;
  void Reset(int lane, Rng& rng) override;
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  void Step(std::span<const int> lanes, std::span<const double> actions) override;
  std::span<const double> observation(int lane) const override { return {&At(lane).temperature, 1}; }
  double reward(int lane) const override { return At(lane).reward; }
  LaneStatus status(int lane) const override { return At(lane).status; }

 private:
  struct Lane {
    double constants[2];     // loss [W/K] and power [W] of this lane's room
    double temperature = 0;  // [deg C]
    double reward = 0;
    LaneStatus status = LaneStatus::kRunning;
    int step = 0;
  };
  Lane& At(int lane) { return lanes_[static_cast<size_t>(lane)]; }
  const Lane& At(int lane) const { return lanes_[static_cast<size_t>(lane)]; }
  void Start(int lane, double temperature);

  std::shared_ptr<const Shared> shared_;
  std::vector<Lane> lanes_;
};

class ThermostatFactory : public SimulatorFactory {
 public:
  /// @throws UsageError for a parameter that is neither env/loss nor env/power
  explicit ThermostatFactory(std::vector<ParameterSpec> parameters);
  const SimulatorSpec& spec() const override { return shared_->spec; }
  const ParameterSpace& parameters() const override { return shared_->parameters; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;

 private:
  std::shared_ptr<const Thermostat::Shared> shared_;
};

}  // namespace oted
