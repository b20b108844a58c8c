#pragma once
/// The shortest windows of trajectory matching, and how well parameters explain them before anything is fitted.

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/stages/design/replay/windows.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// Stretches of the log of `length` rows in a random order, until they hold `n_rows`; cut into windows of `n_steps`.
Level FirstLevel(WindowReplayer& replayer, const Dataset& dataset, int length, int n_steps, int n_rows, Rng& rng);

/// Windows cut into whole pieces of `n_steps`, each of its window's stretch and from where its readings say; without
/// those that cannot start. @param longer  its starts do not matter
Level Cut(WindowReplayer& replayer, const Level& longer, int n_steps);

/// The first `n` windows of a level.
Level Leading(const Level& level, size_t n);

/// The fit of windows that grew: those of `level`, then windows of twice the length from the starts that these found,
/// and so on up to `n_steps`, as long as `n_fewest` are left. Noisy readings are no starts of long windows.
/// @param make     a fit of windows, from x
/// @param descend  told whether it is the first
/// @return null where `level` has too few windows
std::unique_ptr<LevelFit> FitGrowing(Level level, Eigen::VectorXd x, int n_steps, size_t n_fewest,
                                     const std::function<std::unique_ptr<LevelFit>(Level, Eigen::VectorXd)>& make,
                                     const std::function<void(LevelFit&, bool)>& descend);

/// How well z explains replays from the guessed states: the log of each channel's error, the worst fifth of the windows
/// left out.
double CoarseCost(WindowReplayer& replayer, const Level& level, const Eigen::VectorXd& scale,
                  const std::vector<double>& z);

}  // namespace oted
