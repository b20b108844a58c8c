#pragma once
/// Makes any simulator with channel parameters: splits the parameters between the plant and what surrounds it.

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/sim/channels.h"

namespace oted {

class ChannelSimulatorFactory : public SimulatorFactory {
 public:
  /// Makes the plant's factory from the parameters that are its own.
  using PlantMaker = std::function<std::unique_ptr<SimulatorFactory>(std::vector<ParameterSpec>)>;

  /// Paths that begin with action/ or obs/ are resolved here, the others go to the plant; z has the order of `specs`.
  /// @throws UsageError as ResolveChannelParameter, and when two parameters set the same channel; DataError when the
  /// plant's observations are not flat.
  ChannelSimulatorFactory(std::vector<ParameterSpec> specs, PlantMaker make_plant);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;
  std::vector<ParameterOffer> Offers() const override { return plant_->Offers(); }
  PathInfo Describe(const std::string& path) const override;
  std::string model_sha256() const override { return plant_->model_sha256(); }
  std::string why_not_settable() const override { return plant_->why_not_settable(); }
  bool has_expert() const override { return plant_->has_expert(); }
  std::unique_ptr<Renderer> MakeRenderer(int width, int height, std::string* why_not) const override;
  std::vector<ParameterSpec> Suspects() const override;
  std::vector<ParameterSpec> PartsOf(const ParameterSpec& suspect) const override;
  std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& more) const override;
  std::optional<std::vector<std::string>> NotInMjcf() const override;
  bool mjcf_delays_actions() const override { return plant_->mjcf_delays_actions(); }
  std::string Mjcf(std::span<const double> z, const std::string& comment,
                   std::span<const double> action_delays_s = {}) const override;

 protected:
  const std::shared_ptr<const ChannelSetup>& setup() const { return setup_; }
  std::unique_ptr<Simulator> MakePlant(int n_lanes, int n_threads) const { return plant_->Make(n_lanes, n_threads); }

 private:
  PlantMaker make_plant_;
  std::unique_ptr<SimulatorFactory> plant_;
  std::shared_ptr<const ChannelSetup> setup_;
};

/// The plant's own factory when no parameter is a channel's, else a ChannelSimulatorFactory around it.
std::unique_ptr<SimulatorFactory> WithChannels(const std::vector<ParameterSpec>& specs,
                                               const ChannelSimulatorFactory::PlantMaker& make_plant);

}  // namespace oted
