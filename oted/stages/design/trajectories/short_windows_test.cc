#include "oted/stages/design/trajectories/short_windows.h"

#include <gtest/gtest.h>

#include <set>

#include "oted/base/log.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::short_windows_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};
constexpr int kEpisodes = 30;

/// Short windows of these logs, from a fifth of their rows.
class Fitted {
 public:
  explicit Fitted(const Dataset& logs)
      : problem_{factory_, logs, prior_, RngKey(1), no_progress_, context_},
        steps_(no_progress_, context_),
        short_(problem_, config_, 0, steps_, evidence_) {}
  ShortWindows& windows() { return short_; }
  const FitEvidence& evidence() const { return evidence_; }

 private:
  PointMassFactory factory_;
  Prior prior_ = Prior::Uniform(3);
  NullSink log_;
  RunContext context_{.log = &log_};
  FitProgress no_progress_ = [](int, int, const VectorXd&) {};
  TrajectoriesConfig config_{.rows = 120, .starts = 2, .coarse = 16};
  ReplayProblem problem_;
  FitEvidence evidence_;
  FitSteps steps_;
  ShortWindows short_;
};

Dataset Noisy(const Dataset& logs) { return WithSensorNoise(logs, 0.01, RngKey(3)); }

TEST(ShortWindows, MoreRowsOfTheSameAreExplainedAsWell) {
  const Dataset logs = Noisy(PointMassLogs(kTruth, kEpisodes));
  Fitted fitted(logs);
  EXPECT_TRUE(fitted.windows().Fit());
  EXPECT_TRUE(fitted.windows().FitMoreRows());
  EXPECT_EQ(fitted.evidence().window, 16);
}

TEST(ShortWindows, MoreRowsMayShowWhatFewRowsDidNot) {
  const Dataset of_truth = PointMassLogs(kTruth, kEpisodes);
  // Which episodes the first fit sees is a matter of the logs' shape alone. Each of the others is of a plant of its
  // own.
  std::set<int> seen;
  Fitted first(of_truth);
  first.windows().Fit();
  for (const LogWindow& window : first.windows().fit().level().windows) seen.insert(window.episode_begin);
  Dataset mixed;
  double gain = 0.3;
  for (const Episode& episode : of_truth.Episodes()) {
    const bool is_seen = seen.contains(episode.begin);
    mixed.Append((is_seen ? of_truth : PointMassLogs({gain, 0.6, 0.5}, kEpisodes)).Select({episode}));
    if (!is_seen) gain += 0.07;
  }
  ASSERT_LT(seen.size(), kEpisodes / 2);

  const Dataset logs = Noisy(mixed);
  Fitted fitted(logs);
  ASSERT_TRUE(fitted.windows().Fit());
  ASSERT_EQ(fitted.evidence().window, 16);
  EXPECT_FALSE(fitted.windows().FitMoreRows());
  EXPECT_LT(fitted.evidence().window, 16);
}

}  // namespace oted::short_windows_test
