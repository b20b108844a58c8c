#pragma once
/// What is known of each recording and differs between them: a payload, a gain of the firmware, the zero of a sensor.
/// Paths are those of parameters, values come with the logs (LoggedHistory::constants). Where a parameter has numbers
/// of a constant too, and both are multiples of the nominal value, the constant multiplies what the parameter gives.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "oted/sim/wrapped_simulator.h"

namespace oted {

/// What the simulators of one factory share, read-only.
struct ConstantsSetup {
  SimulatorSpec spec;           ///< with constant_names
  ParameterSpace space;         ///< what is searched
  std::vector<double> nominal;  ///< of the constants: as in the model
  /// z and the constants, as the simulator inside has them. @param known  empty, or one each; NaN: as in the model
  std::vector<double> Join(std::span<const double> z, std::span<const double> known) const;
};

/// A lane that is set to a logged state has the constants of that recording, one that was reset those of the model.
class ConstantsSimulator : public WrappedSimulator {
 public:
  /// @param of_all  one of the parameters and the constants
  ConstantsSimulator(std::shared_ptr<const ConstantsSetup> setup, std::unique_ptr<Simulator> of_all);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }

  void SetParameters(int lane, std::span<const double> z) override;
  void Reset(int lane, Rng& rng) override;
  void ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng) override;
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  bool SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) override;
  bool SetState(int lane, std::span<const double> state, const LoggedHistory& before) override;
  std::optional<bool> EndsAt(int lane, std::span<const double> observation) override;
  void Step(std::span<const int> lanes, std::span<const double> actions) override;

 private:
  struct Lane {
    std::vector<double> z, known;
    bool is_applied = false;
  };
  void Know(int lane, std::span<const double> known);
  void Apply(int lane);

  std::shared_ptr<const ConstantsSetup> setup_;
  std::vector<Lane> lanes_;
};

class ConstantsSimulatorFactory : public SimulatorFactory {
 public:
  /// Makes the factory inside, of the parameters and then the constants.
  using Maker = std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>;

  /// @param constants  fields of the model, or obs/NAME/bias. @throws UsageError for others, and as `make` does
  ConstantsSimulatorFactory(const std::vector<ParameterSpec>& parameters, std::vector<ParameterSpec> constants,
                            Maker make);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;
  std::vector<ParameterOffer> Offers() const override { return inside_->Offers(); }
  PathInfo Describe(const std::string& path) const override { return inside_->Describe(path); }
  std::vector<ParameterSpec> Suspects() const override { return inside_->Suspects(); }
  std::vector<ParameterSpec> PartsOf(const ParameterSpec& suspect) const override { return inside_->PartsOf(suspect); }
  std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& more) const override;
  std::string model_sha256() const override { return inside_->model_sha256(); }
  std::string why_not_settable() const override { return inside_->why_not_settable(); }
  bool has_expert() const override { return inside_->has_expert(); }
  std::unique_ptr<Renderer> MakeRenderer(int width, int height, std::string* why_not) const override;
  std::optional<std::vector<std::string>> NotInMjcf() const override;
  bool mjcf_delays_actions() const override { return inside_->mjcf_delays_actions(); }
  /// With the constants' nominal values.
  std::string Mjcf(std::span<const double> z, const std::string& comment,
                   std::span<const double> action_delays_s = {}) const override;

 private:
  std::vector<ParameterSpec> constants_;
  Maker make_;
  std::unique_ptr<SimulatorFactory> inside_;
  std::shared_ptr<const ConstantsSetup> setup_;
};

/// What `make` makes where there are no constants, else a ConstantsSimulatorFactory around it.
std::unique_ptr<SimulatorFactory> WithConstants(const std::vector<ParameterSpec>& parameters,
                                                const std::vector<ParameterSpec>& constants,
                                                const ConstantsSimulatorFactory::Maker& make);

}  // namespace oted
