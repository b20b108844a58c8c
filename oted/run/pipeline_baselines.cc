// What the paper compares with: the part that is no agent, and which agent of a ground counts.

#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/baselines/bc_dr.h"
#include "oted/run/pipeline.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

int Pipeline::BestAgent(const std::string& where) const {
  int best = 1;
  const auto own_return = [&](int j) {
    return ReadJson(AgentFolder(where, j) / "agent.json").at("eval_return").get<double>();
  };
  for (int j = 2; j <= config_.agents.n_agents; ++j) best = own_return(j) > own_return(best) ? j : best;
  return best;
}

void Pipeline::CloneUnderRandomization() {
  const fs::path folder = directory_.baseline("bc_dr");
  const std::string fingerprint = BcDrFingerprint();
  if (directory_.IsComplete(folder / "clone.json", fingerprint)) return;
  const bool by_agent = config_.baselines.bc_dr.collector == "dr";
  const auto collector =
      LoadPolicy((by_agent ? AgentFolder("dr", BestAgent("dr")) : directory_.clone()) / "policy.npz");
  const CloneResult clone = CloneWithSimulated(dataset_, *factory_, *collector, config_.baselines.bc_dr.ratio,
                                               config_.clone, BcDrKey(config_), directory_.NameOf(folder), context_);
  clone.policy->Save(folder / "policy.npz");
  ExportAgent(folder, fingerprint, folder / "policy.onnx");
  directory_.Complete(folder / "clone.json",
                      {{"schema", "oted.clone/1"},
                       {"train_loss", clone.train_loss},
                       {"held_out_loss", clone.held_out_loss},
                       {"n_steps", clone.n_steps}},
                      fingerprint);
}

std::string Pipeline::BcDrFingerprint() const {
  const BcDrConfig& settings = config_.baselines.bc_dr;
  json inputs = {"bc_dr", CloneFingerprint(), settings.collector, settings.ratio};
  if (settings.collector == "dr") {
    inputs.push_back({AgentFingerprint("dr"), config_.agents.n_agents});
  } else {
    inputs.push_back(ComparedIdentity("dr", config_, factory_->parameters()));
  }
  return Fingerprint(inputs);
}

}  // namespace oted
