#pragma once
/// Ctrl-C, SIGTERM, a terminal that goes away and a limit of processor time.

#include <atomic>
#include <string>

namespace oted::cli {

/// Set by Ctrl-C; a second one ends the program at once, unless it comes with the first: `timeout` and a terminal send
/// both to the program and to its group.
extern std::atomic<bool> g_stop;
void InstallStopHandler();
/// For a command that waits for child programs: they have a grace of their own, so this program ends by itself.
void WaitForChildrenOnStop();

/// What goes to stdout, while it exists, where work does not come to an end in time after a signal.
class LastWords {
 public:
  explicit LastWords(std::string words);
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;
  ~LastWords();

 private:
  std::string words_;
};

}  // namespace oted::cli
