#include "oted/data/episode_choice.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/testing.h"

namespace oted::episode_choice_test {

TEST(EpisodeChoice, IsByNumberRangeOrList) {
  const Dataset d = MakeTestDataset(50, 10);
  const auto begins = [&](const std::string& which) {
    std::vector<int> rows;
    const Dataset chosen = EpisodeChoice(which, "--episodes").Of(d);
    for (const Episode& e : chosen.Episodes()) {
      const auto row = chosen.observations.row(e.begin);
      for (int i = 0; i < d.size(); ++i) {
        if (std::ranges::equal(row, d.observations.row(i))) rows.push_back(i);
      }
    }
    return rows;
  };
  EXPECT_EQ(begins("all").size(), 5u);
  EXPECT_EQ(begins("2"), (std::vector<int>{0, 10}));
  EXPECT_EQ(begins("2-4"), (std::vector<int>{10, 20, 30}));
  EXPECT_EQ(begins("1,3-5"), (std::vector<int>{0, 20, 30, 40})) << "all but the second";
  EXPECT_EQ(begins("4,2,2-2"), (std::vector<int>{10, 30})) << "in the dataset's order, each once";
}

TEST(EpisodeChoice, OtherNumbersThanTheFilesAreTold) {
  const auto told = [](const char* which) { return EpisodeChoice(which, "--episodes").Renumbering(); };
  for (const char* from_first : {"all", "3", "1-3", "2,1,3-4"}) EXPECT_EQ(told(from_first), "") << from_first;
  EXPECT_EQ(told("1,3-5"), "the episodes 1,3-5 of the data are counted from 1 from here on");
  EXPECT_NE(told("2"), told("2-2"));
}

TEST(EpisodeChoice, WhatNamesNoneIsRefusedWithWhatIsWanted) {
  for (const char* text : {"0", "4-2", "-3", "a", "1-b", "1.5", "", "1,", ",2", "1,,2", "3-", "1 ,2", "5 "}) {
    const std::string message = MessageOf<UsageError>([&] { EpisodeChoice(text, "data.episodes"); });
    EXPECT_NE(message.find("data.episodes is '"), std::string::npos) << text;
    EXPECT_NE(message.find("or all"), std::string::npos) << text;
  }
  const Dataset d = MakeTestDataset(50, 10);
  const std::string fewer = MessageOf<DataError>([&] { EpisodeChoice("1,3-6", "--episodes").Of(d); });
  EXPECT_NE(fewer.find("asks for episode 6, but"), std::string::npos) << fewer;
  EXPECT_NE(fewer.find("holds 5"), std::string::npos) << fewer;
}

}  // namespace oted::episode_choice_test
