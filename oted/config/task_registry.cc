#include "oted/config/task_registry.h"

#include <fmt/format.h>

#include <map>
#include <mutex>

#include "oted/base/error.h"

namespace oted {
namespace {

struct Registry {
  std::mutex mutex;
  std::map<std::string, TaskMaker> makers;
};

Registry& TheRegistry() {
  static Registry registry;
  return registry;
}

}  // namespace

void RegisterTask(const std::string& name, TaskMaker make) {
  const std::lock_guard lock(TheRegistry().mutex);
  TheRegistry().makers[name] = std::move(make);
}

std::unique_ptr<SimulatorFactory> MakeRegisteredTask(const std::string& name,
                                                     const std::vector<ParameterSpec>& parameters) {
  TaskMaker make;
  {
    const std::lock_guard lock(TheRegistry().mutex);
    const auto found = TheRegistry().makers.find(name);
    if (found == TheRegistry().makers.end()) {
      if (!name.starts_with(kOfPython)) return nullptr;
      throw UsageError(
          fmt::format("task '{}' is an environment of a Python program and not known here; in Python, make its "
                      "oted.GymSimulator with that name and version first",
                      name));
    }
    make = found->second;
  }
  return make(parameters);
}

}  // namespace oted
