/// @file
/// Counts every operator new of the program, and every malloc of its own code (that is Eigen's
/// way). In one translation unit of a program only: it replaces the operators, and the program has
/// to be linked with esokit_count_allocations (tests/CMakeLists.txt), which sends malloc here.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace esokit_test {

inline std::atomic<long> allocation_count{0};

inline void* counted_allocation(std::size_t size, std::size_t alignment) {
  ++allocation_count;
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
#ifdef _WIN32
  void* memory = _aligned_malloc(rounded == 0 ? alignment : rounded, alignment);
#else
  void* memory = std::aligned_alloc(alignment, rounded == 0 ? alignment : rounded);
#endif
  if (memory == nullptr) std::abort();
  return memory;
}

inline void free_allocation(void* memory) noexcept {
#ifdef _WIN32
  _aligned_free(memory);
#else
  std::free(memory);
#endif
}

}  // namespace esokit_test

extern "C" {
void* __real_malloc(std::size_t size);
void* __wrap_malloc(std::size_t size) {
  ++esokit_test::allocation_count;
  return __real_malloc(size);
}
void* __real_realloc(void* memory, std::size_t size);
void* __wrap_realloc(void* memory, std::size_t size) {
  ++esokit_test::allocation_count;
  return __real_realloc(memory, size);
}
}

// Not inlined: GCC warns where it sees one half of a replaced pair.
[[gnu::noinline]] void* operator new(std::size_t size) {
  return esokit_test::counted_allocation(size, alignof(std::max_align_t));
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  return esokit_test::counted_allocation(size, static_cast<std::size_t>(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  esokit_test::free_allocation(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  esokit_test::free_allocation(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  esokit_test::free_allocation(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  esokit_test::free_allocation(memory);
}

namespace esokit_test {

/// `count()` says how many allocations there were since it was made.
class NoAllocation {
 public:
  [[nodiscard]] long count() const { return allocation_count - before_; }

 private:
  long before_ = allocation_count;
};

}  // namespace esokit_test
