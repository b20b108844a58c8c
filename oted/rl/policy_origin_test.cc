#include "oted/rl/policy_origin.h"

#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/batch_policy.h"
#include "oted/sim/testing.h"

namespace oted::policy_origin_test {

using Sentences = std::vector<std::string>;

SimulatorSpec Task() {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.observation_names = {"x", "v"};
  spec.action_names = {"force"};
  spec.action_low = {-1};
  spec.action_high = {1};
  spec.control_period_s = 0.02;
  return spec;
}

/// Both files of a policy that was made for Task().
class OtherThanItsTaskTest : public testing::Test {
 protected:
  void SetUp() override {
    const TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
    policy.Save(folder_ / "policy.npz");
    WriteOnnx(policy, PolicyMetadata(Task(), ""), folder_ / "policy.onnx");
  }
  Sentences Of(const char* name, const SimulatorSpec& spec) const { return OtherThanItsTask(folder_ / name, spec); }

 private:
  const TestFolder folder_;
};

TEST_F(OtherThanItsTaskTest, NothingInItsOwnTask) {
  EXPECT_EQ(Of("policy.npz", Task()), Sentences{});
  EXPECT_EQ(Of("policy.onnx", Task()), Sentences{});
}

TEST_F(OtherThanItsTaskTest, ARangeOfActionsIsToldOfBothFiles) {
  SimulatorSpec wider = Task();
  wider.action_high = {2};
  const Sentences told = {"action 1 ranges over [-1, 1] for the policy and over [-1, 2] in the task"};
  EXPECT_EQ(Of("policy.npz", wider), told);
  EXPECT_EQ(Of("policy.onnx", wider), told);
}

TEST_F(OtherThanItsTaskTest, NamesAndThePeriodAreToldOfAnOnnxFile) {
  SimulatorSpec other = Task();
  other.observation_names = {"v", "x"};
  other.action_names = {"torque"};
  other.control_period_s = 0.01;
  EXPECT_EQ(Of("policy.onnx", other), (Sentences{"observation 1 is 'x' for the policy and 'v' in the task",
                                                 "action 1 is 'force' for the policy and 'torque' in the task",
                                                 "the policy acts every 0.02 s and the task every 0.01 s"}));
  EXPECT_EQ(Of("policy.npz", other), Sentences{}) << "the file has neither";
}

TEST_F(OtherThanItsTaskTest, MetadataThatIsNoListSaysNothing) {
  const TestFolder folder;
  const TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  const OnnxMetadata metadata = {
      {"observation_names", "x, v"}, {"action_names", "[1]"}, {"control_period_s", "\"soon\""}};
  WriteOnnx(policy, metadata, folder / "policy.onnx");
  EXPECT_EQ(OtherThanItsTask(folder / "policy.onnx", Task()), Sentences{});
}

}  // namespace oted::policy_origin_test
