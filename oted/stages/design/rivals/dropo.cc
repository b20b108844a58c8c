#include "oted/stages/design/rivals/dropo.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "oted/matching/designer.h"
#include "oted/stages/design/rivals/cma_es.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDropoLanes = 128;
constexpr double kCutOff = 2;                                             // spreads beyond which nothing is drawn
constexpr double kSmallestStd = 2e-5, kLargestStd = Designer::kPriorStd;  // of q, in x
constexpr double kSmallestEpsilon = 1e-15, kLargestEpsilon = 0.1;
constexpr double kWidth = 4;                // of the search's coordinates, over the range of what they stand for
constexpr double kSigma = 1;                // of the search at its start, in them
constexpr double kBrokenLogDensity = -1e6;  // of a transition for which less than two draws hold

/// A number of the search, in [0, kWidth], as a value on a logarithmic scale.
double OnLogScale(double y, double low, double high) { return low * std::pow(high / low, y / kWidth); }

/// What a point y of the search stands for: means of x, then its spreads, then epsilon where it is learned.
struct Candidate {
  VectorXd mean, std;
  double epsilon;
  double outside;  // squared distance of y to the box
};

Candidate Decode(const VectorXd& y, int n, const DropoConfig& config) {
  const VectorXd inside = y.cwiseMax(0.0).cwiseMin(kWidth);
  Candidate c{.mean = (2 * inside.head(n).array() / kWidth - 1) * kMaxX,
              .std = inside.segment(n, n).unaryExpr([](double v) { return OnLogScale(v, kSmallestStd, kLargestStd); }),
              .epsilon = config.epsilon,
              .outside = (y - inside).squaredNorm()};
  if (config.learn_epsilon) c.epsilon = OnLogScale(inside[2 * n], kSmallestEpsilon, kLargestEpsilon);
  return c;
}

VectorXd Start(int n, const DropoConfig& config) {
  VectorXd y = VectorXd::Constant(2 * n + (config.learn_epsilon ? 1 : 0), kWidth / 2);
  if (config.learn_epsilon) {
    const double position = std::log(config.epsilon / kSmallestEpsilon) / std::log(kLargestEpsilon / kSmallestEpsilon);
    y[2 * n] = kWidth * std::clamp(position, 0.0, 1.0);
  }
  return y;
}

/// Standard normals, one row per draw, cut off.
MatrixXd CutNormals(int rows, int cols, Rng& rng) {
  MatrixXd draws(rows, cols);
  for (int k = 0; k < rows; ++k) {
    for (int i = 0; i < cols; ++i) {
      do draws(k, i) = rng.Normal();
      while (std::abs(draws(k, i)) > kCutOff);
    }
  }
  return draws;
}

class Likelihood {
 public:
  Likelihood(const SimulatorFactory& factory, const Dataset& dataset, const DropoConfig& config, RngKey key,
             int n_threads)
      : space_(factory.parameters()),
        replayer_(factory.Make(kDropoLanes, n_threads), dataset),
        inverse_scale_(ChannelScales(dataset).cwiseInverse()) {
    Rng rng = key.MakeRng();
    windows_ =
        DrawStartable(replayer_, dataset, factory.spec(), config.horizon, config.transitions * config.horizon, rng);
    starts_ = LoggedStarts(replayer_, windows_);
  }

  /// Mean over the transitions.
  double LogDensity(const Candidate& q, const MatrixXd& normals) {
    // Errors in place of predictions: the logged state is then zero, and everything else is the same.
    std::vector<std::vector<VectorXd>> errors;
    for (const auto& draw : normals.rowwise()) {
      const VectorXd x = (q.mean + q.std.cwiseProduct(draw.transpose())).cwiseMax(-kMaxX).cwiseMin(kMaxX);
      errors.push_back(replayer_.Residuals(windows_, starts_, ToZ(space_, x)));
    }
    const Eigen::Index dim = inverse_scale_.size();
    double sum = 0;
    for (size_t w = 0; w < windows_.size(); ++w) {
      MatrixXd rows(normals.rows(), dim);
      int n = 0;
      for (const auto& of_draw : errors) {
        if (of_draw[w].size() > 0) rows.row(n++) = of_draw[w].tail(dim).cwiseProduct(inverse_scale_);
      }
      sum += n < 2 ? kBrokenLogDensity : PredictionLogDensity(rows.topRows(n), VectorXd::Zero(dim), q.epsilon);
    }
    return sum / static_cast<double>(windows_.size());
  }

 private:
  const ParameterSpace& space_;
  WindowReplayer replayer_;
  VectorXd inverse_scale_;
  std::vector<LogWindow> windows_;
  std::vector<VectorXd> starts_;
};

}  // namespace

FieldList DropoConfig::Fields() {
  FieldList fields("design.dropo");
  fields.Add("horizon", &horizon, "control steps from a state to its prediction (lambda of DROPO)", AtLeast(1));
  fields.Add("transitions", &transitions, "maximum number of logged states predicted", AtLeast(1));
  fields.Add("samples", &samples, "draws of z for each prediction", AtLeast(2));
  fields.Add("budget", &budget, "distributions that CMA-ES evaluates", AtLeast(1));
  fields.Add(
      "epsilon", &epsilon,
      "added to each predicted variance, in units of the channel's variance in the logs; with sensor noise twice "
      "the noise's",
      Above(0));
  fields.Add("learn_epsilon", &learn_epsilon, "CMA-ES finds epsilon, from the value above on");
  return fields;
}

double PredictionLogDensity(const MatrixXd& predictions, const VectorXd& observed, double epsilon) {
  const VectorXd mean = predictions.colwise().mean();
  const MatrixXd centred = predictions.rowwise() - mean.transpose();
  MatrixXd covariance = centred.transpose() * centred / static_cast<double>(predictions.rows() - 1);
  covariance.diagonal().array() += epsilon;
  const Eigen::LDLT<MatrixXd> factor(covariance);
  const VectorXd error = observed - mean;
  const double log_determinant = factor.vectorD().cwiseMax(1e-300).array().log().sum();
  return -0.5 * (error.dot(factor.solve(error)) + log_determinant +
                 static_cast<double>(error.size()) * std::log(2 * std::numbers::pi));
}

ReplayFit FitDropo(const ReplayProblem& problem, const DropoConfig& config) {
  const auto& [factory, dataset, unused_prior, key, progress, context, unused_judged, unused_aside] = problem;
  Likelihood likelihood(factory, dataset, config, key.Stage("transitions"), context.n_threads);
  const int n = factory.parameters().size();
  CmaEs search(Start(n, config), kSigma);
  const int n_generations = std::max(1, config.budget / search.population());
  for (int generation = 0; generation < n_generations; ++generation) {
    Rng rng = key.Stage("generation").Index(static_cast<uint64_t>(generation)).MakeRng();
    const std::vector<VectorXd> points = search.Ask(rng);
    const MatrixXd normals = CutNormals(config.samples, n, rng);
    std::vector<double> costs;
    for (const VectorXd& point : points) {
      const Candidate candidate = Decode(point, n, config);
      const double cost = -likelihood.LogDensity(candidate, normals);
      // Outside of the box the cost is that of its edge and more, so that the search comes back.
      costs.push_back(cost + (1 + std::abs(cost)) * candidate.outside);
      context.ThrowIfStopped();
    }
    search.Tell(points, costs);
    progress(generation + 1, n_generations, Decode(search.mean(), n, config).mean);
  }
  const Candidate found = Decode(search.mean(), n, config);
  return {.mean = found.mean, .covariance = found.std.cwiseAbs2().asDiagonal(), .evidence = {}};
}

}  // namespace oted
