#pragma once
/// What tells one ONNX model from another.

#include <filesystem>
#include <string>

namespace oted {

/// Of the model's file; where weights lie in files beside it, of the lines "<SHA-256>  <name>\n" of the model and then
/// of these, sorted by name. @throws DataError when it is no model, or a file is missing
std::string Sha256OfOnnx(const std::filesystem::path& path);

}  // namespace oted
