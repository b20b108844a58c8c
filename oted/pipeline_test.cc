#include "oted/pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/collect.h"
#include "oted/nn/onnx_policy.h"
#include "oted/rl/batch_policy.h"
#include "oted/run_inputs.h"

namespace oted {
namespace {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// Counts units of work, and may ask for a stop at one of them.
class Watch : public NullSink {
 public:
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t, std::string_view) override {
    const std::lock_guard lock(mutex);
    worked.insert(std::string(label));
    if (stage == stop_stage && done >= stop_at) stop = true;
  }
  void Warning(std::string_view message) override {
    const std::lock_guard lock(mutex);
    warnings.push_back(std::string(message));
  }
  std::mutex mutex;
  std::set<std::string> worked;
  std::vector<std::string> warnings;
  std::string stop_stage;
  int64_t stop_at = 0;
  std::atomic<bool> stop{false};
};

/// Eight episodes of random actions in Hopper-v5, written once.
const std::string& Demos() {
  static const TestFolder folder;
  static const std::string path = [] {
    const auto factory = MakeSimulatorFactory(TaskConfig::FromArgument("Hopper-v5"), {});
    const SimulatorSpec& spec = factory->spec();
    const size_t n = static_cast<size_t>(spec.obs_dim());
    TanhGaussianPolicy policy(Normalizer{std::vector<double>(n, 0), std::vector<double>(n, 1)}, {}, spec.action_low,
                              spec.action_high);
    std::fill(policy.net().parameters().begin(), policy.net().parameters().end(), 0.0f);
    const Dataset dataset = CollectDemonstrations(*factory, {}, policy, 8, RngKey(3), 1);
    WriteDataset(dataset, folder / "demos.hdf5");
    return folder / "demos.hdf5";
  }();
  return path;
}

RunConfig TinyConfig() {
  RunConfig config = RunConfig::FromToml(R"(
    [task]
    name = "Hopper-v5"
    [parameters]
    gravity  = { field = "opt/gravity[2]", range = [0.2, 2.0] }
    friction = { field = "geom/*/friction[0]", range = [0.2, 2.0] }
    [run]
    threads = 1
    [report]
    motion = false
    [clone]
    hidden = [16]
    max_steps = 60
    check_interval = 20
    [design]
    n_iterations = 3
    n_sims = 4
    n_steps = 20
    discriminator_hidden = [16]
    discriminator_steps = 5
    discriminator_batch = 32
    trajectory_rows = 32
    trajectory_window = 4
    trajectory_starts = 1
    trajectory_coarse = 4
    [selection]
    n_seeds = 2
    n_sims = 2
    n_steps = 20
    judge_steps = 20
    [agents]
    n_agents = 2
    selection_episodes = 2
    target_episodes = 2
    [crossq]
    n_steps = 300
    learning_starts = 100
    batch_size = 32
    hidden = [16]
    critic_hidden = [16]
    buffer_size = 1000
    eval_interval = 150
    eval_episodes = 1
    [truth]
    gravity = 1.2
    friction = 0.6
  )",
                                         "tiny.toml");
  config.data.path = Demos();
  return config;
}

void RunPipeline(const RunConfig& config, const fs::path& out, Watch& watch,
                 void (Pipeline::*call)() = &Pipeline::Run) {
  Pipeline pipeline(config, out, {.log = &watch, .stop = &watch.stop, .n_threads = 1});
  (pipeline.*call)();
}
void RunPipeline(const RunConfig& config, const fs::path& out, void (Pipeline::*call)() = &Pipeline::Run) {
  Watch watch;
  RunPipeline(config, out, watch, call);
}

using Snapshot = std::map<std::string, std::pair<std::string, fs::file_time_type>>;
/// Every file below `root` with its bytes and the time of its last change.
Snapshot Look(const fs::path& root) {
  Snapshot files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), root).string()] = {ReadFile(entry.path()), entry.last_write_time()};
  }
  return files;
}
std::map<std::string, std::string> Bytes(const fs::path& root) {
  std::map<std::string, std::string> bytes;
  for (const auto& [name, file] : Look(root)) bytes[name] = file.first;
  return bytes;
}

/// One whole run that the tests compare with, and copies of it.
class PipelineTest : public testing::Test {
 protected:
  static const fs::path& Whole() {
    static const TestFolder folder;
    static const bool done = (RunPipeline(TinyConfig(), folder.path() / "run"), true);
    static const fs::path path = folder.path() / "run";
    EXPECT_TRUE(done);
    return path;
  }
  fs::path Copy() {
    fs::copy(Whole(), folder_.path() / "copy", fs::copy_options::recursive);
    return folder_.path() / "copy";
  }
  fs::path Fresh(const std::string& name) const { return folder_.path() / name; }
  /// The whole run up to its design.
  fs::path CopyWithoutAgents(const std::string& name) const {
    fs::copy(Whole(), Fresh(name), fs::copy_options::recursive);
    for (const char* made : {"agents", "undesigned", "policy_selection.json", "evaluation.json", "policy.onnx"}) {
      fs::remove_all(Fresh(name) / made);
    }
    return Fresh(name);
  }

 private:
  TestFolder folder_;
};

TEST_F(PipelineTest, LeavesTheDocumentedFilesAndNoOthers) {
  std::set<std::string> names;
  for (const auto& [name, bytes] : Bytes(Whole())) names.insert(name);
  std::set<std::string> wanted = {"run.toml",          "dataset.json", "clone/policy.npz",      "clone/clone.json",
                                  "policy.onnx",       "design.json",  "policy_selection.json", "evaluation.json",
                                  "motion/replay.json"};
  for (const char* k : {"1", "2"}) {
    for (const char* file : {"q.json", "discriminator.npz"}) {
      wanted.insert(std::string("design/default/") + k + "/" + file);
    }
    for (const char* folder : {"agents/", "undesigned/"}) {
      wanted.insert(std::string(folder) + k + "/policy.npz");
      wanted.insert(std::string(folder) + k + "/agent.json");
      wanted.insert(std::string(folder) + k + "/policy.onnx");
    }
  }
  EXPECT_EQ(names, wanted);
}

TEST_F(PipelineTest, ItsResultsHaveTheDocumentedFields) {
  const json design = ReadJson(Whole() / "design.json");
  EXPECT_EQ(design.at("schema"), "oted.design/1");
  ASSERT_EQ(design.at("parameters").size(), 2u);
  EXPECT_EQ(design["parameters"][0].at("name"), "gravity") << "in the order of the configuration";
  EXPECT_EQ(design["parameters"][1].at("name"), "friction");
  for (const char* key : {"field", "unit", "nominal", "mode", "std", "interval90", "verdict"}) {
    EXPECT_TRUE(design["parameters"][0].contains(key)) << key;
  }
  EXPECT_EQ(design.at("selected"), "default");
  ASSERT_EQ(design.at("mixture").size(), 2u);
  for (const char* key : {"correlation", "score", "verdict", "dataset", "model", "versions", "settings", "log2"}) {
    EXPECT_TRUE(design.contains(key)) << key;
  }
  const json evaluation = ReadJson(Whole() / "evaluation.json");
  std::vector<std::string> policies;
  for (const json& policy : evaluation.at("policies")) policies.push_back(policy.at("name"));
  EXPECT_THAT(policies, testing::ElementsAre("random", "clone", "crossq_undesigned", "oted_crossq"));
  EXPECT_EQ(evaluation["parameters"][1].at("truth"), 0.6);
  const json selection = ReadJson(Whole() / "policy_selection.json");
  EXPECT_EQ(selection.at("simulators").size(), 2u);
  ASSERT_EQ(selection.at("agents").size(), 2u);
  EXPECT_EQ(selection["agents"][0].at("returns").size(), 2u);
  const json dataset = ReadJson(Whole() / "dataset.json");
  EXPECT_EQ(dataset.at("n_episodes"), 8);
  EXPECT_EQ(dataset.at("sha256"), Sha256OfFile(Demos()));
  const RunConfig resolved = RunConfig::FromTomlFile((Whole() / "run.toml").string());
  EXPECT_EQ(resolved.ToJson(), TinyConfig().ToJson()) << "form = auto stays: design.json says what it became";
  EXPECT_EQ(design.at("form_choices").at(0).at("form"), "trajectories");
}

/// The tiny study with one agent, all of the baselines beside it.
RunConfig WithBaselines() {
  RunConfig config = TinyConfig();
  config.agents.n_agents = 1;
  config.baselines.run = BaselinesConfig::Known();
  config.baselines.is.episodes = 1;
  return config;
}

/// One whole run of that study.
const fs::path& WholeWithBaselines() {
  static const TestFolder folder;
  static const bool done = (RunPipeline(WithBaselines(), folder.path() / "run"), true);
  static const fs::path path = folder.path() / "run";
  EXPECT_TRUE(done);
  return path;
}

TEST_F(PipelineTest, BaselinesAreTrainedAndEvaluatedAndTouchNothingElse) {
  const fs::path& out = WholeWithBaselines();
  const auto plain = Bytes(Whole()), with = Bytes(out);
  for (const char* file : {"design.json", "clone/policy.npz", "agents/1/policy.npz", "undesigned/1/policy.npz"}) {
    EXPECT_EQ(with.at(file), plain.at(file)) << file;
  }
  for (const std::string name : {"dr", "is"}) {
    const std::string folder = "baselines/" + name + "/1/";
    EXPECT_TRUE(with.contains(folder + "policy.onnx")) << name;
    EXPECT_NE(with.at(folder + "policy.npz"), with.at("undesigned/1/policy.npz")) << name;
    EXPECT_EQ(ReadJson(out / folder / "agent.json").at("baseline"), name);
  }
  EXPECT_TRUE(with.contains("baselines/bc_dr/policy.onnx"));
  const json interval = ReadJson(out / "baselines/is/1/agent.json").at("episodes");
  EXPECT_LE(interval.at("interval/low/friction").get<double>(), 1.0) << "it began at the nominal value";
  EXPECT_GE(interval.at("interval/high/friction").get<double>(), 1.0);
  std::vector<std::string> names;
  const json evaluation = ReadJson(out / "evaluation.json");
  for (const json& policy : evaluation.at("policies")) names.push_back(policy.at("name"));
  EXPECT_THAT(names, testing::ElementsAre("random", "clone", "bc_dr", "crossq_dr", "crossq_is", "crossq_undesigned",
                                          "oted_crossq"));
}

TEST_F(PipelineTest, BaselinesHaveTheSameBytesAtAnyNumberOfThreadsAndAfterStops) {
  const fs::path stopped = CopyWithoutAgents("stopped");
  RunConfig config = WithBaselines();
  config.run.threads = 3;
  for (const int64_t at : {0, 150}) {
    Watch watch;
    watch.stop_stage = "train";
    watch.stop_at = at;
    EXPECT_THROW(RunPipeline(config, stopped, watch), Interrupted) << at;
  }
  RunPipeline(config, stopped);
  auto whole = Bytes(WholeWithBaselines()), other = Bytes(stopped);
  EXPECT_EQ(whole.erase("run.toml") + other.erase("run.toml"), 2u) << "it holds the number of threads";
  ASSERT_EQ(whole.size(), other.size());
  for (const auto& [name, bytes] : whole) EXPECT_EQ(other.at(name), bytes) << name;
}

TEST_F(PipelineTest, AgentsTrainInModesSamplesOrTheBestSimulator) {
  const auto policy_of = [&](const std::string& train_in, int n_seeds) {
    RunConfig config = TinyConfig();
    config.truth.clear();
    config.agents.n_agents = 1;
    config.agents.train_in = train_in;
    config.selection.n_seeds = n_seeds;
    const fs::path out = CopyWithoutAgents(train_in + std::to_string(n_seeds));
    if (n_seeds != 2) fs::remove(out / "design.json");
    RunPipeline(config, out, &Pipeline::TrainAgents);
    const json record = ReadJson(out / "agents/1/agent.json");
    EXPECT_EQ(record.value("train_in", "modes"), train_in);
    return ReadFile(out / "agents/1/policy.npz");
  };
  const std::string modes = ReadFile(Whole() / "agents/1/policy.npz");
  EXPECT_NE(policy_of("samples", 2), modes);
  EXPECT_NE(policy_of("best", 2), modes);
  EXPECT_EQ(policy_of("best", 1), policy_of("modes", 1)) << "with one seed there is one simulator";
}

TEST_F(PipelineTest, RunningAgainDoesNothing) {
  const fs::path copy = Copy();
  const Snapshot before = Look(copy);
  Watch watch;
  RunPipeline(TinyConfig(), copy, watch);
  EXPECT_TRUE(watch.worked.empty()) << "first of them: " << *watch.worked.begin();
  const Snapshot after = Look(copy);
  ASSERT_EQ(after.size(), before.size());
  for (const auto& [name, file] : before) {
    EXPECT_EQ(after.at(name).first, file.first) << name;
    // The record of what was asked is written anew each time.
    if (name != "run.toml" && name != "dataset.json") {
      EXPECT_EQ(after.at(name).second, file.second) << name;
    }
  }
}

TEST_F(PipelineTest, AMissingPieceIsMadeAgainAloneAndIsTheSame) {
  const fs::path copy = Copy();
  const auto before = Bytes(copy);
  fs::remove(copy / "design/default/2/q.json");
  Watch watch;
  RunPipeline(TinyConfig(), copy, watch);
  EXPECT_THAT(watch.worked, testing::ElementsAre("design/default/2"));
  EXPECT_EQ(Bytes(copy), before);
}

TEST_F(PipelineTest, GivesTheSameBytesAtAnyNumberOfThreads) {
  RunConfig config = TinyConfig();
  config.run.threads = 3;
  RunPipeline(config, Fresh("three"));
  auto one = Bytes(Whole()), three = Bytes(Fresh("three"));
  EXPECT_EQ(one.erase("run.toml") + three.erase("run.toml"), 2u) << "it holds the number of threads";
  ASSERT_EQ(one.size(), three.size());
  for (const auto& [name, bytes] : one) EXPECT_EQ(three.at(name), bytes) << name;
}

TEST_F(PipelineTest, TheTruthChangesNothingThatTheDesignWrites) {
  RunConfig other = TinyConfig(), without = TinyConfig();
  other.truth = {{"gravity", 0.3}, {"friction", 1.9}};
  without.truth.clear();
  RunPipeline(other, Fresh("other"), &Pipeline::SelectPolicy);
  RunPipeline(without, Fresh("without"), &Pipeline::SelectPolicy);
  const auto whole = Bytes(Whole());
  for (const char* name : {"other", "without"}) {
    const auto bytes = Bytes(Fresh(name));
    for (const auto& [file, content] : bytes) {
      if (file == "run.toml") continue;
      EXPECT_EQ(whole.at(file), content) << name << ": " << file;
    }
    for (const char* file :
         {"design.json", "design/default/1/q.json", "design/default/2/q.json", "agents/1/policy.npz"}) {
      EXPECT_TRUE(bytes.contains(file)) << file;
    }
  }
}

TEST_F(PipelineTest, OtherSettingsInTheSameDirectoryAreRefusedAndNothingIsTouched) {
  const fs::path copy = Copy();
  const Snapshot before = Look(copy);
  const auto refuse = [&](const std::string& assignment) {
    RunConfig config = TinyConfig();
    config.Set(assignment);
    EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("choose another --out"))
        << assignment;
    EXPECT_EQ(Look(copy), before) << assignment;
  };
  refuse("run.seed=2");
  refuse("clone.max_steps=61");
  refuse("design.lambda=0.02");
  refuse("selection.judge_steps=21");
  refuse("crossq.gamma=0.98");
  refuse("data.episodes=7");
  refuse("data.action_delay=1");
  refuse("agents.selection_episodes=3");
  refuse("agents.train_in=samples");
  refuse("agents.undesigned_at=1.5,1.5");
  RunConfig config = TinyConfig();
  config.parameters[0].high = 1.9;
  EXPECT_THROW(RunPipeline(config, copy), UsageError);
  config = TinyConfig();
  config.truth["gravity"] = 1.1;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("evaluation.json"));
  EXPECT_EQ(Look(copy), before);
  config = TinyConfig();
  config.baselines.run = {"dr"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("evaluation.json"))
      << "its table is of other policies";
  EXPECT_EQ(Look(copy), before);
}

TEST_F(PipelineTest, EveryAgentLeavesAnOnnxFileThatActsAsItDoesAndTheSelectedOneLiesOnTop) {
  const fs::path out = Fresh("onnx");
  fs::copy(Whole(), out, fs::copy_options::recursive);
  const std::string selected = std::to_string(ReadJson(out / "policy_selection.json").at("selected").get<int>());
  EXPECT_EQ(ReadFile(out / "policy.onnx"), ReadFile(out / "agents" / selected / "policy.onnx"));
  const auto before = Bytes(out);
  for (const char* folder : {"agents/1", "agents/2", "undesigned/1", "undesigned/2"}) {
    const TanhGaussianPolicy policy = TanhGaussianPolicy::Load(out / folder / "policy.npz");
    const OnnxPolicy onnx = OnnxPolicy::Load(out / folder / "policy.onnx");
    EXPECT_EQ(onnx.metadata().at("task"), "Hopper-v5");
    EXPECT_EQ(onnx.metadata().at("action_names"), R"(["thigh_joint","leg_joint","foot_joint"])");
    EXPECT_EQ(onnx.metadata().at("control_period_s"), "0.008");
    EXPECT_THAT(onnx.metadata().at("observation_names"), HasSubstr("rootz_pos"));
    EXPECT_THAT(onnx.metadata().at("source"), HasSubstr(folder));
    std::vector<double> observations(3 * 11), actions(3 * 3);
    Rng rng(1);
    for (double& v : observations) v = rng.Normal();
    MeanActionPolicy(policy)(observations, 3, actions);
    const OnnxValue read = onnx.Evaluate(observations, 3);
    for (size_t i = 0; i < actions.size(); ++i) EXPECT_NEAR(read.data[i], actions[i], 1e-5);
    fs::remove(out / folder / "policy.onnx");
  }
  fs::remove(out / "policy.onnx");
  // As after a run of an earlier version: only the missing files are made again, byte for byte.
  RunPipeline(TinyConfig(), out);
  EXPECT_EQ(Bytes(out), before);
}

TEST_F(PipelineTest, AStoppedRunGoesOnAsIfItHadNot) {
  // Algorithm 1 keeps checkpoints; trajectory matching, which takes seconds, begins anew.
  RunConfig tiny = TinyConfig();
  tiny.design.form = "transitions";
  const fs::path out = Fresh("stopped"), undisturbed = Fresh("undisturbed");
  RunPipeline(tiny, undisturbed);
  for (const auto& [stage, at] : {std::pair{"design", 2}, std::pair{"train", 150}}) {
    Watch watch;
    watch.stop_stage = stage;
    watch.stop_at = at;
    EXPECT_THROW(RunPipeline(tiny, out, watch), Interrupted) << stage;
    EXPECT_FALSE(fs::exists(out / "evaluation.json"));
    RunConfig other = tiny;
    other.Set("design.lambda=0.02");
    other.Set("crossq.gamma=0.98");
    EXPECT_THROW(RunPipeline(other, out), UsageError) << "work of other settings would be gone on with: " << stage;
  }
  RunPipeline(tiny, out);
  const auto whole = Bytes(undisturbed), stopped = Bytes(out);
  ASSERT_EQ(stopped.size(), whole.size());
  for (const auto& [name, bytes] : whole) EXPECT_EQ(stopped.at(name), bytes) << name;
}

TEST_F(PipelineTest, ACsvWithTheTasksNamesInAnotherOrderIsTheSameData) {
  const auto factory = MakeSimulatorFactory(TaskConfig::FromArgument("Hopper-v5"), {});
  const Dataset demos = ReadDataset(Demos());
  Dataset named = demos;
  named.observation_names = factory->spec().observation_names;
  std::reverse(named.observation_names.begin(), named.observation_names.end());
  for (Array2<double>* m : {&named.observations, &named.next_observations}) {
    for (int i = 0; i < m->rows(); ++i) std::reverse(m->row(i).begin(), m->row(i).end());
  }
  named.period_s = factory->spec().control_period_s;
  const TestFolder folder;
  WriteDataset(named, folder / "demos.csv.gz");
  const Dataset read = ReadDataset(folder / "demos.csv.gz", DataOptionsFor(DataConfig{}, factory->spec()));
  EXPECT_EQ(read.observations, demos.observations);
  EXPECT_EQ(read.next_observations, demos.next_observations);
  EXPECT_EQ(read.actions, demos.actions);
  EXPECT_EQ(read.terminals, demos.terminals);
  EXPECT_THAT(read.remarks, testing::ElementsAre(HasSubstr("put into the task's order")));
}

TEST_F(PipelineTest, AWrongRequestIsRefusedBeforeAnythingIsWritten) {
  const auto refuse = [&](const RunConfig& config, const std::string& what) {
    try {
      RunPipeline(config, Fresh("none"));
      ADD_FAILURE() << "not refused: " << what;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(what));
    }
    EXPECT_FALSE(fs::exists(Fresh("none"))) << what;
  };
  RunConfig config = TinyConfig();
  config.truth["gravity"] = 2.5;
  refuse(config, "'gravity'");
  config = TinyConfig();
  config.data.episodes = "9";
  refuse(config, "holds 8");
  config = TinyConfig();
  config.task.name = "Walker2d-v5";
  refuse(config, "'Walker2d-v5'");
  config = TinyConfig();
  config.parameters[1].field = "geom/*/frction[0]";
  refuse(config, "frction");
  config = TinyConfig();
  config.agents.algorithm = "ppo";
  refuse(config, "continuous actions");
}

TEST_F(PipelineTest, AParameterWithoutEffectIsAWarningAndUnderStrictAnError) {
  RunConfig config = TinyConfig();
  // Friction is the larger of the two geoms': the foot's is 2, so the floor's below that does nothing.
  config.parameters[1] = ParseParameterSpec("floor=geom/floor/friction[0]:0.2:1.0");
  config.truth.clear();
  config.run.strict = true;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, Fresh("strict")); }), HasSubstr("'floor'"));
  EXPECT_FALSE(fs::exists(Fresh("strict")));
  config.run.strict = false;
  Watch watch;
  RunPipeline(config, Fresh("warned"), watch, &Pipeline::SelectSimulator);
  ASSERT_EQ(watch.warnings.size(), 1u) << "told once";
  EXPECT_THAT(watch.warnings[0], HasSubstr("'floor'"));
  const json design = ReadJson(Fresh("warned") / "design.json");
  EXPECT_EQ(design["parameters"][1].at("verdict"), "not_identified");
  EXPECT_EQ(design.at("warnings").size(), 1u);
}

json ReplayOf(const fs::path& out) { return ReadJson(out / "motion/replay.json"); }

TEST(PipelineReplayTest, TheRecordComparesTheLogsWithBothSimulatorsAtTheSameActions) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 10;
  Watch watch;
  RunContext context;
  context.log = &watch;
  Pipeline pipeline(config, folder.path(), context);
  pipeline.ReplayLogs();
  const json replay = ReplayOf(folder.path());
  EXPECT_EQ(replay["nominal"], json(std::vector<double>(config.parameters.size(), 1.0)));
  ASSERT_GT(replay["channels"].size(), 5u);
  double before = std::numeric_limits<double>::infinity();
  for (const json& channel : replay["channels"]) {
    ASSERT_EQ(channel["logged"].size(), 11u);
    EXPECT_EQ(channel["logged"][0], channel["nominal"][0]) << "a replay starts in the logged state";
    EXPECT_EQ(channel["logged"][0], channel["designed"][0]);
    // The data are float32 and were logged in the nominal simulator: replayed there, they come out again.
    const double end = channel["logged"][10].get<double>();
    EXPECT_NEAR(channel["nominal"][10].get<double>(), end, 1e-2 * (1 + std::abs(end))) << channel["name"];
    EXPECT_LE(channel["error_nominal"].get<double>(), before) << "the largest error first";
    before = channel["error_nominal"].get<double>();
  }
  EXPECT_LT(replay["error"]["nominal"]["median"][10].get<double>(),
            replay["error"]["designed"]["median"][10].get<double>());
  EXPECT_FALSE(fs::exists(folder.path() / "motion/motion.json")) << "no pictures were asked for";
}

TEST(PipelineReplayTest, PicturesAreDrawnWhereTheyCanBeAndOtherwiseANoteSaysWhy) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 5;
  config.report.motion = "auto";
  Watch watch;
  RunContext context;
  context.log = &watch;
  ::setenv("MUJOCO_GL", "off", 1);
  Pipeline(config, folder.path(), context).ReplayLogs();
  EXPECT_THAT(ReadJson(folder.path() / "motion/motion.json")["note"].get<std::string>(), HasSubstr("MUJOCO_GL=off"));
  const std::string replay = ReadFile(folder / "motion/replay.json");
  config.report.motion = "true";
  EXPECT_THAT(MessageOf<UsageError>([&] { Pipeline(config, folder.path(), context); }),
              testing::AllOf(HasSubstr("report.motion"), HasSubstr("MUJOCO_GL=off")));
  ::unsetenv("MUJOCO_GL");

  // The next call draws what the first could not; the curves do not depend on it.
  config.report.motion = "auto";
  Pipeline(config, folder.path(), context).ReplayLogs();
  EXPECT_EQ(ReadFile(folder / "motion/replay.json"), replay);
  const json motion = ReadJson(folder.path() / "motion/motion.json");
  if (motion.contains("note")) GTEST_SKIP() << motion["note"];
  EXPECT_EQ(motion["n_frames"], 6);
  for (const char* name : {"logged", "nominal", "designed"}) {
    EXPECT_GT(fs::file_size(folder.path() / "motion" / (std::string(name) + ".webp")), 1000u);
  }
  config.report.motion = "false";
  Pipeline(config, folder.path(), context).ReplayLogs();
  EXPECT_FALSE(fs::exists(folder.path() / "motion/logged.webp"));
}

TEST(PipelineReplayTest, LogsThatAreTooShortGiveANoteAndNoError) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 100000;
  Watch watch;
  RunContext context;
  context.log = &watch;
  Pipeline(config, folder.path(), context).ReplayLogs();
  EXPECT_THAT(ReplayOf(folder.path())["note"].get<std::string>(), HasSubstr("report.replay_steps"));
  // Another length is simply replayed anew.
  config.report.replay_steps = 5;
  Pipeline(config, folder.path(), context).ReplayLogs();
  EXPECT_TRUE(ReplayOf(folder.path()).contains("window"));
}

}  // namespace
}  // namespace oted
