// The truths: the masses that were read off MuJoCo before 2.1.1, an integral worked by hand, and Gymnasium's v4 model
// with inertias that tests/oracle/gymnasium_rollouts.py computes on its own.

#include "oted/sim/mujoco/legacy_inertia.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"

namespace oted::legacy_inertia_test {

using testing::HasSubstr;

LoadedModel Load(const std::string& task) {
  return LoadModel(AssetFolder() / FindTask(task).xml_file, FindTask(task).legacy_capsules);
}

double MassOf(const mjModel& model, const char* body) { return model.body_mass[mj_name2id(&model, mjOBJ_BODY, body)]; }

// R diag(inertia) R^T of a body, in the body's frame.
std::array<double, 9> Tensor(const double* inertia, const double* quat) {
  double r[9];
  mju_quat2Mat(r, quat);
  std::array<double, 9> tensor{};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      for (size_t k = 0; k < 3; ++k) tensor[3 * i + j] += r[3 * i + k] * inertia[k] * r[3 * j + k];
    }
  }
  return tensor;
}

TEST(LegacyCapsule, IsTheIntegralOverACylinder) {
  const double r = 0.3, half = 0.4, height = 2 * half + r, density = 700;
  const MassAndInertia capsule = LegacyCapsule(r, half, density);
  EXPECT_NEAR(capsule.mass, density * std::numbers::pi * r * r * height, 1e-9);
  // Midpoint sums over slices of the cylinder and rings of each slice.
  constexpr int kN = 2000;
  double across = 0, along = 0;
  for (int i = 0; i < kN; ++i) {
    const double z = height * ((i + 0.5) / kN - 0.5), slice = capsule.mass / kN;
    across += slice * z * z;
    const double rho = r * (i + 0.5) / kN, ring = capsule.mass * 2 * rho / (r * r) * r / kN;
    along += ring * rho * rho;
    across += ring * rho * rho / 2;
  }
  EXPECT_NEAR(capsule.moments[0], across, 1e-5 * across);
  EXPECT_EQ(capsule.moments[0], capsule.moments[1]);
  EXPECT_NEAR(capsule.moments[2], along, 1e-5 * along);
}

TEST(LegacyEngine, BodiesWeighWhatD4rlsEngineGaveThem) {
  // To the digits in which they are known.
  const std::map<std::string, std::map<const char*, double>> masses = {
      {"Hopper-v2", {{"torso", 3.5343}, {"thigh", 3.9270}, {"leg", 2.7143}, {"foot", 5.0894}}},
      {"Walker2d-v2",
       {{"torso", 3.5343},
        {"thigh", 3.9270},
        {"leg", 2.7143},
        {"foot", 2.9405},
        {"thigh_left", 3.9270},
        {"leg_left", 2.7143},
        {"foot_left", 2.9405}}}};
  const std::map<std::string, double> totals = {{"Hopper-v2", 15.265}, {"Walker2d-v2", 22.698}};
  for (const auto& [task, bodies] : masses) {
    const LoadedModel loaded = Load(task);
    for (const auto& [body, mass] : bodies) EXPECT_NEAR(MassOf(*loaded.model, body), mass, 0.5e-4) << task << body;
    EXPECT_NEAR(mj_getTotalmass(loaded.model.get()), totals.at(task), 0.5e-3) << task;
  }
  const LoadedModel cheetah = Load("HalfCheetah-v2");
  EXPECT_NEAR(MassOf(*cheetah.model, "torso"), 6.360, 0.5e-3);
  EXPECT_NEAR(MassOf(*cheetah.model, "ffoot"), 0.850, 0.5e-3);
  EXPECT_DOUBLE_EQ(mj_getTotalmass(cheetah.model.get()), 14);
  const LoadedModel now = Load("HalfCheetah-v4");
  for (const char* body : {"bthigh", "bshin", "bfoot", "fthigh", "fshin"}) {
    const double ratio = MassOf(*cheetah.model, body) / MassOf(*now.model, body);
    EXPECT_LT(std::abs(ratio - 1), 0.025) << body;
    EXPECT_NE(ratio, 1) << body;
  }
}

TEST(LegacyEngine, TheV4ModelsAreAsBefore) {
  for (const char* file : {"hopper.xml", "half_cheetah.xml", "walker2d.xml"}) {
    const LoadedModel before = LoadModel(AssetFolder() / file);
    const LoadedModel legacy = LoadModel(AssetFolder() / file, true);
    EXPECT_EQ(LoadModel(AssetFolder() / file).sha256, before.sha256);
    EXPECT_NE(legacy.sha256, before.sha256);
    EXPECT_TRUE(legacy.model->opt.disableflags & mjDSBL_AUTORESET);
  }
  EXPECT_NEAR(MassOf(*Load("Hopper-v4").model, "torso"), 3.6652, 0.5e-4);
  EXPECT_NEAR(mj_getTotalmass(Load("Walker2d-v4").model.get()), 23.677, 0.5e-3);
}

TEST(LegacyEngine, NothingButTheMassesIsChanged) {
  const LoadedModel old = Load("Walker2d-v2"), now = Load("Walker2d-v4");
  const mjModel &a = *old.model, &b = *now.model;
  ASSERT_EQ(a.nbody, b.nbody);
  for (int i = 0; i < 3 * a.nbody; ++i) EXPECT_EQ(a.body_ipos[i], b.body_ipos[i]);
  for (int i = 0; i < 4 * a.nbody; ++i) EXPECT_EQ(a.body_iquat[i], b.body_iquat[i]);
  for (int i = 0; i < a.nbody; ++i) {
    EXPECT_EQ(a.body_simple[i], b.body_simple[i]);
    EXPECT_EQ(a.body_sameframe[i], b.body_sameframe[i]);
  }
  for (int i = 0; i < 3 * a.ngeom; ++i) {
    EXPECT_EQ(a.geom_friction[i], b.geom_friction[i]);
    EXPECT_EQ(a.geom_size[i], b.geom_size[i]);
  }
  const auto friction = [&](const char* geom) { return a.geom_friction[3 * mj_name2id(&a, mjOBJ_GEOM, geom)]; };
  EXPECT_EQ(friction("foot_geom"), 0.9);
  EXPECT_EQ(friction("foot_left_geom"), 1.9);
}

class LegacyOracle : public testing::TestWithParam<const char*> {};

TEST_P(LegacyOracle, InertiasAndFirstStepsAreThoseOfAnIndependentComputation) {
  const std::string task = GetParam();
  const TestFolder folder;
  const std::string out = folder / "oracle.npz";
  const std::string command = fmt::format("'{}' '{}/tests/oracle/gymnasium_rollouts.py' {} '{}' 2>/dev/null",
                                          OTED_TEST_PYTHON, OTED_TEST_SOURCE_DIR, task, out);
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const NpzArrays recorded = ReadNpz(out);
  const auto array = [&](const char* name) { return recorded.at(name).ToDouble(); };

  const LoadedModel loaded = Load(task);
  const mjModel& model = *loaded.model;
  const std::vector<double> mass = array("body_mass"), ipos = array("body_ipos"), iquat = array("body_iquat"),
                            inertia = array("body_inertia");
  ASSERT_EQ(mass.size(), static_cast<size_t>(model.nbody));
  for (int body = 1; body < model.nbody; ++body) {
    const size_t k = static_cast<size_t>(body);
    EXPECT_NEAR(model.body_mass[body], mass[k], 1e-12 * mass[k]);
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(model.body_ipos[3 * k + i], ipos[3 * k + i], 1e-12);
    const auto ours = Tensor(model.body_inertia + 3 * body, model.body_iquat + 4 * body);
    const auto theirs = Tensor(&inertia[3 * k], &iquat[4 * k]);
    for (size_t i = 0; i < 9; ++i) EXPECT_NEAR(ours[i], theirs[i], 1e-10 * mass[k]) << body << " " << i;
  }

  // Contacts amplify the last bits: the first steps of an episode must agree, later ones cannot.
  constexpr int kSteps = 8;
  const MujocoSimulatorFactory factory(task, {});
  const auto simulator = factory.MakeMujoco(1, 1);
  const std::vector<double> states = array("states"), lengths = array("lengths"), actions = array("actions"),
                            observations = array("observations"), rewards = array("rewards");
  const size_t n_state = states.size() / lengths.size(), act_dim = static_cast<size_t>(factory.spec().act_dim),
               obs_dim = static_cast<size_t>(factory.spec().obs_dim());
  const int lane = 0;
  double worst = 0;
  size_t row = 0;
  for (size_t episode = 0; episode < lengths.size(); ++episode) {
    simulator->SetIntegrationState(lane, std::span(states).subspan(episode * n_state, n_state));
    for (size_t step = 0; step < static_cast<size_t>(lengths[episode]); ++step, ++row) {
      if (step >= kSteps) continue;
      simulator->Step({&lane, 1}, std::span(actions).subspan(row * act_dim, act_dim));
      for (size_t i = 0; i < obs_dim; ++i) {
        worst = std::max(worst, std::abs(simulator->observation(lane)[i] - observations[row * obs_dim + i]));
      }
      worst = std::max(worst, std::abs(simulator->reward(lane) - rewards[row]));
    }
  }
  fmt::print("{}: {} episodes, first {} steps: largest difference {:.3g}\n", task, lengths.size(), kSteps, worst);
  EXPECT_LE(worst, 1e-9);
}

// How far v4 and v2 are apart after `n_steps` from one start under one sequence of actions: the largest difference of
// an observation, its mean over starts.
double Apart(const std::string& task, int n_steps) {
  const MujocoSimulatorFactory old(task + "-v2", {}), now(task + "-v4", {});
  const auto a = old.MakeMujoco(20, 1), b = now.MakeMujoco(20, 1);
  std::vector<int> lanes;
  for (int lane = 0; lane < 20; ++lane) {
    Rng rng = RngKey(1).Index(static_cast<uint64_t>(lane)).MakeRng(), same = rng;
    a->Reset(lane, rng);
    b->Reset(lane, same);
    lanes.push_back(lane);
  }
  Rng rng(2);
  std::vector<double> actions(20 * static_cast<size_t>(old.spec().act_dim));
  for (int step = 0; step < n_steps; ++step) {
    for (double& action : actions) action = rng.Uniform(-1, 1);
    a->Step(lanes, actions);
    b->Step(lanes, actions);
  }
  double mean = 0;
  for (const int lane : lanes) {
    double largest = 0;
    for (int i = 0; i < old.spec().obs_dim(); ++i) {
      const size_t k = static_cast<size_t>(i);
      largest = std::max(largest, std::abs(a->observation(lane)[k] - b->observation(lane)[k]));
    }
    mean += largest / 20;
  }
  return mean;
}

TEST(LegacyEngine, MotionDiffersFromV4ByWhatTheDocumentationSays) {
  // docs/legacy_engine.md: after one control step and after ten.
  const std::map<std::string, std::pair<double, double>> documented = {
      {"Hopper", {0.011, 0.043}}, {"HalfCheetah", {0.063, 0.85}}, {"Walker2d", {0.54, 1.2}}};
  for (const auto& [task, apart] : documented) {
    EXPECT_NEAR(Apart(task, 1), apart.first, 0.1 * apart.first) << task;
    EXPECT_NEAR(Apart(task, 10), apart.second, 0.1 * apart.second) << task;
  }
}

TEST(LegacyEngine, PaysTheHealthyBonusOnTheTerminalStep) {
  for (const char* task : {"Hopper", "Walker2d"}) {
    EXPECT_TRUE(FindTask(std::string(task) + "-v2").healthy_on_terminal);
    const MujocoSimulatorFactory factory(std::string(task) + "-v2", {});
    const auto simulator = factory.MakeMujoco(1, 1);
    Rng rng(1);
    simulator->Reset(0, rng);
    const int lane = 0;
    const std::vector<double> none(static_cast<size_t>(factory.spec().act_dim), 0.0);
    double x = simulator->qpos(0)[0];
    for (int step = 0; simulator->status(0) == LaneStatus::kRunning && step < 1000; ++step) {
      x = simulator->qpos(0)[0];
      simulator->Step({&lane, 1}, none);
    }
    ASSERT_EQ(simulator->status(0), LaneStatus::kTerminated) << "without torque it falls";
    EXPECT_NEAR(simulator->reward(0), (simulator->qpos(0)[0] - x) / 0.008 + 1, 1e-9);
  }
}

std::string Compile(const std::string& bodies, const std::string& compiler = "inertiafromgeom='true'") {
  const TestFolder folder;
  const std::string path = folder / "model.xml";
  WriteFileAtomically(path, "<mujoco><compiler " + compiler + "/><worldbody>" + bodies + "</worldbody></mujoco>");
  const LoadedModel loaded = LoadModel(path, true);
  return fmt::format("{:.6g}", loaded.model->body_mass[1]);
}

TEST(LegacyEngine, DensitiesMassesAndExplicitInertialsOfTheFileCount) {
  const auto body = [](const char* geom) { return fmt::format("<body><freejoint/>{}</body>", geom); };
  // pi r^2 (2 h + r) = 0.0314159 * 0.5
  EXPECT_EQ(Compile(body("<geom type='capsule' size='.1 .2' density='100'/>")), "1.5708");
  EXPECT_EQ(Compile(body("<geom type='capsule' size='.1 .2' mass='3'/>")), "3");
  EXPECT_EQ(Compile(body("<geom type='capsule' size='.1 .2'/><geom type='box' size='1 1 1' mass='0'/>")), "15.708");
  EXPECT_EQ(Compile(body("<geom type='sphere' size='.1' mass='2'/>")), "2") << "no capsule, no change";
  const auto explicit_one =
      body("<inertial pos='0 0 0' mass='7' diaginertia='1 1 1'/><geom type='capsule' size='.1 .2'/>");
  EXPECT_EQ(Compile(explicit_one, "inertiafromgeom='auto'"), "7");
  EXPECT_EQ(Compile(explicit_one), "15.708");
}

TEST(LegacyEngine, ABodyOfMixedGeomsIsRefusedByName) {
  const std::string mixed =
      "<body name='arm'><freejoint/><geom type='capsule' size='.1 .2'/><geom name='hand' type='box' size='1 1 "
      "1'/></body>";
  const std::string message = MessageOf<DataError>([&] { Compile(mixed); });
  EXPECT_THAT(message, HasSubstr("'arm'"));
  EXPECT_THAT(message, HasSubstr("'hand'"));
  MessageOf<DataError>([] { Compile("<geom type='sphere' size='-1'/>"); });
  MessageOf<DataError>([] { Compile("<nothing>"); });
}

INSTANTIATE_TEST_SUITE_P(EveryTask, LegacyOracle, testing::Values("Hopper-v2", "HalfCheetah-v2", "Walker2d-v2"));

}  // namespace oted::legacy_inertia_test
