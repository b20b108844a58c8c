#include "oted/sim/mujoco/expression.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::expression_test {

using testing::AllOf;
using testing::HasSubstr;

class ExpressionTest : public testing::Test {
 protected:
  double Value(const std::string& text) { return Expression(text, variables_, "reward").Evaluate(); }
  std::string Refused(const std::string& text) {
    return MessageOf<UsageError>([&] { Expression(text, variables_, "reward"); });
  }
  double x_ = 3, tip_ = -2;
  std::map<std::string, double*> variables_ = {{"x", &x_}, {"tip[2]", &tip_}};
};

TEST_F(ExpressionTest, ArithmeticIsThatOfC) {
  EXPECT_EQ(Value("1 + 2 * x - x / 4"), 1 + 2 * 3 - 0.75);
  EXPECT_EQ(Value("x^2 - abs(tip[2])"), 7);
  EXPECT_EQ(Value("x > 2 && tip[2] <= -2 ? 5 : 6"), 5);
  EXPECT_EQ(Value("max(x, 4, 1) + min(tip[2], 0)"), 2);
  EXPECT_DOUBLE_EQ(Value("exp(-x) + sqrt(x) + cos(_pi)"), std::exp(-3) + std::sqrt(3) - 1);
}

TEST_F(ExpressionTest, VariablesAreReadEachTime) {
  const Expression expression("2 * x + tip[2]", variables_, "reward");
  EXPECT_EQ(expression.Evaluate(), 4);
  x_ = 10;
  tip_ = 1;
  EXPECT_EQ(expression.Evaluate(), 21);
}

TEST_F(ExpressionTest, ImpossibleArithmeticIsNotFinite) {
  EXPECT_TRUE(std::isnan(Value("log(tip[2])")));
  EXPECT_TRUE(std::isinf(Value("1 / (x - 3)")));
}

TEST_F(ExpressionTest, MistakesAreErrors) {
  EXPECT_THAT(Refused("x + tipp[2]"), AllOf(HasSubstr("reward \"x + tipp[2]\""), HasSubstr("did you mean 'tip[2]'?")));
  EXPECT_THAT(Refused("x +"), HasSubstr("at character"));
  EXPECT_THAT(Refused("(x"), HasSubstr("(x"));
  EXPECT_THAT(Refused(""), HasSubstr("reward"));
  EXPECT_THAT(Refused("x, 2"), HasSubstr("wanted one number"));
  EXPECT_THAT(Refused("x = 2"), HasSubstr("compare with =="));
  EXPECT_EQ(x_, 3) << "a refused assignment assigns nothing";
}

TEST_F(ExpressionTest, FunctionsAndConstantsAreReserved) {
  EXPECT_TRUE(Expression::IsReserved("sin"));
  EXPECT_TRUE(Expression::IsReserved("_pi"));
  EXPECT_FALSE(Expression::IsReserved("height"));
}

}  // namespace oted::expression_test
