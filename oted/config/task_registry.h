#pragma once
/// Tasks that a program adds to the built-in ones: see examples/custom_task.

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

/// Makes the simulators of a task with the given parameters. @throws UsageError for a parameter that it does not have
using TaskMaker = std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>& parameters)>;

/// Makes `name` a task from here on: in [task] name, --task and MakeSimulatorFactory. Call it before any work starts; a
/// name that is registered already gets the new maker.
void RegisterTask(const std::string& name, TaskMaker make);

/// What names of tasks begin with that a Python program registered: they live as long as that program.
inline constexpr std::string_view kOfPython = "python:";

/// Null when no task of that name was registered. @throws UsageError for one of a Python program that did not register
/// it
std::unique_ptr<SimulatorFactory> MakeRegisteredTask(const std::string& name,
                                                     const std::vector<ParameterSpec>& parameters);

}  // namespace oted
