// Delay, bias and noise as parameters of a design: what lies between controller and plant is found from logs.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/effects.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::channels_design_test {

constexpr size_t kGain = 0, kDamping = 1, kChannel = 3;

DesignConfig SmallConfig() {
  DesignConfig config = DesignConfig::For(DesignMethod::kTransitions);
  config.adversarial.n_sims = 24;
  config.adversarial.n_steps = 40;
  config.adversarial.n_iterations = 150;
  config.discriminator.hidden = {48, 48};
  config.discriminator.learning_rate = 1e-3;
  config.discriminator.steps = 30;
  config.discriminator.batch = 128;
  return config;
}

/// The mode of q after a design on ten episodes of the point mass at the truth (1.5, 0.6, -, `channel`).
std::vector<double> Design(const SimulatorFactory& factory, double channel, int n_iterations, int horizon = 10) {
  const TestFolder folder;
  const Dataset logs = RandomLogs(*factory.Make(10, 1), {1.5, 0.6, 0.5, channel});
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 1};
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = n_iterations;
  config.adversarial.horizon = horizon;
  const DesignResult design =
      LearnDesign({factory, logs, nullptr, RngKey(1), folder.path(), "design/test/1", context}, config);
  const std::vector<double> mode = design.q.Mode();
  for (size_t i = 0; i < mode.size(); ++i) {
    testing::Test::RecordProperty("mode_" + std::to_string(i), std::to_string(mode[i]));
  }
  return mode;
}

/// Sets states as if nothing had been logged before them.
class Forgetful : public ChannelSimulator {
 public:
  using ChannelSimulator::ChannelSimulator;
  bool SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory&) override {
    return ChannelSimulator::SetStateFromLog(lane, observation, {});
  }
};
class ForgetfulFactory : public ChannelSimulatorFactory {
 public:
  using ChannelSimulatorFactory::ChannelSimulatorFactory;
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Forgetful>(setup(), MakePlant(n_lanes, n_threads));
  }
};

TEST(DesignOfChannels, RecoversAnActionDelayFromReplaysNoLongerThanItself) {
  const std::vector<double> mode = Design(*PointMassBehind("action/delay", 0, 4), 2, 150, 2);
  EXPECT_NEAR(mode[kChannel], 2, 0.15) << "control steps";
  EXPECT_NEAR(mode[kGain], 1.5, 0.15);
  EXPECT_NEAR(mode[kDamping], 0.6, 0.1);
}

TEST(DesignOfChannels, WithoutTheActionsLoggedBeforeTheirStartsSuchReplaysMisleadAboutTheDelay) {
  std::vector<ParameterSpec> specs = PointMassBehind("action/delay", 0, 4)->parameters().specs();
  const ForgetfulFactory factory(specs, [](const auto&) { return std::make_unique<PointMassFactory>(); });
  EXPECT_GT(std::abs(Design(factory, 2, 80, 2)[kChannel] - 2), 0.5);
}

TEST(DesignOfChannels, RecoversTheBiasOfASensor) {
  EXPECT_NEAR(Design(*PointMassBehind("obs/v/bias", -1, 1), 0.4, 60)[kChannel], 0.4, 0.04);
}

TEST(DesignOfChannels, RecoversTheScaleOfAnEncoderBesideWhatItLooksLike) {
  // A pendulum whose readings are too large swings as if its torque was.
  const TestFolder folder;
  const std::vector<ParameterSpec> specs = {
      {.name = "gain", .field = "actuator/*/gear[0]", .low = 0.5, .high = 2},
      {.name = "encoder", .field = "obs/joint/hinge/qpos/scale + obs/joint/hinge/qvel/scale", .low = 0.5, .high = 2}};
  const auto factory = WithChannels(specs, [&](const std::vector<ParameterSpec>& of_plant) {
    return std::make_unique<MujocoSimulatorFactory>(HingeTask(folder, kBesideAWall), of_plant);
  });
  const std::vector<double> truth = {1.2, 1.05};
  NullSink log;
  const Prior prior = Prior::Uniform(2);
  const ReplayFit fit = MatchTrajectories({*factory,
                                           LogsUnderTorques(*factory, truth, 0.9),
                                           prior,
                                           RngKey(1),
                                           [](int, int, const Eigen::VectorXd&) {},
                                           {.log = &log, .n_threads = 1}},
                                          {.rows = 400, .starts = 2, .coarse = 16});
  const std::vector<double> z = LogitToZ(factory->parameters(), {fit.mean.data(), 2});
  EXPECT_NEAR(z[0], truth[0], 0.001);
  EXPECT_NEAR(z[1], truth[1], 0.001);
}

TEST(DesignOfChannels, RecoversTheNoiseOfASensor) {
  EXPECT_NEAR(Design(*PointMassBehind("obs/x/noise_std", 0, 0.5), 0.1, 60)[kChannel], 0.1, 0.015);
}

TEST(EffectCosines, OfParametersThatAddUpIsOneAndOfSeparateSensorsZero) {
  // Gain and the bias of v both shift v; the noise of x is its own.
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  const auto channel = [](const std::string& name, const std::string& path) {
    return ParameterSpec{.name = name, .field = path, .low = 0, .high = 1, .scale = ParameterScale::kAbsolute};
  };
  specs.push_back(channel("x", "obs/x/noise_std"));
  specs.push_back(channel("v", "obs/v/noise_std"));
  const ChannelSimulatorFactory factory(specs, [](const auto&) { return std::make_unique<PointMassFactory>(); });
  const Dataset logs = RandomLogs(*factory.Make(5, 1), {1, 1, 0.5, 0, 0});
  const Array2<double> cosines = EffectCosines(factory, logs, 20, RngKey(1), 1);
  EXPECT_EQ(cosines(0, 0), 1);
  EXPECT_EQ(cosines(0, 2), 0) << "idle has no effect";
  EXPECT_EQ(cosines(3, 4), 0) << "two sensors";
  EXPECT_NEAR(cosines(0, 3), 0, 0.3) << "noise is like no action";
  EXPECT_EQ(cosines(1, 0), cosines(0, 1));
}

/// A point mass whose third parameter multiplies the gain.
class TwoGains : public PointMass {
 public:
  using PointMass::PointMass;
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, std::vector<double>{0.2 + z[0] * z[2] * 0.4, z[1], z[2]});
  }
};
class TwoGainsFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<TwoGains>(PointMassOptions{}, n_lanes, n_threads);
  }
};

TEST(EffectCosines, OfTwoFactorsOfOneProductIsOne) {
  const Dataset logs = PointMassLogs({1, 1, 0.5}, 5);
  EXPECT_GT(EffectCosines(TwoGainsFactory(), logs, 20, RngKey(1), 1)(0, 2), 0.999);
}

TEST(MeasureEffects, TheLargestChangeIsThatOfTheObservationThatReactsMost) {
  const auto factory = PointMassBehind("obs/v/bias", 0, 1);
  const Dataset logs = RandomLogs(*factory->Make(3, 1), {1, 1, 0.5, 0});
  const auto effects = MeasureEffects(*factory, logs, 3, RngKey(1), 1);
  ASSERT_EQ(effects[kChannel].by_observation.size(), 2u);
  EXPECT_EQ(effects[kChannel].by_observation[0], 0) << "x does not see it from a reset";
  EXPECT_GT(effects[kChannel].by_observation[1], 1);
  EXPECT_EQ(effects[kChannel].largest_change, effects[kChannel].by_observation[1]);
}

}  // namespace oted::channels_design_test
