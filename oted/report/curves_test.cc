#include "oted/report/curves.h"

#include <gmock/gmock.h>

#include <limits>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::curves_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

TEST(CurvesTest, ReadsBackExactlyWhatWasWritten) {
  TestFolder folder;
  const double value = 0.1 + 0.2;
  const double infinity = std::numeric_limits<double>::infinity();
  CurvesWriter(folder / "curves.csv").Append(7, "design/reward", value);
  EXPECT_EQ(ReadFile(folder / "curves.csv"), "step,key,value\n7,design/reward,0.30000000000000004\n");
  CurvesWriter(folder / "curves.csv").Append(8, "design/reward", -infinity);
  const Curves curves = ReadCurves(folder / "curves.csv");
  EXPECT_THAT(curves.At("design/reward"), ElementsAre(Pair(7, value), Pair(8, -infinity)));
  EXPECT_TRUE(curves.At("another").empty());
}

TEST(CurvesTest, AUnitThatWentOnFromACheckpointLeavesTheFileOfOneThatDidNotStop) {
  TestFolder folder;
  const auto append = [](CurvesWriter& writer, int begin, int end) {
    for (int step = begin; step < end; ++step) {
      writer.Append(step, "a", step);
      if (step % 2 == 0) writer.Append(step, "b", 10 * step);
    }
  };
  CurvesWriter whole(folder / "whole/curves.csv");
  append(whole, 0, 8);
  {
    CurvesWriter before(folder / "curves.csv");
    append(before, 0, 6);
  }
  CurvesWriter after(folder / "curves.csv");
  append(after, 3, 8);
  EXPECT_EQ(ReadFile(folder / "curves.csv"), ReadFile(folder / "whole/curves.csv"));
}

TEST(CurvesTest, AnEarlierVersionsRepeatedStepsCountOnce) {
  TestFolder folder;
  WriteFileAtomically(folder / "curves.csv", "step,key,value\n1,a,1\n2,a,2\n2,a,20\n3,a,3\n");
  EXPECT_THAT(ReadCurves(folder / "curves.csv").At("a"), ElementsAre(Pair(1, 1), Pair(2, 20), Pair(3, 3)));
}

TEST(CurvesTest, ARowThatWasWrittenButNotMarkedIsWrittenAgain) {
  TestFolder folder;
  CurvesWriter(folder / "curves.csv").Append(1, "a", 2);
  const std::string mark = ReadFile(folder / "checkpoint.curves");
  CurvesWriter(folder / "curves.csv").Append(2, "a", 3);
  WriteFileAtomically(folder / "checkpoint.curves", mark);  // killed between the two
  EXPECT_EQ(ReadCurves(folder / "curves.csv").At("a").size(), 2u);
  CurvesWriter(folder / "curves.csv").Append(2, "a", 3);
  EXPECT_EQ(ReadFile(folder / "curves.csv"), "step,key,value\n1,a,2\n2,a,3\n");
}

TEST(CurvesTest, AFileThatIsNotWholeIsSetAsideAndNotShown) {
  for (const auto& [name, damage] :
       {std::pair{"a digit", "step,key,value\n1,a,3\n"}, {"cut short", "step,key,value\n"}}) {
    TestFolder folder;
    CurvesWriter(folder / "curves.csv").Append(1, "a", 2);
    WriteFileAtomically(folder / "curves.csv", damage);
    EXPECT_THAT(MessageOf<DataError>([&] { ReadCurves(folder / "curves.csv"); }), HasSubstr("is damaged")) << name;
    CurvesWriter writer(folder / "curves.csv");
    EXPECT_TRUE(writer.set_aside()) << name;
    writer.Append(2, "a", 5);
    EXPECT_EQ(ReadFile(folder / "curves.csv"), "step,key,value\n2,a,5\n") << name;
    EXPECT_EQ(ReadFile(folder / "curves.csv.damaged"), damage) << name;
  }
}

TEST(CurvesTest, ARowCutOffByAnInterruptionIsLeftOutAndThenRemoved) {
  TestFolder folder;
  WriteFileAtomically(folder / "curves.csv", "step,key,value\n1,a,2\n2,a,3.14");
  EXPECT_THAT(ReadCurves(folder / "curves.csv").At("a"), ElementsAre(Pair(1, 2)));
  CurvesWriter(folder / "curves.csv").Append(2, "a", 5);
  EXPECT_EQ(ReadFile(folder / "curves.csv"), "step,key,value\n1,a,2\n2,a,5\n");
}

TEST(CurvesTest, AFileCutOffInItsHeaderStartsAnew) {
  TestFolder folder;
  WriteFileAtomically(folder / "curves.csv", "step,k");
  CurvesWriter(folder / "curves.csv").Append(2, "a", 5);
  EXPECT_EQ(ReadFile(folder / "curves.csv"), "step,key,value\n2,a,5\n");
}

TEST(CurvesTest, AKeyMayHoldCommasAndQuotesAndPythonReadsItToo) {
  TestFolder folder;
  const std::string key = "design/mode/a,\"b\"";
  CurvesWriter(folder / "curves.csv").Append(3, key, 1.5);
  EXPECT_THAT(ReadCurves(folder / "curves.csv").At(key), ElementsAre(Pair(3, 1.5)));
  EXPECT_TRUE(
      RunPython("import csv\n"
                "rows = list(csv.reader(open('curves.csv')))\n"
                "assert rows == [['step', 'key', 'value'], ['3', 'design/mode/a,\"b\"', '1.5']], rows\n",
                folder));
}

TEST(CurvesTest, AForeignFileIsRefusedAndLeftAlone) {
  TestFolder folder;
  WriteFileAtomically(folder / "curves.csv", "time,reward\n1,2\n");
  EXPECT_THAT(MessageOf<DataError>([&] { ReadCurves(folder / "curves.csv"); }), HasSubstr("step,key,value"));
  EXPECT_THAT(MessageOf<DataError>([&] { CurvesWriter writer(folder / "curves.csv"); }), HasSubstr("step,key,value"));
  EXPECT_EQ(ReadFile(folder / "curves.csv"), "time,reward\n1,2\n");
}

TEST(CurvesTest, ADamagedRowIsNamedWithItsLine) {
  TestFolder folder;
  for (const char* row : {"1,a", "x,a,1", "1,a,1.5z", "1.5,a,1", ""}) {
    WriteFileAtomically(folder / "curves.csv", fmt::format("step,key,value\n1,a,2\n{}\n", row));
    EXPECT_THAT(MessageOf<DataError>([&] { ReadCurves(folder / "curves.csv"); }), HasSubstr("line 3")) << row;
  }
}

}  // namespace oted::curves_test
