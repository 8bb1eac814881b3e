/// @file
/// The laws that every controller must obey, whatever observer and form it is made of. A
/// translation unit instantiates them for its types:
/// `register_laws<ControllerLaws>("Name", TypeList<Adrc<..>, ..>{})`.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/incremental.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/eigen.hpp>
#include <support/law_registration.hpp>
#include <support/no_allocation.hpp>
#include <support/refusal.hpp>
#include <tuple>
#include <utility>
#include <vector>

#include "loop_traits.hpp"

namespace esokit_test {

template <class Controller>
struct ControllerLawsOf;

template <class O, class F>
struct ControllerLawsOf<Adrc<O, F>> {
  using Controller = Adrc<O, F>;
  using S = typename O::scalar_type;
  using Traits = LoopTraits<O>;
  using Config = typename Controller::Config;
  static constexpr int n = O::order;
  static constexpr bool error_based = std::is_same_v<F, ErrorBased>;
  static constexpr double period = 0.005;  ///< T, s
  static constexpr double gain = 2;        ///< b0
  static constexpr double omega_o = 40;    ///< rad/s
  static constexpr double omega_c = 6;     ///< rad/s
  static constexpr double disturbance = -3;
  static constexpr double steady_input = 1.5;
  static constexpr double epsilon = std::numeric_limits<S>::epsilon();

  static S s(double x) { return static_cast<S>(x); }

  static Config config() {
    Config settings{};
    settings.observer = Traits::config(omega_o, period, gain);
    settings.controller_bandwidth = s(omega_c);
    return settings;
  }
  static Controller make(const Config& settings) { return Controller::make(settings).value(); }

  /// What the rounding of y and of the states is worth in u: the law multiplies by k_0 / b0, the
  /// observer by its gains, the highest about (omega_o)^n / b0 a few times over.
  static double rounding() { return 64 * epsilon * std::pow(2 * omega_o, n) / gain; }

  static bool same(const Controller& a, const Controller& b) {
    bool equal = same_bits(a.output(), b.output()) && a.mode() == b.mode();
    const auto x = a.observer().estimate();
    const auto y = b.observer().estimate();
    for (int i = 0; i < O::size; ++i) equal = equal && same_bits(x(i), y(i));
    return equal && a.observer().missed() == b.observer().missed();
  }

  static bool finite(const Controller& c) {
    bool good = std::isfinite(c.output());
    for (const S z : c.observer().estimate()) good = good && std::isfinite(z);
    return good;
  }

  /// A controller in the middle of a random run.
  static Controller warm(Config settings = config()) {
    Controller controller = make(settings);
    Random random(3);
    for (int k = 0; k < 60; ++k) {
      controller.update(s(random.uniform(-0.5, 0.5)), s(random.uniform(-0.5, 0.5)));
    }
    return controller;
  }

  // ---- what it is for

  static void reaches_reference_under_disturbance() {
    Controller controller = make(config());
    ChainPlant<n> plant(period, gain, disturbance);
    for (int k = 0; k < 4000; ++k) {
      plant.step(static_cast<double>(controller.update(s(plant.output()), S(1))));
    }
    const double tolerance = std::max(1e-6, rounding());
    EXPECT_NEAR(plant.output(), 1, tolerance);
    EXPECT_NEAR(static_cast<double>(controller.output()), steady_input,
                std::max(1e-6, rounding()) * std::pow(omega_c, n));
  }

  /// The observer sees what was applied: its innovations are those of a run without limits.
  static void limits_do_not_reach_the_observer() {
    if constexpr (std::is_same_v<S, float>) {
      GTEST_SKIP() << "stated to 1e-9: in double";
    } else if constexpr (requires { Traits::approximate; }) {
      GTEST_SKIP() << "what the model changes within a step is disturbance, and depends on u";
    } else {
      Config limited = config();
      limited.limits = {.lower = S(-1), .upper = S(2.5), .rate = S(40)};
      std::vector<double> reference;
      for (const Config& settings : {config(), limited}) {
        Controller controller = make(settings);
        ChainPlant<n> plant(period, gain, disturbance);
        typename ChainPlant<n>::State x = ChainPlant<n>::State::Zero();
        x(0) = 0.3;
        plant.set_state(x);
        std::size_t limited_samples = 0;
        for (std::size_t k = 0; k < 600; ++k) {
          plant.step(controller.update(plant.output(), 1.0));
          if (controller.output() != controller.requested()) ++limited_samples;
          if (reference.size() < 600) {
            reference.push_back(controller.observer().innovation());
          } else {
            ASSERT_NEAR(controller.observer().innovation(), reference[k], 1e-9) << "sample " << k;
          }
        }
        EXPECT_EQ(limited_samples > 20, settings.limits.upper < 3);
      }
    }
  }

  static void output_keeps_its_limits() {
    Config settings = config();
    settings.limits = {.lower = s(-0.7), .upper = s(1.1), .rate = S(20)};
    Controller controller = make(settings);
    Random random(9);
    S last = controller.output();
    int low = 0;
    int high = 0;
    int rate = 0;
    const S step = S(20) * controller.observer().sample_time() * (1 + 8 * s(epsilon));
    for (int k = 0; k < 3000; ++k) {
      const S r = k % 100 < 50 ? S(4) : S(-4);
      const S u = controller.update(s(random.uniform(-0.05, 0.05)), r);
      ASSERT_GE(u, settings.limits.lower);
      ASSERT_LE(u, settings.limits.upper);
      ASSERT_LE(std::abs(u - last), step + 2 * s(epsilon)) << "sample " << k;
      low += u == settings.limits.lower ? 1 : 0;
      high += u == settings.limits.upper ? 1 : 0;
      rate += u != controller.requested() ? 1 : 0;
      last = u;
    }
    EXPECT_GT(low, 20);
    EXPECT_GT(high, 20);
    EXPECT_GT(rate, low + high);
  }

  // ---- no bumps

  static double bump_limit() { return std::is_same_v<S, double> ? 1e-9 : 8 * rounding(); }

  static void start_does_not_bump() {
    Config settings = config();
    settings.limits = {.lower = S(-5), .upper = S(5)};
    settings.start_hold = {.time = S(0.5), .input = S(-2)};
    Controller controller = warm(settings);
    ChainPlant<n> plant(period, gain, disturbance);
    typename ChainPlant<n>::State x = ChainPlant<n>::State::Zero();
    x(0) = 2.5;
    plant.set_state(x);
    EXPECT_EQ(controller.start(S(2.5), s(steady_input)), StepStatus::ok);
    EXPECT_EQ(controller.output(), s(steady_input));
    EXPECT_EQ(controller.mode(), LoopMode::running);
    for (int k = 0; k < 40; ++k) {
      const S u = controller.update(s(plant.output()), S(2.5));
      ASSERT_NEAR(static_cast<double>(u), steady_input, 10 * bump_limit()) << "sample " << k;
      plant.step(static_cast<double>(u));
    }
  }

  static void start_refuses_bad_values() {
    Controller controller = warm();
    const Controller before = controller;
    EXPECT_NE(controller.start(hidden_nan<S>(), S(1)), StepStatus::ok);
    EXPECT_TRUE(same(controller, before));
    EXPECT_NE(controller.start(S(1), hidden_infinity<S>()), StepStatus::ok);
    EXPECT_TRUE(same(controller, before));
  }

  /// Retuning in the steady state: omega_o, b0, omega_c, and all of them.
  static void retune_does_not_bump() {
    const auto change = [](int what) {
      const bool all = what == 3;
      Config settings{};
      settings.observer = Traits::config(what == 0 || all ? 1.4 * omega_o : omega_o, period,
                                         what == 1 || all ? 1.7 * gain : gain);
      settings.controller_bandwidth = s(what == 2 || all ? 0.6 * omega_c : omega_c);
      return settings;
    };
    for (int what = 0; what < 4; ++what) {
      SCOPED_TRACE(what);
      // At once after a start, too: the input of the start is the one that explains.
      Controller started = make(config());
      ASSERT_EQ(started.start(S(0), s(steady_input)), StepStatus::ok);
      ASSERT_TRUE(started.retune(change(what)).has_value());
      EXPECT_NEAR(static_cast<double>(started.update(S(0), S(0))), steady_input, 10 * bump_limit());

      Controller controller = make(config());
      ChainPlant<n> plant(period, gain, disturbance);
      ASSERT_EQ(controller.start(S(0), s(steady_input)), StepStatus::ok);
      for (int k = 0; k < 30; ++k) {
        plant.step(static_cast<double>(controller.update(s(plant.output()), S(0))));
      }
      const double before = static_cast<double>(controller.output());
      ASSERT_TRUE(controller.retune(change(what)).has_value());
      EXPECT_EQ(static_cast<double>(controller.output()), before);
      const S u = controller.update(s(plant.output()), S(0));
      EXPECT_NEAR(static_cast<double>(u), before, 10 * bump_limit());
    }
  }

  static void refused_retune_changes_nothing() {
    Controller controller = warm();
    const Controller before = controller;
    Config bad = config();
    bad.controller_bandwidth = S(-1);
    const auto refused = controller.retune(bad);
    ASSERT_EQ(refusal(refused), "controller_bandwidth: must be finite and positive");
    EXPECT_TRUE(same(controller, before));
    bad = config();
    bad.observer = Traits::config(omega_o, period, 0);
    EXPECT_FALSE(controller.retune(bad).has_value());
    bad = config();
    bad.limits = {.lower = S(1), .upper = S(-1)};
    EXPECT_FALSE(controller.retune(bad).has_value());
    EXPECT_TRUE(same(controller, before));
    Controller untouched = before;
    EXPECT_TRUE(same_bits(controller.update(S(0.3), S(1)), untouched.update(S(0.3), S(1))));
    EXPECT_TRUE(same(controller, untouched));
  }

  /// The operator holds the plant at rest; then the controller takes over with the reference there.
  static void takeover_from_manual_does_not_bump() {
    Controller controller = make(config());
    ChainPlant<n> plant(period, gain, disturbance);
    typename ChainPlant<n>::State x = ChainPlant<n>::State::Zero();
    x(0) = 0.8;
    plant.set_state(x);
    for (int k = 0; k < 3000; ++k) {
      ASSERT_EQ(controller.track(s(plant.output()), s(0.8), s(steady_input)), s(steady_input));
      plant.step(steady_input);
    }
    EXPECT_EQ(controller.mode(), LoopMode::running);
    const S u = controller.update(s(plant.output()), s(0.8));
    EXPECT_NEAR(static_cast<double>(u), steady_input, std::max(1e-8, 64 * rounding()));
  }

  static void hold_holds() {
    Config settings = config();
    settings.start_hold = {.time = s(12.5 * period), .input = s(0.25)};
    settings.limits = {.lower = S(-2), .upper = S(2)};
    Controller controller = make(settings);
    EXPECT_EQ(controller.mode(), LoopMode::start_hold);
    for (int k = 0; k < 13; ++k) {
      EXPECT_EQ(controller.mode(), LoopMode::start_hold) << k;
      EXPECT_EQ(controller.update(S(0.5), S(4)), s(0.25)) << k;
      if (k > 0) {
        EXPECT_EQ(controller.observer().applied_input(), s(0.25)) << k;
      }
    }
    EXPECT_EQ(controller.mode(), LoopMode::running);
    EXPECT_NE(controller.update(S(0.5), S(4)), s(0.25));
  }

  // ---- bad days

  static void bad_measurement_is_a_missing_one() {
    for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
      Controller hit = warm();
      Controller missing = hit;
      const S a = hit.update(bad, s(0.25));
      const S b = missing.update_without_measurement(s(0.25));
      EXPECT_TRUE(same_bits(a, b));
      EXPECT_EQ(hit.status(), StepStatus::measurement_rejected);
      EXPECT_TRUE(same(hit, missing));
      EXPECT_EQ(hit.observer().missed(), 1);
      EXPECT_TRUE(same_bits(hit.update(S(0.1), S(0)), missing.update(S(0.1), S(0))));
      EXPECT_TRUE(esokit::has(hit.status(), StepStatus::gap_bridged) ||
                  !esokit::observer_traits<O>.bears_regular_gaps);
      EXPECT_TRUE(finite(hit));
    }
  }

  static void bad_reference_keeps_the_output() {
    for (const S bad : {hidden_nan<S>(), hidden_infinity<S>()}) {
      Controller controller = warm();
      const S before = controller.output();
      const S u = controller.update(S(0.1), bad);
      if (!error_based) {
        EXPECT_TRUE(same_bits(u, before));
        EXPECT_EQ(controller.observer().missed(), 0);
      } else {
        EXPECT_EQ(controller.observer().missed(), 1);
      }
      EXPECT_TRUE(finite(controller));
      controller.update(S(0.1), S(0.1));
      EXPECT_TRUE(finite(controller));
    }
  }

  static void reported_input_is_believed() {
    Controller own = warm();
    Controller told = own;
    for (int k = 0; k < 20; ++k) {
      const S held = own.output();
      const S bad = k % 3 == 1 ? hidden_nan<S>() : held;
      EXPECT_TRUE(same_bits(own.update(S(0.1), S(0.2)), told.update(S(0.1), S(0.2), bad)));
    }
    EXPECT_TRUE(same(own, told));
    // The actuator was stuck.
    told.update(S(0.1), S(0.2), S(0.125));
    own.update(S(0.1), S(0.2));
    EXPECT_FALSE(same(own, told));
    EXPECT_EQ(told.observer().applied_input(), S(0.125));
  }

  static void missing_measurements_end_in_the_safe_output() {
    Config settings = config();
    settings.limits = {.lower = S(-9), .upper = S(9), .rate = S(100)};
    settings.missing = {.most = 4, .input = s(-0.75)};
    for (const bool stay : {false, true}) {
      settings.missing.stay = stay;
      Controller controller = warm(settings);
      for (int k = 0; k < 4; ++k) {
        controller.update(hidden_nan<S>(), S(0));
        EXPECT_EQ(controller.mode(), LoopMode::running) << k;
      }
      for (int k = 0; k < 60; ++k) {
        const S before = controller.output();
        const S u = controller.update_without_measurement(S(0));
        EXPECT_EQ(controller.mode(), LoopMode::safe);
        EXPECT_LE(std::abs(u - before), S(0.5) + s(8 * epsilon));  // at its rate
        EXPECT_LE(std::abs(u + s(0.75)), std::abs(before + s(0.75)));
      }
      EXPECT_EQ(controller.output(), s(-0.75));
      controller.update(S(0.2), S(0));
      EXPECT_EQ(controller.mode(), stay ? LoopMode::safe : LoopMode::running);
      EXPECT_TRUE(finite(controller));
      if (stay) {
        EXPECT_EQ(controller.update(S(0.2), S(0)), s(-0.75));
        controller.start(S(0.2), s(-0.75));
        controller.update(S(0.2), S(0));
        EXPECT_EQ(controller.mode(), LoopMode::running);
      }
    }
    // Without a safe output the last one stays.
    settings.missing = {.most = 0};
    Controller controller = warm(settings);
    const S before = controller.output();
    EXPECT_EQ(controller.update(hidden_nan<S>(), S(7)), before);
    EXPECT_EQ(controller.mode(), LoopMode::safe);
  }

  /// Only every D-th measurement is looked at, and the loop is as exact as ever.
  static void divider_takes_every_dth_measurement() {
    if constexpr (!esokit::observer_traits<O>.bears_regular_gaps) {
      Config settings = config();
      settings.measurement_divider = 2;
      const auto refused = Controller::make(settings);
      ASSERT_EQ(refusal(refused),
                "measurement_divider: must be 1: regular gaps restart this observer");
    } else {
      constexpr int every = 4;
      Config settings = config();
      settings.measurement_divider = every;
      settings.missing.most = 3;
      Controller controller = make(settings);
      ChainPlant<n> plant(period, gain, disturbance);
      for (int k = 0; k < 4000; ++k) {
        const S y = k % every == 0 ? s(plant.output()) : hidden_nan<S>();
        plant.step(static_cast<double>(controller.update(y, S(1))));
        ASSERT_EQ(controller.status(), StepStatus::ok) << "sample " << k;
        ASSERT_EQ(controller.mode(), LoopMode::running);
        ASSERT_EQ(controller.observer().missed(), k % every);
      }
      EXPECT_NEAR(plant.output(), 1, std::max(1e-5, 4 * rounding()));
      for (int k = 0; k < settings.missing.most * every; ++k) {
        controller.update(hidden_nan<S>(), S(1));
        ASSERT_EQ(controller.mode(), LoopMode::running) << k;
      }
      controller.update(hidden_nan<S>(), S(1));
      EXPECT_EQ(controller.mode(), LoopMode::safe);
    }
  }

  // ---- the other forms: what is proven of Adrc is proven of them where they are the same

  /// Settings and samples for the comparisons: limits that bind, a lost sample now and then.
  static Config limited() {
    Config settings = config();
    settings.limits = {.lower = s(-3), .upper = S(4), .rate = S(200)};
    return settings;
  }

  /// Calls `step(y, r)` in the middle of the run of `controller`, which takes the same samples.
  template <class Step>
  static void beside(Controller controller, Step&& step) {
    ChainPlant<n> plant(period, gain, disturbance);
    Random random(11);
    int at_limit = 0;
    for (int k = 0; k < 200; ++k) {
      const S r = k % 100 < 50 ? S(1) : S(-1);
      const S y = k % 17 == 16 ? hidden_nan<S>() : s(plant.output() + 1e-3 * random.uniform(-1, 1));
      const S u = controller.update(y, r);
      at_limit += u != controller.requested() ? 1 : 0;
      const double allowed = 16 * rounding() + 64 * epsilon * std::abs(static_cast<double>(u));
      ASSERT_NEAR(static_cast<double>(step(y, r, controller)), static_cast<double>(u), allowed)
          << "sample " << k;
      plant.step(static_cast<double>(u));
    }
    EXPECT_GT(at_limit, 5);
  }

  static void increments_add_up_to_u() {
    auto incremental = esokit::Incremental<Controller>::make(limited()).value();
    S sum = 0;
    beside(make(limited()), [&](S y, S r, const Controller&) {
      sum += incremental.update(y, r);
      return sum;
    });
  }

  /// Around the state feedback of ADRC the compensator is ADRC.
  static void compensator_around_the_feedback_is_adrc() {
    if constexpr (error_based) {
      GTEST_SKIP() << "a compensator is fed y";
    } else {
      const Config settings = limited();
      auto compensator = esokit::DisturbanceCompensator<O>::make(
                             {.observer = settings.observer, .limits = settings.limits})
                             .value();
      beside(make(settings), [&](S y, S r, const Controller& controller) {
        const auto z = controller.observer().estimate();
        S v = controller.gains()[0] * (r - z(0));
        for (int i = 1; i < n; ++i) v -= controller.gains()[static_cast<std::size_t>(i)] * z(i);
        return compensator.update(y, v / s(gain));
      });
    }
  }

  static void mimo_of_one_channel_is_adrc() {
    if constexpr (error_based) {
      GTEST_SKIP() << "MimoAdrc is output-based";
    } else {
      using Mimo = esokit::MimoAdrc<O>;
      typename Mimo::Config settings{};
      settings.observers = {Traits::config(omega_o, period, 0)};
      settings.controller_bandwidths = {s(omega_c)};
      settings.input_matrix(0, 0) = s(gain);
      settings.limits = {limited().limits};
      auto mimo = Mimo::make(settings).value();
      using One = typename Mimo::Output;
      beside(make(limited()),
             [&](S y, S r, const Controller&) { return mimo.update(One(y), One(r))(0); });
    }
  }

  // ---- housekeeping

  static void no_allocation() {
    Config settings = config();
    settings.missing.most = 3;
    settings.limits = {.lower = S(-1), .upper = S(1), .rate = S(50)};
    Controller controller = make(settings);
    S sink = 0;
    long count = -1;
    {
      const NoAllocation guard;
      for (int k = 0; k < 20; ++k) {
        sink += controller.update(S(0.1), S(0.5));
        sink += controller.update(hidden_nan<S>(), S(0.5));
        sink += controller.update(S(0.1), S(0.5), S(0.2));
        sink += controller.update(S(0.1), esokit::EigenMatrix<S, 2>(S(0.5), S(0.1)));
        for (int i = 0; i < 5; ++i) sink += controller.update_without_measurement(S(0.5));
        sink += controller.track(S(0.1), S(0.5), S(0.3));
        controller.start(S(0.1), S(0.2));
      }
      count = guard.count();
    }
    EXPECT_EQ(count, 0);
    EXPECT_TRUE(std::isfinite(sink));
  }

  static void copies_are_independent() {
    Controller a = warm();
    Controller b = a;
    const Controller witness = a;
    Random random(5);
    for (int k = 0; k < 40; ++k) {
      const S y = s(random.uniform(-1, 1));
      EXPECT_TRUE(same_bits(a.update(y, S(0.5)), b.update(y, S(0.5))));
    }
    EXPECT_TRUE(same(a, b));
    EXPECT_FALSE(same(a, witness));
  }

  /// A reference with zero derivatives is a reference without.
  static void reference_vector_agrees_with_scalar() {
    Controller a = warm();
    Controller b = a;
    Random random(6);
    for (int k = 0; k < 40; ++k) {
      const S y = s(random.uniform(-0.5, 0.5));
      const S r = s(random.uniform(-0.5, 0.5));
      const S u = a.update(y, r);
      const S v = b.update(y, esokit::EigenMatrix<S, 2>(r, S(0)));
      ASSERT_NEAR(static_cast<double>(u), static_cast<double>(v),
                  16 * rounding() + 64 * epsilon * std::abs(static_cast<double>(u)));
      (void)b.observer();
    }
  }
};

/// The suite for `register_laws`.
template <class Controller>
struct ControllerLaws {
  static std::vector<NamedLaw> laws() {
    using Laws = ControllerLawsOf<Controller>;
    return {
        {"reaches_reference_under_disturbance", &Laws::reaches_reference_under_disturbance},
        {"limits_do_not_reach_the_observer", &Laws::limits_do_not_reach_the_observer},
        {"output_keeps_its_limits", &Laws::output_keeps_its_limits},
        {"start_does_not_bump", &Laws::start_does_not_bump},
        {"start_refuses_bad_values", &Laws::start_refuses_bad_values},
        {"retune_does_not_bump", &Laws::retune_does_not_bump},
        {"refused_retune_changes_nothing", &Laws::refused_retune_changes_nothing},
        {"takeover_from_manual_does_not_bump", &Laws::takeover_from_manual_does_not_bump},
        {"hold_holds", &Laws::hold_holds},
        {"bad_measurement_is_a_missing_one", &Laws::bad_measurement_is_a_missing_one},
        {"bad_reference_keeps_the_output", &Laws::bad_reference_keeps_the_output},
        {"reported_input_is_believed", &Laws::reported_input_is_believed},
        {"missing_measurements_end_in_the_safe_output",
         &Laws::missing_measurements_end_in_the_safe_output},
        {"divider_takes_every_dth_measurement", &Laws::divider_takes_every_dth_measurement},
        {"increments_add_up_to_u", &Laws::increments_add_up_to_u},
        {"compensator_around_the_feedback_is_adrc", &Laws::compensator_around_the_feedback_is_adrc},
        {"mimo_of_one_channel_is_adrc", &Laws::mimo_of_one_channel_is_adrc},
        {"no_allocation", &Laws::no_allocation},
        {"copies_are_independent", &Laws::copies_are_independent},
        {"reference_vector_agrees_with_scalar", &Laws::reference_vector_agrees_with_scalar},
    };
  }
};

}  // namespace esokit_test
