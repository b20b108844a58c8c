#include "cli/versions.h"

#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/sim/mujoco/version.h"

namespace oted::cli {

std::string Cpu() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

std::string Now() {
  const std::time_t now = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  return text;
}

void WriteVersions(const std::filesystem::path& run_directory, const std::string& command_line,
                   const std::string& started) {
  nlohmann::json versions = {{"oted", OTED_VERSION},
                             {"mujoco", MujocoVersion()},
                             {"cpu", Cpu()},
                             {"command", command_line},
                             {"started", started}};
  Seal(versions);
  WriteJson(run_directory / "versions.json", versions);
}

std::string CommandLine(int argc, char** argv) {
  std::string line = "oted";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool plain = word.find_first_of(" *'\"[]$&|;<>()") == std::string::npos;
    line += plain ? " " + word : " '" + word + "'";
  }
  return line;
}

}  // namespace oted::cli
