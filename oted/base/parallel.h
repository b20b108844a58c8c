#pragma once
/// Work spread over threads in fixed shards.

#include <functional>

namespace oted {

/// Calls `work(i)` once for each i in [0, n) on at most `n_threads` threads (the caller's is one of them). Which thread
/// runs which index is not fixed: `work` must depend on i alone. Rethrows the exception of the lowest failing index;
/// after a failure no new index is started.
void ParallelFor(int n, int n_threads, const std::function<void(int)>& work);

/// The number of processors this process may run on; at least 1.
int AvailableThreads();

}  // namespace oted
