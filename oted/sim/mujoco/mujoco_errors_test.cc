#include "oted/sim/mujoco/mujoco_errors.h"

#include <gmock/gmock.h>
#include <mujoco/mjbatch.h>

#include <filesystem>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::mujoco_errors_test {

using testing::HasSubstr;

std::string Pendulum(const std::string& option) {
  return "<mujoco><option " + option +
         "/><worldbody><body><joint axis='0 1 0'/><geom size='0.1'/></body></worldbody></mujoco>";
}

TEST(MujocoErrors, AnErrorOfACallIsADataErrorAndTheSimulationGoesOn) {
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  const auto simulator = factory.MakeMujoco(2, 2);
  const int lane = 0;
  for (int i = 0; i < 3; ++i) {
    const auto misuse = [&] { mjb_step(simulator->batch(), &lane, 1, 0, mjSTAGE_NONE); };
    EXPECT_THAT(MessageOf<DataError>(misuse), testing::AllOf(HasSubstr("MuJoCo"), HasSubstr("nstep")));
  }
  const double before = simulator->qpos(0)[1];
  simulator->Step(std::vector{0, 1}, std::vector<double>(6, 0.5));
  EXPECT_NE(simulator->qpos(0)[1], before);
  EXPECT_FALSE(std::filesystem::exists("MUJOCO_LOG.TXT"));
}

TEST(MujocoErrors, OptionsThatNoSimulationEndsWithAreRefused) {
  const TestFolder folder;
  for (const auto& [option, needle] : {std::pair{"timestep='nan'", "NaN"},
                                       {"timestep='inf'", "time step"},
                                       {"timestep='0'", "time step"},
                                       {"timestep='-1'", "time step"},
                                       {"gravity='0 0 nan'", "NaN"},
                                       {"gravity='0 0 inf'", "gravity"},
                                       {"viscosity='inf'", "viscosity"},
                                       {"iterations='-5'", "iterations"},
                                       {"iterations='2000000000'", "iterations"}}) {
    WriteFileAtomically(folder / "model.xml", Pendulum(option));
    EXPECT_THAT(MessageOf<DataError>([&] { LoadModel(folder / "model.xml"); }),
                testing::AllOf(HasSubstr("model.xml"), HasSubstr(needle)))
        << option;
  }
  WriteFileAtomically(folder / "model.xml", Pendulum("timestep='0.001'"));
  EXPECT_NO_THROW(LoadModel(folder / "model.xml"));
}

}  // namespace oted::mujoco_errors_test
