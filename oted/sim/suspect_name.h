#pragma once
/// Names of what may be freed.

#include <string>

#include "oted/sim/parameter_space.h"

namespace oted {

/// A name as [parameters] has it without quotes: other characters become underscores.
std::string BareKey(std::string name);

/// `wanted` as a bare key of a parameter file, and with an underscore behind it where a searched parameter has that
/// name.
std::string SuspectName(std::string wanted, const ParameterSpace& searched);

}  // namespace oted
