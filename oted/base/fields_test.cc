#include "oted/base/fields.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::fields_test {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Config {
  bool noisy = false;
  int batch_size = 256;
  int64_t steps = 1000;
  double learning_rate = 3e-4;
  std::string kind = "bc";
  std::string label;
  std::vector<int> hidden = {256, 256};
  std::vector<double> lambdas;
  std::vector<std::string> columns;
  FieldList Fields() {
    FieldList fields("clone");
    fields.Add("noisy", &noisy, "adds noise");
    fields.Add("batch_size", &batch_size, "transitions per gradient step", AtLeast(1));
    fields.Add("steps", &steps, "gradient steps", AtLeast(0));
    fields.Add("learning_rate", &learning_rate, "Adam's step", AboveUpTo(0, 1));
    fields.AddChoice("kind", &kind, "method", {"bc", "valuedice"});
    fields.Add("label", &label, "free text");
    fields.Add("hidden", &hidden, "units per layer", AtLeast(1));
    fields.Add("lambdas", &lambdas, "weights", Between(0, 10));
    fields.Add("columns", &columns, "names of columns");
    fields.AddStructure("recordings");
    return fields;
  }
};

std::string TextMessage(const char* name, const char* text) {
  Config config;
  return MessageOf<UsageError>([&] { config.Fields().Find(name, "--set").FromText(text, "--set"); });
}

TEST(Fields, AnUnknownKeyIsAnErrorWithTheNearestName) {
  Config config;
  const auto message = [&](const json& object) {
    return MessageOf<UsageError>([&] { config.Fields().FromJson(object, "hopper.toml"); });
  };
  EXPECT_THAT(message({{"batchsize", 3}}),
              AllOf(HasSubstr("hopper.toml"), HasSubstr("clone.batchsize"), HasSubstr("did you mean 'batch_size'?")));
  EXPECT_THAT(message({{"zzzzzzzzz", 3}}), AllOf(Not(HasSubstr("did you mean")), HasSubstr("learning_rate")));
  EXPECT_THAT(message(json::array({1})), HasSubstr("[clone] is not a table"));
  EXPECT_THAT(message({{"recording", 3}}), HasSubstr("did you mean 'recordings'?"));
  EXPECT_THAT(TextMessage("recordings", "3"), HasSubstr("clone.recordings is no single value; write it in a task"));
}

TEST(Fields, NearestNameTakesTheSmallestEditDistance) {
  const std::vector<std::string> names = {"gravity", "friction", "gain"};
  EXPECT_EQ(NearestName("fricton", names), "friction");
  EXPECT_EQ(NearestName("gian", names), "gain");
  EXPECT_EQ(NearestName("gravity", names), "gravity");
  EXPECT_EQ(NearestName("temperature", names), "");
  EXPECT_EQ(NearestName("GRAVITY", names), "gravity");
  EXPECT_EQ(NearestName("ep", {"1", "x"}), "") << "no letter is the same";
  EXPECT_EQ(NearestName("x", {}), "");
}

TEST(Fields, ListsOfTextsKeepWhatLooksLikeANumber) {
  Config config;
  const FieldList fields = config.Fields();
  fields.Find("columns", "--set").FromText("q,1,true", "--set");
  EXPECT_EQ(config.columns, (std::vector<std::string>{"q", "1", "true"}));
  fields.Find("columns", "--set").FromText(R"(["a,b"])", "--set");
  EXPECT_EQ(config.columns, std::vector<std::string>{"a,b"});
  fields.Find("columns", "--set").FromText("", "--set");
  EXPECT_TRUE(config.columns.empty());
  EXPECT_THAT(MessageOf<UsageError>([&] {
                fields.FromJson({{"columns", {1}}}, "x.toml");
              }),
              HasSubstr("wanted list of texts"));
}

TEST(Fields, TextAsTypedIsTakenByEveryType) {
  Config config;
  const FieldList fields = config.Fields();
  const auto set = [&](const char* name, const char* text) { fields.Find(name, "--set").FromText(text, "--set"); };
  set("noisy", "true");
  set("batch_size", "64");
  set("steps", "1e5");
  set("learning_rate", "1e-3");
  set("lambdas", ".5,5.,+1,1_0");
  EXPECT_EQ(config.lambdas, (std::vector<double>{0.5, 5, 1, 10}));
  set("kind", "valuedice");
  set("label", "12");
  set("hidden", "32,16");
  set("lambdas", "[0.5, 1]");
  EXPECT_TRUE(config.noisy);
  EXPECT_EQ(config.batch_size, 64);
  EXPECT_EQ(config.steps, 100000);
  EXPECT_EQ(config.learning_rate, 1e-3);
  EXPECT_EQ(config.kind, "valuedice");
  EXPECT_EQ(config.label, "12") << "text stays text, also when it looks like a number";
  EXPECT_EQ(config.hidden, (std::vector<int>{32, 16}));
  EXPECT_EQ(config.lambdas, (std::vector<double>{0.5, 1.0}));
  set("steps", "200_000");
  EXPECT_EQ(config.steps, 200000);
  set("hidden", "");
  EXPECT_TRUE(config.hidden.empty());
}

TEST(Fields, WrongTypesAndRangesSayWhatWasGotAndWanted) {
  EXPECT_THAT(TextMessage("batch_size", "0"), AllOf(HasSubstr("batch_size is 0"), HasSubstr("int in [1, inf)")));
  EXPECT_THAT(TextMessage("batch_size", "2.5"), HasSubstr("batch_size is 2.5"));
  EXPECT_THAT(TextMessage("batch_size", "3000000000"), HasSubstr("batch_size is 3000000000"));
  EXPECT_THAT(TextMessage("batch_size", "many"), HasSubstr("\"many\""));
  for (const char* no_number : {".", "1__0", "_1", "1_", "+", "1..2", "--1"}) {
    EXPECT_THAT(TextMessage("batch_size", no_number), HasSubstr(fmt::format("batch_size is \"{}\"", no_number)));
  }
  EXPECT_THAT(TextMessage("batch_size", ""), HasSubstr("batch_size is \"\""));
  EXPECT_THAT(TextMessage("noisy", "1"), HasSubstr("true|false"));
  EXPECT_THAT(TextMessage("learning_rate", "0"), HasSubstr("(0, 1]"));
  EXPECT_THAT(TextMessage("learning_rate", "true"), HasSubstr("wanted number"));
  EXPECT_THAT(TextMessage("kind", "valuedise"), HasSubstr("did you mean 'valuedice'?"));
  EXPECT_THAT(TextMessage("hidden", "64,0"), HasSubstr("hidden is [64,0]"));
  EXPECT_THAT(TextMessage("lambdas", "1,x"), HasSubstr("list of numbers in [0, 10]"));
}

TEST(Fields, ARefusedValueLeavesTheOldOne) {
  Config config;
  EXPECT_THROW(config.Fields().FromJson({{"hidden", {8, -1}}}, "x"), UsageError);
  EXPECT_EQ(config.hidden, (std::vector<int>{256, 256}));
}

TEST(Fields, JsonGoesOutAndComesBack) {
  Config written;
  written.noisy = true;
  written.steps = int64_t{1} << 52;
  written.learning_rate = 0.1;
  written.label = "a \"b\"";
  written.lambdas = {0.25};
  Config read;
  read.Fields().FromJson(json::parse(written.Fields().ToJson().dump()), "run.json");
  EXPECT_EQ(read.Fields().ToJson(), written.Fields().ToJson());
  EXPECT_EQ(read.learning_rate, 0.1);
  EXPECT_EQ(read.label, "a \"b\"");
}

TEST(Range, BoundsAreOpenOrClosedAsNamed) {
  EXPECT_TRUE(AtLeast(1).Contains(1));
  EXPECT_FALSE(Above(1).Contains(1));
  EXPECT_TRUE(Between(0, 2).Contains(2));
  EXPECT_FALSE(AboveUpTo(0, 2).Contains(0));
  EXPECT_FALSE(AtLeast(0).Contains(INFINITY));
  EXPECT_FALSE(Range().Contains(NAN));
  EXPECT_TRUE(Range().Contains(-INFINITY));
  EXPECT_EQ(AtLeast(1).ToString(), "[1, inf)");
  EXPECT_EQ(AboveUpTo(0, 1).ToString(), "(0, 1]");
  EXPECT_EQ(Range().ToString(), "");
}

}  // namespace oted::fields_test
