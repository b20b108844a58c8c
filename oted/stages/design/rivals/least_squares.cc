#include "oted/stages/design/rivals/least_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/matching/as_vector.h"
#include "oted/matching/designer.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kLeastSquaresLanes = 256;
constexpr int kMaxIterations = 30, kMaxAttempts = 8;
constexpr double kStep = 1e-6;            // of finite differences, in the unit cube
constexpr double kStartMargin = 0.05;     // of the cube: starts keep away from the bounds
constexpr double kBrokenError = 10;       // of every number of a window that broke down, in channel scales
constexpr double kSmallDecrease = 1e-10;  // of the cost, relative: converged

/// The windows' residuals as a function of u in the unit cube.
class Predictions {
 public:
  Predictions(const SimulatorFactory& factory, const Dataset& dataset, const LeastSquaresConfig& config, RngKey key,
              int n_threads)
      : space_(factory.parameters()),
        replayer_(factory.Make(kLeastSquaresLanes, n_threads), dataset),
        inverse_scale_(ChannelScales(dataset).cwiseInverse()) {
    int horizon = 1;
    for (const Episode& episode : dataset.Episodes())
      horizon = std::max(horizon, std::min(config.horizon, episode.size()));
    Rng rng = key.MakeRng();
    windows_ = DrawStartable(replayer_, dataset, factory.spec(), horizon, config.rows, rng);
    starts_ = LoggedStarts(replayer_, windows_);
  }

  int n_parameters() const { return space_.size(); }

  /// One vector per window, in channel scales; empty where the physics broke down.
  std::vector<VectorXd> Residuals(const VectorXd& u) {
    std::vector<VectorXd> residuals =
        replayer_.Residuals(windows_, starts_, space_.FromUnit({u.data(), static_cast<size_t>(u.size())}));
    for (VectorXd& r : residuals) {
      for (Eigen::Index t = 0; t < r.size(); t += inverse_scale_.size()) {
        r.segment(t, inverse_scale_.size()).array() *= inverse_scale_.array();
      }
    }
    return residuals;
  }

  double Cost(const std::vector<VectorXd>& residuals) const {
    double cost = 0;
    for (const VectorXd& r : residuals) cost += r.size() > 0 ? r.squaredNorm() : BrokenCost();
    return cost;
  }

  /// J^T J and -J^T r of the residuals' simulated part, over the windows that hold at u and beside it.
  void Linearize(const VectorXd& u, const std::vector<VectorXd>& residuals, MatrixXd& hessian, VectorXd& descent) {
    std::vector<std::vector<VectorXd>> moved;
    std::vector<double> steps;
    for (int i = 0; i < n_parameters(); ++i) {
      VectorXd beside = u;
      steps.push_back(u[i] + kStep > 1 ? -kStep : kStep);
      beside[i] += steps.back();
      moved.push_back(Residuals(beside));
    }
    hessian = MatrixXd::Zero(n_parameters(), n_parameters());
    descent = VectorXd::Zero(n_parameters());
    for (size_t w = 0; w < residuals.size(); ++w) {
      MatrixXd jacobian(residuals[w].size(), n_parameters());
      bool holds = residuals[w].size() > 0;
      for (int i = 0; i < n_parameters() && holds; ++i) {
        const VectorXd& beside = moved[static_cast<size_t>(i)][w];
        holds = beside.size() == residuals[w].size();
        if (holds) jacobian.col(i) = (beside - residuals[w]) / steps[static_cast<size_t>(i)];
      }
      if (!holds) continue;
      hessian += jacobian.transpose() * jacobian;
      descent -= jacobian.transpose() * residuals[w];
    }
  }

  /// s^2: the first observation of a window is its start and has no residual.
  double MeanSquare(const std::vector<VectorXd>& residuals) const {
    double sum = 0, n = -n_parameters();
    for (const VectorXd& r : residuals) {
      if (r.size() == 0) continue;
      sum += r.squaredNorm();
      n += static_cast<double>(r.size() - inverse_scale_.size());
    }
    return std::max(sum / std::max(n, 1.0), kSmallestNoise * kSmallestNoise);
  }

 private:
  double BrokenCost() const {
    return kBrokenError * kBrokenError * static_cast<double>(inverse_scale_.size()) * windows_.front().n_steps;
  }

  const ParameterSpace& space_;
  WindowReplayer replayer_;
  VectorXd inverse_scale_;
  std::vector<LogWindow> windows_;
  std::vector<VectorXd> starts_;
};

/// The step of least damped cost in the box, coordinates at a bound that descent points out of held there.
VectorXd BoxStep(const VectorXd& u, const MatrixXd& hessian, const VectorXd& descent, double damping) {
  MatrixXd damped = hessian;
  // What has no effect has no curvature either; a trace of the others' keeps the matrix regular.
  const double trace = 1e-12 * std::max(hessian.trace(), 1e-300);
  for (int i = 0; i < u.size(); ++i) damped(i, i) += damping * hessian(i, i) + trace;
  VectorXd wanted = descent;
  for (int i = 0; i < u.size(); ++i) {
    if ((u[i] <= 0 && descent[i] < 0) || (u[i] >= 1 && descent[i] > 0)) {
      damped.row(i).setZero();
      damped.col(i).setZero();
      damped(i, i) = 1;
      wanted[i] = 0;
    }
  }
  const VectorXd step = damped.ldlt().solve(wanted);
  if (!step.allFinite()) return VectorXd::Zero(u.size());
  return (u + step).cwiseMax(0.0).cwiseMin(1.0) - u;
}

VectorXd ToX(const VectorXd& u) {
  return u.unaryExpr([](double v) { return std::clamp(std::log(v / (1 - v)), -kMaxX, kMaxX); });
}

}  // namespace

FieldList LeastSquaresConfig::Fields() {
  FieldList fields("design.least_squares");
  fields.Add("horizon", &horizon, "control steps predicted from each state", AtLeast(1));
  fields.Add("rows", &rows, "maximum number of logged transitions predicted", AtLeast(1));
  fields.Add("starts", &starts, "starting points, the nominal parameters first", AtLeast(1));
  return fields;
}

ReplayFit FitLeastSquares(const ReplayProblem& problem, const LeastSquaresConfig& config) {
  const auto& [factory, dataset, prior, key, progress, context, unused_judged, unused_aside] = problem;
  const ParameterSpace& space = factory.parameters();
  Predictions predictions(factory, dataset, config, key.Stage("windows"), context.n_threads);
  const int n_total = config.starts * kMaxIterations;
  Rng rng = key.Stage("starts").MakeRng();

  VectorXd best_u;
  double best_cost = std::numeric_limits<double>::infinity();
  for (int start = 0; start < config.starts; ++start) {
    const std::vector<double> nominal = space.ToUnit(space.Nominal());
    VectorXd u = AsVector(nominal).cwiseMax(kStartMargin).cwiseMin(1 - kStartMargin);
    if (start > 0) {
      for (double& coordinate : u) coordinate = rng.Uniform(kStartMargin, 1 - kStartMargin);
    }
    std::vector<VectorXd> residuals = predictions.Residuals(u);
    double cost = predictions.Cost(residuals), damping = 1e-3;
    bool converged = false;
    for (int iteration = 0; iteration < kMaxIterations && !converged; ++iteration) {
      MatrixXd hessian;
      VectorXd descent;
      predictions.Linearize(u, residuals, hessian, descent);
      converged = true;  // unless a step makes the cost smaller
      for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
        const VectorXd tried = u + BoxStep(u, hessian, descent, damping);
        std::vector<VectorXd> there = predictions.Residuals(tried);
        const double its_cost = predictions.Cost(there);
        if (its_cost < cost) {
          converged = cost - its_cost < kSmallDecrease * cost;
          u = tried;
          cost = its_cost;
          residuals = std::move(there);
          damping = std::max(1e-10, damping * 0.1);
          break;
        }
        damping = std::min(1e8, damping * 8);
      }
      progress(start * kMaxIterations + iteration + 1, n_total, ToX(u));
      context.ThrowIfStopped();
    }
    if (cost < best_cost) {
      best_cost = cost;
      best_u = u;
    }
  }

  ReplayFit fit;
  fit.mean = ToX(best_u);
  const std::vector<VectorXd> residuals = predictions.Residuals(best_u);
  MatrixXd hessian;
  VectorXd descent;
  predictions.Linearize(best_u, residuals, hessian, descent);
  // From u to x: du/dx = u (1 - u), there where x is.
  const VectorXd u = fit.mean.unaryExpr(&LogitToUnit);
  const VectorXd slope = u.array() * (1 - u.array());
  const MatrixXd precision = slope.asDiagonal() * hessian * slope.asDiagonal() / predictions.MeanSquare(residuals);
  fit.covariance = (precision + prior.precision).inverse();
  if (!prior.uniform) {
    fit.mean += fit.covariance * (prior.precision * (prior.mean - fit.mean));
    fit.mean = fit.mean.cwiseMax(-kMaxX).cwiseMin(kMaxX);
  }
  progress(n_total, n_total, fit.mean);
  return fit;
}

}  // namespace oted
