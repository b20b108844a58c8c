#include "oted/data/checkpoint_curves.h"

#include <cstdint>
#include <variant>
#include <vector>

#include "oted/base/curves_log.h"

namespace oted {
namespace {

constexpr const char* kCurvesArray = "curves";

}  // namespace

void KeepCurvesMark(LogSink& log, const std::string& run, NpzArrays& checkpoint) {
  CurvesLog* curves = CurvesOf(&log);
  const std::string mark = curves == nullptr ? "" : curves->CurvesMark(run);
  if (!mark.empty()) checkpoint[kCurvesArray] = NpyArray(std::vector<uint8_t>(mark.begin(), mark.end()));
}

void GoOnWithCurves(LogSink& log, const std::string& run, const NpzArrays& checkpoint) {
  const auto found = checkpoint.find(kCurvesArray);
  CurvesLog* curves = CurvesOf(&log);
  if (found == checkpoint.end() || curves == nullptr) return;
  const auto* mark = std::get_if<std::vector<uint8_t>>(&found->second.values);
  if (mark != nullptr) curves->GoOn(run, std::string(mark->begin(), mark->end()));
}

}  // namespace oted
