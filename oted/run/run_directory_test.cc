#include "oted/run/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/whole_mark.h"
#include "oted/run/fingerprint.h"

namespace oted::run_directory_test {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

TEST(RunDirectory, IsMadeWithItsParentsAndIsEmpty) {
  const TestFolder folder;
  const RunDirectory directory(folder.path() / "a" / "b");
  EXPECT_TRUE(fs::is_directory(folder.path() / "a" / "b"));
  EXPECT_EQ(std::distance(fs::directory_iterator(directory.root()), {}), 1) << "the test for writing leaves nothing";
  EXPECT_TRUE(fs::exists(directory.root() / ".lock"));
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

class Warnings : public NullSink {
 public:
  void Warning(std::string_view message) override { told.emplace_back(message); }
  std::vector<std::string> told;
};

/// A stage that leaves a policy, which can be written in two forms, and curves.
Artifact Stage(const RunDirectory& directory) {
  return {.file = directory.clone() / "clone.json",
          .schema = "a/1",
          .fingerprint = "aa",
          .files = {"policy.npz"},
          .derived = {"policy.onnx"}};
}
struct StageMaker {
  const RunDirectory& directory;
  std::string policy = "weights";
  int n_made = 0;
  json operator()() {
    ++n_made;
    for (const char* name : {"policy.npz", "policy.onnx", "curves.csv"})
      WriteFileAtomically(directory.clone() / name, policy);
    return Loss();
  }
};

TEST(RunDirectory, AResultThatIsNotJsonIsMadeAgainWithAWarning) {
  const TestFolder folder;
  Warnings warnings;
  const RunDirectory directory(folder.path(), &warnings);
  WriteFileAtomically(folder / "design.json", "{\"fingerpr");
  EXPECT_FALSE(directory.IsComplete(OnTop(directory, "aa")));
  EXPECT_EQ(directory.Once(OnTop(directory, "aa"), Loss).at("loss"), 0.5);
  EXPECT_TRUE(directory.IsComplete(OnTop(directory, "aa")));
  EXPECT_THAT(warnings.told, testing::ElementsAre(HasSubstr("design.json' is damaged: its stage is made again")));
}

TEST(RunDirectory, AnEditedRecordIsRefusedAndNotMadeAgain) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  const Artifact artifact = OnTop(directory, "aa");
  directory.Once(artifact, Loss);
  json edited = ReadJson(artifact.file);
  edited["loss"] = 0.4;
  WriteJson(artifact.file, edited);
  for (const auto& use :
       std::vector<std::function<void()>>{[&] { directory.IsComplete(artifact); }, [&] { directory.Check({artifact}); },
                                          [&] { directory.Once(artifact, Loss); }}) {
    EXPECT_THAT(MessageOf<DataError>(use), HasSubstr("design.json' is not as oted wrote it"));
  }
  EXPECT_EQ(ReadJson(artifact.file).at("loss"), 0.4) << "the edit is still there";
}

TEST(RunDirectory, ADamagedFileIsMadeAgainByItsStageAndOnlyThen) {
  const TestFolder folder;
  for (const char* name : {"policy.npz", "policy.onnx", "curves.csv"}) {
    Warnings warnings;
    const RunDirectory directory(folder.path(), &warnings);
    StageMaker make{directory};
    directory.Once(Stage(directory), std::ref(make));
    const int before = make.n_made;
    EXPECT_TRUE(directory.IsComplete(Stage(directory)));
    WriteFileAtomically(directory.clone() / name, "damage");
    // Another program: this one has seen the file whole.
    const std::string root = directory.root().string();
    const bool needs_stage = std::string(name) == "policy.npz";
    const RunDirectory reader = RunDirectory::At(root);
    EXPECT_EQ(reader.IsComplete(Stage(reader)), !needs_stage) << name;
    EXPECT_EQ(fs::exists(directory.clone() / "policy.onnx"), std::string(name) != "policy.onnx") << name;
    StageMaker again{reader};
    reader.Once(Stage(reader), std::ref(again));
    EXPECT_EQ(again.n_made, needs_stage ? 1 : 0) << name;
    if (needs_stage) {
      EXPECT_EQ(ReadFile(directory.clone() / name), "weights");
    }
    EXPECT_LE(before, 1);
    fs::remove_all(directory.clone());
  }
}

TEST(RunDirectory, AStageThatIsAnotherWhenMadeAgainIsRefused) {
  const TestFolder folder;
  {
    const RunDirectory directory(folder.path());
    StageMaker make{directory};
    directory.Once(Stage(directory), std::ref(make));
    WriteFileAtomically(directory.clone() / "policy.npz", "damage");
  }
  const RunDirectory directory(folder.path());
  StageMaker other{directory, "other weights"};
  EXPECT_THAT(MessageOf<DataError>([&] { directory.Once(Stage(directory), std::ref(other)); }),
              testing::AllOf(HasSubstr("policy.npz"), HasSubstr("is another than before")));
}

TEST(RunDirectory, AResultFitsOnlyTheRecordsThatItWasMadeFrom) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  Artifact later = OnTop(directory, "bb");
  later.made_from = {directory.clone() / "clone.json", directory.root() / "not_there.json"};
  directory.Once(Clone(directory, "aa"), Loss);
  const json made = directory.Once(later, Loss);
  EXPECT_EQ(made.at("made_from"), (json{{"clone/clone.json", ReadJson(later.made_from[0]).at("seal")}}));
  fs::remove(later.made_from[0]);
  directory.Check({later});  // what is missing is made again first
  directory.Once(Clone(directory, "aa"), [] { return json{{"schema", "a/1"}, {"loss", 0.25}}; });
  EXPECT_THAT(MessageOf<DataError>([&] { directory.Check({later}); }), HasSubstr("was made from another"));
  EXPECT_THROW(directory.Once(later, Loss), DataError);
  fs::remove(later.made_from[0]);
  directory.Once(Clone(directory, "aa"), Loss);
  directory.Once(later, Loss);  // made again it is the same, and all fits
}

TEST(RunDirectory, ARecordWhoseSourceNoStageRepairedIsMadeAgainAndRepairsIt) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  Artifact later = OnTop(directory, "bb");
  const Artifact within = Clone(directory, "aa");  // asked for while the later one is made, and not before
  later.made_from = {within.file};
  int n_made = 0;
  double loss = 0.5;
  const auto make = [&] {
    ++n_made;
    directory.Once(within, [&] { return json{{"schema", "a/1"}, {"loss", loss}}; });
    return Loss();
  };
  const json made = directory.Once(later, make);
  WriteFileAtomically(within.file, "{");
  EXPECT_EQ(directory.Once(later, make), made);
  fs::remove(within.file);
  EXPECT_EQ(directory.Once(later, make), made);
  EXPECT_EQ(n_made, 3);
  directory.Check({within});
  // Made from something else, it is not what others were made from.
  fs::remove(within.file);
  loss = 0.25;
  EXPECT_THAT(MessageOf<DataError>([&] { directory.Once(later, make); }),
              testing::AllOf(HasSubstr("clone.json' is damaged or missing"), HasSubstr("is another than before")));
}

TEST(RunDirectory, OneDirectoryOneHolder) {
  const TestFolder folder;
  {
    const RunDirectory directory(folder.path());
    const RunDirectory copy = directory;
    EXPECT_THAT(MessageOf<UsageError>([&] { RunDirectory second(folder.path()); }),
                testing::AllOf(HasSubstr(fmt::format("process {}", ::getpid())), HasSubstr("choose another --out")));
    RunDirectory::At(folder.path());
  }
  const RunDirectory next(folder.path());
}

TEST(RunDirectory, ADirectoryThatIsMovedOrRemovedMeanwhileIsAnErrorAndNoPartOfAResult) {
  for (const bool moved : {true, false}) {
    const TestFolder folder;
    const RunDirectory directory(folder / "run");
    const auto make = [&] {
      moved ? fs::rename(folder / "run", folder / "moved") : static_cast<void>(fs::remove_all(folder / "run"));
      return Loss();
    };
    const std::string message = MessageOf<DataError>([&] { directory.Once(Clone(directory, "aa"), make); });
    EXPECT_THAT(message, HasSubstr(std::string(folder / "run") + "' was moved or removed"));
    EXPECT_FALSE(fs::exists(directory.clone() / "clone.json"));
    EXPECT_THROW(directory.Once(OnTop(directory, "aa"), Loss), DataError) << "nor is another stage begun there";
  }
}

TEST(RunDirectory, ALockInWhosePlaceALinkLiesIsRefusedAndWhatItLeadsToStays) {
  const TestFolder folder;
  fs::create_directory(folder / "run");
  WriteFileAtomically(folder / "precious", "mine");
  fs::create_symlink(folder / "precious", folder / "run/.lock");
  EXPECT_THAT(MessageOf<DataError>([&] { RunDirectory directory(folder / "run"); }), HasSubstr(".lock"));
  EXPECT_EQ(ReadFile(folder / "precious"), "mine");
}

TEST(RunDirectory, CurvesThatWereDamagedBeforeTheirStageWasDoneAreSetAsideWithAWarning) {
  const std::string text = "step,key,value\n1,a,0.5\n";
  for (const std::string& found : {text, text + "2,a,", std::string("step,kex,value\n1,a,0.5\n"), std::string()}) {
    const TestFolder folder;
    Warnings warnings;
    const RunDirectory directory(folder / "run", &warnings);
    const Artifact artifact = Clone(directory, "aa");
    directory.Once(artifact, [&] {
      // As of a stage that had only its record left to write.
      WriteFileAtomically(directory.clone() / "curves.csv", found);
      WriteFileAtomically(directory.clone() / "checkpoint.curves", WholeMark{text.size(), Checksum(0, text)}.ToText());
      return Loss();
    });
    const bool whole = found.starts_with(text);
    EXPECT_EQ(fs::exists(directory.clone() / "curves.csv"), whole) << found;
    EXPECT_EQ(fs::exists(directory.clone() / "curves.csv.damaged"), !whole) << found;
    EXPECT_EQ(warnings.told.size(), whole ? 0u : 1u) << found;
    EXPECT_EQ(ReadJson(artifact.file).value("files", json::object()).contains("curves.csv"), whole) << found;
  }
}

TEST(RunDirectory, WhatDeadProgramsLeftHalfWrittenIsRemoved) {
  const TestFolder folder;
  WriteFileAtomically(folder / "agents/1/policy.npz.oted-tmp-0123abcd-77-5-1", "half");
  WriteFileAtomically(folder / "agents/1/policy.npz", "whole");
  const RunDirectory directory(folder.path());
  EXPECT_FALSE(fs::exists(folder / "agents/1/policy.npz.oted-tmp-0123abcd-77-5-1"));
  EXPECT_TRUE(fs::exists(folder / "agents/1/policy.npz"));
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

TEST(RunDirectory, ARecordLargerThanAnyRecordIsRefusedUnread) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  directory.Once(Clone(directory, "aa"), Loss);
  fs::resize_file(directory.clone() / "clone.json", uint64_t{3} << 30);  // a hole: it takes no space
  EXPECT_THAT(MessageOf<DataError>([&] { directory.Once(Clone(directory, "aa"), Loss); }), HasSubstr("64 MiB"));
}

TEST(RunDirectory, ACheckpointIsGoneOnWithUnderItsOwnSettingsOnly) {
  for (const char* name : {"checkpoint.npz", "starts/1/checkpoint.npz"}) {
    SCOPED_TRACE(name);
    const TestFolder folder;
    const RunDirectory directory(folder.path());
    const fs::path unit = directory.clone();
    const auto stopped = [&]() -> json {
      WriteFileAtomically(unit / name, "work");
      throw Interrupted("stopped");
    };
    EXPECT_THROW(directory.Once(Clone(directory, "bb"), stopped), Interrupted);
    EXPECT_THAT(MessageOf<UsageError>([&] { directory.Once(Clone(directory, "aa"), Loss); }), HasSubstr(unit.string()));
    EXPECT_THROW(directory.Check({Clone(directory, "aa")}), UsageError);
    directory.Check({Clone(directory, "bb")});
    directory.Once(Clone(directory, "bb"), Loss);
    EXPECT_FALSE(fs::exists(unit / name));
    EXPECT_FALSE(fs::exists(unit / "checkpoint.json"));

    fs::remove(unit / "clone.json");
    WriteFileAtomically(unit / name, "of nobody knows what");
    for (const char* mark : {"", "x", "[]", "{\"fingerprint\": 5}"}) {
      if (*mark != 0) WriteFileAtomically(unit / "checkpoint.json", mark);
      EXPECT_THAT(MessageOf<DataError>([&] { directory.Once(Clone(directory, "bb"), Loss); }),
                  HasSubstr("remove the folder to begin its stage anew"))
          << mark;
    }
  }
}

TEST(RunDirectory, ACheckpointThatIsGoneIsTold) {
  const TestFolder folder;
  Warnings warnings;
  const RunDirectory directory(folder.path(), &warnings);
  const auto stopped = [&]() -> json {
    WriteFileAtomically(directory.clone() / "checkpoint.curves", WholeMark{}.ToText());
    throw Interrupted("stopped");
  };
  EXPECT_THROW(directory.Once(Clone(directory, "aa"), stopped), Interrupted);
  directory.Once(Clone(directory, "aa"), Loss);
  ASSERT_EQ(warnings.told.size(), 1u);
  EXPECT_THAT(warnings.told.front(), testing::AllOf(HasSubstr("no saved state"), HasSubstr("begins anew")));
}

TEST(RunDirectory, ARecordOfOtherSettingsIsToldBeforeWhatWasMadeFromAnother) {
  const TestFolder folder;
  const RunDirectory directory(folder.path());
  directory.Once(Clone(directory, "aa"), Loss);
  directory.Once(OnTop(directory, "bb"), Loss);
  json other = ReadJson(directory.clone() / "clone.json");
  other["fingerprint"] = "cc";
  Seal(other, directory.clone(), {});
  WriteJson(directory.clone() / "clone.json", other);
  for (const auto& artifacts : {std::vector{OnTop(directory, "bb"), Clone(directory, "aa")},
                                std::vector{Clone(directory, "aa"), OnTop(directory, "bb")}}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { directory.Check(artifacts); }),
                HasSubstr("remove '" + directory.clone().string()));
  }
}

TEST(Fingerprint, EqualInputsAgreeAndAnyChangeShows) {
  EXPECT_EQ(Fingerprint(json{{"a", 1}, {"b", 0.1}}), Fingerprint(json{{"b", 0.1}, {"a", 1}}));
  EXPECT_NE(Fingerprint(json{{"a", 1}}), Fingerprint(json{{"a", 2}}));
  EXPECT_NE(Fingerprint(json{{"a", 0.1}}), Fingerprint(json{{"a", std::nextafter(0.1, 1)}}));
  EXPECT_EQ(Fingerprint(json{}).size(), 16u);
}

}  // namespace oted::run_directory_test
