#include "oted/sim/parameter_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "oted/base/error.h"

namespace oted::parameter_space_test {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

ParameterSpace LinearAndLogarithmic() {
  return ParameterSpace({{.name = "a", .field = "opt/gravity[2]", .low = 0.2, .high = 2.2},
                         {.name = "b", .field = "body/*/mass", .low = 0.01, .high = 100, .logarithmic = true}});
}

TEST(ParseParameterSpec, ReadsPathBoundsAndOptions) {
  const ParameterSpec spec = ParseParameterSpec("friction=geom/*/friction[0]:0.2:2");
  EXPECT_EQ(spec.name, "friction");
  EXPECT_EQ(spec.field, "geom/*/friction[0]");
  EXPECT_EQ(spec.low, 0.2);
  EXPECT_EQ(spec.high, 2);
  EXPECT_EQ(spec.scale, ParameterScale::kNominal);
  EXPECT_FALSE(spec.logarithmic);
  const ParameterSpec options = ParseParameterSpec("w=opt/wind[0]:1e-3:5:log:absolute");
  EXPECT_EQ(options.scale, ParameterScale::kAbsolute);
  EXPECT_TRUE(options.logarithmic);
  EXPECT_EQ(ParseParameterSpec("w=opt/wind[0]:-5:-1:absolute").low, -5);
  const ParameterSpec believed = ParseParameterSpec("w=opt/wind[0]:1e-3:5:log:prior=0.5,0.1");
  EXPECT_EQ(believed.prior->mean, 0.5);
  EXPECT_EQ(believed.prior->std, 0.1);
  EXPECT_FALSE(options.prior);
  for (const char* prior : {"prior=0.5", "prior=0.5,0", "prior=7,0.1", "prior=a,b", "prior"}) {
    EXPECT_THROW(ParseParameterSpec(std::string("w=opt/wind[0]:1e-3:5:") + prior), UsageError) << prior;
  }
}

TEST(ParseParameterSpec, SaysWhatIsWrong) {
  const auto message = [](const char* text, const char* part) {
    EXPECT_THAT([&] { ParseParameterSpec(text); }, ThrowsMessage<UsageError>(HasSubstr(part))) << text;
  };
  message("friction", "no '='");
  message("friction=geom/*/friction[0]", "no bounds");
  message("friction=geom/*/friction[0]:0.2", "no bounds");
  message("friction=geom/*/friction[0]:0.2:2x", "'2x'");
  message("friction=geom/*/friction[0]:0.2:2:logs", "'logs'");
  message("friction=geom/*/friction[0]:2:0.2", "low < high");
  message("friction=geom/*/friction[0]:1:1", "low < high");
  message("friction=geom/*/friction[0]:0:inf", "finite");
  message("friction=geom/*/friction[0]:nan:1", "finite");
  message("friction=geom/*/friction[0]:0:1:log", "low > 0");
  message("=geom/*/friction[0]:0.2:2", "no name");
  message("friction=:0.2:2", "no field path");
}

TEST(ParameterSpace, ANameGivenTwiceIsAnError) {
  EXPECT_THAT(
      [] {
        ParameterSpace({{.name = "a", .field = "x"}, {.name = "a", .field = "y"}});
      },
      ThrowsMessage<UsageError>(HasSubstr("'a' is given twice")));
}

TEST(ParameterSpace, TheUnitCubeSpansTheBoundsLinearlyOrInTheLogarithm) {
  const ParameterSpace space = LinearAndLogarithmic();
  EXPECT_THAT(space.FromUnit(std::vector{0.0, 0.0}), ElementsAre(0.2, 0.01));
  EXPECT_THAT(space.FromUnit(std::vector{1.0, 1.0}), ElementsAre(2.2, 100));
  EXPECT_THAT(space.FromUnit(std::vector{0.5, 0.5}), ElementsAre(DoubleNear(1.2, 1e-15), DoubleNear(1.0, 1e-14)));
  EXPECT_THAT(space.ToUnit(std::vector{0.7, 0.1}), ElementsAre(DoubleNear(0.25, 1e-15), DoubleNear(0.25, 1e-14)));
}

TEST(ParameterSpace, ValuesOutsideAreClampedAndEveryResultIsInside) {
  const ParameterSpace space = LinearAndLogarithmic();
  EXPECT_EQ(space.FromUnit(std::vector{-1.0, 2.0}), (std::vector{0.2, 100.0}));
  EXPECT_EQ(space.ToUnit(std::vector{9.0, 1e-9}), (std::vector{1.0, 0.0}));
  Rng rng(3);
  for (int i = 0; i < 1000; ++i) {
    const std::vector<double> z = space.SampleUniform(rng);
    EXPECT_NO_THROW(space.CheckInside(z));
    const std::vector<double> back = space.FromUnit(space.ToUnit(z));
    EXPECT_NEAR(back[0], z[0], 1e-14);
    EXPECT_NEAR(back[1] / z[1], 1, 1e-13);
  }
}

TEST(ParameterSpace, SamplesAreUniformInTheUnitCube) {
  const ParameterSpace space = LinearAndLogarithmic();
  Rng rng(4);
  double below = 0;
  for (int i = 0; i < 20000; ++i) below += space.SampleUniform(rng)[1] < 1;
  // Half of the logarithmic range lies below 1; four standard deviations.
  EXPECT_NEAR(below / 20000, 0.5, 4 * 0.5 / std::sqrt(20000));
}

TEST(ParameterSpace, CheckInsideRefusesWrongLengthsOutsidersAndNan) {
  const ParameterSpace space = LinearAndLogarithmic();
  EXPECT_NO_THROW(space.CheckInside(std::vector{0.2, 100.0}));
  EXPECT_THROW(space.CheckInside(std::vector{0.2}), UsageError);
  EXPECT_THAT(
      [&] {
        space.CheckInside(std::vector{1.0, 101.0});
      },
      ThrowsMessage<UsageError>(testing::AllOf(HasSubstr("'b'"), HasSubstr("101"))));
  EXPECT_THROW(space.CheckInside(std::vector{std::nan(""), 1.0}), UsageError);
}

}  // namespace oted::parameter_space_test
