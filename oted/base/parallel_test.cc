#include "oted/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace oted::parallel_test {

TEST(ParallelFor, CallsEveryIndexOnceAtAnyThreadCount) {
  for (const int n : {0, 1, 2, 7, 1000}) {
    for (const int threads : {0, 1, 2, 8, 64}) {
      std::vector<std::atomic<int>> calls(static_cast<size_t>(n));
      ParallelFor(n, threads, [&](int i) { ++calls[static_cast<size_t>(i)]; });
      for (const auto& count : calls) EXPECT_EQ(count, 1) << n << " on " << threads;
    }
  }
}

TEST(ParallelFor, RunsIndicesSideBySide) {
  // Each call waits for the other: with one thread alone this would never end.
  std::latch both(2);
  ParallelFor(2, 2, [&](int) { both.arrive_and_wait(); });
}

TEST(ParallelFor, OneThreadIsTheCallersInOrder) {
  std::vector<int> order;
  const std::thread::id caller = std::this_thread::get_id();
  ParallelFor(5, 1, [&](int i) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(i);
  });
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

TEST(ParallelFor, RethrowsTheExceptionOfTheLowestFailingIndex) {
  // Both fail for sure: each waits until the other has been started.
  for (int trial = 0; trial < 20; ++trial) {
    std::latch both(2);
    try {
      ParallelFor(2, 2, [&](int i) {
        both.arrive_and_wait();
        throw std::runtime_error(std::to_string(i));
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "0");
    }
  }
}

TEST(ParallelFor, StartsNothingNewAfterAFailure) {
  int calls = 0;
  EXPECT_THROW(ParallelFor(100, 1,
                           [&](int i) {
                             ++calls;
                             if (i == 3) throw std::runtime_error("three");
                           }),
               std::runtime_error);
  EXPECT_EQ(calls, 4);
}

TEST(AvailableThreads, IsAtLeastOne) { EXPECT_GE(AvailableThreads(), 1); }

}  // namespace oted::parallel_test
