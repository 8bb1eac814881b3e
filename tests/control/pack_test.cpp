// A controller of packs is as many of the plain scalar: u, requested u, mode and status, bit for
// bit, with limits, rates, start holds, gaps and safe mode of each lane its own.
#include <gtest/gtest.h>

#include <esokit/control/adrc.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/lanes.hpp>
#include <vector>

namespace esokit_test {
namespace control_pack_test {

using esokit::lane_count;
using esokit::LaneScalar;
using esokit::LoopMode;
using esokit::StepStatus;

template <class S>
S by_lane(int lane, double first, double step) {
  return each_lane<S>(lane, [=](int i) { return first + step * i; });
}

/// What all controllers here have: limits and rates of their own, one lane without any.
template <class S, class Config>
Config with_loop(Config config, int lane, bool again) {
  using One = LaneScalar<S>;
  config.observer.observer_bandwidth = by_lane<S>(lane, again ? 30 : 25, 5);
  config.observer.input_gain = by_lane<S>(lane, again ? 1.5 : 1.25, 0.5);
  config.observer.sample_time = by_lane<S>(lane, 0.01, 0.005);
  config.observer.max_gap = 6;
  config.controller_bandwidth = by_lane<S>(lane, again ? 4 : 3, 0.5);
  const auto but_one = [](double value, double none) {
    return [=](int i) { return i == 1 ? none : value + i; };
  };
  constexpr double most = (std::numeric_limits<One>::max)();
  config.limits = {each_lane<S>(lane, but_one(-40, -most)), each_lane<S>(lane, but_one(30, most)),
                   each_lane<S>(lane, but_one(500, most))};
  config.start_hold = {each_lane<S>(lane, [](int i) { return 0.1 * (i % 3); }),
                       by_lane<S>(lane, 0.5, 1)};
  config.missing.most = 3;
  return config;
}

struct OfLinear {
  template <class S>
  using Controller = esokit::Adrc<esokit::LinearEso<2, S>>;
  template <class S>
  static auto config(int lane, bool again) {
    return with_loop<S>(typename Controller<S>::Config{}, lane, again);
  }
};

struct ErrorBasedOfCascade {
  template <class S>
  using Controller = esokit::Adrc<esokit::CascadeEso<1, 2, S>, esokit::ErrorBased>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_loop<S>(typename Controller<S>::Config{}, lane, again);
    config.observer.bandwidth_factor = S(2.0);
    config.missing.input = by_lane<S>(lane, -3, 1);  // a safe u
    return config;
  }
};

struct OfAlgebraic {
  template <class S>
  using Controller = esokit::Adrc<esokit::AlgebraicEso<2, S>>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_loop<S>(typename Controller<S>::Config{}, lane, again);
    config.observer.frequency_shift = by_lane<S>(lane, 40, 10);
    config.missing.stay = true;
    return config;
  }
};

/// Every second update brings a measurement.
struct Divided {
  template <class S>
  using Controller = esokit::Adrc<esokit::AdjustableBandwidthEso<1, S>>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_loop<S>(typename Controller<S>::Config{}, lane, again);
    config.measurement_divider = 2;
    config.domain = esokit::TimeDomain::sampled;
    return config;
  }
};

template <class Kind, class S>
struct Of {
  using Controller = Kind;
  using Scalar = S;
};

template <class Case>
class ControllerPacks : public ::testing::Test {
 protected:
  using Kind = typename Case::Controller;
  using Scalar = typename Case::Scalar;
  using Number = LaneScalar<Scalar>;
  using Packed = typename Kind::template Controller<Scalar>;
  using Plain = typename Kind::template Controller<Number>;
  static constexpr int count = lane_count<Scalar>;

  ControllerPacks() {
    for (int i = 0; i < count; ++i) {
      lanes.push_back(Plain::make(Kind::template config<Number>(i, false)).value());
    }
  }

  /// Calls step(controller, signal of it ..) on the pack and on each scalar.
  template <class Step, class... Signals>
  void both(const Step& step, const Signals&... signals) {
    const auto u = step(packed, signals...);
    for (int i = 0; i < count; ++i) {
      Plain& one = lanes[static_cast<std::size_t>(i)];
      ASSERT_TRUE(lane_equals(u, step(one, signals[i]...), i)) << "lane " << i;
    }
    expect_equal();
  }

  void expect_equal() {
    for (int i = 0; i < count; ++i) {
      const Plain& one = lanes[static_cast<std::size_t>(i)];
      ASSERT_TRUE(lane_equals(packed.output(), one.output(), i)) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.requested(), one.requested(), i)) << "lane " << i;
      ASSERT_EQ(packed.status()[i], one.status()) << "lane " << i;
      ASSERT_EQ(packed.mode()[i], one.mode()) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.observer().estimate(), one.observer().estimate(), i));
      ASSERT_EQ(packed.observer().missed()[i], one.observer().missed()) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.gains(), one.gains(), i)) << "lane " << i;
      mixed = mixed || packed.mode()[i] != packed.mode()[0];
      safe = safe || packed.mode()[i] == LoopMode::safe;
      bad_estimate = bad_estimate || !all(is_finite(packed.output()));
    }
  }

  void retune(bool again) {
    ASSERT_TRUE(packed.retune(Kind::template config<Scalar>(0, again)));
    for (int i = 0; i < count; ++i) {
      ASSERT_TRUE(
          lanes[static_cast<std::size_t>(i)].retune(Kind::template config<Number>(i, again)));
    }
    expect_equal();
  }

  Packed packed = Packed::make(Kind::template config<Scalar>(0, false)).value();
  std::vector<Plain> lanes;
  bool mixed = false;         ///< lanes were in different modes
  bool safe = false;          ///< one was in safe mode
  bool bad_estimate = false;  ///< never
};

// More lanes than a register has: with one observer that steps alike and one that does not, the
// rest of them is in observer/pack_test.cpp.
template <class... Kinds>
#ifdef ESOKIT_ONE_TYPE
using Cases = ::testing::Types<Of<Kinds, esokit::Pack<float>>...>;
#else
using Cases =
    ::testing::Types<Of<Kinds, esokit::Pack<double>>..., Of<OfLinear, esokit::Pack<double, 8>>,
                     Of<OfAlgebraic, esokit::Pack<double, 8>>>;
#endif
using All = Cases<OfLinear, ErrorBasedOfCascade, OfAlgebraic, Divided>;
TYPED_TEST_SUITE(ControllerPacks, All);

const auto update = [](auto& c, const auto& y, const auto& r) { return c.update(y, r); };

TYPED_TEST(ControllerPacks, AreTheirLanesWithoutFaults) {
  using S = typename TestFixture::Scalar;
  FaultySignal<S> y(1, 0);
  FaultySignal<S> r(2, 0);
  for (int k = 0; k < 1500; ++k) {
    this->both(update, y(), r());
    if (this->HasFatalFailure()) FAIL() << "sample " << k;
  }
  EXPECT_TRUE(this->mixed) << "some lanes hold at first";
  EXPECT_FALSE(this->safe);
}

TYPED_TEST(ControllerPacks, AreTheirLanesInEveryCall) {
  using S = typename TestFixture::Scalar;
  FaultySignal<S> y(3, 0.06);
  FaultySignal<S> r(4, 0.01);
  FaultySignal<S> u(5, 0.01);
  Random random(6);
  for (int k = 0; k < 4000; ++k) {
    const int call = static_cast<int>(random.uniform(0, 200));
    if (call < 140) {
      this->both(update, y(), r());
    } else if (call < 160) {
      this->both([](auto& c, const auto& of_y, const auto& of_r,
                    const auto& of_u) { return c.update(of_y, of_r, of_u); },
                 y(), r(), u());
    } else if (call < 170) {
      this->both([](auto& c, const auto& of) { return c.update_without_measurement(of); }, r());
    } else if (call < 180) {
      this->both(
          [](auto& c, const auto& of_y, const auto& of_r, const auto& of_rate) {
            return c.update(of_y, {of_r, of_rate});
          },
          y(), r(), r());
    } else if (call < 190) {
      this->both([](auto& c, const auto& of_y, const auto& of_r,
                    const auto& of_u) { return c.track(of_y, of_r, of_u); },
                 y(), r(), u());
    } else if (call < 197) {
      this->both([](auto& c, const auto& of_y, const auto& of_u) { return c.start(of_y, of_u); },
                 y(), u());
    } else {
      this->both([](auto& c, const auto& of) { return c.start(of, of); }, S(0.5));
      this->retune(k % 2 == 0);
    }
    if (this->HasFatalFailure()) FAIL() << "sample " << k << ", call " << call;
  }
  EXPECT_TRUE(this->mixed);
  EXPECT_TRUE(this->safe);
  EXPECT_FALSE(this->bad_estimate);
}

/// A lane without measurements goes to safe mode alone, and comes back alone.
TYPED_TEST(ControllerPacks, KeepSafeModeInItsLane) {
  using S = typename TestFixture::Scalar;
  using One = typename TestFixture::Number;
  for (int k = 0; k < 60; ++k) this->packed.update(S(0.1), S(0.2));
  constexpr int bad = TestFixture::count - 1;
  S y(0.1);
  y[bad] = hidden_nan<One>();
  for (int k = 0; k < 10; ++k) this->packed.update(y, S(0.2));
  for (int i = 0; i < TestFixture::count; ++i) {
    EXPECT_EQ(this->packed.mode()[i], i == bad ? LoopMode::safe : LoopMode::running);
  }
}

TYPED_TEST(ControllerPacks, NameTheLaneOfAnError) {
  using S = typename TestFixture::Scalar;
  using Which = typename TestFixture::Kind;
  for (int bad = 0; bad < TestFixture::count; ++bad) {
    auto config = Which::template config<S>(0, false);
    config.limits.rate[bad] = -config.limits.rate[bad];
    const auto made = TestFixture::Packed::make(config);
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().lane, bad);
    EXPECT_STREQ(made.error().field, "limits.rate");
    EXPECT_STREQ(made.error().rule, "must be finite and positive");
    const auto refused = this->packed.retune(config);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().lane, bad);
    this->expect_equal();
  }
}

/// The parts, on their own.
TEST(PackOfALimiter, LimitsEachLaneByItsOwn) {
  using S = esokit::Pack<double, 4>;
  const S most((std::numeric_limits<double>::max)());
  const esokit::Limits<S> limits{S({-1, -2, -3, -std::numeric_limits<double>::max()}),
                                 S({1, 2, 3, std::numeric_limits<double>::max()}),
                                 S({10, std::numeric_limits<double>::max(), 20, 1e308})};
  auto packed = esokit::Limiter<S>::make(limits, S(0.01)).value();
  std::vector<esokit::Limiter<double>> lanes;
  for (int i = 0; i < 4; ++i) {
    lanes.push_back(
        esokit::Limiter<double>::make({limits.lower[i], limits.upper[i], limits.rate[i]}, 0.01)
            .value());
  }
  Random random(9);
  for (int k = 0; k < 500; ++k) {
    S wanted(0.0);
    for (int i = 0; i < 4; ++i) wanted[i] = random.uniform(-5, 5) * (k % 7 == 0 ? 1e307 : 1.0);
    const S out = packed(wanted);
    for (int i = 0; i < 4; ++i) {
      auto& lane = lanes[static_cast<std::size_t>(i)];
      ASSERT_TRUE(same_bits(out[i], lane(wanted[i]))) << "lane " << i;
      ASSERT_TRUE(same_bits(packed.clamp(-wanted)[i], lane.clamp(-wanted[i]))) << "lane " << i;
      ASSERT_TRUE(same_bits(packed.within(-wanted)[i], lane.within(-wanted[i]))) << "lane " << i;
    }
  }
  const auto refused = esokit::Limiter<S>::make({S({0, 0, 5, 0}), S(1.0), most}, S(0.01));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 2);
  EXPECT_STREQ(refused.error().rule, "must be below limits.upper");
}

TEST(PackOfAnAdrcLaw, NamesTheLaneOfAnError) {
  using S = esokit::Pack<float>;
  S gain(1.0);
  gain[2] = 0;
  const auto refused =
      esokit::AdrcLaw<2, S>::make({.controller_bandwidth = S(2.0), .input_gain = gain});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 2);
  EXPECT_STREQ(refused.error().field, "input_gain");
}

}  // namespace control_pack_test
}  // namespace esokit_test
