/// @file
/// Independent jobs on all cores, with progress on the console.
#pragma once

#include <concepts>
#include <cstddef>
#include <functional>
#include <string_view>
#include <type_traits>
#include <vector>

namespace esokit::examples {

/// Calls job(0) .. job(count - 1) on `threads` threads (0: as many as there are cores), with the
/// progress on stderr: one line that rewrites itself on a terminal, elsewhere a line every ten
/// seconds, so that a CI log stays short. The first exception (by index) is rethrown.
void for_each_parallel(std::string_view label, std::size_t count,
                       const std::function<void(std::size_t)>& job, unsigned threads = 0);

/// { job(0), .., job(count - 1) }, computed by for_each_parallel.
///
/// The result does not depend on the number of threads as long as a job depends on its index alone:
/// make its random seed from the index.
template <class Job>
[[nodiscard]] auto run_parallel(std::string_view label, std::size_t count, Job job,
                                unsigned threads = 0) {
  using Result = std::invoke_result_t<Job&, std::size_t>;
  static_assert(std::default_initializable<Result>, "a job returns a value that has a default");
  static_assert(!std::same_as<Result, bool>, "std::vector<bool> is not safe to fill in parallel");
  std::vector<Result> results(count);
  for_each_parallel(
      label, count, [&](std::size_t i) { results[i] = job(i); }, threads);
  return results;
}

}  // namespace esokit::examples
