#include "controller_law_suite.hpp"

#include <cmath>
#include <support/no_allocation.hpp>

namespace esokit_test {
namespace {

constexpr double period = LoopSetup::period;
constexpr double gain = LoopSetup{}.gain;
constexpr double disturbance = -3;
constexpr double steady_input = 1.5;

using Type = ControllerType;
using Controller = std::unique_ptr<AnyController>;

ChainPlant plant_of(const Type& type, double y = 0) {
  ChainPlant plant(type.order, period, gain, disturbance);
  std::vector<double> x(static_cast<std::size_t>(type.order));
  x[0] = y;
  plant.set_state(x);
  return plant;
}

double epsilon(const Type& type) {
  return type.single ? static_cast<double>(std::numeric_limits<float>::epsilon())
                     : std::numeric_limits<double>::epsilon();
}

/// x as the controller has it.
double rounded(const Type& type, double x) {
  return type.single ? static_cast<double>(static_cast<float>(x)) : x;
}

/// What the rounding of y and of the states is worth in u: the law multiplies by k_0 / b0, the
/// observer by its gains, the highest about (omega_o)^n / b0 a few times over.
double rounding(const Type& type) {
  return 64 * epsilon(type) * std::pow(2 * LoopSetup{}.omega_o, type.order) / gain;
}

double bump_limit(const Type& type) { return type.single ? 8 * rounding(type) : 1e-9; }

bool same(const AnyController& a, const AnyController& b) {
  const auto x = a.state();
  const auto y = b.state();
  bool equal = same_bits(x.output, y.output) && x.mode == y.mode && x.missed == y.missed;
  for (std::size_t i = 0; i < x.estimate.size(); ++i) {
    equal = equal && same_bits(x.estimate[i], y.estimate[i]);
  }
  return equal;
}

bool finite(const AnyController& c) {
  const auto now = c.state();
  return std::isfinite(now.output) && std::all_of(now.estimate.begin(), now.estimate.end(),
                                                  [](double z) { return std::isfinite(z); });
}

/// A controller in the middle of a random run.
Controller warm(const Type& type, const LoopSetup& setup = {}) {
  Controller c = type.make(setup);
  Random random(3);
  for (int k = 0; k < 60; ++k) c->update(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5));
  return c;
}

// ---- what it is for

void reaches_reference_under_disturbance(const Type& type) {
  const Controller c = type.make({});
  ChainPlant plant = plant_of(type);
  for (int k = 0; k < 4000; ++k) plant.step(c->update(plant.output(), 1));
  const double tolerance = std::max(1e-6, rounding(type));
  EXPECT_NEAR(plant.output(), 1, tolerance);
  EXPECT_NEAR(c->state().output, steady_input,
              tolerance * std::pow(LoopSetup{}.omega_c, type.order));
}

/// The observer sees what was applied: its innovations are those of a run without limits.
void limits_do_not_reach_the_observer(const Type& type) {
  if (type.single) GTEST_SKIP() << "stated to 1e-9: in double";
  if (type.approximate) {
    GTEST_SKIP() << "what the model changes within a step is disturbance, and depends on u";
  }
  LoopSetup limited;
  limited.loop.limits = {.lower = -1, .upper = 2.5, .rate = 40};
  const Controller free = type.make({});
  const Controller bound = type.make(limited);
  ChainPlant of_free = plant_of(type, 0.3);
  ChainPlant of_bound = plant_of(type, 0.3);
  int limited_samples = 0;
  for (int k = 0; k < 600; ++k) {
    of_free.step(free->update(of_free.output(), 1));
    of_bound.step(bound->update(of_bound.output(), 1));
    ASSERT_EQ(free->state().output, free->state().requested);
    const auto now = bound->state();
    limited_samples += now.output < now.requested || now.output > now.requested ? 1 : 0;
    ASSERT_NEAR(now.innovation, free->state().innovation, 1e-9) << "sample " << k;
  }
  EXPECT_GT(limited_samples, 20);
}

void output_keeps_its_limits(const Type& type) {
  LoopSetup setup;
  setup.loop.limits = {.lower = rounded(type, -0.7), .upper = rounded(type, 1.1), .rate = 20};
  const auto& limits = setup.loop.limits;
  const Controller c = type.make(setup);
  Random random(9);
  double last = c->state().output;
  int low = 0;
  int high = 0;
  int rate = 0;
  const double step = 20 * period * (1 + 8 * epsilon(type));
  for (int k = 0; k < 3000; ++k) {
    const double u = c->update(random.uniform(-0.05, 0.05), k % 100 < 50 ? 4 : -4);
    ASSERT_GE(u, limits.lower);
    ASSERT_LE(u, limits.upper);
    ASSERT_LE(std::abs(u - last), step + 2 * epsilon(type)) << "sample " << k;
    low += u <= limits.lower ? 1 : 0;
    high += u >= limits.upper ? 1 : 0;
    const double requested = c->state().requested;
    rate += u < requested || u > requested ? 1 : 0;
    last = u;
  }
  EXPECT_GT(low, 20);
  EXPECT_GT(high, 20);
  EXPECT_GT(rate, low + high);
}

// ---- no bumps

void start_does_not_bump(const Type& type) {
  LoopSetup setup;
  setup.loop.limits = {.lower = -5, .upper = 5};
  setup.loop.start_hold = {.time = 0.5, .input = -2};
  const Controller c = warm(type, setup);
  ChainPlant plant = plant_of(type, 2.5);
  EXPECT_EQ(c->start(2.5, steady_input), StepStatus::ok);
  EXPECT_EQ(c->state().output, steady_input);
  EXPECT_EQ(c->state().mode, LoopMode::running);
  for (int k = 0; k < 40; ++k) {
    const double u = c->update(plant.output(), 2.5);
    ASSERT_NEAR(u, steady_input, 10 * bump_limit(type)) << "sample " << k;
    plant.step(u);
  }
}

void start_refuses_bad_values(const Type& type) {
  const Controller c = warm(type);
  const Controller before = c->copy();
  EXPECT_NE(c->start(hidden_nan<double>(), 1), StepStatus::ok);
  EXPECT_TRUE(same(*c, *before));
  EXPECT_NE(c->start(1, hidden_infinity<double>()), StepStatus::ok);
  EXPECT_TRUE(same(*c, *before));
}

/// Retuning in the steady state: omega_o, b0, omega_c, and all of them.
void retune_does_not_bump(const Type& type) {
  for (int what = 0; what < 4; ++what) {
    SCOPED_TRACE(what);
    LoopSetup changed;
    if (what == 0 || what == 3) changed.omega_o *= 1.4;
    if (what == 1 || what == 3) changed.gain *= 1.7;
    if (what == 2 || what == 3) changed.omega_c *= 0.6;
    // At once after a start, too: the input of the start is the one that explains.
    const Controller started = type.make({});
    ASSERT_EQ(started->start(0, steady_input), StepStatus::ok);
    ASSERT_EQ(started->retune(changed), "accepted");
    EXPECT_NEAR(started->update(0, 0), steady_input, 10 * bump_limit(type));

    const Controller c = type.make({});
    ChainPlant plant = plant_of(type);
    ASSERT_EQ(c->start(0, steady_input), StepStatus::ok);
    for (int k = 0; k < 30; ++k) plant.step(c->update(plant.output(), 0));
    const double before = c->state().output;
    ASSERT_EQ(c->retune(changed), "accepted");
    EXPECT_EQ(c->state().output, before);
    EXPECT_NEAR(c->update(plant.output(), 0), before, 10 * bump_limit(type));
  }
}

void refused_retune_changes_nothing(const Type& type) {
  const Controller c = warm(type);
  const Controller before = c->copy();
  ASSERT_EQ(c->retune({.omega_c = -1}), "controller_bandwidth: must be finite and positive");
  EXPECT_TRUE(same(*c, *before));
  EXPECT_NE(c->retune({.gain = 0}), "accepted");
  LoopSetup bad;
  bad.loop.limits = {.lower = 1, .upper = -1};
  EXPECT_NE(c->retune(bad), "accepted");
  EXPECT_TRUE(same(*c, *before));
  EXPECT_TRUE(same_bits(c->update(0.3, 1), before->update(0.3, 1)));
  EXPECT_TRUE(same(*c, *before));
}

/// The operator holds the plant at rest; then the controller takes over with the reference there.
void takeover_from_manual_does_not_bump(const Type& type) {
  const Controller c = type.make({});
  ChainPlant plant = plant_of(type, 0.8);
  for (int k = 0; k < 3000; ++k) {
    ASSERT_EQ(c->track(plant.output(), 0.8, steady_input), steady_input);
    plant.step(steady_input);
  }
  EXPECT_EQ(c->state().mode, LoopMode::running);
  EXPECT_NEAR(c->update(plant.output(), 0.8), steady_input, std::max(1e-8, 64 * rounding(type)));
}

void hold_holds(const Type& type) {
  LoopSetup setup;
  setup.loop.start_hold = {.time = 12.5 * period, .input = 0.25};
  setup.loop.limits = {.lower = -2, .upper = 2};
  const Controller c = type.make(setup);
  EXPECT_EQ(c->state().mode, LoopMode::start_hold);
  for (int k = 0; k < 13; ++k) {
    EXPECT_EQ(c->state().mode, LoopMode::start_hold) << k;
    EXPECT_EQ(c->update(0.5, 4), 0.25) << k;
    if (k > 0) {
      EXPECT_EQ(c->state().applied_input, 0.25) << k;
    }
  }
  EXPECT_EQ(c->state().mode, LoopMode::running);
  EXPECT_NE(c->update(0.5, 4), 0.25);
}

// ---- bad days

void bad_measurement_is_a_missing_one(const Type& type) {
  const double infinity = hidden_infinity<double>();
  for (const double bad : {hidden_nan<double>(), infinity, -infinity}) {
    const Controller hit = warm(type);
    const Controller missing = hit->copy();
    EXPECT_TRUE(same_bits(hit->update(bad, 0.25), missing->update_without_measurement(0.25)));
    EXPECT_EQ(hit->state().status, StepStatus::measurement_rejected);
    EXPECT_TRUE(same(*hit, *missing));
    EXPECT_EQ(hit->state().missed, 1);
    EXPECT_TRUE(same_bits(hit->update(0.1, 0), missing->update(0.1, 0)));
    EXPECT_TRUE(esokit::has(hit->state().status, StepStatus::gap_bridged) ||
                !type.bears_regular_gaps);
    EXPECT_TRUE(finite(*hit));
  }
}

void bad_reference_keeps_the_output(const Type& type) {
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>()}) {
    const Controller c = warm(type);
    const double before = c->state().output;
    const double u = c->update(0.1, bad);
    if (!type.error_based) {
      EXPECT_TRUE(same_bits(u, before));
    }
    EXPECT_EQ(c->state().missed, type.error_based ? 1 : 0);
    EXPECT_TRUE(finite(*c));
    c->update(0.1, 0.1);
    EXPECT_TRUE(finite(*c));
    EXPECT_FALSE(has(c->state().status, StepStatus::reference_rejected));
  }
}

/// At every sample, in every mode and way, and whatever is reported: no report moves the u that is
/// kept.
void bad_reference_is_reported_each_time(const Type& type) {
  for (const double bad : {hidden_nan<double>(), -hidden_infinity<double>()}) {
    for (const double rate : {20.0, 1e300}) {
      LoopSetup setup;
      setup.loop.limits = {.lower = -9, .upper = 9, .rate = rate};
      setup.loop.missing = {.most = 30};
      const Controller c = warm(type, setup);
      const double before = c->state().output;
      for (int k = 0; k < 100; ++k) {
        c->applied(c->state().output + 0.25);
        const double u = k % 7 == 6 ? c->update_without_measurement(bad) : c->update(0.1, bad);
        EXPECT_TRUE(has(c->state().status, StepStatus::reference_rejected)) << k;
        if (!type.error_based) {
          EXPECT_TRUE(same_bits(u, before)) << k;
        }
      }
      // There each is a lost measurement.
      EXPECT_EQ(c->state().mode, type.error_based ? LoopMode::safe : LoopMode::running);
      if (type.error_based) {
        EXPECT_EQ(c->state().output, 0);
      }
      c->update(0.1, 0.1);
      EXPECT_FALSE(has(c->state().status, StepStatus::reference_rejected));
      EXPECT_EQ(c->state().mode, LoopMode::running);
      if (!type.error_based) {
        c->update_with_rate(0.1, 0.1, bad);
        EXPECT_TRUE(has(c->state().status, StepStatus::reference_rejected));
      }
    }
  }
}

void reported_input_is_believed(const Type& type) {
  const Controller own = warm(type);
  const Controller told = own->copy();
  for (int k = 0; k < 20; ++k) {
    const double reported = k % 3 == 1 ? hidden_nan<double>() : own->state().output;
    told->applied(reported);
    EXPECT_TRUE(same_bits(own->update(0.1, 0.2), told->update(0.1, 0.2)));
  }
  EXPECT_TRUE(same(*own, *told));
  // The actuator was stuck.
  told->applied(0.125);
  told->update(0.1, 0.2);
  own->update(0.1, 0.2);
  EXPECT_FALSE(same(*own, *told));
  EXPECT_EQ(told->state().applied_input, 0.125);
  EXPECT_EQ(told->applied(0.125), StepStatus::ok);
  EXPECT_EQ(told->applied(hidden_nan<double>()), StepStatus::input_rejected);
}

/// What an actuator reports is no command: in any sequence of reports u stays in its range, moves
/// by no more than its rate, and output() is what was put out.
void reports_do_not_move_the_command(const Type& type) {
  for (const double sign : {1.0, -1.0}) {
    LoopSetup setup;
    setup.gain *= sign;
    setup.loop.limits = {.lower = rounded(type, -0.7), .upper = rounded(type, 1.1), .rate = 20};
    setup.loop.missing = {.most = 3, .input = 0.5};
    const auto& limits = setup.loop.limits;
    const Controller c = type.make(setup);
    const double step = 20 * period * (1 + 8 * epsilon(type)) + 4 * epsilon(type);
    Random random(31);
    double last = c->state().output;
    int there = 0;
    for (int k = 0; k < 3000; ++k) {
      const int kind = k / 50 % 8;
      const double reports[] = {last + 0.25,           last - 0.25, 10 * last,
                                random.uniform(-9, 9), 1e30,        hidden_nan<double>(),
                                random.uniform(-1, 1), limits.upper};
      for (int i = 0; i <= random.index(3); ++i) c->applied(reports[kind]);
      ASSERT_EQ(c->state().output, last);
      const double y = random.uniform(-0.05, 0.05);
      const double r = kind == 5 && k % 3 == 0 ? hidden_nan<double>() : 4 * random.uniform(-1, 1);
      const double u = random.index(20) == 0 ? c->update_without_measurement(r) : c->update(y, r);
      ASSERT_GE(u, limits.lower);
      ASSERT_LE(u, limits.upper);
      ASSERT_LE(std::abs(u - last), step) << "sample " << k << ", report " << kind;
      ASSERT_EQ(c->state().output, u);
      there += std::abs(u - last) > 0.99 * 20 * period ? 1 : 0;
      last = u;
    }
    EXPECT_GT(there, 100);
    // A rate counts from an operator's u.
    c->track(0, 0, limits.upper);
    EXPECT_LE(limits.upper - c->update(0, -sign * 100), step);
    c->start(0, limits.lower);
    EXPECT_LE(c->update(0, sign * 100) - limits.lower, step);
  }
}

void missing_measurements_end_in_the_safe_output(const Type& type) {
  const double nan = hidden_nan<double>();
  LoopSetup setup;
  setup.loop.limits = {.lower = -9, .upper = 9, .rate = 100};
  setup.loop.missing = {.most = 4, .input = -0.75};
  for (const bool stay : {false, true}) {
    setup.loop.missing.stay = stay;
    const Controller c = warm(type, setup);
    for (int k = 0; k < 4; ++k) {
      c->update(nan, 0);
      EXPECT_EQ(c->state().mode, LoopMode::running) << k;
    }
    for (int k = 0; k < 60; ++k) {
      const double before = c->state().output;
      const double u = c->update_without_measurement(0);
      EXPECT_EQ(c->state().mode, LoopMode::safe);
      EXPECT_LE(std::abs(u - before), 0.5 + 8 * epsilon(type));  // at its rate
      EXPECT_LE(std::abs(u + 0.75), std::abs(before + 0.75));
    }
    EXPECT_EQ(c->state().output, -0.75);
    c->update(0.2, 0);
    EXPECT_EQ(c->state().mode, stay ? LoopMode::safe : LoopMode::running);
    EXPECT_TRUE(finite(*c));
    if (stay) {
      EXPECT_EQ(c->update(0.2, 0), -0.75);
      c->start(0.2, -0.75);
      c->update(0.2, 0);
      EXPECT_EQ(c->state().mode, LoopMode::running);
    }
  }
  // Without one it is zero; the last one is kept only by name, and that of the command.
  for (const bool hold : {false, true}) {
    for (const double rate : {100.0, 1e300}) {
      setup.loop.limits = {.lower = -9, .upper = 9, .rate = rate};
      setup.loop.missing = {.most = 0, .hold = hold};
      const Controller c = warm(type, setup);
      c->track(0, 0, 4);
      for (int k = 0; k < 60; ++k) {
        const double before = c->state().output;
        if (k > 0) c->applied(before + 0.125);  // right after `track` it would be the operator's
        const double u = c->update(nan, 7);
        EXPECT_EQ(c->state().mode, LoopMode::safe);
        if (rate < 1e3 && !hold && k < 7) {
          EXPECT_NEAR(u, before - 0.5, 8 * epsilon(type));
        } else {
          EXPECT_EQ(u, hold ? before : k < 8 && rate < 1e3 ? u : 0);
        }
      }
      EXPECT_EQ(c->state().output, hold ? c->state().output : 0);
    }
  }
}

void safe_output_is_stated(const Type& type) {
  const auto said = [&](const esokit::Limits<double>& limits,
                        const esokit::MissingRule<double>& missing) {
    LoopSetup setup;
    setup.loop.limits = limits;
    setup.loop.missing = missing;
    return type.refusal_of(setup);
  };
  using L = esokit::Limits<double>;
  EXPECT_EQ(said({.lower = 0, .upper = 1}, {}), "accepted");
  EXPECT_EQ(said({.lower = -1, .upper = 0}, {}), "accepted");
  const L above{.lower = 0.25, .upper = 1};
  const L below{.lower = -1, .upper = -0.25};
  EXPECT_EQ(said(above, {}), "missing.input: must be given, as zero is below limits.lower");
  EXPECT_EQ(said(below, {}), "missing.input: must be given, as zero is above limits.upper");
  EXPECT_EQ(said(above, {.hold = true}), "accepted");
  EXPECT_EQ(said(below, {.hold = true}), "accepted");
  EXPECT_EQ(said(above, {.input = 0.25}), "accepted");
  EXPECT_EQ(said(below, {.input = -0.25}), "accepted");
  // Zero that is stated is no exception.
  EXPECT_EQ(said(above, {.input = 0}), "missing.input: must not be below limits.lower");
  EXPECT_EQ(said(below, {.input = 0}), "missing.input: must not be above limits.upper");
  EXPECT_EQ(said({}, {.input = 0.5, .hold = true}),
            "missing.hold: must be left out if missing.input is given");
  LoopSetup held;
  held.loop.limits = above;
  held.loop.missing.input = 0.5;
  EXPECT_EQ(type.refusal_of(held), "accepted");
  held.loop.start_hold.time = 0.1;
  EXPECT_EQ(type.refusal_of(held), "start_hold.input: must not be below limits.lower");
  held.loop.start_hold.input = 0.25;
  EXPECT_EQ(type.refusal_of(held), "accepted");
}

/// Only every D-th measurement is looked at, and the loop is as exact as ever.
void divider_takes_every_dth_measurement(const Type& type) {
  constexpr int every = 4;
  constexpr int most = 3;
  LoopSetup setup;
  setup.loop.measurement_divider = every;
  setup.loop.missing.most = most;
  if (!type.bears_regular_gaps) {
    ASSERT_EQ(type.refusal_of(setup),
              "measurement_divider: must be 1: regular gaps restart this observer");
    return;
  }
  const Controller c = type.make(setup);
  ChainPlant plant = plant_of(type);
  for (int k = 0; k < 4000; ++k) {
    plant.step(c->update(k % every == 0 ? plant.output() : hidden_nan<double>(), 1));
    const auto now = c->state();
    ASSERT_EQ(now.status, StepStatus::ok) << "sample " << k;
    ASSERT_EQ(now.mode, LoopMode::running);
    ASSERT_EQ(now.missed, k % every);
  }
  EXPECT_NEAR(plant.output(), 1, std::max(1e-5, 4 * rounding(type)));
  for (int k = 0; k < most * every; ++k) {
    c->update(hidden_nan<double>(), 1);
    ASSERT_EQ(c->state().mode, LoopMode::running) << k;
  }
  c->update(hidden_nan<double>(), 1);
  EXPECT_EQ(c->state().mode, LoopMode::safe);
}

// ---- the other forms: what is proven of Adrc is proven of them where they are the same

/// The form takes the same samples as the controller; limits that bind, a lost sample now and then.
/// @param make null where there is no such form
/// @param other what the form takes besides y, of a controller that has taken this sample
void beside(const Type& type, Type::Form (*make)(const LoopSetup&),
            double (*other)(const AnyController&, double r)) {
  if (make == nullptr) GTEST_SKIP() << "is fed y";
  LoopSetup setup;
  setup.loop.limits = {.lower = -3, .upper = 4, .rate = 200};
  setup.soften = false;  // the others do not
  const Controller c = type.make(setup);
  const Type::Form form = make(setup);
  ChainPlant plant = plant_of(type);
  Random random(11);
  int at_limit = 0;
  for (int k = 0; k < 200; ++k) {
    const double r = k % 100 < 50 ? 1 : -1;
    const double y =
        k % 17 == 16 ? hidden_nan<double>() : plant.output() + 1e-3 * random.uniform(-1, 1);
    const double u = c->update(y, r);
    at_limit += std::abs(u - c->state().requested) > 0 ? 1 : 0;
    const double allowed = 16 * rounding(type) + 64 * epsilon(type) * std::abs(u);
    ASSERT_NEAR(form(y, other(*c, r)), u, allowed) << "sample " << k;
    plant.step(u);
  }
  EXPECT_GT(at_limit, 5);
}

double reference(const AnyController&, double r) { return r; }

/// b0 u of the state feedback of ADRC, without the disturbance, over b0.
double state_feedback(const AnyController& c, double r) {
  const auto z = c.state().estimate;
  const auto k = c.gains();
  double v = k[0] * (r - z[0]);
  for (std::size_t i = 1; i < k.size(); ++i) v -= k[i] * z[i];
  return v / gain;
}

/// Around the state feedback of ADRC the compensator is ADRC.
void compensator_around_the_feedback_is_adrc(const Type& type) {
  beside(type, type.compensator, state_feedback);
}

void mimo_of_one_channel_is_adrc(const Type& type) { beside(type, type.mimo, reference); }

// ---- housekeeping

void no_allocation(const Type& type) {
  LoopSetup setup;
  setup.loop.missing.most = 3;
  setup.loop.limits = {.lower = -1, .upper = 1, .rate = 50};
  const Controller c = type.make(setup);
  double sink = 0;
  long count = -1;
  {
    const NoAllocation guard;
    for (int k = 0; k < 20; ++k) {
      sink += c->update(0.1, 0.5);
      sink += c->update(hidden_nan<double>(), 0.5);
      c->applied(0.2);
      sink += c->update(0.1, 0.5);
      sink += c->update_with_rate(0.1, 0.5, 0.1);
      for (int i = 0; i < 5; ++i) sink += c->update_without_measurement(0.5);
      sink += c->track(0.1, 0.5, 0.3);
      c->start(0.1, 0.2);
    }
    count = guard.count();
  }
  EXPECT_EQ(count, 0);
  EXPECT_TRUE(std::isfinite(sink));
}

void copies_are_independent(const Type& type) {
  const Controller a = warm(type);
  const Controller b = a->copy();
  const Controller witness = a->copy();
  Random random(5);
  for (int k = 0; k < 40; ++k) {
    const double y = random.uniform(-1, 1);
    EXPECT_TRUE(same_bits(a->update(y, 0.5), b->update(y, 0.5)));
  }
  EXPECT_TRUE(same(*a, *b));
  EXPECT_FALSE(same(*a, *witness));
}

/// A reference with zero derivatives is a reference without.
void reference_vector_agrees_with_scalar(const Type& type) {
  const Controller a = warm(type);
  const Controller b = a->copy();
  Random random(6);
  for (int k = 0; k < 40; ++k) {
    const double y = random.uniform(-0.5, 0.5);
    const double r = random.uniform(-0.5, 0.5);
    const double u = a->update(y, r);
    ASSERT_NEAR(u, b->update_with_rate(y, r, 0),
                16 * rounding(type) + 64 * epsilon(type) * std::abs(u));
  }
}

struct Law {
  const char* name;
  void (*run)(const Type&);
};

#define ESOKIT_LAW(law) \
  Law { #law, &(law) }
constexpr Law laws[] = {ESOKIT_LAW(reaches_reference_under_disturbance),
                        ESOKIT_LAW(limits_do_not_reach_the_observer),
                        ESOKIT_LAW(output_keeps_its_limits),
                        ESOKIT_LAW(start_does_not_bump),
                        ESOKIT_LAW(start_refuses_bad_values),
                        ESOKIT_LAW(retune_does_not_bump),
                        ESOKIT_LAW(refused_retune_changes_nothing),
                        ESOKIT_LAW(takeover_from_manual_does_not_bump),
                        ESOKIT_LAW(hold_holds),
                        ESOKIT_LAW(bad_measurement_is_a_missing_one),
                        ESOKIT_LAW(bad_reference_keeps_the_output),
                        ESOKIT_LAW(bad_reference_is_reported_each_time),
                        ESOKIT_LAW(reported_input_is_believed),
                        ESOKIT_LAW(reports_do_not_move_the_command),
                        ESOKIT_LAW(missing_measurements_end_in_the_safe_output),
                        ESOKIT_LAW(safe_output_is_stated),
                        ESOKIT_LAW(divider_takes_every_dth_measurement),
                        ESOKIT_LAW(compensator_around_the_feedback_is_adrc),
                        ESOKIT_LAW(mimo_of_one_channel_is_adrc),
                        ESOKIT_LAW(no_allocation),
                        ESOKIT_LAW(copies_are_independent),
                        ESOKIT_LAW(reference_vector_agrees_with_scalar)};
#undef ESOKIT_LAW

class ControllerLawTest : public ::testing::Test {
 public:
  ControllerLawTest(const Law& law, const Type& type) : law_(law), type_(type) {}
  void TestBody() override { law_.run(type_); }

 private:
  Law law_;
  Type type_;
};

}  // namespace

void register_controller_laws_of(const std::string& suite, const ControllerType& type,
                                 const char* file) {
  for (const Law& law : laws) {
    ::testing::RegisterTest(suite.c_str(), law.name, type.name.c_str(), nullptr, file, __LINE__,
                            [law, type] { return new ControllerLawTest(law, type); });
  }
}

}  // namespace esokit_test
