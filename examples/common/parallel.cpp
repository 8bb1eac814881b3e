#include "parallel.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <string>
#include <thread>

namespace esokit::examples {

void for_each_parallel(std::string_view label, std::size_t count,
                       const std::function<void(std::size_t)>& job) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  auto last = start;
  std::vector<std::exception_ptr> failures(count);
  std::atomic<std::size_t> next = 0;
  std::size_t done = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        job(i);
      } catch (...) {
        failures[i] = std::current_exception();
      }
      const std::scoped_lock lock(mutex);
      ++done;
      const auto now = Clock::now();
      if (now - last < std::chrono::seconds(10)) continue;
      last = now;
      std::fprintf(stderr, "  %s: %zu of %zu, %.0f s\n", std::string(label).c_str(), done, count,
                   std::chrono::duration<double>(now - start).count());
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
}

}  // namespace esokit::examples
