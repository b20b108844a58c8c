// One family of readers under libFuzzer, for scripts/fuzz.py. The environment names it, as libFuzzer has the arguments:
//
//   OTED_FUZZ_FAMILY  name of a family; "list" prints them all
//   OTED_FUZZ_WORK    folder for the files that are read
//   OTED_FUZZ_SEEDS   folder that gets the family's seeds
//   OTED_FUZZ_HERE    set: what the program reads in a child process is read in this one

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <random>
#include <stdexcept>

#include "oted/base/files.h"
#include "oted/data/child_process.h"
#include "tests/fuzz/families.h"

extern "C" size_t LLVMFuzzerMutate(uint8_t* bytes, size_t size, size_t most);

// The sanitizer's own ends the process where memory is out. The program expects std::bad_alloc, and so do limits.
void* operator new(size_t size) {
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new[](size_t size) { return operator new(size); }
void* operator new(size_t size, std::align_val_t alignment) {
  void* memory = nullptr;
  if (::posix_memalign(&memory, static_cast<size_t>(alignment), size) == 0) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, size_t, std::align_val_t) noexcept { std::free(memory); }

// Where clang has put a counter for each edge of the program's own code. The linker leads its call here (--wrap); it
// comes before any constructor.
static uint8_t* g_counters = nullptr;
static uint8_t* g_counters_end = nullptr;
extern "C" void __real___sanitizer_cov_8bit_counters_init(uint8_t* begin, uint8_t* end);
extern "C" void __wrap___sanitizer_cov_8bit_counters_init(uint8_t* begin, uint8_t* end) {
  g_counters = begin;
  g_counters_end = end;
  __real___sanitizer_cov_8bit_counters_init(begin, end);
}

namespace oted {
namespace {

namespace fs = std::filesystem;

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  if (value == nullptr) throw std::runtime_error(fmt::format("{} is not set; run scripts/fuzz.py", name));
  return value;
}

/// HDF5 is read in a forked child: its counters are this process's, too.
void ShareCountersWithChildren() {
  const uintptr_t page = static_cast<uintptr_t>(::sysconf(_SC_PAGESIZE));
  const uintptr_t begin = (reinterpret_cast<uintptr_t>(g_counters) + page - 1) / page * page;
  const uintptr_t end = reinterpret_cast<uintptr_t>(g_counters_end) / page * page;
  if (end <= begin) return;
  void* at = reinterpret_cast<void*>(begin);
  if (::mmap(at, end - begin, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_FIXED, -1, 0) != at) {
    throw std::runtime_error("the counters cannot be shared");
  }
}

struct Target {
  fs::path folder;
  FuzzFamily family;
};

Target MakeTarget() {
  Target target{Environment("OTED_FUZZ_WORK"), {}};
  const std::string name = Environment("OTED_FUZZ_FAMILY");
  for (FuzzFamily& family : FuzzFamilies(target.folder)) {
    if (name == "list") std::puts(family.name.c_str());
    if (family.name == name) target.family = std::move(family);
  }
  if (target.family.name.empty()) std::exit(name == "list" ? 0 : 2);
  const fs::path seeds = Environment("OTED_FUZZ_SEEDS");
  fs::create_directories(seeds);
  for (size_t i = 0; i < target.family.seeds.size(); ++i) {
    WriteFileAtomically(seeds / fmt::format("seed-{}", i), target.family.seeds[i]);
  }
  if (std::getenv("OTED_FUZZ_HERE") != nullptr) ChildProcess::WorkHere();
  ShareCountersWithChildren();
  return target;
}

const Target& The() {
  static const Target target = MakeTarget();
  return target;
}

std::string MutatedByLibFuzzer(const std::string& bytes, size_t most) {
  std::string mutant = bytes;
  mutant.resize(std::max(most, bytes.size() + 1));
  const size_t size = LLVMFuzzerMutate(reinterpret_cast<uint8_t*>(mutant.data()), bytes.size(), mutant.size());
  mutant.resize(size);
  return mutant;
}

}  // namespace
}  // namespace oted

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  oted::The();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  const oted::Target& target = oted::The();
  const std::string input(reinterpret_cast<const char*>(bytes), size);
  for (const oted::FuzzReader& reader : target.family.readers) {
    const oted::FuzzResult result = oted::ReadBytes(reader, target.folder, input);
    if (result.outcome != oted::FuzzOutcome::kFailed) continue;
    fmt::print(stderr, "{}: {}\n", reader.file, result.message);
    std::abort();
  }
  return 0;
}

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* bytes, size_t size, size_t most, unsigned seed) {
  const oted::FuzzFamily& family = oted::The().family;
  std::minstd_rand random(seed);
  if (family.mutate_inside && random() % 4 != 0) {
    try {
      const std::string mutant =
          family.mutate_inside(std::string(reinterpret_cast<const char*>(bytes), size), random(),
                               [&](const std::string& inside) { return oted::MutatedByLibFuzzer(inside, 4096); });
      if (mutant.size() <= most) {
        std::memcpy(bytes, mutant.data(), mutant.size());
        return mutant.size();
      }
    } catch (const std::exception&) {  // not whole: changed like any bytes
    }
  }
  return LLVMFuzzerMutate(bytes, size, most);
}
