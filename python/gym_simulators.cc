#include "python/gym_simulators.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/config/task_registry.h"
#include "oted/sim/simulator.h"

namespace oted::python {
namespace {

using nlohmann::json;
using SteadyClock = std::chrono::steady_clock;

constexpr auto kStopPatience = std::chrono::seconds(2);
constexpr uint64_t kSeeds = uint64_t{1} << 31;  // what Gymnasium's environments take
constexpr const char* kPath = "env/";           // of a parameter

std::atomic<int> n_sessions{0};
std::atomic<SteadyClock::rep> asked_at{0};  // 0: not asked

/// Calls into Python with the GIL. What the user's code raises becomes a PythonFailure.
template <class Call>
auto InPython(const std::string& task, const Call& call) {
  Sessions::Check();
  const nb::gil_scoped_acquire acquire;
  try {
    return call();
  } catch (nb::python_error& e) {
    if (e.matches(PyExc_KeyboardInterrupt)) throw PythonInterrupt();
    const std::string kind = nb::cast<std::string>(e.type().attr("__name__"));
    const std::string what = nb::cast<std::string>(nb::str(e.value()));
    if (e.traceback().is_valid()) PyException_SetTraceback(e.value().ptr(), e.traceback().ptr());
    throw PythonFailure(fmt::format("'{}': its Python code raised {}: {}; see the traceback above", task, kind, what),
                        std::make_shared<const Held>(nb::borrow(e.value())));
  }
}

/// What the simulators of one environment share.
struct GymSetup {
  SimulatorSpec spec;
  ParameterSpace space;
  std::vector<double> nominal;    ///< of every number that the user's function sets
  std::vector<int> numbers;       ///< per parameter: which of them
  std::vector<uint8_t> multiply;  ///< per parameter: whether z multiplies
  bool has_state = false;
};

class GymSimulator : public Simulator {
 private:
  static nb::object Module() { return nb::module_::import_("oted.gym"); }
  template <class Function>
  auto Call(const Function& function) {
    return InPython(setup_->spec.task, [&] { return function(nb::object(Module().attr("lanes")(number_))); });
  }

 public:
  GymSimulator(std::shared_ptr<const GymSetup> setup, int n_lanes)
      : setup_(std::move(setup)),
        lanes_(static_cast<size_t>(n_lanes)),
        observations_(n_lanes, setup_->spec.obs_dim()),
        number_(InPython(setup_->spec.task,
                         [&] { return nb::cast<int64_t>(Module().attr("make_lanes")(setup_->spec.task, n_lanes)); })) {}
  ~GymSimulator() override {
    if (!nb::is_alive()) return;
    const nb::gil_scoped_acquire acquire;
    try {
      Module().attr("release")(number_);
    } catch (nb::python_error&) {  // they are then not used again
    }
  }

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  int n_lanes() const override { return static_cast<int>(lanes_.size()); }

  void SetParameters(int lane, std::span<const double> z) override {
    setup_->space.CheckInside(z);
    std::vector<double> values = setup_->nominal;
    for (size_t i = 0; i < z.size(); ++i) {
      double& value = values[static_cast<size_t>(setup_->numbers[i])];
      value = setup_->multiply[i] ? value * z[i] : z[i];
    }
    Call([&](const nb::object& python) { python.attr("set_parameters")(lane, values); });
  }

  void Reset(int lane, Rng& rng) override {
    const uint64_t seed = rng.Below(kSeeds);
    Begin(lane, Call([&](const nb::object& python) { return Numbers(python.attr("reset")(lane, seed)); }));
  }

  bool SetStateFromObservation(int lane, std::span<const double> observation) override {
    if (!setup_->spec.can_set_state) throw UsageError(WhyNot());
    return Set(lane, observation, {});
  }
  bool SetState(int lane, std::span<const double> state, const LoggedHistory& before) override {
    if (setup_->spec.can_set_state) return SetStateFromLog(lane, state, before);
    if (!setup_->has_state) throw UsageError(WhyNot());
    const size_t n = static_cast<size_t>(setup_->spec.obs_dim());
    OTED_CHECK(state.size() == static_cast<size_t>(setup_->spec.state_dim()));
    return Set(lane, state.first(n), state.subspan(n));
  }

  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    const size_t width = static_cast<size_t>(setup_->spec.act_dim), dim = static_cast<size_t>(setup_->spec.obs_dim());
    std::vector<double> chosen;
    for (const int lane : lanes) {
      const auto row = actions.subspan(static_cast<size_t>(lane) * width, width);
      chosen.insert(chosen.end(), row.begin(), row.end());
    }
    // (lanes, observation + reward + terminated + truncated)
    const std::vector<double> rows = Call([&](const nb::object& python) {
      return Numbers(python.attr("step")(std::vector<int>(lanes.begin(), lanes.end()),
                                         ToNumpy<double>(chosen, {lanes.size(), width})));
    });
    OTED_CHECK(rows.size() == lanes.size() * (dim + 3));
    for (size_t i = 0; i < lanes.size(); ++i) {
      const std::span<const double> row = std::span(rows).subspan(i * (dim + 3), dim + 3);
      Take(lanes[i], row.first(dim), row.subspan(dim));
    }
  }

  std::span<const double> observation(int lane) const override { return observations_.row(lane); }
  double reward(int lane) const override { return lanes_[static_cast<size_t>(lane)].reward; }
  LaneStatus status(int lane) const override { return lanes_[static_cast<size_t>(lane)].status; }

 private:
  struct Lane {
    double reward = 0;
    LaneStatus status = LaneStatus::kRunning;
    int step = 0;
  };

  static std::vector<double> Numbers(const nb::object& array) {
    const auto got = nb::cast<InArray>(array);
    return {got.data(), got.data() + got.size()};
  }
  std::string WhyNot() const {
    return fmt::format("task '{}' cannot be set to an observed state; give its oted.GymSimulator set_state",
                       setup_->spec.task);
  }

  bool Set(int lane, std::span<const double> observation, std::span<const double> hidden) {
    if (!std::ranges::all_of(observation, [](double v) { return std::isfinite(v); })) return false;
    const std::vector<double> shown = Call([&](const nb::object& python) {
      const nb::object found = python.attr("set_state")(lane, ToNumpy<double>(observation, {observation.size()}),
                                                        ToNumpy<double>(hidden, {hidden.size()}));
      return found.is_none() ? std::vector<double>() : Numbers(found);
    });
    if (shown.empty()) return false;
    Begin(lane, shown);
    return true;
  }

  void Begin(int lane, const std::vector<double>& shown) {
    std::ranges::copy(shown, observations_.row(lane).begin());
    lanes_[static_cast<size_t>(lane)] = Lane();
  }

  void Take(int lane, std::span<const double> shown, std::span<const double> outcome) {
    Lane& l = lanes_[static_cast<size_t>(lane)];
    ++l.step;
    const bool is_sound =
        std::ranges::all_of(shown, [](double v) { return std::isfinite(v); }) && std::isfinite(outcome[0]);
    if (!is_sound) {
      l.status = LaneStatus::kDiverged;
      l.reward = 0;
      return;
    }
    std::ranges::copy(shown, observations_.row(lane).begin());
    l.reward = outcome[0];
    const int most = setup_->spec.max_episode_steps;
    l.status = outcome[1] != 0                                   ? LaneStatus::kTerminated
               : outcome[2] != 0 || (most > 0 && l.step >= most) ? LaneStatus::kTruncated
                                                                 : LaneStatus::kRunning;
  }

  std::shared_ptr<const GymSetup> setup_;
  std::vector<Lane> lanes_;
  Array2<double> observations_;
  int64_t number_;  // of the lanes in oted.gym
};

/// facts: of the environment, as oted/gym.py writes them.
SimulatorSpec SpecOf(const std::string& task, const json& facts) {
  SimulatorSpec spec;
  spec.task = task;
  spec.observation_names = facts.at("observation_names").get<std::vector<std::string>>();
  spec.observation_shape = {static_cast<int>(spec.observation_names.size())};
  spec.observation_units = facts.at("observation_units").get<std::vector<std::string>>();
  spec.action_names = facts.at("action_names").get<std::vector<std::string>>();
  spec.n_discrete_actions = facts.at("n_discrete_actions");
  spec.action_low = facts.at("action_low").get<std::vector<double>>();
  spec.action_high = facts.at("action_high").get<std::vector<double>>();
  spec.act_dim = spec.n_discrete_actions > 0 ? 1 : static_cast<int>(spec.action_low.size());
  spec.control_period_s = facts.at("control_period");
  spec.max_episode_steps = facts.at("max_episode_steps");
  spec.rate_of = facts.at("rate_of").get<std::vector<int>>();
  for (const json& hidden : facts.at("hidden")) {
    spec.hidden.push_back({.name = hidden.at("name"), .rate_of = hidden.at("rate_of")});
  }
  spec.can_set_state = facts.at("has_state") && spec.hidden.empty();
  return spec;
}

class GymSimulatorFactory : public SimulatorFactory {
 public:
  GymSimulatorFactory(const std::string& task, const json& facts, std::vector<ParameterSpec> parameters) {
    auto setup = std::make_shared<GymSetup>();
    setup->spec = SpecOf(task, facts);
    setup->has_state = facts.at("has_state");
    std::vector<std::string> paths;
    for (const json& number : facts.at("numbers")) {
      paths.push_back(kPath + number.at("name").get<std::string>());
      setup->nominal.push_back(number.at("nominal"));
    }
    for (ParameterSpec& p : parameters) {
      const auto found = std::ranges::find(paths, p.field);
      if (found == paths.end()) {
        throw UsageError(fmt::format(
            "parameter '{}': '{}'{} is no parameter of task '{}'; it has {}", p.name, p.field,
            DidYouMean(p.field, paths), task,
            paths.empty() ? "none: give nominal and set_parameters" : fmt::format("{}", fmt::join(paths, ", "))));
      }
      const auto which = static_cast<size_t>(found - paths.begin());
      setup->numbers.push_back(static_cast<int>(which));
      setup->multiply.push_back(p.scale == ParameterScale::kNominal);
      Complete(p, setup->nominal[which]);
    }
    setup->space = ParameterSpace(std::move(parameters));
    setup_ = std::move(setup);
  }

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  std::unique_ptr<Simulator> Make(int n_lanes, int /*n_threads*/) const override {
    return std::make_unique<GymSimulator>(setup_, n_lanes);
  }
  std::string why_not_settable() const override {
    return setup_->spec.can_set_state ? ""
           : setup_->has_state        ? "its logs do not show all of its state"
                                      : "its oted.GymSimulator has no set_state";
  }

 private:
  static void Complete(ParameterSpec& p, double nominal) {
    if (p.scale == ParameterScale::kAbsolute) {
      p.nominal = nominal;
      p.unit = "";
    } else if (nominal == 0) {
      throw UsageError(fmt::format(
          "parameter '{}': '{}' is 0 at nominal, and multiples of 0 are 0; give its range with scale=\"absolute\"",
          p.name, p.field));
    }
  }
  std::shared_ptr<const GymSetup> setup_;
};

}  // namespace

void Sessions::Begin() { ++n_sessions; }

void Sessions::End() {
  --n_sessions;
  asked_at = 0;
}

void Sessions::AskToStop() {
  if (asked_at == 0) asked_at = SteadyClock::now().time_since_epoch().count();
}

void Sessions::Check() {
  const SteadyClock::rep asked = asked_at;
  if (asked == 0 || n_sessions != 1) return;
  if (SteadyClock::now().time_since_epoch() - SteadyClock::duration(asked) < kStopPatience) return;
  throw Interrupted("stopped within a unit of work; the same call goes on from the last one that was whole");
}

void AddGymSimulators(nb::module_& m) {
  m.def(
      "register_gym_simulator",
      [](const std::string& task, const std::string& facts) {
        RegisterTask(task, [task, read = json::parse(facts)](const std::vector<ParameterSpec>& parameters) {
          return std::make_unique<GymSimulatorFactory>(task, read, parameters);
        });
      },
      nb::arg("task"), nb::arg("facts"));
}

}  // namespace oted::python
