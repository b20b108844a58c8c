#pragma once
/// How two simulators' errors compare in the same windows, with errors that know of chance.

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "oted/matching/held_out_prediction.h"

namespace oted {

/// What is judged by.
struct JudgedChannels {
  Eigen::VectorXd spread;  ///< (channels): standard deviations over the logs; squares count as HeldOutPrediction has it
  /// (channels): the part of each in what is told of all together; 0 for readings that the fit leaves out
  /// (ReadingModel::computed), whose errors are not the simulator's.
  Eigen::VectorXd weight;
};

/// Logarithms of ratios, of each channel and behind them of all channels together, with errors by the delete-one
/// jackknife over ten blocks of neighbouring windows.
class PredictionRatios {
 public:
  /// @param without  the ratios when one block is left out, by its index
  PredictionRatios(Eigen::VectorXd value, Eigen::Index n_blocks,
                   const std::function<Eigen::VectorXd(Eigen::Index)>& without);

  /// (channels + 1): errors that are at least these.
  void Widen(const Eigen::VectorXd& errors) { error_ = error_.cwiseMax(errors); }
  /// (channels): errors beside these, of independent numbers. @param weight  (channels): as JudgedChannels
  void Add(const Eigen::VectorXd& errors, const Eigen::VectorXd& weight);
  Estimated OfChannel(Eigen::Index c) const { return {value_[c], error_[c]}; }
  Estimated OfAll() const { return OfChannel(value_.size() - 1); }

 private:
  Eigen::VectorXd value_, error_;
};

/// Means over windows. @param of_windows  (channels, windows)  @param weight  (channels): as JudgedChannels
PredictionRatios MeansOf(const Eigen::MatrixXd& of_windows, const Eigen::VectorXd& weight);

/// How much larger the errors `a` are than `b` in a typical one of the same `n` windows: means of logarithms. Either
/// may hold several draws of each window, one behind the other.
/// @param a, b  (channels, windows): mean squared errors, NaN where the physics broke down
PredictionRatios TypicalRatios(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::Index n,
                               const JudgedChannels& channels);

/// (n): the same of each window, the mean over channels.
Eigen::VectorXd LogRatios(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::Index n,
                          const JudgedChannels& channels);

/// (channels + 1): how far one more draw of all windows may lie from the mean of these, as a standard error of
/// TypicalRatios; 0 of fewer than three draws, which do not tell.
/// @param draws  (channels, windows) each
Eigen::VectorXd ScatterOfDraws(const std::vector<Eigen::MatrixXd>& draws, const JudgedChannels& channels);

/// The same by sums over the windows: what users feel is the error of the windows that are far off.
PredictionRatios RatiosOfSums(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const JudgedChannels& channels);

}  // namespace oted
