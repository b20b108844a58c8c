#include "oted/data/child_process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <thread>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::child_process_test {

using testing::AllOf;
using testing::HasSubstr;

std::mutex& Lock() {
  static std::mutex mutex;
  return mutex;
}

std::string RunChildWork(const std::function<void(ChildOutput&)>& work, size_t size, ChildLimits limits = {}) {
  ChildProcess child("some.hdf5", limits, Lock(), work);
  std::string bytes(size, '\0');
  child.Read(bytes.data(), size);
  return bytes;
}

std::string Failure(const std::function<void(ChildOutput&)>& work, ChildLimits limits = {}) {
  return MessageOf<DataError>([&] { RunChildWork(work, 1, limits); });
}

TEST(ChildProcess, GivesBackWhatTheChildWrote) {
  std::string much(3 << 20, 'x');
  much[12345] = 'y';
  EXPECT_EQ(RunChildWork([&](ChildOutput& out) { out.Write(much.data(), much.size()); }, much.size()), much);
}

TEST(ChildProcess, ErrorsKeepTheirKindAndText) {
  EXPECT_EQ(Failure([](ChildOutput&) { throw DataError("'a': no rows"); }), "'a': no rows");
  EXPECT_THROW(RunChildWork([](ChildOutput&) { throw UsageError("wrong"); }, 1), UsageError);
  EXPECT_THROW(RunChildWork([](ChildOutput&) { OTED_CHECK(1 == 2); }, 1), InternalError);
}

TEST(ChildProcess, ACrashIsADataErrorThatNamesTheFile) {
  const std::string message = Failure([](ChildOutput&) { ::raise(SIGKILL); });
  EXPECT_THAT(message, AllOf(HasSubstr("'some.hdf5'"), HasSubstr("crashed (signal 9)"), HasSubstr("download")));
  EXPECT_THAT(Failure([](ChildOutput&) { ::_exit(7); }), HasSubstr("exit status 7"));
  // Also in the middle of its result.
  EXPECT_THAT(MessageOf<DataError>([] {
                RunChildWork(
                    [](ChildOutput& out) {
                      out.Write("abc", 3);
                      ::raise(SIGKILL);
                    },
                    100);
              }),
              HasSubstr("crashed"));
}

TEST(ChildProcess, AChildThatHangsOrSpinsIsStopped) {
  ChildLimits limits;
  limits.wall_s = 1;
  EXPECT_THAT(Failure([](ChildOutput&) { ::pause(); }, limits), HasSubstr("took more than 1 s;"));
  limits.wall_s = 60;
  limits.cpu_s = 1;
  EXPECT_THAT(Failure(
                  [](ChildOutput&) {
                    volatile bool spin = true;
                    while (spin) {
                    }
                  },
                  limits),
              HasSubstr("more than 1 s of processor time"));
}

TEST(ChildProcess, AChildThatWaitsForAPipeWithoutAWriterIsStoppedLongBeforeItsTime) {
  const TestFolder folder;
  const std::string pipe = (folder.path() / "pipe").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  ChildLimits limits;
  limits.wall_s = 3600;
  EXPECT_THAT(Failure([&](ChildOutput&) { ::open(pipe.c_str(), O_RDONLY); }, limits),
              AllOf(HasSubstr("'some.hdf5'"), HasSubstr("waits for what does not come")));
}

TEST(ChildProcess, MemoryBeyondTheLimitIsADataError) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "AddressSanitizer needs the address space";
#endif
  ChildLimits limits;
  limits.memory_bytes = 64 << 20;
  const auto take = [](size_t bytes) {
    return [bytes](ChildOutput& out) {
      const std::vector<char> memory(bytes, 'x');
      out.Write(&memory[bytes / 2], 1);
    };
  };
  EXPECT_EQ(RunChildWork(take(32 << 20), 1, limits), "x");
  EXPECT_THAT(Failure(take(128 << 20), limits),
              AllOf(HasSubstr("'some.hdf5'"), HasSubstr("more than 64 MiB of memory")));
}

TEST(ChildProcess, LeavesNoCoreAndNoZombie) {
  const std::string cores = RunChildWork(
      [](ChildOutput& out) {
        rlimit limit{};
        ::getrlimit(RLIMIT_CORE, &limit);
        const char none = limit.rlim_cur == 0 ? 'y' : 'n';
        out.Write(&none, 1);
      },
      1);
  EXPECT_EQ(cores, "y");
  Failure([](ChildOutput&) { ::raise(SIGKILL); });
  errno = 0;
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
  EXPECT_EQ(errno, ECHILD);
}

TEST(ChildProcess, WorksFromThreadsThatAllocateAndThrow) {
  std::vector<int> right(4, 0);
  {
    std::vector<std::jthread> threads;
    for (size_t t = 0; t < right.size(); ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 20; ++i) {
          const std::string sent(1000 + t, static_cast<char>('a' + t));
          right[t] += RunChildWork([&](ChildOutput& out) { out.Write(sent.data(), sent.size()); }, sent.size()) == sent;
          try {
            RunChildWork([](ChildOutput&) { throw DataError("no"); }, 1);
          } catch (const DataError& e) {
            right[t] += std::string(e.what()) == "no";
          }
        }
      });
    }
  }
  EXPECT_EQ(right, std::vector<int>(4, 40));
}

TEST(ChildProcess, LimitsGrowWithTheFile) {
  const ChildLimits small = LimitsFor(1000), large = LimitsFor(uint64_t{500} << 20);
  EXPECT_EQ(small.cpu_s, 10);
  EXPECT_EQ(small.memory_bytes, uint64_t{1} << 30);
  EXPECT_EQ(large.cpu_s, 510);
  EXPECT_EQ(large.wall_s, 1560);
  EXPECT_EQ(large.memory_bytes, (uint64_t{1} << 30) + (uint64_t{16000} << 20));
}

}  // namespace oted::child_process_test
