#include "oted/nn/onnx_operators.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "oted/nn/gemm.h"
#include "oted/nn/onnx_call.h"
#include "oted/nn/onnx_image_operators.h"

namespace oted {

using onnx::Call, onnx::Fail, onnx::Shaped, onnx::kMaxConstant, onnx::kMaxWidth;

namespace {

template <class F>
OnnxValue Unary(const Call& call, F f) {
  OnnxValue y = call.Number(0);
  for (float& v : y.data) v = f(v);
  return y;
}

/// Element by element; rows and columns of one broadcast.
template <class F>
OnnxValue Binary(const OnnxValue& a, const OnnxValue& b, F f) {
  const bool is_batch = a.is_batch || b.is_batch;
  const auto fits = [&](const OnnxValue& x, const OnnxValue& y) { return x.cols == y.cols || x.cols == 1; };
  const bool rows_fit = a.rows == b.rows || (a.rows == 1 && !a.is_batch) || (b.rows == 1 && !b.is_batch);
  const bool is_matrix = is_batch && ((!a.is_batch && a.rows > 1) || (!b.is_batch && b.rows > 1));
  if (!rows_fit || is_matrix || !(fits(a, b) || fits(b, a))) {
    Fail(fmt::format("cannot combine ({}, {}) with ({}, {})", a.rows, a.cols, b.rows, b.cols));
  }
  OnnxValue y = Shaped(is_batch, std::max(a.rows, b.rows), std::max(a.cols, b.cols));
  const auto stride = [](const OnnxValue& x) {
    return std::pair(x.rows == 1 ? size_t{0} : static_cast<size_t>(x.cols), x.cols == 1 ? size_t{0} : size_t{1});
  };
  const auto [a_row, a_col] = stride(a);
  const auto [b_row, b_col] = stride(b);
  float* out = y.data.data();
  for (size_t i = 0; i < static_cast<size_t>(y.rows); ++i) {
    for (size_t j = 0; j < static_cast<size_t>(y.cols); ++j) {
      *out++ = f(a.data[i * a_row + j * a_col], b.data[i * b_row + j * b_col]);
    }
  }
  return y;
}

/// Min and Max take any number of inputs.
template <class F>
OnnxValue Fold(const Call& call, F f) {
  OnnxValue y = call.Number(0);
  for (size_t k = 1; k < call.inputs.size(); ++k) y = Binary(y, call.Number(k), f);
  return y;
}

OnnxValue Clip(const Call& call) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  float low = call.Float("min", -kLargest), high = call.Float("max", kLargest);
  const auto bound = [&](size_t k, float& value) {
    if (!call.Has(k)) return;
    if (call.Constant(k).data.size() != 1) Fail("takes scalars as bounds");
    value = call.Constant(k).data[0];
  };
  bound(1, low);
  bound(2, high);
  return Unary(call, [&](float v) { return std::isnan(v) ? v : std::min(std::max(v, low), high); });
}

/// x (rows, k) times w, which is (k, m), or (m, k) where transposed.
OnnxValue Product(const OnnxValue& x, const OnnxValue& w, bool transposed) {
  const int k = transposed ? w.cols : w.rows, m = transposed ? w.rows : w.cols;
  if (x.cols != k) Fail(fmt::format("cannot multiply ({}, {}) with ({}, {})", x.rows, x.cols, k, m));
  OnnxValue y = Shaped(x.is_batch, x.rows, m);
  Gemm(Op::kNone, transposed ? Op::kTranspose : Op::kNone, x.rows, m, k, x.data.data(), k, w.data.data(), w.cols, 0,
       y.data.data(), m);
  return y;
}

OnnxValue GemmNode(const Call& call) {
  if (call.Integer("transA", 0) != 0) Fail("with transA is not read");
  OnnxValue y = Product(call.Number(0), call.Constant(1), call.Integer("transB", 0) != 0);
  const float alpha = call.Float("alpha", 1), beta = call.Float("beta", 1);
  if (alpha != 1) {
    for (float& v : y.data) v *= alpha;
  }
  if (!call.Has(2)) return y;
  const OnnxValue& c = call.Constant(2);
  if (c.cols > y.cols) Fail(fmt::format("adds {} columns to {}", c.cols, y.cols));
  return Binary(y, c, [&](float v, float bias) { return v + beta * bias; });
}

/// The axis of columns, in either way of counting.
void CheckColumns(int64_t axis) {
  if (axis != 1 && axis != -1) Fail(fmt::format("along axis {} is not read, along the last one is", axis));
}

OnnxValue Columns(const OnnxValue& x, int64_t begin, int64_t end) {
  if (begin < 0 || begin >= end || end > x.cols) Fail(fmt::format("takes columns {} to {} of {}", begin, end, x.cols));
  OnnxValue y = Shaped(x.is_batch, x.rows, static_cast<int>(end - begin));
  for (int i = 0; i < x.rows; ++i) {
    const float* row = x.data.data() + static_cast<size_t>(i) * static_cast<size_t>(x.cols) + begin;
    std::copy_n(row, y.cols, y.data.data() + static_cast<size_t>(i) * static_cast<size_t>(y.cols));
  }
  return y;
}

OnnxValue Slice(const Call& call) {
  const OnnxValue& x = call.Batch(0);
  const auto one = [&](size_t k, int64_t otherwise) {
    if (!call.Has(k)) return otherwise;
    if (call.Integers(k).size() != 1) Fail("along several axes is not read");
    return call.Integers(k)[0];
  };
  CheckColumns(one(3, 0));
  if (one(4, 1) != 1) Fail("with a step other than 1 is not read");
  const auto bound = [&](int64_t at) {
    return std::clamp<int64_t>(at < 0 ? std::max<int64_t>(at, -x.cols) + x.cols : at, 0, x.cols);
  };
  return Columns(x, bound(one(1, 0)), bound(one(2, x.cols)));
}

std::vector<OnnxValue> Split(const Call& call) {
  const OnnxValue& x = call.Batch(0);
  CheckColumns(call.Integer("axis", 0));
  const int64_t n = static_cast<int64_t>(call.node.outputs.size());
  std::vector<int64_t> widths;
  if (call.Has(1)) {
    widths = call.Integers(1);
  } else if (call.HasAttribute("split")) {
    widths = call.node.attributes.at("split").integers;
  } else {
    const int64_t width = (x.cols + n - 1) / n;  // the last part may be smaller
    for (int64_t k = 0; k < n; ++k) widths.push_back(std::min(width, x.cols - k * width));
  }
  if (static_cast<int64_t>(widths.size()) != n) Fail(fmt::format("has {} outputs for {} parts", n, widths.size()));
  std::vector<OnnxValue> parts;
  int64_t at = 0;
  for (const int64_t width : widths) {
    if (width < 1 || width > x.cols - at) Fail("has parts that do not add up");
    parts.push_back(Columns(x, at, at + width));
    at += width;
  }
  if (at != x.cols) Fail("has parts that do not add up");
  return parts;
}

OnnxValue Concat(const Call& call) {
  CheckColumns(call.Integer("axis", 0));
  int64_t cols = 0;
  for (size_t k = 0; k < call.inputs.size(); ++k) cols += call.Batch(k).cols;
  OnnxValue y = Shaped(true, call.Batch(0).rows, static_cast<int>(std::min<int64_t>(cols, kMaxWidth + 1)));
  int64_t at = 0;
  for (const OnnxValue* x : call.inputs) {
    for (int i = 0; i < y.rows; ++i) {
      std::copy_n(x->data.data() + static_cast<size_t>(i) * static_cast<size_t>(x->cols), x->cols,
                  y.data.data() + static_cast<size_t>(i) * static_cast<size_t>(y.cols) + at);
    }
    at += x->cols;
  }
  return y;
}

OnnxValue Transpose(const Call& call) {
  const OnnxValue& x = call.Constant(0);
  if (call.HasAttribute("perm") && call.node.attributes.at("perm").integers != std::vector<int64_t>{1, 0}) {
    Fail("with such a perm is not read");
  }
  OnnxValue y = Shaped(false, x.cols, x.rows);
  for (int i = 0; i < x.rows; ++i) {
    for (int j = 0; j < x.cols; ++j) {
      y.data[static_cast<size_t>(j) * static_cast<size_t>(y.cols) + static_cast<size_t>(i)] =
          x.data[static_cast<size_t>(i) * static_cast<size_t>(x.cols) + static_cast<size_t>(j)];
    }
  }
  return y;
}

/// Rows are observations and stay so: what is read is the old shape, and rows as images.
OnnxValue Reshape(const Call& call) {
  const OnnxValue& x = call.Batch(0);
  const std::vector<int64_t>& shape = call.Integers(1);
  if (shape.size() == 4 && shape[0] <= 0) {
    int64_t size = 1;
    for (size_t d = 1; d < 4; ++d) size = shape[d] >= 1 && shape[d] <= x.cols ? size * shape[d] : -1;
    if (size != x.cols) Fail("to images of another size is not read");
    OnnxValue y = x;
    y.image = {static_cast<int>(shape[1]), static_cast<int>(shape[2]), static_cast<int>(shape[3])};
    return y;
  }
  const bool keeps = shape.size() == 2 && (shape[1] == x.cols || (shape[1] == -1 && shape[0] != -1));
  if (!keeps) Fail("to another number of columns is not read");
  return x;
}

OnnxValue Flatten(const Call& call) {
  if (call.Integer("axis", 1) != 1) Fail("at an axis other than 1 is not read");
  OnnxValue y = call.Batch(0);
  y.image.clear();
  return y;
}

OnnxValue Gather(const Call& call) {
  const OnnxValue& x = call.Batch(0);
  CheckColumns(call.Integer("axis", 0));
  const std::vector<int64_t>& columns = call.Integers(1);
  OnnxValue y = Shaped(true, x.rows, static_cast<int>(std::min<size_t>(columns.size(), kMaxWidth + 1)));
  float* out = y.data.data();
  for (int i = 0; i < x.rows; ++i) {
    for (const int64_t at : columns) {
      const int64_t column = at < 0 ? at + x.cols : at;
      if (column < 0 || column >= x.cols) Fail(fmt::format("takes column {} of {}", at, x.cols));
      *out++ = x.data[static_cast<size_t>(i) * static_cast<size_t>(x.cols) + static_cast<size_t>(column)];
    }
  }
  return y;
}

/// The index of the largest number of each row, as a number.
OnnxValue ArgMax(const Call& call) {
  const OnnxValue& x = call.Batch(0);
  CheckColumns(call.Integer("axis", 0));
  if (call.Integer("select_last_index", 0) != 0) Fail("with select_last_index is not read");
  OnnxValue y = Shaped(true, x.rows, 1);
  for (size_t i = 0; i < y.data.size(); ++i) {
    const float* row = x.data.data() + i * static_cast<size_t>(x.cols);
    y.data[i] = static_cast<float>(std::max_element(row, row + x.cols) - row);
  }
  return y;
}

OnnxValue Cast(const Call& call) {
  const int64_t to = call.Integer("to", 0);
  if (to != 1 && to != 11) Fail("to another type than float32 or float64 is not read");
  OnnxValue y = call.Any(0);
  if (y.data.empty()) {
    for (const int64_t v : y.integers) y.data.push_back(static_cast<float>(v));
    y.integers.clear();
  }
  return y;
}

OnnxValue ConstantNode(const Call& call) {
  const auto& attributes = call.node.attributes;
  OnnxTensor tensor;
  if (const auto value = attributes.find("value"); value != attributes.end()) {
    tensor = value->second.tensor;
  } else if (const auto f = attributes.find("value_float"); f != attributes.end()) {
    tensor.floats = {f->second.f};
  } else if (const auto fs = attributes.find("value_floats"); fs != attributes.end()) {
    tensor.floats = fs->second.floats;
    tensor.shape = {static_cast<int64_t>(tensor.floats.size())};
  } else if (const auto i = attributes.find("value_int"); i != attributes.end()) {
    tensor.is_integer = true;
    tensor.integers = {i->second.i};
  } else if (const auto is = attributes.find("value_ints"); is != attributes.end()) {
    tensor.is_integer = true;
    tensor.integers = is->second.integers;
    tensor.shape = {static_cast<int64_t>(tensor.integers.size())};
  } else {
    Fail("has no value that is read");
  }
  return ConstantValue(tensor);
}

using Operator = std::vector<OnnxValue> (*)(const Call&);

template <OnnxValue (*F)(const Call&)>
std::vector<OnnxValue> One(const Call& call) {
  return {F(call)};
}

float Softplus(float v) { return v > 20 ? v : std::log1p(std::exp(v)); }

/// Lambdas without captures, so that the table is one of plain functions.
const std::map<std::string, Operator, std::less<>>& Table() {
  using V = std::vector<OnnxValue>;
  static const std::map<std::string, Operator, std::less<>> table = {
      {"Abs", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::abs(v); })}; }},
      {"Add", [](const Call& c) -> V { return {Binary(c.Number(0), c.Number(1), std::plus<float>())}; }},
      {"ArgMax", One<ArgMax>},
      {"Cast", One<Cast>},
      {"Clip", One<Clip>},
      {"Concat", One<Concat>},
      {"Constant", One<ConstantNode>},
      {"Conv", One<OnnxConv>},
      {"Div", [](const Call& c) -> V { return {Binary(c.Number(0), c.Number(1), std::divides<float>())}; }},
      {"Elu",
       [](const Call& c) -> V {
         const float alpha = c.Float("alpha", 1);
         return {Unary(c, [alpha](float v) { return v < 0 ? alpha * std::expm1(v) : v; })};
       }},
      {"Equal",
       [](const Call& c) -> V {
         return {Binary(c.Number(0), c.Number(1), [](float a, float b) { return a == b ? 1.0f : 0.0f; })};
       }},
      {"Exp", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::exp(v); })}; }},
      {"Flatten", One<Flatten>},
      {"Floor", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::floor(v); })}; }},
      {"Gather", One<Gather>},
      {"Gemm", One<GemmNode>},
      {"GlobalAveragePool", One<OnnxGlobalAveragePool>},
      {"Identity", [](const Call& c) -> V { return {c.Any(0)}; }},
      {"LeakyRelu",
       [](const Call& c) -> V {
         const float alpha = c.Float("alpha", 0.01f);
         return {Unary(c, [alpha](float v) { return v < 0 ? alpha * v : v; })};
       }},
      {"Log", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::log(v); })}; }},
      {"MatMul", [](const Call& c) -> V { return {Product(c.Number(0), c.Constant(1), false)}; }},
      {"Max", [](const Call& c) -> V { return {Fold(c, [](float a, float b) { return std::max(a, b); })}; }},
      {"Min", [](const Call& c) -> V { return {Fold(c, [](float a, float b) { return std::min(a, b); })}; }},
      {"Mul", [](const Call& c) -> V { return {Binary(c.Number(0), c.Number(1), std::multiplies<float>())}; }},
      {"Neg", [](const Call& c) -> V { return {Unary(c, [](float v) { return -v; })}; }},
      {"Relu", [](const Call& c) -> V { return {Unary(c, [](float v) { return v < 0 ? 0 : v; })}; }},
      {"Reshape", One<Reshape>},
      {"Sigmoid", [](const Call& c) -> V { return {Unary(c, [](float v) { return 1 / (1 + std::exp(-v)); })}; }},
      {"Slice", One<Slice>},
      {"Softplus", [](const Call& c) -> V { return {Unary(c, Softplus)}; }},
      {"Softsign", [](const Call& c) -> V { return {Unary(c, [](float v) { return v / (1 + std::abs(v)); })}; }},
      {"Split", Split},
      {"Sqrt", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::sqrt(v); })}; }},
      {"Sub", [](const Call& c) -> V { return {Binary(c.Number(0), c.Number(1), std::minus<float>())}; }},
      {"Tanh", [](const Call& c) -> V { return {Unary(c, [](float v) { return std::tanh(v); })}; }},
      {"Transpose", One<Transpose>},
  };
  return table;
}

}  // namespace

OnnxValue ConstantValue(const OnnxTensor& tensor) {
  const size_t rank = tensor.shape.size(), size = tensor.is_integer ? tensor.integers.size() : tensor.floats.size();
  const bool is_filter = rank == 4 && !tensor.is_integer;
  if ((rank > 2 && !is_filter) || size == 0) {
    Fail(fmt::format("has a constant of {} dimensions and {} numbers", rank, size));
  }
  OnnxValue value;
  if (is_filter) {
    for (const int64_t n : tensor.shape) {
      if (n < 1 || n > kMaxWidth) Fail(fmt::format("has a constant whose dimension is {}", n));
    }
    if (static_cast<int64_t>(size) > kMaxConstant) Fail(fmt::format("has a constant of {} numbers", size));
    value.rows = static_cast<int>(tensor.shape[0]);
    value.cols = static_cast<int>(size / static_cast<size_t>(value.rows));
    for (size_t d = 1; d < 4; ++d) value.image.push_back(static_cast<int>(tensor.shape[d]));
    value.data.assign(tensor.floats.begin(), tensor.floats.end());
    return value;
  }
  const int64_t rows = rank == 2 ? tensor.shape[0] : 1, cols = rank == 0 ? 1 : tensor.shape[rank - 1];
  if (rows > kMaxWidth || cols > kMaxWidth) Fail(fmt::format("has a constant of ({}, {}) numbers", rows, cols));
  value.rows = static_cast<int>(rows);
  value.cols = static_cast<int>(cols);
  value.data.assign(tensor.floats.begin(), tensor.floats.end());
  value.integers = tensor.integers;
  if (tensor.is_integer) value.data.clear();
  return value;
}

std::vector<std::string> OnnxOperators() {
  std::vector<std::string> names;
  for (const auto& [name, unused] : Table()) names.push_back(name);
  return names;
}

std::vector<OnnxValue> ApplyOnnx(const OnnxNode& node, std::span<const OnnxValue* const> inputs) {
  const auto found = Table().find(node.op);
  OTED_CHECK(found != Table().end());
  static const std::set<std::string> takes_images = {
      "Abs",      "Clip",      "Conv", "Elu", "Exp",  "Flatten", "Floor",    "GlobalAveragePool",
      "Identity", "LeakyRelu", "Log",  "Neg", "Relu", "Sigmoid", "Softplus", "Softsign",
      "Sqrt",     "Tanh"};
  const bool has_image =
      std::ranges::any_of(inputs, [](const OnnxValue* x) { return x != nullptr && !x->image.empty(); });
  if (has_image && !takes_images.contains(node.op)) Fail("is not read on images; flatten them before it");
  return found->second({node, inputs});
}

}  // namespace oted
