#include "oted/config/run_config.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::run_config_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kMinimal = R"(
[task]
name = "Hopper-v5"
[data]
path = "/data/demos.hdf5"
[parameters]
gravity  = { field = "opt/gravity[2]", range = [0.5, 1.5] }
friction = { field = "geom/*/friction[0]" }
)";

RunConfig Parse(const std::string& text) { return RunConfig::FromToml(text, "here.toml"); }
RunConfig WithSection(const std::string& text) { return Parse(kMinimal + text); }
/// The line that reading `text`, appended to the minimal configuration (eight lines), is refused with.
std::string Refusal(const std::string& text) {
  return MessageOf<UsageError>([&] { WithSection(text).Check(); });
}

std::vector<std::string> Names(const RunConfig& config) {
  std::vector<std::string> names;
  for (const ParameterSpec& spec : config.parameters) names.push_back(spec.name);
  return names;
}

void ExpectSame(const ParameterSpec& a, const ParameterSpec& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.field, b.field);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
  EXPECT_EQ(a.scale, b.scale);
  EXPECT_EQ(a.logarithmic, b.logarithmic);
  EXPECT_EQ(a.unit, b.unit);
}

TEST(RunConfig, ReadsBackWhatItWrites) {
  RunConfig config = Parse(R"(
    [task]
    name = "Walker2d-v4"
    [data]
    path = "/a folder/with \"quotes\" and ä.npz"
    episodes = 5
    [run]
    seed = 12345678901
    threads = 3
    strict = true
    [parameters]
    zeta  = { field = "joint/*/damping", range = [0.1, 10.0], log = true }
    alpha = { field = "opt/gravity[2]", range = [-12.345678901234567, -1e-05], scale = "absolute", unit = "m/s^2" }
    mid-1 = { field = "geom/*/friction[0]", range = [0.2, 2.0] }
    [clone]
    hidden = [32, 16]
    [design.adversarial]
    lambda = 1e-3
    [design.settings.paper]
    method = "paper"
    adversarial.n_sims = 7
    [design.settings.short.adversarial]
    horizon = 3
    [selection]
    score = "paper"
    [sac]
    n_steps = 1e5
    [truth]
    zeta = 0.3
    alpha = -9.81
    mid-1 = 1
  )");
  config.Check();
  const RunConfig again = RunConfig::FromToml(config.ToToml(), "run.toml");
  EXPECT_EQ(again.ToJson(), config.ToJson());
  EXPECT_EQ(again.ToToml(), config.ToToml());
  EXPECT_THAT(Names(again), ElementsAre("zeta", "alpha", "mid-1")) << "the order of the file is the order of z";
  for (size_t i = 0; i < 3; ++i) ExpectSame(again.parameters[i], config.parameters[i]);
  EXPECT_EQ(again.truth, config.truth);
  EXPECT_THAT(again.TruthVector(), ElementsAre(0.3, -9.81, 1.0));
  EXPECT_EQ(again.data.path, config.data.path);
  EXPECT_EQ(again.data.episodes, "5");
  EXPECT_EQ(again.algorithms.sac.n_steps, 100'000);
  EXPECT_EQ(again.settings.at("paper").Assumed().adversarial.n_sims, 7);
  EXPECT_EQ(again.settings.at("paper").Assumed().adversarial.actions, RolloutActions::kClone);
  EXPECT_EQ(again.settings.at("short").Assumed().adversarial.horizon, 3);
  EXPECT_EQ(again.settings.at("short").Assumed().adversarial.lambda, 1e-3) << "a setting starts from [design]";
}

TEST(RunConfig, DefaultsReadBackToo) {
  const RunConfig config = Parse(kMinimal);
  const RunConfig again = RunConfig::FromToml(config.ToToml(), "run.toml");
  EXPECT_EQ(again.ToJson(), config.ToJson());
  EXPECT_THAT(Names(again), ElementsAre("gravity", "friction"));
  EXPECT_EQ(config.parameters[1].low, 0.2);
  EXPECT_EQ(config.parameters[1].high, 2.0);
}

TEST(RunConfig, PriorsReadBackAndTheirPathsLieBesideTheFile) {
  const std::string text =
      "[parameters]\na = { field = \"opt/a\", range = [0, 2], prior = { mean = 0.5, std = 0.1 } }\n"
      "[design]\nprior = \"gaussian\"\n[design.settings.next]\nprior = \"runs/first\"\n"
      "[design.settings.same.adversarial]\nlambda = 1.0\n";
  const RunConfig config = RunConfig::FromToml(text, "configs/x.toml");
  EXPECT_EQ(config.parameters[0].prior->mean, 0.5);
  EXPECT_EQ(config.settings.at("next").Assumed().prior, "configs/runs/first");
  EXPECT_EQ(config.settings.at("same").Assumed().prior, "gaussian");
  const RunConfig again = RunConfig::FromToml(config.ToToml(), "run.toml");
  EXPECT_EQ(again.ToJson(), config.ToJson());
  EXPECT_EQ(again.parameters[0].prior->std, 0.1);
  const auto refused = [](const std::string& prior, const std::string& word) {
    EXPECT_THAT(MessageOf<UsageError>(
                    [&] { Parse("[parameters]\na = { field = \"x/y\", range = [0, 2], prior = " + prior + " }"); }),
                HasSubstr(word));
  };
  refused("1.0", "{ mean = 1.0, std = 0.1 }");
  refused("{ mean = 1.0 }", "{ mean = 1.0, std = 0.1 }");
  refused("{ mean = 3.0, std = 0.1 }", "inside of the range");
  refused("{ mean = 1.0, std = 0.0 }", "above 0");
  refused("{ mean = 1.0, std = \"wide\" }", "prior.std");
}

TEST(RunConfig, AListOfPathsTiesThemAndIsReadBackAsWritten) {
  const RunConfig config = Parse(R"(
    [task]
    name = "Hopper-v5"
    [parameters]
    leg = { field = ["body/leg/mass", "body/leg/inertia"], range = [0.5, 2.0] })");
  ASSERT_EQ(config.parameters.size(), 1u);
  EXPECT_EQ(config.parameters[0].field, "body/leg/mass + body/leg/inertia");
  ExpectSame(RunConfig::FromToml(config.ToToml(), "run.toml").parameters[0], config.parameters[0]);
  for (const char* field : {"[]", "[1]", "3", "[[\"body/leg/mass\"]]"}) {
    EXPECT_THAT(Refusal(fmt::format("leg = {{ field = {} }}\n", field)), HasSubstr("ties them together")) << field;
  }
}

TEST(RunConfig, ParametersOnOneLineKeepTheirOrder) {
  const RunConfig config = Parse("parameters = { b = { field = \"opt/b\" }, a = { field = \"opt/a\" } }");
  EXPECT_THAT(Names(config), ElementsAre("b", "a"));
}

TEST(RunConfig, TheMethodsDefaultsGiveWayToSettingsWhereverTheyStand) {
  const RunConfig config = WithSection("[design]\nadversarial.horizon = 50\nmethod = \"paper\"\n");
  const DesignConfig design = config.design.Assumed();
  EXPECT_EQ(design.adversarial.horizon, 50);
  EXPECT_EQ(design.adversarial.starts, RolloutStarts::kDataset);
  EXPECT_EQ(design.adversarial.actions, RolloutActions::kClone);
  EXPECT_EQ(design.adversarial.n_steps, DesignConfig::For(DesignMethod::kPaper).adversarial.n_steps);
}

TEST(RunConfig, WhatAMethodWouldSetIsNoSettingInTheWrittenFile) {
  const RunConfig again = RunConfig::FromToml(WithSection("").ToToml(), "run.toml");
  EXPECT_FALSE(again.design.method);
  EXPECT_EQ(again.design.For(DesignMethod::kPaper).ToJson(), DesignConfig::For(DesignMethod::kPaper).ToJson())
      << "another method than the first begins with its own defaults";
}

TEST(RunConfig, RelativeDataLieBesideTheFile) {
  const std::string text = "[data]\npath = \"demos.hdf5\"\n";
  EXPECT_EQ(RunConfig::FromToml(text, "configs/a/x.toml").data.path, "configs/a/demos.hdf5");
  EXPECT_EQ(RunConfig::FromToml(text, "x.toml").data.path, "demos.hdf5");
  EXPECT_EQ(RunConfig::FromToml("[data]\npath = \"/d.hdf5\"\n", "configs/x.toml").data.path, "/d.hdf5");
}

constexpr const char* kSysidFile = R"(
damping: {frozen: false, max_value: [3.0], min_value: [0.5], name: damping, nominal: [1.0], value: [1.0]}
friction: {frozen: false, max_value: [1.5], min_value: [0.6], name: friction, nominal: [1.0], value: [0.9],
           field: "geom/*/friction[0]", scale: nominal, log: true}
)";

TEST(RunConfig, ParametersComeFromASysidFileBesideTheConfiguration) {
  TestFolder folder;
  WriteFileAtomically(folder / "params.yaml", kSysidFile);
  const auto read = [&](const std::string& parameters) {
    return RunConfig::FromToml("[parameters]\n" + parameters, folder / "run.toml");
  };
  const RunConfig config = read(R"(
    gravity = { field = "opt/gravity[2]", range = [0.5, 1.5] }
    sysid   = "params.yaml"
    damping = { field = "joint/*/damping", scale = "nominal" })");
  EXPECT_EQ(Names(config), (std::vector<std::string>{"damping", "friction", "gravity"}));
  EXPECT_EQ(config.parameters[0].field, "joint/*/damping");
  EXPECT_EQ(config.parameters[0].high, 3.0) << "the file's";
  EXPECT_EQ(config.parameters[1].low, 0.6);
  EXPECT_TRUE(config.parameters[1].logarithmic);
  EXPECT_EQ(config.parameters[2].high, 1.5);
  // What the resolved configuration says needs no file any more.
  const RunConfig again = Parse(config.ToToml());
  ASSERT_EQ(Names(again), Names(config));
  for (size_t i = 0; i < again.parameters.size(); ++i) ExpectSame(again.parameters[i], config.parameters[i]);

  EXPECT_THAT(MessageOf<UsageError>([&] { read("sysid = 'params.yaml'"); }),
              testing::AllOf(HasSubstr("params.yaml"), HasSubstr("'damping'")));
  EXPECT_THAT(MessageOf<UsageError>([&] { read("sysid = ''"); }), HasSubstr("parameters.sysid"));
  EXPECT_THAT(MessageOf<DataError>([&] { read("sysid = 'gone.yaml'"); }), HasSubstr("gone.yaml"));
  EXPECT_EQ(Names(read("sysid = { field = 'opt/gravity[2]' }")), std::vector<std::string>{"sysid"})
      << "a name like any";
}

TEST(RunConfig, AParameterFileOnTheCommandLineTakesThePlaceOfTheConfigurations) {
  TestFolder folder;
  WriteFileAtomically(folder / "params.yaml", kSysidFile);
  const RunConfig config =
      RunConfig::FromToml("[parameters]\nsysid = 'gone.yaml'\ndamping = { field = 'joint/*/damping' }", "here.toml",
                          folder / "params.yaml");
  EXPECT_EQ(Names(config), (std::vector<std::string>{"damping", "friction"}));
  EXPECT_THAT(MessageOf<UsageError>([&] { RunConfig::FromToml("", "here.toml", folder / "params.yaml"); }),
              HasSubstr("'damping'"));
}

TEST(RunConfig, AnUnknownNameIsRefusedWithTheNearestAndItsLine) {
  const std::string key = Refusal("[sac]\nlearning_rat = 1e-3\n");
  EXPECT_THAT(key, HasSubstr("here.toml:10"));
  EXPECT_THAT(key, HasSubstr("did you mean 'learning_rate'?"));
  const std::string section = Refusal("[selecton]\nn_seeds = 3\n");
  EXPECT_THAT(section, HasSubstr("here.toml:9"));
  EXPECT_THAT(section, HasSubstr("did you mean 'selection'?"));
  const std::string method = Refusal("[design]\nmethod = \"papr\"\n");
  EXPECT_THAT(method, HasSubstr("here.toml:10"));
  EXPECT_THAT(method, HasSubstr("did you mean 'paper'?"));
  const std::string in_setting = Refusal("[design.settings.x]\nadversarial.horizn = 5\n");
  EXPECT_THAT(in_setting, HasSubstr("here.toml:10"));
  EXPECT_THAT(in_setting, HasSubstr("did you mean 'horizon'?"));
  const std::string former = Refusal("[design]\nform = \"paper\"\n");
  EXPECT_THAT(former, HasSubstr("here.toml:10"));
  EXPECT_THAT(former, HasSubstr("design.form is now design.method"));
  const std::string inner = Refusal("[design.trajectry]\nwindow = 8\n");
  EXPECT_THAT(inner, HasSubstr("did you mean 'design.trajectories'?"));
  const std::string truth = Refusal("[truth]\nfricton = 1\ngravity = 1\n");
  EXPECT_THAT(truth, HasSubstr("truth.fricton"));
  EXPECT_THAT(truth, HasSubstr("did you mean 'friction'?"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("seed = 3\n"); }), HasSubstr("outside of a section"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[parameters]\na = { field = \"x/y\", rnge = [0, 1] }"); }),
              HasSubstr("did you mean 'range'?"));
}

TEST(RunConfig, AValueOutsideItsRangeOrTypeIsRefusedWithWhatItTakes) {
  EXPECT_THAT(Refusal("[sac]\ngamma = 1.5\n"), HasSubstr("gamma is 1.5"));
  EXPECT_THAT(Refusal("[sac]\nbatch_size = 0\n"), HasSubstr("[1, 1000000]"));
  EXPECT_THAT(Refusal("[design.adversarial]\nn_sims = 1\n"), HasSubstr("n_sims is 1"));
  EXPECT_THAT(Refusal("[design.adversarial]\nn_sims = 2.5\n"), HasSubstr("int"));
  EXPECT_THAT(Refusal("[design.adversarial]\nreward = \"papre\"\n"), HasSubstr("did you mean 'paper'?"));
  EXPECT_THAT(Refusal("[run]\nstrict = 1\n"), HasSubstr("true|false"));
  EXPECT_THAT(Refusal("[run]\nseed = 2024-01-01\n"), HasSubstr("dates"));
  EXPECT_THAT(Refusal("[design]\nsettings = 3\n"), HasSubstr("[design.settings.NAME]"));
  EXPECT_THAT(Refusal("[design.settings.\"../up\"]\nadversarial.horizon = 3\n"), HasSubstr("'../up'"));
  for (const char* episodes : {"0", "-3", "\"five\"", "\"\"", "\"5 \"", "\"99999999999999999999\"", "2.5"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] {
                  Parse(fmt::format("[task]\nname = \"Hopper-v5\"\n[data]\nepisodes = {}\n"
                                    "[parameters]\na = {{ field = \"opt/gravity[2]\" }}\n",
                                    episodes))
                      .Check();
                }),
                HasSubstr("episodes is"))
        << episodes;
  }
}

TEST(RunConfig, BoundsThatAreEmptyInvertedOrInfiniteAreRefusedWithTheirLine) {
  for (const char* range : {"[1, 1]", "[2, 1]", "[0.2, inf]", "[nan, 1]", "[1]", "[1, 2, 3]", "3", "[\"a\", 2]"}) {
    const std::string message = MessageOf<UsageError>(
        [&] { Parse(fmt::format("[parameters]\nmass = {{ field = \"body/torso/mass\", range = {} }}\n", range)); });
    EXPECT_THAT(message, HasSubstr("here.toml:2")) << range;
    EXPECT_THAT(message, HasSubstr("mass")) << range;
  }
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[parameters]\na = { field = \"x/y\", range = [0, 1], log = true }"); }),
              HasSubstr("low > 0"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[parameters]\na = { field = \"x/y\", scale = \"absolute\" }"); }),
              HasSubstr("range"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[parameters]\na = { range = [0, 1] }"); }), HasSubstr("field"));
}

TEST(RunConfig, BrokenTomlIsRefusedWithItsLine) {
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[task]\nname = \"Hopper\n"); }), HasSubstr("here.toml:2"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[task\n"); }), HasSubstr("here.toml:1"));
  EXPECT_THAT(MessageOf<UsageError>([] { Parse("[task]\nname = \"a\"\nname = \"b\"\n"); }), HasSubstr("here.toml:3"));
  EXPECT_THROW(RunConfig::FromTomlFile("/no/such/file.toml"), DataError);
}

TEST(RunConfig, ASettingThatNoMethodReadsIsTold) {
  RunConfig config = Parse(kMinimal);
  config.Set("design.method=trajectories");
  config.Set("design.discriminator.steps=3");  // the judge's, whatever the method
  config.Set("design.trajectories.window=8");
  config.Set("design.dropo.budget=" + config.design.Assumed().ToJson()["dropo"]["budget"].dump());  // as by default
  EXPECT_EQ(config.UnreadSetting(), std::nullopt);
  config.Set("design.dropo.budget=7");
  EXPECT_THAT(config.UnreadSetting().value_or(""), AllOf(HasSubstr("design.dropo.budget"), HasSubstr("trajectories")));
  config.Set("design.method=dropo");
  EXPECT_THAT(config.UnreadSetting().value_or(""), HasSubstr("design.trajectories.window"));
  config.Set("design.method=auto");
  EXPECT_THAT(config.UnreadSetting().value_or(""), HasSubstr("design.dropo.budget")) << "auto never takes dropo";
}

TEST(RunConfig, SetTakesAnySetting) {
  RunConfig config = Parse(kMinimal);
  config.Set("design.adversarial.n_iterations=5");
  config.Set("clone.hidden=32,16");
  config.Set("sac.n_steps=1e5");
  config.Set("data.path=a=b.hdf5");
  config.Set("data.episodes=5");
  config.Set("data.format=csv");
  config.Set("data.observations=joint/hip/qpos,obs_1");
  config.Set("data.actions=[\"a,b\"]");
  config.Set("data.time=t");
  config.Set("data.action_delay=2");
  config.Set("data.unwrap=joint/*/qpos");
  config.Set("run.strict=true");
  EXPECT_EQ(config.design.Assumed().adversarial.n_iterations, 5);
  EXPECT_THAT(config.clone.hidden, ElementsAre(32, 16));
  EXPECT_EQ(config.algorithms.sac.n_steps, 100'000);
  config.Set("design.trajectories.window=8");
  config.Set("design.designer=categorical");
  EXPECT_EQ(config.design.Assumed().trajectories.window, 8);
  EXPECT_EQ(config.design.Assumed().designer, DesignerKind::kCategorical);
  EXPECT_EQ(config.data.path, "a=b.hdf5") << "the first '=' ends the key";
  EXPECT_EQ(config.data.episodes, "5");
  const DataOptions options = config.data.Options();
  EXPECT_EQ(options.format, DataFormat::kCsv);
  EXPECT_THAT(options.columns.observations, ElementsAre("joint/hip/qpos", "obs_1"));
  EXPECT_THAT(options.columns.actions, ElementsAre("a,b"));
  EXPECT_EQ(options.columns.time, "t");
  EXPECT_EQ(options.action_delay, 2);
  EXPECT_THAT(options.unwrap, ElementsAre("joint/*/qpos"));
  EXPECT_EQ(RunConfig::FromToml(config.ToToml(), "run.toml").ToJson(), config.ToJson());
  EXPECT_TRUE(config.run.strict);
}

TEST(RunConfig, AMalformedInlineTableIsAnErrorWithItsLine) {
  for (const char* text : {"a = {\n}", "a = { b = 1,\n }", "a = {", "a = { .b = 1 }", "a.\n= 1"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { Parse(text); }), HasSubstr("here.toml:")) << text;
  }
}

TEST(RunConfig, SetRefusesWhatItDoesNotKnow) {
  RunConfig config = Parse(kMinimal);
  const auto refusal = [&](const std::string& text) { return MessageOf<UsageError>([&] { config.Set(text); }); };
  EXPECT_THAT(refusal("design.adversarial.n_iteratons=5"), HasSubstr("did you mean 'n_iterations'?"));
  EXPECT_THAT(refusal("desing.prior=uniform"), HasSubstr("did you mean 'design'?"));
  EXPECT_THAT(refusal("design.adversarial.n_iterations=0"), HasSubstr("[1, inf)"));
  EXPECT_THAT(refusal("design.adversarial.n_iterations=five"), HasSubstr("\"five\""));
  EXPECT_THAT(refusal("design.adversarial.n_iterations="), HasSubstr("design.adversarial.n_iterations="));
  EXPECT_THAT(refusal("n_iterations=5"), HasSubstr("section.key=value"));
  EXPECT_THAT(refusal("design.adversarial.n_iterations"), HasSubstr("section.key=value"));
}

TEST(RunConfig, SetHoldsForEverySettingOfTheDesign) {
  RunConfig config =
      WithSection("[design.settings.a.adversarial]\nhorizon = 5\n[design.settings.b]\nmethod = \"paper\"\n");
  config.Set("design.adversarial.n_sims=8");
  EXPECT_EQ(config.DesignSettings().at("a").Assumed().adversarial.n_sims, 8);
  EXPECT_EQ(config.DesignSettings().at("b").Assumed().adversarial.n_sims, 8);
  EXPECT_EQ(config.DesignSettings().at("a").Assumed().adversarial.horizon, 5);
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Set("design.method=paper"); }), HasSubstr("design.settings.a"))
      << "each setting may have a method of its own";
}

TEST(RunConfig, WithoutSettingsThereIsOneCalledDefault) {
  const RunConfig config = WithSection("[design.adversarial]\nhorizon = 7\n");
  ASSERT_EQ(config.DesignSettings().size(), 1u);
  EXPECT_EQ(config.DesignSettings().at("default").Assumed().adversarial.horizon, 7);
}

TEST(RunConfig, TruthIsNamedWholeOrNotAtAll) {
  RunConfig config = Parse(kMinimal);
  config.Check();
  EXPECT_TRUE(config.TruthVector().empty());
  config.SetTruth("friction=0.6");
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("1 of 2"));
  config.SetTruth("gravity=1.2");
  config.Check();
  EXPECT_THAT(config.TruthVector(), ElementsAre(1.2, 0.6)) << "in the order of the parameters";
  for (const char* text : {"friction", "friction=", "friction=a", "friction=1x"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { config.SetTruth(text); }), HasSubstr("name=value")) << text;
  }
}

TEST(RunConfig, CheckNamesWhatIsMissingAndWhatIsDouble) {
  RunConfig config;
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("--task"));
  config.task.name = "Hopper-v5";
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("--param"));
  config.parameters = {ParseParameterSpec("a=opt/gravity[2]:0:1"), ParseParameterSpec("a=body/torso/mass:0:1")};
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("'a' is given twice"));
  config.parameters = {ParseParameterSpec("a b=opt/gravity[2]:0:1")};
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("'a b'"));
}

TEST(RunConfig, ThreadsAreAllOfThemUnlessSaid) {
  RunConfig config;
  EXPECT_GE(config.Threads(), 1);
  config.run.threads = 3;
  EXPECT_EQ(config.Threads(), 3);
}

TEST(RunConfig, AFormerNameOfASettingIsToldThePresentOne) {
  EXPECT_THAT(Refusal("[agents]\nundesigned = false\n"), HasSubstr("agents.undesigned is now agents.nominal"));
  RunConfig config;
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Set("agents.undesigned_at=1,1"); }),
              HasSubstr("agents.undesigned_at is now agents.nominal_at"));
}

TEST(RunConfig, TheActionsOfATaskChooseTheAlgorithmAndAnotherIsRefused) {
  SimulatorSpec continuous, discrete;
  continuous.task = "Mine";
  discrete.task = "Grid";
  discrete.n_discrete_actions = 3;
  RunConfig config;
  EXPECT_EQ(config.agents.AlgorithmFor(continuous), AgentAlgorithm::kSac);
  EXPECT_EQ(config.agents.AlgorithmFor(discrete), AgentAlgorithm::kPpo);
  config.Set("agents.algorithm=crossq");
  EXPECT_THAT(MessageOf<UsageError>([&] { config.agents.AlgorithmFor(discrete); }),
              testing::AllOf(HasSubstr("agents.algorithm is crossq"), HasSubstr("set it to ppo")));
  config.Set("agents.algorithm=ppo");
  EXPECT_EQ(config.agents.AlgorithmFor(discrete), AgentAlgorithm::kPpo);
  EXPECT_THAT(MessageOf<UsageError>([&] { config.agents.AlgorithmFor(continuous); }),
              testing::AllOf(HasSubstr("agents.algorithm is ppo"), HasSubstr("'Mine' has continuous actions")));
  config.Set("agents.algorithm=sac");
  EXPECT_THAT(MessageOf<UsageError>([&] { config.agents.AlgorithmFor(discrete); }),
              HasSubstr("'Grid' has discrete actions"));
  EXPECT_THAT(Refusal("[agents]\nalgorithm = \"dqn\"\n"), HasSubstr("auto"));
}

TEST(RunConfig, SettingsOfAnAlgorithmThatAgentsDoNotLearnByAreRefused) {
  SimulatorSpec continuous;
  continuous.task = "Mine";
  RunConfig config;
  config.CheckAgentSettings(continuous);
  config.Set("crossq.gamma=0.98");
  EXPECT_THAT(
      MessageOf<UsageError>([&] { config.CheckAgentSettings(continuous); }),
      testing::AllOf(HasSubstr("crossq.gamma is set"), HasSubstr("set sac.gamma, or agents.algorithm = crossq")));
  config.Set("agents.algorithm=crossq");
  config.CheckAgentSettings(continuous);
  config.Set("sac.tau=0.01");
  EXPECT_THAT(MessageOf<UsageError>([&] { config.CheckAgentSettings(continuous); }), HasSubstr("sac.tau is set"));
}

TEST(RunConfig, AnAgentThatWouldNeverLearnIsRefused) {
  SimulatorSpec continuous;
  RunConfig config;
  config.Set("sac.n_steps=1000");
  config.CheckAgentSettings(continuous);
  config.Set("agents.algorithm=crossq");
  config.Set("sac.n_steps=300000");
  config.Set("crossq.n_steps=5000");
  config.CheckAgentSettings(continuous);
  config.Set("crossq.n_steps=4999");
  EXPECT_THAT(MessageOf<UsageError>([&] { config.CheckAgentSettings(continuous); }),
              HasSubstr("crossq.n_steps is 4999, which is over before the first gradient step after "
                        "crossq.learning_starts = 5000"));
  const auto told = [&](const std::vector<const char*>& settings) {
    RunConfig other;
    for (const char* setting : settings) other.Set(setting);
    return MessageOf<UsageError>([&] { other.CheckAgentSettings(continuous); });
  };
  EXPECT_THAT(told({"sac.updates_per_step=1e-6"}), HasSubstr("no gradient step in the 59016 control steps"));
  EXPECT_THAT(told({"sac.n_lanes=5_000", "sac.eval_interval=2_000"}),
              HasSubstr("sac.n_lanes is 5000, more than the control steps"));
  EXPECT_THAT(told({"sac.buffer_size=10"}), HasSubstr("sac.batch_size is 64, more than the transitions kept"));
}

TEST(RunConfig, PresetsAreANameOrAListOfNamesBesideParameters) {
  const RunConfig one = RunConfig::FromToml("[parameters]\npreset = \"arm\"\n", "t.toml");
  EXPECT_EQ(one.presets, std::vector<std::string>{"arm"});
  EXPECT_TRUE(one.parameters.empty());
  const RunConfig two = RunConfig::FromToml(
      "[parameters]\npreset = [\"arm\", \"gripper\"]\nwind = { field = \"opt/wind[0]\", range = [-1, 1], scale = "
      "\"absolute\" }\n",
      "t.toml");
  EXPECT_EQ(two.presets, (std::vector<std::string>{"arm", "gripper"}));
  EXPECT_EQ(two.parameters.size(), 1u);
  EXPECT_EQ(RunConfig::FromToml(two.ToToml(), "again.toml").presets, two.presets);
  EXPECT_THROW(RunConfig::FromToml("[parameters]\npreset = 3\n", "t.toml"), UsageError);
}

}  // namespace oted::run_config_test
