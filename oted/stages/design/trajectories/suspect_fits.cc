#include "oted/stages/design/trajectories/suspect_fits.h"

#include <algorithm>
#include <cmath>

#include "oted/matching/as_vector.h"
#include "oted/matching/designer.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/suspects.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr double kLargestStartX = 4.5;  // of what is freed: a start on a bound would hardly move
constexpr int kFewestShortSteps = 4, kMostShortSteps = 8;
constexpr double kShortSeconds = 0.06;

}  // namespace

SuspectFits::SuspectFits(const FreedProblem& problem)
    : problem_(problem),
      period_(problem.factory.spec().control_period_s),
      noise_(AsVector(problem.fit.short_noise_std)),
      parts_(KeepAside(problem.dataset, period_, problem.kept_aside)) {
  const bool has_unseen = problem.fit.unseen && !problem.fit.unseen->z.empty();
  const std::vector<double> x = ZToLogit(problem.factory.parameters(), has_unseen ? problem.fit.unseen->z : problem.z);
  x_ = AsVector(x);
}

ReadingModel SuspectFits::ReadingsOf(const SimulatorFactory& factory) const {
  return ::oted::ReadingsOf(factory.spec(), problem_.dataset, problem_.fit.unseen);
}

WindowReplayer SuspectFits::Replayer(const SimulatorFactory& factory, const ReadingModel& readings) const {
  return MakeReplayer(factory, parts_.learn, readings, problem_.context.n_threads);
}

int SuspectFits::ShortSteps() const {
  const int wanted = static_cast<int>(std::lround(kShortSeconds / period_));
  return std::max(ReadingsOf(problem_.factory).ShortestWindow(),
                  std::clamp(wanted, kFewestShortSteps, kMostShortSteps));
}

Prior SuspectFits::PriorIn(const ParameterSpace& space) const {
  const Prior of_nominal = ForTrajectories(Prior::Uniform(space.size()), space);
  return WithOneMore(problem_.prior, of_nominal.mean[space.size() - 1]);
}

VectorXd SuspectFits::StartOf(const SimulatorFactory& wider, const VectorXd& x, double value) {
  const ParameterSpace& space = wider.parameters();
  std::vector<double> z = space.Nominal();
  z.back() = value;
  VectorXd start(x.size() + 1);
  start << x, std::clamp(ZToLogit(space, z).back(), -kLargestStartX, kLargestStartX);
  return start;
}

void SuspectFits::Descend(LevelFit& fit, int n_iterations) const {
  fit.Descend(n_iterations, [&](const VectorXd&) { problem_.context.ThrowIfStopped(); });
}

}  // namespace oted
