#include "oted/stages/design/images/ratio_matching.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "oted/base/error.h"
#include "oted/matching/as_vector.h"
#include "oted/stages/design/images/posterior.h"
#include "oted/stages/design/images/ratio_estimator.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUnitEdge = 1e-6;
constexpr int kSamplesPerSimulator = 2;  // in one batch of g
constexpr int kPatience = 10;            // iterations in which nothing but divergence is seen

/// Samples of one simulator and where it lies in the unit cube.
struct SimulatorSamples {
  Array2<double> rows;
  std::vector<double> u;
};

/// Line 4: g learns to tell the simulators of the replay apart.
double UpdateRatios(const std::deque<std::vector<SimulatorSamples>>& replay, const DiscriminatorConfig& settings,
                    RatioEstimator& g, Rng& rng) {
  const int n_sims = std::max(2, settings.batch / kSamplesPerSimulator);
  double mean_loss = 0;
  for (int step = 0; step < settings.steps; ++step) {
    std::vector<std::span<const double>> samples;
    std::vector<int> of;
    Array2<double> u;
    for (int k = 0; k < n_sims; ++k) {
      const auto& iteration = replay[rng.Below(replay.size())];
      const SimulatorSamples& one = iteration[rng.Below(iteration.size())];
      u.AppendRow(one.u);
      for (int i = 0; i < kSamplesPerSimulator; ++i) {
        samples.push_back(one.rows.row(static_cast<int>(rng.Below(static_cast<uint64_t>(one.rows.rows())))));
        of.push_back(k);
      }
    }
    mean_loss += g.Step(samples, of, u) / settings.steps;
  }
  return mean_loss;
}

/// The Gaussian over x nearest to the posterior of samples, by g alone.
Designer AnswerTo(const Array2<double>& features, const ParameterSpace& space, RatioEstimator& g, RngKey key) {
  return Posterior(
      Designer(space, 1.0), [&](const Array2<double>& u) { return g.LogLikelihoods(features, u); }, key);
}

VectorXd MeanOf(const Designer& q) { return AsVector(q.mean()); }

Array2<double> UnitOf(const std::vector<VectorXd>& points) {
  Array2<double> u;
  for (const VectorXd& x : points) {
    std::vector<double> row;
    for (const double logit : x) row.push_back(LogitToUnit(logit));
    u.AppendRow(row);
  }
  return u;
}

/// J: the covariance over samples of the gradient of g(x, z) at logits x.
MatrixXd ScoreCovariance(const Array2<double>& features, const VectorXd& x, RatioEstimator& g) {
  constexpr double kStep = 0.05;
  std::vector<VectorXd> points;
  for (int j = 0; j < x.size(); ++j) {
    for (const double sign : {1.0, -1.0}) points.push_back(x + sign * kStep * VectorXd::Unit(x.size(), j));
  }
  const Array2<double> ratios = g.LogRatios(features, UnitOf(points));
  MatrixXd scores(features.rows(), x.size());
  for (int i = 0; i < features.rows(); ++i) {
    for (int j = 0; j < x.size(); ++j) scores(i, j) = (ratios(i, 2 * j) - ratios(i, 2 * j + 1)) / (2 * kStep);
  }
  const MatrixXd off = scores.rowwise() - scores.colwise().mean();
  return off.transpose() * off / std::max(1, features.rows() - 1);
}

/// What must be added to x, and by what factor g is less sure than it says.
struct Calibration {
  VectorXd delta;
  double c = 1;
};

/// Step 2.
Calibration Calibrate(const Array2<double>& logged, const ImagesConfig& config, const ParameterSpace& space,
                      ExperienceGatherer& gatherer, RatioEstimator& g, RngKey key, const RunContext& context) {
  constexpr int kBatches = 4;
  const int d = space.size();
  const VectorXd wanted = MeanOf(AnswerTo(logged, space, g, key.Stage("logs")));
  const MatrixXd prior_precision = MatrixXd::Identity(d, d) / (Designer::kPriorStd * Designer::kPriorStd);
  Calibration calibration{VectorXd::Zero(d), 1};
  VectorXd x = wanted;
  for (int round = 0; round < config.n_calibrations; ++round) {
    context.ThrowIfStopped();
    const RngKey round_key = key.Stage("round").Index(static_cast<uint64_t>(round));
    const std::vector<std::vector<double>> z(static_cast<size_t>(config.n_sims),
                                             LogitToZ(space, {x.data(), static_cast<size_t>(d)}));
    Array2<double> features;
    for (int batch = 0; batch < kBatches; ++batch) {
      for (const LaneExperience& lane : gatherer.Gather(z, round_key.Index(static_cast<uint64_t>(batch)))) {
        const Array2<double> of_lane = g.Features(lane.features);
        for (int i = 0; i < of_lane.rows(); ++i) features.AppendRow(of_lane.row(i));
      }
    }
    if (features.rows() < 2) break;  // the physics breaks down there: nothing to compare with
    const Designer answer = AnswerTo(features, space, g, round_key.Stage("answer"));
    const MatrixXd information = (answer.Covariance().inverse() - prior_precision) / features.rows();
    const MatrixXd ratio = information.ldlt().solve(ScoreCovariance(features, MeanOf(answer), g));
    if (std::isfinite(ratio.trace()) && ratio.trace() > 0) calibration.c = d / ratio.trace();
    calibration.delta = MeanOf(answer) - x;
    // No further than g's own answers reach: where nothing is identified there is nothing to calibrate.
    x = (wanted - calibration.delta).cwiseMax(-6.0).cwiseMin(6.0);
  }
  return calibration;
}

/// log p(logs | z) at each row of u, moved and flattened as the calibration asks for.
std::vector<double> CalibratedLikelihoods(const Array2<double>& features, const Array2<double>& u,
                                          const Calibration& calibration, RatioEstimator& g) {
  Array2<double> moved = u;
  for (int k = 0; k < u.rows(); ++k) {
    for (int i = 0; i < u.cols(); ++i) {
      const double inside = std::clamp(u(k, i), kUnitEdge, 1 - kUnitEdge);  // on a bound the logit is infinite
      moved(k, i) = 1 / (1 + (1 / inside - 1) * std::exp(-calibration.delta[i]));
    }
  }
  std::vector<double> values = g.LogLikelihoods(features, moved);
  for (double& value : values) value *= calibration.c;
  return values;
}

/// An untrained g whose encoder is fitted on these samples.
std::unique_ptr<RatioEstimator> Untrained(const std::vector<SimulatorSamples>& samples, const InputShape& shape,
                                          const ImagesConfig& config, const DiscriminatorConfig& settings, Rng& init) {
  Array2<double> seen;
  for (const SimulatorSamples& one : samples) {
    for (int i = 0; i < one.rows.rows(); ++i) seen.AppendRow(one.rows.row(i));
  }
  const RatioOptions options{.size = {.hidden = settings.hidden, .filters = settings.filters, .mean_pool = false},
                             .learning_rate = settings.learning_rate,
                             .n_steps = config.n_iterations * settings.steps};
  return std::make_unique<RatioEstimator>(seen, shape, static_cast<int>(samples.front().u.size()), options, init);
}

}  // namespace

Designer MatchRatios(const RatioProblem& problem, const ImagesConfig& config, const DiscriminatorConfig& settings) {
  const auto& [factory, dataset, clone, own_evidence, prior, key, progress, context] = problem;
  EvidenceConfig evidence = own_evidence;
  evidence.common_starts = false;
  const ParameterSpace& space = factory.parameters();
  const Array2<double> logged = DatasetFeatures(dataset, evidence);
  if (logged.rows() == 0) {
    throw DataError(
        fmt::format("no episode of dataset '{}' has the {} steps that one sample holds; lower design.adversarial.stack",
                    dataset.path, evidence.stack));
  }
  ExperienceGatherer gatherer(factory.Make(config.n_sims, context.n_threads), dataset, clone, evidence);
  std::deque<std::vector<SimulatorSamples>> replay;
  std::unique_ptr<RatioEstimator> g;
  Rng init = key.Stage("initialisation").MakeRng();
  Designer q = prior;
  int n_barren = 0;
  for (int iteration = 0; iteration < config.n_iterations; ++iteration) {
    context.ThrowIfStopped();
    const RngKey iteration_key = key.Stage("iteration").Index(static_cast<uint64_t>(iteration));
    Rng rng = iteration_key.MakeRng();

    // 1: gather experience, z uniform.
    std::vector<std::vector<double>> z;
    for (int k = 0; k < config.n_sims; ++k) z.push_back(space.SampleUniform(rng));
    std::vector<SimulatorSamples> gathered;
    std::vector<LaneExperience> experience = gatherer.Gather(z, iteration_key.Stage("rollouts"));
    for (size_t k = 0; k < z.size(); ++k) {
      if (experience[k].features.rows() == 0) continue;
      gathered.push_back({std::move(experience[k].features), space.ToUnit(z[k])});
    }
    if (gathered.size() >= 2) {
      replay.push_back(std::move(gathered));
      if (static_cast<int>(replay.size()) > config.replay_iterations) replay.pop_front();
    } else if (++n_barren == kPatience) {
      throw DataError("the physics broke down in nearly all simulators of the range; narrow the parameters' ranges");
    }
    if (replay.empty()) continue;

    // 4: update g, in simulators alone.
    if (!g) g = Untrained(replay.front(), FeatureShape(factory.spec(), evidence), config, settings, init);
    const double loss = UpdateRatios(replay, settings, *g, rng);

    // 2 and 3: what g says of the logs is the reward of every z, and q its posterior.
    const Array2<double> features = g->Features(logged);
    q = Posterior(
        prior, [&](const Array2<double>& u) { return g->LogLikelihoods(features, u); },
        iteration_key.Stage("posterior"));
    progress(iteration + 1, q, loss);
  }
  if (!g) return q;

  const Array2<double> features = g->Features(logged);
  const Calibration calibration = Calibrate(features, config, space, gatherer, *g, key.Stage("calibration"), context);
  const auto likelihoods = [&](const Array2<double>& u) { return CalibratedLikelihoods(features, u, calibration, *g); };
  return Posterior(prior, likelihoods, key.Stage("posterior"));
}

}  // namespace oted
