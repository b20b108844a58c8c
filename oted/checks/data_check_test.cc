#include "oted/checks/data_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/log.h"
#include "oted/checks/data_record.h"
#include "oted/matching/judge.h"
#include "oted/matching/testing.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/testing.h"

namespace oted::data_check_test {

DataCheck Check(const Dataset& logs, const SimulatorFactory* factory, int n_threads = 1) {
  NullSink log;
  RunContext context;
  context.log = &log;
  context.n_threads = n_threads;
  return CheckData(logs, factory, 1, context);
}

const Finding* Find(const DataCheck& check, const std::string& name, const std::string& in_what = "") {
  for (const Finding& f : check.findings) {
    if (f.check == name && f.what.find(in_what) != std::string::npos) return &f;
  }
  return nullptr;
}

TEST(CheckData, LogsOfTheNominalSimulatorShowNoGapAndNoDefect) {
  const PointMassFactory factory;
  const DataCheck check = Check(PointMassLogs({1, 1, 0.5}, 20), &factory);
  EXPECT_EQ(CountOf(check.findings, Severity::kError), 0);
  ASSERT_TRUE(check.gap && check.one_step);
  EXPECT_EQ(check.Verdict(), GapVerdict::kNone);
  EXPECT_EQ(check.one_step->median_ratio, 0);
  EXPECT_NE(Find(check, "one_step_error")->meaning.find("nothing to design"), std::string::npos);
  // The third parameter has no effect, the others have.
  EXPECT_EQ(Find(check, "parameter_effect", "'idle'")->severity, Severity::kWarning);
  EXPECT_EQ(Find(check, "parameter_effect", "'gain'")->severity, Severity::kNote);
  EXPECT_EQ(CountOf(check.findings, Severity::kWarning), 1);
}

TEST(CheckData, AFarTargetIsAClearGap) {
  const PointMassFactory factory;
  const DataCheck check = Check(PointMassLogs({2, 0.2, 0.5}, 20), &factory);
  EXPECT_EQ(check.Verdict(), GapVerdict::kClear);
  EXPECT_NE(Find(check, "gap")->meaning.find("clear gap"), std::string::npos);
  EXPECT_NE(Find(check, "gap")->what.find("400 logged transitions"), std::string::npos);
}

TEST(CheckData, ASimulatorThatBreaksDownIsNoSimulatorWithoutAGap) {
  // At rest it holds out, so that some rows of the one episode can be replayed, and none of the other.
  const PointMassFactory factory({.diverge_beyond = 0});
  Dataset logs = PointMassLogs({1, 1, 0.5}, 2);
  const Episode first = logs.Episodes()[0];
  for (int i = first.begin; i < first.end; ++i) {
    logs.actions(i, 0) = 0;
    for (int k = 0; k < 2; ++k) logs.observations(i, k) = logs.next_observations(i, k) = 0;
  }
  const DataCheck check = Check(logs, &factory);
  EXPECT_FALSE(check.gap.has_value());
  ASSERT_NE(Find(check, "diverged_steps"), nullptr);
  const Finding* gap = Find(check, "gap", "broke down in every replay");
  ASSERT_NE(gap, nullptr);
  EXPECT_EQ(gap->severity, Severity::kWarning);
}

TEST(CheckData, ASingleTransitionIsToldAndNotJudged) {
  const PointMassFactory factory;
  const Dataset logs = PointMassLogs({1, 1, 0.5}, 1).Select({{0, 1, false}});
  const DataCheck check = Check(logs, &factory);
  EXPECT_FALSE(check.gap.has_value());
  EXPECT_NE(Find(check, "little_data"), nullptr);
  EXPECT_THROW(SplitForJudge(logs), DataError);
}

TEST(CheckData, ActionsThatAreARowLateAreFound) {
  Dataset logs = PointMassLogs({1, 1, 0.5}, 20);
  const Array2<double> own = logs.actions;
  for (const Episode& e : logs.Episodes()) {
    for (int i = e.begin; i + 1 < e.end; ++i) logs.actions(i, 0) = own(i + 1, 0);
  }
  const PointMassFactory factory;
  const DataCheck check = Check(logs, &factory);
  ASSERT_NE(Find(check, "shifted_actions"), nullptr);
  EXPECT_NE(Find(check, "shifted_actions")->what.find("1 row(s) before"), std::string::npos);
}

TEST(FindCorrections, ActionsWithTheStateThatTheyLedToAreFoundAndThoseThatActLateAreLeftToTheDesign) {
  const PointMassFactory factory;
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 1};
  for (const int by : {-1, 1}) {
    Dataset logs = PointMassLogs({1, 1, 0.5}, 20);
    const Array2<double> own = logs.actions;
    for (const Episode& e : logs.Episodes()) {
      for (int i = std::max(e.begin, e.begin - by); i < std::min(e.end, e.end - by); ++i)
        logs.actions(i, 0) = own(i + by, 0);
    }
    const std::vector<Finding> found = FindCorrections(factory, logs, context);
    const bool is_found = std::ranges::count(found, "shifted_actions", &Finding::check) == 1;
    EXPECT_EQ(is_found, by < 0) << "a delay is a parameter";
    for (const Finding& finding : found) EXPECT_FALSE(finding.may_be_parameter) << finding.what;
  }
}

TEST(CheckData, AStepThatNoiseHidesIsNoWarningAndOneOfAnotherModelIs) {
  Dataset noisy = PointMassLogs({1, 1, 0.5}, 20);
  Rng rng(4);
  for (Array2<double> Dataset::*readings : {&Dataset::observations, &Dataset::next_observations}) {
    for (int i = 0; i < noisy.size(); ++i) {
      for (int j = 0; j < 2; ++j) (noisy.*readings)(i, j) += rng.Normal();
    }
  }
  const PointMassFactory factory;
  const DataCheck hidden = Check(noisy, &factory);
  EXPECT_GT(hidden.one_step->median_ratio, 0.5);
  EXPECT_EQ(Find(hidden, "one_step_error")->severity, Severity::kNote);

  // A spring that the model lacks: a linear fit knows it.
  Dataset sprung;
  for (int e = 0; e < 20; ++e) {
    double x = rng.Uniform(-1, 1), v = 0;
    for (int t = 0; t < 20; ++t) {
      const double action = 0.1 * rng.Uniform(-1, 1);
      sprung.observations.AppendRow(std::vector<double>{x, v});
      sprung.actions.AppendRow(std::vector<double>{action});
      v += action - 0.5 * x;
      x += 0.1 * v;
      sprung.next_observations.AppendRow(std::vector<double>{x, v});
      sprung.terminals.push_back(0);
      sprung.timeouts.push_back(t == 19);
    }
  }
  EXPECT_EQ(Find(Check(sprung, &factory), "one_step_error")->severity, Severity::kWarning);
}

TEST(CheckData, ADelayAmongTheParametersTakesActionsThatActLate) {
  Dataset logs = PointMassLogs({1, 1, 0.5}, 20);
  const Array2<double> own = logs.actions;
  for (const Episode& e : logs.Episodes()) {
    for (int i = e.begin; i + 1 < e.end; ++i) logs.actions(i, 0) = own(i + 1, 0);
  }
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.push_back({.name = "late", .field = "action/delay", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute});
  const auto factory = WithChannels(specs, [](const auto&) { return std::make_unique<PointMassFactory>(); });
  const DataCheck check = Check(logs, factory.get());
  ASSERT_NE(Find(check, "shifted_actions"), nullptr);
  EXPECT_EQ(Find(check, "shifted_actions")->severity, Severity::kNote);
  EXPECT_NE(Find(check, "shifted_actions")->remedy.find("'late' takes it"), std::string::npos);
}

TEST(CheckData, TerminalsThatTheRuleDoesNotExplainAreFound) {
  PointMassOptions options;
  options.terminate_beyond = 5;
  Dataset logs = PointMassLogs({1, 1, 0.5}, 20, options);
  logs.terminals[39] = 1;
  logs.timeouts[39] = 0;
  const PointMassFactory factory(options);
  const DataCheck check = Check(logs, &factory);
  ASSERT_NE(Find(check, "unexplained_terminals"), nullptr);
  EXPECT_EQ(Find(check, "unexplained_terminals")->row, 39);
}

TEST(CheckData, DataOfAnotherTaskAreAnErrorAndNoCrash) {
  Dataset logs = PointMassLogs({1, 1, 0.5}, 3);
  logs.actions = Array2<double>(logs.size(), 2);
  const PointMassFactory factory;
  const DataCheck check = Check(logs, &factory);
  EXPECT_EQ(Find(check, "wrong_dimensions")->severity, Severity::kError);
  EXPECT_FALSE(check.gap);
  logs.observations(0, 0) = NAN;
  EXPECT_EQ(Check(logs, &factory).findings.at(0).check, "not_finite");
}

TEST(CheckData, ASimulatorWithoutSettableStatesIsJudgedWithAClone) {
  PointMassOptions options;
  options.can_set_state = false;
  const PointMassFactory factory(options);
  const DataCheck check = Check(PointMassLogs({2, 0.2, 0.5}, 10, options), &factory);
  EXPECT_FALSE(check.one_step);
  ASSERT_TRUE(check.gap);
  EXPECT_GT(check.gap->auc, 0.6);
  EXPECT_EQ(check.Verdict(), GapVerdict::kUnknown) << "the clone's errors tell as well";
}

TEST(CheckData, TheRecordIsTheSameAtAnyNumberOfThreads) {
  const PointMassFactory factory;
  const Dataset logs = PointMassLogs({1.4, 0.8, 0.5}, 10);
  const auto record = [&](int threads) {
    return DataCheckRecord(logs, &factory.spec(), Check(logs, &factory, threads)).dump();
  };
  EXPECT_EQ(record(1), record(3));
}

TEST(CheckData, TheRecordNamesEpisodesFromOne) {
  Dataset logs = PointMassLogs({1, 1, 0.5}, 3);
  logs.observations(25, 0) = NAN;
  const auto record = DataCheckRecord(logs, nullptr, Check(logs, nullptr));
  EXPECT_EQ(record["schema"], "oted.data_check/1");
  EXPECT_EQ(record["errors"], 1);
  EXPECT_EQ(record["findings"][0]["row"], 25);
  EXPECT_EQ(record["findings"][0]["episode"], 2);
  EXPECT_TRUE(record["gap"].is_null());
}

TEST(Losses, AreWhatReadingBackDoesNotGive) {
  Dataset full = PointMassLogs({1, 1, 0.5}, 3);
  full.rewards.assign(static_cast<size_t>(full.size()), 1.0);
  full.qpos = full.qvel = Array2<double>(full.size(), 1, 0.5);
  EXPECT_TRUE(Losses(full, full).empty());
  Dataset bare = full;
  bare.rewards.clear();
  bare.qpos = bare.qvel = {};
  bare.actions(3, 0) += 0.25;
  bare.timeouts[5] = 1;
  const std::vector<std::string> losses = Losses(full, bare);
  ASSERT_EQ(losses.size(), 4u);
  EXPECT_EQ(losses[0], "rewards");
  EXPECT_EQ(losses[1], "infos/qpos and infos/qvel");
  EXPECT_NE(losses[2].find("timeouts"), std::string::npos);
  EXPECT_EQ(losses[3], "actions: 1 numbers were rounded, by 0.25 at most");
}

}  // namespace oted::data_check_test
