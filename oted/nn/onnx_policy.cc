#include "oted/nn/onnx_policy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int64_t kOldestOpset = 11;            // ONNX 1.6, 2019: since then these operators have kept their form
constexpr int64_t kMaxColumns = 1 << 20;        // of all values of a graph together; a policy has some 10^3
constexpr size_t kMaxFolded = size_t{1} << 27;  // numbers of all constants that are computed from others

std::string Title(const OnnxNode& node) {
  return node.name.empty() ? fmt::format("{} node", node.op) : fmt::format("node '{}' ({})", node.name, node.op);
}

}  // namespace

OnnxPolicy OnnxPolicy::Load(const std::filesystem::path& path, const std::string& output_name) {
  OnnxFile file = ReadOnnx(path);
  OnnxPolicy policy;
  policy.path_ = path.string();
  policy.metadata_ = std::move(file.metadata);
  const auto fail = [&](const std::string& what) { policy.Fail(what); };
  if (file.opset < kOldestOpset) {
    fail(fmt::format("uses opset {}, wanted {} or later; export it again with a newer one", file.opset, kOldestOpset));
  }
  if (file.inputs.size() != 1) {
    fail(fmt::format("has {} inputs, wanted one, the observation; export the actor alone", file.inputs.size()));
  }
  const OnnxInterface& input = file.inputs[0];
  if (!input.is_real()) {
    fail(fmt::format("takes input '{}' of element type {}, wanted float32; export it so", input.name,
                     input.element_type));
  }
  if (input.dims.size() != 2 || input.dims[1] == 0 || input.dims[1] > (1 << 16)) {
    fail(fmt::format("takes input '{}' of shape [{}], wanted [batch, observations]; images and sequences are not read",
                     input.name, fmt::join(input.dims, ", ")));
  }
  policy.input_ = input.name;
  policy.obs_dim_ = static_cast<int>(std::max<int64_t>(input.dims[1], 0));
  if (file.outputs.empty()) fail("has no output");
  policy.output_ = file.outputs.front().name;
  for (const std::string& name : {std::string("action"), output_name}) {
    const auto is_it = [&](const OnnxInterface& output) { return output.name == name; };
    if (std::ranges::any_of(file.outputs, is_it)) policy.output_ = name;
  }

  // From the output back: only what it needs must be understood.
  std::set<std::string> needed = {policy.output_};
  for (auto node = file.nodes.rbegin(); node != file.nodes.rend(); ++node) {
    const auto wanted = [&](const std::string& name) { return !name.empty() && needed.contains(name); };
    if (std::none_of(node->outputs.begin(), node->outputs.end(), wanted)) continue;
    const std::vector<std::string> known = OnnxOperators();
    const bool is_standard = node->domain.empty() || node->domain == "ai.onnx";
    if (!is_standard || std::find(known.begin(), known.end(), node->op) == known.end()) {
      fail(fmt::format("needs operator '{}{}{}' ({}), which is not read; there are {}", node->domain,
                       node->domain.empty() ? "" : ".", node->op, Title(*node), fmt::join(known, ", ")));
    }
    needed.insert(node->inputs.begin(), node->inputs.end());
    policy.nodes_.push_back(*node);
  }
  std::reverse(policy.nodes_.begin(), policy.nodes_.end());
  if (policy.nodes_.empty()) fail(fmt::format("has no node that makes its output '{}'", policy.output_));
  for (auto& [name, tensor] : file.initializers) {
    if (!needed.contains(name)) continue;
    try {
      policy.constants_[name] = ConstantValue(tensor);
    } catch (const DataError& e) {
      fail(fmt::format("{} as '{}', which is not read", e.what(), name));
    }
  }
  policy.FoldConstants();
  // Misfits show now, not in the middle of an episode.
  if (policy.obs_dim_ > 0) policy.Evaluate(std::vector<double>(2 * static_cast<size_t>(policy.obs_dim_)), 2);
  return policy;
}

std::vector<OnnxValue> OnnxPolicy::Apply(const OnnxNode& node, const std::map<std::string, OnnxValue>& values) const {
  std::vector<const OnnxValue*> inputs;
  for (const std::string& name : node.inputs) {
    inputs.push_back(nullptr);
    if (name.empty()) continue;
    if (const auto value = values.find(name); value != values.end()) {
      inputs.back() = &value->second;
    } else if (const auto constant = constants_.find(name); constant != constants_.end()) {
      inputs.back() = &constant->second;
    } else {
      Fail(fmt::format("has a {} whose input '{}' nothing makes before it; export it again", Title(node), name));
    }
  }
  try {
    return ApplyOnnx(node, inputs);
  } catch (const DataError& e) {
    Fail(fmt::format("is not read: its {} {}", Title(node), e.what()));
  }
}

void OnnxPolicy::FoldConstants() {
  std::vector<OnnxNode> rest;
  size_t n_numbers = 0;
  for (OnnxNode& node : nodes_) {
    const auto is_constant = [&](const std::string& name) { return name.empty() || constants_.contains(name); };
    if (!std::all_of(node.inputs.begin(), node.inputs.end(), is_constant)) {
      rest.push_back(std::move(node));
      continue;
    }
    std::vector<OnnxValue> outputs = Apply(node, {});
    for (size_t k = 0; k < std::min(outputs.size(), node.outputs.size()); ++k) {
      n_numbers += outputs[k].data.size();
      if (n_numbers > kMaxFolded) Fail("is larger than any policy that is read");
      constants_[node.outputs[k]] = std::move(outputs[k]);
    }
  }
  nodes_ = std::move(rest);
}

void OnnxPolicy::Fail(const std::string& what) const {
  throw DataError(fmt::format("ONNX model '{}' {}", path_, what));
}

OnnxValue OnnxPolicy::Evaluate(std::span<const double> observations, int n) const {
  OTED_CHECK(n > 0 && observations.size() % static_cast<size_t>(n) == 0);
  const int width = static_cast<int>(observations.size()) / n;
  if (obs_dim_ > 0 && width != obs_dim_) Fail(fmt::format("takes {} observations, got {}", obs_dim_, width));
  std::map<std::string, OnnxValue> values;
  OnnxValue& input = values[input_];
  input.is_batch = true;
  input.rows = n;
  input.cols = width;
  for (const double v : observations) input.data.push_back(static_cast<float>(v));

  int64_t n_columns = 0;
  for (const OnnxNode& node : nodes_) {
    std::vector<OnnxValue> outputs = Apply(node, values);
    for (size_t k = 0; k < std::min(outputs.size(), node.outputs.size()); ++k) {
      n_columns += outputs[k].cols;
      if (n_columns > kMaxColumns) Fail("is larger than any policy that is read");
      values[node.outputs[k]] = std::move(outputs[k]);
    }
  }
  OnnxValue output;
  if (const auto value = values.find(output_); value != values.end()) {
    output = std::move(value->second);
  } else if (const auto constant = constants_.find(output_); constant != constants_.end()) {
    output = constant->second;
  }
  if (!output.image.empty()) Fail(fmt::format("makes images as its output '{}'", output_));
  if (output.data.empty()) Fail(fmt::format("makes no numbers as its output '{}'", output_));
  if (output.is_batch) return output;
  if (output.rows != 1) Fail(fmt::format("makes a constant matrix as its output '{}'", output_));
  // The same action whatever the observation.
  const AlignedVector<float> row = output.data;
  for (int i = 1; i < n; ++i) output.data.insert(output.data.end(), row.begin(), row.end());
  output.is_batch = true;
  output.rows = n;
  return output;
}

}  // namespace oted
