#pragma once
/// motion/replay.json (schema oted.replay/1, docs/file_formats.md): the logs beside their replay in the nominal and in
/// the designed simulator.

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/replay.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/start_finder.h"

namespace oted {

inline constexpr const char* kReplaySchema = "oted.replay/1";
/// Of motion.json, which names the films of the shown window.
inline constexpr const char* kMotionSchema = "oted.motion/1";
inline constexpr std::array<const char*, 3> kFilmPanels = {"logged", "nominal", "designed"};
/// "nominal.webp"
std::string FilmOf(const std::string& panel);

/// What is replayed. What it refers to must outlive the call.
struct ReplayRequest {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  int n_steps;  ///< control steps that are predicted
  const std::vector<double>& nominal;
  const std::vector<double>& designed;
  StartFinder* starts = nullptr;  ///< where logs show a state in part; null: replays start as logged
  int n_threads = 1;
};

/// Replays up to 32 windows of the logs at both parameters. The record has the error over the steps of all windows, and
/// every channel of one window: the one whose error in the designed simulator is the median, neither the best nor the
/// worst. Channels stand in the order of their error in the nominal simulator over all windows, largest first.
///
/// Where nothing can be replayed (no settable state, no stretch of `n_steps` rows) it has a `note` that says why, and
/// neither.
nlohmann::json MakeReplayRecord(const ReplayRequest& request);

/// The window whose channels the record has.
struct ShownWindow {
  int begin = 0;    ///< row of the logs
  int n_steps = 0;  ///< control steps
  std::vector<double> nominal = {}, designed = {};
  std::vector<double> nominal_start = {}, designed_start = {};  ///< as ReplayStart::state
};
/// None where nothing could be replayed. @param where  the record's file, for errors. @throws DataError
std::optional<ShownWindow> ShownIn(const nlohmann::json& replay, const std::string& where);

}  // namespace oted
