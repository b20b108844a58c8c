#pragma once
/// MuJoCo's errors and warnings, which by default end the process and fill MUJOCO_LOG.TXT in the working directory.

#include <string>
#include <vector>

namespace oted {

/// From now on an error of MuJoCo is a DataError, thrown where it was called, and a warning is dropped: nothing is
/// printed, no file is written. Handlers that the caller has installed are kept. Errors within a batch's threads do not
/// come here: MuJoCo reports them for each lane (mjb_status). To be called before anything else of MuJoCo.
void TakeOverMujocoErrors();

/// The warnings of this thread's calls, from here to the end of its life. None where the caller has a handler of its
/// own.
class MujocoWarnings {
 public:
  MujocoWarnings();
  ~MujocoWarnings();
  MujocoWarnings(const MujocoWarnings&) = delete;
  MujocoWarnings& operator=(const MujocoWarnings&) = delete;

  const std::vector<std::string>& told() const { return told_; }

 private:
  std::vector<std::string> told_;
};

}  // namespace oted
