// A Packed observer is as many observers of the plain scalar: every estimate, status, count and
// innovation, bit for bit, with settings, faults, gaps, restarts and retunes of each lane its own.
#include <gtest/gtest.h>

#include <array>
#include <esokit/core/packed.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <support/lanes.hpp>
#include <support/law_registration.hpp>
#include <support/pack.hpp>
#include <support/refusal.hpp>
#include <type_traits>
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

/// Sets what all configs have.
template <class S, class Config>
Config with_chain(Config config, int lane, bool again) {
  config.input_gain = static_cast<S>(input_gain(lane, again));
  config.sample_time = static_cast<S>(sample_time(lane, again));
  config.max_gap = max_gap;
  return config;
}

template <class S, class Config>
Config by_bandwidth(int lane, bool again) {
  Config config{};
  config.observer_bandwidth = static_cast<S>(bandwidth(lane, again));
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
    config.bandwidth_factor = static_cast<S>(1.25 + 0.25 * lane);
    return config;
  }
};

struct CascadeByLevels {
  template <class S>
  using Observer = esokit::CascadeEso<1, 2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    typename Observer<S>::Config config{};
    config.level_bandwidths = {static_cast<S>(bandwidth(lane, again)), static_cast<S>(30.0 + lane)};
    return with_chain<S>(config, lane, again);
  }
};

/// With an actuator, a pole of the plant and a sine.
struct Modelled {
  template <class S>
  using Observer = esokit::ModelEso<
      esokit::ModelParts{.order = 1, .plant_poles = true, .actuator = 1, .resonators = 1}, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.model.plant = {static_cast<S>(1 + lane)};
    config.model.actuator.time_constant = static_cast<S>(again ? 0.06 : 0.05);
    config.model.resonators[0].frequency = static_cast<S>(15 + lane);
    return config;
  }
};

/// A disturbance that enters elsewhere than u, a zero, and a sensor.
struct OfAPlant {
  template <class S>
  using Observer = esokit::PlantEso<2, esokit::ModelParts{.order = 1, .sensor = 1}, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.model.plant.a = {{S(0.0), S(1.0)}, {static_cast<S>(-3 - lane), S(-2.0)}};
    config.model.plant.b = {S(1.0), S(0.5)};
    config.model.plant.c = {{S(1.0), S(0.25)}};
    config.model.plant.e = {S(0.0), S(1.0)};
    config.model.sensor.time_constant = static_cast<S>(again ? 0.03 : 0.02);
    return config;
  }
};

struct AdjustableBandwidth {
  template <class S>
  using Observer = esokit::AdjustableBandwidthEso<2, S>;
  template <class S>
  static auto config(int lane, bool again) {
    auto config = by_bandwidth<S, typename Observer<S>::Config>(lane, again);
    config.bandwidth_ratio = static_cast<S>(0.6 + 0.2 * (lane % 4));
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
    config.shape.alpha = static_cast<S>(0.5 + 0.25 * (lane % 4));
    config.shape.gain_beta = static_cast<S>(0.1 + 0.1 * (lane % 4));
    config.shape.beta = S(0.5);
    config.gain_min = static_cast<S>(0.55 + 0.0625 * (lane % 4));
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
    config.shape.linear_width = static_cast<S>(0.05 * (1 + lane));
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
    config.frequency_shift = static_cast<S>(lane % 2 == 0 ? 90.0 : 5.0);
    config.blanking = static_cast<S>(0.04 * lane);
    config.start_index = lane % 4 == 1 ? 5 : 0;
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
    config.measurement_variance = static_cast<S>(0.01 * (1 + lane));
    const auto mixed = static_cast<S>(lane % 2 == 0 ? 0.0 : 0.05);
    config.process_covariance = {{S(0.01), mixed}, {mixed, S(0.5)}};
    config.inflation = static_cast<S>((again ? 0.04 : 0.02) * (1 + lane));
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
    config.measurement_variance = static_cast<S>(0.01 * (1 + lane));
    config.disturbance_bounds = {S(0.0), static_cast<S>(0.5 + lane)};
    config.inflation = S(0.05);
    config.mode = lane == 1 ? esokit::RiccatiMode::frozen : esokit::RiccatiMode::start_table;
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
    config.disturbance_bounds = {S(0.0), static_cast<S>(0.5 + lane)};
    config.inflation_rule = esokit::InflationRule::adaptive;
    config.outlier_threshold = static_cast<S>(lane % 2 == 0 ? 0.0 : 9.0);
    return config;
  }
};

// ---- The tests, compiled once: of each type they know what it can be asked.

/// A number for each lane; a double holds a float. A plain scalar has the first.
constexpr int most_lanes = 8;
using Numbers = std::array<double, most_lanes>;
using Statuses = std::array<StepStatus, most_lanes>;

/// What an observer tells of a lane.
class Told {
 public:
  void add(const char* name, double value) {
    names_.push_back(name);
    values_.push_back(value);
  }
  /// The first that differs in a bit, or "".
  [[nodiscard]] std::string difference(const Told& other) const {
    if (names_.size() != other.names_.size()) return "another number of values";
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (!same_bits(values_[i], other.values_[i])) return names_[i];
    }
    return "";
  }

 private:
  std::vector<const char*> names_;
  std::vector<double> values_;
};

/// How a bad config of one lane is refused.
struct Refused {
  std::string by_make, by_retune;
  int lane_of_make, lane_of_retune;
  bool value_is_given;
};

/// An observer of packs or of plain scalars.
class Subject {
 public:
  virtual ~Subject() = default;
  virtual Statuses update(const Numbers& y, const Numbers& u) = 0;
  virtual Statuses update_weighted(const Numbers& y, const Numbers& u, const Numbers& root) = 0;
  virtual Statuses predict(const Numbers& u) = 0;
  virtual Statuses correct(const Numbers& y) = 0;
  virtual Statuses revise_input(const Numbers& u) = 0;
  virtual Statuses reset(const Numbers& y) = 0;
  virtual Statuses reset_two(const Numbers& first, const Numbers& second) = 0;
  virtual Statuses shift_output(const Numbers& y) = 0;
  virtual Statuses shift_disturbance(const Numbers& d) = 0;
  virtual bool retune(int lane, bool again) = 0;
  virtual Refused refuse(int bad) = 0;
  [[nodiscard]] virtual Told told(int lane) const = 0;
};

template <class Kind, class S>
class Of final : public Subject {
  using One = LaneScalar<S>;
  using Plain = typename Kind::template Observer<One>;
  static constexpr bool is_pack = esokit::PackScalar<S>;
  struct Same {
    using type = Plain;
  };
  template <class T>
  struct InPacks {
    using type = esokit::Packed<Plain, lane_count<T>>;
  };
  using Observer = typename std::conditional_t<is_pack, InPacks<S>, Same>::type;

  static S in(const Numbers& x) {
    if constexpr (is_pack) {
      S all(0.0);
      for (int i = 0; i < lane_count<S>; ++i) {
        all[i] = static_cast<LaneScalar<S>>(x[static_cast<std::size_t>(i)]);
      }
      return all;
    } else {
      return static_cast<S>(x[0]);
    }
  }
  static Statuses out(const esokit::StatusOf<S>& status) {
    Statuses all{};
    if constexpr (is_pack) {
      for (int i = 0; i < lane_count<S>; ++i) all[static_cast<std::size_t>(i)] = status[i];
    } else {
      all[0] = status;
    }
    return all;
  }
  /// Of a number, of a count, or of the rows of a vector.
  template <class T>
  static void add(Told& told, int lane, const char* name, const T& x) {
    if constexpr (requires { x.size(); } && !std::is_same_v<T, S>) {
      for (decltype(x.size()) r = 0; r < x.size(); ++r) add(told, lane, name, x[r]);
    } else if constexpr (is_pack) {
      told.add(name, static_cast<double>(x[lane]));
    } else {
      told.add(name, static_cast<double>(x));
    }
  }

  /// Of a lane, or of each.
  static auto settings([[maybe_unused]] int lane, bool again) {
    if constexpr (is_pack) {
      return [again](int i) { return Kind::template config<One>(i, again); };
    } else {
      return Kind::template config<One>(lane, again);
    }
  }
  /// What only lanes have.
  template <class F>
  Statuses each(const F& f, const Numbers& x, const Numbers& v = {}, const Numbers& w = {}) {
    const auto number = [](const Numbers& all, int i) {
      return static_cast<One>(all[static_cast<std::size_t>(i)]);
    };
    const auto of_one = [&](Plain& one, int i) {
      return f(one, number(x, i), number(v, i), number(w, i));
    };
    if constexpr (is_pack) {
      return out(observer_.each(of_one));
    } else {
      return out(of_one(observer_, 0));
    }
  }

 public:
  explicit Of(int lane) : observer_(Observer::make(settings(lane, false)).value()) {}

  Statuses update(const Numbers& y, const Numbers& u) override {
    return out(observer_.update(in(y), in(u)));
  }
  Statuses update_weighted(const Numbers& y, const Numbers& u, const Numbers& root) override {
    if constexpr (requires(Plain & o) { o.update_weighted(One(), One(), One()); }) {
      return each([](Plain& o, One a, One b, One r) { return o.update_weighted(a, b, r * r); }, y,
                  u, root);
    } else {
      return {};
    }
  }
  Statuses predict(const Numbers& u) override { return out(observer_.predict(in(u))); }
  Statuses correct(const Numbers& y) override { return out(observer_.correct(in(y))); }
  Statuses revise_input(const Numbers& u) override {
    return each([](Plain& o, One v, One, One) { return o.revise_input(v); }, u);
  }
  Statuses reset(const Numbers& y) override { return out(observer_.reset(in(y))); }
  Statuses reset_two(const Numbers& first, const Numbers& second) override {
    auto state = observer_.estimate();
    state[0] = in(first);
    state[1] = in(second);
    return out(observer_.reset(state));
  }
  Statuses shift_output(const Numbers& y) override {
    return each(
        [](Plain& o, One x, One, One) {
          if constexpr (requires { o.shift_output(x); }) {
            return o.shift_output(x);
          } else {
            return StepStatus::ok;
          }
        },
        y);
  }
  Statuses shift_disturbance(const Numbers& d) override {
    return each([](Plain& o, One x, One, One) { return o.shift_disturbance(x); }, d);
  }
  bool retune(int lane, bool again) override {
    return observer_.retune(settings(lane, again)).has_value();
  }
  Refused refuse([[maybe_unused]] int bad) override {
    if constexpr (is_pack) {
      const auto config = [bad](int i) {
        auto one = Kind::template config<One>(i, false);
        if (i == bad) one.sample_time = -one.sample_time;
        return one;
      };
      const auto made = Observer::make(config);
      const auto retuned = observer_.retune(config);
      if (made || retuned) return {};
      return {refusal(made), refusal(retuned), made.error().lane, retuned.error().lane,
              made.error().value == config(bad).sample_time};
    } else {
      return {};
    }
  }
  [[nodiscard]] Told told(int lane) const override {
    const auto& o = packs();
    Told told;
    const auto add = [&](const char* name, const auto& x) { Of::add(told, lane, name, x); };
    add("estimate", o.estimate());
    add("estimate<1>", o.template estimate<1>());
    add("total_disturbance", o.total_disturbance());
    add("level_estimate", o.level_estimate(0));
    add("innovation", o.innovation());
    add("applied_input", o.applied_input());
    add("input_gain", o.input_gain());
    add("sample_time", o.sample_time());
    add("missed", o.missed());
    if constexpr (is_pack) {
      add_rest(told, observer_[lane]);
    } else {
      add_rest(told, o);
    }
    return told;
  }

 private:
  template <class, class>
  friend class Of;
  [[nodiscard]] const auto& packs() const {
    if constexpr (is_pack) {
      return observer_.together();
    } else {
      return observer_;
    }
  }
  /// What is not read from the packs.
  static void add_rest(Told& told, const Plain& o) {
    Of<Kind, One>::add(told, 0, "restarts", o.restarts());
    Of<Kind, One>::add(told, 0, "max_gap", o.max_gap());
    if constexpr (requires { o.preview(); }) {
      Of<Kind, One>::add(told, 0, "preview offset", o.preview().offset);
      Of<Kind, One>::add(told, 0, "preview slope", o.preview().slope);
    }
    if constexpr (requires { o.blanked(); }) {
      Of<Kind, One>::add(told, 0, "blanked", o.blanked());
      Of<Kind, One>::add(told, 0, "settled", o.settled());
      Of<Kind, One>::add(told, 0, "age", o.age());
      Of<Kind, One>::add(told, 0, "blanking", o.blanking());
    }
    if constexpr (requires { o.normalised_innovation(); }) {
      for (int r = 0; r < Plain::size; ++r)
        Of<Kind, One>::add(told, 0, "covariance", o.covariance()(0, r));
      Of<Kind, One>::add(told, 0, "normalised_innovation", o.normalised_innovation());
      Of<Kind, One>::add(told, 0, "gain", o.gain());
      Of<Kind, One>::add(told, 0, "frozen", o.frozen());
    }
    if constexpr (requires { o.gain_min(); }) {
      Of<Kind, One>::add(told, 0, "gain_min", o.gain_min());
      Of<Kind, One>::add(told, 0, "gain_max", o.gain_max());
    }
  }

  Observer observer_;
};

/// What the tests know of a case.
struct Case {
  int lanes;
  bool single, gates, weighs;
  std::unique_ptr<Subject> (*packed)();
  std::unique_ptr<Subject> (*plain)(int lane);
};

template <class Kind, class S>
Case case_of() {
  using One = LaneScalar<S>;
  using Plain = typename Kind::template Observer<One>;
  return {lane_count<S>, std::is_same_v<One, float>, esokit::observer_traits<Plain>.gates_outliers,
          requires(Plain o){o.update_weighted(One(0), One(0), One(1));
}
, []() -> std::unique_ptr<Subject> { return std::unique_ptr<Subject>(new Of<Kind, S>(0)); },
    [](int lane) -> std::unique_ptr<Subject> {
      return std::unique_ptr<Subject>(new Of<Kind, One>(lane));
    }
};  // namespace observer_pack_test
}  // namespace esokit_test

/// A pack and the scalars that it has to equal.
class Packs {
 public:
  explicit Packs(const Case& of) : count(of.lanes), packed(of.packed()), of_(of) {
    for (int i = 0; i < count; ++i) lanes.push_back(of.plain(i));
  }

  /// The same call of the pack and of each scalar; their status must agree.
  template <class... Signals>
  void both(Statuses (Subject::*call)(const Signals&...), const Signals&... signals) {
    const Statuses status = ((*packed).*call)(signals...);
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      const StepStatus of_one = ((*lanes[i]).*call)(Numbers{signals[i]}...)[0];
      ASSERT_EQ(status[i], of_one) << "lane " << i;
      flags = flags | of_one;
    }
    expect_equal();
  }
  void expect_equal() const {
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      ASSERT_EQ(packed->told(static_cast<int>(i)).difference(lanes[i]->told(0)), "")
          << "lane " << i;
    }
  }
  void retune(bool again) {
    ASSERT_TRUE(packed->retune(0, again));
    for (int i = 0; i < count; ++i) {
      ASSERT_TRUE(lanes[static_cast<std::size_t>(i)]->retune(i, again));
    }
    expect_equal();
  }
  /// A signal with faults, in the lanes' precision.
  std::function<Numbers()> signal(unsigned seed, double faults) const {
    return of_.single ? of_lanes<float>(seed, faults) : of_lanes<double>(seed, faults);
  }

  int count;
  std::unique_ptr<Subject> packed;
  std::vector<std::unique_ptr<Subject>> lanes;
  StepStatus flags{};  ///< all that were met

 private:
  template <class One>
  static std::function<Numbers()> of_lanes(unsigned seed, double faults) {
    return [from = FaultySignal<Pack<One, most_lanes>>(seed, faults)]() mutable {
      const auto all = from();
      Numbers numbers{};
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(all[i]);
      return numbers;
    };
  }

  Case of_;
};

void are_their_lanes_without_faults(const Case& of) {
  Packs packs(of);
  auto y = packs.signal(1, 0);
  auto u = packs.signal(2, 0);
  for (int k = 0; k < 2000; ++k) {
    packs.both(&Subject::update, y(), u());
    if (::testing::Test::HasFatalFailure()) FAIL() << "sample " << k;
  }
  // A gate takes these signals for outliers now and then.
  if (!of.gates) {
    EXPECT_EQ(packs.flags, StepStatus::ok);
  }
}

void are_their_lanes_with_faults_in_single_lanes(const Case& of) {
  Packs packs(of);
  auto y = packs.signal(3, 0.05);
  auto u = packs.signal(4, 0.02);
  for (int k = 0; k < 4000; ++k) {
    packs.both(&Subject::update, y(), u());
    if (::testing::Test::HasFatalFailure()) FAIL() << "sample " << k;
  }
  for (const StepStatus flag :
       {StepStatus::measurement_rejected, StepStatus::input_rejected, StepStatus::restarted}) {
    EXPECT_TRUE(has(packs.flags, flag)) << flag << " was not met";
  }
}

void are_their_lanes_in_every_call(const Case& of) {
  Packs packs(of);
  auto y = packs.signal(5, 0.02);
  auto u = packs.signal(6, 0.01);
  Random random(7);
  for (int k = 0; k < 3000; ++k) {
    const int call = static_cast<int>(random.uniform(0, 100));
    if (call < 60) {
      packs.both(&Subject::update, y(), u());
    } else if (call < 75) {
      packs.both(&Subject::predict, u());
    } else if (call < 85) {
      packs.both(&Subject::correct, y());
    } else if (call < 88) {
      if (of.weighs) packs.both(&Subject::update_weighted, y(), u(), y());
      if (::testing::Test::HasFatalFailure()) FAIL() << "sample " << k << ", weighted";
      packs.both(&Subject::revise_input, u());
    } else if (call < 90) {
      packs.both(&Subject::reset, y());
    } else if (call < 92) {
      packs.both(&Subject::reset_two, y(), y());
    } else if (call < 95) {
      packs.both(&Subject::shift_output, y());
    } else if (call < 98) {
      packs.both(&Subject::shift_disturbance, y());
    } else {
      Numbers half;
      half.fill(0.5);
      packs.both(&Subject::reset, half);
      packs.retune(k % 2 == 0);
    }
    if (::testing::Test::HasFatalFailure()) FAIL() << "sample " << k << ", call " << call;
  }
}

/// What a lane suffers leaves the others alone.
void keep_one_lanes_trouble_in_it(const Case& of) {
  Packs packs(of);
  Numbers good;
  good.fill(0.25);
  Numbers u;
  u.fill(0.5);
  for (std::size_t bad = 0; bad < packs.lanes.size(); ++bad) {
    for (int k = 0; k < 3; ++k) {
      Numbers y = good;
      y[bad] = k == 1 ? hidden_infinity<double>() : hidden_nan<double>();
      const Statuses status = packs.packed->update(y, u);
      for (std::size_t i = 0; i < packs.lanes.size(); ++i) {
        EXPECT_EQ(has(status[i], StepStatus::measurement_rejected), i == bad);
        packs.lanes[i]->update({y[i]}, u);
      }
      packs.expect_equal();
    }
    packs.both(&Subject::update, good, u);
  }
}

void name_the_lane_of_an_error(const Case& of) {
  Packs packs(of);
  for (int bad = 0; bad < packs.count; ++bad) {
    const Refused refused = packs.packed->refuse(bad);
    EXPECT_EQ(refused.by_make, "sample_time: must be finite and positive");
    EXPECT_EQ(refused.by_retune, "sample_time: must be finite and positive");
    EXPECT_EQ(refused.lane_of_make, bad);
    EXPECT_EQ(refused.lane_of_retune, bad);
    EXPECT_TRUE(refused.value_is_given);
    packs.expect_equal();
  }
}

bool registered(int index, const std::string& type, const Case& of) {
  const auto test = [&](const char* name, void (*run)(const Case&)) {
    register_law("Packs/" + std::to_string(index), type, {name, [=] { run(of); }});
  };
  test("AreTheirLanesWithoutFaults", are_their_lanes_without_faults);
  test("AreTheirLanesWithFaultsInSingleLanes", are_their_lanes_with_faults_in_single_lanes);
  test("AreTheirLanesInEveryCall", are_their_lanes_in_every_call);
  test("KeepOneLanesTroubleInIt", keep_one_lanes_trouble_in_it);
  test("NameTheLaneOfAnError", name_the_lane_of_an_error);
  return true;
}

template <class Kind, class S>
struct As {};

template <class... Kinds, class... Scalars>
bool register_cases(TypeList<As<Kinds, Scalars>...>) {
  int index = 0;
  return (registered(index++, ::testing::internal::GetTypeName<As<Kinds, Scalars>>(),
                     case_of<Kinds, Scalars>()) &&
          ...);
}

// Of one register, and of two where the steps differ in more than the gains.
using OneRegister = esokit::Pack<double>;
using TwoRegisters = esokit::Pack<double, 2 * esokit::default_lanes<double>>;
#ifdef ESOKIT_ONE_TYPE
template <class... Kinds>
using InFloat = TypeList<As<Kinds, esokit::Pack<float>>...>;
using Cases = InFloat<Linear, ByPoles, HalfGain, Reduced, Cascade, CascadeByLevels,
                      AdjustableBandwidth, PowerSum, FalShape, OwnShape, Algebraic, Modelled>;
#else
using Cases =
    TypeList<As<Linear, TwoRegisters>, As<ByPoles, OneRegister>, As<HalfGain, OneRegister>,
             As<Reduced, OneRegister>, As<Cascade, TwoRegisters>, As<CascadeByLevels, OneRegister>,
             As<AdjustableBandwidth, TwoRegisters>, As<PowerSum, TwoRegisters>,
             As<FalShape, OneRegister>, As<OwnShape, OneRegister>, As<Algebraic, TwoRegisters>,
             As<Riccati, OneRegister>, As<Modelled, TwoRegisters>, As<OfAPlant, OneRegister>,
             As<RiccatiTable, esokit::Pack<float>>, As<GatedRiccati, OneRegister>>;
#endif
const bool all_registered = register_cases(Cases{});

/// What a step asks of a scalar is what the concept names: here of an archetype.
template <class T, int Lanes, class One>
void expect_lanes_of_archetype(const T& one) {
  using S = Pack<One, Lanes>;
  auto packed = esokit::detail::blank<esokit::detail::WithScalar<T, S>>();
  std::vector<T> lanes(Lanes, one);
  for (int i = 0; i < Lanes; ++i) esokit::detail::set_lane(packed, one, i);
  FaultySignal<S> y(1, 0.002);
  FaultySignal<S> u(2, 0.002);
  int taken = 0;
  for (int k = 0; k < 1000; ++k) {
    const S now_y = y();
    const S now_u = u();
    using Access = esokit::detail::LaneAccess;
    const bool good = Access::advance(packed) && Access::step(packed, now_y, now_u);
    bool all_good = true;
    for (int i = 0; i < Lanes; ++i) {
      T& lane = lanes[static_cast<std::size_t>(i)];
      all_good = lane.update(now_y[i], now_u[i]) == StepStatus::ok && all_good;
      // What is not a good step goes through the lanes.
      if (!good) esokit::detail::set_lane(packed, lane, i);
      ASSERT_TRUE(lane_equals(packed.estimate(), lane.estimate(), i)) << "sample " << k;
    }
    ASSERT_TRUE(all_good || !good);
    taken += good ? 1 : 0;
  }
  EXPECT_GT(taken, 500);
}
TEST(PackOfAnArchetype, IsItsLanes) {
  expect_lanes_of_archetype<esokit::LinearEso<2>, 4, double>(
      esokit::LinearEso<2>::make(Linear::config<double>(0, false)).value());
  expect_lanes_of_archetype<esokit::CascadeEso<2, 3, float, 2>, 3, float>(
      esokit::CascadeEso<2, 3, float, 2>::make(Cascade::config<float>(0, false)).value());
}

TEST(PackOfAdjustableBandwidth, NamesTheLaneWithoutACertificate) {
  using Eso = esokit::AdjustableBandwidthEso<2>;
  const auto config = [](int lane) {
    return Eso::Config{.observer_bandwidth = 50,
                       .bandwidth_ratio = lane == 0 ? 0.7 : 0.1,
                       .input_gain = 1,
                       .sample_time = 0.01};
  };
  const auto made = esokit::Packed<Eso, 2>::make(config);
  const auto alone = Eso::make(config(1));
  ASSERT_FALSE(made);
  ASSERT_FALSE(alone);
  EXPECT_EQ(made.error().lane, 1);
  EXPECT_STREQ(made.error().rule, alone.error().rule);
  EXPECT_EQ(made.error().limit, alone.error().limit);
  std::ostringstream text;
  text << made.error();
  EXPECT_NE(text.str().find("bandwidth_ratio = 0.1: must be certified"), std::string::npos);
  EXPECT_NE(text.str().find("(lane 1)"), std::string::npos);
}

/// All lanes take new settings or none: here the estimate of one would overflow.
TEST(Pack, TakesNoSettingsThatALaneCannotTake) {
  using S = esokit::Pack<double>;
  constexpr int last = lane_count<S> - 1;
  const auto with_gain = [](double gain, double bandwidth) {
    return [=](int lane) {
      return esokit::LinearEso<1>::Config{.observer_bandwidth = bandwidth,
                                          .input_gain = lane == last ? gain : 1.0,
                                          .sample_time = 0.01};
    };
  };
  auto observer = esokit::Packed<esokit::LinearEso<1>>::make(with_gain(1, 10)).value();
  observer.update(S(0.5), S(1e10));
  const auto before = observer.estimate();
  const auto refused = observer.retune(with_gain(1e300, 20));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, last);
  EXPECT_STREQ(refused.error().rule, "would make the estimate not finite");
  for (int i = 0; i < lane_count<S>; ++i) {
    EXPECT_EQ(observer[i].input_gain(), 1);
    EXPECT_EQ(observer.estimate()[0][i], before[0][i]);
  }
}

}  // namespace observer_pack_test
}  // namespace esokit_test
