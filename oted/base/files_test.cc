#include "oted/base/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::files_test {

namespace fs = std::filesystem;
using testing::HasSubstr;

int EntriesIn(const fs::path& folder) {
  int n = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder)) ++n;
  return n;
}

TEST(Files, WritesWholeFilesAndMissingFolders) {
  const TestFolder folder;
  const std::string bytes("a\0b\r\n\xff", 6);
  WriteFileAtomically(folder / "new/deep/file", bytes);
  EXPECT_EQ(ReadFile(folder / "new/deep/file"), bytes);
  WriteFileAtomically(folder / "new/deep/file", "");
  EXPECT_EQ(ReadFile(folder / "new/deep/file"), "");
  EXPECT_EQ(EntriesIn(folder / "new/deep"), 1) << "a temporary file is left";
}

TEST(Files, AWriteThatFailsLeavesTheOldFileAlone) {
  const TestFolder folder;
  WriteFileAtomically(folder / "file", "old");
  try {
    const AtomicFile file(folder / "file");
    std::ofstream(file.temporary_path()) << "half of the new";
    throw std::runtime_error("the writer failed");
  } catch (const std::runtime_error&) {
  }
  EXPECT_EQ(ReadFile(folder / "file"), "old");
  EXPECT_EQ(EntriesIn(folder.path()), 1) << "the half-written file is left";
}

TEST(Files, TheOldFileStaysReadableUntilCommit) {
  const TestFolder folder;
  WriteFileAtomically(folder / "file", "old");
  AtomicFile file(folder / "file");
  std::ofstream(file.temporary_path()) << "new";
  EXPECT_EQ(ReadFile(folder / "file"), "old");
  file.Commit();
  EXPECT_EQ(ReadFile(folder / "file"), "new");
}

TEST(Files, APathThatCannotBeWrittenIsADataError) {
  const TestFolder folder;
  WriteFileAtomically(folder / "file", "x");
  EXPECT_THAT(MessageOf<DataError>([&] { WriteFileAtomically(folder / "file/below", "y"); }), HasSubstr("file"));
  // A folder is not replaced by a file.
  fs::create_directories(folder / "folder/inside");
  EXPECT_THAT(MessageOf<DataError>([&] { WriteFileAtomically(folder / "folder", "y"); }), HasSubstr("folder'"));
  EXPECT_EQ(ReadFile(folder / "file"), "x");
  EXPECT_EQ(EntriesIn(folder.path()), 2);
}

TEST(Files, MissingFilesAndFoldersAreDataErrors) {
  const TestFolder folder;
  EXPECT_THAT(MessageOf<DataError>([&] { ReadFile(folder / "none"); }), HasSubstr("none': No such file"));
  EXPECT_THAT(MessageOf<DataError>([&] { ReadFile(folder.path()); }), HasSubstr("directory"));
}

TEST(Files, JsonComesBackAndBrokenJsonIsNamed) {
  const TestFolder folder;
  const nlohmann::json value = {{"a", 0.1}, {"b", {1, 2}}};
  WriteJson(folder / "a.json", value);
  EXPECT_EQ(ReadJson(folder / "a.json"), value);
  EXPECT_EQ(ReadFile(folder / "a.json").back(), '\n');
  WriteFileAtomically(folder / "b.json", "{\"a\": ");
  EXPECT_THAT(MessageOf<DataError>([&] { ReadJson(folder / "b.json"); }), HasSubstr("b.json' is not valid JSON"));
}

TEST(Files, JsonIsReadWithinLimits) {
  const TestFolder folder;
  const auto nested = [](int n) {
    return std::string(static_cast<size_t>(n), '[') + std::string(static_cast<size_t>(n), ']');
  };
  EXPECT_NO_THROW(ParseJson(nested(64), "a.json"));
  EXPECT_THAT(MessageOf<DataError>([&] { ParseJson(nested(65), "a.json"); }), HasSubstr("nested more than 64 deep"));
  EXPECT_THAT(MessageOf<DataError>([&] { ParseJson(std::string(100000, '['), "a.json"); }), HasSubstr("a.json"));
  EXPECT_EQ(ParseJson("[\"[[[\\\"[[\"]", "a.json"), nlohmann::json({"[[[\"[["})) << "brackets in text do not nest";
  WriteFileAtomically(folder / "large", std::string(2000, ' '));
  EXPECT_THAT(MessageOf<DataError>([&] { ReadFile(folder / "large", 1999); }), HasSubstr("large' has more than"));
  EXPECT_EQ(ReadFile(folder / "large", 2000).size(), 2000u);
}

TEST(Files, TextThatIsNoUtf8IsReplacedAndNoCrash) {
  const TestFolder folder;
  WriteJson(folder / "a.json", {{"name", "a\xff"}});
  EXPECT_EQ(ReadJson(folder / "a.json").at("name"), "a\xEF\xBF\xBD");
}

TEST(Files, WhatHasNoEndIsAUsageError) {
  const TestFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", folder / "zero");
  for (const char* name : {"pipe", "zero"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { ReadFile(folder / name); }), HasSubstr("no regular file")) << name;
    EXPECT_THROW(Sha256OfFile(folder / name), UsageError) << name;
  }
  EXPECT_THAT(MessageOf<UsageError>([&] { WriteFileAtomically(folder / "pipe", "x"); }), HasSubstr("no regular file"));
  EXPECT_TRUE(fs::is_fifo(folder / "pipe")) << "nothing took its place";
}

TEST(Files, ALinkInSharedMemoryIsWrittenThrough) {
  const fs::path folder = fs::path("/dev/shm") / fmt::format("oted-test-{}", ::getpid());
  if (::access("/dev/shm", W_OK) != 0) GTEST_SKIP() << "no shared memory here";
  fs::create_directory(folder);
  fs::create_symlink("behind", folder / "link");
  WriteFileAtomically(folder / "link", "x");
  EXPECT_EQ(ReadFile(folder / "behind"), "x");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  fs::remove_all(folder);
}

TEST(Files, WhatADeadWriterLeftGoesAndWhatALivingOneWritesStays) {
  const TestFolder folder;
  const AtomicFile living(folder / "file");
  WriteFileAtomically(living.temporary_path(), "being written");
  const int child = ::fork();
  if (child == 0) {
    // It has made its temporary and is killed.
    const AtomicFile half(folder / "file");
    std::ofstream(half.temporary_path()) << "half";
    ::kill(::getpid(), SIGKILL);
  }
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  ASSERT_EQ(EntriesIn(folder.path()), 2);
  // A process looks once for each name of a file: by another name, as another process would.
  WriteFileAtomically(folder.path() / "." / "file", "whole");
  EXPECT_EQ(EntriesIn(folder.path()), 2) << "what the dead one left is still there";
  EXPECT_TRUE(fs::exists(living.temporary_path()));
  EXPECT_TRUE(IsTemporaryName(living.temporary_path().filename().string()));
  for (const char* name :
       {"file", "a.oted-tmp-", "notes.oted-tmp-old", ".oted-tmp-0123abcd-1-1-1", "a.tmp-20261126-2-1-1",
        "a.oted-tmp-0123abcd-1-1", "a.oted-tmp-0123abcd-1-1-1x", "a.oted-tmp-0123abcx-1-1-1"})
    EXPECT_FALSE(IsTemporaryName(name)) << name;
}

TEST(AtomicFile, WhatAnUnburiedProcessOrOneOfTheSameNumberLeftIsRemoved) {
  const TestFolder folder;
  const int child = ::fork();
  if (child == 0) {
    const AtomicFile half(folder / "file");
    std::ofstream(half.temporary_path()) << "half";
    ::kill(::getpid(), SIGKILL);
  }
  siginfo_t end{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(child), &end, WEXITED | WNOWAIT), 0);
  ASSERT_EQ(EntriesIn(folder.path()), 1);
  WriteFileAtomically(folder / "file", "whole");
  EXPECT_EQ(EntriesIn(folder.path()), 1) << "it is dead, though its number is still given";
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);

  // Of this process, had it begun a tick before.
  const AtomicFile own(folder / "other");
  std::string name = own.temporary_path().filename().string();
  const size_t number = name.rfind('-'), start = name.rfind('-', number - 1) + 1;
  name.replace(start, number - start, std::to_string(std::stoull(name.substr(start, number - start)) - 1));
  ASSERT_TRUE(IsTemporaryName(name));
  WriteFileAtomically(folder.path() / name, "half");
  WriteFileAtomically(own.temporary_path(), "being written");
  RemoveTemporaries(folder.path(), std::span<const char* const>());
  EXPECT_FALSE(fs::exists(folder.path() / name));
  EXPECT_TRUE(fs::exists(own.temporary_path()));
}

TEST(AtomicFile, TemporariesAreRemovedInOnesOwnFoldersAloneAndNotThoseOfPrograms) {
  const TestFolder folder;
  const AtomicFile living(folder / "own/file");
  WriteFileAtomically(living.temporary_path(), "");
  const std::string dead = "file.oted-tmp-0123abcd-99-5-1";
  for (const char* place : {".", "own", "own/deep", "other"}) WriteFileAtomically(folder.path() / place / dead, "");
  WriteFileAtomically(folder / "own/backup.tmp-20261126-2", "");
  RemoveTemporaries(folder.path(), std::array{"own", "missing"});
  for (const char* place : {".", "own", "own/deep"}) EXPECT_FALSE(fs::exists(folder.path() / place / dead)) << place;
  EXPECT_TRUE(fs::exists(folder.path() / "other" / dead));
  EXPECT_TRUE(fs::exists(living.temporary_path()));
  EXPECT_TRUE(fs::exists(folder / "own/backup.tmp-20261126-2"));
}

TEST(WriteGuard, WhatIsGuardedIsNotMadeAnewAndTheRestIsWritten) {
  const TestFolder folder;
  const fs::path run = folder.path() / "run";
  WriteFileAtomically(run / "a", "");
  {
    const WriteGuard guard(run / "", [&] {
      if (!fs::exists(run)) throw DataError("gone");
    });
    EXPECT_NO_THROW(WriteFileAtomically(run / "b", ""));
    fs::remove_all(run);
    EXPECT_THROW(WriteFileAtomically(run / "deep/c", ""), DataError);
    EXPECT_FALSE(fs::exists(run));
    EXPECT_NO_THROW(WriteFileAtomically(folder.path() / "running/c", "")) << "another folder";
  }
  EXPECT_NO_THROW(WriteFileAtomically(run / "c", ""));
}

TEST(Sha256, MatchesThePublishedVectors) {
  // FIPS 180-4's examples.
  EXPECT_EQ(Sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  const TestFolder folder;
  WriteFileAtomically(folder / "abc", "abc");
  EXPECT_EQ(Sha256OfFile(folder / "abc"), Sha256("abc"));
}

}  // namespace oted::files_test
