#include "oted/stages/clone/value_dice.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "oted/rl/imitation_rows.h"
#include "oted/rl/value_dice_update.h"
#include "oted/stages/clone/behavioral_cloning.h"

namespace oted {
namespace {

/// Before that many updates a critic tells noise: a tenth of them, and no more than this.
constexpr int kLongestWarmUp = 500;

/// @param n_steps  gets the gradient steps that were made for it
TanhGaussianPolicy Start(const CloneJob& job, int& n_steps) {
  const CloneConfig& config = job.config;
  if (config.valuedice_start == ValueDiceStart::kBehavioralClone) {
    const CloneResult clone = CloneByLikelihood(job);
    n_steps = clone.n_steps;
    return dynamic_cast<const TanhGaussianPolicy&>(*clone.policy);
  }
  TanhGaussianPolicy policy(Normalizer::Fit(job.dataset.observations), config.hidden, job.spec.action_low,
                            job.spec.action_high);
  Rng rng = job.key.Stage("start").MakeRng();
  policy.net().Initialize(rng);
  return policy;
}

}  // namespace

CloneResult CloneByValueDice(const CloneJob& job) {
  const auto& [dataset, spec, config, key, run_name, context, unused] = job;
  dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  Rng split = key.MakeRng();
  const CloneRowSplit rows = SplitCloneRows(dataset, config.held_out, split);
  int n_before = 0;
  TanhGaussianPolicy start = Start(job, n_before);

  const ImitationRows logged(dataset, start, rows.train);
  Rng rng = key.Stage("valuedice").MakeRng();
  ValueDiceUpdate update(std::move(start), config.valuedice_hidden, config.ValueDice(), rng);
  ValueDiceBatch batch;
  const int warm_up = std::min(kLongestWarmUp, config.valuedice_updates / 10);
  double objective = 0;
  for (int step = 1; step <= config.valuedice_updates; ++step) {
    DrawValueDiceBatch(logged, nullptr, config.valuedice_batch, update.actor(), rng, batch);
    const ValueDiceLosses losses = update.Step(batch, step > warm_up);
    objective = step == 1 ? losses.objective : 0.98 * objective + 0.02 * losses.objective;
    if (step % config.check_interval != 0 && step != config.valuedice_updates) continue;
    const double held_out_loss = LogLoss(update.actor(), dataset, rows.held_out);
    context.log->Scalar(run_name, "clone/train_loss", n_before + step, LogLoss(update.actor(), dataset, rows.train));
    context.log->Scalar(run_name, "clone/held_out_loss", n_before + step, held_out_loss);
    context.log->Scalar(run_name, "clone/valuedice_objective", n_before + step, objective);
    context.log->Progress("clone", run_name, step, config.valuedice_updates,
                          fmt::format("ValueDICE, divergence {:.3f}", -objective));
    context.ThrowIfStopped();
  }
  return {std::make_unique<TanhGaussianPolicy>(update.actor()),
          LogLoss(update.actor(), dataset, rows.train),
          LogLoss(update.actor(), dataset, rows.held_out),
          n_before + config.valuedice_updates,
          CloneMethod::kValueDice,
          {}};
}

}  // namespace oted
