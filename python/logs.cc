#include "python/logs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/checks/data_check.h"
#include "oted/checks/data_record.h"
#include "oted/data/dataset_files.h"
#include "oted/data/recording.h"
#include "oted/data/resample.h"
#include "oted/data/unwrap.h"
#include "oted/run/run_inputs.h"
#include "python/study.h"

namespace oted::python {
namespace {

using Maybe = std::optional<InArray>;

constexpr double kPeriodSlack = 0.02;           // by which a period that was measured may be off
constexpr const char* kInMemory = "in memory";  // what errors call logs that are no file

/// Gives logs without a file a name for errors, as long as it lives.
class Named {
 public:
  explicit Named(Dataset& dataset) : dataset_(dataset), names_(dataset.path.empty()) {
    if (names_) dataset_.path = kInMemory;
  }
  Named(const Named&) = delete;
  Named& operator=(const Named&) = delete;
  ~Named() {
    if (names_) dataset_.path.clear();
  }

 private:
  Dataset& dataset_;
  const bool names_;
};

Array2<double> Matrix(const InArray& array, const char* name) {
  if (array.ndim() != 2) {
    throw UsageError(fmt::format("{} has {} dimensions, wanted 2: (rows, columns)", name, array.ndim()));
  }
  Array2<double> matrix(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)));
  std::copy_n(array.data(), array.size(), matrix.data());
  return matrix;
}

Array2<double> Matrix(const Maybe& array, const char* name) { return array ? Matrix(*array, name) : Array2<double>(); }

std::vector<double> Vector(const Maybe& array, const char* name) {
  if (!array) return {};
  if (array->ndim() != 1) {
    throw UsageError(fmt::format("{} has {} dimensions, wanted 1: one number per row", name, array->ndim()));
  }
  return {array->data(), array->data() + array->size()};
}

/// Sets a constant in all rows, a new one behind those that there are.
void SetConstant(Dataset& dataset, const std::string& name, double value) {
  std::vector<std::string>& names = dataset.constant_names;
  const auto at = std::find(names.begin(), names.end(), name);
  const int column = static_cast<int>(at - names.begin());
  if (at == names.end()) {
    names.push_back(name);
    Array2<double> wider(dataset.size(), static_cast<int>(names.size()), std::nan(""));
    for (int i = 0; i < dataset.size() && column > 0; ++i) {
      std::copy_n(dataset.constants.row(i).begin(), column, wider.row(i).begin());
    }
    dataset.constants = std::move(wider);
  }
  for (int i = 0; i < dataset.size(); ++i) dataset.constants(i, column) = value;
}

bool PeriodsDiffer(double a, double b) { return std::abs(a - b) > kPeriodSlack * std::max(a, b); }

/// Appends logs that may say other constants: where one says nothing it is as in the model.
void Append(Dataset& dataset, Dataset other) {
  const auto add_missing = [](Dataset& to, const Dataset& from) {
    for (const std::string& name : from.constant_names) {
      if (std::find(to.constant_names.begin(), to.constant_names.end(), name) == to.constant_names.end()) {
        SetConstant(to, name, std::nan(""));
      }
    }
  };
  const auto wanted = [](const char* what, auto got, auto here) {
    if (got != here) throw UsageError(fmt::format("+: the second logs have {} {}, the first {}", got, what, here));
  };
  wanted("observations", other.obs_dim(), dataset.obs_dim());
  wanted("actions", other.act_dim(), dataset.act_dim());
  const auto same_names = [](const char* what, std::vector<std::string> got, std::vector<std::string> here) {
    if (got.empty() || here.empty()) return;
    const std::string names = fmt::format("{}, the first {}", fmt::join(got, ", "), fmt::join(here, ", "));
    std::ranges::sort(got);
    std::ranges::sort(here);
    if (got != here) throw UsageError(fmt::format("+: the second logs have the {} {}; rename them", what, names));
  };
  same_names("observations", other.observation_names, dataset.observation_names);
  same_names("actions", other.action_names, dataset.action_names);
  {
    const Named named(other);
    MatchNames(other, dataset.observation_names, dataset.action_names);
  }
  if (dataset.period_s > 0 && other.period_s > 0 && PeriodsDiffer(dataset.period_s, other.period_s)) {
    throw UsageError(
        fmt::format("+: rows of the second logs lie {:.6g} s apart, and those of the first {:.6g} s; make "
                    "both with one period",
                    other.period_s, dataset.period_s));
  }
  if (other.rewards.empty() != dataset.rewards.empty()) other.rewards.clear(), dataset.rewards.clear();
  if (other.qpos.cols() != dataset.qpos.cols() || other.qvel.cols() != dataset.qvel.cols()) {
    other.qpos = other.qvel = dataset.qpos = dataset.qvel = {};
  }
  add_missing(dataset, other);
  add_missing(other, dataset);
  Dataset ordered = other;
  for (size_t k = 0; k < dataset.constant_names.size(); ++k) {
    const auto at = std::find(other.constant_names.begin(), other.constant_names.end(), dataset.constant_names[k]);
    const int from = static_cast<int>(at - other.constant_names.begin());
    for (int i = 0; i < other.size(); ++i) ordered.constants(i, static_cast<int>(k)) = other.constants(i, from);
  }
  ordered.constant_names = dataset.constant_names;
  dataset.Append(ordered);
}

/// Brings constants into the order of the task's. @throws UsageError where the task has none of that name
void MatchConstants(Dataset& dataset, const SimulatorSpec& spec) {
  for (const std::string& name : dataset.constant_names) {
    const auto& known = spec.constant_names;
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw UsageError(fmt::format(
        "constant '{}' of the logs is none of task {}; it has {}", name, spec.task,
        known.empty() ? "none: declare it in [task.constants]" : fmt::format("{}", fmt::join(known, ", "))));
  }
  if (dataset.constant_names.empty() || dataset.constant_names == spec.constant_names) return;
  Dataset ordered = dataset;
  ordered.constants = {};
  ordered.constant_names.clear();
  for (const std::string& name : spec.constant_names) SetConstant(ordered, name, std::nan(""));
  for (size_t k = 0; k < dataset.constant_names.size(); ++k) {
    const auto at = std::find(spec.constant_names.begin(), spec.constant_names.end(), dataset.constant_names[k]);
    const int to = static_cast<int>(at - spec.constant_names.begin());
    for (int i = 0; i < dataset.size(); ++i) ordered.constants(i, to) = dataset.constants(i, static_cast<int>(k));
  }
  dataset = std::move(ordered);
}

/// Brings channels and constants into the task's order. @throws UsageError where it has others, or another period
void MatchTask(Dataset& dataset, const SimulatorSpec& spec) {
  const Named named(dataset);
  MatchNames(dataset, spec.observation_names, spec.action_names);
  dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  MatchConstants(dataset, spec);
  if (!(dataset.period_s > 0) || !(spec.control_period_s > 0) ||
      !PeriodsDiffer(dataset.period_s, spec.control_period_s))
    return;
  throw UsageError(
      fmt::format("rows of the logs lie {:.6g} s apart, and the control period of task {} is {:.6g} s; give "
                  "the logs their times and this period, or correct the task",
                  dataset.period_s, spec.task, spec.control_period_s));
}

OutArray Copy(const Array2<double>& m) {
  return ToNumpy<double>(m.values(), {static_cast<size_t>(m.rows()), static_cast<size_t>(m.cols())});
}

/// A log as rows of (s_k, a_k) at times, in runs [begin, end) of rows; a run's last row gives its final observation.
struct Rows {
  InArray observations, actions;
  Maybe times, rewards, qpos, qvel;
  std::vector<std::tuple<int, int, bool>> runs;
  std::vector<std::string> observation_names, action_names, unwrap;
};

Recording RecordingOf(const Rows& rows) {
  Recording recording;
  recording.file = "logs";
  recording.observations = Matrix(rows.observations, "observations");
  recording.actions = Matrix(rows.actions, "actions");
  recording.times = Vector(rows.times, "times");
  recording.rewards = Vector(rows.rewards, "rewards");
  recording.qpos = Matrix(rows.qpos, "qpos");
  recording.qvel = Matrix(rows.qvel, "qvel");
  for (const auto& [begin, end, terminated] : rows.runs) recording.runs.push_back({begin, end, terminated});
  recording.observation_names = rows.observation_names;
  recording.action_names = rows.action_names;
  const auto check = [&](const char* name, size_t n) {
    const auto wanted = static_cast<size_t>(recording.observations.rows());
    if (n == wanted || n == 0) return;
    throw UsageError(fmt::format("{} has {} rows, wanted {} as observations have", name, n, wanted));
  };
  check("actions", static_cast<size_t>(recording.actions.rows()));
  check("times", recording.times.size());
  check("rewards", recording.rewards.size());
  check("qpos", static_cast<size_t>(recording.qpos.rows()));
  check("qvel", static_cast<size_t>(recording.qvel.rows()));
  return recording;
}

/// Takes each run's period from its times, by the rules of tables, and ends it where more than two rows are missing.
/// @throws UsageError where times do not rise
void UseTimes(Recording& recording) {
  const std::vector<double>& times = recording.times;
  const double resolution = ResolutionOf(times);
  std::vector<Recording::Run> runs;
  for (Recording::Run rest : recording.runs) {
    std::vector<double> steps;
    for (int i = rest.begin + 1; i < rest.end; ++i) {
      steps.push_back(times[static_cast<size_t>(i)] - times[static_cast<size_t>(i) - 1]);
      if (steps.back() > 0) continue;
      throw UsageError(
          fmt::format("times: row {} lies {:.6g} s after the row before, wanted times that rise within "
                      "an episode; sort the rows, or say where episodes end",
                      i, steps.back()));
    }
    const double period = TypicalStep(steps);
    const auto add = [&](Recording::Run run) {
      if (run.end - run.begin > 1) MeasureRun(times, period, resolution, run);
      runs.push_back(run);
    };
    for (int i = rest.begin + 1; i < rest.end; ++i) {
      if (times[static_cast<size_t>(i)] - times[static_cast<size_t>(i) - 1] <= kMostGap * period) continue;
      add({rest.begin, i, false});
      rest.begin = i;
    }
    add(rest);
  }
  if (runs.size() > recording.runs.size()) {
    recording.remarks.push_back(fmt::format("{} gaps of more than {} missing rows in the times: episodes end there",
                                            runs.size() - recording.runs.size(), static_cast<int>(kMostGap) - 1));
  }
  recording.runs = std::move(runs);
  recording.period_s = PeriodOfRuns(recording);
}

/// The transitions of the rows, at one per `period_s` where that is given and there are times.
Dataset FromRows(const Rows& rows, double period_s) {
  Recording recording = RecordingOf(rows);
  recording.period_s = period_s;
  const nb::gil_scoped_release release;
  if (!recording.times.empty()) UseTimes(recording);
  Unwrap(recording, rows.unwrap);
  if (!recording.times.empty() && period_s > 0) recording = Resample(recording, period_s);
  Dataset dataset = ToDataset(recording);
  dataset.path.clear();
  dataset.Check();
  return dataset;
}

/// (name, source, times, values)
using GivenStream = std::tuple<std::string, std::string, InArray, InArray>;

std::vector<Stream> StreamsOf(const std::vector<GivenStream>& given) {
  std::vector<Stream> streams;
  for (const auto& [name, source, times, values] : given) {
    const std::span<const double> t = Values(times), v = Values(values);
    streams.push_back({name, source, {t.begin(), t.end()}, {v.begin(), v.end()}});
  }
  return streams;
}

Dataset LogsOfStreams(const std::vector<GivenStream>& states, const std::vector<GivenStream>& actions, double period,
                      double most_gap, const std::vector<std::string>& unwrap) {
  std::vector<Stream> seen = StreamsOf(states);
  const std::vector<Stream> done = StreamsOf(actions);
  const nb::gil_scoped_release release;
  const std::vector<std::string> remarks = Unwrap(seen, unwrap);
  Dataset dataset = ToDataset(FromStreams(seen, done, period, most_gap));
  dataset.remarks.insert(dataset.remarks.end(), remarks.begin(), remarks.end());
  dataset.path.clear();
  dataset.Check();
  return dataset;
}

Dataset Read(const Study& study) {
  const nb::gil_scoped_release release;
  const RunConfig config = study.Config();
  if (config.task.name.empty()) return ReadEpisodes(config.data, config.data.Options());
  return ReadEpisodes(config.data, SpecOf(config.task));
}

void Write(Dataset dataset, const std::string& path, const Study& study) {
  const nb::gil_scoped_release release;
  const RunConfig config = study.Config();
  if (!config.task.name.empty()) {
    const SimulatorSpec spec = SpecOf(config.task);
    MatchTask(dataset, spec);
  }
  WriteDataset(dataset, path);
}

/// oted.data_check/1. The data are those given, or else those that the configuration names.
std::string Check(const std::optional<Dataset>& given, const Study& study, uint64_t seed) {
  const nb::gil_scoped_release release;
  RunConfig config = study.Config();
  const bool has_task = !config.task.name.empty();
  Dataset dataset;
  if (given) {
    dataset = *given;
    if (has_task) {
      MatchTask(dataset, SpecOf(config.task));
    }
  } else {
    DataOptions how = has_task ? DataOptionsFor(config.data, SpecOf(config.task)) : config.data.Options();
    how.check = false;
    dataset = ReadFiles(config.data, how);
  }
  if (has_task) config = ExpandPresets(config);
  const auto factory =
      has_task ? MakeSimulatorFactory(config.task, config.parameters, dataset.EpisodeStarts()) : nullptr;
  NullSink log;
  RunContext context;
  context.log = &log;
  context.n_threads = config.Threads();
  const DataCheck check = CheckData(dataset, factory.get(), seed, context);
  return DataCheckRecord(dataset, factory ? &factory->spec() : nullptr, check).dump();
}

}  // namespace

namespace {

void AddDataset(nb::module_& m) {
  nb::class_<Dataset>(m, "Dataset")
      .def_prop_ro(
          "observations", [](const Dataset& d) { return Copy(d.observations); }, nb::rv_policy::move)
      .def_prop_ro(
          "actions", [](const Dataset& d) { return Copy(d.actions); }, nb::rv_policy::move)
      .def_prop_ro(
          "next_observations", [](const Dataset& d) { return Copy(d.next_observations); }, nb::rv_policy::move)
      .def_prop_ro(
          "qpos", [](const Dataset& d) { return Copy(d.qpos); }, nb::rv_policy::move)
      .def_prop_ro(
          "qvel", [](const Dataset& d) { return Copy(d.qvel); }, nb::rv_policy::move)
      .def_prop_ro(
          "rewards", [](const Dataset& d) { return ToNumpy<double>(d.rewards, {d.rewards.size()}); },
          nb::rv_policy::move)
      .def_prop_ro(
          "terminals", [](const Dataset& d) { return ToNumpy<uint8_t>(d.terminals, {d.terminals.size()}); },
          nb::rv_policy::move)
      .def_prop_ro(
          "timeouts", [](const Dataset& d) { return ToNumpy<uint8_t>(d.timeouts, {d.timeouts.size()}); },
          nb::rv_policy::move)
      .def_ro("observation_names", &Dataset::observation_names)
      .def_ro("action_names", &Dataset::action_names)
      .def_ro("remarks", &Dataset::remarks)
      .def_ro("warnings", &Dataset::warnings)
      .def_ro("period", &Dataset::period_s)
      .def_ro("path", &Dataset::path)
      .def("__len__", &Dataset::size)
      .def("episodes",
           [](const Dataset& d) {
             std::vector<std::tuple<int, int, bool>> episodes;
             for (const Episode& e : d.Episodes()) episodes.emplace_back(e.begin, e.end, e.terminated);
             return episodes;
           })
      .def_prop_ro(
          "constants", [](const Dataset& d) { return Copy(d.constants); }, nb::rv_policy::move)
      .def_ro("constant_names", &Dataset::constant_names)
      .def("set_constant", &SetConstant, nb::arg("name"), nb::arg("value"))
      .def("append", &Append, nb::arg("other"))
      .def("copy", [](const Dataset& d) { return d; })
      .def("select", [](const Dataset& d, const std::vector<int>& which) {
        const std::vector<Episode> all = d.Episodes();
        std::vector<Episode> chosen;
        for (const int i : which) chosen.push_back(all.at(static_cast<size_t>(i)));
        return d.Select(chosen);
      });
}

}  // namespace

void AddLogs(nb::module_& m) {
  AddDataset(m);
  m.def("read_logs", &Read, nb::arg("study"));
  m.def("write_logs", &Write, nb::arg("dataset"), nb::arg("path"), nb::arg("study"));
  m.def("check_logs", &Check, nb::arg("dataset").none(), nb::arg("study"), nb::arg("seed"));
  m.def(
      "logs_from_rows",
      [](const InArray& observations, const InArray& actions, const std::vector<std::tuple<int, int, bool>>& runs,
         const Maybe& times, const Maybe& rewards, const Maybe& qpos, const Maybe& qvel,
         const std::vector<std::string>& observation_names, const std::vector<std::string>& action_names, double period,
         const std::vector<std::string>& unwrap) {
        return FromRows(
            {observations, actions, times, rewards, qpos, qvel, runs, observation_names, action_names, unwrap}, period);
      },
      nb::arg("observations"), nb::arg("actions"), nb::arg("runs"), nb::arg("times").none(), nb::arg("rewards").none(),
      nb::arg("qpos").none(), nb::arg("qvel").none(), nb::arg("observation_names"), nb::arg("action_names"),
      nb::arg("period"), nb::arg("unwrap"));
  m.def("logs_from_streams", &LogsOfStreams, nb::arg("states"), nb::arg("actions"), nb::arg("period"),
        nb::arg("most_gap"), nb::arg("unwrap"));
  m.attr("MOST_GAP") = kMostGap;
  m.def(
      "logs_from_transitions",
      [](const InArray& observations, const InArray& actions, const InArray& next_observations, const Maybe& terminals,
         const Maybe& timeouts, const Maybe& rewards, const std::vector<std::string>& observation_names,
         const std::vector<std::string>& action_names, double period, const std::vector<std::string>& unwrap) {
        Dataset d;
        d.observations = Matrix(observations, "observations");
        d.actions = Matrix(actions, "actions");
        d.next_observations = Matrix(next_observations, "next_observations");
        const auto flags = [&](const Maybe& array, const char* name) {
          const std::vector<double> values = Vector(array, name);
          std::vector<uint8_t> result(array ? values.size() : static_cast<size_t>(d.size()), 0);
          for (size_t i = 0; i < values.size(); ++i) result[i] = values[i] != 0;
          return result;
        };
        d.terminals = flags(terminals, "terminals");
        d.timeouts = flags(timeouts, "timeouts");
        d.rewards = Vector(rewards, "rewards");
        d.observation_names = observation_names;
        d.action_names = action_names;
        d.period_s = period;
        d.path = "logs";
        d.Check();
        Unwrap(d, unwrap);
        d.path.clear();
        return d;
      },
      nb::arg("observations"), nb::arg("actions"), nb::arg("next_observations"), nb::arg("terminals").none(),
      nb::arg("timeouts").none(), nb::arg("rewards").none(), nb::arg("observation_names"), nb::arg("action_names"),
      nb::arg("period"), nb::arg("unwrap"));
}

}  // namespace oted::python
