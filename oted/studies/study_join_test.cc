#include "oted/studies/study_join.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted {
namespace {

using nlohmann::json;
using testing::HasSubstr;

json Seed(int seed, double score, double seconds) { return {{"seed", seed}, {"score", score}, {"seconds", seconds}}; }
json CellOfSeeds(const std::vector<json>& seeds, int steps = 100) {
  return {{"steps", steps}, {"command", "whatever"}, {"seeds", seeds}};
}

TEST(JoinStudies, SeedsOfACellComeTogetherInOrderWhateverTheOrderOfTheParts) {
  const TestFolder folder;
  const StudyFile a(folder / "a"), b(folder / "b"), whole(folder / "whole"), turned(folder / "turned");
  a.Put("cell", CellOfSeeds({Seed(3, 1, 5)}));
  b.Put("cell", CellOfSeeds({Seed(1, 2, 5), Seed(2, 3, 5)}));
  b.Put("other", {{"error", 0.5}, {"command", "whatever"}});
  JoinStudies({a, b}, whole, "oted plan");
  JoinStudies({b, a}, turned, "oted plan");
  EXPECT_EQ(ReadFile(whole.path()), ReadFile(turned.path()));
  EXPECT_EQ(whole.Find("cell").at("seeds"), json({Seed(1, 2, 5), Seed(2, 3, 5), Seed(3, 1, 5)}));
  EXPECT_EQ(whole.Find("other").at("command"), "oted plan");
  // Again, with a part that took longer: nothing new.
  const std::string before = ReadFile(whole.path());
  a.Put("cell", CellOfSeeds({Seed(3, 1, 99)}));
  JoinStudies({a, b}, whole, "oted plan");
  EXPECT_EQ(ReadFile(whole.path()), before);
}

TEST(JoinStudies, WhatDoesNotBelongTogetherIsRefusedAndNothingIsWritten) {
  const TestFolder folder;
  const StudyFile a(folder / "a"), b(folder / "b"), whole(folder / "whole");
  a.Put("cell", CellOfSeeds({Seed(1, 1, 5)}));
  b.Put("cell", CellOfSeeds({Seed(1, 2, 5)}));
  EXPECT_THAT(MessageOf<DataError>([&] { JoinStudies({a, b}, whole, ""); }), HasSubstr("seed 1 of the cell cell"));
  b.Put("cell", CellOfSeeds({Seed(2, 2, 5)}, 200));
  EXPECT_THAT(MessageOf<DataError>([&] {
                JoinStudies({a, b}, whole, "");
              }),
              HasSubstr("the settings of the cell cell"));
  EXPECT_FALSE(std::filesystem::exists(whole.path()));
}

}  // namespace
}  // namespace oted
