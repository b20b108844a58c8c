#include "oted/sim/mujoco/task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"

namespace oted::task_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using testing::UnorderedElementsAre;

// What the numbers mean is checked against Gymnasium itself in gymnasium_oracle_test.cc.

TEST(FindTask, KnowsEveryTaskItNames) {
  EXPECT_THAT(TaskNames(),
              UnorderedElementsAre("Hopper-v2", "Hopper-v4", "Hopper-v5", "HalfCheetah-v2", "HalfCheetah-v4",
                                   "HalfCheetah-v5", "Walker2d-v2", "Walker2d-v4", "Walker2d-v5"));
  for (const std::string& name : TaskNames()) EXPECT_EQ(FindTask(name).name, name);
}

TEST(FindTask, AnUnknownNameIsAnErrorWithTheNearestAndTheList) {
  EXPECT_THAT([] { FindTask("Hoper-v5"); },
              ThrowsMessage<UsageError>(
                  AllOf(HasSubstr("'Hoper-v5'"), HasSubstr("did you mean 'Hopper-v5'"), HasSubstr("Walker2d-v4"))));
}

TEST(OpenInterval, ExcludesItsEndsAndNan) {
  const OpenInterval interval{.low = 0.7, .high = 2};
  EXPECT_TRUE(interval.Contains(1));
  EXPECT_FALSE(interval.Contains(0.7));
  EXPECT_FALSE(interval.Contains(2));
  EXPECT_FALSE(interval.Contains(std::nan("")));
  EXPECT_FALSE(OpenInterval{}.Contains(std::nan("")));
}

}  // namespace oted::task_test
