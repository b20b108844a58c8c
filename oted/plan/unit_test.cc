#include "oted/plan/unit.h"

#include <gmock/gmock.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/plan/collected.h"
#include "oted/plan/plan_state.h"
#include "oted/plan/testing.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

const UnitPlace kHere{"host", "cpu", "avx2"};

UnitTry WriteResult(const PlanLine& line, const fs::path& folder, const std::function<bool()>&) {
  WriteFileAtomically(folder / "result.jsonl", line.name);
  return Ends(0);
}

UnitTry MustNotRun(const PlanLine&, const fs::path&, const std::function<bool()>&) {
  ADD_FAILURE() << "it ran again";
  return Ends(0);
}

TEST(Unit, IsMadeOnce) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  const PlanLine line = CountedLine(1);
  EXPECT_EQ(MakeUnit(line, root, kHere, WriteResult).outcome, UnitOutcome::kDone);
  EXPECT_EQ(ReadFile(root.Result(line.Folder()) / "result.jsonl"), "unit 1");
  EXPECT_EQ(root.ReadDone(line.Folder()).key, line.key);
  EXPECT_EQ(MakeUnit(line, root, kHere, MustNotRun).outcome, UnitOutcome::kWasDone);
  EXPECT_TRUE(root.Begun().empty());
}

TEST(Unit, AWrongOneFailsWhenItIsWrongTwiceAndIsBegunAnewOnlyOnRequest) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  const PlanLine line = CountedLine(1);
  int n_runs = 0;
  const auto wrong = [&](const PlanLine&, const fs::path&, const std::function<bool()>&) {
    ++n_runs;
    return Ends(3, "the file is damaged");
  };
  EXPECT_EQ(MakeUnit(line, root, kHere, wrong).outcome, UnitOutcome::kFailed);
  EXPECT_EQ(n_runs, 2);
  EXPECT_EQ(MakeUnit(line, root, kHere, MustNotRun).outcome, UnitOutcome::kWasFailed);
  EXPECT_EQ(root.ReadFailed(line.Folder()).message, "the file is damaged");
  root.ForgetFailure(line.Folder());
  EXPECT_EQ(MakeUnit(line, root, kHere, WriteResult).outcome, UnitOutcome::kDone);
}

TEST(Unit, ADiskThatFailsOnceFailsNoUnit) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  const PlanLine line = CountedLine(1);
  int n_runs = 0;
  const auto once = [&](const PlanLine& of, const fs::path& to, const std::function<bool()>& beat) {
    return ++n_runs == 1 ? Ends(3, "cannot read the logs: Input/output error") : WriteResult(of, to, beat);
  };
  EXPECT_EQ(MakeUnit(line, root, kHere, once).outcome, UnitOutcome::kDone);
  EXPECT_TRUE(root.Failed().empty());
}

TEST(Unit, WorkFoldersThatADeadProcessLeftOfADoneOneGo) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  for (const int k : {1, 2}) {
    ASSERT_EQ(MakeUnit(CountedLine(k), root, kHere, WriteResult).outcome, UnitOutcome::kDone);
    fs::create_directories(folder.path() / "runs" / CountedLine(k).Folder() / "1");
    WriteFileAtomically(folder.path() / "runs" / CountedLine(k).Folder() / "1/owner.json",
                        R"({"owner": {"host": "", "pid": 0}})");
  }
  EXPECT_EQ(MakeUnit(CountedLine(1), root, kHere, MustNotRun).outcome, UnitOutcome::kWasDone);
  EXPECT_FALSE(fs::exists(folder.path() / "runs" / CountedLine(1).Folder()));
  EXPECT_TRUE(fs::exists(folder.path() / "runs" / CountedLine(2).Folder()));
  root.RemoveLeftovers();
  EXPECT_FALSE(fs::exists(folder.path() / "runs" / CountedLine(2).Folder()));
}

TEST(Unit, ABrokenOneIsTriedThreeTimesOverAllProcesses) {
  const TestFolder folder;
  const PlanLine line = CountedLine(1);
  int n_runs = 0;
  const auto crash = [&](const PlanLine&, const fs::path&, const std::function<bool()>&) {
    if (++n_runs == 2) return Ends(130);
    return Ends(139, "signal 11");
  };
  EXPECT_EQ(MakeUnit(line, WorkRoot(folder.path()), kHere, crash).outcome, UnitOutcome::kInterrupted);
  const UnitReport last = MakeUnit(line, WorkRoot(folder.path()), kHere, crash);
  EXPECT_EQ(last.outcome, UnitOutcome::kFailed);
  EXPECT_EQ(last.exit_code, 139);
  EXPECT_EQ(n_runs, 1 + kMostBreaks) << "the interruption counts for nothing";
}

TEST(Unit, AnInterruptedOneGoesOnWithWhatIsThere) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  const PlanLine line = CountedLine(1);
  const auto half = [](const PlanLine&, const fs::path& at, const std::function<bool()>&) {
    WriteFileAtomically(at / "result/half", "half");
    WriteFileAtomically(at / "result/.lock", "whoever");
    return Ends(130);
  };
  EXPECT_EQ(MakeUnit(line, root, kHere, half).outcome, UnitOutcome::kInterrupted);
  const auto rest = [](const PlanLine&, const fs::path& at, const std::function<bool()>&) {
    EXPECT_EQ(ReadFile(at / "result/half"), "half");
    EXPECT_FALSE(fs::exists(at / "result/.lock")) << "the lock of a process that is gone";
    return Ends(4);
  };
  EXPECT_EQ(MakeUnit(line, root, kHere, rest).outcome, UnitOutcome::kDone) << "4 is an answer";
  EXPECT_EQ(root.ReadDone(line.Folder()).attempts, 2);
}

TEST(Unit, OneThatAnotherKindOfProcessorBeganIsBegunAnew) {
  const TestFolder folder;
  const WorkRoot root(folder.path());
  const PlanLine line = CountedLine(1);
  const auto half = [](const PlanLine&, const fs::path& at, const std::function<bool()>&) {
    EXPECT_FALSE(fs::exists(at / "result/half"));
    WriteFileAtomically(at / "result/half", "half");
    WriteFileAtomically(at / "result.jsonl", "half");
    return Ends(130);
  };
  MakeUnit(line, root, kHere, half);
  MakeUnit(line, root, {"host2", "cpu", "avx512"}, half);
  const auto rest = [](const PlanLine&, const fs::path& at, const std::function<bool()>&) {
    EXPECT_TRUE(fs::exists(at / "result/half"));
    return Ends(0);
  };
  EXPECT_EQ(MakeUnit(line, root, {"host3", "cpu", "avx512"}, rest).outcome, UnitOutcome::kDone);
}

TEST(Unit, WithAnInputThatChangedFailsBeforeItRuns) {
  const TestFolder folder;
  WriteFileAtomically(folder / "data", "1");
  PlanLine line = CountedLine(1);
  line.inputs = {PlanInput::Of(folder / "data")};
  WriteFileAtomically(folder / "data", "2");
  const UnitReport report = MakeUnit(line, WorkRoot(folder.path() / "root"), kHere, MustNotRun);
  EXPECT_EQ(report.outcome, UnitOutcome::kFailed);
  EXPECT_THAT(report.message, HasSubstr("not what it was"));
}

TEST(Unit, OneThatAnotherMachineWorksOnIsLeftAloneUntilItIsSilent) {
  const TestFolder folder;
  const PlanLine line = CountedLine(1);
  const WorkRoot other(folder.path(), OwnerElsewhere(1));
  const auto dies = [&](const PlanLine& unit, const fs::path& at, const std::function<bool()>&) -> UnitTry {
    EXPECT_EQ(MakeUnit(unit, WorkRoot(folder.path(), OwnerElsewhere(2)), kHere, MustNotRun).outcome,
              UnitOutcome::kBusy);
    WriteFileAtomically(at / "result/half", "half");
    throw NodeDies();
  };
  EXPECT_THROW(MakeUnit(line, other, kHere, dies), NodeDies);
  EXPECT_EQ(MakeUnit(line, WorkRoot(folder.path()), kHere, MustNotRun).outcome, UnitOutcome::kBusy);
  const WorkRoot impatient(folder.path(), UnitOwner::Me(), std::chrono::seconds(0));
  EXPECT_EQ(MakeUnit(line, impatient, kHere, WriteResult).outcome, UnitOutcome::kDone);
  EXPECT_EQ(ReadFile(other.Result(line.Folder()) / "result/half"), "half");
}

TEST(Unit, OneWhoseProcessHereIsGoneIsGoneOnWithAtOnce) {
  const TestFolder folder;
  UnitOwner gone = UnitOwner::Me();
  EXPECT_FALSE(gone.IsGone());
  ++gone.started;
  EXPECT_TRUE(gone.IsGone()) << "another process has the number now";
  const PlanLine line = CountedLine(1);
  const auto dies = [](const PlanLine&, const fs::path&, const std::function<bool()>&) -> UnitTry { throw NodeDies(); };
  EXPECT_THROW(MakeUnit(line, WorkRoot(folder.path(), gone), kHere, dies), NodeDies);
  EXPECT_EQ(MakeUnit(line, WorkRoot(folder.path()), kHere, WriteResult).outcome, UnitOutcome::kDone);
}

TEST(Unit, AnOwnerThatWasThoughtDeadWritesNothingIntoTheResult) {
  const TestFolder folder;
  const PlanLine line = CountedLine(1);
  const WorkRoot impatient(folder.path(), OwnerElsewhere(2), std::chrono::seconds(0));
  const auto sleeper = [&](const PlanLine& unit, const fs::path& at, const std::function<bool()>& beat) {
    EXPECT_EQ(MakeUnit(unit, impatient, kHere, WriteResult).outcome, UnitOutcome::kDone);
    EXPECT_FALSE(beat());
    WriteFileAtomically(at / "result.jsonl", "late");
    return Ends(0);
  };
  EXPECT_EQ(MakeUnit(line, WorkRoot(folder.path(), OwnerElsewhere(1)), kHere, sleeper).outcome, UnitOutcome::kBusy);
  EXPECT_EQ(ReadFile(impatient.Result(line.Folder()) / "result.jsonl"), "unit 1");
}

TEST(PlanState, CountsWhatIsDoneFailedRunningStoppedAndMissing) {
  const TestFolder folder;
  const Plan plan = CountedPlan(5);
  const WorkRoot root(folder.path());
  const auto ends = [](int code) {
    return [code](const PlanLine&, const fs::path&, const std::function<bool()>&) { return Ends(code); };
  };
  MakeUnit(plan.lines[0], root, kHere, ends(0));
  MakeUnit(plan.lines[1], root, kHere, ends(2));
  MakeUnit(plan.lines[2], root, kHere, ends(130));
  const auto look = [&](const PlanLine&, const fs::path&, const std::function<bool()>&) {
    const PlanState state = StateOf(plan, root);
    EXPECT_THAT(state.units, ElementsAre(UnitState::kDone, UnitState::kFailed, UnitState::kStopped, UnitState::kRunning,
                                         UnitState::kMissing));
    EXPECT_THAT(state.Open(), ElementsAre(2, 4));
    EXPECT_EQ(state.SecondsLeft(), 2.5) << "two are open and one is half done, of a second each";
    return Ends(0);
  };
  MakeUnit(plan.lines[3], root, kHere, look);
  EXPECT_FALSE(StateOf(plan, root).SecondsLeft()) << "nothing runs";
}

TEST(Collected, RefusesWhatDoesNotBelongTogether) {
  const TestFolder folder;
  const Plan plan = CountedPlan(3);
  const WorkRoot root(folder.path());
  MakeUnit(plan.lines[0], root, kHere, WriteResult);
  MakeUnit(plan.lines[1], root, {"host2", "cpu", "avx512"}, WriteResult);
  EXPECT_THAT(MessageOf<DataError>([&] { Collect(plan, root, false); }),
              testing::AllOf(HasSubstr("avx2 on host"), HasSubstr("avx512 on host2")));
  const Collected mixed = Collect(plan, root, true);
  EXPECT_EQ(mixed.done.size(), 2u);
  ASSERT_EQ(mixed.missing.size(), 1u);
  EXPECT_EQ(mixed.missing[0].name, "unit 2");
  // Another unit's result in a unit's place, and a result that was edited.
  const fs::path first = root.Result(plan.lines[0].Folder());
  fs::copy(first, root.Result(plan.lines[2].Folder()), fs::copy_options::recursive);
  EXPECT_THAT(MessageOf<DataError>([&] { Collect(plan, root, true); }), HasSubstr("was wanted"));
  fs::remove_all(root.Result(plan.lines[2].Folder()));
  WriteFileAtomically(first / "result.jsonl", "edited");
  EXPECT_THAT(MessageOf<DataError>([&] { Collect(plan, root, true); }), HasSubstr("result.jsonl"));
}

}  // namespace
}  // namespace oted
