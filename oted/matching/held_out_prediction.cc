#include "oted/matching/held_out_prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace oted {

using nlohmann::json;

namespace {

constexpr double kSureOfExcess = 2.0;  // standard errors

/// Null is NaN: every window broke down.
double NumberFrom(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

}  // namespace

double MostTimesFloor(const HeldOutPrediction::Horizon& horizon) {
  double log_ratio = 0;
  int n_judged = 0;
  for (const HeldOutPrediction::Channel& c : horizon.channels) {
    const double seen = kVisibleError * c.spread;
    const double ratio = std::hypot(c.designed, seen) / std::hypot(c.floor, seen);
    if (!c.judged || !std::isfinite(ratio) || ratio <= 0) continue;
    log_ratio += std::log(ratio);
    ++n_judged;
  }
  const double in_sum = n_judged > 0 ? std::exp(log_ratio / n_judged) : 1;
  return std::max(in_sum, std::exp(0.5 * (horizon.excess.value + kSureOfExcess * horizon.excess.error)));
}

json ToJson(const Estimated& estimated) { return {{"value", estimated.value}, {"error", estimated.error}}; }

Estimated EstimatedFromJson(const json& record) {
  return {NumberFrom(record.at("value")), NumberFrom(record.at("error"))};
}

namespace {

json HorizonToJson(const HeldOutPrediction::Horizon& h) {
  json channels = json::array();
  for (const HeldOutPrediction::Channel& c : h.channels) {
    channels.push_back({{"nominal", c.nominal},
                        {"designed", c.designed},
                        {"floor", c.floor},
                        {"spread", c.spread},
                        {"guess", c.guess},
                        {"judged", c.judged},
                        {"in_some", c.in_some},
                        {"excess", ToJson(c.excess)},
                        {"gain", ToJson(c.gain)}});
  }
  return {{"seconds", h.seconds},
          {"n_steps", h.n_steps},
          {"n_windows", h.n_windows},
          {"learned", h.learned},
          {"channels", channels},
          {"excess", ToJson(h.excess)},
          {"gain", ToJson(h.gain)},
          {"typical_gain", ToJson(h.typical_gain)},
          {"odd_episodes", h.odd_episodes},
          {"surely_odd", h.surely_odd},
          {"n_of_recordings", h.n_of_recordings},
          {"gain_of_recordings", ToJson(h.gain_of_recordings)}};
}

HeldOutPrediction::Horizon HorizonFromJson(const json& h) {
  HeldOutPrediction::Horizon horizon{.seconds = h.at("seconds"),
                                     .n_steps = h.at("n_steps"),
                                     .n_windows = h.at("n_windows"),
                                     .learned = h.at("learned"),
                                     .channels = {},
                                     .excess = EstimatedFromJson(h.at("excess")),
                                     .gain = EstimatedFromJson(h.at("gain")),
                                     .typical_gain = EstimatedFromJson(h.at("typical_gain")),
                                     .odd_episodes = h.at("odd_episodes"),
                                     .surely_odd = h.at("surely_odd"),
                                     .n_of_recordings = h.at("n_of_recordings"),
                                     .gain_of_recordings = EstimatedFromJson(h.at("gain_of_recordings"))};
  for (const json& c : h.at("channels")) {
    horizon.channels.push_back({.nominal = NumberFrom(c.at("nominal")),
                                .designed = NumberFrom(c.at("designed")),
                                .floor = NumberFrom(c.at("floor")),
                                .spread = NumberFrom(c.at("spread")),
                                .judged = c.at("judged"),
                                .excess = EstimatedFromJson(c.at("excess")),
                                .gain = EstimatedFromJson(c.at("gain")),
                                .guess = NumberFrom(c.at("guess")),
                                .in_some = c.at("in_some")});
  }
  return horizon;
}

}  // namespace

json ToJson(const HeldOutPrediction& prediction) {
  json horizons = json::array(), open_ends = json::array();
  for (const HeldOutPrediction::Horizon& h : prediction.horizons) horizons.push_back(HorizonToJson(h));
  for (const HeldOutPrediction::OpenEnd& end : prediction.open_ends) {
    open_ends.push_back({{"parameter", end.parameter}, {"above", end.above}});
  }
  json record = {{"horizons", horizons},
                 {"n_recordings", prediction.n_recordings},
                 {"n_parts", prediction.n_parts},
                 {"open_ends", open_ends}};
  if (prediction.longest) record["longest"] = HorizonToJson(*prediction.longest);
  return record;
}

HeldOutPrediction HeldOutPredictionFromJson(const json& record) {
  HeldOutPrediction prediction;
  for (const json& h : record.at("horizons")) prediction.horizons.push_back(HorizonFromJson(h));
  if (record.contains("longest")) prediction.longest = HorizonFromJson(record.at("longest"));
  prediction.n_recordings = record.at("n_recordings");
  prediction.n_parts = record.at("n_parts");
  for (const json& end : record.at("open_ends")) {
    prediction.open_ends.push_back({end.at("parameter"), end.at("above")});
  }
  return prediction;
}

}  // namespace oted
