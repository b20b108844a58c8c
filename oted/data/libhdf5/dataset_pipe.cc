#include "oted/data/libhdf5/dataset_pipe.h"

#include <fmt/format.h>

#include <filesystem>
#include <limits>

#include "oted/base/error.h"
#include "oted/data/child_process.h"
#include "oted/data/libhdf5/handles.h"

namespace oted {
namespace {

constexpr uint64_t kMaxNumbers = 1 << 20;
constexpr uint64_t kMaxTexts = 1 << 20;

/// The parts of a dataset in the order in which they are sent: the same list for both ends.
template <class Pipe, class D>
void EachPart(Pipe& pipe, D& dataset) {
  pipe.Matrix(dataset.observations);
  pipe.Matrix(dataset.actions);
  pipe.Matrix(dataset.next_observations);
  pipe.Matrix(dataset.qpos);
  pipe.Matrix(dataset.qvel);
  pipe.Vector(dataset.rewards);
  pipe.Vector(dataset.terminals);
  pipe.Vector(dataset.timeouts);
  pipe.Texts(dataset.observation_names);
  pipe.Texts(dataset.action_names);
  pipe.Texts(dataset.remarks);
  pipe.Texts(dataset.warnings);
}

class Sender {
 public:
  explicit Sender(ChildOutput& out) : out_(out) {}
  void Matrix(const Array2<double>& m) {
    Number(static_cast<uint64_t>(m.rows()));
    Number(static_cast<uint64_t>(m.cols()));
    out_.Write(m.data(), m.values().size_bytes());
  }
  template <class T>
  void Vector(const std::vector<T>& v) {
    Number(v.size());
    out_.Write(v.data(), v.size() * sizeof(T));
  }
  void Texts(const std::vector<std::string>& texts) {
    Number(texts.size());
    for (const std::string& text : texts) {
      Number(text.size());
      out_.Write(text.data(), text.size());
    }
  }

 private:
  void Number(uint64_t value) { out_.Write(&value, sizeof(value)); }
  ChildOutput& out_;
};

class Receiver {
 public:
  Receiver(ChildProcess& child, const std::string& file, uint64_t budget)
      : child_(child), file_(file), budget_(budget) {}
  void Matrix(Array2<double>& m) {
    const uint64_t rows = Number(std::numeric_limits<int>::max());
    const uint64_t cols = Number(kMaxNumbers);
    if (cols > 0) Take(rows, cols * sizeof(double));
    m = Array2<double>(static_cast<int>(rows), static_cast<int>(cols));
    child_.Read(m.data(), m.values().size_bytes());
  }
  template <class T>
  void Vector(std::vector<T>& v) {
    const uint64_t size = Number(std::numeric_limits<int>::max());
    Take(size, sizeof(T));
    v.resize(size);
    child_.Read(v.data(), size * sizeof(T));
  }
  void Texts(std::vector<std::string>& texts) {
    const uint64_t n = Number(kMaxTexts);
    Take(n, sizeof(std::string));
    texts.resize(n);
    for (std::string& text : texts) {
      const uint64_t size = Number(kMaxTexts);
      Take(size, 1);
      text.resize(size);
      child_.Read(text.data(), size);
    }
  }

 private:
  uint64_t Number(uint64_t most) {
    uint64_t value = 0;
    child_.Read(&value, sizeof(value));
    if (value > most) Fail();
    return value;
  }
  void Take(uint64_t n, uint64_t bytes_each) {
    if (n > budget_ / bytes_each) Fail();
    budget_ -= n * bytes_each;
  }
  [[noreturn]] void Fail() const {
    throw DataError(fmt::format(
        "'{}': the process that read it gave back nonsense; the file is damaged: download or write it again", file_));
  }
  ChildProcess& child_;
  const std::string& file_;
  uint64_t budget_;
};

}  // namespace

Dataset ReadInChild(const std::string& file, const ChildLimits& limits, const std::function<Dataset()>& read) {
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(file, error);
  if (error) throw DataError(fmt::format("cannot read '{}': {}; check the path", file, error.message()));
  const ChildLimits grown = LimitsFor(bytes, limits);
  ChildProcess child(file, grown, Hdf5Mutex(), [&](ChildOutput& out) {
    const Dataset dataset = read();
    Sender sender(out);
    EachPart(sender, dataset);
  });
  Dataset dataset;
  Receiver receiver(child, file, grown.memory_bytes);
  EachPart(receiver, dataset);
  return dataset;
}

}  // namespace oted
