#include "oted/stages/design/prior_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/matching/designer.h"

namespace oted::prior_source_test {

std::vector<ParameterSpec> Specs() {
  return {{.name = "friction", .field = "env/friction", .low = 0.2, .high = 2.0},
          {.name = "gain", .field = "env/gain", .low = 0.1, .high = 10.0, .logarithmic = true}};
}

Designer Q(double first, double second) {
  Designer q(ParameterSpace(Specs()), 1.0);
  q.Restore({first, second}, {std::log(0.2), std::log(0.3)});
  return q;
}

TEST(MakePrior, UniformIsTheOneThatKnowsNothing) {
  const Prior prior = MakePrior("uniform", ParameterSpace(Specs()));
  EXPECT_TRUE(prior.uniform);
  EXPECT_EQ(prior.Std()[0], Prior::kUniformStd);
}

TEST(MakePrior, OfBeliefsHasTheirMeanAndSpreadInTheParametersOwnUnits) {
  std::vector<ParameterSpec> specs = Specs();
  specs[0].prior = {.mean = 0.8, .std = 0.02};
  specs[1].prior = {.mean = 3.0, .std = 0.1};
  const ParameterSpace space(specs);
  const Prior prior = MakePrior("gaussian", space);
  EXPECT_FALSE(prior.uniform);
  const Designer q(space, prior.mean, prior.Covariance());
  EXPECT_NEAR(q.Mode()[0], 0.8, 1e-9);
  EXPECT_NEAR(q.Mode()[1], 3.0, 1e-9);
  Rng rng(1);
  double square[2] = {0, 0};
  constexpr int kN = 20000;
  for (int k = 0; k < kN; ++k) {
    const auto z = q.Draw(rng).z;
    square[0] += (z[0] - 0.8) * (z[0] - 0.8) / kN;
    square[1] += (z[1] - 3.0) * (z[1] - 3.0) / kN;
  }
  EXPECT_NEAR(std::sqrt(square[0]), 0.02, 0.001);
  EXPECT_NEAR(std::sqrt(square[1]), 0.1, 0.005);
  // A parameter without one, and a spread that says nothing.
  specs[0].prior.reset();
  specs[1].prior->std = 100;
  const Prior wide = MakePrior("gaussian", ParameterSpace(specs));
  EXPECT_NEAR(wide.Std()[0], Prior::kUniformStd, 1e-12);
  EXPECT_NEAR(wide.Std()[1], Prior::kUniformStd, 1e-12);
  MessageOf<UsageError>([] { MakePrior("gaussian", ParameterSpace(Specs())); });
  specs[1].prior->mean = 20;
  MessageOf<UsageError>([&] { ParameterSpace space_outside(specs); });
}

TEST(MakePrior, OfAnEarlierDesignIsItsQAndOfARunItsMixtureOverSeeds) {
  const TestFolder folder;
  const ParameterSpace space(Specs());
  WriteJson(folder / "design/h/1/q.json", Q(0.5, -1).ToJson(0));
  WriteJson(folder / "design/h/2/q.json", Q(0.9, -1).ToJson(0));
  WriteJson(folder / "design.json", {{"selected", "h"}, {"mixture", {{{"seed", 1}}, {{"seed", 2}}}}});
  const Prior one = MakePrior((folder / "design/h/1/q.json"), space);
  EXPECT_NEAR(one.mean[0], 0.5, 1e-12);
  EXPECT_NEAR(one.Std()[1], 0.3, 1e-12);
  const Prior run = MakePrior(folder.path().string(), space);
  EXPECT_NEAR(run.mean[0], 0.7, 1e-12);
  EXPECT_NEAR(run.Covariance()(0, 0), 0.2 * 0.2 + 0.2 * 0.2, 1e-12) << "within and between the seeds";
  EXPECT_NEAR(run.Covariance()(1, 1), 0.09, 1e-12);
  nlohmann::json mixture = {{"schema", "oted.q/1"}, {"kind", "mixture"}};
  for (const Designer& q : {Q(0.5, -1), Q(0.9, -1)}) {
    nlohmann::json component = q.ToJson(0);
    for (const char* shared : {"parameters", "bounds", "scale"}) mixture[shared] = component.at(shared);
    mixture["components"].push_back(component);
  }
  WriteJson(folder / "export.json", mixture);
  EXPECT_TRUE(MakePrior((folder / "export.json"), space).Covariance().isApprox(run.Covariance(), 1e-12));
}

TEST(MakePrior, AnotherFamilyIsRefused) {
  const TestFolder folder;
  const std::string file = (folder / "q.json");
  WriteJson(file, Q(0, 0).ToJson(0));
  const auto refused = [&](const std::function<void(std::vector<ParameterSpec>&)>& change) {
    std::vector<ParameterSpec> specs = Specs();
    change(specs);
    const std::string message = MessageOf<DataError>([&] { MakePrior(file, ParameterSpace(specs)); });
    EXPECT_NE(message.find("q.json"), std::string::npos) << message;
  };
  refused([](auto& s) { s[0].name = "drag"; });
  refused([](auto& s) { s[0].high = 3; });
  refused([](auto& s) { s[1].logarithmic = false; });
  refused([](auto& s) { s.pop_back(); });
  MessageOf<UsageError>([&] { MakePrior((folder / "nothing.json"), ParameterSpace(Specs())); });
  MessageOf<UsageError>([&] { MakePrior(folder.path().string(), ParameterSpace(Specs())); });
}

TEST(MakePrior, ACategoricalQNeedsTheSameGrid) {
  const TestFolder folder;
  const ParameterSpace space({{.name = "density", .field = "env/density", .low = 0, .high = 0.6}});
  Designer q = Designer::OnGrid(space, 0.3);
  q.SetState({0.2, 0.7, 0.1});
  const std::string file = (folder / "q.json");
  WriteJson(file, q.ToJson(0));
  const Prior prior = MakePrior(file, space, {.categorical = true, .grid_step = 0.3});
  Designer next = Designer::OnGrid(space, 0.3);
  next.SetPrior(prior);
  next.StartAtPrior(1);
  EXPECT_NEAR(next.grid()->probabilities(0)[1], 0.7, 1e-12);
  MessageOf<UsageError>([&] { MakePrior(file, space, {.categorical = true, .grid_step = 0.1}); });
  MessageOf<UsageError>([&] { MakePrior(file, space); });
}

}  // namespace oted::prior_source_test
