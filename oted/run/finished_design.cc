#include "oted/run/finished_design.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/run/fingerprint.h"
#include "oted/run/provenance.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

using Member = DesignRecord::Member;

size_t BestMember(const DesignRecord& record, const std::string& file) {
  // The parameters' modes are the best-scoring seed's.
  const auto found = std::ranges::find(record.mixture, record.BestMode(), &Member::mode);
  if (found == record.mixture.end()) {
    throw DataError(fmt::format(
        "'{}': no member of the mixture has the parameters' modes; make it again with 'oted design'", file));
  }
  return static_cast<size_t>(found - record.mixture.begin());
}

// @throws DataError unless the design is one of the parameters of its run.toml
void CheckBelongs(const FinishedDesign& design, const std::string& file) {
  const auto foreign = [&](const std::string& why) {
    return DataError(fmt::format(
        "'{}' is not the design of this directory's run.toml ({}); make it again with 'oted design'", file, why));
  };
  const auto& parameters = design.record.parameters;
  if (parameters.size() != design.config.parameters.size()) throw foreign("another number of parameters");
  for (size_t i = 0; i < parameters.size(); ++i) {
    const ParameterSpec& spec = design.config.parameters[i];
    if (parameters[i].name != spec.name || parameters[i].field != spec.field) {
      throw foreign(fmt::format("parameter '{}'", spec.name));
    }
  }
  for (const Member& member : design.record.mixture) {
    if (member.mode.size() != parameters.size()) throw foreign("a mode of another length");
  }
  RunConfig config = design.config;
  config.task.Resolve();
  const std::string inputs = InputsFingerprint({config, design.record.model_sha256, design.record.dataset.sha256},
                                               ParameterSpace(config.parameters));
  if (!design.record.inputs.empty() && inputs != design.record.inputs) {
    throw foreign("another task, seed, choice of data, or range of a parameter");
  }
}

}  // namespace

FinishedDesign ReadDesign(const fs::path& folder) {
  const fs::path file = folder / "design.json";
  if (!fs::exists(file)) {
    throw UsageError(
        fmt::format("'{}' holds no design.json; name a run directory, and make the design first, or let it end: oted "
                    "design --out {}",
                    folder.string(), folder.string()));
  }
  FinishedDesign design{folder, ReadKeptConfig(folder), DesignRecord::FromJson(ReadSealed(file, true), file.string())};
  // run.toml has what was asked; a design may have more.
  for (const Suspect& grown : design.record.grown) design.config.parameters.push_back(grown.spec);
  CheckBelongs(design, file.string());
  design.best = BestMember(design.record, file.string());
  return design;
}

void CheckSameModel(const FinishedDesign& design, const SimulatorFactory& factory) {
  if (design.record.model_sha256 == factory.model_sha256()) return;
  const TaskConfig& task = design.config.task;
  if (!task.has_model()) {
    throw DataError(
        fmt::format("the model of task '{}' is no longer the one that the design was made with (its SHA-256 differs); "
                    "restore it, or make the design again",
                    task.name));
  }
  throw DataError(fmt::format(
      "the model '{}' is no longer the one that the design was made with (its SHA-256 differs); restore it ('{}' was "
      "a copy of it), or make the design again",
      task.model.model, (design.folder / "model").string()));
}

}  // namespace oted
