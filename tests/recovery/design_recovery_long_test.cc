// The shipped five-episode datasets of medium policies come from targets that are known: the default design must find
// friction, gain and gravity from nothing but the transitions in them.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/sensor_noise.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/design_choice.h"

namespace oted::design_recovery_long_test {

// In multiples of nominal, over the three parameters.
constexpr double kLargestMeanError = 0.005;
// With sensor noise of this standard deviation on every observation, which the design is not told.
constexpr double kNoise = 0.02;
double LargestNoisyMeanError(const std::string& task) { return task == "HalfCheetah-v5" ? 0.016 : 0.03; }
constexpr int kSeeds = 3;

struct Target {
  std::string task;
  std::string data;
  std::vector<double> truth;
};

std::vector<Target> Targets() {
  std::vector<Target> targets;
  for (const auto& [task, name] : {std::pair("Hopper-v5", "hopper"), std::pair("HalfCheetah-v5", "halfcheetah"),
                                   std::pair("Walker2d-v5", "walker2d")}) {
    const std::string data = fmt::format("{}/examples/data/{}-medium", OTED_TEST_SOURCE_DIR, name);
    targets.push_back({task, data + ".hdf5", {1.0, 1.0, 1.0}});
    targets.push_back({task, data + "-shifted.hdf5", {0.6, 1.3, 1.2}});
  }
  return targets;
}

double MeanError(const std::vector<double>& mode, const std::vector<double>& truth) {
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) sum += std::abs(mode[i] - truth[i]);
  return sum / static_cast<double>(truth.size());
}

class DesignRecovery : public testing::TestWithParam<Target> {};

/// The default design with three seeds.
void ExpectRecovery(const Target& target, const Dataset& logs, double largest_error) {
  const auto& [task, data, truth] = target;
  const MujocoSimulatorFactory factory(task,
                                       {{.name = "friction", .field = "geom/*/friction[0]", .low = 0.2, .high = 2.0},
                                        {.name = "gain", .field = "actuator/*/gainprm[0]", .low = 0.2, .high = 2.0},
                                        {.name = "gravity", .field = "opt/gravity[2]", .low = 0.2, .high = 2.0}});
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 2};
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const TestFolder folder;
    const DesignConfig config = DesignChoice().Resolved(factory.parameters(), factory.spec());
    const DesignResult design =
        LearnDesign({factory, logs, nullptr, RngKey(seed), folder.path(), "design/default/1", context}, config);
    const std::vector<double> mode = design.q.Mode();
    const double error = MeanError(mode, truth);
    fmt::print("{} seed {}: friction {:.3f}, gain {:.3f}, gravity {:.3f}; mean absolute error {:.3f}\n",
               std::filesystem::path(data).stem().string(), seed, mode[0], mode[1], mode[2], error);
    EXPECT_LE(error, largest_error) << "seed " << seed;
  }
}

TEST_P(DesignRecovery, TheDefaultFindsFrictionGainAndGravity) {
  const Dataset logs = ReadDataset(GetParam().data);
  ASSERT_EQ(logs.Episodes().size(), 5u);
  ExpectRecovery(GetParam(), logs, kLargestMeanError);
}

TEST_P(DesignRecovery, AndFindsThemUnderSensorNoiseOfUnknownLevel) {
  const Dataset logs = WithSensorNoise(ReadDataset(GetParam().data), kNoise, RngKey(1).Stage("sensor noise"));
  ExpectRecovery(GetParam(), logs, LargestNoisyMeanError(GetParam().task));
}

INSTANTIATE_TEST_SUITE_P(MediumData, DesignRecovery, testing::ValuesIn(Targets()), [](const auto& target) {
  std::string name = std::filesystem::path(target.param.data).stem().string();
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace oted::design_recovery_long_test
