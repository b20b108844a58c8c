#pragma once
/// When a window has to be linearized again: a replay costs one lane, its derivatives one more for every coordinate.

#include <Eigen/Dense>

#include "oted/stages/design/replay/windows.h"

namespace oted {

/// Whether a window's derivatives foretold what its replay has become, but for a fifth of how far it moved, or for less
/// than a start can be known: then the next step may take the same ones.
/// @param before         the residual that they went out from, and they
/// @param d_start, d_x   how far the start and x have moved since; d_start empty where starts are held, d_x where x is
/// @param after          the residual now; empty where the replay broke down
/// @param precision      of every number of a residual
bool ForetoldBy(const WindowReplayer::Linearization& before, const Eigen::VectorXd& d_start, const Eigen::VectorXd& d_x,
                const Eigen::VectorXd& after, const Eigen::VectorXd& precision);

}  // namespace oted
