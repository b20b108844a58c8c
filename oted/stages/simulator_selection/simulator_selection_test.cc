#include "oted/stages/simulator_selection/simulator_selection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "oted/base/error.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::simulator_selection_test {

const std::vector<double> kTruth = {1.6, 0.5, 0.5};
constexpr double kLog2 = std::numbers::ln2;

/// A design that is nearly certain of `z`, with an untrained g.
Candidate CertainOf(const std::string& setting, int seed, const std::vector<double>& z, const Dataset& logs) {
  const ParameterSpace space = PointMass::MakeParameters();
  std::vector<double> mean;
  for (const double u : space.ToUnit(z)) mean.push_back(std::log(u / (1 - u)));
  Candidate candidate;
  candidate.setting = setting;
  candidate.seed = seed;
  candidate.q = Designer(space, 1.0);
  candidate.q.Restore(mean, std::vector<double>(mean.size(), -5.0));
  Rng rng(static_cast<uint64_t>(seed));
  candidate.g = Discriminator(DatasetFeatures(logs, candidate.evidence), {}, rng);
  return candidate;
}

SelectionConfig SmallConfig() {
  SelectionConfig config;
  config.n_sims = 4;
  config.n_steps = 60;
  config.judge_steps = 60;
  return config;
}

SelectionResult Select(const Dataset& logs, std::vector<Candidate> candidates, const SelectionConfig& config,
                       int n_threads = 1) {
  NullSink log;
  const RunContext context{.log = &log, .n_threads = n_threads};
  return SelectSimulator({PointMassFactory(), logs, nullptr, config, RngKey(3), context}, candidates);
}

TEST(SelectSimulator, ACandidateAtTheTruthOutranksOneFarAway) {
  const Dataset logs = PointMassLogs(kTruth, 8);
  const auto result =
      Select(logs, {CertainOf("far", 1, {0.6, 0.9, 0.5}, logs), CertainOf("true", 1, kTruth, logs)}, SmallConfig());
  EXPECT_GT(result.candidates[1].common.value(), kLog2 - 0.05);
  EXPECT_LT(result.candidates[0].common.value(), kLog2 - 0.2);
  EXPECT_EQ(result.settings[static_cast<size_t>(result.selected_setting)].setting, "true");
  EXPECT_EQ(result.best_candidate, 1);
  EXPECT_LT(result.nominal_common.value(), kLog2 - 0.1) << "the nominal simulator has gain and damping wrong";
}

TEST(SelectSimulator, ASettingWhosePlaceAnotherTookIsScoredAndNeverSelected) {
  const Dataset logs = PointMassLogs(kTruth, 8);
  std::vector<Candidate> candidates = {CertainOf("true", 1, kTruth, logs), CertainOf("far", 1, {0.6, 0.9, 0.5}, logs)};
  candidates[0].superseded = true;
  const auto result = Select(logs, candidates, SmallConfig());
  EXPECT_GT(result.settings[0].common, result.settings[1].common);
  EXPECT_EQ(result.selected_setting, 1);
  EXPECT_EQ(result.best_candidate, 1);
  EXPECT_EQ(result.settings[0].best_candidate, 0);
}

TEST(SelectSimulator, WithoutAGapTheUndesignedSimulatorScoresLog2) {
  const Dataset logs = PointMassLogs(PointMassFactory().parameters().Nominal(), 8);
  const auto result = Select(logs, {CertainOf("a", 1, {0.6, 0.5, 0.5}, logs)}, SmallConfig());
  EXPECT_NEAR(result.nominal_common.value(), kLog2, 0.03);
  EXPECT_LE(result.nominal_common, kLog2) << "a blind judge is the worst judge";
}

TEST(SelectSimulator, OfSeedsThatNoJudgeTellsApartTheOneNearestTheirMeanWins) {
  const Dataset logs = PointMassLogs(kTruth, 8);
  const auto near_truth = [&](int seed, double gain) { return CertainOf("a", seed, {gain, 0.5, 0.5}, logs); };
  SelectionConfig config = SmallConfig();
  config.judge_steps = 1;  // checked every 20 steps: the judge stays blind, every score is log 2
  const auto result = Select(logs, {near_truth(1, 1.2), near_truth(2, 1.9), near_truth(3, 1.6)}, config);
  for (const CandidateScore& score : result.candidates) EXPECT_EQ(score.common, kLog2);
  EXPECT_EQ(result.best_candidate, 2);
}

TEST(SelectSimulator, ScoresDoNotDependOnThreads) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  const std::vector<Candidate> candidates = {CertainOf("a", 1, {0.6, 0.9, 0.5}, logs), CertainOf("a", 2, kTruth, logs)};
  const auto one = Select(logs, candidates, SmallConfig(), 1), three = Select(logs, candidates, SmallConfig(), 3);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(one.candidates[i].c, three.candidates[i].c);
    EXPECT_EQ(one.candidates[i].common, three.candidates[i].common);
  }
  EXPECT_EQ(one.nominal_common, three.nominal_common);
}

TEST(SelectSimulator, ACandidatesScoreDoesNotDependOnItsRivals) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  const Candidate candidate = CertainOf("a", 2, {1.2, 0.7, 0.5}, logs);
  const auto alone = Select(logs, {candidate}, SmallConfig());
  const auto beside = Select(logs, {CertainOf("b", 1, kTruth, logs), candidate}, SmallConfig());
  EXPECT_EQ(alone.candidates[0].common, beside.candidates[1].common);
  EXPECT_EQ(alone.candidates[0].c, beside.candidates[1].c);
}

TEST(SelectSimulator, WhatIsAloneAndJudgedByItsPredictionsIsNotScored) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  const auto is_scored = [&](bool is_predicted, bool has_g) {
    Candidate candidate = CertainOf("a", 1, kTruth, logs);
    if (is_predicted) candidate.prediction.emplace();
    if (!has_g) candidate.g.reset();
    const auto result = Select(logs, {candidate}, SmallConfig());
    EXPECT_EQ(result.best_candidate, 0);
    EXPECT_EQ(result.settings[0].common, result.candidates[0].common);
    EXPECT_EQ(result.nominal_common.has_value(), result.candidates[0].common.has_value());
    return result.candidates[0].common.has_value();
  };
  EXPECT_FALSE(is_scored(true, false));
  EXPECT_TRUE(is_scored(false, false)) << "a judge gives the verdict";
  EXPECT_TRUE(is_scored(true, true)) << "the paper's own score is asked of it";
}

TEST(SelectSimulator, ADesignThatLeftNoDiscriminatorHasNoPaperScore) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  std::vector<Candidate> candidates = {CertainOf("with", 1, kTruth, logs), CertainOf("without", 1, kTruth, logs)};
  candidates[1].g.reset();
  const auto result = Select(logs, candidates, SmallConfig());
  EXPECT_TRUE(result.settings[0].c.has_value());
  EXPECT_FALSE(result.settings[1].c.has_value());
  EXPECT_FALSE(result.settings[1].learning_progress.has_value());
  EXPECT_THROW(CheckSelectionScore(SelectionScore::kPaper, "without", "trajectories", false), UsageError);
  EXPECT_NO_THROW(CheckSelectionScore(SelectionScore::kPaper, "with", "transitions", true));
  EXPECT_NO_THROW(CheckSelectionScore(SelectionScore::kCommon, "without", "trajectories", false));
}

TEST(SelectSimulator, ASettingsScoresAreMeansOverItsSeeds) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  std::vector<Candidate> candidates = {
      CertainOf("agree", 1, {1.0, 0.6, 0.5}, logs), CertainOf("agree", 2, {1.0, 0.6, 0.5}, logs),
      CertainOf("differ", 1, {0.8, 0.6, 0.5}, logs), CertainOf("differ", 2, {1.7, 0.6, 0.5}, logs)};
  candidates[0].learning_progress = candidates[1].learning_progress = 0;
  candidates[2].learning_progress = 1;
  candidates[3].learning_progress = 3;
  SelectionConfig config = SmallConfig();
  config.judge_steps = 20;
  config.score = SelectionScore::kDesignDeviation;
  const auto by_deviation = Select(logs, candidates, config);
  ASSERT_EQ(by_deviation.settings.size(), 2u);
  const SettingScore &agree = by_deviation.settings[0], &differ = by_deviation.settings[1];
  EXPECT_NEAR(agree.design_deviation, 0, 1e-6);
  // Modes 0.8 and 1.7 of a range of 1.8: deviation 0.25, the other two parameters none; mean over three.
  EXPECT_NEAR(differ.design_deviation, 0.25 / 3, 1e-6);
  EXPECT_DOUBLE_EQ(differ.learning_progress.value(), 2);
  const auto& of_seeds = by_deviation.candidates;
  EXPECT_DOUBLE_EQ(differ.common.value(), 0.5 * (of_seeds[2].common.value() + of_seeds[3].common.value()));
  EXPECT_DOUBLE_EQ(differ.c.value(), 0.5 * (of_seeds[2].c.value() + of_seeds[3].c.value()));
  EXPECT_EQ(by_deviation.settings[static_cast<size_t>(by_deviation.selected_setting)].setting, "agree")
      << "the lowest deviation wins";

  config.score = SelectionScore::kLearningProgress;
  const auto by_progress = Select(logs, candidates, config);
  EXPECT_EQ(by_progress.settings[static_cast<size_t>(by_progress.selected_setting)].setting, "differ")
      << "the highest progress wins";
  EXPECT_EQ(by_progress.best_candidate, 3) << "within a setting the nearer seed is best";
}

}  // namespace oted::simulator_selection_test
