#pragma once
/// Names of what may be freed.

#include <string>
#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// A name as [parameters] has it without quotes: other characters become underscores.
std::string BareKey(std::string name);

/// Makes names bare keys of a parameter file, and puts underscores behind those that a searched parameter, one of
/// `others` or one before them has.
void NameApart(std::vector<ParameterSpec>& suspects, const ParameterSpace& searched,
               const std::vector<ParameterSpec>& others = {});

}  // namespace oted
