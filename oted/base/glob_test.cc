#include "oted/base/glob.h"

#include <gtest/gtest.h>

#include <string>

namespace oted::glob_test {

TEST(MatchesGlob, WithoutWildcardsIsEquality) {
  EXPECT_TRUE(MatchesGlob("foot", "foot"));
  EXPECT_FALSE(MatchesGlob("foot", "foot2"));
  EXPECT_FALSE(MatchesGlob("foot2", "foot"));
  EXPECT_TRUE(MatchesGlob("", ""));
  EXPECT_FALSE(MatchesGlob("", "x"));
}

TEST(MatchesGlob, AStarIsAnyTextAndAQuestionMarkOneCharacter) {
  EXPECT_TRUE(MatchesGlob("*", ""));
  EXPECT_TRUE(MatchesGlob("*_vel", "foot_joint_vel"));
  EXPECT_FALSE(MatchesGlob("*_vel", "foot_joint_pos"));
  EXPECT_TRUE(MatchesGlob("l?g*", "leg_geom"));
  EXPECT_FALSE(MatchesGlob("l?g", "lg"));
  EXPECT_TRUE(MatchesGlob("*a*b", "xaxbab")) << "a later end than the first one found";
}

TEST(MatchesGlob, ManyStarsDoNotTakeForever) {
  EXPECT_FALSE(MatchesGlob("*a*a*a*a*a*a*a*a*a*a*a*a*a*a*a*b", std::string(200, 'a')));
}

}  // namespace oted::glob_test
