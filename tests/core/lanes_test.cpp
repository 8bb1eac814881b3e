// How things of packs are taken apart into their lanes and put together again.
#include <gtest/gtest.h>

#include <esokit/core/lanes.hpp>
#include <esokit/core/pack.hpp>
#include <optional>
#include <tuple>

namespace core_lanes_test {

using esokit::Lanes;
using esokit::LaneScalar;
using esokit::Pack;
using esokit::PerLane;

static_assert(std::is_same_v<Lanes<bool, double>, bool>);
static_assert(std::is_same_v<Lanes<bool, Pack<float, 8>>, PerLane<bool, 8>>);

/// One of everything that an object may hold.
template <class S>
class Thing {
 public:
  template <class T>
  using with_scalar = Thing<T>;
  using scalar_type = S;

  struct Nothing {};

  S number{};
  std::array<S, 2> numbers{};
  Lanes<int, S> count{0};
  std::optional<S> maybe{};
  Nothing nothing{};
  int common = 0;
};

/// The same with private data: it says how many they are.
template <class S>
class Closed {
 public:
  explicit Closed(const S& first) : first_(first) {}
  [[nodiscard]] const S& first() const { return first_; }
  [[nodiscard]] Lanes<int, S> second() const { return second_; }

 private:
  friend struct esokit::detail::LaneAccess;
  static constexpr int data_members = 2;
  S first_;
  Lanes<int, S> second_{3};
};

/// A class that has no data of its own, and one that adds some.
template <class S>
struct Named : Closed<S> {
  using Closed<S>::Closed;
};
template <class S>
struct Larger : Closed<S> {
  using Base = Closed<S>;
  using Base::Base;
  struct {
    S third{};
  } rest_;
};

using Packed = Thing<Pack<double, 4>>;
using Plain = Thing<double>;
static_assert(std::is_same_v<esokit::detail::PlainTwin<Packed, Pack<double, 4>>, Plain>);
static_assert(std::is_same_v<esokit::detail::PlainTwin<Plain, double>, Plain>);

Packed packed() {
  Packed thing;
  thing.number = Pack<double, 4>({1, 2, 3, 4});
  thing.numbers = {Pack<double, 4>({10, 20, 30, 40}), Pack<double, 4>({-1, -2, -3, -4})};
  for (int i = 0; i < 4; ++i) thing.count[i] = 100 + i;
  thing.common = 7;
  return thing;
}

TEST(Lanes, AreTakenOut) {
  Packed all = packed();
  for (int i = 0; i < 4; ++i) {
    const auto one = esokit::detail::get_lane<Plain>(all, i);
    EXPECT_EQ(one.number, i + 1);
    EXPECT_EQ(one.numbers[0], 10 * (i + 1));
    EXPECT_EQ(one.numbers[1], -(i + 1));
    EXPECT_EQ(one.count, 100 + i);
    EXPECT_EQ(one.common, 7);
    EXPECT_FALSE(one.maybe.has_value());
  }
  all.maybe = Pack<double, 4>({5, 6, 7, 8});
  EXPECT_EQ(esokit::detail::get_lane<Plain>(all, 2).maybe, 7);
}

TEST(Lanes, HaveAllDataOfAClassAndOfItsBase) {
  using Four = Pack<double, 4>;
  const Named<Four> named(Four({1, 2, 3, 4}));
  const auto one = esokit::detail::get_lane<Named<double>>(named, 2);
  EXPECT_EQ(one.first(), 3);
  EXPECT_EQ(one.second(), 3);
  Larger<Four> larger(Four({5, 6, 7, 8}));
  larger.rest_.third = Four({9, 10, 11, 12});
  auto lane = esokit::detail::get_lane<Larger<double>>(larger, 1);
  EXPECT_EQ(lane.first(), 6);
  EXPECT_EQ(lane.rest_.third, 10);
  lane.rest_.third = 0.5;
  esokit::detail::set_lane(larger, lane, 1);
  EXPECT_EQ(larger.rest_.third[0], 9);
  EXPECT_EQ(larger.rest_.third[1], 0.5);
}

TEST(Lanes, ArePutBackOneByOne) {
  for (int changed = 0; changed < 4; ++changed) {
    Packed all = packed();
    Plain one = esokit::detail::get_lane<Plain>(all, changed);
    one.number = 0.5;
    one.numbers[1] = 0.25;
    one.count = 9;
    esokit::detail::set_lane(all, one, changed);
    const Packed before = packed();
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(all.number[i], i == changed ? 0.5 : before.number[i]);
      EXPECT_EQ(all.numbers[0][i], before.numbers[0][i]);
      EXPECT_EQ(all.numbers[1][i], i == changed ? 0.25 : before.numbers[1][i]);
      EXPECT_EQ(all.count[i], i == changed ? 9 : before.count[i]);
    }
  }
}

TEST(Lanes, AreVisitedInOrder) {
  Packed all = packed();
  int calls = 0;
  esokit::detail::for_each_lane<Plain>(all, [&](Plain& one) {
    EXPECT_EQ(one.number, ++calls);
    one.number = -one.number;
  });
  EXPECT_EQ(calls, 4);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(all.number[i], -(i + 1));
}

template <class T>
class PerLaneOf : public ::testing::Test {};
struct Big {  // not compared in words
  double value = 0;
  Big() = default;
  Big(double v) : value(v) {}
  bool operator==(const Big&) const = default;
};
using Elements = ::testing::Types<PerLane<bool, 2>, PerLane<bool, 4>, PerLane<unsigned char, 8>,
                                  PerLane<unsigned short, 4>, PerLane<unsigned, 3>,
                                  PerLane<unsigned char, 64>, PerLane<Big, 4>>;
TYPED_TEST_SUITE(PerLaneOf, Elements);

/// Compilers call memcmp for an array; the words that stand for it see every lane.
TYPED_TEST(PerLaneOf, IsEqualIfEveryLaneIs) {
  TypeParam a(1);
  const TypeParam b(1);
  EXPECT_TRUE(a == b);
  EXPECT_TRUE(TypeParam(a) == a);
  for (int i = 0; i < static_cast<int>(a.values.size()); ++i) {
    a[i] = 0;
    EXPECT_FALSE(a == b) << i;
    a[i] = 1;
    EXPECT_TRUE(a == b) << i;
  }
}

}  // namespace core_lanes_test
