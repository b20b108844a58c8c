#include "oted/data/checks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/rng.h"
#include "oted/data/checks_dynamics.h"
#include "oted/data/linear_fit.h"

namespace oted::checks_test {

const TaskFacts kFacts = {.observation_names = {"angle", "speed", "height"},
                          .action_names = {"torque"},
                          .action_low = {-1},
                          .action_high = {1},
                          .max_episode_steps = 200};

/// Five episodes of 120 rows of a damped oscillator that a smooth torque drives: (angle, speed, slow height).
Dataset CleanLog() {
  Dataset d;
  for (int e = 0; e < 5; ++e) {
    double angle = 1 + 0.3 * e, speed = 0.1 * e;
    for (int t = 0; t < 120; ++t) {
      const auto height = [&](int at) { return 0.7 * std::sin(0.023 * at + e) + 0.1 * std::cos(0.11 * at); };
      const double torque = 0.9 * std::sin(0.07 * t + 1.3 * e);
      d.observations.AppendRow(std::vector<double>{angle, speed, height(t)});
      d.actions.AppendRow(std::vector<double>{torque});
      speed += 0.05 * (-angle - 0.2 * speed + torque);
      angle += 0.05 * speed;
      d.next_observations.AppendRow(std::vector<double>{angle, speed, height(t + 1)});
      d.terminals.push_back(0);
      d.timeouts.push_back(t == 119);
    }
  }
  return d;
}

std::vector<Finding> Check(const Dataset& d, const TaskFacts& facts = kFacts) { return CheckDataset(d, facts); }

/// The finding of that check; a test failure when there is none.
Finding FindingOf(const std::vector<Finding>& findings, const std::string& check) {
  for (const Finding& f : findings) {
    if (f.check == check) return f;
  }
  ADD_FAILURE() << "no finding '" << check << "'";
  return {};
}

bool Has(const std::vector<Finding>& findings, const std::string& check) {
  for (const Finding& f : findings) {
    if (f.check == check) return true;
  }
  return false;
}

TEST(Checks, ACleanLogHasNoFinding) {
  for (const Finding& f : Check(CleanLog())) ADD_FAILURE() << f.check << ": " << f.what;
  // Without a task, too.
  for (const Finding& f : Check(CleanLog(), {})) ADD_FAILURE() << f.check << ": " << f.what;
}

TEST(Checks, EveryNumberThatIsNotFiniteIsCounted) {
  Dataset d = CleanLog();
  d.observations(7, 1) = NAN;
  d.observations(7, 2) = NAN;
  d.observations(300, 0) = INFINITY;
  d.actions(9, 0) = -INFINITY;
  const auto findings = Check(d);
  ASSERT_EQ(findings.size(), 2u);
  EXPECT_EQ(findings[0].severity, Severity::kError);
  EXPECT_EQ(findings[0].row, 7);
  EXPECT_EQ(findings[0].count, 2);  // rows
  EXPECT_NE(findings[0].what.find("3 of 1800"), std::string::npos) << findings[0].what;
  EXPECT_EQ(findings[1].row, 9);
}

TEST(Checks, ArraysThatDisagreeAreAFindingAndNoCrash) {
  Dataset d = CleanLog();
  d.rewards.assign(17, 0.0);
  const auto findings = Check(d);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].check, "malformed");
  EXPECT_EQ(Check(Dataset{}).at(0).check, "malformed");
}

TEST(Checks, RepeatedRowsAndEpisodesAreFound) {
  Dataset rows = CleanLog();
  for (Array2<double>* m : {&rows.observations, &rows.actions, &rows.next_observations}) {
    std::ranges::copy(m->row(119), m->row(120).begin());  // the first row of an episode: no boundary is crossed
  }
  const auto found = FindingOf(Check(rows), "duplicated_rows");
  EXPECT_EQ(found.count, 1);
  EXPECT_EQ(found.row, 120);
  EXPECT_EQ(found.severity, Severity::kNote);

  Dataset episodes = CleanLog();
  const std::vector<Episode> all = episodes.Episodes();
  episodes.Append(episodes.Select({all[2]}));
  const auto again = Check(episodes);
  EXPECT_EQ(FindingOf(again, "duplicated_episodes").row, 600);
  EXPECT_EQ(FindingOf(again, "duplicated_episodes").count, 120);
  EXPECT_FALSE(Has(again, "duplicated_rows")) << "the episode explains its rows";
}

TEST(Checks, RowsThatStandStillAreFound) {
  Dataset d = CleanLog();
  for (const int i : {130, 131, 132, 133, 134, 135, 136}) {
    std::ranges::copy(d.observations.row(130), d.observations.row(i).begin());
    std::ranges::copy(d.observations.row(130), d.next_observations.row(i).begin());
  }
  const Finding found = FindingOf(Check(d), "standing_rows");
  EXPECT_EQ(found.row, 130);
  EXPECT_EQ(found.count, 7);
  EXPECT_EQ(found.severity, Severity::kWarning);
}

TEST(Checks, ARobotThatWaitsBeforeItBeginsIsAtRest) {
  Dataset d = CleanLog();
  for (const Episode& episode : d.Episodes()) {
    for (int i = episode.begin; i < episode.begin + 8; ++i) {
      std::ranges::copy(d.observations.row(episode.begin + 8), d.observations.row(i).begin());
      std::ranges::copy(d.observations.row(episode.begin + 8), d.next_observations.row(i).begin());
    }
  }
  const Finding found = FindingOf(Check(d), "standing_rows");
  EXPECT_EQ(found.count, 8 * static_cast<int>(d.Episodes().size()));
  EXPECT_EQ(found.severity, Severity::kNote) << found.what;
}

/// The clean log as encoders read it every `every` rows, in these steps.
Dataset Encoded(double step, int every) {
  Dataset d = CleanLog();
  for (const Episode& episode : d.Episodes()) {
    for (int i = episode.begin; i < episode.end; ++i) {
      const int from = episode.begin + (i - episode.begin) / every * every;
      const int next = episode.begin + (i + 1 - episode.begin) / every * every;
      for (int j = 0; j < d.obs_dim(); ++j) {
        const auto read = [&](int row) { return step * std::nearbyint(d.observations(row, j) / step); };
        const double here = read(from),
                     there = next == i + 1 ? step * std::nearbyint(d.next_observations(i, j) / step) : here;
        d.observations(i, j) = here;
        d.next_observations(i, j) = there;
      }
    }
  }
  return d;
}

TEST(Checks, ARobotSlowerThanItsEncodersStepsIsNotTakenForOldReadings) {
  const Finding slow = FindingOf(Check(Encoded(0.1, 1)), "standing_rows");
  EXPECT_EQ(slow.severity, Severity::kNote) << slow.what;
  EXPECT_NE(slow.meaning.find("less than a step"), std::string::npos) << slow.meaning;
  EXPECT_FALSE(Has(Check(Encoded(0.1, 1)), "duplicated_rows")) << "a robot at rest wrote nothing twice";
  const Finding old = FindingOf(Check(Encoded(1e-3, 2)), "standing_rows");
  EXPECT_EQ(old.severity, Severity::kWarning) << old.what;
}

TEST(Checks, AMissedBoundaryIsAnErrorAtItsRow) {
  Dataset d = CleanLog();
  d.timeouts[119] = 0;
  const Finding found = FindingOf(Check(d), "missed_boundary");
  EXPECT_EQ(found.severity, Severity::kError);
  EXPECT_EQ(found.row, 119);
  EXPECT_EQ(found.count, 1);
  EXPECT_EQ(FindingOf(Check(d), "long_episodes").row, 0);  // 240 steps, the limit is 200
}

TEST(Checks, AJumpIsFoundWhereTheNextRowIsAllThatIsKnown) {
  Dataset d = CleanLog();
  for (const int end : {119, 239, 359, 479}) {
    d.timeouts[static_cast<size_t>(end)] = 0;
    std::ranges::copy(d.observations.row(end + 1), d.next_observations.row(end).begin());
  }
  d.timeouts.back() = 0;
  const auto findings = Check(d);
  EXPECT_FALSE(Has(findings, "missed_boundary"));
  const Finding found = FindingOf(findings, "state_jumps");
  EXPECT_EQ(found.row, 119);
  EXPECT_NE(found.what.find("no row is marked as a timeout"), std::string::npos);
}

TEST(Checks, NextObservationsOfAnotherOriginAreNoMissedBoundary) {
  Dataset d = CleanLog();
  Rng rng(1);
  for (int i = 0; i < d.size(); ++i) d.next_observations(i, 0) += 0.001 * rng.Normal();
  const auto findings = Check(d);
  EXPECT_EQ(FindingOf(findings, "inconsistent_next").severity, Severity::kWarning);
  EXPECT_FALSE(Has(findings, "missed_boundary"));
}

TEST(Checks, ARecordingCutInPiecesAndEpisodesOfOneRowAreNamed) {
  Dataset d = CleanLog();
  d.timeouts[50] = 1;
  EXPECT_EQ(FindingOf(Check(d), "continued_episodes").row, 50);
  d = CleanLog();
  d.terminals.assign(d.terminals.size(), 1);
  d.timeouts.assign(d.timeouts.size(), 0);
  EXPECT_EQ(FindingOf(Check(d), "short_episodes").severity, Severity::kWarning);
  d = CleanLog();
  EXPECT_TRUE(Has(Check(d.Select({{0, 120, false}})), "little_data"));
}

TEST(Checks, AConstantChannelIsNamed) {
  Dataset d = CleanLog();
  for (int i = 0; i < d.size(); ++i) d.observations(i, 2) = d.next_observations(i, 2) = 0.7;
  EXPECT_EQ(FindingOf(Check(d), "constant_channels").channels, std::vector<std::string>{"height"});
  d = CleanLog();
  for (int i = 0; i < d.size(); ++i) d.actions(i, 0) = 0.1;
  EXPECT_EQ(FindingOf(Check(d), "constant_channels").channels, std::vector<std::string>{"torque"});
}

TEST(Checks, ActionsOnAndBeyondTheirBoundsAreFound) {
  Dataset d = CleanLog();
  for (int i = 0; i < d.size(); ++i) d.actions(i, 0) = std::clamp(5 * d.actions(i, 0), -1.0, 1.0);
  auto findings = Check(d);
  EXPECT_EQ(FindingOf(findings, "clipped_actions").severity, Severity::kWarning);
  EXPECT_FALSE(Has(findings, "actions_outside_bounds"));
  d = CleanLog();
  d.actions(77, 0) = 1.2;
  const Finding outside = FindingOf(Check(d), "actions_outside_bounds");
  EXPECT_EQ(outside.row, 77);
  EXPECT_EQ(outside.severity, Severity::kWarning);
  d = CleanLog();
  for (int i = 0; i < d.size(); ++i) d.actions(i, 0) *= 1e-3;
  EXPECT_TRUE(Has(Check(d), "small_actions"));
}

TEST(Checks, AClippedObservationIsFoundAndItsBoundNamed) {
  Dataset d = CleanLog();
  for (Array2<double>* m : {&d.observations, &d.next_observations}) {
    for (int i = 0; i < d.size(); ++i) (*m)(i, 1) = std::clamp((*m)(i, 1), -0.6, 0.6);
  }
  const Finding found = FindingOf(Check(d), "clipped_observations");
  EXPECT_EQ(found.channels, std::vector<std::string>{"speed"});
  EXPECT_NE(found.what.find("-0.6, 0.6"), std::string::npos) << found.what;
}

TEST(Checks, AQuaternionOfABodyThatHasNotTurnedIsNotClipped) {
  Dataset d = CleanLog();
  for (Array2<double>* m : {&d.observations, &d.next_observations}) {
    for (int i = 0; i < d.size(); ++i) (*m)(i, 1) = std::min(10 * (*m)(i, 1), 1.0);
  }
  EXPECT_TRUE(Has(Check(d), "clipped_observations"));
  TaskFacts facts = kFacts;
  facts.bodies.push_back({.orientation = {1, -1, -1, -1}});
  EXPECT_FALSE(Has(Check(d, facts), "clipped_observations"));
  for (Array2<double>* m : {&d.observations, &d.next_observations}) {
    for (int i = 0; i < d.size(); ++i) (*m)(i, 1) = std::min((*m)(i, 1), 0.9999999);  // the log has seven digits
  }
  EXPECT_FALSE(Has(Check(d, facts), "clipped_observations"));
}

TEST(Checks, AGridIsFoundWithItsStep) {
  Dataset d = CleanLog();
  for (Array2<double>* m : {&d.observations, &d.next_observations}) {
    for (int i = 0; i < d.size(); ++i) {
      (*m)(i, 0) = 0.05 * std::nearbyint((*m)(i, 0) / 0.05);
      (*m)(i, 2) = static_cast<float>(1e-4 * std::nearbyint((*m)(i, 2) / 1e-4));  // and rounded to float32
    }
  }
  const auto findings = Check(d);
  const Finding coarse = FindingOf(findings, "quantised");
  EXPECT_EQ(coarse.channels, std::vector<std::string>{"angle (step 0.05)"});
  EXPECT_NE(coarse.meaning.find("more than a tenth"), std::string::npos) << coarse.meaning;
  const auto is_fine = [](const Finding& f) {
    return f.check == "quantised" && f.meaning.find("fine enough") != std::string::npos;
  };
  const auto fine = std::find_if(findings.begin(), findings.end(), is_fine);
  ASSERT_NE(fine, findings.end());
  EXPECT_EQ(fine->channels, std::vector<std::string>{"height (step 0.0001)"});
}

TEST(Checks, HalfPrecisionIsFoundAndFloat32IsNot) {
  Dataset single = CleanLog(), half = CleanLog();
  for (int i = 0; i < half.size(); ++i) {
    for (int j = 0; j < 3; ++j) {
      for (auto m : {&Dataset::observations, &Dataset::next_observations}) {
        (single.*m)(i, j) = static_cast<float>((single.*m)(i, j));
        int exponent = 0;
        const double mantissa = std::frexp((half.*m)(i, j), &exponent);
        (half.*m)(i, j) = std::ldexp(std::nearbyint(std::ldexp(mantissa, 11)), exponent - 11);
      }
    }
  }
  EXPECT_EQ(FindingOf(Check(half), "half_precision").count, 3);
  EXPECT_TRUE(Check(single).empty());
}

TEST(Checks, StatesThatAreNotTheObservationsAreFound) {
  Dataset d = CleanLog();  // read as: qpos = (x, angle), qvel = (speed, height)
  d.qpos = Array2<double>(d.size(), 2);
  d.qvel = Array2<double>(d.size(), 2);
  const auto fill = [&d](const Array2<double>& from) {
    for (int i = 0; i < d.size(); ++i) {
      d.qpos(i, 1) = from(i, 0);
      d.qvel(i, 0) = from(i, 1);
      d.qvel(i, 1) = from(i, 2);
    }
  };
  fill(d.observations);
  EXPECT_TRUE(Check(d).empty());
  d.qvel(33, 0) += 0.5;
  const Finding found = FindingOf(Check(d), "states_disagree");
  EXPECT_EQ(found.row, 33);
  EXPECT_EQ(found.count, 1);
  EXPECT_EQ(found.channels, std::vector<std::string>{"speed"});
  fill(d.next_observations);
  EXPECT_TRUE(Has(Check(d), "states_after_action"));
  // A velocity that the observation clips is no disagreement.
  fill(d.observations);
  for (Array2<double>* m : {&d.observations, &d.next_observations}) {
    for (int i = 0; i < d.size(); ++i) (*m)(i, 1) = std::clamp((*m)(i, 1), -0.9, 0.9);
  }
  EXPECT_FALSE(Has(Check(d), "states_disagree"));
}

TEST(Checks, TheNoiseOfAChannelIsEstimatedWithinAFifth) {
  Dataset d = CleanLog();
  Rng rng(3);
  const double sigma = 0.02;
  for (const Episode& e : d.Episodes()) {
    for (int i = e.begin; i < e.end; ++i) {
      d.next_observations(i, 0) += sigma * rng.Normal();
      if (i == e.begin) d.observations(i, 0) += sigma * rng.Normal();
      if (i > e.begin) d.observations(i, 0) = d.next_observations(i - 1, 0);
    }
  }
  const auto noise = EstimateNoise(d);
  ASSERT_EQ(noise.size(), 3u);
  EXPECT_TRUE(noise[0].visible);
  EXPECT_NEAR(noise[0].sigma, sigma, 0.2 * sigma);
  EXPECT_FALSE(noise[2].visible);
  EXPECT_EQ(FindingOf(Check(d), "measurement_noise").severity, Severity::kWarning);
}

TEST(Checks, ALogThatIsThinnedTooFarIsCoarse) {
  Dataset d = CleanLog(), thin;
  Rng rng(4);
  // The torque now changes at random within the steps that are thrown away.
  double angle = 1, speed = 0;
  for (int i = 0; i < 400; ++i) {
    const double torque = rng.Uniform(-1, 1);
    thin.observations.AppendRow(std::vector<double>{angle, speed, rng.Normal()});
    thin.actions.AppendRow(std::vector<double>{torque});
    for (int k = 0; k < 200; ++k) {
      speed += 0.05 * (-angle - 0.2 * speed + 10 * (k == 0 ? torque : rng.Uniform(-1, 1)));
      angle += 0.05 * speed;
    }
    thin.next_observations.AppendRow(std::vector<double>{angle, speed, rng.Normal()});
    thin.terminals.push_back(0);
    thin.timeouts.push_back(1);
  }
  EXPECT_EQ(FindingOf(Check(thin), "low_rate").severity, Severity::kWarning);
}

TEST(Checks, ImagesAndDiscreteActionsAreNotCheckedNumberByNumber) {
  Dataset d = CleanLog();
  for (int i = 0; i < d.size(); ++i) d.observations(i, 2) = d.next_observations(i, 2) = 0;
  TaskFacts facts = kFacts;
  facts.flat_observations = false;
  facts.continuous_actions = false;
  EXPECT_TRUE(Check(d, facts).empty());
}

TEST(LinearFit, RecoversAMapAndSurvivesACollinearColumn) {
  Rng rng(5);
  Array2<double> x(50, 3), y(50, 1);
  for (int i = 0; i < 50; ++i) {
    x(i, 0) = rng.Normal();
    x(i, 1) = 1000 * rng.Normal();
    x(i, 2) = 2 * x(i, 0);
    y(i, 0) = 3 * x(i, 0) - 0.01 * x(i, 1);
  }
  const Array2<double> b = LeastSquares(x, y);
  EXPECT_NEAR(b(0, 0) + 2 * b(2, 0), 3, 1e-6);
  EXPECT_NEAR(b(1, 0), -0.01, 1e-9);
}

}  // namespace oted::checks_test
