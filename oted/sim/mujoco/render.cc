#include "oted/sim/mujoco/render.h"

#include <fmt/format.h>
#include <mujoco/mjbatch.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/render_context.h"

namespace oted {
namespace {

constexpr int kMostGeoms = 2000;
constexpr int kMostPixels = 16384;    // each way
constexpr uint8_t kEmptySpace = 235;  // its grey where the model has no sky; MuJoCo's black hides dark robots

// Whether the model's base travels: its first body moves by itself and does not only turn.
bool HasMovingBase(const mjModel& model) {
  for (int joint = 0; joint < model.njnt; ++joint) {
    const int type = model.jnt_type[joint];
    if (model.body_parentid[model.jnt_bodyid[joint]] == 0 && (type == mjJNT_FREE || type == mjJNT_SLIDE)) return true;
  }
  return false;
}

mjvCamera ChooseCamera(const mjModel& model) {
  mjvCamera camera;
  mjv_defaultFreeCamera(&model, &camera);
  for (int i = 0; i < model.ncam; ++i) {
    if (model.cam_mode[i] != mjCAMLIGHT_TRACK && model.cam_mode[i] != mjCAMLIGHT_TRACKCOM) continue;
    camera.type = mjCAMERA_FIXED;
    camera.fixedcamid = i;
    return camera;
  }
  if (HasMovingBase(model)) {
    camera.type = mjCAMERA_TRACKING;
    camera.trackbodyid = model.jnt_bodyid[0];
  }
  return camera;
}

bool HasSky(const mjModel& model) {
  return std::find(model.tex_type, model.tex_type + model.ntex, mjTEXTURE_SKYBOX) != model.tex_type + model.ntex;
}

// The light at the camera, brighter: for a model without lights of its own, which it leaves nearly black.
void Brighten(mjvLight* headlight) {
  std::fill_n(headlight->ambient, 3, 0.4F);
  std::fill_n(headlight->diffuse, 3, 0.6F);
}

}  // namespace

struct MujocoRenderer::Scene {
  Scene(std::unique_ptr<RenderContext> gl_context, const MujocoSimulatorFactory& factory, int width_, int height_)
      : gl(std::move(gl_context)),
        simulator(factory.MakeMujoco(1, 1)),
        model(mj_copyModel(nullptr, mjb_model(simulator->batch()))),
        data(mj_makeData(model.get())),
        width(width_),
        height(height_),
        bottom_up(3 * static_cast<size_t>(width_) * static_cast<size_t>(height_)),
        picture(bottom_up.size()),
        depth(HasSky(*model) ? 0 : bottom_up.size() / 3) {
    OTED_CHECK(model != nullptr && data != nullptr);
    model->vis.global.offwidth = width;
    model->vis.global.offheight = height;
    model->vis.quality.shadowsize = 1024;  // by default 4096, most of the time of a picture of this size
    if (!HasSky(*model)) model->vis.quality.offsamples = 0;  // smoothed edges would keep some of MuJoCo's black
    mjv_defaultScene(&scene);
    mjv_defaultOption(&option);
    mjr_defaultContext(&context);
    mjv_makeScene(model.get(), &scene, kMostGeoms);
    scene.flags[mjRND_REFLECTION] = 0;
    camera = ChooseCamera(*model);
  }
  ~Scene() {
    mjv_freeScene(&scene);
    if (has_context) mjr_freeContext(&context);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  void MakeContext() {
    mjr_makeContext(model.get(), &context, mjFONTSCALE_100);
    has_context = true;
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
  }
  void DrawPose() {
    mj_kinematics(model.get(), data.get());
    mj_comPos(model.get(), data.get());
    mj_camlight(model.get(), data.get());
    mjv_updateScene(model.get(), data.get(), &option, nullptr, &camera, mjCAT_ALL, &scene);
    if (model->nlight == 0 && scene.nlight > 0) Brighten(&scene.lights[0]);
    const mjrRect viewport = {0, 0, width, height};
    mjr_render(viewport, &scene, &context);
    mjr_readPixels(bottom_up.data(), depth.empty() ? nullptr : depth.data(), viewport, &context);
    for (size_t i = 0; i < depth.size(); ++i) {
      if (depth[i] >= 1) std::fill_n(bottom_up.begin() + static_cast<ptrdiff_t>(3 * i), 3, kEmptySpace);
    }
  }

  std::unique_ptr<RenderContext> gl;  // outlives what MuJoCo keeps in it
  std::unique_ptr<MujocoSimulator> simulator;
  ModelPtr model;
  DataPtr data;
  int width, height;
  mjvScene scene;
  mjvOption option;
  mjvCamera camera;
  mjrContext context;
  bool has_context = false;
  std::vector<uint8_t> bottom_up, picture;
  std::vector<float> depth;  // empty where a sky lies behind everything
};

MujocoRenderer::MujocoRenderer(std::unique_ptr<Scene> scene) : scene_(std::move(scene)) {}
MujocoRenderer::~MujocoRenderer() = default;
int MujocoRenderer::width() const { return scene_->width; }
int MujocoRenderer::height() const { return scene_->height; }
const std::string& MujocoRenderer::description() const { return scene_->gl->description(); }

std::unique_ptr<MujocoRenderer> MujocoRenderer::Make(const MujocoSimulatorFactory& factory, int width, int height,
                                                     std::string* why_not) {
  if (width < 1 || height < 1 || width > kMostPixels || height > kMostPixels) {
    throw UsageError(
        fmt::format("got a picture of {} x {} pixels, wanted 1 to {} each way", width, height, kMostPixels));
  }
  auto gl = RenderContext::Make(why_not);
  if (gl == nullptr) return nullptr;
  auto scene = std::make_unique<Scene>(std::move(gl), factory, width, height);
  try {
    scene->MakeContext();
  } catch (const DataError& e) {
    *why_not = fmt::format("with {} it cannot be drawn ({})", scene->gl->description(), e.what());
    return nullptr;
  }
  return std::unique_ptr<MujocoRenderer>(new MujocoRenderer(std::move(scene)));
}

const std::vector<uint8_t>& MujocoRenderer::Draw(std::span<const double> z, std::span<const double> qpos) {
  Scene& scene = *scene_;
  OTED_CHECK(static_cast<int>(qpos.size()) == scene.model->nq);
  scene.simulator->SetParameters(0, z);
  mjb_getModel(scene.simulator->batch(), 0, scene.model.get());
  std::copy(qpos.begin(), qpos.end(), scene.data->qpos);
  try {
    scene.DrawPose();
  } catch (const DataError& e) {
    throw DataError(
        fmt::format("with {} the motion cannot be drawn ({}); set report.motion = false", description(), e.what()));
  }
  const size_t row = 3 * static_cast<size_t>(scene.width);
  for (size_t y = 0; y < static_cast<size_t>(scene.height); ++y) {
    std::copy_n(scene.bottom_up.end() - static_cast<ptrdiff_t>((y + 1) * row), row,
                scene.picture.begin() + static_cast<ptrdiff_t>(y * row));
  }
  return scene.picture;
}

}  // namespace oted
