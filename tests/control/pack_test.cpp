// A Packed controller is as many of the plain scalar: u, requested u, mode and status, bit for
// bit, with limits, rates, start holds, gaps and safe mode of each lane its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <esokit/control/adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <memory>
#include <string>
#include <support/lanes.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_pack_test {

using esokit::lane_count;
using esokit::LaneScalar;
using esokit::LoopMode;
using esokit::StepStatus;

template <class S>
S by_lane(int lane, double first, double step) {
  return static_cast<S>(first + step * lane);
}

/// What all controllers here have: limits and rates of their own, one lane without any.
template <class S, class Config>
Config with_loop(Config config, int lane, bool again) {
  config.observer.observer_bandwidth = by_lane<S>(lane, again ? 30 : 25, 5);
  config.observer.input_gain = by_lane<S>(lane, again ? 1.5 : 1.25, 0.5);
  config.observer.sample_time = by_lane<S>(lane, 0.01, 0.005);
  config.observer.max_gap = 6;
  config.controller_bandwidth = by_lane<S>(lane, again ? 4 : 3, 0.5);
  const auto but_one = [=](double value, double none) {
    return static_cast<S>(lane == 1 ? none : value + lane);
  };
  constexpr double most = (std::numeric_limits<S>::max)();
  config.limits = {but_one(-40, -most), but_one(30, most), but_one(500, most)};
  config.start_hold = {static_cast<S>(0.1 * (lane % 3)), by_lane<S>(lane, 0.5, 1)};
  config.missing.most = 3 + lane % 3;
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

/// It softens at the limits, where a lane has them.
struct OfThirdOrder {
  template <class S>
  using Controller = esokit::Adrc<esokit::LinearEso<3, S>>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = with_loop<S>(typename Controller<S>::Config{}, lane, again);
    config.observer.input_gain = by_lane<S>(lane, again ? -35 : -45, 10);
    const auto nearer = [=](S limit) { return lane == 1 ? limit : limit / 4; };
    config.limits.lower = nearer(config.limits.lower);
    config.limits.upper = nearer(config.limits.upper);
    return config;
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
    config.missing.most = 3;
    config.domain = esokit::TimeDomain::sampled;
    return config;
  }
};

/// A controller of packs and the plain ones that it has to be, of any type: what plays them is
/// compiled once.
class Pair {
 public:
  enum class Call { update, report, miss, derive, track, start };
  /// An error of a config.
  struct Named {
    int lane;
    std::string text;
  };

  virtual ~Pair() = default;
  /// Signals with faults from now on.
  virtual void feed(unsigned seed, double faults_of_y, double other_faults) = 0;
  /// Calls both with the next signals. @return the lane that differs, -1: none
  virtual int call(Call what) = 0;
  virtual int start_and_retune(bool again) = 0;
  /// An update of the pack alone, without a measurement in its last lane.
  virtual void update(double y, double r, bool last_is_bad) = 0;
  /// What make and retune say of a config with a bad rate in a lane; nothing changes.
  [[nodiscard]] virtual Named made_with_bad_rate(int lane) const = 0;
  virtual Named retuned_with_bad_rate(int lane) = 0;
  [[nodiscard]] virtual int differs() const = 0;
  [[nodiscard]] virtual std::vector<LoopMode> modes() const = 0;
  [[nodiscard]] virtual bool finite() const = 0;
};

template <class Kind, class S>
class PairOf final : public Pair {
  using One = LaneScalar<S>;
  using Plain = typename Kind::template Controller<One>;
  static constexpr int count = lane_count<S>;
  using Packed = esokit::Packed<Plain, count>;
  static auto settings(bool again) {
    return [again](int i) { return Kind::template config<One>(i, again); };
  }

 public:
  PairOf() {
    for (int i = 0; i < count; ++i) {
      lanes_.push_back(Plain::make(settings(false)(i)).value());
    }
  }

  void feed(unsigned seed, double faults_of_y, double other_faults) override {
    y_ = FaultySignal<S>(seed, faults_of_y);
    r_ = FaultySignal<S>(seed + 1, other_faults);
    u_ = FaultySignal<S>(seed + 2, other_faults);
  }

  int call(Call what) override {
    const S y = y_();
    const S r = r_();
    const S u = u_();
    return both([&](auto& c, const auto& in) {
      using T = std::remove_cvref_t<decltype(in(y))>;
      switch (what) {
        case Call::update:
          return Answers(c.update(in(y), in(r)));
        case Call::report:
          c.applied(in(u));
          return Answers(c.update(in(y), in(r)));
        case Call::miss:
          return Answers(c.update_without_measurement(in(r)));
        case Call::derive: {
          return Answers(c.update(in(y), esokit::Vector<T, 2>{in(r), in(u)}));
        }
        case Call::track:
          if constexpr (requires { c.together(); }) {
            return Answers(c.each([&](auto& lane, int i) { return lane.track(y[i], r[i], u[i]); }));
          } else {
            return Answers(c.track(in(y), in(r), in(u)));
          }
        case Call::start:
          return Answers(c.start(in(y), in(u)));
      }
      return Answers();
    });
  }

  int start_and_retune(bool again) override {
    packed_.start(S(0.5), S(0.5));
    bool done = packed_.retune(settings(again)).has_value();
    for (int i = 0; i < count; ++i) {
      Plain& one = lanes_[static_cast<std::size_t>(i)];
      one.start(One(0.5), One(0.5));
      done = done && one.retune(settings(again)(i));
    }
    EXPECT_TRUE(done);
    return differs();
  }

  void update(double y, double r, bool last_is_bad) override {
    S measured(y);
    if (last_is_bad) measured[count - 1] = hidden_nan<One>();
    packed_.update(measured, S(r));
  }

  [[nodiscard]] Named made_with_bad_rate(int lane) const override {
    return named(Packed::make(with_bad_rate(lane)));
  }
  Named retuned_with_bad_rate(int lane) override {
    return named(packed_.retune(with_bad_rate(lane)));
  }

  [[nodiscard]] int differs() const override {
    const Answers mine = state(packed_.together());
    for (int i = 0; i < count; ++i) {
      if (mine.differs(i, state(lanes_[static_cast<std::size_t>(i)])) != -1) return i;
    }
    return -1;
  }
  [[nodiscard]] std::vector<LoopMode> modes() const override {
    std::vector<LoopMode> modes;
    for (int i = 0; i < count; ++i) modes.push_back(packed_.mode()[i]);
    return modes;
  }
  [[nodiscard]] bool finite() const override { return all(is_finite(packed_.output())); }

 private:
  template <class Controller>
  static Answers state(const Controller& c) {
    return Answers(c.output(), c.requested(), c.status(), c.mode(), c.observer().estimate(),
                   c.observer().missed(), c.gains(), c.softness());
  }
  template <class Step>
  int both(const Step& step) {
    const Answers mine = step(packed_, [](const S& all) { return all; });
    for (int i = 0; i < count; ++i) {
      const auto of_lane = [i](const S& all) { return all[i]; };
      if (mine.differs(i, step(lanes_[static_cast<std::size_t>(i)], of_lane)) != -1) return i;
    }
    return differs();
  }
  static auto with_bad_rate(int lane) {
    return [lane](int i) {
      auto config = settings(false)(i);
      if (i == lane) config.limits.rate = -config.limits.rate;
      return config;
    };
  }
  template <class Made>
  static Named named(const Made& made) {
    return {made ? -1 : made.error().lane, refusal(made)};
  }

  Packed packed_ = Packed::make(settings(false)).value();
  std::vector<Plain> lanes_;
  FaultySignal<S> y_{1, 0}, r_{2, 0}, u_{3, 0};
};

// One with more lanes than a register has; the rest of them is in observer/pack_test.cpp.
using Pairs = std::vector<std::unique_ptr<Pair>>;
Pairs pairs() {
#ifdef ESOKIT_ONE_TYPE
  using S = esokit::Pack<float>;
  using Wide = S;
#else
  using S = esokit::Pack<double>;
  using Wide = esokit::Pack<double, 8>;
#endif
  Pairs all;
  all.push_back(std::make_unique<PairOf<OfLinear, Wide>>());
  all.push_back(std::make_unique<PairOf<OfThirdOrder, S>>());
  all.push_back(std::make_unique<PairOf<ErrorBasedOfCascade, S>>());
  all.push_back(std::make_unique<PairOf<OfAlgebraic, S>>());
  all.push_back(std::make_unique<PairOf<Divided, S>>());
  return all;
}

bool mixed(const std::vector<LoopMode>& modes) {
  return std::count(modes.begin(), modes.end(), modes[0]) != static_cast<int>(modes.size());
}
bool safe(const std::vector<LoopMode>& modes) {
  return std::count(modes.begin(), modes.end(), LoopMode::safe) > 0;
}

TEST(ControllerPacks, AreTheirLanesWithoutFaults) {
  for (const auto& pair : pairs()) {
    bool were_mixed = false;
    for (int k = 0; k < 1500; ++k) {
      ASSERT_EQ(pair->call(Pair::Call::update), -1) << "sample " << k;
      were_mixed = were_mixed || mixed(pair->modes());
      ASSERT_FALSE(safe(pair->modes()));
    }
    EXPECT_TRUE(were_mixed) << "some lanes hold at first";
  }
}

TEST(ControllerPacks, AreTheirLanesInEveryCall) {
  for (const auto& pair : pairs()) {
    pair->feed(3, 0.06, 0.01);
    Random random(6);
    bool were_mixed = false;
    bool were_safe = false;
    for (int k = 0; k < 4000; ++k) {
      const int draw = random.index(200);
      const auto what = draw < 140   ? Pair::Call::update
                        : draw < 160 ? Pair::Call::report
                        : draw < 170 ? Pair::Call::miss
                        : draw < 180 ? Pair::Call::derive
                        : draw < 190 ? Pair::Call::track
                                     : Pair::Call::start;
      ASSERT_EQ(draw < 197 ? pair->call(what) : pair->start_and_retune(k % 2 == 0), -1)
          << "sample " << k << ", call " << draw;
      were_mixed = were_mixed || mixed(pair->modes());
      were_safe = were_safe || safe(pair->modes());
      ASSERT_TRUE(pair->finite());
    }
    EXPECT_TRUE(were_mixed);
    EXPECT_TRUE(were_safe);
  }
}

/// A lane without measurements goes to safe mode alone, and comes back alone.
TEST(ControllerPacks, KeepSafeModeInItsLane) {
  for (const auto& pair : pairs()) {
    for (int k = 0; k < 60; ++k) pair->update(0.1, 0.2, false);
    for (int k = 0; k < 10; ++k) pair->update(0.1, 0.2, true);
    std::vector<LoopMode> wanted(pair->modes().size(), LoopMode::running);
    wanted.back() = LoopMode::safe;
    EXPECT_EQ(pair->modes(), wanted);
  }
}

TEST(ControllerPacks, NameTheLaneOfAnError) {
  for (const auto& pair : pairs()) {
    for (int bad = 0; bad < static_cast<int>(pair->modes().size()); ++bad) {
      for (const auto& error : {pair->made_with_bad_rate(bad), pair->retuned_with_bad_rate(bad)}) {
        EXPECT_EQ(error.lane, bad);
        EXPECT_EQ(error.text, "limits.rate: must be finite and positive");
      }
      EXPECT_EQ(pair->differs(), -1);
    }
  }
}

/// The parts, on their own.
TEST(PackOfALimiter, LimitsEachLaneByItsOwn) {
  using S = esokit::Pack<double, 4>;
  constexpr double none = (std::numeric_limits<double>::max)();
  const esokit::Limits<double> limits[] = {
      {-1, 1, 10}, {-2, 2, none}, {-3, 3, 20}, {-none, none, 1e308}};
  std::vector<esokit::Limiter<double>> lanes;
  for (const auto& of_lane : limits) {
    lanes.push_back(esokit::Limiter<double>::make(of_lane, 0.01).value());
  }
  const esokit::Packed<esokit::Limiter<double>, 4> all(
      [&](int i) { return lanes[static_cast<std::size_t>(i)]; });
  auto packed = all.together();
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
}

}  // namespace control_pack_test
}  // namespace esokit_test
