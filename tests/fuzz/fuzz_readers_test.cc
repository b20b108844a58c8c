// Five hundred damaged files: no reader crashes, hangs or allocates without bound, and each error names its file.

#include <gtest/gtest.h>

#include <map>

#include "oted/base/testing.h"
#include "tests/fuzz/fuzzing.h"

namespace oted::fuzz_readers_test {

TEST(FuzzReaders, TheSeedsThemselvesAreRead) {
  const TestFolder folder;
  for (const FuzzFormat& format : FuzzFormats(folder.path())) {
    for (const std::string& seed : format.seeds) {
      const FuzzResult result = ReadMutant(format, folder.path(), seed);
      EXPECT_EQ(result.outcome, FuzzOutcome::kRead) << format.name << ": " << result.message;
    }
    for (const std::string& seed : format.inner_seeds) EXPECT_FALSE(format.pack(seed).empty());
  }
}

TEST(FuzzReaders, FiveHundredDamagedFilesAreReadOrRefused) {
  const TestFolder folder;
  const std::vector<FuzzFormat> formats = FuzzFormats(folder.path());
  std::map<FuzzOutcome, int> counts;
  for (uint64_t i = 0; i < 500; ++i) {
    const FuzzFormat& format = formats[i % formats.size()];
    const std::string mutant = MakeMutant(format, RngKey(1).Stage("fuzz").Index(i));
    const FuzzResult result = ReadMutant(format, folder.path(), mutant);
    ++counts[result.outcome];
    EXPECT_NE(result.outcome, FuzzOutcome::kFailed)
        << "mutant " << i << " of " << format.name << ": " << result.message;
  }
  // Mutations that change nothing that matters and such that do: both kinds are met.
  EXPECT_GT(counts[FuzzOutcome::kRead], 20);
  EXPECT_GT(counts[FuzzOutcome::kRefused], 100);
}

TEST(FuzzReaders, TheSameKeyMakesTheSameMutant) {
  const TestFolder folder;
  const std::vector<FuzzFormat> formats = FuzzFormats(folder.path());
  for (const FuzzFormat& format : formats) {
    EXPECT_EQ(MakeMutant(format, RngKey(3).Index(5)), MakeMutant(format, RngKey(3).Index(5)));
  }
}

}  // namespace oted::fuzz_readers_test
