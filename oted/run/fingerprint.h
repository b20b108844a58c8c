#pragma once
/// Short names for everything that a result depends on.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "oted/config/run_config.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// Equal inputs give equal names, others other ones: 16 hexadecimal digits.
std::string Fingerprint(const nlohmann::json& inputs);

/// What parameters are, for fingerprints.
nlohmann::json ParameterIdentity(const ParameterSpace& space);

/// What every stage begins with, beside settings of its own. What it refers to must outlive it.
struct InputsOfRun {
  const RunConfig& config;
  const std::string& model_sha256;
  const std::string& dataset_sha256;
};

/// The task, for fingerprints.
nlohmann::json TaskIdentity(const InputsOfRun& inputs);
/// Logs, the task as a design sees it, and seed, for fingerprints.
nlohmann::json DataIdentity(const InputsOfRun& inputs);
/// What tells whether run.toml is the one that a design was made with.
std::string InputsFingerprint(const InputsOfRun& inputs, const ParameterSpace& space);

}  // namespace oted
