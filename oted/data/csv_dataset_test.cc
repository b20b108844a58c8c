#include "oted/data/csv_dataset.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/rng.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/testing.h"

namespace oted::csv_dataset_test {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class CsvDataset : public testing::Test {
 protected:
  Dataset Read(const std::string& text, const DataOptions& options = {}) {
    WriteFileAtomically(folder_ / "log.csv", text);
    return ReadDataset(folder_ / "log.csv", options);
  }
  std::string Failure(const std::string& text, const DataOptions& options = {}) {
    return MessageOf<DataError>([&] { Read(text, options); });
  }
  TestFolder folder_;
};

TEST_F(CsvDataset, NextObservationsAreTheNextRowsAndTheLastRowIsDropped) {
  const Dataset d = Read("obs_x,obs_y,act_u\n0,10,0.5\n1,11,0.25\n2,12,9\n");
  ASSERT_EQ(d.size(), 2);
  EXPECT_THAT(d.observations.values(), ElementsAre(0, 10, 1, 11));
  EXPECT_THAT(d.next_observations.values(), ElementsAre(1, 11, 2, 12));
  EXPECT_THAT(d.actions.values(), ElementsAre(0.5, 0.25));
  EXPECT_THAT(d.timeouts, ElementsAre(0, 1));
  EXPECT_THAT(d.terminals, ElementsAre(0, 0));
  EXPECT_TRUE(d.rewards.empty());
  EXPECT_EQ(d.period_s, 0);
  EXPECT_THAT(d.remarks, Contains(HasSubstr("the last row of 1 episodes was dropped with its action")));
}

TEST_F(CsvDataset, ALastRowWithoutActionsKeepsTheTerminalState) {
  // The flag may stand with the action that ended the episode or with the state that it led to.
  for (const char* rows : {"0,1,0\n1,2,1\n2,,\n", "0,1,0\n1,2,0\n2,,1\n"}) {
    const Dataset d = Read(std::string("obs0,act0,terminal\n") + rows);
    EXPECT_THAT(d.terminals, ElementsAre(0, 1)) << rows;
    EXPECT_THAT(d.timeouts, ElementsAre(0, 0)) << rows;
    EXPECT_THAT(d.next_observations.values(), ElementsAre(1, 2)) << rows;
    EXPECT_TRUE(d.remarks.empty()) << rows;
  }
  const Dataset lost = Read("obs0,act0,terminal\n0,1,0\n1,2,0\n2,3,1\n");
  EXPECT_THAT(lost.timeouts, ElementsAre(0, 1));
  EXPECT_THAT(lost.warnings, Contains(HasSubstr("to keep a terminal state")));
}

TEST_F(CsvDataset, EpisodesEndAtNumbersFlagsAndJumpsOfTime) {
  const auto sizes = [](const Dataset& d) {
    std::vector<int> s;
    for (const Episode& e : d.Episodes()) s.push_back(e.size());
    return s;
  };
  EXPECT_THAT(sizes(Read("episode,obs0,act0\na,0,0\na,1,0\nb,2,0\nb,3,0\nb,4,0\n")), ElementsAre(1, 2));
  EXPECT_THAT(sizes(Read("obs0,act0,timeout\n0,0,0\n1,0,1\n2,0,0\n3,0,0\n4,0,False\n")), ElementsAre(1, 2));
  EXPECT_THAT(sizes(Read("t,obs0,act0\n0,0,0\n0.1,1,0\n0.2,2,0\n0,3,0\n0.1,4,0\n")), ElementsAre(2, 1));
  const Dataset gap = Read("t,obs0,act0\n0,0,0\n0.1,1,0\n0.2,2,0\n0.7,3,0\n0.8,4,0\n");
  EXPECT_THAT(sizes(gap), ElementsAre(2, 1));
  EXPECT_NEAR(gap.period_s, 0.1, 1e-12);
  EXPECT_THAT(gap.warnings, Contains(HasSubstr("1 gaps of more than 2 missing rows")));
}

TEST_F(CsvDataset, ColumnsAreFoundByConventionListsAndTheTasksNames) {
  const std::string text = "Time,q,observation.dq,Action[0],noise,Reward\n0,1,2,3,4,5\n1,6,7,8,9,10\n2,11,12,,14,0\n";
  const Dataset by_prefix = Read(text);
  EXPECT_THAT(by_prefix.observation_names, ElementsAre("dq"));
  EXPECT_THAT(by_prefix.action_names, ElementsAre("Action[0]"));
  EXPECT_THAT(by_prefix.rewards, ElementsAre(5, 10));
  EXPECT_EQ(by_prefix.period_s, 1);
  EXPECT_THAT(by_prefix.remarks, Contains("columns not used: q, noise"));
  DataOptions lists;
  lists.columns.observations = {"noise", "q"};
  lists.columns.actions = {"observation.dq"};
  const Dataset listed = Read(text, lists);
  EXPECT_THAT(listed.observations.row(0), ElementsAre(4, 1));
  EXPECT_THAT(listed.actions.values(), ElementsAre(2, 7));
  DataOptions task;
  task.observation_names = {"q", "noise"};
  EXPECT_THAT(Read(text, task).observations.row(0), ElementsAre(1, 4));
}

TEST_F(CsvDataset, NamedColumnsComeInTheTasksOrderOrAreAnError) {
  DataOptions task;
  task.observation_names = {"joint/a/qpos", "joint/b/qpos"};
  task.action_names = {"m1", "m2"};
  const std::string header = "obs.joint/b/qpos,obs.joint/a/qpos,obs.extra,act.m2,act.m1\n";
  const Dataset d = Read(header + "1,2,3,4,5\n6,7,8,9,10\n", task);
  EXPECT_THAT(d.observations.values(), ElementsAre(2, 1));
  EXPECT_THAT(d.next_observations.values(), ElementsAre(7, 6));
  EXPECT_THAT(d.actions.values(), ElementsAre(5, 4));
  EXPECT_EQ(d.observation_names, task.observation_names);
  EXPECT_THAT(Failure("obs.joint/b/qpos,obs.other,act.m2,act.m1\n1,2,3,4\n5,6,7,8\n", task),
              AllOf(HasSubstr("log.csv"), HasSubstr("joint/a/qpos"), HasSubstr("other")));
  EXPECT_THAT(Failure("joint/a/qpos,joint/c/qpos,m1,m2\n1,2,3,4\n5,6,7,8\n", task),
              AllOf(HasSubstr("none 'joint/b/qpos'"), HasSubstr("did you mean 'joint/c/qpos'")));
  // Names that mean nothing to the task are places.
  EXPECT_THAT(Read("obs_0,obs_1,act_0,act_1\n1,2,3,4\n5,6,7,8\n", task).observations.values(), ElementsAre(1, 2));
}

TEST_F(CsvDataset, DefectsNameFileLineAndColumn) {
  EXPECT_THAT(Failure("obs0,act0\n0,1\nx,2\n3,4\n"), AllOf(HasSubstr("log.csv' line 3, column 'obs0': 'x'")));
  EXPECT_THAT(Failure("obs0,act0\n0,1\nnan,2\n"), HasSubstr("no finite number"));
  EXPECT_THAT(Failure("obs0,act0\n0,1\n1e999,2\n"), HasSubstr("no finite number"));
  EXPECT_THAT(Failure("obs0,act0\n0,1\n1\n"), HasSubstr("line 3: 1 fields, but the header has 2"));
  EXPECT_THAT(Failure("obs0,act0,act1\n0,1,2\n1,,2\n"), HasSubstr("line 3, column 'act0': ''"));
  EXPECT_THAT(Failure("obs0,act0,terminal\n0,1,2\n"), HasSubstr("column 'terminal': '2' is no flag"));
  EXPECT_THAT(Failure("obs.\xFF,act0\n0,1\n1,2\n"), HasSubstr("not UTF-8"));
  EXPECT_THAT(Failure("obs0;act0\n0;1\n"), HasSubstr("semicolons"));
  EXPECT_THAT(Failure("obs0\tact0\n0\t1\n"), HasSubstr("tabs"));
  EXPECT_THAT(Failure("obs0,act0\n0,1\n-1e101,2\n"), HasSubstr("line 3, column 'obs0': '-1e101'"));
  EXPECT_THAT(Failure("obs0,act0\n0,1\n\"1,5\",2\n"), HasSubstr("line 3, column 'obs0': '1,5'"));
  EXPECT_THAT(Failure("obs0,act0\n"), HasSubstr("a header and no rows"));
  EXPECT_THAT(Failure("q,act0\n0,1\n"), AllOf(HasSubstr("no column of observations"), HasSubstr("'q', 'act0'")));
  EXPECT_THAT(Failure("obs0,obs0,act0\n"), HasSubstr("stands there twice"));
  EXPECT_THAT(Failure(""), HasSubstr("is empty"));
  EXPECT_THAT(Failure("obs0,act0\n0,1\n"), HasSubstr("holds no transition"));
  EXPECT_THAT(Failure("obs0,act0\n0,\n1,\n2,\n"), HasSubstr("none of its 3 rows has an action"));
  EXPECT_THAT(Failure("episode,obs0,act0\n1,0,0\n1,1,0\n2,0,0\n2,1,0\n1,2,0\n"),
              HasSubstr("line 6: episode 1 begins a second"));
  EXPECT_THAT(Failure("episode,t,obs0,act0\n1,0,0,0\n1,1,1,0\n1,2,2,0\n1,1,3,0\n"),
              HasSubstr("line 5: time goes back from 2 to 1 s within episode 1"));
  EXPECT_THAT(Failure("t,obs0,act0\n2,0,0\n1,1,0\n0,2,0\n"), HasSubstr("line 3: time goes back from 2 to 1 s, and so"));
  EXPECT_THAT(Failure("t,obs0,act0\n0,0,0\n1,1,0\n1,2,0\n"), HasSubstr("line 4: time 1 stands there twice"));
  EXPECT_THAT(Failure("episode,obs0,act0,terminal\n1,0,0,1\n1,1,0,0\n"), HasSubstr("line 3: episode 1 goes on after"));
  DataOptions options;
  options.columns.actions = {"act1"};
  EXPECT_THAT(Failure("obs0,act0\n0,1\n", options), AllOf(HasSubstr("data.actions"), HasSubstr("did you mean 'act0'")));
}

/// A robot whose joint moves as sin(t) and whose command steps at each row: time of row k is `time(k)`.
template <class Time>
std::string SineLog(int n_rows, const Time& time, int first = 0) {
  std::string text = "episode,t,obs0,act0\n";
  for (int k = first; k < n_rows; ++k) {
    if (const double t = time(k); t >= 0) text += fmt::format("1,{},{},{}\n", t, std::sin(t), k);
  }
  return text;
}

TEST_F(CsvDataset, JitteredRowsAreMadeEvenAndKeepTheirActions) {
  Rng rng = RngKey(1).MakeRng();
  const Dataset d = Read(SineLog(500, [&](int k) { return 0.005 * k + 0.0015 * (k > 0 ? rng.Uniform(-1, 1) : 0); }));
  ASSERT_NEAR(d.size(), 499, 1);
  for (int k = 0; k < d.size(); ++k) {
    EXPECT_NEAR(d.observations(k, 0), std::sin(d.period_s * k), 1e-4) << k;
    EXPECT_EQ(d.actions(k, 0), k);
  }
  EXPECT_NEAR(d.period_s, 0.005, 1e-4);
  EXPECT_THAT(d.remarks, Contains(HasSubstr("rows made even")));
}

TEST_F(CsvDataset, MissingRowsAreFilledInAndLongGapsCut) {
  const auto without = [](int first, int last) {
    return [=](int k) { return k >= first && k <= last ? -1 : 0.01 * k; };
  };
  const Dataset filled = Read(SineLog(100, without(40, 41)));
  ASSERT_EQ(filled.size(), 99);
  EXPECT_EQ(filled.Episodes().size(), 1u);
  EXPECT_NEAR(filled.observations(40, 0), std::sin(0.4), 1e-4);
  EXPECT_EQ(filled.actions(41, 0), 39) << "held";
  EXPECT_EQ(filled.observations(70, 0), std::sin(0.01 * 70)) << "as it was logged";
  EXPECT_THAT(filled.warnings, Contains(HasSubstr("2 missing rows filled in")));
  const Dataset cut = Read(SineLog(100, without(40, 49)));
  ASSERT_EQ(cut.Episodes().size(), 2u);
  EXPECT_EQ(cut.size(), 39 + 49);
  EXPECT_THAT(cut.warnings, Contains(HasSubstr("1 gaps of more than 2 missing rows")));
}

TEST_F(CsvDataset, TimesInMillisecondsAreEvenAndARepeatedRowIsLeftOut) {
  const Dataset rounded = Read(SineLog(300, [](int k) { return std::round(1000 * k / 300.0) / 1000; }));
  EXPECT_EQ(rounded.size(), 299);
  EXPECT_EQ(rounded.actions(123, 0), 123);
  for (const std::string& remark : rounded.remarks) EXPECT_THAT(remark, Not(HasSubstr("made even")));
  const Dataset twice = Read(SineLog(300, [](int k) { return 0.01 * (k > 200 ? k - 1 : k); }));
  EXPECT_EQ(twice.size(), 298);
  EXPECT_THAT(twice.warnings, Contains(HasSubstr("1 rows whose time stood there already")));
}

TEST_F(CsvDataset, RecordingsOfDifferentRatesShareTheControlPeriod) {
  DataOptions options;
  options.control_period_s = 0.02;
  std::string text = "episode,t,obs0,act0\n";
  for (int k = 0; k <= 400; ++k) text += fmt::format("fast,{},{},{}\n", 0.005 * k, std::sin(0.005 * k), k / 4);
  for (int k = 0; k <= 100; ++k) text += fmt::format("slow,{},{},{}\n", 0.02 * k, std::sin(0.02 * k), k);
  const Dataset d = Read(text, options);
  ASSERT_EQ(d.Episodes().size(), 2u);
  for (const Episode& episode : d.Episodes()) {
    EXPECT_EQ(episode.size(), 100);
    EXPECT_NEAR(d.observations(episode.begin + 50, 0), std::sin(1.0), 1e-12);
    EXPECT_EQ(d.actions(episode.begin + 50, 0), 50);
  }
  EXPECT_THAT(d.remarks, Contains(HasSubstr("1 of 2 episodes resampled")));
  options.control_period_s = 0.005;
  EXPECT_THAT(Failure(text, options), HasSubstr("one row per 0.02 s"));
}

TEST_F(CsvDataset, GivesBackWhatWasWritten) {
  for (const char* name : {"a.csv", "a.csv.gz"}) {
    for (const bool all : {true, false}) {
      Dataset dataset = MakeTestDataset(45, 10, all, all);
      dataset.timeouts.back() = 1;
      dataset.observations(0, 0) = 1e-300;
      if (all) dataset.observation_names = {"a,b", "\"c\"", "joint/d"};
      if (all) dataset.action_names = {"u", "v"};
      if (all) dataset.period_s = 0.008;
      WriteDataset(dataset, folder_ / name);
      const Dataset read = ReadDataset(folder_ / name);
      EXPECT_TRUE(SameTransitions(read, dataset)) << name;
      EXPECT_NEAR(read.period_s, dataset.period_s, 1e-12);
      EXPECT_EQ(all ? read.observation_names : dataset.observation_names, dataset.observation_names);
      EXPECT_TRUE(read.remarks.empty()) << read.remarks[0];
    }
  }
  Dataset broken = MakeTestDataset(20, 10);
  broken.next_observations(3, 0) += 1;
  EXPECT_THAT(MessageOf<DataError>([&] { WriteDataset(broken, folder_ / "b.csv"); }),
              AllOf(HasSubstr("b.csv"), HasSubstr("next_observations[3]")));
}

TEST_F(CsvDataset, PythonReadsWhatWeWriteAndWritesWhatWeRead) {
  WriteDataset(MakeTestDataset(20, 10), folder_ / "ours.csv.gz");
  ASSERT_TRUE(RunPython(R"(
import csv, gzip
rows = list(csv.DictReader(gzip.open('ours.csv.gz', 'rt')))
assert len(rows) == 22 and float(rows[3]['obs.1']) == 0.1 * 3 + 1, rows[3]
assert rows[10]['act.0'] == '' and float(rows[10]['obs.0']) == 0.1 * 10
with open('theirs.csv', 'w', newline='') as f:
    w = csv.DictWriter(f, rows[0].keys(), quoting=csv.QUOTE_ALL)
    w.writeheader()
    w.writerows(rows)
)",
                        folder_));
  EXPECT_TRUE(SameTransitions(ReadDataset(folder_ / "theirs.csv"), MakeTestDataset(20, 10)));
}

TEST_F(CsvDataset, DelayedActionsMoveWithinTheirEpisode) {
  const std::string text =
      "episode,obs0,act0\n1,0,10\n1,1,11\n1,2,12\n1,3,\n2,4,14\n2,5,15\n2,6,16\n2,7,\n3,8,18\n3,9,\n";
  DataOptions options;
  options.action_delay = 1;
  const Dataset d = Read(text, options);
  EXPECT_THAT(d.observations.values(), ElementsAre(1, 2, 5, 6));
  EXPECT_THAT(d.actions.values(), ElementsAre(10, 11, 14, 15));
  EXPECT_THAT(d.timeouts, ElementsAre(0, 1, 0, 1));
  EXPECT_THAT(d.remarks, Contains(HasSubstr("1 shorter ones are gone")));
  options.action_delay = 3;
  EXPECT_THAT(Failure(text, options), HasSubstr("data.action_delay (3 control steps)"));
}

}  // namespace oted::csv_dataset_test
