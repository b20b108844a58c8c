#include "python/simulators.h"

#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/film.h"
#include "oted/sim/log_window.h"
#include "oted/sim/mujoco/task.h"
#include "python/study.h"

namespace oted::python {
namespace {

class Lanes {
 public:
  Lanes(const Study& study, int n_lanes, int n_threads) {
    const nb::gil_scoped_release release;
    const RunConfig config = ExpandPresets(study.Config());
    task_ = config.task;
    Array2<double> starts;
    if (task_.has_model() && task_.model.starts_in_logs()) {
      starts = ReadEpisodes(config.data, SpecOf(task_)).EpisodeStarts();
    }
    factory_ = study.Factory(config, starts);
    lanes_ = factory_->Make(n_lanes, n_threads);
    observations_ = Array2<double>(n_lanes, factory_->spec().obs_dim());
    rewards_.resize(static_cast<size_t>(n_lanes));
    status_.resize(static_cast<size_t>(n_lanes));
  }

  int n_lanes() const { return lanes_->n_lanes(); }
  std::vector<double> Nominal() const { return factory_->parameters().Nominal(); }

  void SetParameters(int lane, const InArray& z) {
    CheckLane(lane);
    lanes_->SetParameters(lane, Values(z));
  }
  void Reset(int lane, uint64_t seed) {
    CheckLane(lane);
    Rng rng = RngKey(seed).Stage("python reset").MakeRng();
    lanes_->Reset(lane, rng);
    Show(lane);
  }
  void ResetTo(int lane, const InArray& qpos, const InArray& qvel, uint64_t seed) {
    CheckLane(lane);
    Rng rng = RngKey(seed).Stage("python reset").MakeRng();
    lanes_->ResetTo(lane, Values(qpos), Values(qvel), rng);
    Show(lane);
  }
  /// Into the state of one row of the logs, with what was logged before it on its way through delays. Velocities that
  /// no observation shows are the rates of their positions. False where the row shows no state: the lane is then
  /// unchanged.
  bool SetToRow(int lane, const Dataset& logs, int row) {
    CheckLane(lane);
    const SimulatorSpec& spec = factory_->spec();
    const LogWindow window = WindowAt(logs, row, 1);
    const LoggedHistory before = HistoryBefore(logs, window);
    if (spec.can_set_state) {
      if (!lanes_->SetStateFromLog(lane, logs.observations.row(row), before)) return false;
    } else {
      std::vector<double> state(logs.observations.row(row).begin(), logs.observations.row(row).end());
      const int first = std::max(window.episode_begin, row - 1);
      for (const HiddenCoordinate& hidden : spec.hidden) {
        const double change =
            hidden.rate_of < 0 ? 0
                               : logs.next_observations(row, hidden.rate_of) - logs.observations(first, hidden.rate_of);
        state.push_back(change / ((row - first + 1) * spec.control_period_s));
      }
      if (!lanes_->SetState(lane, state, before)) return false;
    }
    Show(lane);
    return true;
  }
  bool CanReplay() const { return factory_->spec().can_replay(); }
  /// (rows, numbers of a pose): NaN where a row shows no state. Uses lane 0.
  OutArray LoggedPoses(const Dataset& logs, int begin, int end) {
    Array2<double> poses;
    if (factory_->spec().can_set_state) {
      const std::vector<Episode> rows = {{begin, end, false}};
      poses = PosesOfObservations(*lanes_, logs.Select(rows).observations);
    } else {
      poses = Array2<double>(end - begin, static_cast<int>(lanes_->pose(0).size()), std::nan(""));
      for (int row = begin; row < end; ++row) {
        if (!SetToRow(0, logs, row)) continue;
        std::copy(lanes_->pose(0).begin(), lanes_->pose(0).end(), poses.row(row - begin).begin());
      }
    }
    return ToNumpy<double>(poses.values(), {static_cast<size_t>(poses.rows()), static_cast<size_t>(poses.cols())});
  }

  /// One control period of the listed lanes; `actions` has a row for every lane.
  void Step(const std::vector<int>& lanes, const InArray& actions) {
    for (const int lane : lanes) CheckLane(lane);
    const auto wanted = static_cast<size_t>(n_lanes()) * static_cast<size_t>(factory_->spec().act_dim);
    if (actions.size() != wanted) {
      throw UsageError(
          fmt::format("got {} numbers of actions, wanted {} for {} environments", actions.size(), wanted, n_lanes()));
    }
    const std::span<const double> values = Values(actions);
    const nb::gil_scoped_release release;
    lanes_->Step(lanes, values);
    for (const int lane : lanes) {
      Show(lane);
      rewards_[static_cast<size_t>(lane)] = lanes_->reward(lane);
      status_[static_cast<size_t>(lane)] = static_cast<uint8_t>(lanes_->status(lane));
    }
  }

  OutArray Observations() const {
    return ToNumpy<double>(observations_.values(),
                           {static_cast<size_t>(observations_.rows()), static_cast<size_t>(observations_.cols())});
  }
  OutArray Rewards() const { return ToNumpy<double>(rewards_, {rewards_.size()}); }
  nb::ndarray<nb::numpy, uint8_t> Status() const { return ToNumpy<uint8_t>(status_, {status_.size()}); }
  OutArray Pose(int lane) const {
    CheckLane(lane);
    const std::span<const double> pose = lanes_->pose(lane);
    return ToNumpy<double>(pose, {pose.size()});
  }

  /// (height, width, 3), the lane as it stands, drawn with parameters z.
  nb::ndarray<nb::numpy, uint8_t> Draw(int lane, const InArray& z, int width, int height) {
    CheckLane(lane);
    if (!renderer_ || renderer_->width() != width || renderer_->height() != height) {
      std::string why_not;
      renderer_ = factory_->MakeRenderer(width, height, &why_not);
      if (!renderer_) throw DataError(fmt::format("nothing can be drawn: {}", why_not));
    }
    const std::vector<uint8_t>& picture = renderer_->Draw(Values(z), lanes_->pose(lane));
    return ToNumpy<uint8_t>(picture, {static_cast<size_t>(height), static_cast<size_t>(width), 3});
  }

  /// How Gymnasium's own task of this name draws its starts: (half width of the noise on positions, the same on
  /// velocities or their standard deviation, whether that is normal); empty for other tasks.
  std::optional<std::pair<double, bool>> GymnasiumNoise() const {
    if (task_.has_model() || task_.is_grid()) return std::nullopt;
    const std::vector<std::string> names = TaskNames();
    if (std::find(names.begin(), names.end(), task_.name) == names.end()) return std::nullopt;
    const MujocoTask& task = FindTask(task_.name);
    return std::pair(task.reset_noise_scale, task.reset_noise == ResetNoise::kUniformPositionsNormal);
  }

 private:
  void CheckLane(int lane) const {
    if (lane >= 0 && lane < n_lanes()) return;
    throw UsageError(fmt::format("environment {} does not exist, there are {}", lane, n_lanes()));
  }
  void Show(int lane) {
    const std::span<const double> shown = lanes_->observation(lane);
    std::copy(shown.begin(), shown.end(), observations_.row(lane).begin());
  }

  TaskConfig task_;
  std::unique_ptr<SimulatorFactory> factory_;
  std::unique_ptr<Simulator> lanes_;
  std::unique_ptr<Renderer> renderer_;
  Array2<double> observations_;
  std::vector<double> rewards_;
  std::vector<uint8_t> status_;
};

}  // namespace

void AddSimulators(nb::module_& m) {
  nb::class_<Lanes>(m, "Lanes")
      .def(nb::init<const Study&, int, int>(), nb::arg("study"), nb::arg("n_lanes"), nb::arg("n_threads"))
      .def_prop_ro("n_lanes", &Lanes::n_lanes)
      .def("nominal", &Lanes::Nominal)
      .def("set_parameters", &Lanes::SetParameters, nb::arg("lane"), nb::arg("z"))
      .def("reset", &Lanes::Reset, nb::arg("lane"), nb::arg("seed"))
      .def("reset_to", &Lanes::ResetTo, nb::arg("lane"), nb::arg("qpos"), nb::arg("qvel"), nb::arg("seed"))
      .def_prop_ro("can_replay", &Lanes::CanReplay)
      .def("set_to_row", &Lanes::SetToRow, nb::arg("lane"), nb::arg("logs"), nb::arg("row"))
      .def("logged_poses", &Lanes::LoggedPoses, nb::arg("logs"), nb::arg("begin"), nb::arg("end"))
      .def("step", &Lanes::Step, nb::arg("lanes"), nb::arg("actions"))
      .def("observations", &Lanes::Observations)
      .def("rewards", &Lanes::Rewards)
      .def("status", &Lanes::Status)
      .def("pose", &Lanes::Pose, nb::arg("lane"))
      .def("draw", &Lanes::Draw, nb::arg("lane"), nb::arg("z"), nb::arg("width"), nb::arg("height"))
      .def("gymnasium_noise", [](const Lanes& lanes) -> nb::object {
        const auto noise = lanes.GymnasiumNoise();
        return noise ? nb::object(nb::make_tuple(noise->first, noise->second)) : nb::object(nb::none());
      });
  m.attr("TERMINATED") = static_cast<int>(LaneStatus::kTerminated);
  m.attr("TRUNCATED") = static_cast<int>(LaneStatus::kTruncated);
  m.attr("DIVERGED") = static_cast<int>(LaneStatus::kDiverged);
}

}  // namespace oted::python
