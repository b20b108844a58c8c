#include "oted/sim/mujoco/model_suspects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/sim/mujoco/mujoco_simulator.h"

namespace oted::model_suspects_test {

using testing::Contains;
using testing::Not;

std::vector<std::string> Fields(const std::vector<ParameterSpec>& specs) {
  std::vector<std::string> fields;
  for (const ParameterSpec& spec : specs) fields.push_back(spec.field);
  return fields;
}

TEST(ModelSuspects, AreWhatTheModelHasAndNobodySearches) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "gravity", .field = "opt/gravity[2]"},
                                                     {.name = "foot", .field = "geom/foot_geom/friction[0]"}});
  const std::vector<std::string> fields = Fields(factory.Suspects());
  EXPECT_THAT(fields, Contains("joint/*/damping"));
  EXPECT_THAT(fields, Contains("body/torso/mass"));
  EXPECT_THAT(fields, Not(Contains("joint/*/stiffness")));   // all of them 0
  EXPECT_THAT(fields, Not(Contains("opt/gravity[2]")));      // searched
  EXPECT_THAT(fields, Not(Contains("geom/*/friction[0]")));  // searched in part
}

TEST(ModelSuspects, StandBehindTheParametersOfTheSameSimulator) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "gain", .field = "actuator/*/gainprm[0]"}});
  const std::vector<ParameterSpec> suspects = factory.Suspects();
  const auto wider = factory.With(suspects);
  ASSERT_EQ(wider->parameters().size(), 1 + static_cast<int>(suspects.size()));
  EXPECT_EQ(wider->parameters()[0].name, "gain");
  EXPECT_EQ(wider->parameters()[1].field, suspects[0].field);
  EXPECT_EQ(wider->parameters().Nominal(), std::vector<double>(1 + suspects.size(), 1.0));
}

}  // namespace oted::model_suspects_test
