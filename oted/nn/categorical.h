#pragma once
/// The categorical distribution over discrete actions that a network's outputs (logits) stand for.

#include <span>

#include "oted/base/rng.h"

namespace oted {

/// log softmax of each row. @param logits (rows, n). @param out (rows, n); may be `logits` itself
void LogSoftmax(std::span<const float> logits, int n, std::span<float> out);

/// The mean over rows of -log p(action) [nats], and its gradient with respect to the logits.
/// @param actions (rows) indices below n. @param gradient (rows, n), overwritten; empty when not wanted
double CategoricalLoss(std::span<const float> logits, int n, std::span<const int> actions, std::span<float> gradient);

/// One index drawn from softmax(logits), by one uniform number of `rng`.
int SampleCategorical(std::span<const float> logits, Rng& rng);

/// The index of the largest logit; the first of equals.
int MostProbable(std::span<const float> logits);

}  // namespace oted
