#include "oted/stages/design/replay/excess.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "oted/base/statistics.h"
#include "oted/matching/verdict.h"
#include "oted/stages/design/replay/judged_part.h"

namespace oted {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

PredictionRatios InJudged(const ExcessOverFloor::Inputs& in, const JudgedChannels& channels) {
  std::vector<MatrixXd> draws;
  for (const MatrixXd& draw : in.draws) draws.push_back(draw.leftCols(in.n_judged));
  return TypicalRatios(in.designed.leftCols(in.n_judged), AllBeside(draws), in.n_judged, channels);
}

constexpr double kSurelyOdd = 4.0;       // standard errors
constexpr double kStdOfMiddle = 1.4826;  // of the middle deviation, of normal numbers
constexpr size_t kFewestOfOdd = 3;       // windows of an episode that have a standard error,
constexpr size_t kFewestBeside = 4;      // episodes that have a scatter

double LowerMedian(std::vector<double> values) {
  std::ranges::sort(values);
  return values[(values.size() - 1) / 2];
}

}  // namespace

OddEpisodes FindOddEpisodes(const std::map<int, std::vector<double>>& excess) {
  std::vector<double> means;
  for (const auto& [unused, of] : excess) means.push_back(Mean(of));
  const double middle = LowerMedian(means);
  if (!(middle < kFarOff / 2)) return {};
  std::vector<double> from_middle;
  for (const double mean : means) from_middle.push_back(std::abs(mean - middle));
  const double scatter = kStdOfMiddle * LowerMedian(std::move(from_middle));
  OddEpisodes odd;
  std::map<int, double> off;
  for (const auto& [episode, of] : excess) {
    const double mean = Mean(of);
    const double error = std::hypot(scatter, StandardDeviation(of) / std::sqrt(static_cast<double>(of.size())));
    const bool has_error = of.size() >= kFewestOfOdd && excess.size() >= kFewestBeside;
    const bool is_sure = has_error && mean > kFarOff / 2 && mean - middle > kSurelyOdd * error;
    odd.surely |= is_sure;
    if (!is_sure && !(mean > kFarOff)) continue;
    odd.numbers.push_back(episode);
    off[episode] = mean;
  }
  std::ranges::stable_sort(odd.numbers, std::ranges::greater(), [&](int episode) { return off.at(episode); });
  return odd;
}

ExcessOverFloor::ExcessOverFloor(const Inputs& in, const JudgedChannels& channels)
    : typical_(TypicalRatios(in.designed, in.floor, in.designed.cols(), channels)),
      in_judged_(InJudged(in, channels)),
      in_sum_(RatiosOfSums(in.designed, MeanOf(in.draws), channels)) {
  typical_.Widen(in.times_scatter * ScatterOfDraws(in.draws, channels));
  typical_.Add(in.error_of_noise, channels.weight);
  if (in.draws_of_other.empty()) return;
  const MatrixXd floor_of_other = AllBeside(in.draws_of_other);
  lower_ = TypicalRatios(in.floor, floor_of_other, in.designed.cols(), channels);
  over_lower_ = TypicalRatios(in.designed, floor_of_other, in.designed.cols(), channels);
  over_lower_->Add(in.error_of_noise, channels.weight);
}

bool ExcessOverFloor::IsInSome(Index c) const {
  const Estimated sum = in_sum_.OfChannel(c);
  return sum.value > std::max(kFarOff, Typical(c).value) && IsSure(sum);
}

}  // namespace oted
