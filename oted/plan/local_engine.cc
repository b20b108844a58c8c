#include "oted/plan/local_engine.h"

#include <chrono>
#include <csignal>
#include <list>
#include <thread>

#include "oted/base/error.h"
#include "oted/plan/child_program.h"

namespace oted {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kPause{50};
/// A unit answers a signal within two seconds, and so does its command.
constexpr std::chrono::seconds kPatience{6};

void StopAll(std::list<ChildProgram>& running) {
  for (ChildProgram& child : running) child.Signal(SIGTERM);
  const Clock::time_point end = Clock::now() + kPatience;
  while (!running.empty() && Clock::now() < end) {
    running.remove_if([](ChildProgram& child) { return child.Poll().has_value(); });
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

void RunHere(const std::vector<int>& indices, const LocalEngine& engine, const RunContext& context) {
  std::list<ChildProgram> running;
  size_t next = 0;
  Clock::time_point looked = Clock::now();
  while (next < indices.size() || !running.empty()) {
    if (context.StopRequested()) {
      StopAll(running);
      context.ThrowIfStopped();
    }
    running.remove_if([](ChildProgram& child) { return child.Poll().has_value(); });
    while (next < indices.size() && static_cast<int>(running.size()) < engine.at_once) {
      const int index = indices[next++];
      running.emplace_back(engine.words(index), engine.log(index));
    }
    if (engine.look && Clock::now() - looked > std::chrono::seconds(1)) {
      engine.look();
      looked = Clock::now();
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace oted
