#pragma once
/// MuJoCo's errors and warnings, which by default end the process and fill MUJOCO_LOG.TXT in the working directory.

namespace oted {

/// From now on an error of MuJoCo is a DataError, thrown where it was called, and a warning is dropped: nothing is
/// printed, no file is written. Handlers that the caller has installed are kept. Errors within a batch's threads do not
/// come here: MuJoCo reports them for each lane (mjb_status). To be called before anything else of MuJoCo.
void TakeOverMujocoErrors();

}  // namespace oted
