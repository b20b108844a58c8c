#include "oted/base/process.h"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

namespace oted {

std::optional<uint64_t> ProcessStart(int pid) {
  std::ifstream stream(fmt::format("/proc/{}/stat", pid));
  std::string line;
  std::getline(stream, line);
  // The name in brackets may hold anything. The first word behind it is the state, the 20th the start.
  const size_t name_end = line.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream words(line.substr(name_end + 1));
  std::string word;
  words >> word;
  if (word == "Z" || word == "X") return 0;
  for (int i = 1; i < 20; ++i) words >> word;
  return std::strtoull(word.c_str(), nullptr, 10);
}

}  // namespace oted
