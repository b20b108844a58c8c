#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"
#include "oted/sim/mujoco/testing.h"
#include "tests/conformance/simulator_conformance.h"

namespace oted::mujoco_simulator_test {

using testing::HasSubstr;

std::vector<ParameterSpec> ThreeParameters() {
  return {{.name = "friction", .field = "geom/*/friction[0]"},
          {.name = "gain", .field = "actuator/*/gainprm[0]"},
          {.name = "gravity", .field = "opt/gravity[2]"}};
}

std::vector<ParameterSpec> InertialParameters() {
  return {{.name = "mass", .field = "body/*/mass"},
          {.name = "gear", .field = "actuator/*/gear[0]"},
          {.name = "armature", .field = "joint/*/armature", .low = 0.5, .logarithmic = true},
          {.name = "floor",
           .field = "geom/floor/friction[1]",
           .low = 0.001,
           .high = 0.2,
           .scale = ParameterScale::kAbsolute}};
}

ConformanceCase Case(const std::string& name, const std::string& task, std::vector<ParameterSpec> specs) {
  return {name, [task, specs] { return std::make_unique<MujocoSimulatorFactory>(task, specs); }};
}

/// Hopper with a parameter of its own and every kind of channel around it.
ConformanceCase HopperChannels() {
  const auto channel = [](const char* name, const char* path, double high) {
    return ParameterSpec{.name = name, .field = path, .high = high, .scale = ParameterScale::kAbsolute};
  };
  std::vector<ParameterSpec> specs = {{.name = "gain", .field = "actuator/*/gainprm[0]"},
                                      channel("delay", "action/delay", 2.5),
                                      channel("noise", "obs/*/noise_std", 0.02),
                                      channel("bias", "obs/*_pos/bias", 0.05),
                                      channel("lag", "obs/*_vel/delay", 2)};
  for (ParameterSpec& spec : specs) spec.low = spec.name == "gain" ? 0.2 : 0.0;
  return {"HopperChannels", [specs] {
            return WithChannels(specs, [](std::vector<ParameterSpec> own) {
              return std::make_unique<MujocoSimulatorFactory>("Hopper-v5", std::move(own));
            });
          }};
}

std::vector<ParameterSpec> FrictionParameters() {
  const auto friction = [](const std::string& name, double high) {
    return ParameterSpec{
        .name = name, .field = "joint/@actuated/" + name, .low = 0, .high = high, .scale = ParameterScale::kAbsolute};
  };
  return {friction("stribeck_torque", 5), friction("stribeck_velocity", 2), friction("load_friction", 0.5)};
}

INSTANTIATE_TEST_SUITE_P(Mujoco, SimulatorConformance,
                         testing::Values(Case("Hopper", "Hopper-v5", ThreeParameters()),
                                         Case("HalfCheetah", "HalfCheetah-v5", ThreeParameters()),
                                         Case("Walker2d", "Walker2d-v5", ThreeParameters()), HopperChannels(),
                                         Case("HopperInertia", "Hopper-v4", InertialParameters()),
                                         Case("HalfCheetahInertia", "HalfCheetah-v4", InertialParameters()),
                                         Case("HopperFriction", "Hopper-v5", FrictionParameters())),
                         [](const auto& parameter) { return parameter.param.name; });

ConformanceCase CrawlerCase(const std::string& name, ModelTask (*make_task)(const TestFolder&)) {
  static const TestFolder folder;  // factories are made from it at any time
  return {name, [make_task] {
            return std::make_unique<MujocoSimulatorFactory>(
                make_task(folder), std::vector<ParameterSpec>{{.name = "gain", .field = "actuator/*/gainprm[0]"},
                                                              {.name = "mass", .field = "body/*/mass"}});
          }};
}

INSTANTIATE_TEST_SUITE_P(ModelTask, SimulatorConformance,
                         testing::Values(CrawlerCase("Crawler", CrawlerTask),
                                         CrawlerCase("CrawlerWithoutSettableState", BlindCrawlerTask)),
                         [](const auto& parameter) { return parameter.param.name; });

// Runs `work` in an empty working directory; returns what it wrote to stdout and stderr and the files it left.
struct SideEffects {
  std::string text;
  int n_files = 0;
};
SideEffects Observe(const std::function<void()>& work) {
  const std::filesystem::path before = std::filesystem::current_path();
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("oted_sim_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::filesystem::current_path(folder);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  work();
  SideEffects effects;
  effects.text = testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr();
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++effects.n_files;
  std::filesystem::current_path(before);
  std::filesystem::remove_all(folder);
  return effects;
}

void ResetAll(MujocoSimulator& simulator) {
  for (int lane = 0; lane < simulator.n_lanes(); ++lane) {
    Rng rng = RngKey(3).Index(static_cast<uint64_t>(lane)).MakeRng();
    simulator.Reset(lane, rng);
  }
}

// State with one velocity replaced.
std::vector<double> WithVelocity(const MujocoSimulator& simulator, int lane, double velocity) {
  const std::span<const double> state = simulator.IntegrationState(lane);
  std::vector<double> changed(state.begin(), state.end());
  changed[static_cast<size_t>(simulator.qvel(lane).data() - state.data())] = velocity;
  return changed;
}

TEST(MujocoSimulator, AnExplodingLaneIsDivergedAndItsNeighboursDoNotNotice) {
  for (int n_threads : {1, 2}) {
    for (const std::string& task : TaskNames()) {
      const SideEffects effects = Observe([&] {
        const MujocoSimulatorFactory factory(task, {});
        const auto broken = factory.MakeMujoco(3, n_threads);
        const auto sound = factory.MakeMujoco(3, n_threads);
        ResetAll(*broken);
        ResetAll(*sound);
        broken->SetIntegrationState(1, WithVelocity(*broken, 1, 1e12));
        const std::vector<double> actions(static_cast<size_t>(3 * factory.spec().act_dim), 0.3);
        const std::vector<int> lanes = {0, 1, 2};
        for (int step = 0; step < 20; ++step) {
          broken->Step(lanes, actions);
          sound->Step(lanes, actions);
          EXPECT_EQ(broken->status(1), LaneStatus::kDiverged) << task;
          EXPECT_NE(sound->status(1), LaneStatus::kDiverged) << task;
          EXPECT_EQ(broken->reward(1), 0);
          for (int lane : {0, 2}) {
            EXPECT_TRUE(std::ranges::equal(broken->IntegrationState(lane), sound->IntegrationState(lane))) << task;
            EXPECT_EQ(broken->reward(lane), sound->reward(lane));
            EXPECT_EQ(broken->status(lane), sound->status(lane));
          }
        }
        for (double v : broken->observation(1)) EXPECT_TRUE(std::isfinite(v));
        // A reset brings the lane back.
        ResetAll(*broken);
        ResetAll(*sound);
        broken->Step(lanes, actions);
        sound->Step(lanes, actions);
        EXPECT_TRUE(std::ranges::equal(broken->IntegrationState(1), sound->IntegrationState(1))) << task;
        EXPECT_EQ(broken->status(1), sound->status(1));
      });
      EXPECT_EQ(effects.text, "");
      EXPECT_EQ(effects.n_files, 0);
    }
  }
}

TEST(MujocoSimulator, AStateThatIsNotANumberIsDiverged) {
  const MujocoSimulatorFactory factory("HalfCheetah-v5", {});
  const auto simulator = factory.MakeMujoco(1, 1);
  ResetAll(*simulator);
  simulator->SetIntegrationState(0, WithVelocity(*simulator, 0, std::nan("")));
  const int lane = 0;
  const SideEffects effects = Observe([&] { simulator->Step({&lane, 1}, std::vector<double>(6, 0.0)); });
  EXPECT_EQ(simulator->status(0), LaneStatus::kDiverged);
  EXPECT_EQ(effects.text, "");
  EXPECT_EQ(effects.n_files, 0);
}

TEST(MujocoSimulator, AnActionThatIsNotFiniteIsAnErrorAndMovesNothing) {
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  const auto simulator = factory.MakeMujoco(2, 1);
  ResetAll(*simulator);
  const std::vector<double> before(simulator->IntegrationState(0).begin(), simulator->IntegrationState(0).end());
  std::vector<double> actions(6, 0.0);
  actions[4] = std::nan("");
  EXPECT_THROW(simulator->Step(std::vector{0, 1}, actions), UsageError);
  EXPECT_TRUE(std::ranges::equal(before, simulator->IntegrationState(0)));
  EXPECT_NO_THROW(simulator->Step(std::vector{0}, actions)) << "rows of other lanes are not read";
}

TEST(MujocoSimulator, AClippedVelocityDoesNotDetermineAState) {
  for (const std::string task : {"Hopper-v5", "Walker2d-v4", "HalfCheetah-v5"}) {
    const bool clips = task != "HalfCheetah-v5";
    const MujocoSimulatorFactory factory(task, {});
    const auto simulator = factory.MakeMujoco(1, 1);
    ResetAll(*simulator);
    const std::vector<double> state(simulator->IntegrationState(0).begin(), simulator->IntegrationState(0).end());
    std::vector<double> observation(simulator->observation(0).begin(), simulator->observation(0).end());
    observation.back() = -10;
    EXPECT_EQ(simulator->SetStateFromObservation(0, observation), !clips) << task;
    observation.back() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(simulator->SetStateFromObservation(0, observation));
    EXPECT_EQ(clips, std::ranges::equal(state, simulator->IntegrationState(0))) << "unchanged when refused";
    observation.pop_back();
    EXPECT_THROW(simulator->SetStateFromObservation(0, observation), UsageError);
  }
}

TEST(MujocoSimulator, TellsInWhichStatesTheTaskEnds) {
  const MujocoSimulatorFactory hopper("Hopper-v5", {}), cheetah("HalfCheetah-v5", {});
  const auto simulator = hopper.MakeMujoco(1, 1);
  std::vector<double> observation(11, 0.0);
  observation[0] = 1.25;  // height: healthy above 0.7
  EXPECT_EQ(simulator->EndsAt(0, observation), std::optional(false));
  observation[0] = 0.69;
  EXPECT_EQ(simulator->EndsAt(0, observation), std::optional(true));
  observation[0] = 1.25;
  observation[1] = 0.21;  // angle: healthy within 0.2
  EXPECT_EQ(simulator->EndsAt(0, observation), std::optional(true));
  observation[7] = 10;  // on the clip: the true velocity may be beyond every bound
  EXPECT_EQ(simulator->EndsAt(0, observation), std::nullopt);
  EXPECT_EQ(cheetah.MakeMujoco(1, 1)->EndsAt(0, std::vector<double>(17, 3.0)), std::optional(false));
}

TEST(MujocoSimulator, VelocitiesAreObservedClippedWhereGymnasiumClips) {
  for (const std::string task : {"Hopper-v4", "HalfCheetah-v4"}) {
    const MujocoSimulatorFactory factory(task, {});
    const auto simulator = factory.MakeMujoco(1, 1);
    ResetAll(*simulator);
    simulator->SetIntegrationState(0, WithVelocity(*simulator, 0, 12.5));
    const size_t index = simulator->qpos(0).size() - 1;
    EXPECT_EQ(simulator->observation(0)[index], task == "Hopper-v4" ? 10 : 12.5);
  }
}

// Largest distance between the empirical distribution and `cdf`.
double KolmogorovSmirnov(std::vector<double> sample, const std::function<double(double)>& cdf) {
  std::sort(sample.begin(), sample.end());
  double distance = 0;
  for (size_t i = 0; i < sample.size(); ++i) {
    const double n = static_cast<double>(sample.size());
    const double p = cdf(sample[i]);
    distance = std::max({distance, p - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - p});
  }
  return distance;
}

class ResetNoiseTest : public testing::TestWithParam<std::string> {};

TEST_P(ResetNoiseTest, HasTheDocumentedDistributionInEveryCoordinate) {
  const bool cheetah = GetParam().starts_with("HalfCheetah");
  const double scale = cheetah ? 0.1 : 5e-3;
  const auto uniform = [&](double x) { return std::clamp((x + scale) / (2 * scale), 0.0, 1.0); };
  const auto normal = [&](double x) { return 0.5 * std::erfc(-x / (scale * std::sqrt(2.0))); };
  const MujocoSimulatorFactory factory(GetParam(), {});
  const auto simulator = factory.MakeMujoco(1, 1);
  const std::vector<double> centre = {simulator->qpos(0).begin(), simulator->qpos(0).end()};
  constexpr int kDraws = 20000;
  std::vector<std::vector<double>> positions(centre.size()), velocities(simulator->qvel(0).size());
  Rng rng = RngKey(11).MakeRng();
  for (int i = 0; i < kDraws; ++i) {
    simulator->Reset(0, rng);
    for (size_t k = 0; k < centre.size(); ++k) positions[k].push_back(simulator->qpos(0)[k] - centre[k]);
    for (size_t k = 0; k < velocities.size(); ++k) velocities[k].push_back(simulator->qvel(0)[k]);
  }
  // 1.95 / sqrt(n) is exceeded with probability 1e-3 per coordinate; the seed is fixed.
  const double limit = 1.95 / std::sqrt(kDraws);
  for (const auto& sample : positions) EXPECT_LT(KolmogorovSmirnov(sample, uniform), limit);
  for (const auto& sample : velocities) {
    EXPECT_LT(cheetah ? KolmogorovSmirnov(sample, normal) : KolmogorovSmirnov(sample, uniform), limit);
    EXPECT_GT(cheetah ? KolmogorovSmirnov(sample, uniform) : KolmogorovSmirnov(sample, normal), 3 * limit);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryTask, ResetNoiseTest, testing::ValuesIn(TaskNames()), [](const auto& parameter) {
  std::string name = parameter.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

/// dof_damping of Hopper, in multiples of the model's, after these were set in turn.
std::vector<double> Dampings(const std::vector<ParameterSpec>& specs, const std::vector<std::vector<double>>& all_z) {
  const MujocoSimulatorFactory factory("Hopper-v5", specs);
  const auto simulator = factory.MakeMujoco(1, 1);
  for (const std::vector<double>& z : all_z) simulator->SetParameters(0, z);
  const ModelPtr model(mj_copyModel(nullptr, &factory.model()));
  simulator->CopyModel(0, *model);
  std::vector<double> multiples;
  for (int dof = 3; dof < model->nv; ++dof)
    multiples.push_back(model->dof_damping[dof] / factory.model().dof_damping[dof]);
  return multiples;
}

TEST(MujocoSimulator, MultiplesOfOnePlaceMultiplyInAnyOrderAndDoNotAddUp) {
  const ParameterSpec all = {.name = "all", .field = "joint/*/damping", .high = 3};
  const ParameterSpec knee = {.name = "knee", .field = "joint/leg_joint/damping", .high = 3};
  const auto expected = testing::Pointwise(testing::DoubleNear(1e-15), std::vector{1.5, 3.0, 1.5});
  EXPECT_THAT(Dampings({all, knee}, {{0.5, 0.7}, {1.5, 2}}), expected);
  EXPECT_THAT(Dampings({knee, all}, {{0.7, 0.5}, {2, 1.5}}), expected);
  ParameterSpec value = knee;
  value.scale = ParameterScale::kAbsolute;
  for (const auto& specs : {std::vector{all, value}, std::vector{value, all}}) {
    EXPECT_THAT([&] { MujocoSimulatorFactory("Hopper-v5", specs); },
                testing::ThrowsMessage<UsageError>(testing::AllOf(
                    HasSubstr("'all'"), HasSubstr("'knee'"),
                    HasSubstr("both set joint/leg_joint/damping; narrow one of the paths, or make both multiples"))));
  }
}

TEST(MujocoSimulator, ScaledMassesGiveTheConstantsOfAModelCompiledWithThem) {
  // Density and every body's inertia are proportional here: scaling mass and inertia is scaling the density.
  const MujocoSimulatorFactory factory(
      "Hopper-v5", {{.name = "mass", .field = "body/*/mass"}, {.name = "inertia", .field = "body/*/inertia"}});
  const auto simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, std::vector{1.5, 1.5});
  ResetAll(*simulator);
  std::ifstream file(factory.model_path());
  std::string xml((std::istreambuf_iterator<char>(file)), {});
  const size_t geom = xml.find("<geom conaffinity=\"1\" condim=\"1\"");
  ASSERT_NE(geom, std::string::npos);
  xml.insert(geom + 5, " density=\"1500\"");
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "oted_dense_hopper.xml";
  std::ofstream(path) << xml;
  const LoadedModel dense = LoadModel(path);
  std::filesystem::remove(path);
  DataPtr data(mj_makeData(dense.model.get()));
  mj_setState(dense.model.get(), data.get(), simulator->IntegrationState(0).data(), mjSTATE_INTEGRATION);
  const std::vector<double> action = {0.4, -0.3, 0.2};
  const int lane = 0;
  for (int step = 0; step < 40; ++step) {
    simulator->Step({&lane, 1}, action);
    std::copy(action.begin(), action.end(), data->ctrl);
    for (int i = 0; i < 4; ++i) mj_step(dense.model.get(), data.get());
    // The solver's tolerance is scaled by a statistic that the batch keeps at its nominal value.
    for (size_t i = 0; i < simulator->qpos(0).size(); ++i) EXPECT_NEAR(simulator->qpos(0)[i], data->qpos[i], 1e-6);
  }
}

TEST(MujocoSimulator, ScaledSizesCollideAsInAModelWhoseBoundsNeverExclude) {
  // The upright leg reaches the floor with its new length; its old bounding sphere does not.
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "leg", .field = "geom/leg_geom/size"}});
  const auto simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, std::vector{1.3});
  ResetAll(*simulator);
  const LoadedModel loaded = LoadModel(factory.model_path());
  mjModel& model = *loaded.model;
  const int leg = mj_name2id(&model, mjOBJ_GEOM, "leg_geom");
  for (int i = 0; i < 3; ++i) model.geom_size[3 * leg + i] *= 1.3;
  model.geom_rbound[leg] = 100;
  model.opt.disableflags |= mjDSBL_MIDPHASE;
  DataPtr data(mj_makeData(&model));
  mj_setState(&model, data.get(), simulator->IntegrationState(0).data(), mjSTATE_INTEGRATION);
  const int lane = 0;
  for (int step = 0; step < 100; ++step) {
    simulator->Step({&lane, 1}, std::vector(3, 0.0));
    for (int i = 0; i < 4; ++i) mj_step(&model, data.get());
    for (size_t i = 0; i < simulator->qpos(0).size(); ++i) ASSERT_EQ(simulator->qpos(0)[i], data->qpos[i]) << step;
  }
}

TEST(MujocoSimulatorFactory, MakesSimulatorsFromSeveralThreads) {
  const MujocoSimulatorFactory factory("Hopper-v5", ThreeParameters());
  std::vector<std::vector<double>> ends(8);
  ParallelFor(8, 4, [&](int i) {
    const auto simulator = factory.MakeMujoco(2, 1);
    simulator->SetParameters(1, std::vector{0.6, 1.3, 1.2});
    ResetAll(*simulator);
    for (int step = 0; step < 20; ++step) simulator->Step(std::vector{1}, std::vector(6, 0.5));
    ends[static_cast<size_t>(i)].assign(simulator->IntegrationState(1).begin(), simulator->IntegrationState(1).end());
  });
  for (const auto& end : ends) EXPECT_EQ(end, ends[0]);
}

TEST(MujocoSimulatorFactory, TellsWhichModelItUses) {
  const MujocoSimulatorFactory first("Walker2d-v4", {}), again("Walker2d-v4", ThreeParameters()),
      other("Walker2d-v5", {});
  EXPECT_EQ(first.model_sha256().size(), 64u);
  EXPECT_EQ(first.model_sha256(), again.model_sha256());
  EXPECT_NE(first.model_sha256(), other.model_sha256());
}

TEST(MujocoSimulatorFactory, RefusesWhatCannotBeSimulated) {
  EXPECT_THROW(MujocoSimulatorFactory("Hopper-v5", {}).Make(0, 1), UsageError);
  EXPECT_THROW(MujocoSimulatorFactory("Hopper-v5", {}).Make(1, 0), UsageError);
}

TEST(MujocoSimulatorFactory, FillsInTheNominalValueOfAbsoluteParameters) {
  const MujocoSimulatorFactory factory(
      "Hopper-v5",
      {{.name = "gravity", .field = "opt/gravity[2]", .low = -20, .high = -1, .scale = ParameterScale::kAbsolute}});
  EXPECT_EQ(factory.parameters().Nominal(), std::vector{-9.81});
  EXPECT_EQ(factory.parameters()[0].unit, "m/s^2");
}

TEST(MujocoSimulatorFactory, MissingModelFilesAreErrorsWithTheRemedy) {
  setenv("OTED_ASSETS", "/nonexistent", 1);
  EXPECT_THAT([] { MujocoSimulatorFactory("Hopper-v5", {}); },
              testing::ThrowsMessage<DataError>(testing::AllOf(HasSubstr("/nonexistent"), HasSubstr("OTED_ASSETS"))));
  unsetenv("OTED_ASSETS");
}

/// What lane 0 of the crawler shows after each of `commands`, from one start.
/// @param delays  of its actions, in control steps; none: there is no such parameter
std::vector<std::vector<double>> CrawlerShows(double period, const std::vector<std::vector<double>>& commands,
                                              const std::vector<double>& delays = {}) {
  const TestFolder folder;
  ModelTask task = CrawlerTask(folder);
  task.control_period = period;
  std::vector<ParameterSpec> specs = {{.name = "gravity", .field = "opt/gravity[2]"}};
  std::vector<double> z = {1.1};
  for (size_t k = 0; k < delays.size(); ++k) {
    const std::string which = delays.size() == 1 ? "" : std::to_string(k) + "/";
    specs.push_back({.name = "delay" + std::to_string(k),
                     .field = "action/" + which + "delay",
                     .low = 0,
                     .high = 3,
                     .scale = ParameterScale::kAbsolute});
    z.push_back(delays[k]);
  }
  const auto factory = WithChannels(specs, [&](std::vector<ParameterSpec> own) {
    return std::make_unique<MujocoSimulatorFactory>(task, std::move(own));
  });
  const auto simulator = factory->Make(1, 1);
  simulator->SetParameters(0, z);
  Rng rng(5);
  simulator->Reset(0, rng);
  std::vector<std::vector<double>> shown;
  const int lane = 0;
  for (const std::vector<double>& command : commands) {
    simulator->Step({&lane, 1}, command);
    shown.emplace_back(simulator->observation(0).begin(), simulator->observation(0).end());
  }
  return shown;
}

TEST(MujocoSimulator, ALateCommandArrivesBetweenTwoTimeStepsOfThePeriod) {
  constexpr int kInPeriod = 5, kPeriods = 8;  // time steps of 4 ms
  std::vector<std::vector<double>> commands;
  for (int k = 0; k < kPeriods; ++k) {
    commands.push_back({std::sin(1.0 + 2.7 * k), std::cos(1.9 * k), 0.15 * std::sin(0.3 + k)});
  }
  // In time steps, of all actions or of each; with 6.5 one of them is half and half.
  for (const std::vector<double>& late :
       std::vector<std::vector<double>>{{5}, {8}, {6.5}, {0, 6.5, 0}, {5, 0, 8}, {3.5, 1, 11.5}}) {
    const auto late_of = [&](size_t i) { return late.size() == 1 ? late[0] : late[i]; };
    std::vector<std::vector<double>> by_step;
    for (int step = 0; step < kPeriods * kInPeriod; ++step) {
      const auto given = [&](size_t i, double when) {
        const double since = when - late_of(i);
        return since < 0 ? 0.0 : commands[static_cast<size_t>(since / kInPeriod)][i];
      };
      by_step.emplace_back();
      for (size_t i = 0; i < 3; ++i) {
        const double first = given(i, step + 0.25), last = given(i, step + 0.75);
        by_step.back().push_back(first == last ? first : (first + last) / 2);
      }
    }
    std::vector<double> delays;
    for (const double steps : late) delays.push_back(steps / kInPeriod);
    const auto delayed = CrawlerShows(0.02, commands, delays), expected = CrawlerShows(0.004, by_step);
    for (size_t k = 0; k < kPeriods; ++k) {
      EXPECT_THAT(delayed[k], testing::Pointwise(testing::DoubleNear(1e-9), expected[(k + 1) * kInPeriod - 1]))
          << testing::PrintToString(late) << ", " << k;
    }
  }
}

TEST(MujocoSimulator, LanesThatAreNotLateGoOnToTheLastBitBesideOthersThatAre) {
  const MujocoSimulatorFactory factory("HalfCheetah-v5", ThreeParameters());
  const auto alone = factory.MakeMujoco(1, 1), beside = factory.MakeMujoco(2, 1);
  for (int lane = 0; lane < 2; ++lane) {
    Rng rng(7);
    beside->Reset(lane, rng);
  }
  Rng rng(7);
  alone->Reset(0, rng);
  const std::vector<int> lanes = {0, 1};
  const std::vector<double> before(12, 0.2);
  std::vector<double> share(12, 0.0);
  std::fill(share.begin() + 6, share.end(), 0.37);
  for (int step = 0; step < 20; ++step) {
    std::vector<double> action(6), of_both;
    for (size_t k = 0; k < 6; ++k) action[k] = std::sin(1.3 * step + static_cast<double>(k));
    of_both = action;
    of_both.insert(of_both.end(), action.begin(), action.end());
    alone->Step({lanes.data(), 1}, action);
    beside->StepLate(lanes, of_both, {.before = before, .share = share});
    EXPECT_THAT(beside->observation(0), testing::ElementsAreArray(alone->observation(0)));
    EXPECT_EQ(beside->reward(0), alone->reward(0));
  }
  EXPECT_NE(beside->observation(1)[8], beside->observation(0)[8]);
}

}  // namespace oted::mujoco_simulator_test
