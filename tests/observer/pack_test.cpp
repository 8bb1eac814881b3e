// An observer of packs is as many observers of the plain scalar: every estimate, status, count and
// innovation, bit for bit, with settings, faults, gaps, restarts and retunes of each lane its own.
#include <gtest/gtest.h>

#include <esokit/core/pack.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <sstream>
#include <string>
#include <support/lanes.hpp>
#include <support/pack.hpp>
#include <vector>

namespace esokit_test {
namespace observer_pack_test {

using esokit::lane_count;
using esokit::LaneScalar;
using esokit::StepStatus;

// Settings of lane i; `again` are those of a retune.
double bandwidth(int i, bool again) { return (again ? 15.0 : 10.0) + 7.0 * i; }
double input_gain(int i, bool again) { return (i % 2 == 0 ? 1.5 : -2.0) + (again ? 0.25 : 0.0); }
double sample_time(int i, bool again) { return 0.01 * (1 + i % 3) * (again && i == 1 ? 1.5 : 1.0); }
constexpr int max_gap = 4;  // short: restarts are met often

template <class S>
S of(int lane, bool again, double (*setting)(int, bool)) {
  return each_lane<S>(lane, [&](int i) { return setting(i, again); });
}

/// Sets what all configs have.
template <class S, class Config>
Config with_chain(Config config, int lane, bool again) {
  config.input_gain = of<S>(lane, again, input_gain);
  config.sample_time = of<S>(lane, again, sample_time);
  config.max_gap = max_gap;
  return config;
}

template <class S, class Config>
Config by_bandwidth(int lane, bool again) {
  Config config{};
  config.observer_bandwidth = of<S>(lane, again, bandwidth);
  return with_chain<S>(config, lane, again);
}

struct Linear {
  template <class S>
  using Observer = esokit::LinearEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    return by_bandwidth<S, typename Observer<S>::Config>(lane, again);
  }
};

struct ByPoles {
  template <class S>
  using Observer = esokit::LinearEso<1, S, 2, esokit::PoleSet>;
  template <class S>
  static auto config(int lane, bool again) {
    typename Observer<S>::Config config{};
    config.poles[0] = {-20, 5};
    config.poles[1] = {-20, -5};
    config.poles[2] = {-9, 0};
    return with_chain<S>(config, lane, again);
  }
};

struct HalfGain {
  template <class S>
  using Observer = esokit::HalfGainEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    return by_bandwidth<S, typename Observer<S>::Config>(lane, again);
  }
};

struct Reduced {
  template <class S>
  using Observer = esokit::ReducedOrderEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    return by_bandwidth<S, typename Observer<S>::Config>(lane, again);
  }
};

struct Cascade {
  template <class S>
  using Observer = esokit::CascadeEso<2, 3, S, 2>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.bandwidth_factor = each_lane<S>(lane, [](int i) { return 1.25 + 0.25 * i; });
    return config;
  }
};

struct CascadeByLevels {
  template <class S>
  using Observer = esokit::CascadeEso<1, 2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    typename Observer<S>::Config config{};
    config.level_bandwidths = {of<S>(lane, again, bandwidth),
                               each_lane<S>(lane, [](int i) { return 30.0 + i; })};
    return with_chain<S>(config, lane, again);
  }
};

struct AdjustableBandwidth {
  template <class S>
  using Observer = esokit::AdjustableBandwidthEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.bandwidth_ratio = each_lane<S>(lane, [](int i) { return 0.6 + 0.2 * (i % 4); });
    return config;
  }
};

/// Exponents of different kinds, so that the lanes part.
struct PowerSum {
  template <class S>
  using Observer = esokit::NonlinearEso<1, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.shape.gain_alpha = S(0.6);
    config.shape.alpha = each_lane<S>(lane, [](int i) { return 0.5 + 0.25 * (i % 4); });
    config.shape.gain_beta = each_lane<S>(lane, [](int i) { return 0.1 + 0.1 * (i % 4); });
    config.shape.beta = S(0.5);
    config.gain_min = each_lane<S>(lane, [](int i) { return 0.55 + 0.0625 * (i % 4); });
    return config;
  }
};

struct FalShape {
  template <class S>
  using Observer = esokit::NonlinearEso<1, S, 1, esokit::FalGain<S>>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.shape.exponent = S(0.5);
    config.shape.linear_width = each_lane<S>(lane, [](int i) { return 0.05 * (1 + i); });
    return config;
  }
};

/// A gain function that is no template of a scalar: the same object for packs and scalars.
struct OfAnyScalar {
  template <class S>
  S operator()(const S& x) const {
    return S(1.0) / (S(0.75) + x);
  }
};
struct OwnShape {
  template <class S>
  using Observer = esokit::NonlinearEso<1, S, 1, OfAnyScalar>;
  template <class S>
  static auto config(int lane, bool again) {
    return by_bandwidth<S, typename Observer<S>::Config>(lane, again);
  }
};

/// Some lanes settle soon, some late; blanked for times of their own.
struct Algebraic {
  template <class S>
  using Observer = esokit::AlgebraicEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.frequency_shift = each_lane<S>(lane, [](int i) { return i % 2 == 0 ? 90.0 : 5.0; });
    config.blanking = each_lane<S>(lane, [](int i) { return 0.04 * i; });
    return config;
  }
};

/// The recursion; the noise of some lanes is diagonal.
struct Riccati {
  template <class S>
  using Observer = esokit::ExtendedStateFilter<1, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_chain<S>(typename Observer<S>::Config{}, lane, again);
    config.measurement_variance = each_lane<S>(lane, [](int i) { return 0.01 * (1 + i); });
    const S mixed = each_lane<S>(lane, [](int i) { return i % 2 == 0 ? 0.0 : 0.05; });
    config.process_covariance = {{S(0.01), mixed}, {mixed, S(0.5)}};
    config.inflation = each_lane<S>(lane, [=](int i) { return (again ? 0.04 : 0.02) * (1 + i); });
    return config;
  }
};

/// Gains out of a table, then their limit; after a gap the recursion of some lanes.
struct RiccatiTable {
  template <class S>
  using Observer = esokit::ExtendedStateFilter<1, S, 1, esokit::NoNominalModel, 30>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_chain<S>(typename Observer<S>::Config{}, lane, again);
    config.measurement_variance = each_lane<S>(lane, [](int i) { return 0.01 * (1 + i); });
    config.disturbance_bounds = {S(0.0), each_lane<S>(lane, [](int i) { return 0.5 + i; })};
    config.inflation = S(0.05);
    config.mode = esokit::RiccatiMode::start_table;
    return config;
  }
};

/// What d is thought to be; the same object for packs and scalars.
struct Nominal {
  template <class S>
  S operator()(const esokit::Vector<S, 1>& x, const S& u, const S&) const {
    return S(-0.5) * x[0] + S(0.125) * u;
  }
};

/// With a gate in every second lane, and a model.
struct GatedRiccati {
  template <class S>
  using Observer = esokit::ExtendedStateFilter<1, S, 1, Nominal>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_chain<S>(typename Observer<S>::Config{}, lane, again);
    config.measurement_variance = S(0.01);
    config.disturbance_bounds = {S(0.0), each_lane<S>(lane, [](int i) { return 0.5 + i; })};
    config.inflation_rule = esokit::InflationRule::adaptive;
    config.outlier_threshold = each_lane<S>(lane, [](int i) { return i % 2 == 0 ? 0.0 : 9.0; });
    return config;
  }
};

/// What all observers tell, of the pack's lanes and of the scalars.
template <class Packed, class One>
void expect_equal(const Packed& packed, const std::vector<One>& lanes) {
  using S = typename Packed::scalar_type;
  const auto estimate = packed.estimate();
  for (int i = 0; i < lane_count<S>; ++i) {
    const One& one = lanes[static_cast<std::size_t>(i)];
    ASSERT_TRUE(lane_equals(estimate, one.estimate(), i)) << "lane " << i;
    ASSERT_TRUE(lane_equals(packed.template estimate<1>(), one.template estimate<1>(), i));
    ASSERT_TRUE(lane_equals(packed.total_disturbance(), one.total_disturbance(), i));
    ASSERT_TRUE(lane_equals(packed.level_estimate(0), one.level_estimate(0), i));
    ASSERT_TRUE(lane_equals(packed.innovation(), one.innovation(), i)) << "lane " << i;
    ASSERT_TRUE(lane_equals(packed.applied_input(), one.applied_input(), i)) << "lane " << i;
    ASSERT_TRUE(lane_equals(packed.input_gain(), one.input_gain(), i));
    ASSERT_TRUE(lane_equals(packed.sample_time(), one.sample_time(), i));
    ASSERT_EQ(packed.missed()[i], one.missed()) << "lane " << i;
    ASSERT_EQ(packed.restarts()[i], one.restarts()) << "lane " << i;
    if constexpr (requires { one.preview(); }) {
      ASSERT_TRUE(lane_equals(packed.preview().offset, one.preview().offset, i)) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.preview().slope, one.preview().slope, i)) << "lane " << i;
    }
    if constexpr (requires { one.blanked(); }) {
      ASSERT_EQ(packed.blanked()[i], one.blanked()) << "lane " << i;
      ASSERT_EQ(packed.settled()[i], one.settled()) << "lane " << i;
      ASSERT_EQ(packed.age()[i], one.age()) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.blanking(), one.blanking(), i)) << "lane " << i;
    }
    if constexpr (requires { one.normalised_innovation(); }) {
      ASSERT_TRUE(lane_equals(packed.covariance().row(0), one.covariance().row(0), i));
      ASSERT_TRUE(lane_equals(packed.normalised_innovation(), one.normalised_innovation(), i));
      ASSERT_TRUE(lane_equals(packed.gain(), one.gain(), i));
      ASSERT_EQ(packed.frozen()[i], one.frozen()) << "lane " << i;
    }
    if constexpr (requires { one.gain_min(); }) {
      ASSERT_TRUE(lane_equals(packed.gain_min(), one.gain_min(), i)) << "lane " << i;
      ASSERT_TRUE(lane_equals(packed.gain_max(), one.gain_max(), i)) << "lane " << i;
    }
  }
}

template <class Kind, class S>
struct Of {
  using Observer = Kind;
  using Scalar = S;
};

template <class Case>
class Packs : public ::testing::Test {
 protected:
  using Kind = typename Case::Observer;
  using Scalar = typename Case::Scalar;
  using Number = LaneScalar<Scalar>;
  using Packed = typename Kind::template Observer<Scalar>;
  using Plain = typename Kind::template Observer<Number>;

  Packs() {
    for (int i = 0; i < lane_count<Scalar>; ++i) {
      lanes.push_back(Plain::make(Kind::template config<Number>(i, false)).value());
    }
  }

  /// Calls step(observer, signal of it ..) on the pack and on each scalar; their status must agree.
  template <class Step, class... Signals>
  void both(const Step& step, const Signals&... signals) {
    const auto status = step(packed, signals...);
    for (int i = 0; i < lane_count<Scalar>; ++i) {
      Plain& one = lanes[static_cast<std::size_t>(i)];
      const StepStatus of_one = step(one, signals[i]...);
      ASSERT_EQ(status[i], of_one) << "lane " << i;
      flags = flags | of_one;
    }
    expect_equal(packed, lanes);
  }

  // Out of line, as each inlines the update of the pack: it is what takes long to compile here.
  [[gnu::noinline]] auto update_packed(const Scalar& y, const Scalar& u) {
    return packed.update(y, u);
  }
  [[gnu::noinline]] void update(const Scalar& y, const Scalar& u) {
    both([](auto& o, const auto& y_of, const auto& u_of) { return o.update(y_of, u_of); }, y, u);
  }

  void retune(bool again) {
    ASSERT_TRUE(packed.retune(Kind::template config<Scalar>(0, again)));
    for (int i = 0; i < lane_count<Scalar>; ++i) {
      ASSERT_TRUE(
          lanes[static_cast<std::size_t>(i)].retune(Kind::template config<Number>(i, again)));
    }
    expect_equal(packed, lanes);
  }

  Packed packed = Packed::make(Kind::template config<Scalar>(0, false)).value();
  std::vector<Plain> lanes;
  StepStatus flags{};  ///< all that were met
};

// With more lanes than a register has those whose steps differ, the others share them. The last are
// of an archetype: what the concept names and nothing more.
template <class... Kinds>
#ifdef ESOKIT_ONE_TYPE
using Cases = ::testing::Types<Of<Kinds, esokit::Pack<float>>..., Of<Cascade, Pack<float, 3>>>;
#else
using Cases = ::testing::Types<
    Of<Kinds, esokit::Pack<double>>..., Of<Linear, esokit::Pack<double, 8>>,
    Of<Cascade, esokit::Pack<double, 8>>, Of<AdjustableBandwidth, esokit::Pack<double, 8>>,
    Of<PowerSum, esokit::Pack<double, 8>>, Of<Algebraic, esokit::Pack<double, 8>>,
    Of<Linear, Pack<double, 4>>, Of<Cascade, Pack<float, 3>>, Of<Riccati, esokit::Pack<double>>,
    Of<RiccatiTable, esokit::Pack<float>>, Of<GatedRiccati, esokit::Pack<double>>>;
#endif
using All = Cases<Linear, ByPoles, HalfGain, Reduced, Cascade, CascadeByLevels, AdjustableBandwidth,
                  PowerSum, FalShape, OwnShape, Algebraic>;
TYPED_TEST_SUITE(Packs, All);

TYPED_TEST(Packs, AreTheirLanesWithoutFaults) {
  using S = typename TestFixture::Scalar;
  FaultySignal<S> y(1, 0);
  FaultySignal<S> u(2, 0);
  for (int k = 0; k < 2000; ++k) {
    this->update(y(), u());
    if (this->HasFatalFailure()) FAIL() << "sample " << k;
  }
  // A gate takes these signals for outliers now and then.
  if (!esokit::observer_traits<typename TestFixture::Plain>.gates_outliers) {
    EXPECT_EQ(this->flags, StepStatus::ok);
  }
}

TYPED_TEST(Packs, AreTheirLanesWithFaultsInSingleLanes) {
  using S = typename TestFixture::Scalar;
  FaultySignal<S> y(3, 0.05);
  FaultySignal<S> u(4, 0.02);
  for (int k = 0; k < 4000; ++k) {
    this->update(y(), u());
    if (this->HasFatalFailure()) FAIL() << "sample " << k;
  }
  for (const StepStatus flag :
       {StepStatus::measurement_rejected, StepStatus::input_rejected, StepStatus::restarted}) {
    EXPECT_TRUE(has(this->flags, flag)) << flag << " was not met";
  }
}

TYPED_TEST(Packs, AreTheirLanesInEveryCall) {
  using S = typename TestFixture::Scalar;
  FaultySignal<S> y(5, 0.02);
  FaultySignal<S> u(6, 0.01);
  Random random(7);
  for (int k = 0; k < 3000; ++k) {
    const int call = static_cast<int>(random.uniform(0, 100));
    if (call < 60) {
      this->update(y(), u());
    } else if (call < 75) {
      this->both([](auto& o, const auto& of) { return o.predict(of); }, u());
    } else if (call < 85) {
      this->both([](auto& o, const auto& of) { return o.correct(of); }, y());
    } else if (call < 88) {
      if constexpr (requires { this->packed.update_weighted(y(), u(), y()); }) {
        this->both([](auto& o, const auto& of_y, const auto& of_u,
                      const auto& of_r) { return o.update_weighted(of_y, of_u, of_r * of_r); },
                   y(), u(), y());
        if (this->HasFatalFailure()) FAIL() << "sample " << k << ", weighted";
      }
      this->both([](auto& o, const auto& of) { return o.revise_input(of); }, u());
    } else if (call < 90) {
      this->both([](auto& o, const auto& of) { return o.reset(of); }, y());
    } else if (call < 92) {
      this->both(
          [](auto& o, const auto& a, const auto& b) {
            auto state = o.estimate();
            state[0] = a;
            state[1] = b;
            return o.reset(state);
          },
          y(), y());
    } else if (call < 95) {
      this->both([](auto& o, const auto& of) { return o.shift_output(of); }, y());
    } else if (call < 98) {
      this->both([](auto& o, const auto& of) { return o.shift_disturbance(of); }, y());
    } else {
      this->both([](auto& o, const auto& of) { return o.reset(of); }, S(0.5));
      this->retune(k % 2 == 0);
    }
    if (this->HasFatalFailure()) FAIL() << "sample " << k << ", call " << call;
  }
}

/// What a lane suffers leaves the others alone.
TYPED_TEST(Packs, KeepOneLanesTroubleInIt) {
  using S = typename TestFixture::Scalar;
  using One = typename TestFixture::Number;
  for (int bad = 0; bad < lane_count<S>; ++bad) {
    for (int k = 0; k < 3; ++k) {
      S y(0.25);
      y[bad] = k == 1 ? hidden_infinity<One>() : hidden_nan<One>();
      const auto status = this->update_packed(y, S(0.5));
      for (int i = 0; i < lane_count<S>; ++i) {
        EXPECT_EQ(has(status[i], StepStatus::measurement_rejected), i == bad);
        EXPECT_EQ(this->packed.missed()[i] > 0, i == bad);
      }
    }
    this->update_packed(S(0.25), S(0.5));
  }
}

TYPED_TEST(Packs, NameTheLaneOfAnError) {
  using S = typename TestFixture::Scalar;
  using Which = typename TestFixture::Kind;
  for (int bad = 0; bad < lane_count<S>; ++bad) {
    auto config = Which::template config<S>(0, false);
    config.sample_time[bad] = -config.sample_time[bad];
    const auto made = TestFixture::Packed::make(config);
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().lane, bad);
    EXPECT_STREQ(made.error().field, "sample_time");
    EXPECT_STREQ(made.error().rule, "must be finite and positive");
    EXPECT_EQ(made.error().value[bad], config.sample_time[bad]);
    const auto before = this->packed;
    const auto refused = this->packed.retune(config);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().lane, bad);
    expect_equal(before, this->lanes);
    expect_equal(this->packed, this->lanes);
  }
}

TEST(PackOfAdjustableBandwidth, NamesTheLaneWithoutACertificate) {
  using S = esokit::Pack<double, 2>;
  const auto made = esokit::AdjustableBandwidthEso<2, S>::make({.observer_bandwidth = S(50.0),
                                                                .bandwidth_ratio = S({0.7, 0.1}),
                                                                .input_gain = S(1.0),
                                                                .sample_time = S(0.01)});
  const auto alone = esokit::AdjustableBandwidthEso<2>::make(
      {.observer_bandwidth = 50, .bandwidth_ratio = 0.1, .input_gain = 1, .sample_time = 0.01});
  ASSERT_FALSE(made);
  ASSERT_FALSE(alone);
  EXPECT_EQ(made.error().lane, 1);
  EXPECT_STREQ(made.error().rule, alone.error().rule);
  EXPECT_EQ(made.error().limit[1], alone.error().limit);
  std::ostringstream text;
  text << made.error();
  EXPECT_NE(text.str().find("bandwidth_ratio = 0.1: must be certified"), std::string::npos);
  EXPECT_NE(text.str().find("(lane 1)"), std::string::npos);
}

/// All lanes take new settings or none: here the estimate of one would overflow.
TEST(Pack, TakesNoSettingsThatALaneCannotTake) {
  using S = esokit::Pack<double>;
  const auto with_gain = [](double gain) {
    S b0(1.0);
    b0[lane_count<S> - 1] = gain;
    return esokit::LinearEso<1, S>::Config{
        .observer_bandwidth = S(10.0), .input_gain = b0, .sample_time = S(0.01)};
  };
  auto observer = esokit::LinearEso<1, S>::make(with_gain(1)).value();
  observer.update(S(0.5), S(1e10));
  const auto before = observer.estimate();
  auto changed = with_gain(1e300);
  changed.observer_bandwidth = S(20.0);
  const auto refused = observer.retune(changed);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, lane_count<S> - 1);
  EXPECT_STREQ(refused.error().rule, "would make the estimate not finite");
  for (int i = 0; i < lane_count<S>; ++i) {
    EXPECT_EQ(observer.input_gain()[i], 1);
    EXPECT_EQ(observer.estimate()[0][i], before[0][i]);
  }
}

}  // namespace observer_pack_test
}  // namespace esokit_test
