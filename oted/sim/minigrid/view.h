#pragma once
/// What the agent sees, encoded as Minigrid does: three numbers per cell (kind, colour, state).

#include <array>
#include <cstdint>
#include <span>

#include "oted/sim/minigrid/grid.h"

namespace oted::minigrid {

/// Length of an encoded view.
inline constexpr int kViewNumbers = kView * kView * 3;

/// Which cells of the view are visible: bit i of row j is cell (i, j) of the view, in which the agent stands at (3, 6)
/// and looks towards row 0.
using Visibility = std::array<uint8_t, kView>;

/// Everything, or what `Grid.process_vis` of Minigrid leaves.
Visibility Visible(const State& state, bool see_through_walls);

/// The cell of the grid that cell (i, j) of the view shows; it may lie outside the grid.
Position ViewCell(const State& state, int i, int j);

/// The partial view, column by column as Minigrid's image[i][j][channel]; 0 where nothing is visible. Writes the first
/// kViewNumbers numbers of `out`, which has room for one more (overwritten with anything).
void EncodeView(const State& state, bool see_through_walls, std::span<double> out);

/// The whole grid with the agent in it, image[x][y][channel], as Minigrid's FullyObsWrapper shows it. Writes
/// 3 width height numbers.
void EncodeGrid(const State& state, std::span<double> out);

}  // namespace oted::minigrid
