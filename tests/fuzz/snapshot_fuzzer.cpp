// libFuzzer: snapshots with flipped bits, and words that never were a snapshot, are refused,
// whatever they hold.
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <esokit/control/adrc.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace {

using namespace esokit;

template <class T>
void attack(const T& object, const std::uint8_t* data, std::size_t size) {
  const Snapshot<T> good = snapshot(object);
  if (!from_snapshot<T>(good)) {
    std::fprintf(stderr, "snapshot_fuzzer: its own snapshot is refused\n");
    std::abort();
  }
  // Up to three flipped bits, and a burst of up to 32: what a CRC-32 is sure to see.
  Snapshot<T> wrong = good;
  const auto flip = [&wrong](std::size_t place) {
    const std::size_t bit = place % (32 * wrong.size());
    wrong[bit / 32] ^= 1u << (bit % 32);
  };
  const auto place = [&](std::size_t i) {
    return (std::size_t{data[i]} << 8u) + std::size_t{data[i + 1]};
  };
  const auto refused = [&] {
    if (wrong == good || !from_snapshot<T>(wrong)) return;
    std::fprintf(stderr, "snapshot_fuzzer: flipped bits are accepted\n");
    std::abort();
  };
  for (std::size_t i = 0; i + 1 < size && i < 6; i += 2) {
    flip(place(i));
    refused();
  }
  wrong = good;
  if (size >= 6) {
    for (std::size_t i = 0; i < 32; ++i) {
      if ((data[2 + i / 8] >> (i % 8) & 1u) != 0) flip(place(0) + i);
    }
    refused();
  }
  // Anything at all: no undefined behaviour on the way to the refusal.
  Snapshot<T> any{};
  std::memcpy(any.data(), data, std::min(size, sizeof any));
  if (any != good) (void)from_snapshot<T>(any);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto linear =
      LinearEso<2, float>::make(
          {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f})
          .value();
  static const auto algebraic = AlgebraicEso<1, float>::make({.observer_bandwidth = 50.0f,
                                                              .frequency_shift = 5.0f,
                                                              .input_gain = 3.0f,
                                                              .sample_time = 1e-3f})
                                    .value();
  static const auto adrc =
      Adrc<LinearEso<2>>::make(
          {.observer = {.observer_bandwidth = 50, .input_gain = 3, .sample_time = 1e-3},
           .controller_bandwidth = 10})
          .value();
  attack(linear, data, size);
  attack(algebraic, data, size);
  attack(adrc, data, size);
  return 0;
}
