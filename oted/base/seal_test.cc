#include "oted/base/seal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::seal_test {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

json Record() {
  return {
      {"schema", "a/1"}, {"value", 0.1}, {"nan", std::numeric_limits<double>::quiet_NaN()}, {"list", {1, 2.5, "x"}}};
}

TEST(Seal, HoldsWhenTheRecordIsReadAgainAndBreaksWithAnyChange) {
  const TestFolder folder;
  json record = Record();
  Seal(record);
  WriteJson(folder / "a.json", record);
  EXPECT_EQ(SealOf(ReadSealed(folder / "a.json")), SealOf(record));
  const std::string whole = ReadFile(folder / "a.json");
  int n_read = 0, n_changed = 0;
  for (size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] ^= 1;
    std::ofstream(folder / "a.json") << damaged;  // without waiting for the disk
    try {
      const json read = ReadSealed(folder / "a.json");
      ++n_read;
      n_changed += read != json::parse(whole);
    } catch (const DataError& e) {
      EXPECT_THAT(e.what(), HasSubstr("a.json"));
    }
  }
  EXPECT_EQ(n_changed, 0) << "a damage went unnoticed";
  EXPECT_LT(n_read, static_cast<int>(whole.size()) / 4) << "only white space and the like can change nothing";
}

TEST(Seal, IsTheHashThatTheFormatSaysAndAnotherProgramCanCheckIt) {
  const TestFolder folder;
  WriteFileAtomically(folder / "policy.npz", "weights");
  json record = {{"b", 1}, {"a", "text"}};
  Seal(record, folder.path(), {"policy.npz"});
  WriteJson(folder / "record.json", record);
  EXPECT_TRUE(RunPython(R"(
import hashlib, json
record = json.load(open('record.json'))
seal = record.pop('seal')
text = json.dumps(record, sort_keys=True, separators=(',', ':'))
assert hashlib.sha256(text.encode()).hexdigest() == seal, text
assert record['files'] == {'policy.npz': hashlib.sha256(open('policy.npz', 'rb').read()).hexdigest()}
)",
                        folder));
}

TEST(Seal, DamagedAndMissingFilesAreNamed) {
  const TestFolder folder;
  for (const char* name : {"a", "b", "c"}) WriteFileAtomically(folder / name, name);
  json record = Record();
  Seal(record, folder.path(), {"a", "b", "c"});
  EXPECT_TRUE(DamagedFiles(record, folder / "r.json").empty());
  WriteFileAtomically(folder / "b", "B");
  std::filesystem::remove(folder / "c");
  EXPECT_THAT(DamagedFiles(record, folder / "r.json"), ElementsAre("b", "c"));
  CheckSealedFile(record, folder / "r.json", "a");
  EXPECT_THAT(MessageOf<DataError>([&] { CheckSealedFile(record, folder / "r.json", "b"); }),
              HasSubstr("b' is damaged"));
}

TEST(Seal, NamesOfFilesElsewhereAreRefused) {
  for (const char* name : {"../a", "/etc/passwd", "..", ".", "", "a/b", "a\\b"}) {
    EXPECT_FALSE(IsPlainName(name)) << name;
    const json record = {{"files", {{name, "00"}}}};
    EXPECT_THAT(MessageOf<DataError>([&] { SealedFiles(record, "r.json"); }), HasSubstr("r.json")) << name;
  }
  EXPECT_TRUE(IsPlainName("policy.npz"));
}

TEST(Seal, ARecordWithoutOneIsReadOnlyWhereThatIsAllowed) {
  const TestFolder folder;
  WriteJson(folder / "a.json", Record());
  EXPECT_THAT(MessageOf<DataError>([&] { ReadSealed(folder / "a.json"); }), HasSubstr("has no seal"));
  EXPECT_EQ(ReadSealed(folder / "a.json", true).at("value"), 0.1);
}

TEST(SealedText, HoldsUntilTheTextIsChanged) {
  const TestFolder folder;
  const std::string text = "[run]\nseed = 1\n", sealed = SealedText(text, "comment");
  WriteFileAtomically(folder / "run.toml", sealed);
  EXPECT_EQ(ReadSealedText(folder / "run.toml", ""), sealed);
  EXPECT_TRUE(sealed.ends_with(text));
  for (const std::string& changed :
       {sealed + "x", text, sealed.substr(0, 40), std::string(), sealed.substr(0, sealed.size() - 1)}) {
    WriteFileAtomically(folder / "run.toml", changed);
    EXPECT_THAT(MessageOf<DataError>([&] { ReadSealedText(folder / "run.toml", "do this"); }), HasSubstr("do this"));
  }
}

}  // namespace oted::seal_test
