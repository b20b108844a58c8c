#include "oted/report/file_sink.h"

#include <gmock/gmock.h>

#include <thread>
#include <vector>

#include "oted/base/testing.h"
#include "oted/report/curves.h"

namespace oted::file_sink_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

class Recorder : public NullSink {
 public:
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    heard.push_back(fmt::format("{}|{}|{}|{}|{}", stage, label, done, total, note));
  }
  void Warning(std::string_view message) override { heard.emplace_back(message); }
  std::vector<std::string> heard;
};

TEST(FileSinkTest, EachUnitGetsItsOwnCurvesAndTensorBoardShowsTheSame) {
  TestFolder folder;
  {
    FileSink sink(folder.path());
    for (int step = 0; step < 3; ++step) {
      sink.Scalar("design/paper/1", "design/reward", step, 0.25 * step);
      sink.Scalar("agents/1", "eval/mean_reward", step, -step);
    }
  }
  EXPECT_THAT(ReadCurves(folder.path() / "design/paper/1/curves.csv").At("design/reward"),
              ElementsAre(Pair(0, 0), Pair(1, 0.25), Pair(2, 0.5)));
  EXPECT_THAT(ReadCurves(folder.path() / "agents/1/curves.csv").by_key,
              ElementsAre(Pair("eval/mean_reward", ElementsAre(Pair(0, 0), Pair(1, -1), Pair(2, -2)))));
  EXPECT_TRUE(RunPython(R"(
import csv
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
for run in ['design/paper/1', 'agents/1']:
    accumulator = EventAccumulator(run)
    accumulator.Reload()
    seen = {(s.step, tag, s.value) for tag in accumulator.Tags()['scalars'] for s in accumulator.Scalars(tag)}
    rows = list(csv.DictReader(open(run + '/curves.csv')))
    assert len(rows) == 3
    assert seen == {(int(r['step']), r['key'], float(r['value'])) for r in rows}, (seen, rows)
)",
                        folder));
}

TEST(FileSinkTest, ScalarsFromManyThreadsAllArriveWhole) {
  TestFolder folder;
  constexpr int kThreads = 4;
  constexpr int kSteps = 300;
  {
    FileSink sink(folder.path());
    std::vector<std::jthread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&sink, t] {
        for (int step = 0; step < kSteps; ++step) {
          sink.Scalar("shared", fmt::format("key/{}", t), step, t + step);
          sink.Scalar(fmt::format("own/{}", t), "key", step, step);
        }
      });
    }
  }
  const Curves shared = ReadCurves(folder / "shared/curves.csv");
  ASSERT_EQ(shared.by_key.size(), size_t{kThreads});
  for (int t = 0; t < kThreads; ++t) {
    const Curve& curve = shared.At(fmt::format("key/{}", t));
    ASSERT_EQ(curve.size(), size_t{kSteps});
    for (int step = 0; step < kSteps; ++step)
      EXPECT_EQ(curve[static_cast<size_t>(step)], std::pair(int64_t{step}, double(t + step)));
    EXPECT_EQ(ReadCurves(folder / fmt::format("own/{}/curves.csv", t)).At("key").size(), size_t{kSteps});
  }
}

TEST(FileSinkTest, ASecondProcessGoesOnWhereTheFirstStopped) {
  TestFolder folder;
  FileSink(folder.path()).Scalar("clone", "clone/train_loss", 1, 3);
  FileSink(folder.path()).Scalar("clone", "clone/train_loss", 2, 2);
  EXPECT_THAT(ReadCurves(folder / "clone/curves.csv").At("clone/train_loss"), ElementsAre(Pair(1, 3), Pair(2, 2)));
}

TEST(FileSinkTest, OpenFilesDoNotGrowWithUnitsThatAreFinished) {
  TestFolder folder;
  const auto n_open = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator());
  };
  FileSink sink(folder.path());
  const auto before = n_open();
  for (int unit = 0; unit < 20; ++unit) {
    sink.Scalar(fmt::format("agents/{}", unit), "eval/mean_reward", 1, unit);
    sink.Finish(fmt::format("agents/{}", unit));
  }
  EXPECT_EQ(n_open(), before);
  EXPECT_THAT(ReadCurves(folder / "agents/7/curves.csv").At("eval/mean_reward"), ElementsAre(Pair(1, 7)));
}

TEST(FileSinkTest, CurvesOlderThanTheCheckpointAreSetAsideWithAWarning) {
  TestFolder folder;
  const std::filesystem::path unit = folder / "agents/1", old = folder / "old";
  const std::vector<std::string> files = {"curves.csv", "checkpoint.curves"};
  const auto write_two = [&] {
    FileSink sink(folder.path());
    EXPECT_EQ(sink.CurvesMark("agents/1"), "");
    sink.Scalar("agents/1", "eval/mean_reward", 1, 3);
    std::filesystem::create_directories(old);
    for (const std::string& name : files) {
      std::filesystem::copy_file(unit / name, old / name, std::filesystem::copy_options::overwrite_existing);
    }
    sink.Scalar("agents/1", "eval/mean_reward", 2, 4);
    return sink.CurvesMark("agents/1");
  };
  const auto go_on = [&](const std::string& mark) {
    Recorder recorder;
    FileSink sink(folder.path(), &recorder);
    sink.GoOn("agents/1", mark);
    sink.Scalar("agents/1", "eval/mean_reward", 3, 5);
    return recorder.heard;
  };
  const auto restore = [&](const std::string& name) {
    std::filesystem::copy_file(old / name, unit / name, std::filesystem::copy_options::overwrite_existing);
  };
  const auto curve = [&] { return ReadCurves(unit / "curves.csv").At("eval/mean_reward"); };
  const Curve whole = {{1, 3}, {2, 4}, {3, 5}};

  EXPECT_THAT(go_on(write_two()), IsEmpty()) << "what the checkpoint was written behind is there";
  EXPECT_EQ(curve(), whole);
  std::filesystem::remove_all(unit);
  const std::string mark = write_two();
  restore("checkpoint.curves");
  EXPECT_THAT(go_on(mark), IsEmpty()) << "an old mark alone loses no row";
  EXPECT_EQ(curve(), whole);
  for (const std::string& name : files) restore(name);
  EXPECT_THAT(go_on(mark), ElementsAre(HasSubstr("curves.csv.damaged")));
  EXPECT_THAT(curve(), ElementsAre(Pair(3, 5)));
  EXPECT_EQ(ReadFile(unit / "curves.csv.damaged"), ReadFile(old / "curves.csv"));
  std::filesystem::remove_all(unit);
  EXPECT_THAT(go_on(mark), ElementsAre(HasSubstr("curves.csv"))) << "none are there at all";
}

TEST(FileSinkTest, ProgressAndWarningsGoToTheInnerSink) {
  TestFolder folder;
  Recorder recorder;
  FileSink sink(folder.path(), &recorder);
  sink.Progress("design", "seed 1", 3, 50, "c 0.61");
  sink.Warning("look here");
  EXPECT_THAT(recorder.heard, ElementsAre("design|seed 1|3|50|c 0.61", "look here"));
  FileSink alone(folder.path());
  alone.Progress("design", "seed 1", 3, 50, "");
  alone.Warning("nobody hears");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "no scalar, no file";
}

}  // namespace oted::file_sink_test
