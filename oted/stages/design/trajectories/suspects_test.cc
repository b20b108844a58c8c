#include "oted/stages/design/trajectories/suspects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::suspects_test {

constexpr double kDamping = 0.5;  // of the model

/// The point mass with its gain alone as a parameter; behind it, where there is more, multiples of its damping and
/// idle.
class GainOfPointMass : public PointMass {
 public:
  using PointMass::PointMass;
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, std::vector<double>{z[0], kDamping * (z.size() > 1 ? z[1] : 1.0), 0.5});
  }
};

class GainFactory : public PointMassFactory {
 public:
  explicit GainFactory(const std::vector<ParameterSpec>& more = {}) {
    std::vector<ParameterSpec> specs = {PointMass::MakeParameters()[0]};
    specs.insert(specs.end(), more.begin(), more.end());
    parameters_ = ParameterSpace(specs);
  }
  const ParameterSpace& parameters() const override { return parameters_; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<GainOfPointMass>(PointMassOptions{}, n_lanes, n_threads);
  }
  std::vector<ParameterSpec> Suspects() const override {
    return {{.name = "env/damping", .field = "env/damping"}, {.name = "env/idle", .field = "env/idle"}};
  }
  std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& more) const override {
    return std::make_unique<GainFactory>(more);
  }

 private:
  ParameterSpace parameters_;
};

/// What is suspected where the target's damping is `factor` times the model's, whose gain alone is searched.
std::vector<Suspect> SuspectsOf(double factor, uint64_t seed) {
  NullSink log;
  const Dataset logs = WithSensorNoise(PointMassLogs({1.3, factor * kDamping, 0.5}, 20), 0.02, RngKey(seed));
  const RunContext context{.log = &log, .n_threads = 1};
  return MatchTrajectories(
             {GainFactory(), logs, Prior::Uniform(1), RngKey(seed), [](int, int, const Eigen::VectorXd&) {}, context},
             {.rows = 400, .starts = 2, .coarse = 16})
      .evidence->suspects;
}

TEST(FindSuspects, NamesWhatIsOffAndByHowMuch) {
  for (const double factor : {0.8, 1.25}) {
    const std::vector<Suspect> suspects = SuspectsOf(factor, 3);
    ASSERT_EQ(suspects.size(), 1u);
    EXPECT_EQ(suspects[0].field, "env/damping");
    EXPECT_NEAR(suspects[0].factor, factor, 0.08);
  }
}

TEST(FindSuspects, SuspectsNothingWhereTheSearchedParametersExplainTheLogs) {
  for (uint64_t seed = 0; seed < 20; ++seed) EXPECT_TRUE(SuspectsOf(1.0, seed).empty());
}

}  // namespace oted::suspects_test
