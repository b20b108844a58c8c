#include "python/designs.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/exports/export.h"
#include "oted/report/report.h"
#include "oted/run/design_record.h"
#include "oted/run/finished_design.h"
#include "oted/run/records.h"
#include "oted/run/run_inputs.h"
#include "oted/run/validation.h"
#include "oted/run/verify.h"
#include "oted/sim/mujoco/task.h"
#include "python/study.h"

namespace oted::python {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// The selected setting's mixture of q.
class Sampler {
 public:
  explicit Sampler(const std::string& run_directory) {
    CheckRecords(run_directory);
    const FinishedDesign design = ReadDesign(run_directory);
    const ParameterSpace space(design.config.parameters);
    for (const DesignRecord::Member& member : design.record.mixture) {
      const fs::path path = design.folder / "design" / design.record.selected / std::to_string(member.seed) / "q.json";
      q_.push_back(QRecord::FromJson(ReadJson(path), space, path.string()).q);
    }
  }

  /// (n, parameters): draw i is from seed i modulo the number of seeds.
  OutArray Draw(int n, uint64_t seed) const {
    Array2<double> samples(n, q_.front().size());
    const RngKey key = RngKey(seed).Stage("samples of q");
    for (int i = 0; i < n; ++i) {
      Rng rng = key.Index(static_cast<uint64_t>(i)).MakeRng();
      const Designer::Sample draw = q_[static_cast<size_t>(i) % q_.size()].Draw(rng);
      std::copy(draw.z.begin(), draw.z.end(), samples.row(i).begin());
    }
    return ToNumpy<double>(samples.values(),
                           {static_cast<size_t>(samples.rows()), static_cast<size_t>(samples.cols())});
  }

 private:
  std::vector<Designer> q_;
};

/// @throws DataError unless design.json is whole and as it was written. It may be there alone: run.toml is not read.
void CheckRecord(const std::string& run_directory) {
  const nb::gil_scoped_release release;
  const fs::path file = fs::path(run_directory) / "design.json";
  DesignRecord::FromJson(ReadSealed(file, true), file.string());
}

json ToJson(const ParameterSpec& spec) {
  return {{"name", spec.name},
          {"field", spec.field},
          {"low", spec.low},
          {"high", spec.high},
          {"scale", spec.scale == ParameterScale::kNominal ? "nominal" : "absolute"},
          {"log", spec.logarithmic},
          {"unit", spec.unit},
          {"nominal", spec.nominal}};
}

/// What a configuration's simulator is: shapes, names, units and parameters.
std::string Describe(const Study& study) {
  const nb::gil_scoped_release release;
  RunConfig config = ExpandPresets(study.Config());
  config.task.model.start = "default";
  const auto factory = study.Factory(config);
  const SimulatorSpec& spec = factory->spec();
  json parameters = json::array(), offers = json::array();
  for (const ParameterSpec& p : factory->parameters().specs()) parameters.push_back(ToJson(p));
  for (const ParameterOffer& offer : factory->Offers()) {
    json values = json::array();
    for (const ParameterPlace& place : offer.places)
      values.push_back({{"path", place.path}, {"nominal", place.nominal}});
    offers.push_back({{"owner", offer.owner},
                      {"path", offer.path},
                      {"unit", offer.unit},
                      {"meaning", offer.meaning},
                      {"values", values}});
  }
  return json{{"task", spec.task},
              {"observation_names", spec.observation_names},
              {"observation_units", spec.observation_units},
              {"observation_shape", spec.observation_shape},
              {"action_names", spec.action_names},
              {"action_low", spec.action_low},
              {"action_high", spec.action_high},
              {"n_discrete_actions", spec.n_discrete_actions},
              {"control_period", spec.control_period_s},
              {"max_episode_steps", spec.max_episode_steps},
              {"can_set_state", spec.can_set_state},
              {"has_reward", spec.has_reward},
              {"parameters", parameters},
              {"offers", offers}}
      .dump();
}

}  // namespace

void AddDesigns(nb::module_& m) {
  nb::class_<Sampler>(m, "Sampler")
      .def(nb::init<const std::string&>(), nb::arg("run_directory"))
      .def("draw", &Sampler::Draw, nb::arg("n"), nb::arg("seed"));
  m.def("check_record", &CheckRecord, nb::arg("run_directory"));
  m.def("describe", &Describe, nb::arg("study"));
  m.def(
      "export_design",
      [](const std::string& run_directory, const std::string& mjcf, const std::string& sysid,
         const std::string& member) {
        const nb::gil_scoped_release release;
        ExportRequest request;
        request.mjcf = mjcf;
        request.sysid = sysid;
        request.member = member;
        std::vector<std::string> written;
        for (const ExportedFile& file : Export(run_directory, request)) written.push_back(file.path.string());
        return written;
      },
      nb::arg("run_directory"), nb::arg("mjcf"), nb::arg("sysid"), nb::arg("member"));
  m.def("task_names", &TaskNames);
  m.def(
      "validate",
      [](const std::string& run_directory, const std::string& data, const std::string& model, int threads) {
        const nb::gil_scoped_release release;
        ValidationRequest request;
        request.run = run_directory;
        request.data = {data};
        request.model = model;
        NullSink log;
        RunConfig config;
        config.run.threads = threads;
        RunContext context;
        context.log = &log;
        context.n_threads = config.Threads();
        return Validate(request, context).ToJson(request).dump();
      },
      nb::arg("run_directory"), nb::arg("data"), nb::arg("model"), nb::arg("threads"));
}

}  // namespace oted::python
