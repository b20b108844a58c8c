#pragma once
/// Learning a policy from the logs alone, whatever the method: steps, curves, checkpoints. No simulator is asked; what
/// is learned last is kept.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/data/npz.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What is learned from, and where it goes. What it refers to must outlive it.
struct OfflineJob {
  const Dataset& dataset;
  const SimulatorSpec& spec;
  RngKey key;
  std::filesystem::path folder;  ///< checkpoint.npz while it learns
  std::string run_name;          ///< its curves' in the log
  RunContext context;
};

/// A method at work. All that it holds between two steps goes through Save and Restore.
class OfflineLearner {
 public:
  virtual ~OfflineLearner() = default;
  virtual int64_t n_steps() const = 0;  ///< that were made; a phase that ends early counts as done
  virtual int64_t total() const = 0;
  virtual void Step() = 0;
  /// Names and values for the log, of the last step.
  virtual std::vector<std::pair<std::string, double>> Losses() const = 0;
  virtual std::unique_ptr<Policy> MakePolicy() const = 0;
  virtual void Save(NpzArrays& arrays) = 0;
  /// @throws std::exception of any kind where the arrays are not those of Save
  virtual void Restore(const NpzArrays& arrays) = 0;
};

struct OfflineResult {
  std::unique_ptr<const Policy> policy;
  std::vector<std::pair<std::string, double>> losses;  ///< of the last step
};

/// Runs a learner to its end, from its checkpoint where there is one: a stopped run that goes on gives the same bytes
/// as one that was not stopped.
/// @throws Interrupted, its state on disk, when a stop was requested; DataError for a checkpoint that does not fit, or
/// when a loss is no longer finite
OfflineResult LearnOffline(OfflineLearner& learner, const OfflineJob& job);

}  // namespace oted
