#include "oted/report/tensorboard.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <protozero/pbf_writer.hpp>

namespace oted {
namespace {

constexpr std::array<uint32_t, 256> MakeTable() {
  std::array<uint32_t, 256> table{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0x82F63B78u : 0u);
    table[i] = crc;
  }
  return table;
}
constexpr std::array<uint32_t, 256> kTable = MakeTable();

// TFRecord stores checksums rotated and shifted by a constant, so that a checksum of data that holds checksums is
// sound.
uint32_t MaskedCrc32c(std::string_view bytes) {
  const uint32_t crc = Crc32c(bytes);
  return ((crc >> 15) | (crc << 17)) + 0xa282ead8u;
}

template <class T>
void AppendLittleEndian(T value, std::string* out) {
  for (size_t i = 0; i < sizeof(T); ++i) out->push_back(static_cast<char>((value >> (8 * i)) & 0xff));
}

double WallTime() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

std::string HostName() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0 || name[0] == '\0') return "localhost";
  return name.data();
}

}  // namespace

uint32_t Crc32c(std::string_view bytes) {
  uint32_t crc = ~0u;
  for (const char byte : bytes) crc = (crc >> 8) ^ kTable[(crc ^ static_cast<unsigned char>(byte)) & 0xff];
  return ~crc;
}

std::string TfRecord(std::string_view data) {
  std::string record;
  record.reserve(data.size() + 16);
  AppendLittleEndian<uint64_t>(data.size(), &record);
  AppendLittleEndian(MaskedCrc32c(record), &record);
  record.append(data);
  AppendLittleEndian(MaskedCrc32c(data), &record);
  return record;
}

EventFileWriter::EventFileWriter(const std::filesystem::path& folder) {
  // Readers order the files of a folder by name: the time comes first. The counter keeps names of one second apart.
  static std::atomic<int> counter{0};
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  path_ = folder / fmt::format("events.out.tfevents.{}.{}.{}.{}", static_cast<int64_t>(WallTime()), HostName(),
                               ::getpid(), counter++);
  file_.emplace(path_, O_WRONLY | O_CREAT | O_TRUNC);
  std::string event;
  protozero::pbf_writer writer(event);
  writer.add_double(1, WallTime());
  writer.add_string(3, "brain.Event:2");
  Append(event);
}

void EventFileWriter::Scalar(std::string_view tag, int64_t step, double value) {
  std::string event;
  protozero::pbf_writer writer(event);
  writer.add_double(1, WallTime());
  writer.add_int64(2, step);
  {
    protozero::pbf_writer summary(writer, 5);
    protozero::pbf_writer entry(summary, 1);
    entry.add_string(1, tag.data(), tag.size());
    entry.add_float(2, static_cast<float>(value));
  }
  Append(event);
}

void EventFileWriter::Append(std::string_view event) { file_->Write(TfRecord(event)); }

}  // namespace oted
