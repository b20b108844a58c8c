#include "oted/run/agents_step.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace oted::agents_step_test {

TEST(Agents, OneThatBreaksTheSimulatorInEveryEpisodeIsNeverTheBest) {
  Agents agents;
  const auto add = [&](int agent, double eval_return, bool always_diverged) {
    TrainedRecord trained;
    trained.record.agent = agent;
    trained.record.eval_return = eval_return;
    trained.record.always_diverged = always_diverged;
    agents.of[Ground::kNominal].push_back(std::move(trained));
  };
  add(1, 0, true);
  EXPECT_EQ(agents.Best(Ground::kNominal).record.agent, 1) << "there is no other";
  add(2, -7, false);
  add(3, -5, false);
  add(4, 0, true);
  EXPECT_EQ(agents.Best(Ground::kNominal).record.agent, 3);
}

TEST(Agents, TheirRecordSaysWhereEveryEpisodeDiverged) {
  AgentRecord agent;
  EXPECT_FALSE(AgentRecord::FromJson(agent.ToJson(), "agent.json").always_diverged);
  agent.always_diverged = true;
  EXPECT_TRUE(AgentRecord::FromJson(agent.ToJson(), "agent.json").always_diverged);
}

}  // namespace oted::agents_step_test
