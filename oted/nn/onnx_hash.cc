#include "oted/nn/onnx_hash.h"

#include <fmt/format.h>

#include <vector>

#include "oted/base/files.h"
#include "oted/nn/onnx_wire.h"

namespace oted {

std::string Sha256OfOnnx(const std::filesystem::path& path) {
  const std::vector<std::string> weights = OnnxWeightFiles(path);
  if (weights.empty()) return Sha256OfFile(path);
  std::string lines = fmt::format("{}  {}\n", Sha256OfFile(path), path.filename().string());
  for (const std::string& name : weights) {
    lines += fmt::format("{}  {}\n", Sha256OfFile(path.parent_path() / name), name);
  }
  return Sha256(lines);
}

}  // namespace oted
