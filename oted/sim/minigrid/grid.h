#pragma once
/// What Minigrid's world is made of: objects, the grid, the agent. Numbers and rules are Minigrid 3.2.0's.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "oted/base/error.h"

namespace oted::minigrid {

/// The first channel of an encoded cell.
enum class Kind : uint8_t { kUnseen, kEmpty, kWall, kFloor, kDoor, kKey, kBall, kBox, kGoal, kLava, kAgent };
inline constexpr int kKinds = 11;
/// The second channel.
enum class Colour : uint8_t { kRed, kGreen, kBlue, kPurple, kYellow, kGrey };
inline constexpr int kColours = 6;
/// The third channel, of doors; 0 for everything else.
enum DoorState { kOpen = 0, kClosed = 1, kLocked = 2 };
/// What the third channel can hold: a door's state, or the agent's direction where the whole grid is shown.
inline constexpr int kStates = 4;

/// One cell of the grid: nothing (kEmpty), or an object. A box may contain an object that is no door and no box.
class Cell {
 public:
  constexpr Cell() = default;
  explicit constexpr Cell(Kind kind, Colour colour = Colour::kRed, int state = 0)
      : bits_(static_cast<uint16_t>(static_cast<int>(kind) | static_cast<int>(colour) << 4 | state << 7)) {}
  /// A box around `inside`; kEmpty: an empty one.
  static constexpr Cell BoxAround(Colour colour, Cell inside) {
    Cell box(Kind::kBox, colour);
    if (inside.kind() != Kind::kEmpty) box.bits_ = static_cast<uint16_t>(box.bits_ | (inside.bits_ & 127) << 9);
    return box;
  }

  constexpr Kind kind() const { return static_cast<Kind>(bits_ & 15); }
  constexpr Colour colour() const { return static_cast<Colour>(bits_ >> 4 & 7); }
  constexpr int state() const { return bits_ >> 7 & 3; }
  /// What is in a box: kEmpty when nothing is.
  constexpr Cell contents() const {
    Cell inside;
    if (bits_ >> 9 != 0) inside.bits_ = static_cast<uint16_t>(bits_ >> 9);
    return inside;
  }
  /// Kind, colour and state as one number below kCodes.
  constexpr unsigned code() const { return bits_ & 511u; }
  static constexpr int kCodes = 512;

  constexpr bool is_empty() const { return kind() == Kind::kEmpty; }
  /// The agent can stand here.
  constexpr bool CanOverlap() const {
    return kind() == Kind::kEmpty || kind() == Kind::kFloor || kind() == Kind::kGoal || kind() == Kind::kLava ||
           (kind() == Kind::kDoor && state() == kOpen);
  }
  constexpr bool CanPickUp() const { return kind() == Kind::kKey || kind() == Kind::kBall || kind() == Kind::kBox; }
  constexpr bool SeeBehind() const { return kind() != Kind::kWall && !(kind() == Kind::kDoor && state() != kOpen); }
  constexpr bool operator==(const Cell&) const = default;

 private:
  uint16_t bits_ = static_cast<uint16_t>(Kind::kEmpty);
};

inline constexpr Cell kWall(Kind::kWall, Colour::kGrey);
inline constexpr Cell kGoal(Kind::kGoal, Colour::kGreen);
inline constexpr Cell kLava(Kind::kLava, Colour::kRed);
inline constexpr Cell kBall(Kind::kBall, Colour::kBlue);

/// Side of the agent's view, in cells.
inline constexpr int kView = 7;

/// Cells by (x, y), x to the right, y down, with walls all around as far as the agent can see.
class Grid {
 public:
  Grid() = default;
  Grid(int width, int height)
      : width_(width),
        height_(height),
        cells_(static_cast<size_t>((width + 2 * kMargin) * (height + 2 * kMargin)), kWall) {
    OTED_CHECK(width >= 3 && height >= 3);
    Clear();
  }

  int width() const { return width_; }
  int height() const { return height_; }
  int stride() const { return width_ + 2 * kMargin; }
  /// (x, y) may lie up to kMargin cells outside.
  Cell& at(int x, int y) { return cells_[Index(x, y)]; }
  Cell at(int x, int y) const { return cells_[Index(x, y)]; }
  const Cell* address(int x, int y) const { return cells_.data() + Index(x, y); }
  bool Contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

  /// Empties every cell inside.
  void Clear() {
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) at(x, y) = Cell();
    }
  }
  void HorizontalWall(int x, int y, int length) {
    for (int i = 0; i < length; ++i) at(x + i, y) = kWall;
  }
  void VerticalWall(int x, int y, int length) {
    for (int i = 0; i < length; ++i) at(x, y + i) = kWall;
  }
  /// Empties the grid and walls its border.
  void MakeRoom() {
    Clear();
    HorizontalWall(0, 0, width_);
    HorizontalWall(0, height_ - 1, width_);
    VerticalWall(0, 0, height_);
    VerticalWall(width_ - 1, 0, height_);
  }
  bool operator==(const Grid&) const = default;

 private:
  static constexpr int kMargin = kView - 1;
  size_t Index(int x, int y) const { return static_cast<size_t>((y + kMargin) * stride() + x + kMargin); }

  int width_ = 0;
  int height_ = 0;
  std::vector<Cell> cells_;
};

struct Position {
  int x = 0, y = 0;
  bool operator==(const Position&) const = default;
};

/// Directions: 0 right (+x), 1 down (+y), 2 left, 3 up.
inline constexpr std::array<Position, 4> kDirections = {Position{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

enum Action { kLeft = 0, kRight = 1, kForward = 2, kPickUp = 3, kDrop = 4, kToggle = 5, kDone = 6 };
inline constexpr int kActions = 7;

/// Everything that an episode's future depends on, but the random stream of moving balls.
struct State {
  Grid grid;
  int x = 1, y = 1;  ///< the agent
  int direction = 0;
  Cell carrying;  ///< kEmpty: nothing
  int step_count = 0;
  std::vector<Position> balls;  ///< those that move, in the order in which they do

  Position front() const {
    const Position& ahead = kDirections[static_cast<size_t>(direction)];
    return {x + ahead.x, y + ahead.y};
  }
  Cell front_cell() const {
    const Position at = front();
    return grid.at(at.x, at.y);
  }
};

}  // namespace oted::minigrid
