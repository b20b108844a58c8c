#include "oted/stages/design/design_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/stages/design/prior_source.h"

namespace oted {
namespace {

const std::vector<std::string>& Forms() {
  static const std::vector<std::string> forms = {"auto",          "trajectories", "transitions", "paper",
                                                 "least-squares", "dropo",        "images"};
  return forms;
}

}  // namespace

DesignConfig DesignConfig::ForForm(const std::string& form) {
  DesignConfig config;
  if (std::ranges::find(Forms(), form) == Forms().end()) {
    throw UsageError(fmt::format("design.form is '{}', wanted one of {}{}", form, fmt::join(Forms(), "|"),
                                 DidYouMean(form, Forms())));
  }
  config.form = form;
  if (form != "paper" && form != "images") return config;
  config.starts = "initial";
  config.actions = "clone";
  config.discriminator = "sa";
  config.horizon = 300;
  config.n_steps = 300;
  config.n_iterations = 60;
  config.rows = "first";
  if (form == "paper") return config;
  config.horizon = 8;
  config.stack = 8;
  config.n_steps = 24;
  config.n_iterations = 80;
  config.n_sims = 128;
  config.discriminator_hidden = {64};
  config.discriminator_learning_rate = 2e-3;
  config.discriminator_steps = 30;
  config.discriminator_batch = 128;
  return config;
}

DesignConfig DesignConfig::Resolved(const ParameterSpace& space, const SimulatorSpec& spec) const {
  if (FitsByReplay() && !spec.can_set_state) {
    throw UsageError(fmt::format(
        "design.form = \"{}\" sets logged states, which task '{}' does not take; use auto or paper", form, spec.task));
  }
  if (clone_updates > 0 && (spec.n_discrete_actions > 0 || !spec.image_shape.empty())) {
    throw UsageError(
        fmt::format("design.clone_updates trains the clone by ValueDICE, which takes continuous actions and no images; "
                    "set it to 0 for task '{}'",
                    spec.task));
  }
  if (form != "auto") return *this;
  const bool of_sensors = std::ranges::any_of(
      space.specs(), [](const ParameterSpec& parameter) { return parameter.field.starts_with("obs/"); });
  DesignConfig resolved = InForm(!spec.image_shape.empty() ? "images"
                                 : !spec.can_set_state     ? "paper"
                                 : of_sensors              ? "transitions"
                                                           : "trajectories");
  resolved.by_auto = true;
  return resolved;
}

DesignConfig DesignConfig::InForm(const std::string& other) const {
  DesignConfig given = *this, unset = ForForm(form), changed = ForForm(other);
  nlohmann::json fields = changed.Fields().ToJson();
  const nlohmann::json before = unset.Fields().ToJson(), after = given.Fields().ToJson();
  for (const auto& [name, value] : after.items()) {
    if (name != "form" && value != before.at(name)) fields[name] = value;
  }
  changed.Fields().FromJson(fields, "design");
  return changed;
}

bool DesignConfig::AdaptToFixedStarts() {
  if (starts == "initial") return false;
  const DesignConfig defaults = ForForm(form), paper = ForForm("paper");
  starts = paper.starts;
  actions = paper.actions;
  rows = paper.rows;
  if (horizon == defaults.horizon) horizon = paper.horizon;
  if (n_steps == defaults.n_steps) n_steps = paper.n_steps;
  return true;
}

FieldList DesignConfig::Fields() {
  FieldList fields("design");
  fields.AddChoice(
      "form", &form,
      "how q is found: trajectory matching; Algorithm 1 on replayed transitions, or as in the paper; "
      "least squares on predictions; DROPO; auto takes trajectories where states can be set (and tries others "
      "where its answer is outside the family), images where there are some, otherwise paper",
      Forms());
  fields.AddChoice("starts", &starts, "where rollouts begin: logged states, or the initial distribution",
                   {"dataset", "initial"});
  fields.AddChoice("actions", &actions, "who acts: the logged actions again, or the clone", {"replayed", "clone"});
  fields.AddChoice("discriminator", &discriminator, "what g sees: (s, a), or (s, a, s' - s), or s alone",
                   {"sa", "sas", "s"});
  fields.Add("horizon", &horizon, "control steps per rollout", AtLeast(1));
  fields.Add("n_steps", &n_steps, "control steps per simulator and iteration, over its rollouts", AtLeast(1));
  fields.Add("clone_noise", &clone_noise, "multiplies the clone's action noise; 0 takes its mean action", AtLeast(0));
  fields.Add(
      "clone_updates", &clone_updates,
      "joint training: updates of the clone by ValueDICE per iteration, on the logs and the simulators' samples; "
      "0: the clone stays as it is",
      AtLeast(0));
  fields.Add("clone_replay", &clone_replay, "of joint training: share of the simulators' samples",
             {.low = 0, .high = 1, .low_open = true, .high_open = true});
  fields.Add("clone_rate", &clone_rate, "of joint training: Adam's step size for the clone", Above(0));
  fields.AddChoice("rows", &rows, "logged rows that g sees: all, or the first horizon of each episode",
                   {"all", "first"});
  fields.Add("stack", &stack, "steps that g sees as one sample; with images, at most the horizon", AtLeast(1));
  fields.Add("trajectory_window", &trajectory_window, "of trajectories: control steps of the longest windows",
             AtLeast(2));
  fields.Add("trajectory_rows", &trajectory_rows, "of trajectories: logged transitions matched per seed, at most",
             AtLeast(2));
  fields.Add("trajectory_starts", &trajectory_starts, "of trajectories: starting points that are refined", AtLeast(1));
  fields.Add("trajectory_coarse", &trajectory_coarse, "of trajectories: draws of z among which they are chosen",
             AtLeast(1));
  fields.Add("least_squares_horizon", &least_squares_horizon,
             "of least-squares: control steps predicted from each state", AtLeast(1));
  fields.Add("least_squares_rows", &least_squares_rows, "of least-squares: logged transitions predicted, at most",
             AtLeast(1));
  fields.Add("least_squares_starts", &least_squares_starts,
             "of least-squares: starting points, the nominal parameters first", AtLeast(1));
  fields.Add("dropo_horizon", &dropo_horizon, "of dropo: lambda, control steps up to the state that is predicted",
             AtLeast(1));
  fields.Add("dropo_transitions", &dropo_transitions, "of dropo: logged states predicted, at most", AtLeast(1));
  fields.Add("dropo_samples", &dropo_samples, "of dropo: draws of z for each prediction", AtLeast(2));
  fields.Add("dropo_budget", &dropo_budget, "of dropo: distributions that CMA-ES tries", AtLeast(1));
  fields.Add("dropo_epsilon", &dropo_epsilon,
             "of dropo: added to each predicted variance, in units of the channel's variance in the logs; with sensor "
             "noise twice the noise's",
             Above(0));
  fields.Add("dropo_learn_epsilon", &dropo_learn_epsilon, "of dropo: CMA-ES finds epsilon, from dropo_epsilon on");
  fields.Add("n_iterations", &n_iterations, "repetitions of Algorithm 1", AtLeast(1));
  fields.Add("n_sims", &n_sims, "simulators per iteration, each with its own z ~ q", AtLeast(2));
  fields.Add("step_mean", &step_mean, "natural-gradient step on the mean of q, in spreads of q", Above(0));
  fields.Add("step_log_std", &step_log_std, "natural-gradient step on the log spread of q", Above(0));
  fields.Add("lambda", &lambda, "weight of KL(q, prior), in standard deviations of the reward (Eq. 3)", AtLeast(0));
  fields.Add("prior", &prior,
             "p(z): uniform; gaussian, by the prior of each of [parameters]; or an earlier design's q: the path of a "
             "q.json or of a run directory");
  fields.Add("initial_std", &initial_std,
             "spread of q at the start, in logits of the range (the uniform prior has 1.7); less, as the prior is "
             "narrower",
             Above(0));
  fields.Add("reward_floor", &reward_floor,
             "rewards are divided by their standard deviation, or by this [nats] where that is smaller: near the match "
             "q then slows down in place of following noise",
             Above(0));
  fields.AddChoice("designer", &designer, "q: a Gaussian in logits of the range, or probabilities of grid values",
                   {"gaussian", "categorical"});
  fields.Add("grid_step", &grid_step, "of the categorical designer: its values are the multiples of this in the range",
             Above(0));
  fields.Add("average", &average, "share of the iterations, the last ones, over which q is averaged; 0: the last q",
             Between(0, 1));
  fields.AddChoice("reward", &reward, "-log(1 - g) as in the paper, or the whole log ratio log g - log(1 - g)",
                   {"paper", "log_ratio"});
  fields.Add("discriminator_hidden", &discriminator_hidden, "widths of g's hidden layers", AtLeast(1));
  fields.Add("discriminator_filters", &discriminator_filters, "filters of g's 3x3 convolutions; of images alone",
             AtLeast(1));
  fields.Add("discriminator_learning_rate", &discriminator_learning_rate, "Adam's step size for g", Above(0));
  fields.Add("discriminator_weight_decay", &discriminator_weight_decay, "L2 penalty on g", AtLeast(0));
  fields.Add("discriminator_steps", &discriminator_steps, "gradient steps on g per iteration", AtLeast(1));
  fields.Add("discriminator_batch", &discriminator_batch, "samples of each kind per gradient step", AtLeast(1));
  fields.Add("replay_iterations", &replay_iterations, "iterations whose simulator samples g is trained on", AtLeast(1));
  return fields;
}

void DesignConfig::Check() const {
  if (actions == "replayed" && starts == "initial") {
    throw UsageError(
        "design.actions = \"replayed\" needs design.starts = \"dataset\": logged actions mean nothing from other "
        "states; "
        "set design.actions = \"clone\"");
  }
  if (rows == "first" && starts == "dataset") {
    throw UsageError(
        "design.rows = \"first\" matches how episodes begin, which rollouts from logged states do not show; set "
        "design.starts = \"initial\" and design.actions = \"clone\"");
  }
  if (stack > horizon) {
    throw UsageError(fmt::format(
        "design.stack = {} steps do not fit into rollouts of design.horizon = {}; lower the one or raise the other",
        stack, horizon));
  }
  if (clone_updates > 0 && form != "auto" && (actions != "clone" || (form != "paper" && form != "transitions"))) {
    throw UsageError(fmt::format(
        "design.clone_updates trains a clone that acts in the design, which it does not in form \"{}\" with "
        "design.actions = \"{}\"; set design.form = \"paper\", or design.clone_updates = 0",
        form, actions));
  }
  if (form == "dropo" && prior != "uniform") {
    throw UsageError(
        "design.form = \"dropo\" maximises a likelihood and knows no prior; set design.prior = \"uniform\", or another "
        "form");
  }
  if (FitsByReplay() && designer == "categorical") {
    throw UsageError(
        fmt::format("design.form = \"{}\" finds a Gaussian; for design.designer = \"categorical\" set design.form to "
                    "transitions or paper",
                    form));
  }
}

bool DesignConfig::FitsByReplay() const { return form == "trajectories" || form == "least-squares" || form == "dropo"; }

EvidenceConfig DesignConfig::Evidence(const SimulatorSpec& spec) const {
  return {.dataset_starts = starts == "dataset",
          .replayed_actions = actions == "replayed",
          .transitions = discriminator == "sas",
          .actions = discriminator != "s",
          .horizon = horizon,
          .n_steps = n_steps,
          .clone_noise = clone_noise,
          .n_past_actions = spec.n_past_actions,
          .first_rows = rows == "first",
          .stack = stack,
          .image = spec.image_shape};
}

RatioMatchingOptions DesignConfig::Ratios(const SimulatorSpec& spec) const {
  EvidenceConfig evidence = Evidence(spec);
  evidence.common_starts = false;
  return {.evidence = evidence,
          .estimator = {.size = {.hidden = discriminator_hidden, .filters = discriminator_filters, .mean_pool = false},
                        .learning_rate = discriminator_learning_rate,
                        .n_steps = n_iterations * discriminator_steps},
          .n_iterations = n_iterations,
          .n_sims = n_sims,
          .steps_per_iteration = discriminator_steps,
          .batch = discriminator_batch,
          .replay_iterations = replay_iterations};
}

TrajectoryOptions DesignConfig::Trajectories() const {
  return {.max_window = trajectory_window,
          .n_rows = trajectory_rows,
          .n_coarse = trajectory_coarse,
          .n_starts = trajectory_starts};
}

LeastSquaresOptions DesignConfig::LeastSquares() const {
  return {.horizon = least_squares_horizon, .n_rows = least_squares_rows, .n_starts = least_squares_starts};
}

DropoOptions DesignConfig::Dropo() const {
  return {.horizon = dropo_horizon,
          .n_transitions = dropo_transitions,
          .n_samples = dropo_samples,
          .budget = dropo_budget,
          .epsilon = dropo_epsilon,
          .learns_epsilon = dropo_learn_epsilon};
}

Designer DesignConfig::Start(const ParameterSpace& space) const {
  Designer q = designer == "categorical" ? Designer::OnGrid(space, grid_step) : Designer(space, initial_std);
  q.SetPrior(MakePrior(space));
  q.StartAtPrior(initial_std);
  return q;
}

Prior DesignConfig::MakePrior(const ParameterSpace& space) const {
  return ::oted::MakePrior(prior, space, {.categorical = designer == "categorical", .grid_step = grid_step});
}

DiscriminatorOptions DesignConfig::Discriminator() const {
  return {.hidden = discriminator_hidden,
          .filters = discriminator_filters,
          .learning_rate = discriminator_learning_rate,
          .weight_decay = discriminator_weight_decay,
          .batch_size = discriminator_batch};
}

}  // namespace oted
