#include "oted/stages/design/replay/start_finder.h"

#include <gmock/gmock.h>

#include <cmath>

#include "oted/stages/design/testing.h"

namespace oted {
namespace {

/// Four episodes of the point mass whose velocity nobody sees, and the velocities.
struct Logged {
  Dataset logs;
  std::vector<double> velocities;
};

Logged LogsOfPositions(const std::vector<double>& truth) {
  PositionAlone mass(1, 1);
  mass.SetParameters(0, truth);
  Logged made;
  const int lane = 0;
  for (int i = 0; i < 80; ++i) {
    Rng rng(static_cast<uint64_t>(i));
    if (i % 20 == 0) mass.Reset(0, rng);
    const std::vector<double> action = {std::sin(0.7 * i)};
    made.logs.observations.AppendRow(mass.observation(0));
    made.velocities.push_back(mass.PointMass::observation(0)[1]);
    made.logs.actions.AppendRow(action);
    mass.Step({&lane, 1}, action);
    made.logs.next_observations.AppendRow(mass.observation(0));
    made.logs.terminals.push_back(0);
    made.logs.timeouts.push_back(i % 20 == 19);
  }
  return made;
}

TEST(StartFinder, FindsTheUnseenVelocityFromWhichReplaysReproduceTheLog) {
  const std::vector<double> truth = {1.3, 0.5, 0.0};
  const Logged made = LogsOfPositions(truth);
  const PositionAloneFactory factory;
  StartFinder finder(factory, made.logs, Eigen::VectorXd::Constant(1, 1e-6), 1);
  const std::vector<int> rows = {3, 24, 44};
  constexpr int kSteps = 15;
  ASSERT_LT(finder.n_lead(), kSteps);
  const std::vector<ReplayStart> starts = finder.Find(rows, kSteps, truth);
  ASSERT_EQ(starts.size(), rows.size());
  const auto simulator = factory.Make(static_cast<int>(rows.size()), 1);
  const std::vector<Array2<double>> replayed = ReplayWindows(*simulator, made.logs, starts, kSteps, truth);
  for (size_t i = 0; i < rows.size(); ++i) {
    EXPECT_NEAR(starts[i].state.at(1), made.velocities[static_cast<size_t>(rows[i])], 1e-4);
    const Array2<double> logged = LoggedWindow(made.logs, rows[i], kSteps);
    for (int t = 0; t <= kSteps; ++t) EXPECT_NEAR(replayed[i](t, 0), logged(t, 0), 1e-4) << rows[i] << " " << t;
  }
}

}  // namespace
}  // namespace oted
