/// @file
/// Independent jobs on all cores, with progress on the console.
#pragma once

#include <cstddef>
#include <functional>
#include <string_view>
#include <type_traits>
#include <vector>

namespace esokit::examples {

/// Calls job(0) .. job(count - 1) on all cores, with a line of progress on stderr every ten
/// seconds. The first exception (by index) is rethrown.
void for_each_parallel(std::string_view label, std::size_t count,
                       const std::function<void(std::size_t)>& job);

/// { job(0), .., job(count - 1) }. The result does not depend on the number of cores as long as a
/// job depends on its index alone: make its random seed from the index.
template <class Job>
[[nodiscard]] auto run_parallel(std::string_view label, std::size_t count, Job job) {
  using Result = std::invoke_result_t<Job&, std::size_t>;
  static_assert(!std::is_same_v<Result, bool>, "std::vector<bool> is not safe to fill in parallel");
  std::vector<Result> results(count);
  for_each_parallel(label, count, [&](std::size_t i) { results[i] = job(i); });
  return results;
}

}  // namespace esokit::examples
