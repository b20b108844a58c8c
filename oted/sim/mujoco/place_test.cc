#include "oted/sim/mujoco/place.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

namespace oted::place_test {

/// The entries of qpos that are places, of a model with these elements.
std::vector<int> Places(const std::string& world, const std::string& root, const std::string& more = "") {
  const std::string xml = "<mujoco><worldbody>" + world + "<body name='torso' pos='0 0 1'>" + root +
                          "<geom size='0.1'/><body><joint name='leg' axis='0 1 0'/><geom size='0.1' pos='0 0 -0.3'/>"
                          "</body></body></worldbody>" +
                          more + "</mujoco>";
  char error[500] = "";
  mjSpec* spec = mj_parseXMLString(xml.c_str(), nullptr, error, sizeof(error));
  EXPECT_NE(spec, nullptr) << error;
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  EXPECT_NE(model, nullptr);
  std::vector<int> places;
  for (int i = 0; i < model->nq; ++i) {
    if (IsPlace(*model, i)) places.push_back(i);
  }
  return places;
}

const std::string kFloor = "<geom type='plane' size='5 5 1'/>", kFree = "<freejoint/>";
const std::string kPlanar =
    "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 0 1'/><joint type='hinge' axis='0 1 0'/>";

TEST(IsPlace, AFreeBaseOverAFloorHasTwoAndAPlanarOneHasOne) {
  EXPECT_EQ(Places(kFloor, kFree), (std::vector<int>{0, 1}));
  EXPECT_EQ(Places(kFloor, kPlanar), std::vector<int>{0});
  EXPECT_EQ(Places("", kFree), (std::vector<int>{0, 1, 2})) << "nothing to stand on";
}

TEST(IsPlace, WhatCanBeHitOrTurnsTheAxisOrHoldsIsNone) {
  EXPECT_TRUE(Places(kFloor + "<geom type='box' size='0.1 0.1 0.1' pos='3 0 0'/>", kFree).empty());
  EXPECT_EQ(Places(kFloor + "<geom type='box' size='0.1 0.1 0.1' contype='0' conaffinity='0'/>", kFree).size(), 2u)
      << "a picture of a box stops nobody";
  EXPECT_TRUE(Places("<geom type='plane' size='5 5 1' euler='0 10 0'/>", kPlanar).empty()) << "a slope";
  EXPECT_TRUE(Places(kFloor, "<joint type='hinge' axis='0 1 0'/><joint type='slide' axis='1 0 0'/>").empty());
  EXPECT_TRUE(Places(kFloor, "<joint type='slide' axis='1 0 0' stiffness='2'/>").empty());
  EXPECT_TRUE(Places(kFloor, "<joint type='slide' axis='1 0 0' limited='true' range='-1 1'/>").empty());
  EXPECT_TRUE(
      Places(kFloor, "<joint name='x' type='slide' axis='1 0 0'/>", "<actuator><position joint='x'/></actuator>")
          .empty());
}

TEST(IsPlace, ASecondTreeIsSomethingToMeet) {
  EXPECT_TRUE(Places(kFloor + "<body pos='2 0 1'><freejoint/><geom size='0.1'/></body>", kFree).empty());
}

}  // namespace oted::place_test
