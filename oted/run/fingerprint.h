#pragma once
/// Short names for everything that a result depends on.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "oted/sim/parameter_space.h"

namespace oted {

/// Equal inputs give equal names, others other ones: 16 hexadecimal digits.
std::string Fingerprint(const nlohmann::json& inputs);

/// What parameters are, for fingerprints.
nlohmann::json ParameterIdentity(const ParameterSpace& space);

}  // namespace oted
