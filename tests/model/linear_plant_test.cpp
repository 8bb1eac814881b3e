// The linear plant: against closed forms, its parts against each other, refused numbers by their
// rule.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <esokit/core/pack.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/held_plant.hpp>
#include <limits>
#include <string>
#include <support/refusal.hpp>

namespace model_linear_plant_test {

using namespace esokit;
using esokit_test::refusal;

// Made when compiling, too.
constexpr auto servo = LinearPlant<2>::chain({.coefficients = {5, 2}, .input_gain = 10});
static_assert(servo->relative_degree() == 2 && servo->input_gain() == 10.0);
static_assert(servo->b(1) == 10.0 && servo->e(1) == 1.0);
constexpr LinearPlant<2> listed{.a = {{0, 1}, {-5, -2}}, .b = {0, 10}, .c = {1, 0}};
static_assert(listed.a == servo->a && listed.b == servo->b && listed.c == servo->c);
static_assert(listed.e == listed.b, "d enters as u does");
static_assert(held_plant(listed, 0.1).has_value());

/// C (s I - A)^-1 b for two states, of u or of d.
std::complex<double> response(const LinearPlant<2>& p, const Vector<double, 2>& b,
                              std::complex<double> s) {
  const auto determinant = (s - p.a(0, 0)) * (s - p.a(1, 1)) - p.a(0, 1) * p.a(1, 0);
  const auto x0 = ((s - p.a(1, 1)) * b(0) + p.a(0, 1) * b(1)) / determinant;
  const auto x1 = (p.a(1, 0) * b(0) + (s - p.a(0, 0)) * b(1)) / determinant;
  return p.c(0, 0) * x0 + p.c(0, 1) * x1;
}

TEST(LinearPlant, IsItsTransferFunction) {
  const double b0 = 3.0, b1 = -1.5, a0 = 5.0, a1 = 2.0;
  const auto plant = LinearPlant<2>::transfer_function(
                         {.numerator = {b0, b1}, .denominator = {a0, a1}, .dead_time = 0.3})
                         .value();
  EXPECT_EQ(plant.dead_time, 0.3);
  EXPECT_EQ(plant.relative_degree(), 1);
  EXPECT_EQ(plant.input_gain(), b1);
  for (const std::complex<double> s : {std::complex(0.2, 1.0), std::complex(1.0, -3.0)}) {
    const auto exact = (b1 * s + b0) / (s * s + a1 * s + a0);
    EXPECT_NEAR(std::abs(response(plant, plant.b, s) - exact), 0.0, 1e-14);
    EXPECT_NEAR(std::abs(response(plant, plant.e, s) - exact), 0.0, 1e-14);
    // A chain has d in the unit of y^(n).
    EXPECT_NEAR(std::abs(response(*servo, servo->e, s) - 1.0 / (s * s + 2.0 * s + 5.0)), 0.0,
                1e-14);
  }
  // Three zeros to choose from: s^2 + 4 s + 7 over s^3 + 2 s^2 + 3 s + 5, long division by hand.
  const auto third =
      LinearPlant<3>::transfer_function({.numerator = {7, 4, 1}, .denominator = {5, 3, 2}}).value();
  EXPECT_EQ(third.b, (Vector<double, 3>{1, 2, 0}));
  const auto without_zeros =
      LinearPlant<2>::transfer_function({.numerator = {10}, .denominator = {5, 2}}).value();
  EXPECT_EQ(without_zeros.b, servo->b);
  EXPECT_EQ(without_zeros.e, servo->b);
}

TEST(LinearPlant, RelativeDegreeIgnoresWhatRoundingLeft) {
  // The servo in coordinates turned by 0.3 rad: C B = cos sin - sin cos, which may not be zero.
  const double c = std::cos(0.3), s = std::sin(0.3);
  const Matrix<double, 2, 2> turn{{c, s}, {-s, c}};
  auto turned = *servo;
  turned.a = turn * servo->a * turn.transpose();
  turned.b = turn * servo->b;
  turned.c = servo->c * turn.transpose();
  for (const double rest : {0.0, 1e-16, -1e-16}) {
    auto rough = turned;
    rough.c(0, 0) += rest;
    EXPECT_EQ(rough.relative_degree(), 2) << rest;
    EXPECT_NEAR(rough.input_gain(), 10.0, 1e-13);
  }
  turned.c(0, 0) += 1e-9;  // no rounding
  EXPECT_EQ(turned.relative_degree(), 1);
}

TEST(LinearPlant, ActuatorAndSensorCountAsOrders) {
  const auto lagged = with_lag(*servo, 0.05).value();
  EXPECT_EQ(lagged.relative_degree(), 3);
  EXPECT_DOUBLE_EQ(lagged.input_gain(), 200.0);
  // In the steady state all three are the plant; d goes around the actuator.
  const auto seen = with_sensor(lagged, 0.02).value();
  EXPECT_EQ(seen.relative_degree(), 4);
  EXPECT_NEAR(seen.input_gain(), 200.0 / 0.02, 1e-9);
  Vector<double, 4> x{2.0, 0.0, 1.0, 2.0};  // y = 2 under u = 1
  for (const double rate : seen.derivative(x, Vector<double, 1>(1.0)))
    EXPECT_NEAR(rate, 0.0, 1e-13);
  EXPECT_EQ(seen.derivative(x, Vector<double, 1>(1.0), Vector<double, 1>(3.0)),
            (Vector<double, 4>{0.0, 3.0, 0.0, 0.0}));
  EXPECT_EQ(double(seen.output({0, 0, 0, 7})), 7.0);
  const auto late = with_dead_time(with_dead_time(seen, 0.1).value(), 0.25).value();
  EXPECT_DOUBLE_EQ(late.dead_time, 0.35);
  EXPECT_EQ(with_lag(late, 0.1)->dead_time, late.dead_time);
  EXPECT_EQ(with_sensor(late, 0.1)->dead_time, late.dead_time);
  EXPECT_EQ(late.a, seen.a);
}

TEST(LinearPlant, HasTheCoefficientsItWasMadeOf) {
  EXPECT_EQ(servo->coefficients(), (Array<double, 2>{5, 2}));
  const Array<double, 4> four{7, -3, 2, 0.5};
  const auto chain = LinearPlant<4>::chain({.coefficients = four}).value();
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(chain.coefficients()[i], four[i], 1e-14);
  // (s^2 + 2 s + 5) (s + 20) = s^3 + 22 s^2 + 45 s + 100
  const auto lagged = with_lag(*servo, 0.05)->coefficients();
  EXPECT_DOUBLE_EQ(lagged[0], 100.0);
  EXPECT_DOUBLE_EQ(lagged[1], 45.0);
  EXPECT_DOUBLE_EQ(lagged[2], 22.0);
}

TEST(LinearPlant, TwoInputsTwoOutputs) {
  // y_1'' = -y_1' + 2 u_1 + 1.4 u_2, y_2' = -2 y_2 + 1.2 u_1 + 3 u_2
  const auto plant =
      LinearPlant<3, double, 2, 2>::state_space({.a = {{0, 1, 0}, {0, -1, 0}, {0, 0, -2}},
                                                 .b = {{0, 0}, {2, 1.4}, {1.2, 3}},
                                                 .c = {{1, 0, 0}, {0, 0, 1}}})
          .value();
  EXPECT_EQ(plant.relative_degree(0), 2);
  EXPECT_EQ(plant.relative_degree(1), 1);
  EXPECT_EQ(plant.input_gain(), (Matrix<double, 2, 2>{{2, 1.4}, {1.2, 3}}));
  const auto lagged = with_lag(plant, 0.5).value();
  EXPECT_EQ(lagged.relative_degree(1), 2);
  EXPECT_EQ(lagged.input_gain(), (Matrix<double, 2, 2>{{4, 2.8}, {2.4, 6}}));
  EXPECT_EQ(lagged.derivative({0, 0, 0, 1, 0}, {}), (Vector<double, 5>{0, 2, 1.2, -2, 0}));
  EXPECT_EQ(with_sensor(plant, 0.5)->relative_degree(0), 3);
}

// y'' + 2 y' + 5 y = 10 u + d: poles -1 +- 2i.
TEST(HeldPlant, IsTheSolution) {
  for (const double t : {1e-6, 0.1, 1.0, 6.0}) {
    const auto held = held_plant(*servo, t).value();
    const double decay = std::exp(-t), co = std::cos(2 * t), si = std::sin(2 * t);
    const double step = (1.0 - decay * (co + 0.5 * si)) / 5.0;  // of d, from rest
    const double slope = decay * si / 2.0;
    const auto near = [t](double ours, double exact, double size) {
      EXPECT_NEAR(ours, exact, 1e-14 * size) << t;
    };
    near(held.input(0), 10 * step, 2.0);
    near(held.input(1), 10 * slope, 5.0);
    near(held.disturbance(0), step, 0.2);
    near(held.disturbance(1), slope, 0.5);
    near(held.increment(0, 0), decay * (co + 0.5 * si) - 1.0, 1.0);
    near(held.increment(0, 1), slope, 0.5);
    near(held.increment(1, 0), -5.0 * slope, 2.5);
  }
  // For a short while the digits are those of the increment.
  // exp(A t) - I = A t + A^2 t^2 / 2 + ..
  EXPECT_NEAR(held_plant(*servo, 1e-6)->increment(1, 1) / -2e-6, 1.0 + 0.25e-6, 2e-12);
  EXPECT_EQ(held_plant(*servo, 0.0)->increment, (Matrix<double, 2, 2>()));
}

TEST(HeldPlant, OfTwoHalvesIsThatOfTheWhole) {
  const auto plant = with_sensor(with_lag(*servo, 0.05).value(), 0.02).value();
  const auto half = held_plant(plant, 0.15).value(), whole = held_plant(plant, 0.3).value();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      double twice = 2 * half.increment(i, j);
      for (int k = 0; k < 4; ++k) twice += half.increment(i, k) * half.increment(k, j);
      EXPECT_NEAR(twice, whole.increment(i, j), 1e-13 * 20);
    }
    double input = 2 * half.input(i);
    for (int k = 0; k < 4; ++k) input += half.increment(i, k) * half.input(k);
    EXPECT_NEAR(input, whole.input(i), 1e-13 * 20);
  }
}

TEST(HeldPlant, OfPacksIsThatOfEachLane) {
  using Pair = Pack<double, 2>;
  const auto plants = LinearPlant<2, Pair>::chain(
      {.coefficients = {Pair({5, 1}), Pair({2, 3})}, .input_gain = Pair({10, 4})});
  EXPECT_EQ(plants->relative_degree(), 2);
  const auto held = held_plant(*plants, Pair({0.1, 0.2})).value();
  for (int lane = 0; lane < 2; ++lane) {
    const auto plant = LinearPlant<2>::chain({.coefficients = {lane == 0 ? 5.0 : 1.0, 2.0 + lane},
                                              .input_gain = lane == 0 ? 10.0 : 4.0});
    const auto one = held_plant(*plant, lane == 0 ? 0.1 : 0.2).value();
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(held.input(i)[lane], one.input(i));
      EXPECT_EQ(held.disturbance(i)[lane], one.disturbance(i));
      for (int j = 0; j < 2; ++j) EXPECT_EQ(held.increment(i, j)[lane], one.increment(i, j));
    }
  }
  const auto wrong = LinearPlant<2, Pair>::chain({.input_gain = Pair({1, 0})});
  EXPECT_EQ(refusal(wrong), "input_gain: must be finite and not zero (negative is fine)");
}

TEST(LinearPlant, RefusesByFieldAndRule) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  using P = LinearPlant<2>;
  for (const double bad : {nan, infinity, -infinity}) {
    EXPECT_EQ(refusal(P::chain({.coefficients = {bad, 1}})), "coefficients[0]: must be finite");
    EXPECT_EQ(refusal(P::chain({.coefficients = {1, bad}})), "coefficients[1]: must be finite");
    EXPECT_EQ(refusal(P::transfer_function({.numerator = {1, bad}})),
              "numerator[1]: must be finite");
    EXPECT_EQ(refusal(P::transfer_function({.numerator = {1}, .denominator = {bad, 1}})),
              "denominator[0]: must be finite");
    for (int i = 0; i < 4; ++i) {
      auto plant = *servo;
      plant.a.data()[i] = bad;
      EXPECT_EQ(refusal(P::state_space(plant)), "a[" + std::to_string(i) + "]: must be finite");
    }
    for (int i = 0; i < 2; ++i) {
      const std::string place = "[" + std::to_string(i) + "]: must be finite";
      for (const auto& [member, name] : {std::pair{&P::b, "b"}, std::pair{&P::e, "e"}}) {
        auto plant = *servo;
        (plant.*member)(i) = bad;
        EXPECT_EQ(refusal(P::state_space(plant)), name + place);
      }
      auto plant = *servo;
      plant.c(i) = bad;
      EXPECT_EQ(refusal(P::state_space(plant)), "c" + place);
    }
  }
  for (const double bad : {nan, infinity, -infinity, 0.0}) {
    EXPECT_EQ(refusal(P::chain({.input_gain = bad})),
              "input_gain: must be finite and not zero (negative is fine)");
  }
  EXPECT_EQ(refusal(P::chain({.input_gain = -1})), "accepted");
  for (const double bad : {nan, infinity, -infinity, -1e-9}) {
    const char* const rule = "dead_time: must be finite and not negative";
    EXPECT_EQ(refusal(P::chain({.dead_time = bad})), rule);
    EXPECT_EQ(refusal(P::transfer_function({.numerator = {1}, .dead_time = bad})), rule);
    EXPECT_EQ(refusal(with_dead_time(*servo, bad)), rule);
  }
  for (const double bad : {nan, infinity, -infinity, 0.0, -1.0}) {
    EXPECT_EQ(refusal(with_lag(*servo, bad)), "time_constant: must be finite and positive");
    EXPECT_EQ(refusal(with_sensor(*servo, bad)), "time_constant: must be finite and positive");
  }
  EXPECT_EQ(refusal(with_lag(*servo, 1e-310)),
            "time_constant: has an inverse that the scalar cannot hold");
  const auto strong = LinearPlant<1>::chain({.input_gain = 1e300}).value();
  EXPECT_EQ(refusal(with_lag(strong, 1e-7)), "accepted");
  EXPECT_EQ(refusal(with_lag(strong, 1e-10)),
            "time_constant: gives a plant that the scalar cannot hold");
  EXPECT_EQ(refusal(with_sensor(strong, 1e-10)),
            "time_constant: gives a plant that the scalar cannot hold");
  EXPECT_EQ(refusal(P::state_space({.a = {{0, 1e200}, {0, 0}}, .b = {0, 1e200}, .c = {1, 0}})),
            "b: gives an input gain (the value here) that the scalar cannot hold");
  EXPECT_EQ(refusal(P::transfer_function({})), "numerator[0]: must not be zero throughout");
  EXPECT_EQ(refusal(P::transfer_function({.numerator = {1, 1e200}, .denominator = {0, 1e200}})),
            "numerator[0]: gives, with this denominator, a state that the scalar cannot hold");
  const char* const unreached = "c[1]: is of an output that no input reaches";
  EXPECT_EQ(refusal(LinearPlant<2, double, 1, 2>::state_space(
                {.a = {{-1, 0}, {0, -1}}, .b = {1, 0}, .c = {{1, 0}, {0, 1}}})),
            unreached);
  EXPECT_EQ(refusal(with_lag(P{}, 1.0)), "c[0]: is of an output that no input reaches");
  for (const double bad : {nan, infinity, -1e-9}) {
    EXPECT_EQ(refusal(held_plant(*servo, bad)), "duration: must be finite and not negative");
  }
  const auto unstable = LinearPlant<1>::chain({.coefficients = {-1.0}}).value();
  EXPECT_EQ(refusal(held_plant(unstable, 700.0)), "accepted");
  EXPECT_EQ(refusal(held_plant(unstable, 720.0)),
            "duration: is so long that the plant's states leave the range of the scalar");
}

}  // namespace model_linear_plant_test
