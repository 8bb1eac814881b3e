/// @file
/// Settings and samples of which each lane has its own, for a pack and for the scalars that it has
/// to equal.
#pragma once

#include <bit>
#include <cmath>
#include <esokit/core/lanes.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <vector>

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

/// What an object answers, as numbers: of a pack lane by lane, of a plain scalar as its only lane.
/// So that what compares them is compiled once.
class Answers {
 public:
  template <class... All>
  explicit Answers(const All&... all) {
    (add(all), ...);
  }
  /// With more of them.
  template <class... All>
  [[nodiscard]] Answers and_also(const All&... all) const {
    Answers more = *this;
    (more.add(all), ...);
    return more;
  }
  /// The first number that lane `lane` of the pack has not as the scalar, bit for bit; -1: none.
  [[nodiscard]] int differs(int lane, const Answers& scalar) const {
    const auto& mine = lanes_[static_cast<std::size_t>(lane)];
    const auto& wanted = scalar.lanes_[0];
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (i >= mine.size() || !same_bits(mine[i], wanted[i])) return static_cast<int>(i);
    }
    return mine.size() == wanted.size() ? -1 : static_cast<int>(wanted.size());
  }

 private:
  template <class T>
  void add(const T& value) {
    if constexpr (requires { value.values.size(); }) {  // PerLane
      for (std::size_t i = 0; i < value.values.size(); ++i) put(i, value.values[i]);
    } else if constexpr (requires { value.size(); }) {
      for (decltype(value.size()) i = 0; i < value.size(); ++i) add(value[i]);
    } else if constexpr (esokit::PackScalar<T>) {
      for (int i = 0; i < esokit::lane_count<T>; ++i) put(static_cast<std::size_t>(i), value[i]);
    } else {
      put(0, value);
    }
  }
  template <class T>
  void put(std::size_t lane, T value) {
    if (lanes_.size() <= lane) lanes_.resize(lane + 1);
    lanes_[lane].push_back(static_cast<double>(value));
  }

  std::vector<std::vector<double>> lanes_;
};

}  // namespace esokit_test
