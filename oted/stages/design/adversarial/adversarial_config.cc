#include "oted/stages/design/adversarial/adversarial_config.h"

#include <fmt/format.h>

#include "oted/base/error.h"

namespace oted {
namespace {

const NamedValues<RolloutStarts> kStartNames = {{RolloutStarts::kDataset, "dataset"},
                                                {RolloutStarts::kInitial, "initial"}};
const NamedValues<RolloutActions> kActionNames = {{RolloutActions::kReplayed, "replayed"},
                                                  {RolloutActions::kClone, "clone"}};
const NamedValues<SeenByG> kSeenNames = {
    {SeenByG::kStateAction, "sa"}, {SeenByG::kTransition, "sas"}, {SeenByG::kState, "s"}};
const NamedValues<LoggedRows> kRowNames = {{LoggedRows::kAll, "all"}, {LoggedRows::kFirst, "first"}};
const NamedValues<DesignReward> kRewardNames = {{DesignReward::kPaper, "paper"},
                                                {DesignReward::kLogRatio, "log_ratio"}};

/// What is shown to g, and how much of it.
void AddEvidence(AdversarialConfig& config, FieldList& fields) {
  fields.AddChoice(
      "starts", &config.starts,
      "where rollouts begin: logged states, or the initial distribution; given to method paper, "
      "the latter changes the defaults of this section and of [design.discriminator] to those nearest to the paper",
      kStartNames);
  fields.AddChoice("actions", &config.actions, "what acts: the logged actions replayed, or the clone", kActionNames);
  fields.AddChoice("evidence", &config.evidence, "what g sees: (s, a), or (s, a, s' - s), or s alone", kSeenNames);
  fields.Add("horizon", &config.horizon, "control steps per rollout", AtLeast(1));
  fields.Add("n_steps", &config.n_steps, "control steps per simulator and iteration, over its rollouts", AtLeast(1));
  fields.AddChoice("rows", &config.rows,
                   "logged rows that g sees: all, or the first of each episode, as many as the horizon", kRowNames);
  fields.Add("stack", &config.stack, "steps that g sees as one sample; with images, at most the horizon", AtLeast(1));
}

void AddClone(AdversarialConfig& config, FieldList& fields) {
  fields.Add("clone_noise", &config.clone_noise, "factor on the clone's action noise; 0: its mean action", AtLeast(0));
  fields.Add("clone_updates", &config.clone_updates,
             "joint training: ValueDICE updates of the clone per iteration, on logs and simulated samples; 0: none",
             AtLeast(0));
  fields.Add("clone_replay", &config.clone_replay, "of joint training: share of the simulators' samples",
             {.low = 0, .high = 1, .low_open = true, .high_open = true});
  fields.Add("clone_rate", &config.clone_rate, "of joint training: Adam's step size for the clone", Above(0));
}

}  // namespace

FieldList AdversarialConfig::Fields() {
  FieldList fields("design.adversarial");
  AddEvidence(*this, fields);
  AddClone(*this, fields);
  fields.Add("n_iterations", &n_iterations, "iterations of Algorithm 1", AtLeast(1));
  fields.Add("n_sims", &n_sims, "simulators per iteration, each with its own z ~ q", AtLeast(2));
  fields.Add("step_mean", &step_mean, "natural-gradient step on the mean of q, in spreads of q", Above(0));
  fields.Add("step_log_std", &step_log_std, "natural-gradient step on the log spread of q", Above(0));
  fields.Add("lambda", &lambda, "weight of KL(q, prior), in standard deviations of the reward (Eq. 3)", AtLeast(0));
  fields.Add(
      "initial_std", &initial_std,
      "spread of q at the start, in logits of the range (the uniform prior has 1.7); less if the prior is narrower",
      Above(0));
  fields.AddChoice("reward", &reward, "-log(1 - g) as in the paper, or the whole log ratio log g - log(1 - g)",
                   kRewardNames);
  fields.Add("reward_floor", &reward_floor,
             "smallest standard deviation by which rewards are divided [nats]: near the match q slows down and does "
             "not follow noise",
             Above(0));
  fields.Add("average", &average, "share of the last iterations over which q is averaged; 0: only the last q",
             Between(0, 1));
  fields.Add("replay_iterations", &replay_iterations,
             "g is trained on the simulator samples of this many last iterations", AtLeast(1));
  return fields;
}

std::vector<std::string> AdversarialConfig::EvidenceNames() {
  AdversarialConfig config;
  FieldList fields("design.adversarial");
  AddEvidence(config, fields);
  std::vector<std::string> names = {"clone_noise"};
  for (const Field& field : fields.fields()) names.push_back(field.name);
  return names;
}

void AdversarialConfig::Check() const {
  if (actions == RolloutActions::kReplayed && starts == RolloutStarts::kInitial) {
    throw UsageError(
        "design.adversarial.actions = \"replayed\" needs design.adversarial.starts = \"dataset\": logged actions "
        "mean nothing from other states; set design.adversarial.actions = \"clone\"");
  }
  if (rows == LoggedRows::kFirst && starts == RolloutStarts::kDataset) {
    throw UsageError(
        "design.adversarial.rows = \"first\" matches how episodes begin, which rollouts from logged states do not "
        "show; set design.adversarial.starts = \"initial\" and design.adversarial.actions = \"clone\"");
  }
  if (stack > horizon) {
    throw UsageError(
        fmt::format("design.adversarial.stack = {} steps do not fit into rollouts of design.adversarial.horizon = {}; "
                    "lower the one or raise the other",
                    stack, horizon));
  }
}

void AdversarialConfig::SetPaperDefaults(DiscriminatorConfig& g) {
  g.hidden = {100, 100};
  g.steps = 40;
  actions = RolloutActions::kClone;
  evidence = SeenByG::kStateAction;
  horizon = 30;
  n_steps = 150;
  step_mean = 1.0;
  step_log_std = 0.5;
  average = 0.5;
}

void AdversarialConfig::StartAtResets() {
  starts = RolloutStarts::kInitial;
  actions = RolloutActions::kClone;
  rows = LoggedRows::kFirst;
  horizon = 300;
  n_steps = 300;
  step_mean = 0.5;
  step_log_std = 0.25;
  average = 0.0;
}

EvidenceConfig AdversarialConfig::Evidence(const SimulatorSpec& spec) const {
  return {.dataset_starts = starts == RolloutStarts::kDataset,
          .replayed_actions = actions == RolloutActions::kReplayed,
          .transitions = evidence == SeenByG::kTransition,
          .actions = evidence != SeenByG::kState,
          .horizon = horizon,
          .n_steps = n_steps,
          .clone_noise = clone_noise,
          .n_past_actions = spec.n_past_actions,
          .first_rows = rows == LoggedRows::kFirst,
          .stack = stack,
          .image = spec.image_shape};
}

}  // namespace oted
