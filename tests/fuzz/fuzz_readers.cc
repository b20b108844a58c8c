// Feeds damaged files to every reader for a while (`make fuzz`).
//
//   fuzz_readers --minutes M --seed S --out FOLDER [--summary FILE] [--format NAME] [--replay INDEX]
//
// Mutants are numbered and depend on the seed and their number alone. They are read in a worker process: one that
// crashes or hangs is a failure, its file is kept in FOLDER/failures, and the next worker goes on behind it. Exit
// status 1 when anything failed. --replay reads one mutant in this process, for a debugger.

#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "tests/fuzz/fuzzing.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr size_t kMaxFormats = 64;
constexpr int kHangSeconds = 60;
constexpr int kMaxKept = 50;

/// What the worker tells its supervisor.
struct Shared {
  uint64_t index;  ///< of the mutant at hand
  uint64_t counts[kMaxFormats][4];
  double slowest_s[kMaxFormats];
  uint64_t n_kept_children;
};

struct Arguments {
  double minutes = 1;
  uint64_t seed = 1;
  std::string out = "build/fuzz";
  std::string summary;
  std::string format;
  int64_t replay = -1;
};

Arguments Parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--minutes") a.minutes = std::atof(value.c_str());
    if (name == "--seed") a.seed = std::strtoull(value.c_str(), nullptr, 10);
    if (name == "--out") a.out = value;
    if (name == "--summary") a.summary = value;
    if (name == "--format") a.format = value;
    if (name == "--replay") a.replay = std::atoll(value.c_str());
  }
  return a;
}

class Fuzzer {
 public:
  explicit Fuzzer(const Arguments& arguments)
      : arguments_(arguments), work_(fs::path(arguments.out) / "work"), formats_(FuzzFormats(work_)) {
    if (!arguments_.format.empty()) {
      std::erase_if(formats_, [&](const FuzzFormat& f) { return f.name != arguments_.format; });
    }
    fs::create_directories(fs::path(arguments_.out) / "failures");
    void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED || formats_.empty() || formats_.size() > kMaxFormats) std::exit(2);
    shared_ = new (memory) Shared{};
  }

  int Replay(uint64_t index) {
    const FuzzResult result = ReadMutant(FormatOf(index), work_, MutantOf(index));
    fmt::print("mutant {} of {}: outcome {} {}\n", index, FormatOf(index).name, static_cast<int>(result.outcome),
               result.message);
    return result.outcome == FuzzOutcome::kFailed;
  }

  int Run() {
    started_ = Clock::now();
    deadline_ =
        started_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(arguments_.minutes * 60));
    int64_t said = -1;
    while (Clock::now() < deadline_) {
      const pid_t worker = ::fork();
      if (worker < 0) return 2;
      if (worker == 0) {
        Work();
        ::_exit(0);
      }
      uint64_t index = shared_->index;
      Clock::time_point since = Clock::now();
      int status = 0;
      while (::waitpid(worker, &status, WNOHANG) == 0) {
        ::usleep(100000);
        if (shared_->index != index) {
          index = shared_->index;
          since = Clock::now();
        } else if (Clock::now() - since > std::chrono::seconds(kHangSeconds)) {
          ::kill(worker, SIGKILL);
        }
        const int64_t minute = std::chrono::duration_cast<std::chrono::minutes>(Clock::now() - started_).count();
        if (minute != said) fmt::print("minute {}: {} mutants, {} failures\n", said = minute, index, failures_.size());
        std::fflush(stdout);
      }
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;
      // The worker died of this mutant: keep it, go on behind it.
      const std::string how = WIFSIGNALED(status) ? fmt::format("worker killed by signal {} (9: hung for {} s)",
                                                                WTERMSIG(status), kHangSeconds)
                                                  : fmt::format("worker ended with status {}", WEXITSTATUS(status));
      ++shared_->counts[shared_->index % formats_.size()][static_cast<size_t>(FuzzOutcome::kFailed)];
      Keep("failures", shared_->index, how);
      ++shared_->index;
      if (failures_.size() >= kMaxKept) break;
    }
    CollectFailures();
    WriteSummary();
    fmt::print("{} mutants, {} failures in {}\n", shared_->index, failures_.size(), arguments_.out);
    return failures_.empty() ? 0 : 1;
  }

 private:
  const FuzzFormat& FormatOf(uint64_t index) const { return formats_[index % formats_.size()]; }

  std::string MutantOf(uint64_t index) const {
    return MakeMutant(FormatOf(index), RngKey(arguments_.seed).Stage("fuzz").Index(index));
  }

  void Work() {
    while (Clock::now() < deadline_) {
      const uint64_t index = shared_->index;
      const Clock::time_point begin = Clock::now();
      const FuzzResult result = ReadMutant(FormatOf(index), work_, MutantOf(index));
      const size_t at = index % formats_.size();
      shared_->slowest_s[at] =
          std::max(shared_->slowest_s[at], std::chrono::duration<double>(Clock::now() - begin).count());
      ++shared_->counts[at][static_cast<size_t>(result.outcome)];
      if (result.outcome == FuzzOutcome::kFailed) Keep("failures", index, result.message);
      if (result.outcome == FuzzOutcome::kChildDied && shared_->n_kept_children < kMaxKept) {
        ++shared_->n_kept_children;
        Keep("children", index, result.message);
      }
      ++shared_->index;
    }
  }

  /// The mutant, what became of it, and how to meet it again.
  void Keep(const std::string& folder, uint64_t index, const std::string& message) {
    const fs::path base = fs::path(arguments_.out) / folder / fmt::format("seed{}-{}", arguments_.seed, index);
    std::string file = FormatOf(index).file;
    std::replace(file.begin(), file.end(), '/', '_');
    WriteFileAtomically(base.string() + "-" + file, MutantOf(index));
    WriteFileAtomically(
        base.string() + ".txt",
        fmt::format("{}\nfuzz_readers --seed {} --replay {}{}\n{}\n", FormatOf(index).name, arguments_.seed, index,
                    arguments_.format.empty() ? "" : fmt::format(" --format '{}'", arguments_.format), message));
    if (folder == "failures") failures_[index] = message;
  }

  /// Those that a worker kept are on disk only.
  void CollectFailures() {
    const std::string prefix = fmt::format("seed{}-", arguments_.seed);
    for (const auto& entry : fs::directory_iterator(fs::path(arguments_.out) / "failures")) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with(prefix) || entry.path().extension() != ".txt") continue;
      const uint64_t index = std::strtoull(name.c_str() + prefix.size(), nullptr, 10);
      failures_.emplace(index, ReadFile(entry.path()));
    }
  }

  void WriteSummary() const {
    if (arguments_.summary.empty()) return;
    nlohmann::json formats = nlohmann::json::object();
    uint64_t totals[4] = {};
    for (size_t f = 0; f < formats_.size(); ++f) {
      const auto& counts = shared_->counts[f];
      for (size_t k = 0; k < 4; ++k) totals[k] += counts[k];
      formats[formats_[f].name] = {{"read", counts[0]},
                                   {"refused", counts[1]},
                                   {"child_died", counts[2]},
                                   {"failed", counts[3]},
                                   {"slowest_s", shared_->slowest_s[f]}};
    }
#if defined(__SANITIZE_ADDRESS__)
    const char* sanitizers = "address,undefined";
#else
    const char* sanitizers = "none";
#endif
    WriteJson(arguments_.summary, {{"schema", "oted.fuzz/1"},
                                   {"oted", OTED_VERSION},
                                   {"seed", arguments_.seed},
                                   {"minutes", std::chrono::duration<double>(Clock::now() - started_).count() / 60},
                                   {"sanitizers", sanitizers},
                                   {"mutants", shared_->index},
                                   {"read", totals[0]},
                                   {"refused", totals[1]},
                                   {"child_died", totals[2]},
                                   {"failed", totals[3]},
                                   {"formats", formats}});
  }

  Arguments arguments_;
  fs::path work_;
  std::vector<FuzzFormat> formats_;
  Shared* shared_ = nullptr;
  Clock::time_point started_;
  Clock::time_point deadline_;
  std::map<uint64_t, std::string> failures_;
};

}  // namespace
}  // namespace oted

int main(int argc, char** argv) {
  const oted::Arguments arguments = oted::Parse(argc, argv);
  std::filesystem::remove_all(std::filesystem::path(arguments.out) / "failures");
  oted::Fuzzer fuzzer(arguments);
  return arguments.replay >= 0 ? fuzzer.Replay(static_cast<uint64_t>(arguments.replay)) : fuzzer.Run();
}
