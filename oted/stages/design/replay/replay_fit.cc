#include "oted/stages/design/replay/replay_fit.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/data/normalizer.h"
#include "oted/matching/as_vector.h"
#include "oted/matching/designer.h"

namespace oted {

using Eigen::VectorXd;

namespace {
constexpr int kLanes = 64;  // of each thread's simulator
constexpr double kEdge = 3.0;
constexpr double kFarthestMean = 2.0;  // in x: the 90 % interval about it reaches over two thirds of the range
}  // namespace

std::vector<double> ToZ(const ParameterSpace& space, const VectorXd& x) {
  return LogitToZ(space, {x.data(), static_cast<size_t>(x.size())});
}

VectorXd NominalStart(const ParameterSpace& space) {
  const std::vector<double> x = ZToLogit(space, space.Nominal());
  return AsVector(x).cwiseMax(-kEdge).cwiseMin(kEdge);
}

Prior ForTrajectories(const Prior& prior, const ParameterSpace& space) {
  if (!prior.uniform) return prior;
  return Prior::Gaussian(NominalStart(space).cwiseMax(-kFarthestMean).cwiseMin(kFarthestMean), prior.Covariance());
}

VectorXd ChannelScales(const Dataset& dataset) {
  const std::vector<double> scale = Normalizer::Fit(dataset.observations).scale;
  return AsVector(scale);
}

ReadingModel ReadingsOf(const SimulatorSpec& spec, const Dataset& logs, const std::optional<UnseenFit>& unseen) {
  if (!unseen) return ReadingModel::Of(spec, logs);
  ReadingModel readings = ReadingModel::Of(spec, logs, unseen->computed);
  // Where a sensor may lag that could not then, more is unread, of which the fit expected nothing.
  if (readings.unread.size() != unseen->mean.size()) return readings;
  readings.mean = AsVector(unseen->mean);
  readings.std = AsVector(unseen->std);
  return readings;
}

WindowReplayer MakeReplayer(const SimulatorFactory& factory, const Dataset& dataset, const ReadingModel& readings,
                            int n_threads) {
  WindowReplayer::Simulators simulators;
  for (int i = 0; i < std::max(1, n_threads); ++i) simulators.push_back(factory.Make(kLanes, 1));
  return WindowReplayer(std::move(simulators), dataset, readings);
}

std::vector<LogWindow> DrawStretches(const Dataset& dataset, int length, int n_rows, Rng& rng) {
  std::vector<LogWindow> stretches;
  for (const Episode& episode : dataset.Episodes()) {
    // What an episode has beyond whole stretches falls on either end, by chance.
    const int spare = episode.size() % length;
    const int begin = episode.begin + (spare > 0 ? static_cast<int>(rng.Below(static_cast<uint64_t>(spare))) : 0);
    for (int i = begin; i + length <= episode.end; i += length) stretches.push_back({i, length, episode.begin});
  }
  std::vector<LogWindow> drawn;
  for (const int k : RandomPermutation(static_cast<int>(stretches.size()), rng)) {
    if (static_cast<int>(drawn.size()) * length >= n_rows) break;
    drawn.push_back(stretches[static_cast<size_t>(k)]);
  }
  return drawn;
}

std::vector<LogWindow> DrawStartable(WindowReplayer& replayer, const Dataset& dataset, const SimulatorSpec& spec,
                                     int length, int n_rows, Rng& rng) {
  std::vector<LogWindow> startable;
  // All of them in random order: the first few may be ones that cannot be set.
  for (const LogWindow& window : DrawStretches(dataset, length, dataset.size(), rng)) {
    if (static_cast<int>(startable.size()) * length >= n_rows) break;
    if (replayer.CanStart(window)) startable.push_back(window);
  }
  if (startable.empty()) ThrowNothingStartable(dataset, spec, length);
  return startable;
}

std::vector<VectorXd> LoggedStarts(const WindowReplayer& replayer, const std::vector<LogWindow>& windows) {
  std::vector<VectorXd> starts;
  for (const LogWindow& window : windows) starts.push_back(replayer.Guess(window));
  return starts;
}

void ThrowNothingStartable(const Dataset& dataset, const SimulatorSpec& spec, int length) {
  throw DataError(fmt::format(
      "no state of dataset '{}' can be set in task '{}' (velocities at the observation's clip, or episodes under {} "
      "transitions?); use --set design.method=paper",
      dataset.path, spec.task, length));
}

}  // namespace oted
