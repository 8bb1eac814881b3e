/// @file
/// Independent jobs on all cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <vector>

namespace esokit::examples {

/// { job(0), .., job(count - 1) }; says on stderr what it is at. The result does not depend on the
/// number of cores as long as a job depends on its index alone: make its random seed from the
/// index. The first exception (by index) is rethrown.
template <class Job>
[[nodiscard]] auto run_parallel(std::string_view label, std::size_t count, Job job) {
  using Result = std::invoke_result_t<Job&, std::size_t>;
  static_assert(!std::is_same_v<Result, bool>, "std::vector<bool> is not safe to fill in parallel");
  std::fprintf(stderr, "  %s: %zu jobs\n", std::string(label).c_str(), count);
  std::vector<Result> results(count);
  std::vector<std::exception_ptr> failures(count);
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        results[i] = job(i);
      } catch (...) {
        failures[i] = std::current_exception();
      }
    }
  };
  {
    std::vector<std::jthread> pool(std::max(1U, std::thread::hardware_concurrency()) - 1);
    for (auto& thread : pool) thread = std::jthread(work);
    work();
  }
  for (const auto& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
  return results;
}

}  // namespace esokit::examples
