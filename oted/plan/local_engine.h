#pragma once
/// Units as child processes on this machine.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "oted/base/log.h"

namespace oted {

struct LocalEngine {
  /// The command of one unit.
  std::function<std::vector<std::string>(int index)> words;
  /// Where what it prints goes.
  std::function<std::filesystem::path(int index)> log;
  int at_once = 1;
  /// Called about once a second.
  std::function<void()> look;
};

/// Runs each unit once, in order, `at_once` at a time. What a unit ends with is in its records.
/// @throws Interrupted when the context's stop flag is set, after the units have been told and have ended
void RunHere(const std::vector<int>& indices, const LocalEngine& engine, const RunContext& context);

}  // namespace oted
