#pragma once
/// The whole method of "Targeted Environment Design from Offline Data", as five calls in the paper's order.
///
///   Pipeline pipeline(config, "runs/hopper", context);
///   pipeline.CloneBehavior();      // stage 1, Sec. 4 step 1:  mu-hat from D
///   pipeline.Design();             // stage 2, Sec. 4.1:       q(z | h_i) for every setting h and seed i
///   pipeline.SelectSimulator();    // stage 3, Sec. 4.2:       the best h
///   pipeline.TrainAgents();        // stage 4, Algorithm 2:    pi_j in the modes z_i of q(. | h_i)
///   pipeline.SelectPolicy();       // stage 5, Sec. 4.2:       the best pi_j
///   pipeline.EvaluateInTarget();   // only where a study knows the truth
///
/// Each call reads what earlier ones left in the run directory, skips what is complete there, and goes on from where it
/// was stopped. The truth is read by the last call alone.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/run_config.h"
#include "oted/run_directory.h"
#include "oted/sim/simulator.h"

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
  void TrainAgents();
  void SelectPolicy();
  void EvaluateInTarget();
  /// All of the above.
  void Run();

  const RunConfig& config() const { return config_; }
  const RunDirectory& directory() const { return directory_; }
  const Dataset& dataset() const { return dataset_; }

 private:
  struct AgentJob;
  /// Everything that can be wrong with the request; nothing has been written yet. @return `out`
  const std::filesystem::path& CheckRequest(const std::filesystem::path& out);
  /// Results and checkpoints that lie in the directory are of this configuration. @throws UsageError
  void CheckDirectory() const;
  void WriteProvenance() const;
  const std::vector<bool>& ParametersWithEffect();
  std::string CloneFingerprint() const;
  std::string DesignFingerprint(const std::string& setting) const;
  std::string SelectionFingerprint() const;
  std::string AgentFingerprint(bool designed) const;
  std::string PolicySelectionFingerprint() const;
  std::string EvaluationFingerprint() const;
  std::vector<std::vector<double>> MixtureModes() const;
  bool ComparesUndesigned() const { return config_.agents.undesigned && !config_.truth.empty(); }

  RunConfig config_;
  RunContext context_;
  std::unique_ptr<SimulatorFactory> factory_;
  std::string model_sha256_;
  Dataset dataset_;
  std::vector<bool> has_effect_;  // empty until measured
  RunDirectory directory_;
};

/// The simulator that a task's name stands for. @throws UsageError, DataError
std::unique_ptr<SimulatorFactory> MakeSimulatorFactory(const std::string& task,
                                                       const std::vector<ParameterSpec>& parameters);

/// How the logs of a task are read: what the configuration says, and the task's control period, time limit and names.
DataOptions DataOptionsFor(const DataConfig& config, const SimulatorSpec& spec);

}  // namespace oted
