#include "oted/sim/mujoco/mujoco_simulator_factory.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "oted/sim/channel_factory.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/channel_suspects.h"
#include "oted/sim/mujoco/model_offers.h"
#include "oted/sim/mujoco/model_setup.h"
#include "oted/sim/mujoco/model_setup_check.h"
#include "oted/sim/mujoco/model_suspects.h"
#include "oted/sim/mujoco/mujoco_setup.h"
#include "oted/sim/mujoco/render.h"
#include "oted/sim/suspect_name.h"

namespace oted {

MujocoSimulatorFactory::MujocoSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs)
    : make_again_([task](std::vector<ParameterSpec> others) {
        return std::make_unique<MujocoSimulatorFactory>(task, std::move(others));
      }),
      setup_(MakeMujocoSetup(task, std::move(specs))) {}
MujocoSimulatorFactory::MujocoSimulatorFactory(const ModelTask& task, std::vector<ParameterSpec> specs,
                                               const Array2<double>& logged_starts)
    : make_again_([task, logged_starts](std::vector<ParameterSpec> others) {
        return std::make_unique<MujocoSimulatorFactory>(task, std::move(others), logged_starts);
      }),
      setup_(MakeModelSetup(task, std::move(specs), logged_starts)) {
  CheckModelSetup(setup_);
}
MujocoSimulatorFactory::~MujocoSimulatorFactory() = default;

const SimulatorSpec& MujocoSimulatorFactory::spec() const { return setup_->spec; }
const ParameterSpace& MujocoSimulatorFactory::parameters() const { return setup_->space; }
int MujocoSimulatorFactory::frame_skip() const { return setup_->frame_skip; }
const mjModel_& MujocoSimulatorFactory::model() const { return *setup_->loaded.model; }
const mjSpec_& MujocoSimulatorFactory::model_spec() const { return *setup_->loaded.spec; }
std::string MujocoSimulatorFactory::model_path() const { return setup_->model_path.string(); }
std::string MujocoSimulatorFactory::model_sha256() const { return setup_->loaded.sha256; }
std::string MujocoSimulatorFactory::why_not_settable() const { return setup_->why_not_settable; }
std::unique_ptr<Renderer> MujocoSimulatorFactory::MakeRenderer(int width, int height, std::string* why_not) const {
  return MujocoRenderer::Make(*this, width, height, why_not);
}

std::vector<ParameterOffer> MujocoSimulatorFactory::Offers() const { return ModelOffers(*setup_->loaded.model); }
PathInfo MujocoSimulatorFactory::Describe(const std::string& path) const {
  return DescribeModelPath(*setup_->loaded.model, path);
}

std::vector<ParameterSpec> MujocoSimulatorFactory::Suspects() const {
  std::vector<ParameterSpec> suspects = ModelSuspects(*setup_->loaded.model, setup_->space);
  std::ranges::move(ChannelSuspects(setup_->spec, setup_->space), std::back_inserter(suspects));
  NameApart(suspects, setup_->space);
  return suspects;
}

std::vector<ParameterSpec> MujocoSimulatorFactory::PartsOf(const ParameterSpec& suspect) const {
  return IsChannelPath(suspect.field) ? PartsOfChannelSuspect(setup_->spec, suspect)
                                      : PartsOfSuspect(*setup_->loaded.model, setup_->space, suspect);
}

std::unique_ptr<SimulatorFactory> MujocoSimulatorFactory::With(const std::vector<ParameterSpec>& more) const {
  std::vector<ParameterSpec> all = setup_->space.specs();
  all.insert(all.end(), more.begin(), more.end());
  return WithChannels(all, make_again_);
}

std::unique_ptr<Simulator> MujocoSimulatorFactory::Make(int n_lanes, int n_threads) const {
  return MakeMujoco(n_lanes, n_threads);
}

std::unique_ptr<MujocoSimulator> MujocoSimulatorFactory::MakeMujoco(int n_lanes, int n_threads) const {
  return std::make_unique<MujocoSimulator>(setup_, n_lanes, n_threads);
}

}  // namespace oted
