#include "oted/baselines/domain_randomization.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/testing.h"
#include "oted/rl/sac.h"
#include "oted/sim/testing.h"

namespace oted::domain_randomization_test {

/// The largest distance between the samples' distribution function and the uniform one, times sqrt(n): above 1.95 in
/// one of a thousand uniform samples (Kolmogorov).
double KolmogorovStatistic(std::vector<double> u) {
  std::sort(u.begin(), u.end());
  double distance = 0;
  const double n = static_cast<double>(u.size());
  for (size_t i = 0; i < u.size(); ++i) {
    distance = std::max({distance, u[i] - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - u[i]});
  }
  return distance * std::sqrt(n);
}

TEST(DomainRandomization, DrawsAreUniformOverTheRangesAndOfALogarithmicOneInItsLogarithm) {
  const ParameterSpace space({{.name = "gain", .field = "env/gain", .low = 0.2, .high = 2.0},
                              {.name = "mass", .field = "env/mass", .low = 0.1, .high = 10.0, .logarithmic = true}});
  const EpisodeParameters draw = DrawUniformly(space);
  Rng rng = RngKey(3).MakeRng();
  std::vector<double> gain, mass, product;
  double covariance = 0;
  constexpr int kDraws = 4000;
  for (int k = 0; k < kDraws; ++k) {
    const std::vector<double> z = draw(rng);
    gain.push_back((z[0] - 0.2) / 1.8);
    mass.push_back((std::log10(z[1]) + 1) / 2);
    covariance += (gain.back() - 0.5) * (mass.back() - 0.5) / kDraws;
  }
  EXPECT_LT(KolmogorovStatistic(gain), 1.95);
  EXPECT_LT(KolmogorovStatistic(mass), 1.95);
  EXPECT_NEAR(covariance, 0, 5.0 / 12 / std::sqrt(kDraws)) << "parameters are drawn independently";
}

/// Remembers the gains of the episodes that a simulator of two lanes began.
class Recording : public PointMass {
 public:
  Recording(int n_lanes, std::vector<double>* gains)
      : PointMass({.max_episode_steps = 4}, n_lanes, 1), gains_(n_lanes == 2 ? gains : nullptr) {}
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, z);
    if (gains_ != nullptr) gains_->push_back(z[0]);
  }

 private:
  std::vector<double>* gains_;
};

class RecordingFactory : public PointMassFactory {
 public:
  explicit RecordingFactory(std::vector<double>* gains) : gains_(gains) {}
  std::unique_ptr<Simulator> Make(int n_lanes, int) const override {
    return std::make_unique<Recording>(n_lanes, gains_);
  }

 private:
  std::vector<double>* gains_;
};

TEST(DomainRandomization, EveryTrainingEpisodeHasADrawOfItsOwn) {
  std::vector<double> gains;
  const TestFolder folder;
  NullSink log;
  const RecordingFactory factory(&gains);
  SacConfig config;
  config.n_steps = config.learning_starts = config.eval_interval = 4000;
  config.n_lanes = 2;
  config.hidden = {4};
  config.eval_episodes = 1;
  DrawnEpisodes source(DrawUniformly(factory.parameters()));
  TrainAgent({.factory = factory,
              .source = source,
              .eval_parameters = UniformDraws(factory.parameters(), 1, RngKey(1)),
              .key = RngKey(5),
              .folder = folder.path(),
              .run_name = "baselines/dr/1",
              .context = {.log = &log, .n_threads = 1}},
             config);
  ASSERT_GE(gains.size(), 1000u);
  for (double& gain : gains) gain = (gain - 0.2) / 1.8;
  EXPECT_LT(KolmogorovStatistic(gains), 1.95);
  std::sort(gains.begin(), gains.end());
  EXPECT_EQ(std::adjacent_find(gains.begin(), gains.end()), gains.end());
}

}  // namespace oted::domain_randomization_test
