#include "oted/stages/design/replay/excess.h"

#include <algorithm>

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

}  // namespace

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
