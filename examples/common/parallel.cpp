#include "parallel.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <string>
#include <thread>

namespace esokit::examples {
namespace {

/// Progress on stderr. Safe to call from several threads.
class Progress {
 public:
  Progress(std::string_view label, std::size_t count)
      : label_(label), count_(count), start_(Clock::now()), last_(start_) {}

  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// One job is done.
  void step() {
    const std::scoped_lock lock(mutex_);
    ++done_;
    const auto now = Clock::now();
    const bool due = now - last_ >= (terminal_ ? std::chrono::milliseconds(100)
                                               : std::chrono::milliseconds(10'000));
    if (due) {
      last_ = now;
      print(now);
    }
  }

  ~Progress() {
    // A job list that took no time is not worth a line of a log.
    const auto now = Clock::now();
    if (terminal_ || now - start_ >= std::chrono::seconds(1)) {
      print(now);
      if (terminal_) std::fputc('\n', stderr);
    }
  }

 private:
  using Clock = std::chrono::steady_clock;

  void print(Clock::time_point now) const {
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    const auto done = static_cast<double>(done_);
    const auto count = static_cast<double>(count_);
    const double share = count_ == 0 ? 1.0 : done / count;
    std::string line = "  " + label_ + ": " + std::to_string(done_) + " of " +
                       std::to_string(count_) + ", " +
                       std::to_string(static_cast<int>(100.0 * share)) + " %, " +
                       std::to_string(static_cast<int>(elapsed)) + " s";
    if (done_ > 0 && done_ < count_) {
      line += ", about " + std::to_string(static_cast<int>(elapsed * (1.0 / share - 1.0) + 0.5)) +
              " s left";
    }
    if (terminal_) {
      std::fprintf(stderr, "\r%s\x1b[K", line.c_str());
    } else {
      std::fprintf(stderr, "%s\n", line.c_str());
    }
    std::fflush(stderr);
  }

  std::string label_;
  std::size_t count_;
  std::size_t done_ = 0;
  Clock::time_point start_;
  Clock::time_point last_;
  std::mutex mutex_;
  const bool terminal_ = isatty(STDERR_FILENO) != 0;
};

}  // namespace

void for_each_parallel(std::string_view label, std::size_t count,
                       const std::function<void(std::size_t)>& job, unsigned threads) {
  std::vector<std::exception_ptr> failures(count);
  std::atomic<std::size_t> next = 0;
  {
    Progress progress(label, count);
    const auto work = [&] {
      for (std::size_t i = next++; i < count; i = next++) {
        try {
          job(i);
        } catch (...) {
          failures[i] = std::current_exception();
        }
        progress.step();
      }
    };
    if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
    const std::size_t helpers = std::min<std::size_t>(threads, std::max<std::size_t>(count, 1)) - 1;
    std::vector<std::jthread> pool;
    for (std::size_t i = 0; i < helpers; ++i) pool.emplace_back(work);
    work();
  }
  for (const auto& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace esokit::examples
