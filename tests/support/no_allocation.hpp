/// @file
/// Counts every operator new of the program and arms Eigen's allocation guard, in release builds
/// too. Include it first, and in one translation unit of a program only: it replaces the operators.
#pragma once

#ifdef EIGEN_CORE_H
#error "support/no_allocation.hpp must come before Eigen"
#endif

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <new>

namespace esokit_test {

inline std::atomic<long> allocation_count{0};

inline void eigen_assertion(bool holds, const char* text) {
  if (holds) return;
  std::fprintf(stderr, "Eigen: %s\n", text);
  std::abort();
}

inline void* counted_allocation(std::size_t size, std::size_t alignment) {
  ++allocation_count;
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, rounded == 0 ? alignment : rounded);
  if (memory == nullptr) std::abort();
  return memory;
}

}  // namespace esokit_test

// Eigen's guard works through its assertion, which NDEBUG would remove.
#define EIGEN_RUNTIME_NO_MALLOC
#define eigen_assert(...) \
  ::esokit_test::eigen_assertion(static_cast<bool>(__VA_ARGS__), #__VA_ARGS__)

// Not inlined: GCC warns where it sees one half of a replaced pair.
[[gnu::noinline]] void* operator new(std::size_t size) {
  return esokit_test::counted_allocation(size, alignof(std::max_align_t));
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  return esokit_test::counted_allocation(size, static_cast<std::size_t>(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

#include <Eigen/Core>

namespace esokit_test {

/// While it lives, an allocation by Eigen aborts; `count()` says how many others there were.
class NoAllocation {
 public:
  NoAllocation() : before_(allocation_count) { Eigen::internal::set_is_malloc_allowed(false); }
  ~NoAllocation() { Eigen::internal::set_is_malloc_allowed(true); }
  NoAllocation(const NoAllocation&) = delete;
  NoAllocation& operator=(const NoAllocation&) = delete;

  [[nodiscard]] long count() const { return allocation_count - before_; }

 private:
  long before_;
};

}  // namespace esokit_test
