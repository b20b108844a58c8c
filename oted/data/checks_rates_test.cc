#include "oted/data/checks_rates.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "oted/base/rng.h"

namespace oted::checks_rates_test {

constexpr double kPeriod = 0.01;
const TaskFacts kFacts = {.observation_names = {"hip/qpos", "knee/qpos", "hip/qvel", "knee/qvel"},
                          .rate_of = {-1, -1, 0, 1},
                          .positions = {0, 1},
                          .control_period_s = kPeriod};

double Hip(double t) { return 0.8 * std::sin(3 * t) + 0.1 * std::sin(17 * t); }
double HipRate(double t) { return 2.4 * std::cos(3 * t) + 1.7 * std::cos(17 * t); }
double Knee(double t) { return 0.5 * std::cos(5 * t) - 0.2 * std::sin(11 * t); }
double KneeRate(double t) { return -2.5 * std::sin(5 * t) - 2.2 * std::cos(11 * t); }

/// Three episodes of 150 rows; `row` makes the numbers of a moment.
Dataset LogOf(const std::function<std::vector<double>(double)>& row, double period = kPeriod) {
  Dataset d;
  Rng rng(1);
  for (int e = 0; e < 3; ++e) {
    for (int i = 0; i < 150; ++i) {
      const double t = 7 * e + i * period;
      d.observations.AppendRow(row(t));
      d.next_observations.AppendRow(row(t + period));
      d.actions.AppendRow(std::vector<double>{rng.Normal()});
      d.terminals.push_back(0);
      d.timeouts.push_back(i == 149);
    }
  }
  return d;
}

std::vector<double> Truth(double t) { return {Hip(t), Knee(t), HipRate(t), KneeRate(t)}; }

std::vector<Finding> Check(const Dataset& d, const TaskFacts& facts = kFacts) {
  std::vector<Finding> found;
  for (const Finding& f : CheckDataset(d, facts)) {
    if (f.severity != Severity::kNote) found.push_back(f);
  }
  return found;
}

/// The only one, and that it is of this check.
Finding Only(const std::vector<Finding>& found, const std::string& check) {
  EXPECT_EQ(found.size(), 1u);
  for (const Finding& f : found) {
    if (f.check == check) return f;
    ADD_FAILURE() << f.check << ": " << f.what;
  }
  ADD_FAILURE() << "no '" << check << "'";
  return {};
}

TEST(Rates, PositionsAndTheirVelocitiesRaiseNoWarning) {
  for (const Finding& f : Check(LogOf(Truth))) ADD_FAILURE() << f.check << ": " << f.what;
  // Velocities at the end of a row, as an integrator leaves them, and from backward differences are half a row off.
  const auto late = [](double t) {
    return std::vector<double>{Hip(t), Knee(t), (Hip(t) - Hip(t - kPeriod)) / kPeriod, KneeRate(t - kPeriod / 2)};
  };
  for (const Finding& f : Check(LogOf(late))) ADD_FAILURE() << f.check << ": " << f.what;
}

TEST(Rates, ATurnedSignIsNamedInItsChannelAlone) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{Hip(t), -Knee(t), HipRate(t), KneeRate(t)};
                      })),
                      "rate_sign");
  EXPECT_EQ(f.channels, (std::vector<std::string>{"knee/qpos", "knee/qvel"}));
}

TEST(Rates, DegreesAreNamedWithTheirFactor) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{57.29578 * Hip(t), Knee(t), HipRate(t), KneeRate(t)};
                      })),
                      "rate_unit");
  EXPECT_NE(f.remedy.find("multiply hip/qpos by 0.0174533"), std::string::npos) << f.remedy;
  const auto g = Only(Check(LogOf([](double t) {
                        return std::vector<double>{Hip(t), Knee(t), HipRate(t), 57.29578 * KneeRate(t)};
                      })),
                      "rate_unit");
  EXPECT_NE(g.remedy.find("multiply knee/qvel by 0.0174533"), std::string::npos) << g.remedy;
}

TEST(Rates, ThousandthsAreNamedByTheColumnThatHasThem) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{1000 * Hip(t), Knee(t), HipRate(t), KneeRate(t)};
                      })),
                      "rate_unit");
  EXPECT_NE(f.remedy.find("multiply hip/qpos by 0.001"), std::string::npos) << f.remedy;
  // All of them: not another control rate.
  const auto found = Check(LogOf([](double t) {
    return std::vector<double>{Hip(t), Knee(t), 1000 * HipRate(t), 1000 * KneeRate(t)};
  }));
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NE(found[1].remedy.find("multiply knee/qvel by 0.001"), std::string::npos) << found[1].remedy;
}

TEST(Rates, SwappedColumnsAreNamedTogether) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{Knee(t), Hip(t), HipRate(t), KneeRate(t)};
                      })),
                      "swapped_columns");
  EXPECT_NE(f.remedy.find("swap hip/qpos and knee/qpos"), std::string::npos) << f.remedy;
}

TEST(Rates, APositionThatIsTheRateOfItsVelocityStandsInItsPlace) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{HipRate(t), Knee(t), Hip(t), KneeRate(t)};
                      })),
                      "swapped_columns");
  EXPECT_EQ(f.remedy, "swap hip/qpos and hip/qvel");
  // By -57.3 a position in degrees would change as well.
  const auto slow =
      Only(Check(LogOf([](double t) {
             const double rate = std::sqrt(57.3);
             return std::vector<double>{rate * std::cos(rate * t), Knee(t), std::sin(rate * t), KneeRate(t)};
           })),
           "swapped_columns");
  EXPECT_EQ(slow.remedy, "swap hip/qpos and hip/qvel");
}

TEST(Rates, OneRecordingInAnotherSignOrUnitIsNamed) {
  const auto of_second = [](double position, double velocity) {
    Dataset d = LogOf(Truth);
    for (int i = 150; i < 300; ++i) {
      for (Array2<double>* rows : {&d.observations, &d.next_observations}) {
        (*rows)(i, 0) *= position;
        (*rows)(i, 2) *= velocity;
      }
    }
    return Check(d);
  };
  const auto sign = Only(of_second(1, -1), "rate_sign");
  EXPECT_EQ(sign.what, "in episode 2 hip/qpos and hip/qvel have opposite signs, in the others they have not");
  const auto unit = Only(of_second(180 / M_PI, 1), "rate_unit");
  EXPECT_NE(unit.what.find("in episode 2 hip/qpos changes 57.3 times as fast"), std::string::npos) << unit.what;
}

TEST(Rates, AVelocityThatLagsIsNamedWithItsLag) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{Hip(t), Knee(t), HipRate(t), KneeRate(t - 2.5 * kPeriod)};
                      })),
                      "velocity_lag");
  EXPECT_EQ(f.channels, std::vector<std::string>{"knee/qvel"});
  EXPECT_NE(f.what.find("knee/qvel by 2.5 rows"), std::string::npos) << f.what;
}

TEST(Rates, AVelocityThatIsNotZeroAtRestIsNamedWithWhatMendsIt) {
  const auto with = [](double offset, double scale, double scatter = 0) {
    return Check(LogOf([=](double t) {
      const double noise = 0.05 * std::sin(7919 * t), more = scatter * std::sin(97 * t);
      return std::vector<double>{Hip(t), Knee(t) + t, HipRate(t) + offset + noise + more,
                                 scale * (KneeRate(t) + 1) + noise};
    }));
  };
  for (const Finding& f : with(0.25, 1, 1.0)) EXPECT_NE(f.check, "velocity_zero") << "it may be what rows miss";
  for (const Finding& f : with(0, 1.01)) ADD_FAILURE() << f.check << ": " << f.what << ", a wheel's scale is no zero";
  const Finding f = Only(with(0.25, 1), "velocity_zero");
  EXPECT_EQ(f.channels, std::vector<std::string>{"hip/qvel"});
  EXPECT_NE(f.remedy.find("data.offset = { \"hip/qvel\" = -0.2"), std::string::npos) << f.remedy;
  EXPECT_TRUE(f.may_be_parameter);
}

TEST(Rates, APositionThatLagsIsNamedWithItsLagAndTheLineThatSearchesIt) {
  const auto f = Only(Check(LogOf([](double t) {
                        return std::vector<double>{Hip(t), Knee(t - 2.5 * kPeriod), HipRate(t), KneeRate(t)};
                      })),
                      "position_lag");
  EXPECT_EQ(f.channels, std::vector<std::string>{"knee/qpos"});
  EXPECT_NE(f.what.find("knee/qpos by 2.5 rows"), std::string::npos) << f.what;
  EXPECT_NE(f.remedy.find(R"(field = "obs/knee/qpos/delay", range = [0, 5])"), std::string::npos) << f.remedy;
}

TEST(Rates, ALagThatNoiseDrawsBetweenRowsIsOneWhereItExplainsMuch) {
  const auto is_shifted = [](double lag, double gain) {
    RateAgreement rate;
    rate.lag = lag;
    rate.lag_gain = gain;
    return rate.IsShifted();
  };
  EXPECT_TRUE(is_shifted(-0.75, 0.3));
  EXPECT_FALSE(is_shifted(-0.5, 0.3));  // the velocity of a difference
  EXPECT_FALSE(is_shifted(-0.75, 0.9));
}

TEST(Rates, ARecordingOfAnotherRateIsNamedWithItsOwn) {
  Dataset mixed = LogOf(Truth);
  const Dataset slow = LogOf(Truth, 2 * kPeriod);
  for (int i = 300; i < 450; ++i) {
    std::ranges::copy(slow.observations.row(i), mixed.observations.row(i).begin());
    std::ranges::copy(slow.next_observations.row(i), mixed.next_observations.row(i).begin());
  }
  const auto f = Only(Check(mixed), "control_rate");
  EXPECT_NE(f.what.find("the rows of episode 3 are 0.02 s apart, those of the others 0.01 s"), std::string::npos)
      << f.what;
  EXPECT_EQ(f.row, 300);
}

TEST(Rates, AnotherControlRateIsOneFindingWithTheRate) {
  const auto f = Only(Check(LogOf(Truth, 2 * kPeriod)), "control_rate");
  EXPECT_NE(f.what.find("0.02 s apart, not 0.01 s"), std::string::npos) << f.what;
}

TEST(Rates, APeriodThatIsAFewPercentOffIsToldThroughNoiseAndLagAndNoneIsInventedByThem) {
  Rng rng(3);
  const auto with = [&](double period, double knee_rate) {
    const auto row = [=](double t) {
      return std::vector<double>{Hip(t), Knee(t), HipRate(t - 0.004), knee_rate * KneeRate(t)};
    };
    Dataset logs = LogOf(row, period);
    for (const Episode& episode : logs.Episodes()) {
      for (int i = episode.begin; i < episode.end; ++i) {
        for (int c = 0; c < 4; ++c) {
          logs.observations(i, c) += (c < 2 ? 0.001 : 0.05) * rng.Normal();
          if (i > episode.begin) logs.next_observations(i - 1, c) = logs.observations(i, c);
        }
      }
    }
    return Check(logs);
  };
  for (const double times : {0.95, 1.05}) {
    const Finding f = Only(with(times * kPeriod, 1), "control_period");
    double seconds = 0;
    ASSERT_EQ(std::sscanf(f.remedy.c_str(), "set the control period to %lf s", &seconds), 1) << f.remedy;
    EXPECT_NEAR(seconds, times * kPeriod, 0.01 * kPeriod);
  }
  for (const Finding& f : with(kPeriod, 1)) ADD_FAILURE() << f.check << ": " << f.what;
  for (const Finding& f : with(kPeriod, 1.1)) ADD_FAILURE() << f.check << ": one sensor's scale is no period";
}

TEST(Rates, FewRowsToASwingAreNoOtherPeriod) {
  // The trapezoid rule would be 3 % short.
  const auto fast = [](double t) {
    return std::vector<double>{std::sin(60 * t) + t, std::cos(55 * t) - t, 60 * std::cos(60 * t) + 1,
                               -55 * std::sin(55 * t) - 1};
  };
  for (const Finding& f : Check(LogOf(fast))) EXPECT_NE(f.check, "control_period") << f.what;
}

TEST(Rates, AClipThatNoiseSmearsTellsNoRateWhereTheOtherChannelsAreVague) {
  const TaskFacts facts = {.observation_names = {"hip", "knee", "foot", "hip'", "knee'", "foot'"},
                           .rate_of = {-1, -1, -1, 0, 1, 2},
                           .positions = {0, 1, 2},
                           .control_period_s = kPeriod};
  Rng noise(2);
  const auto noisy = [&](double value, double std) { return value + std * noise.Normal(); };
  const auto row = [&](double t) {
    const double foot_rate = noisy(std::clamp(4 * HipRate(t), -4.0, 4.0), 0.02);
    return std::vector<double>{noisy(Hip(t), 0.03), noisy(Knee(t), 0.03), noisy(4 * Hip(t), 0.001),
                               HipRate(t),          KneeRate(t),          foot_rate};
  };
  const std::vector<RateAgreement> rates = CompareRates(LogOf(row), facts.rate_of, kPeriod);
  ASSERT_GT(rates[2].correlation, 0.8);
  ASSERT_GT(rates[2].slope, 1.5 * kPeriod);
  for (const Finding& f : Check(LogOf(row), facts)) EXPECT_NE(f.check, "control_rate") << f.what;
}

TEST(Rates, AWrappedAngleIsToldToBeUnwrappedWithAndWithoutItsVelocity) {
  const auto angle = [](double t) { return std::remainder(9 * t + 0.2 * std::sin(5 * t), 2 * M_PI); };
  const auto rate = [](double t) { return 9 + std::cos(5 * t); };
  const auto with = [&](double t) { return std::vector<double>{angle(t), Knee(t), rate(t), KneeRate(t)}; };
  const auto without = [&](double t) { return std::vector<double>{angle(t), Knee(t)}; };
  const TaskFacts positions = {
      .observation_names = {"hip/qpos", "knee/qpos"}, .positions = {0, 1}, .control_period_s = kPeriod};
  for (const Finding& f :
       {Only(Check(LogOf(with)), "wrapped_angle"), Only(Check(LogOf(without), positions), "wrapped_angle")}) {
    EXPECT_EQ(f.channels, std::vector<std::string>{"hip/qpos"});
    EXPECT_NE(f.remedy.find("unwrap=[\"hip/qpos\"]"), std::string::npos) << f.remedy;
  }
}

TEST(Rates, DegreesThatMoveByATurnOfRadiansInEachRowAreNoWrappedAngle) {
  const TaskFacts positions = {.observation_names = {"hip/qpos"}, .positions = {0}, .control_period_s = kPeriod};
  EXPECT_TRUE(Check(LogOf([](double t) { return std::vector<double>{600 * t + std::sin(3 * t)}; }), positions).empty());
}

TEST(Rates, NoRobotMovesAThousandMetresInATypicalRow) {
  const TaskFacts facts = {.observation_names = {"rail/qpos"}, .positions = {0}, .control_period_s = kPeriod};
  const auto logs = [](double size) {
    return LogOf([=](double t) { return std::vector<double>{size * std::sin(6 * t)}; });
  };
  EXPECT_TRUE(Check(logs(500 / (6 * kPeriod)), facts).empty());
  const Finding f = Only(Check(logs(1e8), facts), kImpossibleMotion);
  EXPECT_EQ(f.severity, Severity::kError);
  EXPECT_NE(f.remedy.find("leave the recording out"), std::string::npos) << f.remedy;
}

TEST(Rates, AnAngleThatGoesARadianInATypicalRowIsHardlyOneInRadians) {
  TaskFacts facts = {.observation_names = {"hip/qpos", "rail/qpos"}, .positions = {0, 1}, .control_period_s = kPeriod};
  const auto logs = [](double unit) {
    return LogOf([=](double t) { return std::vector<double>{unit * std::sin(6 * t), 40 * std::sin(6 * t)}; });
  };
  EXPECT_TRUE(Check(logs(180 / M_PI), facts).empty()) << "what is no angle may go any way";
  facts.radians = {0};
  const Finding f = Only(Check(logs(180 / M_PI), facts), "large_turns");
  EXPECT_EQ(f.channels, std::vector<std::string>{"hip/qpos"});
  EXPECT_NE(f.remedy.find("data.scale = { \"hip/qpos\" = 0.0174533 }"), std::string::npos) << f.remedy;
  EXPECT_TRUE(Check(logs(1), facts).empty());
}

TEST(Frozen, ReadingsThatStandStillWhileTheRobotMovesAreNamed) {
  Dataset d = LogOf(Truth);
  for (int i = 200; i < 209; ++i) {  // ten equal readings of one channel
    d.next_observations(i, 1) = d.observations(i + 1, 1) = d.observations(200, 1);
  }
  const auto f = Only(Check(d), "frozen_channels");
  EXPECT_EQ(f.channels, std::vector<std::string>{"knee/qpos"});
  EXPECT_EQ(f.row, 200);
}

TEST(Spikes, AReadingThatIsOffForOneRowIsNamedAndAJumpIsNone) {
  Dataset d = LogOf(Truth);
  d.next_observations(199, 1) = d.observations(200, 1) = d.observations(200, 1) + 3;
  const auto f = Only(Check(d), "spikes");
  EXPECT_EQ(f.channels, std::vector<std::string>{"knee/qpos"});
  EXPECT_EQ(f.row, 200);
  EXPECT_EQ(f.count, 1);
  Dataset jump = LogOf(Truth);
  for (int i = 200; i < jump.size(); ++i) {
    jump.observations(i, 1) += 3;
    jump.next_observations(i, 1) += 3;
  }
  jump.next_observations(199, 1) += 3;
  for (const Finding& finding : Check(jump)) EXPECT_NE(finding.check, "spikes");
}

TEST(Frozen, AReadingThatStandsWhileItsJointTurnsBackIsNamedThoughItDoesNotJump) {
  Dataset d = LogOf(Truth);
  int top = 20;  // of the knee, in the first episode
  while (KneeRate(top * kPeriod) * KneeRate((top + 1) * kPeriod) > 0) ++top;
  for (int i = top - 7; i < top + 7; ++i) {
    d.next_observations(i, 1) = d.observations(i + 1, 1) = d.observations(top - 7, 1);
  }
  const double jump = std::abs(d.observations(top + 8, 1) - d.observations(top + 7, 1));
  EXPECT_LT(jump, 0.02) << "not by its jump";
  const auto f = Only(Check(d), "frozen_channels");
  EXPECT_EQ(f.channels, std::vector<std::string>{"knee/qpos"});
}

TEST(Frozen, ARobotAtRestAndACoarseEncoderAreNotFrozen) {
  const auto grid = [](double v) { return std::round(v * 1000) / 1000; };
  // It comes to rest smoothly, stays, and starts smoothly.
  const auto still = [&](double t) {
    const double u = std::fmod(t, 7.0);
    const double ease = u < 0.5 ? u : u < 1.0 ? 0.5 : u - 0.5;
    const double s = std::sin(M_PI * ease), c = u < 0.5 || u >= 1.0 ? M_PI * std::cos(M_PI * ease) : 0.0;
    return std::vector<double>{grid(0.2 * s), Knee(t), grid(0.2 * c), KneeRate(t)};
  };
  for (const Finding& f : Check(LogOf(still))) EXPECT_NE(f.check, "frozen_channels") << f.what;
}

TEST(Frozen, AJointAtRestThatIsHitIsNotFrozen) {
  const double at = 0.7;
  const auto hit = [&](double t) {
    const double since = std::max(0.0, std::fmod(t, 7.0) - at);
    const double rate = since > 0 ? 6 * std::exp(-5 * since) : 0, angle = 1.2 * (1 - std::exp(-5 * since));
    return std::vector<double>{Hip(t), angle, HipRate(t), rate};
  };
  EXPECT_TRUE(Check(LogOf(hit)).empty());
  // Positions alone, with rates that are differences of theirs: what a hung reading missed comes in one row.
  Dataset d = LogOf([&](double t) {
    return std::vector<double>{Hip(t), Knee(t), HipRate(t), (Knee(t) - Knee(t - kPeriod)) / kPeriod};
  });
  for (int i = 200; i < 209; ++i) d.next_observations(i, 1) = d.observations(i + 1, 1) = d.observations(200, 1);
  for (int i = 200; i < 210; ++i) {
    const double rate = (d.next_observations(i, 1) - d.observations(i, 1)) / kPeriod;
    d.next_observations(i, 3) = d.observations(i + 1, 3) = rate;
  }
  const auto f = Only(Check(d), "frozen_channels");
  EXPECT_EQ(f.channels.front(), "knee/qpos");
}

using Eigen::AngleAxisd, Eigen::Quaterniond, Eigen::Vector3d;

/// A body that tumbles: yaw, then pitch, with angular velocity and path known in closed form.
struct Tumble {
  Quaterniond q;
  Vector3d turn, position, velocity;  // about the body's axes; in the world
};
Tumble TumbleAt(double t) {
  const double yaw = 2 * t, pitch = 0.9 * std::sin(3 * t), pitch_rate = 2.7 * std::cos(3 * t);
  const Quaterniond to_pitch(AngleAxisd(pitch, Vector3d::UnitY()));
  return {AngleAxisd(yaw, Vector3d::UnitZ()) * to_pitch,
          to_pitch.conjugate() * Vector3d(0, 0, 2) + Vector3d(0, pitch_rate, 0),
          {std::sin(4 * t), std::cos(3 * t), 0.5 * std::sin(5 * t)},
          {4 * std::cos(4 * t), -3 * std::sin(3 * t), 2.5 * std::cos(5 * t)}};
}

const TaskFacts kBody = {
    .observation_names = {"x", "y", "z", "w", "i", "j", "k", "vx", "vy", "vz", "p", "q", "r"},
    .rate_of = {-1, -1, -1, -1, -1, -1, -1, 0, 1, 2, -1, -1, -1},
    .bodies = {{.orientation = {3, 4, 5, 6}, .turn = {10, 11, 12}, .position = {0, 1, 2}, .velocity = {7, 8, 9}}},
    .control_period_s = kPeriod};

std::vector<double> BodyRow(const Tumble& b, const Vector3d& velocity, const Vector3d& turn, bool scalar_last) {
  std::vector<double> row = {b.position[0], b.position[1], b.position[2], b.q.w(), b.q.x(), b.q.y(), b.q.z()};
  if (scalar_last) row = {b.position[0], b.position[1], b.position[2], b.q.x(), b.q.y(), b.q.z(), b.q.w()};
  for (int k = 0; k < 3; ++k) row.push_back(velocity[k]);
  for (int k = 0; k < 3; ++k) row.push_back(turn[k]);
  return row;
}

TEST(Turning, MuJoCosOwnConventionsRaiseNoWarning) {
  const auto row = [](double t) { return BodyRow(TumbleAt(t), TumbleAt(t).velocity, TumbleAt(t).turn, false); };
  for (const Finding& f : Check(LogOf(row), kBody)) ADD_FAILURE() << f.check << ": " << f.what;
}

TEST(Turning, AScalarThatComesLastIsNamed) {
  const auto row = [](double t) { return BodyRow(TumbleAt(t), TumbleAt(t).velocity, TumbleAt(t).turn, true); };
  EXPECT_EQ(Only(Check(LogOf(row), kBody), "quaternion_order").channels,
            (std::vector<std::string>{"w", "i", "j", "k"}));
}

TEST(Turning, AQuaternionWhoseSignsChangeIsNamedWithTheFirstRow) {
  const auto row = [](double t) {
    Tumble b = TumbleAt(t);
    if (t > 0.755 && t < 7) b.q.coeffs() *= -1;
    return BodyRow(b, b.velocity, b.turn, false);
  };
  const Finding f = Only(Check(LogOf(row), kBody), "quaternion_sign");
  EXPECT_EQ(f.count, 1);
  EXPECT_EQ(f.row, 75);
}

TEST(Turning, FramesOfVelocitiesAreNamed) {
  const auto linear = [](double t) {
    const Tumble b = TumbleAt(t);
    return BodyRow(b, b.q.conjugate() * b.velocity, b.turn, false);
  };
  EXPECT_EQ(Only(Check(LogOf(linear), kBody), "velocity_frame").channels, (std::vector<std::string>{"vx", "vy", "vz"}));
  const auto angular = [](double t) {
    const Tumble b = TumbleAt(t);
    return BodyRow(b, b.velocity, b.q * b.turn, false);
  };
  EXPECT_EQ(Only(Check(LogOf(angular), kBody), "turn_frame").channels, (std::vector<std::string>{"p", "q", "r"}));
}

TEST(Copies, ACommandThatStandsAsThePositionIsNamed) {
  TaskFacts facts = kFacts;
  facts.action_names = {"motor"};
  Dataset d = LogOf(Truth);
  for (int i = 0; i < d.size(); ++i) d.actions(i, 0) = 2 * d.next_observations(i, 1) - 1;  // a LeRobot's "action"
  const auto f = Only(Check(d, facts), "copied_channels");
  EXPECT_EQ(f.channels, (std::vector<std::string>{"knee/qpos", "motor"}));
  EXPECT_NE(f.what.find("the next row"), std::string::npos) << f.what;
  // A servo that follows its command well, but not without any error.
  for (int i = 0; i < d.size(); ++i) d.actions(i, 0) = d.next_observations(i, 1) + 1e-3 * d.next_observations(i, 3);
  for (const Finding& g : Check(d, facts)) ADD_FAILURE() << g.check << ": " << g.what;
}

TEST(MissingRows, RowsThatWereLostAreFoundWhereTheRobotMoves) {
  // Every fiftieth row is not there, and the times do not tell.
  Dataset d;
  for (int e = 0; e < 3; ++e) {
    for (int i = 0, k = 0; i < 150; ++i) {
      const double t = 7 * e + k * kPeriod;
      k += i % 50 == 20 ? 2 : 1;
      d.observations.AppendRow(Truth(t));
      d.next_observations.AppendRow(Truth(7 * e + k * kPeriod));
      d.actions.AppendRow(std::vector<double>{std::sin(9 * t)});
      d.terminals.push_back(0);
      d.timeouts.push_back(i == 149);
    }
  }
  const auto f = Only(Check(d), "missing_rows");
  EXPECT_GE(f.count, 3);
  EXPECT_LE(f.count, 9);
  EXPECT_EQ(f.row % 50, 20);
}

}  // namespace oted::checks_rates_test
