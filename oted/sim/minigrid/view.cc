#include "oted/sim/minigrid/view.h"

#include <cstring>

namespace oted::minigrid {
namespace {

constexpr uint8_t kAllColumns = (1u << kView) - 1;

// Sight spreads along a row and into the row ahead, first to the right, then to the left (Grid.process_vis). What it
// makes of one row depends on two sets of columns alone: so there is a table.
struct RowSight {
  uint8_t row;    // visible columns of this row in the end
  uint8_t ahead;  // columns of the row ahead that become visible
};

constexpr RowSight SpreadInRow(unsigned visible, unsigned transparent) {
  unsigned ahead = 0;
  for (unsigned i = 0; i + 1 < kView; ++i) {
    if (!(visible & transparent & 1u << i)) continue;
    visible |= 1u << (i + 1);
    ahead |= 3u << i;
  }
  for (unsigned i = kView - 1; i > 0; --i) {
    if (!(visible & transparent & 1u << i)) continue;
    visible |= 1u << (i - 1);
    ahead |= 3u << (i - 1);
  }
  return {static_cast<uint8_t>(visible), static_cast<uint8_t>(ahead)};
}

struct Tables {
  std::array<RowSight, 1u << 2 * kView> sight{};
  // Kind, colour and state of every code; the fourth number is never shown.
  std::array<std::array<double, 4>, Cell::kCodes> numbers{};
  std::array<uint8_t, Cell::kCodes> transparent{};

  Tables() {
    for (unsigned visible = 0; visible <= kAllColumns; ++visible) {
      for (unsigned clear = 0; clear <= kAllColumns; ++clear) {
        sight[visible << kView | clear] = SpreadInRow(visible, clear);
      }
    }
    for (int state = 0; state < 4; ++state) {
      for (int colour = 0; colour < 8; ++colour) {
        for (int kind = 0; kind < 16; ++kind) {
          const Cell cell(static_cast<Kind>(kind), static_cast<Colour>(colour), state);
          numbers[cell.code()] = {static_cast<double>(kind), static_cast<double>(colour), static_cast<double>(state),
                                  0};
          transparent[cell.code()] = cell.SeeBehind();
        }
      }
    }
  }
};

const Tables kTables;

// Steps in memory from a cell to the one ahead and to the one on the right of an agent that looks in `direction`.
struct Steps {
  ptrdiff_t ahead, right;
};
Steps StepsOf(const State& state) {
  const auto step = [&](int direction) {
    const Position& d = kDirections[static_cast<size_t>(direction & 3)];
    return static_cast<ptrdiff_t>(d.y) * state.grid.stride() + d.x;
  };
  return {step(state.direction), step(state.direction + 1)};
}

}  // namespace

Visibility Visible(const State& state, bool see_through_walls) {
  Visibility visible{};
  if (see_through_walls) {
    visible.fill(kAllColumns);
    return visible;
  }
  const Steps steps = StepsOf(state);
  const Cell* row = state.grid.address(state.x, state.y) - (kView / 2) * steps.right;
  visible[kView - 1] = 1u << kView / 2;
  for (size_t j = kView; j-- > 0 && visible[j] != 0; row += steps.ahead) {
    unsigned clear = 0;
    for (int i = 0; i < kView; ++i) {
      clear |= static_cast<unsigned>(kTables.transparent[row[i * steps.right].code()]) << i;
    }
    const RowSight sight = kTables.sight[static_cast<unsigned>(visible[j]) << kView | clear];
    visible[j] = sight.row;
    if (j > 0) visible[j - 1] = sight.ahead;
  }
  return visible;
}

Position ViewCell(const State& state, int i, int j) {
  const Position& ahead = kDirections[static_cast<size_t>(state.direction)];
  const Position& right = kDirections[static_cast<size_t>(state.direction + 1) & 3];
  const int forward = kView - 1 - j, sideways = i - kView / 2;
  return {state.x + forward * ahead.x + sideways * right.x, state.y + forward * ahead.y + sideways * right.y};
}

void EncodeView(const State& state, bool see_through_walls, std::span<double> out) {
  OTED_CHECK(out.size() > kViewNumbers);
  const Visibility visible = Visible(state, see_through_walls);
  const Steps steps = StepsOf(state);
  const Cell* column = state.grid.address(state.x, state.y) - (kView / 2) * steps.right + (kView - 1) * steps.ahead;
  double* to = out.data();
  for (int i = 0; i < kView; ++i, column += steps.right) {
    const Cell* cell = column;
    for (size_t j = 0; j < kView; ++j, cell -= steps.ahead, to += 3) {
      // Code 0 is the unseen cell. Four numbers are copied, since that is one move; the next cell overwrites the last.
      const unsigned code = visible[j] >> i & 1 ? cell->code() : 0;
      std::memcpy(to, kTables.numbers[code].data(), 4 * sizeof(double));
    }
  }
  // The agent's own cell shows what it carries.
  double* own = out.data() + (kView / 2 * kView + kView - 1) * 3;
  std::memcpy(own, kTables.numbers[state.carrying.code()].data(), 3 * sizeof(double));
}

void EncodeGrid(const State& state, std::span<double> out) {
  const Grid& grid = state.grid;
  OTED_CHECK(static_cast<int>(out.size()) >= 3 * grid.width() * grid.height());
  double* to = out.data();
  for (int x = 0; x < grid.width(); ++x) {
    for (int y = 0; y < grid.height(); ++y, to += 3) {
      std::memcpy(to, kTables.numbers[grid.at(x, y).code()].data(), 3 * sizeof(double));
    }
  }
  double* agent = out.data() + 3 * (state.x * grid.height() + state.y);
  agent[0] = static_cast<double>(Kind::kAgent);
  agent[1] = static_cast<double>(Colour::kRed);
  agent[2] = state.direction;
}

}  // namespace oted::minigrid
