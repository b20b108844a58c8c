#pragma once
/// Which suspects the logs ask for: a score test of all, then a fit with each that it favours. Not in the paper.

#include <map>
#include <string>
#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/trajectories/suspect_fits.h"
#include "oted/stages/design/trajectories/trial_keeper.h"

namespace oted {

class SuspectScreening {
 public:
  explicit SuspectScreening(const SuspectFits& fits) : fits_(fits) {}

  /// The likeliest first. Where long windows took the place of short ones, those tell of little but noise.
  /// @param thoroughly  as TrySuspects has it
  ScreenedSuspects Find(bool thoroughly);

 private:
  struct Windows;
  struct Scored;
  class Fit;
  std::vector<Suspect> FindAll(bool thoroughly);
  std::vector<Suspect> FindBy(const Windows& by, const std::vector<Suspect>& outstanding = {});
  Windows ShortWindows() const;
  Windows GrownWindows() const;
  Windows LongWindows() const;
  Scored Score(const Fit& fit);
  /// Those that the windows ask for at a distance (IsDistant).
  std::vector<Suspect> FindDistantSuspects(const Fit& fit);
  /// Windows are being fitted, or all suspects scored in them.
  void Tell(const char* what);
  bool IsOfReadingsLeftOut(const ParameterSpec& spec, const ReadingModel& readings) const;

  const SuspectFits& fits_;
  std::map<std::string, Eigen::VectorXd> fitted_;
  int n_told_ = 0, n_to_tell_ = 0;
};

}  // namespace oted
