#pragma once
/// The whole method of "Targeted Environment Design from Offline Data", as five calls in the paper's order.
///
///   Pipeline pipeline(config, "runs/hopper", context);
///   pipeline.CloneBehavior();      // stage 1, Sec. 4 step 1:  mu-hat from D
///   pipeline.Design();             // stage 2, Sec. 4.1:       q(z | h_i) for every setting h and seed i
///   pipeline.SelectSimulator();    // stage 3, Sec. 4.2:       the best h
///   pipeline.ReplayLogs();         //                          for the report: logs beside their replay at q's mode
///   pipeline.TrainAgents();        // stage 4, Algorithm 2:    pi_j in the modes z_i of q(. | h_i)
///   pipeline.SelectPolicy();       // stage 5, Sec. 4.2:       the best pi_j
///   pipeline.EvaluateInTarget();   // only where a study knows the truth
///
/// Each call reads what earlier ones left in the run directory, skips what is complete there, and goes on from where it
/// was stopped. The truth is read by the last call alone.

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"
#include "oted/data/dataset.h"
#include "oted/nn/policy.h"
#include "oted/run/run_directory.h"
#include "oted/run/training_ground.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

class Pipeline {
 public:
  /// Reads and checks data, model and parameters; nothing is written before all of that is right.
  /// @throws UsageError, DataError
  Pipeline(RunConfig config, const std::filesystem::path& out, RunContext context);
  ~Pipeline();

  void CloneBehavior();
  void Design();
  void SelectSimulator();
  void ReplayLogs();
  void TrainAgents();
  void SelectPolicy();
  void EvaluateInTarget();
  /// All of the above; up to ReplayLogs for a task without a reward, with a warning.
  void Run();

  const RunConfig& config() const { return config_; }
  const RunDirectory& directory() const { return directory_; }
  const Dataset& dataset() const { return dataset_; }

 private:
  struct AgentJob;
  /// The designs of one setting.
  struct SettingDesigns {
    DesignConfig config;
    std::string drawn_as;  ///< the setting that names their random streams
  };
  /// Everything that can be wrong with the request; nothing has been written yet. @return `out`
  const std::filesystem::path& CheckRequest(const std::filesystem::path& out);
  /// Settles the method of every setting, and its settings, for this simulator.
  void AdaptDesign();
  /// Results and checkpoints that lie in the directory are of this configuration. @throws UsageError
  void CheckDirectory() const;
  /// @throws UsageError when report.motion asks for pictures and none can be drawn
  void CheckCanDraw() const;
  void WriteProvenance() const;
  /// The model file, its task file and the compiled model, into model/.
  void KeepModel() const;
  /// What task and model are, for fingerprints.
  nlohmann::json TaskIdentity() const;
  const std::vector<bool>& ParametersWithEffect();
  /// The designs of all seeds of these settings, as far as they are not complete.
  void DesignAll(const std::map<std::string, SettingDesigns>& settings);
  /// What the designs of a setting left, to be scored.
  void AddCandidates(const std::string& setting, const DesignConfig& design, std::vector<Candidate>* candidates) const;
  /// Of every setting whose method was left to auto, the method and why (oted/stages/design/method_choice.h).
  std::vector<MethodChoice> ChooseMethods(const std::vector<Candidate>& candidates,
                                          const SelectionResult& result) const;
  /// By designs from part of the logs, judged on the rest. @param first  the best design by the first method
  MethodChoice ChooseByTrial(const std::string& setting, const Candidate& first) const;
  /// Designs by the methods that took the place of first ones. @return whether there were any
  bool DesignInChosenMethods(const std::vector<MethodChoice>& choices, std::vector<Candidate>* candidates);
  std::string CloneFingerprint() const;
  std::string DesignFingerprint(const std::string& setting) const;
  std::string TrialFingerprint(const std::string& setting, const DesignConfig& design) const;
  std::string MethodChoiceFingerprint(const std::string& setting) const;
  std::string SelectionFingerprint() const;
  /// Of an agent that trains in `where`: "designed", "undesigned", or a baseline's name.
  std::string AgentFingerprint(const std::string& where) const;
  /// The folder of agent `index` that trains there.
  std::filesystem::path AgentFolder(const std::string& where, int index) const;
  /// Where agents train, designed ones first.
  std::vector<std::string> AgentGrounds() const;
  /// Of the m agents that train in `where`, the index of the one that does best there.
  int BestAgent(const std::string& where) const;
  /// The clone of the logs and of data collected under domain randomisation.
  void CloneUnderRandomization();
  std::string BcDrFingerprint() const;
  std::string PolicySelectionFingerprint() const;
  std::string EvaluationFingerprint() const;
  std::vector<std::vector<double>> MixtureModes() const;
  DesignedSimulators Designed() const;
  /// How clones and agents act where they are judged.
  ActionNoise JudgedNoise() const;
  /// policy.onnx of the agent in `folder`, from its policy.npz, at `path`.
  void ExportAgent(const std::filesystem::path& folder, const std::string& fingerprint,
                   const std::filesystem::path& path) const;
  bool ComparesUndesigned() const { return config_.agents.undesigned && !config_.truth.empty(); }

  RunConfig config_;
  RunContext context_;
  Dataset dataset_;
  std::unique_ptr<SimulatorFactory> factory_;
  std::string model_sha256_;
  std::vector<bool> has_effect_;  // empty until measured
  // By the name of the setting that they would be: methods that may take the place of one that was left to auto.
  std::map<std::string, DesignConfig> designs_;  ///< of every setting, as this simulator has them
  std::map<std::string, SettingDesigns> other_methods_;
  RunDirectory directory_;
};

}  // namespace oted
