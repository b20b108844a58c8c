#include "oted/rl/evaluations.h"

#include <algorithm>
#include <chrono>

#include "oted/base/error.h"
#include "oted/rl/policy_evaluation.h"

namespace oted {

void Evaluations::Begin(const Learner& learner, std::vector<std::pair<std::string, double>> figures) {
  OTED_CHECK(!now_.episodes.valid());
  now_.step = learner.n_steps();
  now_.parameters = learner.PolicyParameters();
  now_.policy = learner.MakePolicy(now_.parameters);
  now_.figures = std::move(figures);
  const bool beside = job_.context.n_threads > 1;
  now_.episodes = std::async(beside ? std::launch::async : std::launch::deferred, [this] {
    return RunPolicy(job_.factory, *now_.policy,
                     {.z = job_.eval_parameters,
                      .n_episodes = schedule_.eval_episodes,
                      .key = job_.key.Stage("evaluation"),
                      .n_threads = std::max(1, job_.context.n_threads - 1),
                      .noise = schedule_.noise});
  });
  if (!beside) Finish();
}

void Evaluations::FinishIfReady() {
  if (now_.episodes.valid() && now_.episodes.wait_for(std::chrono::seconds(0)) == std::future_status::ready) Finish();
}

bool Evaluations::Finish() {
  if (!now_.episodes.valid()) return false;
  const std::vector<EpisodeResult> episodes = now_.episodes.get();
  const double eval_return = MeanReturn(episodes);
  Keep(eval_return, CountDiverged(episodes));
  if (job_.observer) job_.observer(now_.step, *now_.policy, eval_return);
  curve_.eval_steps.push_back(now_.step);
  curve_.eval_returns.push_back(eval_return);
  LogSink& log = *job_.context.log;
  log.Scalar(job_.run_name, "eval/mean_reward", now_.step, eval_return);
  for (const auto& [name, value] : now_.figures) log.Scalar(job_.run_name, name, now_.step, value);
  return true;
}

void Evaluations::Keep(double eval_return, int n_diverged) {
  const auto always = [&](int n) { return n == schedule_.eval_episodes; };
  const EvaluatedReturn now{eval_return, always(n_diverged)}, kept{curve_.eval_return, always(curve_.n_diverged)};
  if (schedule_.keep == KeptPolicy::kBest && !curve_.eval_returns.empty() && !now.IsBetterThan(kept)) return;
  curve_.eval_return = eval_return;
  curve_.n_diverged = n_diverged;
  curve_.kept = now_.parameters;
}

}  // namespace oted
