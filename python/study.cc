#include "python/study.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <nlohmann/json.hpp>

#include "oted/base/parallel.h"
#include "oted/proposal/task_proposal.h"
#include "oted/run/run_inputs.h"

namespace oted::python {

RunConfig Study::Config() const {
  RunConfig config =
      design != nullptr ? design->config : RunConfig::FromToml(toml, file_name.empty() ? "task" : file_name);
  const RunConfig more = RunConfig::FromToml(given, "arguments");
  if (!more.parameters.empty() || !more.presets.empty()) {
    config.parameters = more.parameters;
    config.presets = more.presets;
  }
  if (!more.data.path.empty()) config.data.Take(more.data.path);
  if (more.data.episodes != DataConfig().episodes) config.data.episodes = more.data.episodes;
  if (more.data.format != DataConfig().format) config.data.format = more.data.format;
  if (more.data.action_delay != 0) config.data.action_delay = more.data.action_delay;
  if (!more.data.rescaling.empty()) config.data.rescaling = more.data.rescaling;
  if (!more.data.unwrap.empty()) config.data.unwrap = more.data.unwrap;
  if (more.run.threads != 0) config.run.threads = more.run.threads;
  config.task.Resolve();
  return config;
}

std::unique_ptr<SimulatorFactory> Study::Factory(const RunConfig& config, const Array2<double>& starts) const {
  auto factory = MakeSimulatorFactory(config.task, config.parameters, starts);
  if (design != nullptr) CheckSameModel(*design, *factory);
  return factory;
}

namespace {

/// What `oted init --json` prints.
std::string Propose(const std::string& model, const std::vector<std::string>& logs, const std::string& out,
                    double period, int threads) {
  const nb::gil_scoped_release release;
  NullSink log;
  const RunContext context{.log = &log, .stop = nullptr, .n_threads = threads > 0 ? threads : AvailableThreads()};
  return ProposeTask({model, logs, out, period}, context).ToJson(out).dump();
}

}  // namespace

void AddStudies(nb::module_& m) {
  nb::class_<Study>(m, "Study")
      .def(
          "__init__",
          [](Study* self, const std::string& toml, const std::string& file_name, const std::string& given) {
            new (self) Study{.toml = toml, .file_name = file_name, .given = given};
          },
          nb::arg("toml"), nb::arg("file_name"), nb::arg("given"))
      .def_static(
          "of_run",
          [](const std::string& run, const std::string& given) {
            return Study{.toml = "",
                         .file_name = "",
                         .given = given,
                         .design = std::make_shared<const FinishedDesign>(ReadDesign(run))};
          },
          nb::arg("run"), nb::arg("given"))
      .def_prop_ro("toml", [](const Study& study) { return study.Config().ToToml(); })
      .def_prop_ro("task_name", [](const Study& study) { return study.Config().task.name; });
  m.def("init", &Propose, nb::arg("model"), nb::arg("logs"), nb::arg("out"), nb::arg("period"), nb::arg("threads"));
}

}  // namespace oted::python
