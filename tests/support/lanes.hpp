/// @file
/// Settings and samples of which each lane has its own, for a pack and for the scalars that it has
/// to equal.
#pragma once

#include <bit>
#include <cmath>
#include <esokit/core/lanes.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace esokit_test {

/// f(0), f(1), .. in the lanes of a pack; of a plain scalar f(lane).
template <class S, class F>
S each_lane(int lane, F&& f) {
  if constexpr (esokit::PackScalar<S>) {
    S all(0.0);
    for (int i = 0; i < esokit::lane_count<S>; ++i) {
      all[i] = static_cast<esokit::LaneScalar<S>>(f(i));
    }
    return all;
  } else {
    return static_cast<S>(f(lane));
  }
}

/// A signal with faults, of its own in each lane: now and then NaN, infinite, or so large that the
/// estimate overflows; and runs of NaN, which are gaps.
template <class S>
class FaultySignal {
  using One = esokit::LaneScalar<S>;
  static constexpr int count = esokit::lane_count<S>;

 public:
  explicit FaultySignal(unsigned seed, double faults) : random_(seed), faults_(faults) {}

  S operator()() {
    S all(0.0);
    for (int i = 0; i < count; ++i) all[i] = one(i);
    return all;
  }

 private:
  One one(int lane) {
    int& gap = gap_[static_cast<std::size_t>(lane)];
    const double draw = random_.uniform(0, 1);
    const One good = static_cast<One>(random_.uniform(-1, 1));
    if (gap > 0) {
      --gap;
      return hidden_nan<One>();
    }
    if (draw > faults_) return good;
    const double kind = 6 * draw / faults_;
    if (kind < 1) return hidden_nan<One>();
    if (kind < 2) return std::copysign(hidden_infinity<One>(), good);
    if (kind < 3) return good * (std::numeric_limits<One>::max)();
    if (kind < 4) return good * std::sqrt((std::numeric_limits<One>::max)());
    gap = 1 + static_cast<int>(5 * (kind - 4));
    return hidden_nan<One>();
  }

  Random random_;
  double faults_;
  esokit::Array<int, count> gap_{};
};

/// The number, the vector or the status of a lane equals that of the scalar, bit for bit.
template <class Packed, class One>
bool lane_equals(const Packed& packed, const One& one, int lane) {
  if constexpr (requires { one.size(); }) {
    for (decltype(one.size()) r = 0; r < one.size(); ++r) {
      if (!same_bits(packed[r][lane], one[r])) return false;
    }
    return true;
  } else if constexpr (std::is_floating_point_v<One>) {
    return same_bits(packed[lane], one);
  } else {
    return packed[lane] == one;
  }
}

}  // namespace esokit_test
