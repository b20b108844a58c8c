#include "oted/sim/mujoco/render.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <numeric>

#include "oted/base/testing.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/film.h"
#include "oted/sim/mujoco/render_context.h"

#if defined(__SANITIZE_ADDRESS__)
// Mesa unloads its driver with some bytes still allocated, which can then be told from our own no more: here the
// sanitizer looks for wrong accesses alone.
extern "C" __attribute__((visibility("default"))) int __lsan_is_turned_off() { return 1; }
#endif

namespace oted::render_test {

using testing::HasSubstr;

constexpr int kWidth = 320, kHeight = 240;

/// The environment variable for one test.
class ScopedGl {
 public:
  explicit ScopedGl(const char* value) : before_(std::getenv("MUJOCO_GL") ? std::getenv("MUJOCO_GL") : "") {
    ::setenv("MUJOCO_GL", value, 1);
  }
  ~ScopedGl() { before_.empty() ? ::unsetenv("MUJOCO_GL") : ::setenv("MUJOCO_GL", before_.c_str(), 1); }

 private:
  std::string before_;
};

class RenderTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string why_not;
    renderer_ = factory_.MakeRenderer(kWidth, kHeight, &why_not);
    if (renderer_ == nullptr) GTEST_SKIP() << why_not;
  }
  std::vector<double> Standing() { return {0, 1.25, 0, 0, 0, 0}; }

  MujocoSimulatorFactory factory_{"Hopper-v5",
                                  {{.name = "torso", .field = "geom/torso_geom/size[0]", .low = 0.2, .high = 3}}};
  std::unique_ptr<Renderer> renderer_;
};

// Pixels that differ visibly.
int Difference(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  int n = 0;
  for (size_t i = 0; i < a.size(); i += 3) {
    n += std::abs(a[i] - b[i]) + std::abs(a[i + 1] - b[i + 1]) + std::abs(a[i + 2] - b[i + 2]) > 30;
  }
  return n;
}

TEST(RenderContextTest, TurnedOffItSaysSo) {
  const ScopedGl off("off");
  std::string why_not;
  EXPECT_EQ(RenderContext::Make(&why_not), nullptr);
  EXPECT_THAT(why_not, HasSubstr("MUJOCO_GL=off"));
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  why_not.clear();
  EXPECT_EQ(factory.MakeRenderer(kWidth, kHeight, &why_not), nullptr);
  EXPECT_THAT(why_not, HasSubstr("unset it"));
}

TEST_F(RenderTest, APictureHasTheAskedSizeAndTheRobotStandsInItsMiddle) {
  const std::vector<uint8_t> picture = renderer_->Draw(std::vector{1.0}, Standing());
  ASSERT_EQ(picture.size(), 3u * kWidth * kHeight);
  // Without the robot (below the floor) only its own pixels change, and they lie around the picture's middle column.
  const std::vector<uint8_t> empty = renderer_->Draw(std::vector{1.0}, std::vector<double>{0, 50, 0, 0, 0, 0});
  EXPECT_GT(Difference(picture, empty), 500);
  const auto mean = std::accumulate(picture.begin(), picture.end(), 0.0) / static_cast<double>(picture.size());
  double variance = 0;
  for (const uint8_t v : picture) variance += (v - mean) * (v - mean) / static_cast<double>(picture.size());
  EXPECT_GT(std::sqrt(variance), 20) << "a blank picture";
}

TEST(RenderBareModelTest, AModelWithoutSkyAndLightsStandsOutFromALightBackground) {
  const TestFolder folder;
  WriteFileAtomically(folder / "bare.xml", R"(<mujoco><worldbody><body><joint name="hip" axis="0 1 0"/>
    <geom type="capsule" size=".05" fromto="0 0 0 0 0 .5" rgba=".1 .1 .1 1"/></body></worldbody>
    <actuator><motor joint="hip" ctrlrange="-1 1"/></actuator></mujoco>)");
  ModelTask task;
  task.name = "bare";
  task.model = folder / "bare.xml";
  task.control_period = 0.02;
  task.observations = {"joint/hip/qpos", "joint/hip/qvel"};
  const MujocoSimulatorFactory factory(task, {});
  std::string why_not;
  const auto renderer = factory.MakeRenderer(kWidth, kHeight, &why_not);
  if (renderer == nullptr) GTEST_SKIP() << why_not;
  const std::vector<uint8_t> picture = renderer->Draw({}, std::vector{0.3});
  EXPECT_GT(picture.front(), 200);
  EXPECT_LT(*std::min_element(picture.begin(), picture.end()), 120);
  // The robot is a small part of the picture, and the rest is one colour.
  const auto n_background = std::count(picture.begin(), picture.end(), picture.front());
  EXPECT_GT(n_background, 3 * kWidth * kHeight / 2);
  EXPECT_LT(n_background, 3 * kWidth * kHeight - 300);
}

TEST_F(RenderTest, TheSamePoseGivesTheSamePictureAndAnotherOneAnother) {
  const std::vector<uint8_t> first = renderer_->Draw(std::vector{1.0}, Standing());
  const std::vector<double> bent = {0, 1.25, 0, -0.5, -0.5, 0.5};
  EXPECT_GT(Difference(first, renderer_->Draw(std::vector{1.0}, bent)), 300);
  EXPECT_EQ(Difference(first, renderer_->Draw(std::vector{1.0}, Standing())), 0);
}

TEST_F(RenderTest, AParameterThatChangesAShapeChangesThePicture) {
  const std::vector<uint8_t> thin = renderer_->Draw(std::vector{0.2}, Standing());
  const std::vector<uint8_t> thick = renderer_->Draw(std::vector{3.0}, Standing());
  EXPECT_GT(Difference(thin, thick), 300);
  EXPECT_EQ(Difference(thin, renderer_->Draw(std::vector{0.2}, Standing())), 0);
}

TEST_F(RenderTest, AStripHoldsEveryPoseInItsPlace) {
  PoseTrack track{{1.0}, Array2<double>(10, 6)};
  for (int t = 0; t < 10; ++t) {
    const std::vector<double> pose = Standing();
    std::copy(pose.begin(), pose.end(), track.poses.row(t).begin());
    track.poses(t, 3) = -0.1 * t;
  }
  track.poses(9, 0) = NAN;  // shows the pose before it
  const FilmStrip strip = DrawFilm(*renderer_, track);
  EXPECT_EQ(strip.columns, 8);
  EXPECT_EQ(strip.n_frames, 10);
  const TestFolder folder;
  WriteFileAtomically(folder / "strip.webp", strip.webp);
  const auto save = [&](int t) {
    const auto& rgb = renderer_->Draw(track.z, track.poses.row(t));
    WriteFileAtomically(folder / fmt::format("{}.rgb", t), {reinterpret_cast<const char*>(rgb.data()), rgb.size()});
  };
  save(0);
  save(8);
  EXPECT_TRUE(RunPython(R"(
import numpy as np
from PIL import Image
strip = np.asarray(Image.open('strip.webp').convert('RGB')).astype(int)
assert strip.shape == (2 * 240, 8 * 320, 3), strip.shape
frame = lambda t: strip[t // 8 * 240:, t % 8 * 320:][:240, :320]
read = lambda t: np.fromfile(f'{t}.rgb', np.uint8).reshape(240, 320, 3).astype(int)
for t in (0, 8):
    error = [np.abs(frame(k) - read(t)).mean() for k in range(10)]
    assert min(error) < 6, error
    assert error[t] == min(error), (t, error)
assert np.abs(frame(9) - frame(8)).mean() < 2
)",
                        folder));
}

/// Hopper with the parameter of RenderTest and an action delay before it.
std::unique_ptr<SimulatorFactory> DelayedHopper() {
  return WithChannels(
      {{.name = "delay", .field = "action/delay", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute},
       {.name = "torso", .field = "geom/torso_geom/size[0]", .low = 0.2, .high = 3}},
      [](std::vector<ParameterSpec> own) {
        return std::make_unique<MujocoSimulatorFactory>("Hopper-v5", std::move(own));
      });
}

TEST_F(RenderTest, ATaskWithAnActionDelayIsDrawnAsOneWithout) {
  const auto delayed = DelayedHopper();
  std::string why_not;
  const auto renderer = delayed->MakeRenderer(kWidth, kHeight, &why_not);
  ASSERT_NE(renderer, nullptr) << why_not;
  const auto simulator = delayed->Make(1, 1), plain = factory_.Make(1, 1);
  simulator->SetParameters(0, std::vector{2.0, 3.0});
  plain->SetParameters(0, std::vector{3.0});
  Array2<double> observations(1, 11, 0.1);
  observations(0, 0) = 1.25;
  const Array2<double> poses = PosesOfObservations(*simulator, observations);
  EXPECT_EQ(poses, PosesOfObservations(*plain, observations));
  EXPECT_EQ(DrawFilm(*renderer, {{2.0, 3.0}, poses}).webp, DrawFilm(*renderer_, {{3.0}, poses}).webp);
}

TEST(RenderContextTest, WithoutOpenGlATaskWithAnActionDelaySaysTheSame) {
  const ScopedGl off("off");
  std::string why_not;
  EXPECT_EQ(DelayedHopper()->MakeRenderer(kWidth, kHeight, &why_not), nullptr);
  EXPECT_THAT(why_not, HasSubstr("MUJOCO_GL=off"));
}

TEST(PosesOfObservationsTest, TheRootTravelsByItsLoggedVelocity) {
  const MujocoSimulatorFactory factory("HalfCheetah-v5", {});
  const auto simulator = factory.MakeMujoco(1, 1);
  std::vector<double> start(17, 0.0);
  start[8] = 3;  // the root's speed [m/s]
  ASSERT_TRUE(simulator->SetStateFromObservation(0, start));
  Array2<double> observations, truth;
  const std::vector<int> lanes = {0};
  const double x0 = simulator->qpos(0)[0];
  for (int t = 0; t < 40; ++t) {
    observations.AppendRow(simulator->observation(0));
    truth.AppendRow(simulator->qpos(0));
    simulator->Step(lanes, std::vector<double>{0.3, -0.3, 0.3, -0.3, 0.3, -0.3});
  }
  const Array2<double> poses = PosesOfObservations(*simulator, observations);
  double distance = 0;
  for (int t = 0; t < poses.rows(); ++t) {
    for (int q = 1; q < 9; ++q) EXPECT_EQ(poses(t, q), truth(t, q));
    // The trapezoidal rule over control periods of 50 ms against MuJoCo's steps of 10 ms within them.
    EXPECT_NEAR(poses(t, 0), truth(t, 0) - x0, 0.05);
    distance = std::max(distance, std::abs(truth(t, 0) - x0));
  }
  EXPECT_GT(distance, 0.2) << "it did not travel: nothing was tested";
}

TEST(PosesOfObservationsTest, AnObservationOnTheClipHasNoPose) {
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  const auto simulator = factory.MakeMujoco(1, 1);
  Array2<double> observations(2, 11, 0.5);
  observations(1, 10) = 10;  // Hopper's observed velocities end there
  const Array2<double> poses = PosesOfObservations(*simulator, observations);
  EXPECT_EQ(poses(0, 1), 0.5);
  EXPECT_TRUE(std::isnan(poses(1, 1)));
}

}  // namespace oted::render_test
