#pragma once
/// toml++, for files from anywhere. Include this in place of <toml++/toml.h>.
///
/// toml++ asserts, and in release builds lets the compiler assume, things that a malformed file makes untrue (a line
/// end where a key should stand in an inline table), although its parser handles them a few lines later. Both are off
/// here.

#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_ASSERT(condition) static_assert(true)
#define TOML_EXCEPTIONS 1
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")
