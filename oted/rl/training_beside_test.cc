/// What runs beside what while an agent trains: lanes and gradient steps, evaluations and the next segment. None of it
/// may show in a result.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/rl/replay_training.h"
#include "oted/sim/testing.h"

namespace oted::training_beside_test {

const std::vector<double> kNominal = {1, 1, 0};
constexpr int kEvalEpisodes = 5;  // lanes of an evaluation: no training here has as many

/// Something that one thread waits for and another brings about.
class Event {
 public:
  void Happen() {
    const std::lock_guard lock(mutex_);
    happened_ = true;
    changed_.notify_all();
  }
  /// Whether it happened. Gives up after a time in which any machine gets there.
  bool Wait() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(30), [&] { return happened_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool happened_ = false;
};

/// Point masses that tell of every step before they make it.
class WatchedFactory : public PointMassFactory {
 public:
  using BeforeStep = std::function<void(int n_lanes)>;
  explicit WatchedFactory(BeforeStep before_step) : before_step_(std::move(before_step)) {}
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Watched>(before_step_, n_lanes, n_threads);
  }

 private:
  class Watched : public PointMass {
   public:
    Watched(const BeforeStep& before_step, int n_lanes, int n_threads)
        : PointMass({}, n_lanes, n_threads), before_step_(before_step) {}
    void Step(std::span<const int> lanes, std::span<const double> actions) override {
      before_step_(n_lanes());
      PointMass::Step(lanes, actions);
    }

   private:
    const BeforeStep& before_step_;
  };
  BeforeStep before_step_;
};

/// A learner that learns nothing and tells of every gradient step.
class WatchedUpdate : public ReplayUpdate {
 public:
  WatchedUpdate(TanhGaussianPolicy actor, std::function<void()> on_step)
      : actor_(std::move(actor)), on_step_(std::move(on_step)) {}
  ReplayLosses Step(const TransitionBatch&) override {
    on_step_();
    return {};
  }
  const TanhGaussianPolicy& actor() const override { return actor_; }
  void Save(NpzArrays&) override {}
  void Restore(const NpzArrays&) override {}

 private:
  TanhGaussianPolicy actor_;
  std::function<void()> on_step_;
};

struct WatchedTraining {
  int n_lanes = 1, n_threads = 1;
  int64_t n_steps = 40, eval_interval = 40;
  WatchedFactory::BeforeStep before_step = {};
  std::function<void()> on_update = [] {};

  void operator()() const {
    const TestFolder folder;
    ReplayConfig config;
    config.n_steps = n_steps;
    config.n_lanes = n_lanes;
    config.updates_per_step = 1.0 / n_lanes;
    config.learning_starts = 10;
    config.batch_size = 4;
    config.hidden = {4};
    config.eval_interval = eval_interval;
    config.eval_episodes = kEvalEpisodes;
    NullSink log;
    DrawnEpisodes source([](Rng&) { return kNominal; });
    const auto make = [&](TanhGaussianPolicy actor, Rng& rng) {
      actor.net().Initialize(rng);
      return std::make_unique<WatchedUpdate>(std::move(actor), on_update);
    };
    TrainByReplay({.factory = WatchedFactory(before_step),
                   .source = source,
                   .eval_parameters = {kNominal},
                   .key = RngKey(3),
                   .folder = folder.path(),
                   .run_name = "agent",
                   .context = {&log, nullptr, n_threads}},
                  config, "watched", make);
  }
};

TEST(TrainByReplay, SeveralLanesStepWhileTheLearnerLearns) {
  Event stepping, learning;
  std::atomic<int> n_steps = 0, n_updates = 0;
  bool met_in_step = false, met_in_update = false;
  WatchedTraining train{.n_lanes = 2, .n_threads = 2};
  // The fifth step ends the random play and owes the first gradient step: it runs beside the sixth.
  train.before_step = [&](int n_lanes) {
    if (n_lanes == kEvalEpisodes || ++n_steps != 6) return;
    stepping.Happen();
    met_in_step = learning.Wait();
  };
  train.on_update = [&] {
    if (++n_updates != 1) return;
    learning.Happen();
    met_in_update = stepping.Wait();
  };
  train();
  EXPECT_TRUE(met_in_step && met_in_update);
  EXPECT_EQ(n_steps, 20);
  EXPECT_EQ(n_updates, 16) << "from the step on that ends the random play, all that is owed";
}

TEST(TrainByReplay, OneLaneAndItsLearnerTakeTurns) {
  std::string turns;
  WatchedTraining train{.n_lanes = 1, .n_threads = 2};
  train.before_step = [&](int n_lanes) {
    if (n_lanes == 1) turns += 's';
  };
  train.on_update = [&] { turns += 'u'; };
  train();
  std::string expected(9, 's');
  for (int step = 10; step <= 40; ++step) expected += "su";
  EXPECT_EQ(turns, expected);
}

TEST(TrainInSegments, TheNextSegmentDoesNotWaitForTheEvaluation) {
  Event next_segment;
  std::atomic<int> n_steps = 0, n_evaluation_steps = 0;
  bool met = false;
  WatchedTraining train{.n_lanes = 1, .n_threads = 2, .n_steps = 80, .eval_interval = 40};
  train.before_step = [&](int n_lanes) {
    if (n_lanes == kEvalEpisodes) {
      if (++n_evaluation_steps == 1) met = next_segment.Wait();
    } else if (++n_steps == 41) {
      next_segment.Happen();
    }
  };
  train();
  EXPECT_TRUE(met);
}

TEST(TrainInSegments, AnEvaluationThatFailsEndsTheTraining) {
  for (const int n_threads : {1, 2}) {
    WatchedTraining train{.n_lanes = 1, .n_threads = n_threads};
    train.before_step = [&](int n_lanes) {
      if (n_lanes == kEvalEpisodes) throw DataError("the simulator is gone");
    };
    EXPECT_THAT(MessageOf<DataError>(train), testing::HasSubstr("the simulator is gone"));
  }
}

}  // namespace oted::training_beside_test
