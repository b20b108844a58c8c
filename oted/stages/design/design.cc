#include "oted/stages/design/design.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/stages/design/adversarial.h"
#include "oted/stages/design/dropo.h"
#include "oted/stages/design/least_squares.h"
#include "oted/stages/design/trajectory_matching.h"

namespace oted {
namespace {

/// Iterations of Algorithm 1 without its line 3: enough for g to tell what there is to tell.
constexpr int kDiscriminatorIterations = 10;

void LogFit(const ParameterSpace& space, int done, int total, const Eigen::VectorXd& x, const std::string& run_name,
            LogSink& log) {
  const std::vector<double> z = LogitToZ(space, {x.data(), static_cast<size_t>(x.size())});
  std::string note;
  for (int i = 0; i < space.size(); ++i) {
    log.Scalar(run_name, "design/mode/" + space[i].name, done, z[static_cast<size_t>(i)]);
    if (i < 4) note += fmt::format("{}{} {:.3f}", i > 0 ? "  " : "", space[i].name, z[static_cast<size_t>(i)]);
  }
  log.Progress("design", run_name, done, total, note);
}

}  // namespace

DesignResult LearnDesign(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                         const DesignConfig& config, RngKey key, const std::filesystem::path& folder,
                         const std::string& run_name, const RunContext& context) {
  config.Check();
  OTED_CHECK(config.form != "auto");
  dataset.CheckFits(factory.spec().task, factory.spec().obs_dim(), factory.spec().act_dim);
  const Designer prior = config.Start(factory.parameters());
  if (!config.FitsByReplay()) {
    return LearnAdversarially(factory, dataset, clone, config, prior, true, key, folder, run_name, context);
  }
  const FitProgress progress = [&](int done, int total, const Eigen::VectorXd& x) {
    LogFit(factory.parameters(), done, total + kDiscriminatorIterations, x, run_name, *context.log);
  };
  const RngKey of_form = key.Stage(config.form);
  const ReplayFit fit = config.form == "least-squares"
                            ? FitLeastSquares(factory, dataset, config.LeastSquares(), of_form, progress, context)
                        : config.form == "dropo"
                            ? FitDropo(factory, dataset, config.Dropo(), of_form, progress, context)
                            : MatchTrajectories(factory, dataset, config.Trajectories(), of_form, progress, context);
  const Designer q(factory.parameters(), fit.mean, fit.covariance);
  DesignConfig against = config;
  against.n_iterations = kDiscriminatorIterations;
  DesignResult result = LearnAdversarially(factory, dataset, clone, against, q, false, key, folder, run_name, context);
  result.fit = fit.evidence;
  return result;
}

}  // namespace oted
