#include "oted/sim/minigrid/transition.h"

#include <algorithm>

namespace oted::minigrid {
namespace {

constexpr int kDrawsPerBall = 101;

void MoveBall(State& state, Position& ball, Position to) {
  state.grid.at(to.x, to.y) = state.grid.at(ball.x, ball.y);
  state.grid.at(ball.x, ball.y) = Cell();
  ball = to;
}

void MoveBalls(State& state, Rng& rng) {
  for (Position& ball : state.balls) {
    const int left = std::max(ball.x - 1, 0), top = std::max(ball.y - 1, 0);
    const auto columns = static_cast<uint64_t>(std::min(left + 3, state.grid.width()) - left);
    const auto rows = static_cast<uint64_t>(std::min(top + 3, state.grid.height()) - top);
    for (int draw = 0; draw < kDrawsPerBall; ++draw) {
      const Position to{left + static_cast<int>(rng.Below(columns)), top + static_cast<int>(rng.Below(rows))};
      if (!state.grid.at(to.x, to.y).is_empty() || to == Position{state.x, state.y}) continue;
      MoveBall(state, ball, to);
      break;
    }
  }
}

void Toggle(State& state, Position at) {
  Cell& cell = state.grid.at(at.x, at.y);
  if (cell.kind() == Kind::kBox) {
    cell = cell.contents();
  } else if (cell.kind() == Kind::kDoor && cell.state() == kLocked) {
    const bool has_key = state.carrying.kind() == Kind::kKey && state.carrying.colour() == cell.colour();
    if (has_key) cell = Cell(Kind::kDoor, cell.colour(), kOpen);
  } else if (cell.kind() == Kind::kDoor) {
    cell = Cell(Kind::kDoor, cell.colour(), cell.state() == kOpen ? kClosed : kOpen);
  }
}

// MiniGridEnv.step
Outcome MoveAgent(State& state, const Rules& rules, Action action) {
  Outcome outcome;
  ++state.step_count;
  const Position front = state.front();
  const Cell cell = state.front_cell();
  switch (action) {
    case kLeft:
      state.direction = (state.direction + 3) & 3;
      break;
    case kRight:
      state.direction = (state.direction + 1) & 3;
      break;
    case kForward:
      if (cell.CanOverlap()) {
        state.x = front.x;
        state.y = front.y;
      }
      if (cell.kind() == Kind::kGoal) {
        outcome.terminated = true;
        outcome.reward = 1 - 0.9 * (static_cast<double>(state.step_count) / rules.max_steps);
      }
      if (cell.kind() == Kind::kLava) outcome.terminated = true;
      break;
    case kPickUp:
      if (cell.CanPickUp() && state.carrying.is_empty()) {
        state.carrying = cell;
        state.grid.at(front.x, front.y) = Cell();
      }
      break;
    case kDrop:
      if (cell.is_empty() && !state.carrying.is_empty()) {
        state.grid.at(front.x, front.y) = state.carrying;
        state.carrying = Cell();
      }
      break;
    case kToggle:
      Toggle(state, front);
      break;
    case kDone:
      break;
  }
  outcome.truncated = state.step_count >= rules.max_steps;
  return outcome;
}

template <class BallMover>
Outcome StepAround(State& state, const Rules& rules, Action action, const BallMover& move_balls) {
  // Looked at before the balls move: one that moves in front of the agent blocks it, and costs nothing.
  const Cell cell = state.front_cell();
  const bool collides = rules.collision_ends && action == kForward && !cell.is_empty() && cell.kind() != Kind::kGoal;
  move_balls();
  Outcome outcome = MoveAgent(state, rules, action);
  if (collides) {
    outcome.reward = -1;
    outcome.terminated = true;
  }
  return outcome;
}

}  // namespace

Outcome Step(State& state, const Rules& rules, Action action, Rng& rng) {
  return StepAround(state, rules, action, [&] { MoveBalls(state, rng); });
}

Outcome StepWithBalls(State& state, const Rules& rules, Action action, std::span<const Position> balls) {
  OTED_CHECK(balls.size() == state.balls.size());
  return StepAround(state, rules, action, [&] {
    for (size_t i = 0; i < balls.size(); ++i) {
      if (balls[i] != state.balls[i]) MoveBall(state, state.balls[i], balls[i]);
    }
  });
}

}  // namespace oted::minigrid
