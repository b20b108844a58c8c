#include "oted/studies/cell_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::cell_record_test {

using nlohmann::json;
using testing::HasSubstr;

const json kIdentity = {{"task", "hopper"}, {"steps", 200}};

TEST(CellRecord, SeedsStandInOrderWhateverTheOrderInWhichTheyEnd) {
  const TestFolder folder;
  CellRecord record(kIdentity, "oted.test/1", StudyFile(folder / "study"), "hopper-bc", "a command");
  for (const int seed : {2, 10, 1}) record.Add(seed, {{"score", 10 * seed}});
  EXPECT_EQ(record.record().at("seeds"),
            (json{{{"seed", 1}, {"score", 10}}, {{"seed", 2}, {"score", 20}}, {{"seed", 10}, {"score", 100}}}));
  EXPECT_TRUE(record.Has(10));
  EXPECT_FALSE(record.Has(3));
}

TEST(CellRecord, AFileThatIsThereGoesOnAndNamesTheCommandThatAddedToIt) {
  const TestFolder folder;
  const StudyFile file(folder / "study");
  CellRecord(kIdentity, "oted.test/1", file, "hopper-bc", "one seed").Add(1, {{"score", 10}});
  CellRecord again(kIdentity, "oted.test/1", file, "hopper-bc", "two seeds");
  EXPECT_EQ(again.record().at("command"), "one seed") << "nothing was added yet";
  again.Add(2, {{"score", 20}});
  EXPECT_EQ(file.Find("hopper-bc"), (json{{"task", "hopper"},
                                          {"steps", 200},
                                          {"schema", "oted.test/1"},
                                          {"version", OTED_VERSION},
                                          {"command", "two seeds"},
                                          {"seeds", {{{"seed", 1}, {"score", 10}}, {{"seed", 2}, {"score", 20}}}}}));
}

TEST(CellRecord, NothingIsWrittenBeforeThereIsASeed) {
  const TestFolder folder;
  const CellRecord record(kIdentity, "oted.test/1", StudyFile(folder / "study"), "hopper-bc", "a command");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(CellRecord, SeedsOfOtherSettingsAreRefused) {
  const TestFolder folder;
  const StudyFile file(folder / "study");
  CellRecord(kIdentity, "oted.test/1", file, "hopper-bc", "a command").Add(1, {{"score", 10}});
  const std::string message = MessageOf<UsageError>([&] {
    CellRecord({{"task", "hopper"}, {"steps", 300}}, "oted.test/1", file, "hopper-bc", "a command");
  });
  EXPECT_THAT(message, HasSubstr("study.jsonl"));
  EXPECT_THAT(message,
              HasSubstr("holds seeds of hopper-bc with steps = 200 and this study has 300; take another --out"));
  EXPECT_THROW(CellRecord({{"task", "hopper"}, {"form", "paper"}}, "oted.test/1", file, "hopper-bc", "a command"),
               UsageError);
}

}  // namespace oted::cell_record_test
