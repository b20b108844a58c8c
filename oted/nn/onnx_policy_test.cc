// The truth is onnxruntime, on models that onnx's helper functions make.

#include "oted/nn/onnx_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "oted/base/error.h"
#include "oted/base/rng.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/nn/onnx_export.h"

namespace oted::onnx_policy_test {

using testing::AllOf;
using testing::HasSubstr;

/// Models of four observations, one or more for each operator; onnxruntime's outputs go to expected.npz.
constexpr const char* kModels = R"(
import numpy as np, onnx, onnxruntime
from onnx import helper as h, numpy_helper, TensorProto as T
rng = np.random.default_rng(0)
W, W3, b, b3 = (rng.normal(size=s).astype(np.float32) for s in ((4, 4), (4, 3), (4,), (3,)))
observations = rng.normal(size=(6, 4)).astype(np.float32)
np.savez("observations.npz", observations=observations.astype(float))
expected = {}

def c(name, value, dtype=np.float32):
    return numpy_helper.from_array(np.asarray(value, dtype=dtype), name)

def save(name, nodes, constants=(), outputs=("y",), dtype=T.FLOAT, opset=17, batch="batch", **options):
    graph = h.make_graph(nodes, name, [h.make_tensor_value_info("x", dtype, [batch, 4])],
                         [h.make_tensor_value_info(o, dtype, [] if o == "value" else ["b", "k"]) for o in outputs], list(constants))
    model = h.make_model(graph, opset_imports=[h.make_opsetid("", opset)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save_model(model, name + ".onnx", **options)
    session = onnxruntime.InferenceSession(name + ".onnx", providers=["CPUExecutionProvider"])
    feed = observations.astype(np.float64 if dtype == T.DOUBLE else np.float32)
    wanted = "action" if "action" in outputs else outputs[0]
    rows = [feed] if batch == "batch" else [feed[k:k + 1] for k in range(len(feed))]
    expected[name] = np.concatenate([session.run([wanted], {"x": r})[0] for r in rows]).astype(float)

n = h.make_node
for op in ("Abs", "Exp", "Identity", "Neg", "Relu", "Sigmoid", "Softplus", "Softsign", "Tanh", "Elu", "LeakyRelu"):
    save(op, [n(op, ["x"], ["y"])])
save("Elu2", [n("Elu", ["x"], ["y"], alpha=0.3)])
save("LeakyRelu2", [n("LeakyRelu", ["x"], ["y"], alpha=0.3)])
for op in ("Sqrt", "Log"):
    save(op, [n("Abs", ["x"], ["a"]), n(op, ["a"], ["y"])])
for op in ("Add", "Sub", "Mul", "Div", "Max", "Min"):
    save(op + "Vector", [n(op, ["x", "b"], ["y"])], [c("b", b)])
    save(op + "Scalar", [n(op, ["s", "x"], ["y"])], [c("s", 0.7)])
    save(op + "Both", [n("Tanh", ["x"], ["t"]), n(op, ["x", "t"], ["y"])])
    save(op + "Column", [n("Slice", ["x", "i0", "i1", "axis"], ["col"]), n(op, ["x", "col"], ["y"])],
         [c("i0", [1], np.int64), c("i1", [2], np.int64), c("axis", [1], np.int64)])
save("MaxThree", [n("Max", ["x", "b", "s"], ["y"])], [c("b", b), c("s", [[0.1]])])
save("Clip", [n("Clip", ["x", "lo", "hi"], ["y"])], [c("lo", -0.5), c("hi", 0.3)])
save("ClipHigh", [n("Clip", ["x", "", "hi"], ["y"])], [c("hi", 0.3)])
save("Gemm", [n("Gemm", ["x", "W", "b"], ["y"])], [c("W", W3), c("b", b3)])
save("GemmPlain", [n("Gemm", ["x", "W"], ["y"])], [c("W", W3)])
save("GemmTransposed", [n("Gemm", ["x", "W", "b"], ["y"], transB=1, alpha=0.4, beta=1.7)], [c("W", W3.T), c("b", b3)])
save("GemmScalarBias", [n("Gemm", ["x", "W", "b"], ["y"])], [c("W", W3), c("b", 0.3)])
save("MatMul", [n("MatMul", ["x", "W"], ["y"])], [c("W", W3)])
save("Transpose", [n("Transpose", ["W"], ["Wt"], perm=[1, 0]), n("MatMul", ["x", "Wt"], ["y"])], [c("W", W3.T)])
save("Flatten", [n("Flatten", ["x"], ["y"])])
save("Reshape", [n("Reshape", ["x", "shape"], ["y"])], [c("shape", [-1, 4], np.int64)])
save("Concat", [n("Tanh", ["x"], ["t"]), n("Concat", ["x", "t", "x"], ["y"], axis=1)])
save("Slice", [n("Slice", ["x", "a", "b", "axes", "steps"], ["y"])],
     [c("a", [-3], np.int64), c("b", [2**63 - 1], np.int64), c("axes", [-1], np.int64), c("steps", [1], np.int64)])
save("SplitSizes", [n("Split", ["x", "sizes"], ["a", "y"], axis=-1)], [c("sizes", [1, 3], np.int64)])
save("SplitEven", [n("Split", ["x"], ["y", "b"], axis=1)])
save("SplitOdd", [n("Split", ["x"], ["a", "y"], axis=1, num_outputs=2)], opset=18)
save("Cast", [n("Cast", ["x"], ["y"], to=T.FLOAT)])
save("CastInteger", [n("Cast", ["k"], ["f"], to=T.FLOAT), n("Mul", ["x", "f"], ["y"])], [c("k", [1, 2, 3, 4], np.int64)])
save("Constant", [n("Constant", [], ["k"], value=c("v", b)), n("Add", ["x", "k"], ["y"])])
save("ConstantFloat", [n("Constant", [], ["k"], value_float=2.5), n("Add", ["x", "k"], ["y"])])
save("ConstantFloats", [n("Constant", [], ["k"], value_floats=[1.0, 2.0, 3.0, 4.0]), n("Add", ["x", "k"], ["y"])])
save("Double", [n("Gemm", ["x", "W", "b"], ["y"])], [c("W", W3, float), c("b", b3, float)], dtype=T.DOUBLE)
save("ByName", [n("Tanh", ["x"], ["first"]), n("Neg", ["x"], ["action"])], outputs=("first", "action"))
save("FloatData", [n("Mul", ["x", "k"], ["y"])], [h.make_tensor("k", T.FLOAT, [4], [1.0, 2.0, 3.0, 4.0])])
save("ArgMax", [n("ArgMax", ["x"], ["i"], axis=1), n("Cast", ["i"], ["y"], to=T.FLOAT)])
save("Floor", [n("Floor", ["x"], ["y"])])
save("Equal", [n("Floor", ["x"], ["f"]), n("Equal", ["f", "k"], ["e"]), n("Cast", ["e"], ["y"], to=T.FLOAT)], [c("k", [0, -1, 1, 0])])
save("Gather", [n("Gather", ["x", "at"], ["y"], axis=1)], [c("at", [3, 0, 0, -2, 1], np.int64)])
# Images: columns gathered into two channels of 4 x 3, then what convolutions of other programs have.
at, shape = c("at", rng.integers(0, 4, 24), np.int64), c("shape", [-1, 2, 4, 3], np.int64)
image = [n("Gather", ["x", "at"], ["flat"], axis=1), n("Reshape", ["flat", "shape"], ["image"])]
K = c("K", rng.normal(size=(5, 2, 3, 2)))
save("Conv", image + [n("Conv", ["image", "K", "kb"], ["z"]), n("Relu", ["z"], ["r"]), n("Flatten", ["r"], ["y"])],
     [at, shape, K, c("kb", rng.normal(size=5))])
save("ConvStrides", image + [n("Conv", ["image", "K"], ["z"], strides=[2, 1], kernel_shape=[3, 2]), n("Flatten", ["z"], ["y"])], [at, shape, K])
save("ConvPads", image + [n("Conv", ["image", "K"], ["z"], pads=[1, 0, 2, 1], strides=[1, 2]), n("Tanh", ["z"], ["t"]),
     n("Flatten", ["t"], ["y"])], [at, shape, K])
save("ConvTwice", image + [n("Conv", ["image", "K"], ["z"]), n("Conv", ["z", "K2"], ["zz"]), n("Flatten", ["zz"], ["y"])],
     [at, shape, K, c("K2", 0.2 * rng.normal(size=(3, 5, 1, 1)))])
save("GlobalAveragePool", image + [n("GlobalAveragePool", ["image"], ["z"]), n("Flatten", ["z"], ["y"])], [at, shape])
# What other outputs need is not looked at.
save("Unread", [n("Tanh", ["x"], ["y"]), n("ReduceSum", ["x"], ["value"], keepdims=0)], outputs=("y", "value"))
save("External", [n("Gemm", ["x", "W", "b"], ["y"])], [c("W", W3), c("b", b3)], save_as_external_data=True,
     location="External.data", size_threshold=0)
save("FixedBatch", [n("Flatten", ["x"], ["f"]), n("Gemm", ["f", "W", "b"], ["y"])], [c("W", W3), c("b", b3)], batch=1)
np.savez("expected.npz", **expected)
)";

struct Models {
  TestFolder folder;
  NpzArrays expected;
  std::vector<double> observations;
  Models() {
    EXPECT_TRUE(RunPython(kModels, folder));
    expected = ReadNpz(folder / "expected.npz");
    observations = ReadNpz(folder / "observations.npz").at("observations").ToDouble();
  }
  static const Models& Get() {
    static const Models models;
    return models;
  }
};

double Worst(const OnnxValue& actions, const std::vector<double>& expected) {
  double worst = actions.data.size() == expected.size() ? 0 : INFINITY;
  for (size_t i = 0; i < expected.size() && i < actions.data.size(); ++i) {
    const double difference =
        std::abs(static_cast<double>(actions.data[i]) - expected[i]) / (1 + std::abs(expected[i]));
    if (!(difference <= worst)) worst = difference;
  }
  return worst;
}

TEST(OnnxPolicy, EveryOperatorGivesWhatOnnxruntimeGives) {
  const Models& models = Models::Get();
  ASSERT_GT(models.expected.size(), 64u);
  for (const auto& [name, expected] : models.expected) {
    const OnnxPolicy policy = OnnxPolicy::Load(models.folder / (name + ".onnx"));
    EXPECT_LE(Worst(policy.Evaluate(models.observations, 6), expected.ToDouble()), 1e-6) << name;
  }
}

TEST(OnnxPolicy, EveryOperatorIsTested) {
  for (const std::string& op : OnnxOperators()) {
    bool found = false;
    for (const auto& [name, unused] : Models::Get().expected) found = found || name.starts_with(op);
    EXPECT_TRUE(found) << op;
  }
}

TEST(OnnxPolicy, RowsDoNotSeeEachOther) {
  const Models& models = Models::Get();
  for (const char* name : {"Gemm", "Concat", "SubVector"}) {
    const OnnxPolicy policy = OnnxPolicy::Load(models.folder / (std::string(name) + ".onnx"));
    const OnnxValue all = policy.Evaluate(models.observations, 6);
    for (int i = 0; i < 6; ++i) {
      const OnnxValue one = policy.Evaluate(std::span(models.observations).subspan(4 * static_cast<size_t>(i), 4), 1);
      for (int j = 0; j < all.cols; ++j) {
        EXPECT_NEAR(one.data[static_cast<size_t>(j)], all.data[static_cast<size_t>(i * all.cols + j)], 1e-6) << name;
      }
    }
  }
}

TEST(OnnxPolicy, WhatIsNotReadIsNamedWithItsRemedy) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(R"(
import numpy as np, onnx
from onnx import helper as h, numpy_helper, TensorProto as T
def save(name, nodes, shape=("batch", 4), inputs=1, opset=17, constants=(), dtype=T.FLOAT, domain=""):
    graph = h.make_graph(nodes, name, [h.make_tensor_value_info(f"x{k}" if k else "x", dtype, shape) for k in range(inputs)],
                         [h.make_tensor_value_info("y", dtype, None)], list(constants))
    opsets = [h.make_opsetid("", opset)] + ([h.make_opsetid(domain, 1)] if domain else [])
    onnx.save_model(h.make_model(graph, opset_imports=opsets, ir_version=8), name + ".onnx")
n = h.make_node
c = lambda name, value: numpy_helper.from_array(np.asarray(value, dtype=np.float32), name)
save("operator", [n("Tanh", ["x"], ["t"]), n("LSTM", ["t", "t", "t"], ["y"], name="memory", hidden_size=4)])
save("domain", [n("Relu", ["x"], ["y"], domain="com.mine")], domain="com.mine")
save("image", [n("Relu", ["x"], ["y"])], shape=("batch", 3, 64, 64))
save("inputs", [n("Add", ["x", "x1"], ["y"])], inputs=2)
save("old", [n("Relu", ["x"], ["y"])], opset=9)
save("integers", [n("Relu", ["x"], ["y"])], dtype=T.INT64)
save("misfit", [n("MatMul", ["x", "W"], ["y"], name="layer")], constants=[c("W", np.zeros((5, 3)))])
save("undefined", [n("Add", ["x", "nothing"], ["y"])])
save("cycle", [n("Add", ["x", "b"], ["a"]), n("Relu", ["a"], ["b"]), n("Neg", ["b"], ["y"])])
save("axis", [n("Concat", ["x", "x"], ["y"], axis=0)])
save("explosion", [n("Concat", [f"v{k}" if k else "x"] * 16, [f"v{k + 1}" if k < 19 else "y"], axis=1) for k in range(20)])
save("bomb", [n("Add", ["a", "b"], ["c"]), n("Add", ["x", "c"], ["y"])],
     constants=[c("a", np.zeros((60000, 1))), c("b", np.zeros((1, 60000)))])
save("open", [n("Gemm", ["x", "W"], ["y"])], shape=("batch", "width"), constants=[c("W", np.zeros((5, 3)))])
save("weights", [n("Gemm", ["x", "W"], ["y"])], constants=[c("W", np.zeros((4, 3)))])
m = onnx.load("weights.onnx")
t = m.graph.initializer[0]
t.ClearField("raw_data")
t.data_location = onnx.TensorProto.EXTERNAL
for location in ("../secret", "", "..", "/etc/passwd", "missing.data"):
    del t.external_data[:]
    e = t.external_data.add(); e.key = "location"; e.value = location
    onnx.save_model(m, "external%d.onnx" % len(location))
)",
                        folder));
  const auto message = [&](const std::string& name) {
    const std::string path = folder / (name + ".onnx");
    const std::string text = MessageOf<DataError>([&] { OnnxPolicy::Load(path); });
    EXPECT_THAT(text, HasSubstr(folder.path().string())) << name;
    return text;
  };
  EXPECT_THAT(message("operator"),
              AllOf(HasSubstr("'LSTM'"), HasSubstr("'memory'"), HasSubstr("Gemm"), HasSubstr("Tanh")));
  EXPECT_THAT(message("domain"), HasSubstr("com.mine.Relu"));
  EXPECT_THAT(message("image"), AllOf(HasSubstr("[-1, 3, 64, 64]"), HasSubstr("[batch, observations]")));
  EXPECT_THAT(message("inputs"), AllOf(HasSubstr("2 inputs"), HasSubstr("actor alone")));
  EXPECT_THAT(message("old"), AllOf(HasSubstr("opset 9"), HasSubstr("11")));
  EXPECT_THAT(message("integers"), HasSubstr("float32"));
  EXPECT_THAT(message("misfit"), AllOf(HasSubstr("'layer'"), HasSubstr("(2, 4) with (5, 3)")));
  EXPECT_THAT(message("undefined"), HasSubstr("'nothing'"));
  EXPECT_THAT(message("cycle"), HasSubstr("'b'"));
  EXPECT_THAT(message("axis"), HasSubstr("axis 0"));
  EXPECT_THAT(message("explosion"), HasSubstr("columns"));
  EXPECT_THAT(message("bomb"), HasSubstr("60000"));
  for (const char* name : {"external9", "external0", "external2", "external11"}) {
    EXPECT_THAT(message(name), HasSubstr("another folder")) << name;
  }
  EXPECT_THAT(message("external12"), HasSubstr("missing.data"));
  // A device has no end, and the model's own size says nothing of it.
  std::filesystem::create_symlink("/dev/zero", folder / "missing.data");
  EXPECT_THAT(MessageOf<UsageError>([&] { OnnxPolicy::Load(folder / "external12.onnx"); }),
              AllOf(HasSubstr("missing.data"), HasSubstr("device")));
  // The width is open: only a task can say whether it fits.
  const OnnxPolicy open = OnnxPolicy::Load(folder / "open.onnx");
  EXPECT_EQ(open.obs_dim(), 0);
  EXPECT_EQ(open.Evaluate(std::vector<double>(10), 2).cols, 3);
  MessageOf<DataError>([&] { open.Evaluate(std::vector<double>(8), 2); });
  MessageOf<DataError>([&] { OnnxPolicy::Load(folder / "weights.onnx").Evaluate(std::vector<double>(10), 2); });
}

TEST(OnnxPolicy, FilesThatAreNoModelsAreDataErrors) {
  const TestFolder folder;
  const std::string path = folder / "policy.onnx";
  for (const std::string& bytes :
       {std::string(), std::string("not a model"), std::string(1000, '\xff'), std::string(1, '\x3a')}) {
    WriteFileAtomically(path, bytes);
    EXPECT_THAT(MessageOf<DataError>([&] { OnnxPolicy::Load(path); }), HasSubstr(path));
  }
  MessageOf<DataError>([&] { OnnxPolicy::Load(folder / "absent.onnx"); });
  MessageOf<DataError>([&] { OnnxPolicy::Load(folder.path()); });
}

TEST(OnnxPolicy, FiveHundredDamagedFilesAreReadOrRefusedAndNeverCrash) {
  const Models& models = Models::Get();
  TanhGaussianPolicy own(Normalizer{{1, 2, 3, 4}, {1, 2, 3, 4}}, {6, 5}, {-1, -1}, {1, 2});
  Rng init(1);
  own.net().Initialize(init);
  std::vector<std::string> sources = {OnnxBytes(own, {{"task", "Mine-v0"}})};
  for (const char* name : {"GemmTransposed", "Slice", "SplitSizes", "CastInteger", "ClipHigh", "External", "Constant",
                           "Conv", "ConvPads", "GlobalAveragePool", "ArgMax", "Equal"}) {
    sources.push_back(ReadFile(models.folder / (std::string(name) + ".onnx")));
  }
  // Beside External.data, so that its offsets are followed.
  const std::string path = models.folder / "damaged.onnx";
  Rng rng(3);
  int n_refused = 0, n_read = 0;
  for (int k = 0; k < 500; ++k) {
    std::string bytes = sources[static_cast<size_t>(k) % sources.size()];
    const uint64_t kind = rng.Below(6);
    const size_t at = rng.Below(bytes.size());
    if (kind == 0) {
      bytes.resize(at);
    } else if (kind == 1) {
      bytes.erase(at, 1 + rng.Below(8));
    } else if (kind == 2) {
      bytes.insert(at, std::string(1 + rng.Below(8), static_cast<char>(rng.Below(256))));
    } else {
      for (uint64_t i = 0; i <= rng.Below(kind); ++i)
        bytes[rng.Below(bytes.size())] = static_cast<char>(rng.Below(256));
    }
    std::ofstream(path, std::ios::binary) << bytes;  // not synchronised with the disk, 500 times
    try {
      const OnnxPolicy policy = OnnxPolicy::Load(path);
      const OnnxValue actions = policy.Evaluate(models.observations, 6);
      EXPECT_EQ(actions.data.size(), static_cast<size_t>(actions.rows) * static_cast<size_t>(actions.cols));
      ++n_read;
    } catch (const DataError& e) {
      EXPECT_THAT(e.what(), HasSubstr(path));
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      ++n_refused;
    }
  }
  EXPECT_GT(n_refused, 150);
  EXPECT_GT(n_read, 20) << "numbers and names may change without harm";
}

}  // namespace oted::onnx_policy_test
