#include "oted/rl/value_dice_update.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "oted/base/bisection.h"
#include "oted/base/error.h"

namespace oted::value_dice_update_test {

constexpr double kExpertMean = 0.5, kShift = 0.3, kStd = 0.4;

/// States drawn anew at every step, -1 or 1, whatever is done; u ~ N(0.5 s, 0.4^2), a = tanh(u).
Dataset MakeLogs(int n, uint64_t seed) {
  Dataset d;
  Rng rng(seed);
  double s = 1;
  for (int i = 0; i < n; ++i) {
    const double a = std::tanh(kExpertMean * s + kStd * rng.Normal());
    const double next = rng.Uniform() < 0.5 ? -1 : 1;
    d.observations.AppendRow(std::vector<double>{s});
    d.actions.AppendRow(std::vector<double>{a});
    d.next_observations.AppendRow(std::vector<double>{next});
    d.terminals.push_back(i % 50 == 49);
    d.timeouts.push_back(0);
    s = next;
  }
  return d;
}

/// u ~ N(0.5 s + shift, 0.4^2).
TanhGaussianPolicy MakePolicy(double shift) {
  TanhGaussianPolicy policy({{0.0}, {1.0}}, {}, {-1.0}, {1.0});
  auto& p = policy.net().parameters();
  p[0] = kExpertMean;
  p[1] = 0;
  p[2] = static_cast<float>(shift);
  p[3] = static_cast<float>(std::log(kStd));
  return policy;
}

struct Converged {
  double objective;
  Mlp critic;
};

/// nu at its optimum for a policy that stays as it is, and J there on rows that were not learned from.
Converged Converge(const TanhGaussianPolicy& policy, double gamma, double replay_share) {
  const ImitationRows logs(MakeLogs(20'000, 1), policy), others(MakeLogs(20'000, 2), policy);
  // The replay is the logs' own distribution.
  const std::deque<ImitationRows> replay = {ImitationRows(MakeLogs(20'000, 3), policy)};
  const auto* used = replay_share > 0 ? &replay : nullptr;
  ValueDiceOptions options{.gamma = gamma, .gradient_penalty = 0, .replay_share = replay_share};
  Rng rng(4);
  ValueDiceUpdate update(policy, {32, 32}, options, rng);
  ValueDiceBatch batch;
  for (int step = 0; step < 1'500; ++step) {
    DrawValueDiceBatch(logs, used, 256, policy, rng, batch);
    update.Step(batch, false);
  }
  DrawValueDiceBatch(others, used, 20'000, policy, rng, batch);
  return {update.Step(batch, false).objective, update.critic()};
}

// KL(pi || e) of two Gaussians with one spread, at every state.
const double kDivergence = kShift * kShift / (2 * kStd * kStd);

/// The minimum of J over all functions nu, by quadrature over u. A successor (s', a') has nothing to do with (s, a)
/// here, so that log E[exp(nu - gamma nu')] is the sum of two, and the minimum solves one equation for each u.
double MinimumByQuadrature(double shift, double gamma, double alpha) {
  constexpr double kStep = 0.01;
  std::vector<double> e, pi, nu;
  for (double u = -2.5; u < 2.5; u += kStep) {
    const auto density = [&](double mean) {
      return kStep * std::exp(-0.5 * (u - mean) * (u - mean) / (kStd * kStd)) / (kStd * std::sqrt(2 * M_PI));
    };
    e.push_back(density(0));
    pi.push_back(density(shift));
  }
  nu.assign(e.size(), 0);
  double of_logs = 1, of_next = 1;
  const auto integrate = [&](const std::vector<double>& density, double factor) {
    double sum = 0;
    for (size_t k = 0; k < nu.size(); ++k) sum += density[k] * std::exp(factor * nu[k]);
    return sum;
  };
  for (int iteration = 0; iteration < 60; ++iteration) {
    for (size_t k = 0; k < nu.size(); ++k) {
      const double wanted = (1 - alpha) * (1 - gamma) * pi[k] + alpha * (e[k] - gamma * pi[k]);
      nu[k] = Bisect(-40, 40, 50, [&](double v) {
        return e[k] * std::exp(v) / of_logs - gamma * pi[k] * std::exp(-gamma * v) / of_next < wanted;
      });
    }
    of_logs = 0.5 * of_logs + 0.5 * integrate(e, 1);
    of_next = 0.5 * of_next + 0.5 * integrate(pi, -gamma);
  }
  double linear = 0;
  for (size_t k = 0; k < nu.size(); ++k) {
    linear += nu[k] * ((1 - alpha) * (1 - gamma) * pi[k] + alpha * (e[k] - gamma * pi[k]));
  }
  return std::log(integrate(e, 1)) + std::log(integrate(pi, -gamma)) - linear;
}

TEST(ValueDiceUpdate, WithoutAFutureTheObjectivesMinimumIsMinusTheDivergence) {
  EXPECT_NEAR(MinimumByQuadrature(kShift, 0, 0), -kDivergence, 1e-4);
  EXPECT_NEAR(Converge(MakePolicy(kShift), 0, 0).objective, -kDivergence, 0.1 * kDivergence);
  EXPECT_NEAR(Converge(MakePolicy(0), 0, 0).objective, 0, 0.03 * kDivergence);
}

TEST(ValueDiceUpdate, WithAFutureAndAReplayItIsTheMinimumOverAllFunctions) {
  struct Case {
    double gamma, alpha;
  };
  for (const Case& c : {Case{0.9, 0}, Case{0.9, 0.4}, Case{0, 0.4}}) {
    SCOPED_TRACE(c.alpha);
    const double minimum = MinimumByQuadrature(kShift, c.gamma, c.alpha);
    EXPECT_LT(minimum, -0.1 * kDivergence);
    EXPECT_NEAR(Converge(MakePolicy(kShift), c.gamma, c.alpha).objective, minimum, 0.05 * kDivergence);
  }
  EXPECT_NEAR(Converge(MakePolicy(0), 0.9, 0).objective, 0, 0.03 * kDivergence);
}

TEST(ValueDiceUpdate, NuTellsTheLogRatioOfPolicyAndLogs) {
  // log pi / e is linear in u: (u - 0.5 s) shift / std^2 and a constant. Without a future nu is it.
  const Mlp critic = Converge(MakePolicy(kShift), 0, 0).critic;
  MlpPass pass;
  for (const float s : {-1.0f, 1.0f}) {
    const auto nu = [&](double u) {
      const float x[2] = {s, static_cast<float>(std::tanh(u))};
      return static_cast<double>(pass.Forward(critic, x, 1)[0]);
    };
    const double mean = kExpertMean * s;
    const double slope = (nu(mean + kStd) - nu(mean - kStd)) / (2 * kStd);
    EXPECT_NEAR(slope, kShift / (kStd * kStd), 0.15 * kShift / (kStd * kStd)) << s;
  }
}

TEST(ValueDiceUpdate, AnActorThatIsTheLogsOwnStaysAndAnotherComesToThem) {
  const TanhGaussianPolicy start = MakePolicy(kShift);
  const ImitationRows logs(MakeLogs(4'000, 5), start);
  ValueDiceOptions options{.actor_learning_rate = 1e-3, .gamma = 0.9};
  for (const double shift : {0.0, kShift}) {
    Rng rng(6);
    ValueDiceUpdate update(MakePolicy(shift), {32, 32}, options, rng);
    ValueDiceBatch batch;
    // The actor circles about where it settles: its mean over the second half of the steps counts.
    constexpr int kSteps = 5'000, kSettled = 2'500;
    std::array<double, 4> p{};
    for (int step = 0; step < kSteps; ++step) {
      DrawValueDiceBatch(logs, nullptr, 128, update.actor(), rng, batch);
      update.Step(batch, step >= 200);
      if (step < kSettled) continue;
      for (size_t i = 0; i < p.size(); ++i) p[i] += update.actor().net().parameters()[i] / (kSteps - kSettled);
    }
    EXPECT_NEAR(p[0], kExpertMean, 0.06) << shift;
    EXPECT_NEAR(p[2], 0, 0.06) << shift;
    EXPECT_NEAR(std::exp(p[3]), kStd, 0.06) << shift;
  }
}

TEST(ValueDiceUpdate, GoesOnFromWhatWasSavedWithTheSameBytes) {
  const TanhGaussianPolicy policy = MakePolicy(kShift);
  const ImitationRows logs(MakeLogs(200, 7), policy);
  const std::deque<ImitationRows> replay = {ImitationRows(MakeLogs(100, 8), policy)};
  ValueDiceOptions options{.replay_share = 0.1};
  Rng rng(9);
  ValueDiceUpdate update(policy, {8}, options, rng);
  const auto steps = [&](ValueDiceUpdate& u, const ImitationRows& rows, const std::deque<ImitationRows>& extra,
                         uint64_t seed) {
    Rng own(seed);
    ValueDiceBatch batch;
    for (int step = 0; step < 20; ++step) {
      DrawValueDiceBatch(rows, &extra, 16, policy, own, batch);
      u.Step(batch);
    }
  };
  steps(update, logs, replay, 10);
  NpzArrays arrays;
  update.Save(arrays);
  replay[0].Save("part", arrays);
  Rng other(99);
  ValueDiceUpdate again(policy, {8}, options, other);
  again.Restore(arrays, "file");
  const std::deque<ImitationRows> restored = {ImitationRows::FromArrays("part", arrays, "file")};
  steps(update, logs, replay, 11);
  steps(again, logs, restored, 11);
  EXPECT_EQ(update.actor().net().parameters(), again.actor().net().parameters());
  EXPECT_EQ(update.critic().parameters(), again.critic().parameters());
  arrays.erase("valuedice/critic/m");
  EXPECT_THROW(again.Restore(arrays, "file"), DataError);
  arrays.erase("part/last");
  EXPECT_THROW(ImitationRows::FromArrays("part", arrays, "file"), DataError);
}

TEST(ImitationRows, AnEpisodesLastRowIsFollowedByTheStartOfOneDrawnAtRandom) {
  Dataset d;
  for (int i = 0; i < 6; ++i) {  // two episodes of three rows: one ends terminally, one is cut
    d.observations.AppendRow(std::vector<double>{10.0 * (i / 3) + i % 3});
    d.next_observations.AppendRow(std::vector<double>{10.0 * (i / 3) + i % 3 + 1});
    d.actions.AppendRow(std::vector<double>{i == 0 ? 3.0 : 1.0});
    d.terminals.push_back(i == 2);
    d.timeouts.push_back(i == 5);
  }
  const TanhGaussianPolicy policy({{0.0}, {2.0}}, {}, {-1.0}, {3.0});
  const ImitationRows rows(d, policy);
  Rng rng(1);
  EXPECT_EQ(rows.state(4)[0], 5.5f);
  EXPECT_EQ(rows.action(0)[0], 1.0f);
  EXPECT_EQ(rows.action(1)[0], 0.0f);
  EXPECT_EQ(rows.Next(0, rng)[0], 0.5f);
  for (const int last : {2, 5}) {
    int first = 0;
    for (int k = 0; k < 200; ++k) {
      const float next = rows.Next(last, rng)[0];
      EXPECT_TRUE(next == 0.0f || next == 5.0f) << next;
      first += next == 0.0f;
    }
    EXPECT_NEAR(first, 100, 35);
  }
}

}  // namespace oted::value_dice_update_test
