// oted, and one more task: build/dev/custom_task collect --task Thermostat-v0 --policy noise:0.5 --out room.npz ...

#include "cli/main.h"

#include "examples/custom_task/thermostat.h"
#include "oted/config/task_registry.h"

int main(int argc, char** argv) {
  oted::RegisterTask("Thermostat-v0", [](const std::vector<oted::ParameterSpec>& parameters) {
    return std::make_unique<oted::ThermostatFactory>(parameters);
  });
  return oted::cli::Main(argc, argv);
}
