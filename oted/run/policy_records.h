#pragma once
/// What a run says of its policies: how agents and baselines learned, which agent was selected, and how all of them do
/// in the target.

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "oted/config/agents_config.h"
#include "oted/run/training_ground.h"

namespace oted {

/// agent.json
struct AgentRecord {
  static constexpr const char* kSchema = "oted.agent/1";
  int agent = 1;  ///< from 1
  Ground ground = Ground::kDesigned;
  AgentAlgorithm algorithm = AgentAlgorithm::kSac;
  TrainIn train_in = TrainIn::kModes;  ///< of designed ones
  int64_t seed = 0;
  int64_t n_steps = 0;
  double eval_return = 0;                                ///< where it trained
  bool always_diverged = false;                          ///< in the episodes of that return
  std::vector<std::pair<std::string, double>> episodes;  ///< what its episodes ended with, by name

  nlohmann::json ToJson() const;
  static AgentRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// offline.json: a baseline that learned from the logs alone.
struct OfflineRecord {
  static constexpr const char* kSchema = "oted.offline/1";
  std::string baseline;  ///< its name in settings
  int64_t seed = 0, n_steps = 0;
  int n_transitions = 0;
  std::vector<std::pair<std::string, double>> losses;  ///< of the last step, by name

  nlohmann::json ToJson() const;
  static OfflineRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// policy_selection.json
struct PolicySelectionRecord {
  static constexpr const char* kSchema = "oted.policy_selection/1";
  struct Simulator {
    int seed = 0;
    std::vector<double> mode;
  };
  struct Agent {
    int agent = 1;                ///< from 1
    std::vector<double> returns;  ///< per simulator
    double mean_return = 0;
    int n_diverged = 0;
  };
  int selected = 1;  ///< agent, from 1
  std::vector<Simulator> simulators;
  std::vector<Agent> agents;

  nlohmann::json ToJson() const;
  static PolicySelectionRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// evaluation.json: every policy in the target.
struct EvaluationRecord {
  static constexpr const char* kSchema = "oted.evaluation/1";
  struct Parameter {
    std::string name, unit;
    double nominal = 0, truth = 0, mode = 0, std = 0, absolute_error = 0;
  };
  struct PolicyResult {
    std::string name, label;
    double mean_return = 0, std_return = 0;
    int n_diverged = 0;
    std::optional<double> score;
  };
  std::string task;
  int episodes = 0;
  std::vector<Parameter> parameters;
  std::vector<PolicyResult> policies;

  nlohmann::json ToJson() const;
  static EvaluationRecord FromJson(const nlohmann::json& record, const std::string& where);
};

}  // namespace oted
