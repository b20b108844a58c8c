#include "oted/sim/mujoco/model_offers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <regex>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/field_info.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/task.h"

namespace oted::model_offers_test {

using testing::Contains;
using testing::ElementsAre;

/// One object of every kind that a path can name: an arm on a rail whose tendon, not its last joint, is driven.
constexpr const char* kEverything = R"(<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="cart" pos="0 0 1">
      <joint name="rail" type="slide" axis="1 0 0"/> <geom name="box" size=".1"/>
      <body name="arm"> <joint name="elbow" axis="0 1 0" damping="2"/> <geom name="rod" size=".1" pos="0 0 .3"/>
        <body name="hand" pos="0 0 .5"> <joint name="finger" type="slide"/> <geom size=".05"/> <site name="tip"/> </body>
      </body>
    </body>
    <body name="ball" pos="1 0 1"> <freejoint name="loose"/> <geom name="ball" size=".1"/> </body>
  </worldbody>
  <tendon> <fixed name="cable"> <joint joint="finger" coef="1"/> </fixed> </tendon>
  <equality> <joint name="tie" joint1="finger"/> </equality>
  <contact> <pair geom1="ball" geom2="floor"/> </contact>
  <actuator> <motor joint="elbow"/> <motor tendon="cable"/> </actuator>
</mujoco>)";

class ModelOffersTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "model.xml") << kEverything;
    loaded_ = LoadModel(folder_ / "model.xml");
  }
  const mjModel& model() const { return *loaded_.model; }
  std::vector<std::string> Places(const std::string& path) const {
    std::vector<std::string> paths;
    for (const ParameterPlace& place : DescribeModelPath(model(), path).places) paths.push_back(place.path);
    return paths;
  }
  TestFolder folder_;
  LoadedModel loaded_;
};

TEST_F(ModelOffersTest, EveryFieldThatAPathCanNameIsOfferedWithAMeaning) {
  const std::vector<ParameterOffer> offers = ModelOffers(model());
  std::vector<std::string> offered;
  for (const ParameterOffer& offer : offers) {
    offered.push_back(std::regex_replace(offer.path, std::regex("\\[k\\]$"), ""));
    EXPECT_FALSE(offer.meaning.empty()) << offer.path;
    EXPECT_FALSE(offer.places.empty()) << offer.path;
  }
  // The error for a misspelt field lists those of the model itself.
  int n_listed = 0;
  for (const std::string owner : {"geom", "body", "joint", "actuator", "site", "tendon", "equality", "pair", "opt"}) {
    const std::string prefix = owner == "opt" ? "opt/" : owner + "/*/";
    try {
      ResolvePath(model(), prefix + "xyzzy");
      FAIL();
    } catch (const UsageError& e) {
      std::string list = e.what();
      list = list.substr(list.find("there are ") + 10);
      const std::regex word("\\w+");
      for (auto it = std::sregex_iterator(list.begin(), list.end(), word); it != std::sregex_iterator(); ++it) {
        EXPECT_THAT(offered, Contains((owner == "opt" ? "opt/" : owner + "/NAME/") + it->str()));
        ++n_listed;
      }
    }
  }
  EXPECT_GT(n_listed, 80);
}

TEST_F(ModelOffersTest, EveryOfferedPlaceIsAPathToItsOwnNumber) {
  for (const ParameterOffer& offer : ModelOffers(model())) {
    for (const ParameterPlace& place : offer.places) {
      if (place.path.find("(dof") != std::string::npos) continue;  // no path reaches one of a free joint's
      const ModelField field = ResolvePath(model(), place.path).front();
      ASSERT_EQ(field.nominal.size(), 1u) << place.path;
      EXPECT_EQ(field.nominal[0], place.nominal) << place.path;
      EXPECT_THAT(field.places, ElementsAre(place.path));
    }
  }
}

TEST_F(ModelOffersTest, UnitsFollowTheKindOfJointAndTheNumberOfAnObject) {
  const auto unit = [&](const std::string& path) { return DescribeModelPath(model(), path).unit; };
  EXPECT_EQ(unit("joint/elbow/damping"), "N m s/rad");
  EXPECT_EQ(unit("joint/rail/damping"), "N s/m");
  EXPECT_EQ(unit("joint/*/damping"), "N s/m | N m s/rad");
  EXPECT_EQ(unit("actuator/#1/forcerange"), "N");
  EXPECT_EQ(unit("geom/*/friction[0]"), "");
  EXPECT_EQ(unit("geom/*/friction[1]"), "m");
  EXPECT_EQ(unit("opt/gravity[2]"), "m/s^2");
}

TEST_F(ModelOffersTest, ActuatedStandsForWhatActuatorsDriveAlsoThroughTendons) {
  EXPECT_THAT(Places("joint/@actuated/damping"), ElementsAre("joint/elbow/damping", "joint/finger/damping"));
  EXPECT_THAT(Places("body/@actuated/mass"), ElementsAre("body/arm/mass", "body/hand/mass"));
  EXPECT_THROW(ResolvePath(model(), "geom/@actuated/friction"), UsageError) << "geoms are not driven";
}

}  // namespace oted::model_offers_test
