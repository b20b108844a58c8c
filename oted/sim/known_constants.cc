#include "oted/sim/known_constants.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "oted/base/error.h"
#include "oted/sim/channel_path.h"

namespace oted {
namespace {

/// The parts are drawn as those of the model.
class ConstantsRenderer : public Renderer {
 public:
  ConstantsRenderer(std::shared_ptr<const ConstantsSetup> setup, std::unique_ptr<Renderer> inside)
      : setup_(std::move(setup)), inside_(std::move(inside)) {}
  const std::vector<uint8_t>& Draw(std::span<const double> z, std::span<const double> pose) override {
    return inside_->Draw(setup_->Join(z, {}), pose);
  }
  int width() const override { return inside_->width(); }
  int height() const override { return inside_->height(); }
  const std::string& description() const override { return inside_->description(); }

 private:
  std::shared_ptr<const ConstantsSetup> setup_;
  std::unique_ptr<Renderer> inside_;
};

/// Other channels say how far a simulator looks back, which must not differ between recordings.
void CheckField(const ParameterSpec& constant) {
  if (!IsChannelPath(constant.field) || IsSensorBias(constant.field)) return;
  throw UsageError(
      fmt::format("constant '{}' ({}): wanted a field of the model, or obs/NAME/bias; make it one of the [parameters]",
                  constant.name, constant.field));
}

}  // namespace

std::vector<double> ConstantsSetup::Join(std::span<const double> z, std::span<const double> known) const {
  OTED_CHECK(known.empty() || known.size() == nominal.size());
  std::vector<double> all(z.begin(), z.end());
  for (size_t k = 0; k < nominal.size(); ++k) {
    all.push_back(known.empty() || std::isnan(known[k]) ? nominal[k] : known[k]);
  }
  return all;
}

ConstantsSimulator::ConstantsSimulator(std::shared_ptr<const ConstantsSetup> setup, std::unique_ptr<Simulator> of_all)
    : WrappedSimulator(std::move(of_all)),
      setup_(std::move(setup)),
      lanes_(static_cast<size_t>(n_lanes()), Lane{.z = setup_->space.Nominal(), .known = {}}) {}

void ConstantsSimulator::SetParameters(int lane, std::span<const double> z) {
  setup_->space.CheckInside(z);
  Lane& l = lanes_[static_cast<size_t>(lane)];
  l.z.assign(z.begin(), z.end());
  // The next start says of which recording it is; MuJoCo derives a model's constants once then.
  l.is_applied = false;
}

void ConstantsSimulator::Know(int lane, std::span<const double> known) {
  Lane& l = lanes_[static_cast<size_t>(lane)];
  l.known.assign(known.begin(), known.end());
  l.is_applied = false;
  Apply(lane);
}

void ConstantsSimulator::Apply(int lane) {
  Lane& l = lanes_[static_cast<size_t>(lane)];
  if (l.is_applied) return;
  inside().SetParameters(lane, setup_->Join(l.z, l.known));
  l.is_applied = true;
}

void ConstantsSimulator::Reset(int lane, Rng& rng) {
  Know(lane, {});
  inside().Reset(lane, rng);
}

void ConstantsSimulator::ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng) {
  Know(lane, {});
  inside().ResetTo(lane, qpos, qvel, rng);
}

bool ConstantsSimulator::SetStateFromObservation(int lane, std::span<const double> observation) {
  return SetStateFromLog(lane, observation, {});
}

bool ConstantsSimulator::SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) {
  Know(lane, before.constants);
  return inside().SetStateFromLog(lane, observation, before);
}

bool ConstantsSimulator::SetState(int lane, std::span<const double> state, const LoggedHistory& before) {
  Know(lane, before.constants);
  return inside().SetState(lane, state, before);
}

std::optional<bool> ConstantsSimulator::EndsAt(int lane, std::span<const double> observation) {
  Apply(lane);
  return inside().EndsAt(lane, observation);
}

void ConstantsSimulator::Step(std::span<const int> lanes, std::span<const double> actions) {
  for (const int lane : lanes) Apply(lane);
  inside().Step(lanes, actions);
}

ConstantsSimulatorFactory::ConstantsSimulatorFactory(const std::vector<ParameterSpec>& parameters,
                                                     std::vector<ParameterSpec> constants, Maker make)
    : constants_(std::move(constants)), make_(std::move(make)) {
  std::ranges::for_each(constants_, CheckField);
  std::vector<ParameterSpec> all = parameters;
  all.insert(all.end(), constants_.begin(), constants_.end());
  inside_ = make_(all);
  // The factory inside completes what it has.
  const std::vector<ParameterSpec>& completed = inside_->parameters().specs();
  const auto first_constant = completed.begin() + std::ssize(parameters);
  auto setup = std::make_shared<ConstantsSetup>();
  setup->spec = inside_->spec();
  setup->space = ParameterSpace({completed.begin(), first_constant});
  for (auto constant = first_constant; constant != completed.end(); ++constant) {
    setup->spec.constant_names.push_back(constant->name);
    setup->nominal.push_back(constant->nominal);
  }
  setup_ = std::move(setup);
}

std::unique_ptr<Simulator> ConstantsSimulatorFactory::Make(int n_lanes, int n_threads) const {
  return std::make_unique<ConstantsSimulator>(setup_, inside_->Make(n_lanes, n_threads));
}

std::unique_ptr<SimulatorFactory> ConstantsSimulatorFactory::With(const std::vector<ParameterSpec>& more) const {
  std::vector<ParameterSpec> all = setup_->space.specs();
  all.insert(all.end(), more.begin(), more.end());
  return std::make_unique<ConstantsSimulatorFactory>(all, constants_, make_);
}

std::unique_ptr<Renderer> ConstantsSimulatorFactory::MakeRenderer(int width, int height, std::string* why_not) const {
  std::unique_ptr<Renderer> inside = inside_->MakeRenderer(width, height, why_not);
  if (inside == nullptr) return nullptr;
  return std::make_unique<ConstantsRenderer>(setup_, std::move(inside));
}

std::optional<std::vector<std::string>> ConstantsSimulatorFactory::NotInMjcf() const {
  std::optional<std::vector<std::string>> names = inside_->NotInMjcf();
  const auto is_constant = [this](const std::string& name) {
    return std::ranges::find(constants_, name, &ParameterSpec::name) != constants_.end();
  };
  if (names) std::erase_if(*names, is_constant);
  return names;
}

std::string ConstantsSimulatorFactory::Mjcf(std::span<const double> z, const std::string& comment,
                                            std::span<const double> action_delays_s) const {
  return inside_->Mjcf(setup_->Join(z, {}), comment, action_delays_s);
}

std::unique_ptr<SimulatorFactory> WithConstants(const std::vector<ParameterSpec>& parameters,
                                                const std::vector<ParameterSpec>& constants,
                                                const ConstantsSimulatorFactory::Maker& make) {
  if (constants.empty()) return make(parameters);
  return std::make_unique<ConstantsSimulatorFactory>(parameters, constants, make);
}

}  // namespace oted
