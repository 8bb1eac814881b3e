/// @file
/// The laws that every guarded observer obeys, with a chain or a model, and the circle criterion
/// that its certificate is compared with.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <control/loop_traits.hpp>
#include <cstring>
#include <esokit/adapter/guarded.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test::guards {

using esokit::DisturbanceUnit;
using esokit::Guarded;
using esokit::Pin;

constexpr double sample_time = 0.01;
constexpr double b0 = 2;

template <class S, class Config>
void fill(Config& config, double omega_T) {
  if constexpr (requires { config.period; }) config.period = S(64);
  if constexpr (requires { config.threshold; }) config.threshold = S(40);
  if constexpr (requires { config.delay; }) config.delay = 1;
  if constexpr (requires { config.model.actuator.time_constant; }) {
    config.model.actuator = {S(0.05)};
  }
  if constexpr (requires { config.model.sensor.time_constant; }) config.model.sensor = {S(0.01)};
  if constexpr (requires { config.model.resonators; }) {
    for (auto& pole : config.model.plant) pole = S(4);
    S part = static_cast<S>(0.2);  // of the bandwidth
    for (auto& resonance : config.model.resonators) {
      resonance.frequency = static_cast<S>(omega_T / sample_time) * part;
      resonance.capture_bandwidth = resonance.frequency * static_cast<S>(0.6);
      part = part * S(4);
    }
  }
  if constexpr (requires { config.observer; }) {
    fill<S>(config.observer, omega_T);
  } else {
    fill_settings<S>(config, omega_T / sample_time, sample_time, b0);
  }
}

template <class Observer>
typename Observer::Config settings(double omega_T = 0.3) {
  typename Observer::Config config{};
  fill<typename Observer::scalar_type>(config, omega_T);
  return config;
}

/// An observer of any type, bare or guarded, behind virtual members, so that a law is compiled once
/// and not once a type. Numbers are double; an observer of floats rounds them.
class AnyObserver {
 public:
  struct Reading {
    std::vector<double> estimate;
    double disturbance = 0;    ///< dhat
    double largest = 0;        ///< abs(dhat), of all levels
    double applied_input = 0;  ///< u of the last prediction
    int missed = 0;            ///< measurements
    bool gated = false;        ///< of a guarded one
    bool bounded = false;      ///< the same
  };

  virtual ~AnyObserver() = default;
  [[nodiscard]] virtual std::unique_ptr<AnyObserver> copy() const = 0;
  virtual StepStatus update(double y, double u) = 0;
  virtual StepStatus predict(double u) = 0;
  virtual StepStatus correct(double y) = 0;
  virtual StepStatus reset(double y) = 0;
  virtual StepStatus set_disturbance(double d) = 0;
  [[nodiscard]] virtual Reading read() const = 0;
  [[nodiscard]] virtual std::vector<double> equilibrium(double y, double u) const = 0;

  // Nothing for a bare one; the first four nothing for one that does not gate.
  virtual void set_trust(double phi) = 0;
  virtual void set_pin(Pin where) = 0;
  virtual double hold(double u) = 0;  ///< the u to give to the observer
  virtual void release() = 0;
  virtual bool set_input_gain(double b) = 0;
  [[nodiscard]] virtual double present_input_gain() const = 0;
};

template <class O>
class Erased final : public AnyObserver {
  using S = typename O::scalar_type;
  static constexpr bool guarded = requires(O & o) { o.gated(); };
  static constexpr bool gates = [] {
    if constexpr (guarded) return O::gates;
    return false;
  }();

 public:
  explicit Erased(const O& o) : o_(o) {}

  [[nodiscard]] std::unique_ptr<AnyObserver> copy() const override {
    return std::unique_ptr<AnyObserver>(new Erased(*this));
  }
  StepStatus update(double y, double u) override { return o_.update(s(y), s(u)); }
  StepStatus predict(double u) override { return o_.predict(s(u)); }
  StepStatus correct(double y) override { return o_.correct(s(y)); }
  StepStatus reset(double y) override { return o_.reset(s(y)); }
  StepStatus set_disturbance(double d) override {
    auto state = o_.estimate();
    state(O::order) = s(d);
    return o_.reset(state);
  }
  [[nodiscard]] Reading read() const override {
    Reading now{.estimate = numbers(o_.estimate()),
                .disturbance = static_cast<double>(o_.total_disturbance()),
                .applied_input = static_cast<double>(o_.applied_input()),
                .missed = static_cast<int>(o_.missed())};
    for (int level = 0; level < O::levels; ++level) {
      const auto dhat = static_cast<double>(o_.level_estimate(level)(O::order));
      now.largest = (std::max)(now.largest, std::abs(dhat));
    }
    if constexpr (guarded) {
      now.gated = o_.gated();
      now.bounded = o_.bounded();
    }
    return now;
  }
  [[nodiscard]] std::vector<double> equilibrium(double y, double u) const override {
    return numbers(o_.equilibrium(s(y), s(u)));
  }

  void set_trust([[maybe_unused]] double phi) override {
    if constexpr (gates) o_.set_trust(s(phi));
  }
  void set_pin([[maybe_unused]] Pin where) override {
    if constexpr (gates) o_.set_pin(where);
  }
  double hold(double u) override {
    if constexpr (gates) return static_cast<double>(o_.hold(s(u)));
    return u;
  }
  void release() override {
    if constexpr (gates) o_.release();
  }
  bool set_input_gain([[maybe_unused]] double b) override {
    if constexpr (guarded) return o_.set_input_gain(s(b)).has_value();
    return false;
  }
  [[nodiscard]] double present_input_gain() const override {
    if constexpr (guarded) return static_cast<double>(o_.present_input_gain());
    return 0;
  }

 private:
  static S s(double x) { return static_cast<S>(x); }
  static std::vector<double> numbers(const typename O::Estimate& z) {
    std::vector<double> all;
    for (int i = 0; i < O::size; ++i) all.push_back(static_cast<double>(z(i)));
    return all;
  }

  O o_;
};

struct Settings {
  double omega_T = 0.3;
  double disturbance_bound = 0;
  DisturbanceUnit unit = DisturbanceUnit::output;
  int release_samples = 0;
  double leak_time = 0;
};

/// A type of observer, and how it is made.
struct Type {
  std::string name;
  int order;
  bool single;  ///< computes in float
  bool gates;   ///< when guarded
  bool models;  ///< an actuator and a sensor
  std::unique_ptr<AnyObserver> (*bare)(double omega_T);
  std::unique_ptr<AnyObserver> (*guarded)(const Settings&);
  [[nodiscard]] double epsilon() const {
    return single ? static_cast<double>(std::numeric_limits<float>::epsilon())
                  : std::numeric_limits<double>::epsilon();
  }
};

template <class O>
Type type_of() {
  using S = typename O::scalar_type;
  return {.name = testing::internal::GetTypeName<O>(),
          .order = O::order,
          .single = std::is_same_v<S, float>,
          .gates = Guarded<O>::gates,
          .models = requires(const typename O::Config& c){esokit::chain_config<O>(c).model.actuator;
}
,
    .bare = [](double omega_T) -> std::unique_ptr<AnyObserver> {
      return std::unique_ptr<AnyObserver>(new Erased<O>(O::make(settings<O>(omega_T)).value()));
    },
    .guarded = [](const Settings& c) -> std::unique_ptr<AnyObserver> {
      const typename Guarded<O>::Config config{
          .observer = settings<O>(c.omega_T),
          .disturbance_bound = static_cast<S>(c.disturbance_bound),
          .unit = c.unit,
          .release_samples = c.release_samples,
          .leak_time = static_cast<S>(c.leak_time)};
      return std::unique_ptr<AnyObserver>(new Erased<Guarded<O>>(Guarded<O>::make(config).value()));
    }
};  // namespace esokit_test::guards
}

inline bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

inline double anything_for(const Type& type, Random& random) {
  return type.single ? static_cast<double>(anything<float>(random)) : anything<double>(random);
}

/// With guards that have nothing to do, and after guards that are over.
inline void idle_is_the_observer(const Type& type) {
  SCOPED_TRACE(type.name);
  const auto plain = type.bare(0.3);
  const auto guarded = type.guarded({.release_samples = 3});
  Random random(11);
  for (int k = 0; k < 3000; ++k) {
    const double y = random.index(20) == 0 ? anything_for(type, random) : random.uniform(-1, 1);
    const double u = random.index(20) == 0 ? anything_for(type, random) : random.uniform(-1, 1);
    guarded->set_trust(0.5);
    guarded->hold(u);
    guarded->set_pin(Pin::free);
    guarded->release();
    guarded->set_trust(1);
    ASSERT_TRUE(guarded->set_input_gain(b0));
    const int what = random.index(12);
    const auto step = [&](AnyObserver& o) {
      return what == 0 ? o.predict(u) : what == 1 ? o.correct(y) : o.update(y, u);
    };
    ASSERT_EQ(step(*guarded), step(*plain)) << k;
    const auto now = guarded->read();
    const auto wanted = plain->read();
    ASSERT_FALSE(now.gated);
    ASSERT_TRUE(same(now.estimate, wanted.estimate)) << k;
    ASSERT_EQ(now.missed, wanted.missed);
    ASSERT_TRUE(same_bits(now.applied_input, wanted.applied_input));
    if (k % 400 == 399) {
      guarded->reset(0);
      plain->reset(0);
    }
  }
}

/// A random sequence of guards, gaps and samples of any size, under which every estimate stays
/// finite; at the end all guards are off.
inline void play_garbage(const Type& type, AnyObserver& guarded, Random& random) {
  for (int k = random.index(150); k > 0; --k) {
    if (type.gates) {
      if (random.index(5) == 0) guarded.set_pin(static_cast<Pin>(random.index(4)));
      if (random.index(5) == 0) guarded.set_trust(anything_for(type, random));
      if (random.index(5) == 0) guarded.hold(anything_for(type, random));
      if (random.index(5) == 0) guarded.release();
    }
    if (random.index(5) == 0) (void)guarded.set_input_gain(anything_for(type, random));
    switch (random.index(6)) {
      case 0:
        (void)guarded.predict(anything_for(type, random));
        break;
      case 1:
        (void)guarded.correct(anything_for(type, random));
        break;
      case 2:
        (void)guarded.reset(anything_for(type, random));
        break;
      default: {
        const double y = anything_for(type, random);
        (void)guarded.update(y, anything_for(type, random));
      }
    }
    for (const double z : guarded.read().estimate) ASSERT_TRUE(std::isfinite(z));
  }
  guarded.set_trust(1);
  guarded.set_pin(Pin::free);
  guarded.release();
}

/// After any sequence of trust, pins, b0, gaps and garbage: back in the time that a bare observer
/// is given, and the samples of a release.
/// @param lowest,highest of the bandwidth times the sample time
inline void comes_back_in_the_stated_time(const Type& type, double lowest, double highest) {
  SCOPED_TRACE(type.name);
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(long_run(100)); ++seed) {
    Random random(seed);
    const double omega_T = random.uniform(lowest, highest);
    const int release = random.index(30);
    const auto guarded = type.guarded({.omega_T = omega_T,
                                       .disturbance_bound = random.index(2) * 50.0,
                                       .unit = static_cast<DisturbanceUnit>(random.index(2)),
                                       .release_samples = release});
    ASSERT_NO_FATAL_FAILURE(play_garbage(type, *guarded, random)) << seed;
    const double e_folds = type.single ? 210 : 1500;
    // The lag of an actuator decays in 5 samples.
    const double rate = type.models ? (std::min)(omega_T, 0.2) : omega_T;
    const int samples = 60 + static_cast<int>(e_folds / rate) + release;
    for (int k = 0; k < samples; ++k) (void)guarded->update(0.5, 0);
    const auto now = guarded->read();
    ASSERT_FALSE(now.gated);
    const double tolerance = 1e5 * type.epsilon();
    ASSERT_NEAR(now.estimate[0], 0.5, tolerance) << seed;
    ASSERT_NEAR(now.disturbance, 0, tolerance * std::pow(omega_T / sample_time, type.order))
        << seed;
  }
}

/// What is done to an observer of a plant that stands at y = 0 under u = 0.
struct Move {
  enum Kind { trusted, partly, untrusted, held, upper, lower, either, gaps, garbage, gain };
  static constexpr int kinds = gain + 1;
  Kind kind;
  int length;  ///< measurements
  int gap;     ///< missing before each measurement
};

/// The estimate, which is all error, in the unit of dhat: y^(i) by omega^(n - i).
inline double size_of(const AnyObserver& o, const Type& type, double omega_T) {
  const auto z = o.read().estimate;
  const double omega = omega_T / sample_time;
  double size = 0;
  for (int i = 0; i <= type.order; ++i) {
    size += std::abs(z[static_cast<std::size_t>(i)]) * std::pow(omega, type.order - i);
  }
  return size;
}

/// @return the largest abs(dhat) on the way
inline double play(AnyObserver& o, const Move& move, Random& random) {
  constexpr auto nothing = std::numeric_limits<double>::quiet_NaN();
  o.set_trust(move.kind == Move::untrusted ? 0
              : move.kind == Move::partly  ? random.uniform(0, 1)
                                           : 1);
  o.set_pin(move.kind == Move::upper    ? Pin::upper
            : move.kind == Move::lower  ? Pin::lower
            : move.kind == Move::either ? Pin::either
                                        : Pin::free);
  double largest = 0;
  for (int k = 0; k < move.length; ++k) {
    // b0 changes nothing of an error in the unit of y^(n).
    if (move.kind == Move::gain) (void)o.set_input_gain(b0 * random.log_uniform(0.3, 3));
    for (int i = 0; i <= move.gap; ++i) {
      double u = 0;
      if (move.kind == Move::held) {
        u = o.hold(0);
      } else {
        o.release();
      }
      const bool measured = i == move.gap;
      if (measured && move.kind == Move::garbage)
        (void)o.correct(random.index(2) == 0 ? nothing : HUGE_VAL);
      (void)(measured ? o.update(0, u) : i % 2 == 0 ? o.predict(u) : o.update(nothing, u));
    }
    largest = (std::max)(largest, std::abs(o.read().disturbance));
  }
  return largest;
}

/// An adversary at guards, holds, gaps and lost samples of an observer that starts with an error of
/// dhat of 1: moves at random, two by turns, a hold by turns with another, or of a few the one that
/// makes the error largest.
/// @param longest_gap samples @return the largest abs(dhat) on the way
inline double adversary(const Type& type, const Settings& settings, int longest_gap,
                        Random& random) {
  const auto o = type.guarded(settings);
  (void)o->set_disturbance(1);
  const auto drawn = [&] {
    Move move{.kind = static_cast<Move::Kind>(random.index(Move::kinds)),
              .length = static_cast<int>(random.log_uniform(1, 20 / settings.omega_T)),
              .gap = 0};
    if (move.kind == Move::gaps || random.index(4) == 0) {
      move.gap = static_cast<int>(random.log_uniform(1, longest_gap));
      move.length = 1 + move.length / move.gap;
    }
    return move;
  };
  std::array<Move, 2> turns{drawn(), drawn()};
  const int strategy = random.index(4);
  if (strategy == 3) turns[0].kind = Move::held;
  double largest = 0;
  for (int k = 0; k < 100; ++k) {
    Move move = strategy == 0 ? drawn() : turns[static_cast<std::size_t>(k % 2)];
    double most = -1;
    for (int i = 0; strategy == 2 && i < 6; ++i) {
      const Move tried = drawn();
      const auto copy = o->copy();
      Random same = random;
      (void)play(*copy, tried, same);
      const double size = size_of(*copy, type, settings.omega_T);
      if (size > most) {
        most = size;
        move = tried;
      }
    }
    largest = (std::max)(largest, play(*o, move, random));
  }
  return largest;
}

/// No sequence takes the error of dhat beyond a small multiple. (That the error decays with all
/// guards off is a law above.)
inline void no_sequence_grows(const Type& type) {
  SCOPED_TRACE(type.name);
  // By hand: --gtest_random_seed=N for other ones.
  const auto first = static_cast<std::uint64_t>(GTEST_FLAG_GET(random_seed)) * 1000;
  for (int i = 0; i < long_run(50); ++i) {
    Random random(first + static_cast<std::uint64_t>(i));
    const double omega_T = random.log_uniform(0.1, 1.5);
    const Settings settings{
        .omega_T = omega_T,
        .release_samples = random.index(2) * random.index(30),
        .leak_time = type.gates ? random.index(2) * random.log_uniform(0.05, 5) : 0};
    ASSERT_LT(adversary(type, settings, static_cast<int>(30 / omega_T), random), 4) << i;
  }
}

/// min Re G by brute force; G from the correction of dhat back to the innovation.
/// @param transition of the scaled states, row by row
/// @param gain of the correction
/// @param constant_row,constant_column dhat in the states, and the states of a dhat of 1
/// @param leak of dhat, at each correction
inline double least_real_part(const std::vector<std::vector<double>>& transition,
                              const std::vector<double>& gain,
                              const std::vector<double>& constant_row,
                              const std::vector<double>& constant_column, double leak) {
  using Complex = std::complex<double>;
  constexpr std::size_t most = 8;
  const std::size_t n = gain.size();
  double found = 0;
  for (std::size_t i = 0; i < n; ++i) found += constant_row[i] * gain[i];
  // What becomes of the states while dhat is not corrected; it leaks all the same.
  auto frozen = transition;
  for (std::size_t j = 0; j < n; ++j) {
    double kept = 0;
    for (std::size_t i = 0; i < n; ++i) {
      frozen[i][j] -= (gain[i] - found * constant_column[i]) * transition[0][j];
      kept += constant_row[i] * frozen[i][j];
    }
    for (std::size_t i = 0; i < n; ++i) frozen[i][j] -= leak * constant_column[i] * kept;
  }
  double least = 1e300;
  constexpr int points = 2000;
  for (int point = 0; point < points; ++point) {
    const Complex z = std::polar(1.0, std::numbers::pi * std::pow(10, 6.0 * point / points - 6));
    // (z - frozen) x = the correction, by elimination.
    std::array<std::array<Complex, most + 1>, most> a{};
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) a[i][j] = (i == j ? z : 0.0) - frozen[i][j];
      a[i][n] = (1 - leak) * found * constant_column[i];
    }
    for (std::size_t k = 0; k < n; ++k) {
      std::size_t pivot = k;
      for (std::size_t i = k; i < n; ++i) {
        if (std::norm(a[i][k]) > std::norm(a[pivot][k])) pivot = i;
      }
      std::swap(a[k], a[pivot]);
      for (std::size_t i = 0; i < n; ++i) {
        const Complex factor = i == k ? 0.0 : a[i][k] / a[k][k];
        for (std::size_t j = k; j <= n && i != k; ++j) a[i][j] -= factor * a[k][j];
      }
    }
    double innovation = 0;
    for (std::size_t i = 0; i < n; ++i) innovation += transition[0][i] * (a[i][n] / a[i][i]).real();
    least = (std::min)(least, innovation);
  }
  return least;
}

}  // namespace esokit_test::guards
