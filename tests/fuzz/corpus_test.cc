// Every reader's seeds, and the files in tests/fuzz/corpus: inputs that once broke a reader, and some that `make fuzz`
// found on the way.

#include <gtest/gtest.h>

#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "tests/fuzz/families.h"

namespace oted::fuzz_corpus_test {

namespace fs = std::filesystem;

TEST(FuzzFamilies, EachSeedIsReadBySomeReaderAndNoReaderFailsAtIt) {
  const TestFolder folder;
  for (const FuzzFamily& family : FuzzFamilies(folder.path())) {
    for (size_t i = 0; i < family.seeds.size(); ++i) {
      bool read = false;
      std::string messages;
      for (const FuzzReader& reader : family.readers) {
        const FuzzResult result = ReadBytes(reader, folder.path(), family.seeds[i]);
        read = read || result.outcome == FuzzOutcome::kRead;
        EXPECT_NE(result.outcome, FuzzOutcome::kFailed) << family.name << " " << i << ": " << result.message;
        messages += result.message + "\n";
      }
      EXPECT_TRUE(read) << family.name << " seed " << i << "\n" << messages;
    }
  }
}

TEST(FuzzFamilies, NoReaderFailsAtAFileOfTheCorpus) {
  const TestFolder folder;
  const fs::path corpus = fs::path(OTED_TEST_SOURCE_DIR) / "tests/fuzz/corpus";
  int n_files = 0;
  for (const FuzzFamily& family : FuzzFamilies(folder.path())) {
    if (!fs::is_directory(corpus / family.name)) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(corpus / family.name)) {
      const std::string bytes = ReadFile(entry.path());
      for (const FuzzReader& reader : family.readers) {
        const FuzzResult result = ReadBytes(reader, folder.path(), bytes);
        EXPECT_NE(result.outcome, FuzzOutcome::kFailed) << entry.path() << ": " << result.message;
      }
      ++n_files;
    }
  }
  EXPECT_GT(n_files, 0) << corpus;
}

TEST(FuzzFamilies, WhatIsChangedBehindAChecksumStillPassesIt) {
  const TestFolder folder;
  const Mutator nothing = [](const std::string& bytes) { return bytes; };
  for (const FuzzFamily& family : FuzzFamilies(folder.path())) {
    if (!family.mutate_inside) continue;
    const std::string same = family.mutate_inside(family.seeds[0], 1, nothing);
    const FuzzResult result = ReadBytes(family.readers[0], folder.path(), same);
    EXPECT_EQ(result.outcome, FuzzOutcome::kRead) << family.name << ": " << result.message;
  }
}

}  // namespace oted::fuzz_corpus_test
