/// @file
/// Hands whole structures from the main loop to an interrupt or back, on one core, without locks
/// and without switching interrupts off.
#pragma once

#include <atomic>
#include <cstdint>

namespace firmware {

/// One writer, one reader; one of them may be an interrupt. The writer fills the slot that nobody
/// reads, then publishes it. The fences bind the compiler, which on one core is all that could
/// change the order; between two cores this class is not safe.
template <class T>
class DoubleBuffer {
 public:
  void write(const T& value) {
    const std::uint32_t next = generation_.load(std::memory_order_relaxed) + 1;
    std::atomic_signal_fence(std::memory_order_seq_cst);
    slots_[next & 1u] = value;
    generation_.store(next, std::memory_order_release);
  }

  [[nodiscard]] T read() const {
    for (;;) {
      const std::uint32_t before = generation_.load(std::memory_order_acquire);
      const T copy = slots_[before & 1u];
      std::atomic_signal_fence(std::memory_order_seq_cst);
      // Two writes in the meantime have reached this slot.
      const std::uint32_t after = generation_.load(std::memory_order_acquire);
      if (after - before < 2) return copy;
    }
  }

 private:
  T slots_[2]{};
  std::atomic<std::uint32_t> generation_{0};
};

}  // namespace firmware
