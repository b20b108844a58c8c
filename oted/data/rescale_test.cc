#include "oted/data/rescale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <utility>

#include "oted/base/error.h"

namespace oted::rescale_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

Array2<double> Rows(int rows, int cols, std::initializer_list<double> values) {
  Array2<double> array(rows, cols);
  std::ranges::copy(values, array.values().begin());
  return array;
}

Dataset Log() {
  Dataset log;
  log.path = "log.npz";
  log.observations = Rows(2, 2, {90, 1, 180, 2});
  log.next_observations = Rows(2, 2, {180, 2, 270, 3});
  log.actions = Rows(2, 1, {0.5, -0.5});
  log.observation_names = {"joint/hip/qpos", "joint/hip/qvel"};
  log.action_names = {"actuator/hip"};
  return log;
}

const std::vector<std::string> kNone;
const TaskNames kNoTask{kNone, kNone};

TEST(Rescale, ValuesAreMultipliedAndThenMovedInBothStatesAndInActions) {
  Dataset log = Log();
  Rescale(log, {{{"joint/*/qpos", 0.1}, {"actuator/hip", -1}}, {{"joint/hip/qpos", 1}}}, kNoTask);
  EXPECT_EQ(log.observations, Rows(2, 2, {10, 1, 19, 2}));
  EXPECT_EQ(log.next_observations, Rows(2, 2, {19, 2, 28, 3}));
  EXPECT_EQ(log.actions, Rows(2, 1, {-0.5, 0.5}));
}

TEST(Rescale, ColumnsWithoutNamesHaveTheTasks) {
  Dataset log = Log();
  const std::vector<std::string> observations = std::move(log.observation_names), actions = std::move(log.action_names);
  log.observation_names.clear();
  log.action_names.clear();
  Rescale(log, {{{"joint/hip/qvel", 2}}, {}}, {observations, actions});
  EXPECT_EQ(log.observations, Rows(2, 2, {90, 2, 180, 4}));
}

TEST(Rescale, WhatNamesNothingOrOneColumnTwiceIsRefused) {
  Dataset log = Log();
  EXPECT_THAT(
      [&] {
        Rescale(log, {{{"knee", 2}}, {}}, kNoTask);
      },
      ThrowsMessage<UsageError>(AllOf(HasSubstr("'knee'"), HasSubstr("joint/hip/qpos"), HasSubstr("log.npz"))));
  EXPECT_THAT(
      [&] {
        Rescale(log, {{{"joint/hip/*", 2}, {"joint/hip/qpos", 2}}, {}}, kNoTask);
      },
      ThrowsMessage<UsageError>(HasSubstr("named twice")));
  log.qpos = Rows(2, 1, {0, 0});
  EXPECT_THAT(
      [&] {
        Rescale(log, {{{"joint/hip/qpos", 2}}, {}}, kNoTask);
      },
      ThrowsMessage<UsageError>(HasSubstr("qpos")));
}

TEST(Rescale, AFactorThatLeavesNothingIsRefused) {
  for (const double factor : {0.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    Dataset log = Log();
    EXPECT_THAT(
        [&] {
          Rescale(log, {{{"joint/hip/qpos", factor}}, {}}, kNoTask);
        },
        ThrowsMessage<UsageError>(HasSubstr("wanted a unit or a sign")));
  }
}

}  // namespace oted::rescale_test
