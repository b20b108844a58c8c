#include "oted/stages/design/trajectories/own_designs.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/matching/as_vector.h"
#include "oted/stages/design/trajectories/distant_values.h"
#include "oted/stages/design/trajectories/fit_steps.h"
#include "oted/stages/design/trajectories/own_logs.h"

namespace oted {
namespace {

using Eigen::LLT;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kOtherMinima = 0.1;  // of the windows: below, starts have none, and covariances can be trusted
constexpr size_t kFirstLogs = 2, kMostLogs = 4;

/// Mean square of numbers that have variance 1 where `covariance` holds.
double MeanSquare(const std::vector<VectorXd>& off, const MatrixXd& covariance) {
  const LLT<MatrixXd> factor(covariance);
  double sum = 0;
  for (const VectorXd& d : off) sum += factor.matrixL().solve(d).squaredNorm();
  return sum / static_cast<double>(off.size() * static_cast<size_t>(covariance.rows()));
}

}  // namespace

OwnDesigns DesignsFromOwnLogs(const ReplayProblem& problem, const TrajectoriesConfig& config, ShortWindows& design,
                              const FitEvidence& evidence, const MatrixXd& covariance) {
  const RngKey key = problem.key.Stage("own logs");
  Rng of_starts = key.MakeRng();
  // Of where something stands few windows tell, and they through contact.
  const bool has_places = std::ranges::any_of(problem.factory.parameters().specs(), IsPlace);
  if (!design.IsNoisy()) return {};
  if (!has_places && design.fit().ShareAtOtherMinima(of_starts) < kOtherMinima) return {};
  const VectorXd x = design.fit().x();
  const std::vector<double> z = ToZ(problem.factory.parameters(), x);
  const auto noise = AsVector(evidence.noise_std);
  OwnDesigns own;
  std::vector<VectorXd> off;
  while (own.x.size() < kMostLogs) {
    const FitProgress tell = [&, name = fmt::format("log {}", off.size() + 1)](int done, int total, const VectorXd&) {
      problem.context.log->Progress("own logs", name, done, total, "");
    };
    Rng rng = key.Index(off.size()).MakeRng();
    const Dataset logs = OwnLogs(design.replayer(), design.fit(), z, noise, Through::kExplained, rng);
    const ReplayProblem again{problem.factory, logs,  problem.prior,     problem.key, tell,
                              problem.context, false, problem.kept_aside};
    FitEvidence unused;
    FitSteps own_steps(tell, problem.context);
    ShortWindows windows(again, config, 0, own_steps, unused, design.readings().computed);
    windows.Fit();
    windows.fit().Finish();
    own_steps.Finish(windows.fit().x());
    own.times_fewer = std::max(1.0, static_cast<double>(design.fit().n_rows()) / windows.fit().n_rows());
    own.x.push_back(windows.fit().x());
    off.push_back(Off(own.x.back(), x));
    if (off.size() == kFirstLogs && MeanSquare(off, own.times_fewer * covariance) <= 1) return own;
  }
  own.are_near = false;
  return own;
}

VectorXd Off(const VectorXd& x, const VectorXd& of_design) {
  const auto within = [](const VectorXd& a) { return a.cwiseMax(-kMaxX).cwiseMin(kMaxX); };
  return within(x) - within(of_design);
}

MatrixXd AsWideAs(const std::vector<VectorXd>& off, double times_fewer, const MatrixXd& covariance) {
  if (off.empty()) return covariance;
  const MatrixXd factor = LLT<MatrixXd>(covariance).matrixL();
  MatrixXd scatter = MatrixXd::Zero(covariance.rows(), covariance.cols());
  for (const VectorXd& d : off) {
    const VectorXd whitened = factor.triangularView<Eigen::Lower>().solve(d);
    scatter += whitened * whitened.transpose() / static_cast<double>(off.size());
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(scatter);
  const VectorXd times = 1 + (axes.eigenvalues().array() - times_fewer).cwiseMax(0);
  const MatrixXd wider =
      factor * axes.eigenvectors() * times.asDiagonal() * axes.eigenvectors().transpose() * factor.transpose();
  return 0.5 * (wider + wider.transpose());
}

}  // namespace oted
