#include "oted/data/dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <thread>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/testing.h"

namespace oted::dataset_test {

using testing::HasSubstr;

TEST(Dataset, EpisodesAreCutAfterTerminalsTimeoutsAndTheEnd) {
  const std::vector<Episode> episodes = MakeTestDataset(10, 4).Episodes();
  ASSERT_EQ(episodes.size(), 3u);
  EXPECT_EQ(episodes[0].begin, 0);
  EXPECT_EQ(episodes[0].end, 4);
  EXPECT_FALSE(episodes[0].terminated);
  EXPECT_EQ(episodes[1].end, 8);
  EXPECT_TRUE(episodes[1].terminated);
  EXPECT_EQ(episodes[2].size(), 2);
  EXPECT_FALSE(episodes[2].terminated);
}

TEST(Dataset, ReturnsSumTheRewardsOfEachEpisode) {
  // rewards are i / 4: 0 + 1/4 + 2/4 + 3/4, then 4/4 .. 7/4, then 8/4 + 9/4.
  EXPECT_EQ(MakeTestDataset(10, 4).EpisodeReturns(), (std::vector<double>{1.5, 5.5, 4.25}));
  EXPECT_TRUE(MakeTestDataset(10, 4, true, false).EpisodeReturns().empty());
}

TEST(Dataset, SelectedEpisodesStayApart) {
  const Dataset all = MakeTestDataset(10, 4);
  const std::vector<Episode> episodes = all.Episodes();
  const Dataset selected = all.Select({episodes[2], episodes[0]});
  ASSERT_EQ(selected.size(), 6);
  EXPECT_EQ(selected.observations(0, 0), all.observations(8, 0));
  EXPECT_EQ(selected.qvel(2, 0), all.qvel(0, 0));
  const std::vector<Episode> again = selected.Episodes();
  ASSERT_EQ(again.size(), 2u);
  EXPECT_EQ(again[0].size(), 2);
  EXPECT_EQ(again[1].size(), 4);
}

TEST(Dataset, AppendingKeepsAnUnfinishedEpisodeApartFromTheNext) {
  Dataset joined = MakeTestDataset(6, 4);
  joined.Append(MakeTestDataset(3, 4));
  ASSERT_EQ(joined.size(), 9);
  const std::vector<Episode> episodes = joined.Episodes();
  ASSERT_EQ(episodes.size(), 3u);
  EXPECT_EQ(episodes[1].end, 6);
  EXPECT_EQ(joined.observations(6, 1), MakeTestDataset(3, 4).observations(0, 1));
}

TEST(Dataset, AppendingToAnEmptyDatasetCopies) {
  Dataset joined;
  joined.Append(MakeTestDataset(6, 4));
  EXPECT_TRUE(SameTransitions(joined, MakeTestDataset(6, 4)));
  joined.Append(Dataset());
  EXPECT_TRUE(SameTransitions(joined, MakeTestDataset(6, 4)));
}

TEST(Dataset, CheckNamesTheFirstDefect) {
  const auto message_after = [](const std::function<void(Dataset&)>& damage) {
    Dataset dataset = MakeTestDataset(10, 4);
    dataset.path = "demos.hdf5";
    damage(dataset);
    return MessageOf<DataError>([&] { dataset.Check(); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NO_THROW(MakeTestDataset(10, 4).Check());
  EXPECT_THAT(message_after([](Dataset& d) { d = Dataset(); }), HasSubstr("no transition"));
  EXPECT_THAT(message_after([&](Dataset& d) { d.actions(3, 1) = nan; }),
              HasSubstr("'demos.hdf5': actions[3, 1] (episode 1) is nan"));
  EXPECT_THAT(message_after([&](Dataset& d) { d.rewards[7] = nan; }), HasSubstr("rewards[7] (episode 2) is nan"));
  EXPECT_THAT(message_after([&](Dataset& d) { d.qvel(2, 0) = 1 / 0.0; }),
              HasSubstr("infos/qvel[2, 0] (episode 1) is inf"));
  EXPECT_THAT(message_after([](Dataset& d) { d.terminals.pop_back(); }), HasSubstr("terminals has 9 rows"));
  EXPECT_THAT(message_after([](Dataset& d) { d.qpos = {}; }), HasSubstr("only one of infos/qpos"));
  EXPECT_THAT(message_after([](Dataset& d) { d.next_observations = Array2<double>(10, 2); }),
              HasSubstr("next_observations has 2 columns but observations has 3"));
  EXPECT_THAT(message_after([](Dataset& d) { d.actions = Array2<double>(10, 0); }), HasSubstr("at least one"));
}

TEST(Dataset, AnotherTasksDimensionsAreRefused) {
  const Dataset dataset = MakeTestDataset(10, 4);
  EXPECT_NO_THROW(dataset.CheckFits("Hopper-v5", 3, 2));
  EXPECT_THAT(MessageOf<DataError>([&] { dataset.CheckFits("Hopper-v5", 11, 3); }),
              HasSubstr("'Hopper-v5' has 11 and 3"));
}

TEST(Dataset, BothLayoutsGiveBackWhatWasWrittenWithPathAndHash) {
  const TestFolder folder;
  for (const bool with_optional : {true, false}) {
    const Dataset dataset = MakeTestDataset(50, 7, with_optional, with_optional);
    for (const char* name : {"a.hdf5", "b.h5", "c.npz"}) {
      const std::string path = folder / name;
      WriteDataset(dataset, path);
      const Dataset read = ReadDataset(path);
      EXPECT_TRUE(SameTransitions(read, dataset)) << name;
      EXPECT_EQ(read.path, path);
      EXPECT_EQ(read.sha256, Sha256OfFile(path));
    }
  }
}

TEST(Dataset, ALogThatGrowsWhileItIsReadIsRefused) {
  const TestFolder folder;
  const std::string path = folder / "growing.csv";
  std::string rows = "episode,observation_0,action_0\n";
  for (int i = 0; i < 100000; ++i) rows += "0,1.25,0.5\n";
  WriteFileAtomically(path, rows);
  EXPECT_NO_THROW(ReadDataset(path));
  std::atomic<bool> done = false;
  std::thread logger([&] {
    std::ofstream file(path, std::ios::app);
    while (!done) file << "0,1.25,0.5\n" << std::flush;
  });
  EXPECT_THAT(MessageOf<DataError>([&] { ReadDataset(path); }), HasSubstr("changed while it was read"));
  done = true;
  logger.join();
}

TEST(Dataset, WrongPathsAndEndingsAreOneLineErrors) {
  const TestFolder folder;
  const auto message = [](const std::string& path) { return MessageOf<DataError>([&] { ReadDataset(path); }); };
  EXPECT_THAT(message(folder / "none.hdf5"), HasSubstr("is not a file"));
  EXPECT_THAT(message(folder / "demos.pkl"), HasSubstr("use .hdf5 or .h5"));
  std::filesystem::create_directory(folder / "folder.npz");
  EXPECT_THAT(message(folder / "folder.npz"), HasSubstr("is not a file"));
}

TEST(Dataset, ADefectiveDatasetIsNotWritten) {
  const TestFolder folder;
  Dataset dataset = MakeTestDataset(10, 4);
  dataset.rewards[3] = std::numeric_limits<double>::infinity();
  for (const char* name : {"a.hdf5", "c.npz"}) EXPECT_THROW(WriteDataset(dataset, folder / name), DataError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace oted::dataset_test
