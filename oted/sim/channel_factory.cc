#include "oted/sim/channel_factory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "oted/base/error.h"
#include "oted/sim/channel_suspects.h"
#include "oted/sim/suspect_name.h"

namespace oted {
namespace {

void CheckDisjoint(const ParameterSpace& space, const std::vector<ChannelSetup::Parameter>& channels) {
  for (size_t i = 0; i < channels.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      const ChannelField &a = channels[k].field, &b = channels[i].field;
      if (a.quantity != b.quantity) continue;
      std::vector<int> common;
      std::ranges::set_intersection(a.channels, b.channels, std::back_inserter(common));
      if (common.empty()) continue;
      throw UsageError(fmt::format("parameters '{}' ({}) and '{}' ({}) set the same channel; narrow one of the paths",
                                   space[channels[k].index].name, space[channels[k].index].field,
                                   space[channels[i].index].name, space[channels[i].index].field));
    }
  }
}

/// What lies between controller and plant has no shape: the plant is drawn with its own part of z.
class PlantRenderer : public Renderer {
 public:
  PlantRenderer(std::shared_ptr<const ChannelSetup> setup, std::unique_ptr<Renderer> plant)
      : setup_(std::move(setup)), plant_(std::move(plant)) {}
  const std::vector<uint8_t>& Draw(std::span<const double> z, std::span<const double> pose) override {
    return plant_->Draw(setup_->PlantParameters(z), pose);
  }
  int width() const override { return plant_->width(); }
  int height() const override { return plant_->height(); }
  const std::string& description() const override { return plant_->description(); }

 private:
  std::shared_ptr<const ChannelSetup> setup_;
  std::unique_ptr<Renderer> plant_;
};

}  // namespace

ChannelSimulatorFactory::ChannelSimulatorFactory(std::vector<ParameterSpec> specs, PlantMaker make_plant)
    : make_plant_(std::move(make_plant)) {
  auto setup = std::make_shared<ChannelSetup>();
  std::vector<ParameterSpec> plant_specs;
  for (size_t i = 0; i < specs.size(); ++i) {
    specs[i].Check();
    if (IsChannelPath(specs[i].field)) continue;
    setup->to_plant.push_back(static_cast<int>(i));
    plant_specs.push_back(specs[i]);
  }
  plant_ = make_plant_(std::move(plant_specs));
  OTED_CHECK(plant_->parameters().size() == static_cast<int>(setup->to_plant.size()));
  setup->spec = plant_->spec();
  if (setup->spec.observation_shape.size() != 1) {
    throw DataError(fmt::format("task '{}' shows images; parameters of actions and observations need flat observations",
                                setup->spec.task));
  }
  // The plant has completed its own.
  for (int i = 0; i < plant_->parameters().size(); ++i) {
    specs[static_cast<size_t>(setup->to_plant[static_cast<size_t>(i)])] = plant_->parameters()[i];
  }
  setup->is_noisy.assign(static_cast<size_t>(setup->spec.obs_dim()), false);
  for (size_t i = 0; i < specs.size(); ++i) {
    if (!IsChannelPath(specs[i].field)) continue;
    const ChannelField field = ResolveChannelParameter(setup->spec, specs[i]);
    const int steps = static_cast<int>(std::ceil(specs[i].high));
    if (field.quantity == ChannelQuantity::kActionDelay) {
      setup->longest_action_delay = std::max(setup->longest_action_delay, steps);
    }
    if (field.quantity == ChannelQuantity::kObservationDelay) {
      setup->longest_observation_delay = std::max(setup->longest_observation_delay, steps);
      setup->spec.reading_ages.resize(static_cast<size_t>(setup->spec.obs_dim()));
      for (const int j : field.channels) setup->spec.reading_ages[static_cast<size_t>(j)] = steps;
    }
    if (field.quantity == ChannelQuantity::kNoiseStd) {
      for (const int j : field.channels) setup->is_noisy[static_cast<size_t>(j)] = true;
    }
    setup->channels.push_back({static_cast<int>(i), field});
  }
  setup->n_noisy = static_cast<int>(std::count(setup->is_noisy.begin(), setup->is_noisy.end(), true));
  setup->spec.n_past_actions += setup->longest_action_delay + setup->longest_observation_delay;
  setup->space = ParameterSpace(std::move(specs));
  CheckDisjoint(setup->space, setup->channels);
  setup_ = std::move(setup);
}

std::unique_ptr<Simulator> ChannelSimulatorFactory::Make(int n_lanes, int n_threads) const {
  return std::make_unique<ChannelSimulator>(setup_, plant_->Make(n_lanes, n_threads));
}

PathInfo ChannelSimulatorFactory::Describe(const std::string& path) const {
  return IsChannelPath(path) ? DescribeChannel(spec(), path) : plant_->Describe(path);
}

std::vector<ParameterSpec> ChannelSimulatorFactory::Suspects() const {
  // The plant knows nothing of what is searched around it.
  std::vector<ParameterSpec> suspects = plant_->Suspects();
  if (suspects.empty()) return suspects;
  std::erase_if(suspects, [](const ParameterSpec& suspect) { return IsChannelPath(suspect.field); });
  std::ranges::move(ChannelSuspects(plant_->spec(), setup_->space), std::back_inserter(suspects));
  NameApart(suspects, setup_->space);
  return suspects;
}

std::vector<ParameterSpec> ChannelSimulatorFactory::PartsOf(const ParameterSpec& suspect) const {
  return IsChannelPath(suspect.field) ? PartsOfChannelSuspect(plant_->spec(), suspect) : plant_->PartsOf(suspect);
}

std::unique_ptr<SimulatorFactory> ChannelSimulatorFactory::With(const std::vector<ParameterSpec>& more) const {
  std::vector<ParameterSpec> all = setup_->space.specs();
  all.insert(all.end(), more.begin(), more.end());
  return std::make_unique<ChannelSimulatorFactory>(std::move(all), make_plant_);
}

std::unique_ptr<Renderer> ChannelSimulatorFactory::MakeRenderer(int width, int height, std::string* why_not) const {
  std::unique_ptr<Renderer> plant = plant_->MakeRenderer(width, height, why_not);
  if (plant == nullptr) return nullptr;
  return std::make_unique<PlantRenderer>(setup_, std::move(plant));
}

std::optional<std::vector<std::string>> ChannelSimulatorFactory::NotInMjcf() const {
  std::optional<std::vector<std::string>> names = plant_->NotInMjcf();
  if (!names) return std::nullopt;
  for (const auto& [index, field] : setup_->channels) {
    const bool is_in = field.quantity == ChannelQuantity::kActionDelay && mjcf_delays_actions();
    if (!is_in) names->push_back(setup_->space[index].name);
  }
  return names;
}

std::string ChannelSimulatorFactory::Mjcf(std::span<const double> z, const std::string& comment,
                                          std::span<const double> action_delays_s) const {
  std::vector<double> delays(static_cast<size_t>(spec().act_dim), 0.0);
  std::ranges::copy(action_delays_s, delays.begin());
  for (const auto& [index, field] : setup_->channels) {
    if (field.quantity != ChannelQuantity::kActionDelay || !mjcf_delays_actions()) continue;
    for (const int k : field.channels) {
      delays[static_cast<size_t>(k)] += z[static_cast<size_t>(index)] * spec().control_period_s;
    }
  }
  return plant_->Mjcf(setup_->PlantParameters(z), comment, delays);
}

std::unique_ptr<SimulatorFactory> WithChannels(const std::vector<ParameterSpec>& specs,
                                               const ChannelSimulatorFactory::PlantMaker& make_plant) {
  const bool any = std::any_of(specs.begin(), specs.end(), [](const auto& s) { return IsChannelPath(s.field); });
  if (!any) return make_plant(specs);
  return std::make_unique<ChannelSimulatorFactory>(specs, make_plant);
}

}  // namespace oted
