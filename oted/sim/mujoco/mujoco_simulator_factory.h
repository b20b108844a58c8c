#pragma once
/// Makes MuJoCo simulators of one task with one parameter space.

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/parameter_space.h"
#include "oted/sim/simulator.h"

struct mjModel_;
struct mjSpec_;

namespace oted {

struct ModelTask;
struct MujocoSetup;

/// Simulators of one task with one parameter space. The model is loaded and every parameter resolved here, so that a
/// mistake shows before any work starts.
class MujocoSimulatorFactory : public SimulatorFactory {
 public:
  /// @throws UsageError for an unknown task or a parameter that the model does not have; DataError for a model file
  /// that is missing or does not compile.
  MujocoSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs);
  /// A task that a file describes. @param logged_starts (n, obs_dim): first observations of logged episodes, for
  /// `start = "logs"`; otherwise not read.
  MujocoSimulatorFactory(const ModelTask& task, std::vector<ParameterSpec> specs,
                         const Array2<double>& logged_starts = {});
  ~MujocoSimulatorFactory() override;

  const SimulatorSpec& spec() const override;
  const ParameterSpace& parameters() const override;
  /// @throws UsageError unless both numbers are at least 1.
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;
  /// The same, with MuJoCo's own state at hand.
  std::unique_ptr<MujocoSimulator> MakeMujoco(int n_lanes, int n_threads) const;

  int frame_skip() const;                     ///< physics steps per control step
  const mjModel_& model() const;              ///< the pristine model, compiled
  const mjSpec_& model_spec() const;          ///< what it was compiled from
  std::string model_path() const;             ///< the model file that was loaded
  std::string model_sha256() const override;  ///< of the compiled pristine model
  std::string why_not_settable() const override;
  std::unique_ptr<Renderer> MakeRenderer(int width, int height, std::string* why_not) const override;
  std::vector<ParameterOffer> Offers() const override;
  PathInfo Describe(const std::string& path) const override;
  std::vector<ParameterSpec> Suspects() const override;
  std::vector<ParameterSpec> PartsOf(const ParameterSpec& suspect) const override;
  std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& more) const override;
  std::optional<std::vector<std::string>> NotInMjcf() const override;
  bool mjcf_delays_actions() const override;
  /// See export_mjcf.h.
  std::string Mjcf(std::span<const double> z, const std::string& comment,
                   std::span<const double> action_delays_s = {}) const override;

 private:
  using Maker = std::function<std::unique_ptr<SimulatorFactory>(std::vector<ParameterSpec>)>;
  Maker make_again_;
  std::shared_ptr<const MujocoSetup> setup_;
};

}  // namespace oted
