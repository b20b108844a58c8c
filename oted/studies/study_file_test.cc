#include "oted/studies/study_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/base/testing.h"

namespace oted::study_file_test {

using nlohmann::json;
using testing::HasSubstr;

TEST(StudyFile, IsBesideTheFolderOfItsRuns) {
  EXPECT_EQ(StudyFile("runs/table1").path(), "runs/table1.jsonl");
  EXPECT_EQ(StudyFile("runs/table1/").path(), "runs/table1.jsonl");
  EXPECT_EQ(StudyFile("runs/a.b").path(), "runs/a.b.jsonl");
}

TEST(StudyFile, HasALineForEachCellInTheOrderOfTheirNames) {
  const TestFolder folder;
  const StudyFile file(folder / "new/study");
  EXPECT_TRUE(file.Find("b").is_null());
  file.Put("b", {{"score", 2}});
  file.Put("a", {{"score", 1}});
  file.Put("b", {{"score", 3}});
  EXPECT_EQ(ReadFile(file.path()), "{\"cell\":\"a\",\"score\":1}\n{\"cell\":\"b\",\"score\":3}\n");
  EXPECT_EQ(StudyFile(folder / "new/study").Find("b"), (json{{"score", 3}}));
  EXPECT_TRUE(file.Find("c").is_null());
}

TEST(StudyFile, WhatSeveralAddAtOnceAllStays) {
  const TestFolder folder;
  ParallelFor(40, 4, [&](int i) { StudyFile(folder / "study").Put(std::to_string(i), {{"score", i}}); });
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(StudyFile(folder / "study").Find(std::to_string(i)), (json{{"score", i}}));
  }
}

TEST(StudyFile, ADamagedLineIsNamed) {
  const TestFolder folder;
  WriteFileAtomically(folder / "study.jsonl", "{\"cell\":\"a\"}\n{\"cell\":\n");
  EXPECT_THAT(MessageOf<DataError>([&] { StudyFile(folder / "study").Find("a"); }), HasSubstr("study.jsonl' line 2"));
  EXPECT_THROW(StudyFile(folder / "study").Put("b", {{"score", 1}}), DataError);
}

}  // namespace oted::study_file_test
