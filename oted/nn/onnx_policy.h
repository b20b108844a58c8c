#pragma once
/// Policies of other programs, and our own, from ONNX files: feed-forward graphs of the operators of
/// docs/file_formats.md. No ONNX runtime is needed.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "oted/nn/onnx_operators.h"

namespace oted {

/// A graph with one input, (batch, obs_dim), whose named output, else `action`, else the first, is (batch, k). What
/// other outputs need is not looked at. Computes in float32; actions are as the graph gives them.
class OnnxPolicy {
 public:
  /// @throws DataError naming the file: not ONNX, damaged, a graph of another form, or an operator that is not read,
  /// with the list of those that are.
  static OnnxPolicy Load(const std::filesystem::path& path, const std::string& output_name = "action");

  /// The width of the input; 0 where the file leaves it open.
  int obs_dim() const { return obs_dim_; }
  const std::map<std::string, std::string>& metadata() const { return metadata_; }

  /// observations (n, obs_dim) -> (n, k). k is the graph's, the same for every n.
  /// @throws DataError when the graph does not take so many observations, or its parts do not fit together.
  OnnxValue Evaluate(std::span<const double> observations, int n) const;

 private:
  [[noreturn]] void Fail(const std::string& what) const;
  std::vector<OnnxValue> Apply(const OnnxNode& node, const std::map<std::string, OnnxValue>& values) const;
  /// Nodes that no observation reaches become constants.
  void FoldConstants();

  std::string path_;
  std::string input_, output_;
  int obs_dim_ = 0;
  std::map<std::string, std::string> metadata_;
  std::vector<OnnxNode> nodes_;  // those that the output needs, in order
  std::map<std::string, OnnxValue> constants_;
};

}  // namespace oted
