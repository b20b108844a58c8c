#include "oted/plan/slurm.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/plan/child_program.h"
#include "oted/plan/indices.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

fs::path JobsFile(const fs::path& root) { return root / "slurm" / "jobs.json"; }

/// How many indices an array may have.
int ArrayLimit() {
  std::istringstream lines(OutputOf({"scontrol", "show", "config"}));
  for (std::string line; std::getline(lines, line);) {
    const size_t equals = line.find('=');
    if (line.starts_with("MaxArraySize") && equals != std::string::npos) {
      return std::max(1, std::atoi(line.c_str() + equals + 1));
    }
  }
  throw DataError("'scontrol show config' names no MaxArraySize; submit on a machine of the cluster");
}

/// The number of a job, from what `sbatch --parsable` prints: "NUMBER" or "NUMBER;CLUSTER".
std::string Submit(const std::vector<std::string>& words) {
  const std::string said = OutputOf(words);
  const std::string number = said.substr(0, said.find_first_of(";\n"));
  if (number.empty() || number.find_first_not_of("0123456789") != std::string::npos) {
    throw DataError(fmt::format("sbatch printed '{}', wanted a job's number", said));
  }
  return number;
}

std::vector<std::string> CommonWords(const SlurmRequest& request, const std::string& log) {
  return {"sbatch",
          "--parsable",
          "--job-name=oted-" + request.plan.stem().string(),
          "--requeue",
          "--open-mode=append",
          fmt::format("--mem={}M", request.needs.memory_mib),
          fmt::format("--output={}", (request.root / "logs" / log).string())};
}

}  // namespace

std::string SlurmUnitScript(const SlurmRequest& request) {
  return fmt::format(
      "#!/bin/bash\n# One unit of an array: the shell becomes the program, which so gets the warning before the end.\n"
      "exec {} --index $((SLURM_ARRAY_TASK_ID + $1))\n",
      ShellLine({ThisProgram().string(), "unit", request.plan.string(), "--out", request.root.string()}));
}

SlurmJobs SubmitToSlurm(const SlurmRequest& request) {
  const fs::path unit_script = request.root / "slurm" / "unit.sh", after_script = request.root / "slurm" / "after.sh";
  MakeFolders(request.root / "logs");
  WriteFileAtomically(unit_script, SlurmUnitScript(request));
  WriteFileAtomically(after_script, fmt::format("#!/bin/bash\nexec {}\n", ShellLine(request.follow_up)));
  SlurmJobs jobs;
  const auto keep = [&] {
    WriteJson(JobsFile(request.root), {{"arrays", jobs.arrays}, {"follow_up", jobs.follow_up}});
  };
  for (const IndexChunk& chunk : ChunksOf(request.indices, ArrayLimit())) {
    std::vector<std::string> words = CommonWords(request, "%A_%a.log");
    words.insert(words.end(), {fmt::format("--array={}{}", IndexRanges(chunk.indices),
                                           request.at_once > 0 ? fmt::format("%{}", request.at_once) : ""),
                               fmt::format("--cpus-per-task={}", request.needs.threads),
                               fmt::format("--time={}", request.needs.minutes), "--signal=B:TERM@120"});
    if (!jobs.arrays.empty()) words.push_back("--dependency=afterany:" + jobs.arrays.back());
    words.insert(words.end(), request.more.begin(), request.more.end());
    words.insert(words.end(), {unit_script.string(), std::to_string(chunk.offset)});
    jobs.arrays.push_back(Submit(words));
    keep();
  }
  std::vector<std::string> words = CommonWords(request, "after_%j.log");
  words.insert(words.end(), {"--time=60", "--kill-on-invalid-dep=yes",
                             fmt::format("--dependency=afterany:{}", fmt::join(jobs.arrays, ":"))});
  words.insert(words.end(), request.more.begin(), request.more.end());
  words.push_back(after_script.string());
  jobs.follow_up = Submit(words);
  keep();
  return jobs;
}

std::vector<std::string> JobsInQueue(const fs::path& root) {
  std::vector<std::string> queued;
  if (!fs::exists(JobsFile(root))) return queued;
  const json record = ReadJson(JobsFile(root));
  std::vector<std::string> ours;
  try {
    ours = record.at("arrays").get<std::vector<std::string>>();
    ours.push_back(record.at("follow_up"));
  } catch (const json::exception& e) {
    throw DataError(fmt::format("'{}' cannot be read ({}); remove it when no job of the plan is queued",
                                JobsFile(root).string(), e.what()));
  }
  const char* const asking = std::getenv("SLURM_JOB_ID");
  std::istringstream lines(OutputOf({"squeue", "--me", "--noheader", "--format=%F"}));
  for (std::string job; lines >> job;) {
    if (asking != nullptr && job == asking) continue;
    if (std::ranges::find(ours, job) != ours.end() && std::ranges::find(queued, job) == queued.end()) {
      queued.push_back(job);
    }
  }
  return queued;
}

}  // namespace oted
