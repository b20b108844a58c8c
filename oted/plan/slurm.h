#pragma once
/// A plan's units as array jobs of Slurm.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/plan/plan.h"

namespace oted {

struct SlurmRequest {
  std::filesystem::path plan, root;  ///< absolute
  std::vector<int> indices;
  UnitNeeds needs;
  int at_once = 0;                     ///< units at a time; 0: as many as the cluster gives
  std::vector<std::string> more;       ///< options for sbatch, as "--partition=long"
  std::vector<std::string> follow_up;  ///< the command that runs once all units have ended
};

struct SlurmJobs {
  std::vector<std::string> arrays;
  std::string follow_up;
};

/// Hands the units to sbatch, in arrays that the cluster takes (MaxArraySize), one behind the other; then the command
/// that follows. Keeps the numbers in ROOT/slurm/jobs.json. Units get SIGTERM two minutes before their time is over.
/// @throws DataError where Slurm is not there or refuses
SlurmJobs SubmitToSlurm(const SlurmRequest& request);

/// Those of the last submission that wait or run, but for the job that asks.
std::vector<std::string> JobsInQueue(const std::filesystem::path& root);

/// The script of an array's task; its first argument is added to the index.
std::string SlurmUnitScript(const SlurmRequest& request);

}  // namespace oted
