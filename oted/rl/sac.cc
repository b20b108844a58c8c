#include "oted/rl/sac.h"

#include <utility>

#include "oted/rl/autograd/on_device.h"
#include "oted/rl/sac_update.h"

namespace oted {

FieldList SacConfig::Fields(const std::string& section) {
  FieldList fields(section);
  AddFields(fields);
  fields.Add("hidden", &hidden, "widths of the hidden layers of actor and critics", AtLeast(1));
  fields.Add("normalize_observations", &normalize_observations,
             "actor and critics see observations in units of their running mean and spread");
  fields.Add("tau", &tau, "Polyak step of the target critics", AboveUpTo(0, 1));
  return fields;
}

ReplayAgent TrainSac(const SimulatorFactory& factory, EpisodeSource& source,
                     const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                     const EvaluationObserver& observer) {
  const auto make_update = [&](TanhGaussianPolicy actor, Rng& rng) -> std::unique_ptr<ReplayUpdate> {
    actor.net().Initialize(rng);
    const SacUpdateOptions options{.learning_rate = config.learning_rate,
                                   .gamma = config.gamma,
                                   .tau = config.tau,
                                   .target_entropy = -static_cast<double>(actor.act_dim())};
    SacUpdate update(std::move(actor), config.hidden, options, rng);
    if (config.device != "cpu") return OnDevice(std::move(update), options, config.device);
    return std::make_unique<SacUpdate>(std::move(update));
  };
  return TrainByReplay(factory, source, eval_parameters, config, "sac", make_update, key, folder, run_name, context,
                       observer);
}

ReplayAgent TrainSac(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters,
                     const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                     const EvaluationObserver& observer) {
  DrawnEpisodes source(episode_parameters);
  return TrainSac(factory, source, eval_parameters, config, key, folder, run_name, context, observer);
}

}  // namespace oted
