// design.method = "auto" from end to end, on a point mass whose logs the family can or cannot explain.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/base/testing.h"
#include "oted/config/task_registry.h"
#include "oted/data/dataset_files.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/run/pipeline_testing.h"

namespace oted::pipeline_forms_test {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

/// The point mass with a constant push that no parameter stands for.
class Pushed : public PointMass {
 public:
  explicit Pushed(int n_lanes) : PointMass({}, n_lanes, 1), clock_(static_cast<size_t>(n_lanes)) {}
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    PointMass::Step(lanes, actions);
    for (const int lane : lanes) {
      const double x = observation(lane)[0], v = observation(lane)[1];
      SetStateFromObservation(lane, std::vector<double>{x, v + 0.3});
      ++clock_[static_cast<size_t>(lane)];
    }
  }
  LaneStatus status(int lane) const override {
    return clock_[static_cast<size_t>(lane)] >= 20 ? LaneStatus::kTruncated : LaneStatus::kRunning;
  }

 private:
  std::vector<int> clock_;
};

class FormsTest : public testing::Test {
 protected:
  void SetUp() override {
    RegisterTask("Point", [](const auto&) { return std::make_unique<PointMassFactory>(); });
  }

  /// Thirty episodes of the point mass; or of the nominal one, pushed: no parameter makes it better.
  RunConfig Config(bool pushed, const std::string& method = "auto") {
    const std::string path = folder_ / (pushed ? "pushed.npz" : "plain.npz");
    if (!fs::exists(path)) {
      Pushed target(30);
      WriteDataset(WithSensorNoise(
                       pushed ? RandomLogs(target, PointMass::MakeParameters().Nominal()) : PointMassLogs(kTruth, 30),
                       0.01, RngKey(1)),
                   path);
    }
    RunConfig config = RunConfig::FromToml(fmt::format(R"(
      [task]
      name = "Point"
      [data]
      path = "{}"
      [run]
      threads = 1
      [clone]
      hidden = [8]
      max_steps = 20
      check_interval = 10
      [design]
      method = "{}"
      [design.adversarial]
      n_iterations = 12
      n_sims = 8
      n_steps = 20
      [design.discriminator]
      hidden = [16]
      steps = 5
      batch = 32
      [design.trajectories]
      starts = 1
      coarse = 8
      rows = 200
      [design.least_squares]
      rows = 200
      starts = 2
      [selection]
      n_seeds = 2
      n_sims = 2
      n_steps = 20
      judge_steps = 20
    )",
                                                       path, method),
                                           "forms.toml");
    config.parameters = PointMass::MakeParameters().specs();
    return config;
  }

  json Select(const RunConfig& config, const std::string& name) {
    Watch watch;
    return Select(config, name, watch);
  }
  json Select(const RunConfig& config, const std::string& name, Watch& watch) {
    Pipeline(config, folder_ / name, {.log = &watch, .stop = &watch.stop, .n_threads = 1}).SelectSimulator();
    return Design(name);
  }
  json Design(const std::string& name) { return ReadJson(fs::path(folder_ / name) / "design.json"); }
  fs::path Out(const std::string& name) { return folder_ / name; }

  TestFolder folder_;
};

/// q.json without the mark of what it was made from.
json Q(const fs::path& folder) {
  json q = ReadJson(folder / "q.json");
  for (const char* mark : {"fingerprint", "made_from", "sha256", "seal"}) q.erase(mark);
  return q;
}

TEST_F(FormsTest, WhereTheFamilyIsRightTheFirstFormIsTakenAndNoOtherRuns) {
  const json design = Select(Config(false), "auto"), by_name = Select(Config(false, "trajectories"), "name");
  EXPECT_EQ(design.at("verdict"), "gap_closed");
  const json& choice = design.at("method_choices").at(0);
  EXPECT_EQ(choice.at("method"), "trajectories");
  EXPECT_EQ(choice.at("picked"), "default");
  EXPECT_THAT(choice.at("reason").get<std::string>(), HasSubstr("as near to the logs as the sensors let them"));
  EXPECT_TRUE(choice.at("tried").empty());
  EXPECT_FALSE(fs::exists(Out("auto") / "design/default/methods"));
  EXPECT_FALSE(by_name.contains("method_choices")) << "nothing was left open";
  for (const char* seed : {"1", "2"}) {
    EXPECT_EQ(Q(Out("auto") / "design/default" / seed), Q(Out("name") / "design/default" / seed));
  }
  EXPECT_EQ(design.at("parameters"), by_name.at("parameters"));
  EXPECT_EQ(RunConfig::FromTomlFile(Out("auto") / "run.toml").design.method, std::nullopt)
      << "the next verb leaves it open too";
}

TEST_F(FormsTest, WhereItIsWrongTheOthersAreTriedOnHeldOutLogsAndTheNearestIsTaken) {
  const json design = Select(Config(true), "auto");
  EXPECT_THAT(design.at("verdict").get<std::string>(), testing::AnyOf("gap_narrowed", "outside_family"));
  const json& choice = design.at("method_choices").at(0);
  ASSERT_EQ(choice.at("tried").size(), 3u);
  EXPECT_EQ(choice["tried"][0].at("method"), "trajectories");
  std::string nearest = "trajectories";  // unless another is so beyond chance
  double most = kLeastGain;
  for (const json& tried : choice["tried"]) {
    const double gain = tried.at("gain");
    EXPECT_NEAR(std::log(choice["tried"][0].at("error").get<double>() / tried.at("error").get<double>()), gain, 1e-6);
    if (gain > std::max(most, 2 * tried.at("gain_std").get<double>())) nearest = tried.at("method"), most = gain;
  }
  EXPECT_EQ(choice.at("method"), nearest);
  EXPECT_THAT(choice.at("reason").get<std::string>(), HasSubstr("held-out windows"));
}

TEST_F(FormsTest, AFormThatIsNearerTakesThePlaceOfTheFirstAndTellsTheVerdict) {
  Select(Config(true), "auto");
  // The first form's trial, made worse than any; another's, made the nominal simulator. Farther off than that is none
  // taken.
  const fs::path forms = Out("auto") / "design/default/methods";
  const ParameterSpace space = PointMass::MakeParameters();
  const std::map<std::string, std::vector<double>> planted = {{"trajectories", {-5, -5, 0}},
                                                              {"least-squares", ZToLogit(space, space.Nominal())}};
  for (const auto& [method, mean] : planted) {
    const fs::path file = forms / method / "q.json";
    json trial = ReadJson(file);
    trial["mean"] = mean;
    Seal(trial);
    WriteJson(file, trial);
  }
  fs::remove(forms / "choice.json");
  fs::remove(Out("auto") / "design.json");
  const json design = Select(Config(true), "auto");
  const json& choice = design.at("method_choices").at(0);
  const std::string form = choice.at("method"), picked = "default-" + form;
  ASSERT_NE(form, "trajectories");
  EXPECT_THAT(choice.at("reason").get<std::string>(), HasSubstr("nearest to the log"));
  EXPECT_EQ(choice.at("picked"), picked);
  EXPECT_EQ(design.at("selected"), picked);
  ASSERT_EQ(design.at("settings").size(), 2u) << "both are scored";
  for (const json& setting : design["settings"]) {
    EXPECT_EQ(setting.at("method"), setting.at("name") == picked ? form : "trajectories");
  }
  EXPECT_TRUE(design.contains("fit"));
  // As if the form had been asked for by its name.
  EXPECT_EQ(design.at("verdict"), Select(Config(true, form), "name").at("verdict"));
  for (size_t seed = 1; seed <= 2; ++seed) {
    const json q = Q(Out("auto") / "design" / picked / std::to_string(seed));
    EXPECT_EQ(q, Q(Out("name") / "design/default" / std::to_string(seed)));
    EXPECT_EQ(design.at("mixture").at(seed - 1).at("mode"), q.at("mode"));
  }
  // A verb that comes later finds all of it complete.
  const auto written = fs::last_write_time(Out("auto") / "design.json");
  Select(RunConfig::FromTomlFile(Out("auto") / "run.toml"), "auto");
  EXPECT_EQ(fs::last_write_time(Out("auto") / "design.json"), written);
}

TEST_F(FormsTest, AStopWhileFormsAreTriedGoesOnToTheSameBytes) {
  const json whole = Select(Config(true), "whole");
  for (const int64_t at : {1, 12}) {
    const std::string name = fmt::format("stopped-{}", at);
    Watch watch;
    watch.stop_stage = "methods";
    watch.stop_at = at;
    EXPECT_THROW(Select(Config(true), name, watch), Interrupted);
    EXPECT_FALSE(fs::exists(Out(name) / "design.json"));
    EXPECT_EQ(Select(Config(true), name), whole) << at;
  }
}

TEST_F(FormsTest, TheThreadCountChangesNoByte) {
  RunConfig two = Config(true);
  two.run.threads = 2;
  EXPECT_EQ(Select(Config(true), "one"), Select(two, "two"));
}

TEST_F(FormsTest, ASettingThatHasTheNameOfAnotherFormsDesignsIsRefused) {
  RunConfig config = Config(false);
  config.settings = {{"a", config.design}, {"a-transitions", config.design}};
  EXPECT_THAT(MessageOf<UsageError>([&] { Select(config, "clash"); }), HasSubstr("a-transitions"));
}

}  // namespace oted::pipeline_forms_test
