#include "oted/stages/design/design.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/stages/design/adversarial/adversarial.h"
#include "oted/stages/design/images/ratio_matching.h"
#include "oted/stages/design/rivals/dropo.h"
#include "oted/stages/design/rivals/least_squares.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted {
namespace {

/// Iterations of Algorithm 1 without its line 3: enough for g to tell what there is to tell.
constexpr int kDiscriminatorIterations = 10;

void LogMode(const ParameterSpace& space, int done, int total, const std::vector<double>& z,
             const std::string& run_name, LogSink& log) {
  std::string note;
  for (int i = 0; i < space.size(); ++i) {
    log.Scalar(run_name, "design/mode/" + space[i].name, done, z[static_cast<size_t>(i)]);
    if (i < 4) note += fmt::format("{}{} {:.3f}", i > 0 ? "  " : "", space[i].name, z[static_cast<size_t>(i)]);
  }
  log.Progress("design", run_name, done, total, note);
}

Designer FitByReplay(const SimulatorFactory& factory, const Dataset& dataset, const DesignConfig& config,
                     const Prior& prior, RngKey key, const std::string& run_name, const RunContext& context,
                     std::optional<FitEvidence>& evidence) {
  const ParameterSpace& space = factory.parameters();
  const FitProgress progress = [&](int done, int total, const Eigen::VectorXd& x) {
    LogMode(space, done, total + kDiscriminatorIterations, LogitToZ(space, {x.data(), static_cast<size_t>(x.size())}),
            run_name, *context.log);
  };
  const ReplayFit fit = config.form == "least-squares"
                            ? FitLeastSquares(factory, dataset, config.LeastSquares(), prior, key, progress, context)
                        : config.form == "dropo"
                            ? FitDropo(factory, dataset, config.Dropo(), key, progress, context)
                            : MatchTrajectories(factory, dataset, config.Trajectories(), prior, key, progress, context);
  evidence = fit.evidence;
  Designer q(space, fit.mean, fit.covariance);
  q.SetPrior(prior);
  return q;
}

Designer FitByRatios(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                     const DesignConfig& config, const Designer& prior, RngKey key, const std::string& run_name,
                     const RunContext& context) {
  const ParameterSpace& space = factory.parameters();
  const int total = config.n_iterations + kDiscriminatorIterations;
  const RatioProgress progress = [&](int done, const Designer& q, double loss) {
    const std::vector<double> std = q.Std();
    for (int i = 0; i < space.size(); ++i) {
      context.log->Scalar(run_name, "design/std/" + space[i].name, done, std[static_cast<size_t>(i)]);
    }
    context.log->Scalar(run_name, "design/ratio_loss", done, loss);
    LogMode(space, done, total, q.Mode(), run_name, *context.log);
  };
  return MatchRatios(factory, dataset, clone, config.Ratios(factory.spec()), prior, key, progress, context);
}

}  // namespace

DesignResult LearnDesign(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                         const DesignConfig& config, RngKey key, const std::filesystem::path& folder,
                         const std::string& run_name, const RunContext& context) {
  config.Check();
  OTED_CHECK(config.form != "auto");
  dataset.CheckFits(factory.spec().task, factory.spec().obs_dim(), factory.spec().act_dim);
  const Designer prior = config.Start(factory.parameters());
  if (!config.FitsByReplay() && config.form != "images") {
    return LearnAdversarially(factory, dataset, clone, config, prior, true, key, folder, run_name, context);
  }
  std::optional<FitEvidence> evidence;
  const RngKey of_form = key.Stage(config.form);
  const Designer q = config.form == "images"
                         ? FitByRatios(factory, dataset, clone, config, prior, of_form, run_name, context)
                         : FitByReplay(factory, dataset, config, prior.prior(), of_form, run_name, context, evidence);
  DesignConfig against = config;
  against.n_iterations = kDiscriminatorIterations;
  DesignResult result = LearnAdversarially(factory, dataset, clone, against, q, false, key, folder, run_name, context);
  result.fit = evidence;
  return result;
}

}  // namespace oted
