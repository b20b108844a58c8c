#include "oted/run/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/run/fingerprint.h"

namespace oted::run_directory_test {

using nlohmann::json;
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
  EXPECT_EQ(directory.NameOf(directory.nominal(1)), "nominal/1");
}

Artifact Clone(const RunDirectory& directory, const std::string& fingerprint) {
  return {directory.clone() / "clone.json", "a/1", fingerprint};
}
Artifact OnTop(const RunDirectory& directory, const std::string& fingerprint) {
  return {directory.root() / "design.json", "a/1", fingerprint};
}
json Loss() { return {{"schema", "a/1"}, {"loss", 0.5}}; }

TEST(RunDirectory, AResultIsCompleteForItsOwnSettingsOnly) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  const Artifact mine = Clone(directory, "aa");
  EXPECT_FALSE(directory.IsComplete(mine));
  directory.Once(mine, Loss);
  EXPECT_TRUE(directory.IsComplete(mine));
  EXPECT_EQ(ReadJson(mine.file).at("loss"), 0.5);
  const std::string message = MessageOf<UsageError>([&] { directory.IsComplete(Clone(directory, "bb")); });
  EXPECT_THAT(message, HasSubstr(mine.file.string()));
  EXPECT_THAT(message, HasSubstr("remove '" + directory.clone().string() + "'"));

  directory.Once(OnTop(directory, "aa"), Loss);
  EXPECT_THAT(MessageOf<UsageError>([&] { directory.IsComplete(OnTop(directory, "bb")); }),
              HasSubstr("remove '" + (directory.root() / "design.json").string() + "'"))
      << "never the whole run";
}

TEST(RunDirectory, AnArtefactIsMadeOnceAndWhatWasMadeIsWhatIsRead) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  int n_made = 0;
  const auto make = [&] {
    ++n_made;
    return Loss();
  };
  const json made = directory.Once(Clone(directory, "aa"), make), read = directory.Once(Clone(directory, "aa"), make);
  EXPECT_EQ(n_made, 1);
  EXPECT_EQ(made, read);
  EXPECT_EQ(made.at("fingerprint"), "aa");
  fs::remove(directory.clone() / "clone.json");
  directory.Once(Clone(directory, "bb"), make);
  EXPECT_EQ(n_made, 2);
}

TEST(RunDirectory, AResultThatIsNotJsonIsAnErrorNotComplete) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  WriteFileAtomically(folder / "design.json", "{\"fingerpr");
  EXPECT_THROW(directory.IsComplete(OnTop(directory, "aa")), DataError);
}

TEST(RunDirectory, ARecordOfAnotherVersionIsRefusedInOneLine) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  for (const char* text : {"[1, 2]", "3", "{\"fingerprint\": 5}", "{\"schema\": \"a/1\"}",
                           "{\"fingerprint\": \"aa\", \"schema\": \"a/0\"}"}) {
    WriteFileAtomically(folder / "design.json", text);
    EXPECT_THAT(MessageOf<UsageError>([&] { directory.IsComplete(OnTop(directory, "aa")); }),
                HasSubstr("made by another version of oted; choose another --out"))
        << text;
  }
}

TEST(RunDirectory, ACheckpointIsGoneOnWithUnderItsOwnSettingsOnly) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  const fs::path unit = directory.clone();
  const auto stopped = [&]() -> json {
    WriteFileAtomically(unit / "checkpoint.npz", "work");
    throw Interrupted("stopped");
  };
  EXPECT_THROW(directory.Once(Clone(directory, "bb"), stopped), Interrupted);
  EXPECT_THAT(MessageOf<UsageError>([&] { directory.Once(Clone(directory, "aa"), Loss); }), HasSubstr(unit.string()));
  EXPECT_THROW(directory.Check(Clone(directory, "aa")), UsageError);
  directory.Check(Clone(directory, "bb"));
  directory.Once(Clone(directory, "bb"), Loss);
  EXPECT_FALSE(fs::exists(unit / "checkpoint.npz"));
  EXPECT_FALSE(fs::exists(unit / "checkpoint.json"));

  fs::remove(unit / "clone.json");
  WriteFileAtomically(unit / "checkpoint.npz", "of nobody knows what");
  EXPECT_THROW(directory.Once(Clone(directory, "bb"), Loss), UsageError);
}

TEST(Fingerprint, EqualInputsAgreeAndAnyChangeShows) {
  EXPECT_EQ(Fingerprint(json{{"a", 1}, {"b", 0.1}}), Fingerprint(json{{"b", 0.1}, {"a", 1}}));
  EXPECT_NE(Fingerprint(json{{"a", 1}}), Fingerprint(json{{"a", 2}}));
  EXPECT_NE(Fingerprint(json{{"a", 0.1}}), Fingerprint(json{{"a", std::nextafter(0.1, 1)}}));
  EXPECT_EQ(Fingerprint(json{}).size(), 16u);
}

}  // namespace oted::run_directory_test
