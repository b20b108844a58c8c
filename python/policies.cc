#include "python/policies.h"

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/run/run_inputs.h"
#include "python/study.h"

namespace oted::python {
namespace {

using nlohmann::json;

/// A policy of a file.
class FilePolicy {
 public:
  FilePolicy(const std::string& path, const Study& study) {
    const nb::gil_scoped_release release;
    const RunConfig config = study.Config();
    const SimulatorSpec spec = SpecOf(config.task);
    obs_dim_ = static_cast<size_t>(spec.obs_dim());
    act_dim_ = static_cast<size_t>(spec.act_dim);
    policy_ = LoadBatchPolicy(path, spec);
  }
  OutArray Act(const InArray& observations) const {
    if (observations.ndim() != 2 || observations.shape(1) != obs_dim_) {
      throw UsageError(fmt::format("observations: wanted an array of shape (n, {})", obs_dim_));
    }
    const size_t n = observations.shape(0);
    std::vector<double> actions(n * act_dim_);
    policy_(Values(observations), static_cast<int>(n), actions);
    return ToNumpy<double>(actions, {n, act_dim_});
  }

 private:
  size_t obs_dim_ = 0, act_dim_ = 0;
  BatchPolicy policy_;
};

/// A Python function of a batch of observations. Called with the GIL released.
BatchPolicy OfFunction(const nb::object& function, const SimulatorSpec& spec) {
  return [&function, &spec](std::span<const double> observations, int n, std::span<double> actions) {
    const nb::gil_scoped_acquire acquire;
    const auto rows = static_cast<size_t>(n);
    const nb::object given = function(ToNumpy<double>(observations, {rows, static_cast<size_t>(spec.obs_dim())}));
    const auto got = nb::cast<InArray>(nb::module_::import_("numpy").attr("ascontiguousarray")(given, "float64"));
    if (got.size() != actions.size()) {
      throw UsageError(fmt::format("the policy gave {} numbers for {} observations, wanted {} for each", got.size(), n,
                                   spec.act_dim));
    }
    std::copy_n(got.data(), got.size(), actions.begin());
  };
}

/// What `oted evaluate --policy` says of episodes at parameters z; nominal where z is none.
std::string Evaluate(const nb::object& policy, const Study& study, const std::optional<std::vector<double>>& z,
                     int n_episodes, uint64_t seed) {
  const bool is_file = nb::isinstance<nb::str>(policy);
  const std::string path = is_file ? nb::cast<std::string>(policy) : "";
  const nb::gil_scoped_release release;
  const RunConfig config = ExpandPresets(study.Config());
  Array2<double> starts;
  if (config.task.has_model() && config.task.model.starts_in_logs()) {
    starts = ReadEpisodes(config.data, SpecOf(config.task)).EpisodeStarts();
  }
  const auto factory = study.Factory(config, starts);
  const SimulatorSpec& spec = factory->spec();
  const std::vector<double> at = z ? *z : factory->parameters().Nominal();
  factory->parameters().CheckInside(at);
  const RngKey key = RngKey(seed).Stage("evaluate");
  const BatchPolicy act =
      is_file ? LoadBatchPolicy(path, spec, config.algorithms.ppo.evaluate, key.Stage("actions").MakeRng())
              : OfFunction(policy, spec);
  const PolicyEvaluation result = EvaluateBatchPolicy(*factory, act, at, n_episodes, config.Threads(), key);
  json returns = json::array(), lengths = json::array();
  for (const EpisodeResult& e : result.episodes) {
    returns.push_back(e.episode_return);
    lengths.push_back(e.n_steps);
  }
  return json{{"task", spec.task},
              {"mean_return", result.mean_return},
              {"std_return", result.std_return},
              {"min_return", result.min_return},
              {"max_return", result.max_return},
              {"mean_length", result.mean_length},
              {"n_terminated", result.n_terminated},
              {"n_truncated", result.n_truncated},
              {"n_diverged", result.n_diverged},
              {"score", spec.has_score() ? json(spec.NormalizedScore(result.mean_return)) : json()},
              {"returns", returns},
              {"lengths", lengths}}
      .dump();
}

}  // namespace

void AddPolicies(nb::module_& m) {
  nb::class_<FilePolicy>(m, "Policy")
      .def(nb::init<const std::string&, const Study&>(), nb::arg("path"), nb::arg("study"))
      .def("act", &FilePolicy::Act, nb::arg("observations"));
  m.def("evaluate", &Evaluate, nb::arg("policy"), nb::arg("study"), nb::arg("z").none(), nb::arg("n_episodes"),
        nb::arg("seed"));
}

}  // namespace oted::python
