#pragma once
/// What options that take a number accept, and how they refuse another.

#include <CLI/CLI.hpp>

namespace oted::cli {

/// A finite number above zero.
const CLI::Validator& PositiveNumber();
/// A finite number, zero or above.
const CLI::Validator& NonNegativeNumber();

}  // namespace oted::cli
