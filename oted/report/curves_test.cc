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

TEST(CurvesTest, AUnitThatWentOnFromACheckpointShowsEachStepOnce) {
  TestFolder folder;
  {
    CurvesWriter before(folder / "curves.csv");
    for (int step = 0; step < 6; ++step) before.Append(step, "a", step);
  }
  CurvesWriter after(folder / "curves.csv");
  for (int step = 4; step < 8; ++step) after.Append(step, "a", 10 * step);
  EXPECT_THAT(
      ReadCurves(folder / "curves.csv").At("a"),
      ElementsAre(Pair(0, 0), Pair(1, 1), Pair(2, 2), Pair(3, 3), Pair(4, 40), Pair(5, 50), Pair(6, 60), Pair(7, 70)));
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
