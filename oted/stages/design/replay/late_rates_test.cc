#include "oted/stages/design/replay/late_rates.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/sim/mujoco/mujoco_simulator.h"

namespace oted::late_rates_test {

constexpr double kPeriod = 0.02;

SimulatorSpec Spec() {
  SimulatorSpec spec;
  spec.observation_shape = {2};
  spec.rate_of = {-1, 0};
  spec.control_period_s = kPeriod;
  return spec;
}

/// Two sines and their derivative `lag` periods ago, with white noise on both.
Dataset Logs(double lag, double noise_of_position, double noise_of_rate) {
  Dataset logs;
  Rng rng(4);
  const int n = 800;
  std::vector<std::array<double, 2>> rows;
  for (int i = 0; i <= n; ++i) {
    const double t = i * kPeriod, before = t - lag * kPeriod;
    rows.push_back({std::sin(2 * t) + 0.4 * std::sin(7 * t + 1) + noise_of_position * rng.Normal(),
                    2 * std::cos(2 * before) + 2.8 * std::cos(7 * before + 1) + noise_of_rate * rng.Normal()});
  }
  for (int i = 0; i < n; ++i) {
    logs.observations.AppendRow(rows[static_cast<size_t>(i)]);
    logs.next_observations.AppendRow(rows[static_cast<size_t>(i) + 1]);
    logs.actions.AppendRow(std::array{0.0});
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i == n - 1);
  }
  return logs;
}

TEST(LateRates, AreToldWithTheirLag) {
  for (const int lag : {1, 2, 4}) EXPECT_EQ(LateRates(Spec(), Logs(lag, 1e-3, 0.05))[1], lag);
}

TEST(LateRates, AreNoneWhereRatesAreOfTheirRowOrLaterByLessThanAPeriod) {
  for (const double noise : {0.0, 0.01, 0.3}) {
    EXPECT_EQ(LateRates(Spec(), Logs(0, 1e-4, noise))[1], 0) << noise;
    EXPECT_EQ(LateRates(Spec(), Logs(0.4, 1e-4, noise))[1], 0) << noise;
  }
}

TEST(LateRates, AreNoneWhereTheNoiseOfPositionsHidesThem) { EXPECT_EQ(LateRates(Spec(), Logs(1, 0.2, 0.05))[1], 0); }

TEST(LateRates, AreNoneOfASensorWhoseLagIsKnown) {
  SimulatorSpec spec = Spec();
  spec.reading_ages = {0, 3};
  EXPECT_EQ(LateRates(spec, Logs(2, 1e-3, 0.05))[1], 0);
}

TEST(LateRates, AreNoneInSimulatedLogs) {
  for (const char* task : {"Hopper-v5", "HalfCheetah-v5", "Walker2d-v5"}) {
    const MujocoSimulatorFactory factory(task, {});
    const auto simulator = factory.Make(1, 1);
    Dataset logs;
    Rng rng(2);
    for (int episode = 0; episode < 20; ++episode) {
      simulator->Reset(0, rng);
      for (int i = 0; i < 60; ++i) {
        std::vector<double> action(static_cast<size_t>(factory.spec().act_dim));
        for (double& a : action) a = rng.Uniform(-1, 1);
        logs.observations.AppendRow(simulator->observation(0));
        logs.actions.AppendRow(action);
        const int lane = 0;
        simulator->Step({&lane, 1}, action);
        logs.next_observations.AppendRow(simulator->observation(0));
        logs.terminals.push_back(0);
        logs.timeouts.push_back(i == 59);
      }
    }
    for (const int lag : LateRates(factory.spec(), logs)) EXPECT_EQ(lag, 0) << task;
  }
}

}  // namespace oted::late_rates_test
