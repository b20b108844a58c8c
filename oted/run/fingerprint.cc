#include "oted/run/fingerprint.h"

#include <nlohmann/json.hpp>

#include "oted/base/files.h"

namespace oted {

using nlohmann::json;

std::string Fingerprint(const json& inputs) { return Sha256(inputs.dump()).substr(0, 16); }

json ParameterIdentity(const ParameterSpace& space) {
  json list = json::array();
  for (const ParameterSpec& spec : space.specs()) {
    list.push_back(
        {spec.name, spec.field, spec.low, spec.high, spec.logarithmic, spec.scale == ParameterScale::kAbsolute});
  }
  return list;
}

namespace {

/// The task as a design sees it: a reward that is added when agents are to be trained makes no other simulator.
json DesignedTaskIdentity(const InputsOfRun& inputs) {
  const TaskConfig& task = inputs.config.task;
  json identity = TaskIdentity(inputs);
  if (!task.has_model()) return identity;
  identity.erase("reward");
  // Quantities are for the two expressions.
  if (task.model.terminate.empty()) identity.erase("quantities");
  return identity;
}

}  // namespace

json TaskIdentity(const InputsOfRun& inputs) {
  const RunConfig& config = inputs.config;
  json identity = config.task.Identity();
  // Agents, too, depend on the data where episodes begin there.
  if (config.task.has_model() && config.task.model.starts_in_logs()) {
    identity["starts"] = {inputs.dataset_sha256, config.data.episodes};
  }
  return identity;
}

json DataIdentity(const InputsOfRun& inputs) {
  DataConfig data = inputs.config.data;
  // The file counts by its content, not by its place.
  json settings = data.Fields().ToJson();
  settings.erase("path");
  return {DesignedTaskIdentity(inputs), inputs.model_sha256, inputs.dataset_sha256, settings, inputs.config.run.seed};
}

std::string InputsFingerprint(const InputsOfRun& inputs, const ParameterSpace& space) {
  return Fingerprint({"inputs", DataIdentity(inputs), ParameterIdentity(space)});
}

}  // namespace oted
