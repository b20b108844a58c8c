#include "oted/stages/design/design.h"

#include <algorithm>
#include <string>
#include <vector>

#include "oted/matching/as_vector.h"
#include "oted/matching/verdict.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/replay/noise_estimate.h"
#include "oted/stages/design/replay/prediction_evidence.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr size_t kAsLikely = 6;
constexpr double kLongest = 0.3;  // in x: farther off effects bend, and the covariance says little

/// Draws of z about what was fitted to the logs that were not kept aside, in mirrored pairs. None where all were.
std::vector<std::vector<double>> AsLikely(const ParameterSpace& space, const UnseenFit& unseen, RngKey key) {
  if (unseen.z.empty()) return {};
  const std::vector<double> fitted = ZToLogit(space, unseen.z);
  const Eigen::Index n = space.size();
  const auto x = AsVector(fitted);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(Eigen::Map<const MatrixXd>(unseen.covariance.data(), n, n));
  const VectorXd std = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseMin(kLongest);
  Rng rng = key.Stage("as_likely").MakeRng();
  std::vector<std::vector<double>> draws;
  while (draws.size() < kAsLikely) {
    const VectorXd off = axes.eigenvectors() * std.cwiseProduct(VectorXd::NullaryExpr(n, [&] { return rng.Normal(); }));
    for (const VectorXd& moved : {VectorXd(x + off), VectorXd(x - off)}) {
      draws.push_back(LogitToZ(space, {moved.data(), static_cast<size_t>(n)}));
    }
  }
  return draws;
}

}  // namespace

DesignResult LearnDesign(const DesignProblem& problem, const DesignConfig& config) {
  config.Check();
  const SimulatorSpec& spec = problem.factory.spec();
  problem.dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  return Describe(config.method).learn(problem, config);
}

std::optional<HeldOutPrediction> PredictKeptAside(const DesignProblem& problem, const Designer& q,
                                                  const std::optional<FitEvidence>& fit) {
  const SimulatorSpec& spec = problem.factory.spec();
  if (!spec.can_replay() || !spec.image_shape.empty()) return std::nullopt;
  const Dataset& logs = problem.dataset;
  const int n_threads = problem.context.n_threads;
  const RngKey key = problem.key.Stage("prediction");
  const std::string label = problem.run_name + ", prediction";  // not the fit's own, which growth tells beside it
  const bool all_learned = !fit || !fit->unseen || fit->unseen->z.empty();
  const auto tell = [&](int done, int total) {
    problem.context.log->Progress("predict", label, done, total,
                                  all_learned ? "the logs" : "logs that were kept aside");
    problem.context.ThrowIfStopped();
  };
  const auto predict = [&](const PredictionProblem& asked) {
    tell(0, 1);
    auto prediction = PredictLogs(asked);
    tell(1, 1);
    return prediction;
  };
  const std::vector<int> narrow = NarrowParameters(q);
  if (!fit || !fit->unseen) {
    // A few parameters fit no noise of many rows: little is lost, and it is said.
    ReadingModel readings = ReadingModel::Of(spec, logs);
    VectorXd noise = SensorNoise(problem.factory, logs, readings, q.Mode(), n_threads);
    const std::vector<char> left_out = ReadingsLeftOut(spec, logs, noise);
    if (std::ranges::any_of(left_out, [](char c) { return c != 0; })) {
      readings = ReadingModel::Of(spec, logs, left_out);
      noise = SensorNoise(problem.factory, logs, readings, q.Mode(), n_threads);
    }
    return predict({.factory = problem.factory,
                    .kept_aside = logs,
                    .learned = nullptr,
                    .z = q.Mode(),
                    .noise = noise,
                    .readings = readings,
                    .narrow = narrow,
                    .key = key,
                    .n_threads = n_threads,
                    .noise_rows = logs.size(),
                    .tell = tell});
  }
  const UnseenFit& unseen = *fit->unseen;
  const ReadingModel readings = ReadingsOf(spec, logs, fit->unseen);
  const HeldOutParts parts = KeepAside(logs, spec.control_period_s, problem.KeptAsideKey());
  const std::vector<Episode> episodes = logs.Episodes();
  const VectorXd noise = AsVector(fit->short_noise_std);
  return predict({.factory = problem.factory,
                  .kept_aside = parts.judge,
                  .learned = all_learned ? nullptr : &parts.learn,
                  .z = all_learned ? q.Mode() : unseen.z,
                  .noise = noise,
                  .readings = readings,
                  .narrow = narrow,
                  .key = key,
                  .n_threads = n_threads,
                  .noise_rows = fit->rows,
                  .as_likely = AsLikely(problem.factory.parameters(), unseen, key),
                  .kept_aside_in = EpisodesOf(parts.judged_rows, episodes),
                  .learned_in = EpisodesOf(parts.learned_rows, episodes),
                  .n_whole = all_learned ? 0 : parts.n_whole,
                  .tell = tell});
}

}  // namespace oted
