#include "oted/stages/design/design_method.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>

#include "oted/base/error.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/adversarial/adversarial.h"
#include "oted/stages/design/images/ratio_matching.h"
#include "oted/stages/design/rivals/dropo.h"
#include "oted/stages/design/rivals/least_squares.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted {
namespace {

constexpr int kMostShown = 4;

void LogMode(const DesignProblem& problem, int done, int total, const std::vector<double>& z) {
  const ParameterSpace& space = problem.factory.parameters();
  std::string note;
  for (int i = 0; i < space.size(); ++i) {
    problem.context.log->Scalar(problem.run_name, "design/mode/" + space[i].name, done, z[static_cast<size_t>(i)]);
    if (i < kMostShown) note += fmt::format("{}{} {:.3f}", i > 0 ? "  " : "", space[i].name, z[static_cast<size_t>(i)]);
  }
  if (space.size() > kMostShown) note += fmt::format("  and {} more", space.size() - kMostShown);
  problem.context.log->Progress("design", problem.run_name, done, total, note);
}

RngKey KeyOf(const DesignProblem& problem, const DesignConfig& config) {
  return problem.key.Stage(Describe(config.method).name);
}

DesignResult LearnByAlgorithm1(const DesignProblem& problem, const DesignConfig& config) {
  return LearnAdversarially(problem, config.adversarial, config.discriminator,
                            config.Start(problem.factory.parameters()));
}

DesignResult LearnByReplay(const DesignProblem& problem, const DesignConfig& config,
                           const std::function<ReplayFit(const ReplayProblem&)>& fit_to) {
  const ParameterSpace& space = problem.factory.parameters();
  const Prior prior = config.Start(space).prior();
  const FitProgress progress = [&](int done, int total, const Eigen::VectorXd& x) {
    LogMode(problem, done, total, LogitToZ(space, {x.data(), static_cast<size_t>(x.size())}));
  };
  const ReplayFit fit = fit_to({.factory = problem.factory,
                                .dataset = problem.dataset,
                                .prior = prior,
                                .key = KeyOf(problem, config),
                                .progress = progress,
                                .context = problem.context,
                                .judged = problem.judged,
                                .kept_aside = problem.KeptAsideKey()});
  Designer q(space, fit.mean, fit.covariance);
  q.SetPrior(prior);
  return {.q = q, .fit = fit.evidence};
}

DesignResult LearnByTrajectories(const DesignProblem& problem, const DesignConfig& config) {
  return LearnByReplay(problem, config, [&](const ReplayProblem& p) {
    const Prior prior = ForTrajectories(p.prior, p.factory.parameters());
    return MatchTrajectories({p.factory, p.dataset, prior, p.key, p.progress, p.context, p.judged, p.kept_aside},
                             config.trajectories);
  });
}

DesignResult LearnByLeastSquares(const DesignProblem& problem, const DesignConfig& config) {
  return LearnByReplay(problem, config,
                       [&](const ReplayProblem& p) { return FitLeastSquares(p, config.least_squares); });
}

DesignResult LearnByDropo(const DesignProblem& problem, const DesignConfig& config) {
  return LearnByReplay(problem, config, [&](const ReplayProblem& p) { return FitDropo(p, config.dropo); });
}

DesignResult LearnByRatios(const DesignProblem& problem, const DesignConfig& config) {
  const ParameterSpace& space = problem.factory.parameters();
  const Designer prior = config.Start(space);
  const int total = config.images.n_iterations;
  const RatioProgress progress = [&](int done, const Designer& q, double loss) {
    const std::vector<double> std = q.Std();
    for (int i = 0; i < space.size(); ++i) {
      problem.context.log->Scalar(problem.run_name, "design/std/" + space[i].name, done, std[static_cast<size_t>(i)]);
    }
    problem.context.log->Scalar(problem.run_name, "design/ratio_loss", done, loss);
    LogMode(problem, done, total, q.Mode());
  };
  const RatioProblem to_match{.factory = problem.factory,
                              .dataset = problem.dataset,
                              .clone = problem.clone,
                              .evidence = config.adversarial.Evidence(problem.factory.spec()),
                              .prior = prior,
                              .key = KeyOf(problem, config),
                              .progress = progress,
                              .context = problem.context};
  return {.q = MatchRatios(to_match, config.images, config.discriminator)};
}

int IterationsOfAlgorithm1(const DesignConfig& config) { return config.adversarial.n_iterations; }

bool HasImages(const SimulatorSpec& spec) { return !spec.image_shape.empty(); }

}  // namespace

const std::vector<MethodDescription>& DesignMethods() {
  static const std::vector<MethodDescription> methods = {
      {.method = DesignMethod::kTrajectories,
       .name = "trajectories",
       .summary = "windows of the log are replayed; z and the windows' start states are fitted together, every channel "
                  "and window weighed by what it tells",
       .needs = {.replays = true, .gaussian_q = true},
       .sections = {"trajectories"},
       .n_seeds = 1,
       .first_of_auto = [](const SimulatorSpec& spec,
                           bool of_noise) { return !HasImages(spec) && spec.can_replay() && !of_noise; },
       .learn = LearnByTrajectories},
      {.method = DesignMethod::kTransitions,
       .name = "transitions",
       .summary = "Algorithm 1 on short replays of the logged actions from logged states, g(s, a, s')",
       .sections = {"adversarial", "discriminator"},
       .is_algorithm1 = true,
       .tried_by_auto = true,
       .first_of_auto = [](const SimulatorSpec& spec,
                           bool of_noise) { return !HasImages(spec) && spec.can_set_state && of_noise; },
       .n_iterations = IterationsOfAlgorithm1,
       .learn = LearnByAlgorithm1},
      {.method = DesignMethod::kPaper,
       .name = "paper",
       .summary =
           "Algorithm 1 with g(s, a): the clone is rolled out from logged states, or from the initial ones where no "
           "state can be set",
       .needs = {.clone = true},
       .sections = {"adversarial", "discriminator"},
       .is_algorithm1 = true,
       .first_of_auto =
           [](const SimulatorSpec& spec, bool of_noise) {
             return !HasImages(spec) && !spec.can_set_state && (of_noise || !spec.can_replay());
           },
       .n_iterations = IterationsOfAlgorithm1,
       .set_defaults = [](DesignConfig& config) { config.adversarial.SetPaperDefaults(config.discriminator); },
       .learn = LearnByAlgorithm1},
      {.method = DesignMethod::kLeastSquares,
       .name = "least-squares",
       .summary = "predictions from logged states, which are taken as exact: what identification tools do",
       .needs = {.settable_state = true, .gaussian_q = true},
       .sections = {"least_squares"},
       .n_seeds = 1,
       .tried_by_auto = true,
       .learn = LearnByLeastSquares},
      {.method = DesignMethod::kDropo,
       .name = "dropo",
       .summary = "the distribution of parameters under which the logged next states are likeliest (DROPO)",
       .needs = {.settable_state = true, .gaussian_q = true, .uniform_prior = true},
       .sections = {"dropo"},
       .learn = LearnByDropo},
      {.method = DesignMethod::kImages,
       .name = "images",
       .summary = "a convolutional g that is told z is trained in simulators; q is its posterior given the first steps "
                  "of each episode",
       .needs = {.clone = true},
       .sections = {"images", "adversarial", "discriminator"},
       .first_of_auto = [](const SimulatorSpec& spec, bool) { return HasImages(spec); },
       .n_iterations = [](const DesignConfig& config) { return config.images.n_iterations; },
       .set_defaults = [](DesignConfig& config) { SetImagesDefaults(config.adversarial, config.discriminator); },
       .learn = LearnByRatios}};
  return methods;
}

const MethodDescription& Describe(DesignMethod method) {
  return *std::ranges::find(DesignMethods(), method, &MethodDescription::method);
}

DesignMethod MethodNamed(const std::string& name) {
  std::vector<std::string> names;
  for (const MethodDescription& described : DesignMethods()) {
    if (described.name == name) return described.method;
    names.push_back(described.name);
  }
  throw UsageError(
      fmt::format("design.method is '{}', wanted one of {}{}", name, fmt::join(names, "|"), DidYouMean(name, names)));
}

const NamedValues<std::optional<DesignMethod>>& MethodNames() {
  static const auto names = [] {
    NamedValues<std::optional<DesignMethod>> all = {{std::nullopt, "auto"}};
    for (const MethodDescription& described : DesignMethods()) all.emplace_back(described.method, described.name);
    return all;
  }();
  return names;
}

DesignMethod FirstMethodOfAuto(const ParameterSpace& space, const SimulatorSpec& spec) {
  const bool of_noise =
      std::ranges::any_of(space.specs(), [](const ParameterSpec& parameter) { return IsSensorNoise(parameter.field); });
  for (const MethodDescription& described : DesignMethods()) {
    if (described.first_of_auto != nullptr && described.first_of_auto(spec, of_noise)) return described.method;
  }
  OTED_CHECK(false);
  return DesignMethod::kPaper;
}

std::string NeedsInWords(const MethodDescription& described) {
  std::string words;
  const auto add = [&](bool needed, const char* what) {
    if (needed) words += (words.empty() ? "" : ", ") + std::string(what);
  };
  add(described.needs.settable_state, "states that can be set");
  add(described.needs.replays, "states of which the logs show the positions");
  add(described.needs.clone, "the clone");
  add(described.needs.gaussian_q, "a Gaussian q");
  add(described.needs.uniform_prior, "a uniform prior");
  return words.empty() ? "nothing else" : words;
}

std::string DefaultSeedsInWords() {
  std::vector<std::string> once;
  for (const MethodDescription& described : DesignMethods()) {
    if (described.n_seeds == 1) once.push_back(described.name);
  }
  return fmt::format("1 of the methods {}, {} of the others", fmt::join(once, " and "), MethodDescription().n_seeds);
}

}  // namespace oted
