#include "oted/run/replay_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/run/artifacts.h"
#include "oted/run/replay_record.h"
#include "oted/run/sensor_noise_of.h"
#include "oted/sim/film.h"
#include "oted/sim/log_window.h"
#include "oted/sim/replay.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kWidth = 256, kHeight = 256;  // [pixels]
constexpr int kMostFrames = 64;
constexpr double kReplaySeconds = 0.5;
constexpr int kFewestSteps = 50;

/// Every `stride`-th pose.
Array2<double> Thinned(const Array2<double>& poses, int stride) {
  Array2<double> thinned;
  for (int t = 0; t < poses.rows(); t += stride) thinned.AppendRow(poses.row(t));
  return thinned;
}

Array2<double> ReplayedPoses(Simulator& simulator, const Dataset& dataset, const ReplayStart& start, int n_steps,
                             const std::vector<double>& z) {
  Array2<double> poses;
  ReplayWindows(simulator, dataset, {&start, 1}, n_steps, z, [&](int) { poses.AppendRow(simulator.pose(0)); });
  return poses;
}

/// How the robot moves in each panel, in the order of kFilmPanels.
std::array<PoseTrack, 3> Tracks(const RunSetup& run, const ShownWindow& window) {
  const auto simulator = run.factory->Make(1, 1);
  // The logged poses are drawn in the designed model's shape: the target's own is not known.
  simulator->SetParameters(0, window.designed);
  const Array2<double> logged = LoggedWindow(run.dataset, window.begin, window.n_steps);
  const auto replayed = [&](const std::vector<double>& start, const std::vector<double>& z) {
    return ReplayedPoses(*simulator, run.dataset, {window.begin, start}, window.n_steps, z);
  };
  return {{{window.designed, PosesOfObservations(*simulator, logged)},
           {window.nominal, replayed(window.nominal_start, window.nominal)},
           {window.designed, replayed(window.designed_start, window.designed)}}};
}

/// Draws `window` into `folder`. @return motion.json, with a note in place of pictures where none can be drawn
json DrawMotion(const RunSetup& run, const ShownWindow& window, const fs::path& folder) {
  json motion = {{"schema", kMotionSchema}};
  std::string why_not;
  const auto renderer = run.factory->MakeRenderer(kWidth, kHeight, &why_not);
  if (renderer == nullptr) {
    motion["note"] = why_not;
    return motion;
  }
  const std::array<PoseTrack, 3> tracks = Tracks(run, window);
  const int stride = (window.n_steps + kMostFrames) / kMostFrames;
  for (size_t i = 0; i < tracks.size(); ++i) {
    const FilmStrip strip = DrawFilm(*renderer, {tracks[i].z, Thinned(tracks[i].poses, stride)});
    const std::string file = FilmOf(kFilmPanels[i]);
    WriteFileAtomically(folder / file, strip.webp);
    motion["panels"].push_back({{"name", kFilmPanels[i]}, {"file", file}});
    motion["columns"] = strip.columns;
    motion["n_frames"] = strip.n_frames;
  }
  motion["width"] = kWidth;
  motion["height"] = kHeight;
  motion["frame_period_s"] = stride * run.spec().control_period_s;
  motion["renderer"] = renderer->description();
  return motion;
}

/// As many control steps as the configuration says; by default half a second, and at least kFewestSteps.
int ReplaySteps(const RunSetup& run) {
  if (run.config.report.replay_steps > 0) return run.config.report.replay_steps;
  const double period = run.spec().control_period_s;
  return std::max(kFewestSteps, period > 0 ? static_cast<int>(std::lround(kReplaySeconds / period)) : 0);
}

json Replayed(const RunSetup& run, const DesignRecord& design) {
  const std::vector<double> nominal = run.parameters().Nominal(), designed = design.BestMode();
  std::optional<StartFinder> finder;
  if (!run.spec().can_set_state && run.spec().can_replay()) {
    finder.emplace(*run.factory, run.dataset, SensorNoiseOf(design, run.dataset), run.context.n_threads);
  }
  return MakeReplayRecord({.factory = *run.factory,
                           .dataset = run.dataset,
                           .n_steps = ReplaySteps(run),
                           .nominal = nominal,
                           .designed = designed,
                           .starts = finder ? &*finder : nullptr,
                           .n_threads = run.context.n_threads});
}

void RemoveFilms(const Artifact& film) {
  RemoveFile(film.file);
  for (const std::string& name : film.files) RemoveFile(film.file.parent_path() / name);
}

/// Where OpenGL was missing the record holds a note alone; it may be there now.
void RemoveNote(const fs::path& file) {
  if (!fs::exists(file)) return;
  const json motion = json::parse(ReadFile(file), nullptr, false);
  if (motion.is_object() && !motion.contains("panels")) RemoveFile(file);
}

}  // namespace

void CheckCanDraw(const RunConfig& config, const SimulatorFactory& factory) {
  if (config.report.motion != Motion::kTrue) return;
  std::string why_not;
  if (factory.MakeRenderer(kWidth, kHeight, &why_not) != nullptr) return;
  throw UsageError(fmt::format("report.motion is true, but {}; or set it to auto or false", why_not));
}

void ReplayLogs(const RunSetup& run, const DesignRecord& design) {
  const Artifact artifact = ReplayArtifact(run), film = FilmArtifact(run);
  const json replay = run.directory.Once(artifact, [&] { return Replayed(run, design); });
  if (run.config.report.motion == Motion::kFalse) return RemoveFilms(film);
  const std::optional<ShownWindow> window = ShownIn(replay, artifact.file.string());
  if (!window) return;
  RemoveNote(film.file);
  run.directory.Once(film, [&] {
    RemoveFilms(film);
    return DrawMotion(run, *window, film.file.parent_path());
  });
}

}  // namespace oted
