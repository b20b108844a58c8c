#include "oted/stages/design/replay/reading_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/stages/design/testing.h"

namespace oted::reading_model_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

void Round(Dataset& logs, double step) {
  for (Array2<double>* rows : {&logs.observations, &logs.next_observations}) {
    for (int i = 0; i < rows->rows(); ++i) {
      for (double& value : rows->row(i)) value = std::round(value / step) * step;
    }
  }
}

/// The velocity replaced by the difference of the positions before it.
void Differentiate(Dataset& logs) {
  for (const Episode& episode : logs.Episodes()) {
    for (int row = episode.begin; row < episode.end; ++row) {
      const double before = logs.observations(std::max(episode.begin, row - 1), 0);
      logs.observations(row, 1) = (logs.observations(row, 0) - before) / 0.1;
    }
  }
}

SimulatorSpec RatesKnown() {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.rate_of = {-1, 0};
  return spec;
}

TEST(ReadingModel, OfReadingsThatShowTheStateHoldsAll) {
  const ReadingModel readings = ReadingModel::Of(RatesKnown(), PointMassLogs(kTruth, 3));
  EXPECT_TRUE(readings.unread.empty());
  EXPECT_EQ(readings.Held(4), VectorXd::Ones(10));
  EXPECT_EQ(readings.smallest_std.maxCoeff(), 0);
}

TEST(ReadingModel, OfALaggingSensorHoldsWhatIsOfTheWindowAndGuessesItsStart) {
  SimulatorSpec spec = RatesKnown();
  spec.reading_ages = {0, 2};
  const Dataset logs = PointMassLogs(kTruth, 3);
  const ReadingModel readings = ReadingModel::Of(spec, logs);
  EXPECT_EQ(readings.unread, std::vector<int>{1});
  VectorXd held(9);
  held << 1, 0, 1, 0, 1, 1, 1, 1, 1;
  EXPECT_EQ(readings.Held(3), held) << "x and v of four rows, then the prior of the first v";
}

TEST(ReadingModel, GuessesARateFromPositionsAndNothingWhereThereAreNone) {
  const Dataset logs = RandomLogs(*PositionAloneFactory().Make(20, 1), kTruth);
  SimulatorSpec spec = PositionAlone::SpecOfPosition();
  spec.hidden.push_back({.name = "act"});
  ReadingModel readings = ReadingModel::Of(spec, logs);
  EXPECT_EQ(readings.guessed, (std::vector<char>{1, 0}));
  readings.mean[1] = 0.7;
  LocalRates rates(logs, spec.control_period_s);
  const VectorXd guess = readings.Guess(spec, logs, rates, 5);
  EXPECT_EQ(guess[0], logs.observations(5, 0));
  EXPECT_EQ(guess[1], rates.Rate(0, 5));
  EXPECT_EQ(guess[2], 0.7);
}

TEST(QuantisationNoise, IsThatOfAnEncodersStepAlsoWhereTheFileRoundsIt) {
  Dataset logs = PointMassLogs(kTruth, 20);
  Round(logs, 0.031);
  EXPECT_NEAR(QuantisationNoise(logs)[0], 0.031 / std::sqrt(12.0), 1e-6);
  Round(logs, 1e-5);
  EXPECT_NEAR(QuantisationNoise(logs)[0], 0.031 / std::sqrt(12.0), 1e-4);
  EXPECT_EQ(QuantisationNoise(PointMassLogs(kTruth, 20))[0], 0) << "readings that do not repeat";
}

TEST(ComputedReadings, AreDifferencesOfNoisyPositionsAndNotReadingsOfTheirOwn) {
  const VectorXd noise = Eigen::Vector2d(0.02, 0.28);
  const Dataset own = WithSensorNoise(PointMassLogs(kTruth, 40), 0.02, RngKey(2));
  Dataset differences = own;
  Differentiate(differences);
  EXPECT_EQ(ComputedReadings(RatesKnown(), differences, noise), (std::vector<char>{0, 1}));
  EXPECT_EQ(ComputedReadings(RatesKnown(), own, Eigen::Vector2d(0.02, 0.02)), (std::vector<char>{0, 0}));
  EXPECT_EQ(ComputedReadings(PointMass::MakeSpec({}), differences, noise), (std::vector<char>{0, 0}))
      << "nobody says that v is a rate";
}

/// Two sines and their derivative `lag` rows ago, with white noise on both.
Dataset LogsOfSines(double lag, double noise_of_position, double noise_of_rate) {
  constexpr double kPeriod = 0.02;
  constexpr int kRows = 800;
  Rng rng(4);
  std::vector<std::array<double, 2>> rows;
  for (int i = 0; i <= kRows; ++i) {
    const double t = i * kPeriod, before = t - lag * kPeriod;
    rows.push_back({std::sin(2 * t) + 0.4 * std::sin(7 * t + 1) + noise_of_position * rng.Normal(),
                    2 * std::cos(2 * before) + 2.8 * std::cos(7 * before + 1) + noise_of_rate * rng.Normal()});
  }
  Dataset logs;
  for (size_t i = 0; i < kRows; ++i) {
    logs.observations.AppendRow(rows[i]);
    logs.next_observations.AppendRow(rows[i + 1]);
    logs.actions.AppendRow(std::array{0.0});
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i == kRows - 1);
  }
  return logs;
}

TEST(ComputedReadings, AreNotExactOnesThatAWrongSimulatorMisses) {
  SimulatorSpec spec = RatesKnown();
  spec.control_period_s = 0.02;
  Dataset logs = LogsOfSines(0, 0, 0);
  // A motion that no combination of a few positions gives.
  for (int i = 0; i < logs.size(); ++i) {
    const double t = i * spec.control_period_s, phase = 0.4 * t * t;
    logs.observations(i, 0) = std::sin(phase);
    logs.observations(i, 1) = 0.8 * t * std::cos(phase);
  }
  const VectorXd misses = Eigen::Vector2d(0.02, 0.28);
  EXPECT_EQ(ComputedReadings(spec, logs, misses), (std::vector<char>{0, 0}));
}

TEST(LateReadings, AreRatesThatAreARowOrMoreBehindTheirPositions) {
  SimulatorSpec spec = RatesKnown();
  spec.control_period_s = 0.02;
  const std::vector<char> late = {0, 1}, none = {0, 0};
  for (const double lag : {1.0, 1.5, 2.0}) EXPECT_EQ(LateReadings(spec, LogsOfSines(lag, 1e-3, 0.05)), late) << lag;
  for (const double noise : {0.0, 0.01, 0.3}) {
    EXPECT_EQ(LateReadings(spec, LogsOfSines(0, 1e-4, noise)), none) << noise;
    EXPECT_EQ(LateReadings(spec, LogsOfSines(0.4, 1e-4, noise)), none) << noise;
  }
  spec.reading_ages = {0, 3};
  EXPECT_EQ(LateReadings(spec, LogsOfSines(2, 1e-3, 0.05)), none) << "whose delay is searched";
}

}  // namespace oted::reading_model_test
