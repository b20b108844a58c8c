#include "oted/run/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::run_directory_test {

using testing::HasSubstr;
namespace fs = std::filesystem;

TEST(RunDirectory, IsMadeWithItsParentsAndIsEmpty) {
  const TestFolder folder;
  const RunDirectory directory(folder.path() / "a" / "b");
  EXPECT_TRUE(fs::is_directory(folder.path() / "a" / "b"));
  EXPECT_TRUE(fs::is_empty(directory.root())) << "the test for writing leaves nothing";
}

TEST(RunDirectory, AFileInTheWayIsAnErrorAndStaysUntouched) {
  const TestFolder folder;
  WriteFileAtomically(folder / "taken", "mine");
  const std::string message = MessageOf<DataError>([&] { RunDirectory directory(folder / "taken"); });
  EXPECT_THAT(message, HasSubstr("taken"));
  EXPECT_EQ(ReadFile(folder / "taken"), "mine");
  EXPECT_THROW(RunDirectory directory(folder / "taken/below"), DataError);
}

TEST(RunDirectory, PathsAreThoseOfTheFormat) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  EXPECT_EQ(directory.NameOf(directory.clone()), "clone");
  EXPECT_EQ(directory.NameOf(directory.design_seed("paper", 3)), "design/paper/3");
  EXPECT_EQ(directory.NameOf(directory.agent(2)), "agents/2");
  EXPECT_EQ(directory.NameOf(directory.undesigned(1)), "undesigned/1");
}

TEST(RunDirectory, AResultIsCompleteForItsOwnSettingsOnly) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  const fs::path file = directory.clone() / "clone.json";
  EXPECT_FALSE(directory.IsComplete(file, "aa"));
  directory.Complete(file, {{"loss", 0.5}}, "aa");
  EXPECT_TRUE(directory.IsComplete(file, "aa"));
  EXPECT_EQ(ReadJson(file).at("loss"), 0.5);
  const std::string message = MessageOf<UsageError>([&] { directory.IsComplete(file, "bb"); });
  EXPECT_THAT(message, HasSubstr(file.string()));
  EXPECT_THAT(message, HasSubstr("remove '" + directory.clone().string() + "'"));

  directory.Complete(directory.root() / "design.json", {}, "aa");
  EXPECT_THAT(MessageOf<UsageError>([&] { directory.IsComplete(directory.root() / "design.json", "bb"); }),
              HasSubstr("remove '" + (directory.root() / "design.json").string() + "'"))
      << "never the whole run";
}

TEST(RunDirectory, AResultThatIsNotJsonIsAnErrorNotComplete) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  WriteFileAtomically(folder / "design.json", "{\"fingerpr");
  EXPECT_THROW(directory.IsComplete(folder / "design.json", "aa"), DataError);
  for (const char* text : {"[1, 2]", "3", "{\"fingerprint\": 5}"}) {
    WriteFileAtomically(folder / "design.json", text);
    EXPECT_THROW(directory.IsComplete(folder / "design.json", "aa"), Error) << text;
  }
}

TEST(RunDirectory, ACheckpointIsGoneOnWithUnderItsOwnSettingsOnly) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  const fs::path unit = directory.agent(1);
  directory.CheckCheckpoint(unit, "aa");
  directory.Begin(unit, "aa");
  directory.Begin(unit, "bb");  // no work has been saved yet
  WriteFileAtomically(unit / "checkpoint.npz", "work");
  directory.Begin(unit, "bb");
  EXPECT_THAT(MessageOf<UsageError>([&] { directory.Begin(unit, "aa"); }), HasSubstr(unit.string()));
  EXPECT_THROW(directory.CheckCheckpoint(unit, "aa"), UsageError);
  directory.RemoveCheckpoint(unit);
  EXPECT_TRUE(fs::is_empty(unit));

  WriteFileAtomically(unit / "checkpoint.npz", "of nobody knows what");
  EXPECT_THROW(directory.Begin(unit, "aa"), UsageError);
}

TEST(Fingerprint, EqualInputsAgreeAndAnyChangeShows) {
  using nlohmann::json;
  EXPECT_EQ(Fingerprint(json{{"a", 1}, {"b", 0.1}}), Fingerprint(json{{"b", 0.1}, {"a", 1}}));
  EXPECT_NE(Fingerprint(json{{"a", 1}}), Fingerprint(json{{"a", 2}}));
  EXPECT_NE(Fingerprint(json{{"a", 0.1}}), Fingerprint(json{{"a", std::nextafter(0.1, 1)}}));
  EXPECT_EQ(Fingerprint(json{}).size(), 16u);
}

}  // namespace oted::run_directory_test
