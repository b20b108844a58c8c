#include "examples/custom_task/thermostat.h"

#include <cmath>

#include "tests/conformance/simulator_conformance.h"

namespace oted::thermostat_test {

INSTANTIATE_TEST_SUITE_P(Thermostat, SimulatorConformance,
                         testing::Values(ConformanceCase{
                             "Thermostat", [] {
                               return std::make_unique<ThermostatFactory>(std::vector<ParameterSpec>{
                                   {.name = "loss", .field = "env/loss"}, {.name = "power", .field = "env/power"}});
                             }}));

TEST(Thermostat, CoolsDownExponentially) {
  const auto simulator = ThermostatFactory({}).Make(1, 1);
  simulator->SetStateFromObservation(0, std::vector{20.0});
  const int lane = 0;
  for (int step = 0; step < 60; ++step) simulator->Step({&lane, 1}, std::vector{-1.0});
  // An hour without heating: 100 W/K out of 5e5 J/K.
  EXPECT_NEAR(simulator->observation(0)[0], 5 + 15 * std::exp(-100.0 * 3600 / 5e5), 1e-9);
}

}  // namespace oted::thermostat_test
