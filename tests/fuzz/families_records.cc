// What the program reads of its own: records of a run, a run directory under its report, plans.

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/plan/plan.h"
#include "oted/plan/unit_record.h"
#include "oted/report/gather.h"
#include "oted/report/sample_run.h"
#include "oted/run/design_record.h"
#include "oted/run/kept_trials.h"
#include "oted/run/policy_records.h"
#include "oted/run/records.h"
#include "tests/fuzz/families.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

ParameterSpec Spec(const std::string& name, const std::string& field) {
  ParameterSpec spec;
  spec.name = name;
  spec.field = field;
  spec.low = 0.2;
  spec.high = 2;
  return spec;
}

ParameterSpace Space() {
  return ParameterSpace({Spec("friction", "geom/*/friction[0]"), Spec("gravity", "opt/gravity[2]")});
}

/// A record as its codec reads it, behind the seal.
template <class Record>
FuzzReader CodecReader(const std::string& file) {
  return {file, [file](const fs::path& folder) {
            Record::FromJson(ReadSealed(folder / file, true), (folder / file).string());
          }};
}

DesignRecord SampleDesign(const Suspect& suspect) {
  DesignRecord record;
  record.task = "Hopper-v5";
  record.parameters = {{"friction", "geom/*/friction[0]", "x nominal", 1, 0.2, 2, false, 0.6, 0.1, 0.5, 0.7}};
  record.correlation = {{1}};
  record.selected = "a";
  record.mixture = {{1, {0.6}, {0.1}}};
  record.fit = DesignRecord::Fit{32, 0.9, {{"x", 0.1, 0.1, 0.2, true}}, {{suspect, "a sentence", "a line"}}};
  record.grown = {suspect};
  record.validation = DesignRecord::Validation{{{0.5, 62, 20, false, 0.3, true, {{"x", "m", 1, 0.5, 0.1}}}}};
  record.settings = {{"a", "transitions", 0.6, 0.02, 0.6, 0.3, {{{1, {0.6}, {0.1}}, 0.6, 0.6, 0.3}}}};
  return record;
}

/// The simpler ones of one family: whatever the bytes are, one codec is theirs and the others have to refuse them.
FuzzFamily RecordFamily() {
  FuzzFamily family{.name = "records"};
  const auto seed = [&](const json& record) { family.seeds.push_back(record.dump(2)); };
  const Suspect suspect{Spec("damping", "joint/*/damping"), 1.5, 20, FreedTrial{}};
  HeldOutPrediction prediction;
  prediction.horizons = {
      {0.5, 62, 20, false, {{1, 0.5, 0.1, 2, true, {0.1, 0.1}, {0.2, 0.1}}}, {0.1, 0.1}, {0.2, 0.1}}};
  PolicySelectionRecord selection;
  selection.simulators = {{1, {0.5, 1.5}}};
  selection.agents = {{1, {3, 4}, 3.5, 0}};
  seed(CloneRecord{}.ToJson());
  seed(PredictionRecord{prediction}.ToJson());
  MethodChoice choice;
  choice.setting = choice.picked = "a";
  choice.tried.push_back({.mode = {1}});
  seed(MethodChoiceRecord{choice}.ToJson());
  seed(GrowthRecord{{suspect}}.ToJson());
  seed(ScreeningRecord{{{suspect}, {{"damping", Eigen::VectorXd::Ones(3)}}}}.ToJson());
  const WindowCosts costs{{{{0, 8}, Eigen::VectorXd::Ones(2)}}};
  seed(TrialRecord{{FreedTrial{}, TrialCosts{costs, {0, 1}}}}.ToJson());
  seed(SampleDesign(suspect).ToJson());
  seed(AgentRecord{.episodes = {{"length", 3.5}}}.ToJson());
  seed(OfflineRecord{.baseline = "mbop", .losses = {{"loss", 0.5}}}.ToJson());
  seed(selection.ToJson());
  seed(EvaluationRecord{
      "Hopper-v5", 2, {{"friction", "-", 1, 0.6, 0.7, 0.1, 0.1}}, {{"random", "random actions", 1, 2, 0, 3.0}}}
           .ToJson());
  Designer with_prior(Space(), 1.0);
  with_prior.SetPrior(Prior::Gaussian(Eigen::VectorXd::Ones(2), Eigen::MatrixXd::Identity(2, 2)));
  for (const Designer& q : {Designer(Space(), 1.0), with_prior}) seed(QRecord{q, 0.1, 0.5, FitEvidence{}}.ToJson());

  family.readers = {CodecReader<CloneRecord>("clone.json"),
                    CodecReader<PredictionRecord>("prediction.json"),
                    CodecReader<MethodChoiceRecord>("choice.json"),
                    CodecReader<GrowthRecord>("growth.json"),
                    CodecReader<ScreeningRecord>("suspects.json"),
                    CodecReader<TrialRecord>("trial_1.json"),
                    CodecReader<DesignRecord>("design.json"),
                    CodecReader<AgentRecord>("agent.json"),
                    CodecReader<OfflineRecord>("offline.json"),
                    CodecReader<PolicySelectionRecord>("policy_selection.json"),
                    CodecReader<EvaluationRecord>("evaluation.json"),
                    {"q.json", [](const fs::path& f) {
                       QRecord::FromJson(ReadSealed(f / "q.json", true), Space(), (f / "q.json").string());
                     }}};
  return family;
}

/// Runs that are whole but for one file, under the report.
FuzzFamily ReportFamily(const fs::path& folder) {
  FuzzFamily family{.name = "report"};
  const SampleRun run(folder / "run");
  run.WriteAll();
  run.WriteMotion();
  for (const std::string file :
       {"design.json", "evaluation.json", "dataset.json", "policy_selection.json", "clone/clone.json",
        "motion/replay.json", "motion/motion.json", "agents/1/agent.json"}) {
    // Of its own for each: the bytes in one place are not to meet those in another.
    const std::string dir = "run-" + fs::path(file).stem().string();
    fs::copy(folder / "run", folder / dir, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
    family.seeds.push_back(ReadFile(folder / "run" / file));
    family.readers.push_back({dir + "/" + file, [dir](const fs::path& f) { GatherReport(f / dir); }});
  }
  return family;
}

/// A plan's head with the hash of what follows it.
std::string MutatePlan(const std::string& bytes, uint64_t random, const Mutator& mutate) {
  const size_t end = bytes.find('\n');
  if (end == std::string::npos) throw DataError("no plan");
  const bool in_head = random % 4 == 0;
  std::string head = bytes.substr(0, end), body = bytes.substr(end + 1);
  (in_head ? head : body) = mutate(in_head ? head : body);
  json record = json::parse(head, nullptr, false);
  if (!record.is_object()) return head + "\n" + body;
  record["sha256"] = Sha256(body);
  return record.dump(-1, ' ', false, json::error_handler_t::replace) + "\n" + body;
}

FuzzFamily PlanFamily() {
  Plan plan;
  plan.kind = PlanKind::kStudy;
  plan.command = {"reproduce", "table1"};
  PlanLine line;
  line.key = UnitKey("a unit");
  line.name = "hopper-1";
  line.words = {"run", "--seed", "1"};
  line.inputs = {{"/data/demos.hdf5", std::string(64, 'a')}};
  line.labels = {{"seed", "1"}};
  plan.lines = {line};
  FuzzFamily family{.name = "plan", .mutate_inside = MutatePlan};
  family.seeds = {plan.ToText(), UnitRecord{.key = line.key, .name = line.name}.ToJson().dump(2)};
  family.readers = {{"plan.jsonl",
                     [](const fs::path& f) {
                       const Plan read = Plan::Read(f / "plan.jsonl");
                       if (!read.lines.empty()) read.MostNeeds();
                     }},
                    {"done.json", [](const fs::path& f) {
                       UnitRecord::FromJson(ReadJson(f / "done.json"), (f / "done.json").string());
                     }}};
  return family;
}

}  // namespace

void AddRecordFamilies(const fs::path& folder, std::vector<FuzzFamily>& families) {
  families.push_back(RecordFamily());
  families.push_back(ReportFamily(folder));
  families.push_back(PlanFamily());
}

}  // namespace oted
