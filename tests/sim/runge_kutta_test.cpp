// Runge-Kutta methods: order measured by step halving, oracle Boost.odeint, refused tableaux.
#include <gtest/gtest.h>

#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/runge_kutta.hpp>

namespace sim_runge_kutta_test {

using namespace esokit;
using namespace esokit::sim;

// x1' = x2, x2' = -2 x1 x2^2 + .. would have no closed form; this one has: with y' = -2 t y^2,
// y(0) = 1, y = 1/(1 + t^2), coupled one way to z' = y z cos t. The second has the reference of a
// far finer step.
using State2 = EigenMatrix<double, 2>;
State2 nonlinear(double t, const State2& x) {
  return {-2.0 * t * x[0] * x[0], x[0] * x[1] * std::cos(t) - x[1] * x[1]};
}

// Tableaux as a user writes them, in double: Euler's, and Heun's of third order.
struct UserEuler {
  static constexpr int stages = 1;
  static constexpr int order = 1;
  static constexpr double a[1][1] = {{0}};
  static constexpr double b[1] = {1};
  static constexpr double c[1] = {0};
};
struct UserHeun3 {
  static constexpr int stages = 3;
  static constexpr int order = 3;
  static constexpr double a[3][3] = {{0, 0, 0}, {1.0 / 3, 0, 0}, {0, 2.0 / 3, 0}};
  static constexpr double b[3] = {0.25, 0, 0.75};
  static constexpr double c[3] = {0, 1.0 / 3, 2.0 / 3};
};
struct ImplicitMidpoint {
  static constexpr int stages = 1;
  static constexpr int order = 2;
  static constexpr double a[1][1] = {{0.5}};
  static constexpr double b[1] = {1};
  static constexpr double c[1] = {0.5};
};
struct HeunWithTypo : UserHeun3 {
  static constexpr double b[3] = {0.25, 0, 0.7};
};
struct HeunThatClaimsFour : UserHeun3 {
  static constexpr int order = 4;
};
struct MissingNodes {
  static constexpr int stages = 1;
  static constexpr int order = 1;
  static constexpr double a[1][1] = {{0}};
  static constexpr double b[1] = {1};
};
// Meets every order condition of its order; a system in t would see the wrong time.
struct WrongNode : UserEuler {
  static constexpr double c[1] = {0.3};
};
struct SizesDiffer : UserEuler {
  static constexpr double b[2] = {1, 0};
};
// Each misses one condition of the next order and meets the other: sum b c^2 = 1/3 but not sum b a
// c = 1/6; the other way round; of order 4 sum b c a c = 1/8 alone, sum b a a c = 1/24 alone.
struct MissesBac : UserHeun3 {
  static constexpr double a[3][3] = {{0, 0, 0}, {1.0 / 3, 0, 0}, {1.0 / 3, 1.0 / 3, 0}};
};
struct MissesBcc {
  static constexpr int stages = 3;
  static constexpr int order = 2;
  static constexpr double a[3][3] = {{0, 0, 0}, {0.5, 0, 0}, {1.0 / 3, 2.0 / 3, 0}};
  static constexpr double b[3] = {0.5, 0, 0.5};
  static constexpr double c[3] = {0, 0.5, 1};
};
struct MissesBcac : RungeKutta4 {
  static constexpr double a[4][4] = {{}, {0.5}, {0.25, 0.25}, {-0.5, -0.5, 2}};
};
struct MissesBaac : RungeKutta4 {
  static constexpr double a[4][4] = {{}, {0.5}, {0, 0.5}, {0, 0.5, 0.5}};
};

static_assert(ExplicitRungeKutta<UserEuler> && proven_order<UserEuler>() == 1);
static_assert(ExplicitRungeKutta<RungeKutta4> && proven_order<RungeKutta4>() == 4);
static_assert(ExplicitRungeKutta<UserHeun3> && proven_order<UserHeun3>() == 3);
static_assert(ButcherTableau<ImplicitMidpoint> && !ExplicitRungeKutta<ImplicitMidpoint>);
static_assert(ButcherTableau<HeunWithTypo> && !ExplicitRungeKutta<HeunWithTypo>);
static_assert(!ExplicitRungeKutta<HeunThatClaimsFour>);
static_assert(!ExplicitRungeKutta<MissingNodes>);
static_assert(!ExplicitRungeKutta<WrongNode>);
static_assert(!ExplicitRungeKutta<SizesDiffer>);
static_assert(proven_order<MissesBac>() == 2 && proven_order<MissesBcc>() == 2);
static_assert(proven_order<MissesBcac>() == 3 && proven_order<MissesBaac>() == 3);

// A lambda whose return type is an expression template would return references to the dead.
constexpr auto returns_expression = [](double, const State2& x) { return -x; };
constexpr auto returns_state = [](double, const State2& x) -> State2 { return -x; };
static_assert(!RightHandSide<decltype(returns_expression), State2, double>);
static_assert(RightHandSide<decltype(returns_state), State2, double>);

template <class Method>
double measured_order() {
  const State2 start(1.0, 0.5);
  const double end = 2.0;
  State2 exact = integrate(nonlinear, 0.0, start, end / 40000, 40000);
  EXPECT_NEAR(exact[0], 1.0 / (1.0 + end * end), 1e-14);
  const auto error = [&](int steps) {
    return (integrate<Method>(nonlinear, 0.0, start, end / steps, steps) - exact).norm();
  };
  return std::log2(error(400) / error(800));
}

TEST(RungeKutta, MeasuredOrder) {
  EXPECT_NEAR(measured_order<UserEuler>(), 1.0, 0.05);
  EXPECT_NEAR(measured_order<RungeKutta4>(), 4.0, 0.05);
  EXPECT_NEAR(measured_order<UserHeun3>(), 3.0, 0.05);
}

TEST(RungeKutta, AgreesWithBoostOdeint) {
  using Array2 = std::array<double, 2>;
  boost::numeric::odeint::runge_kutta4<Array2> stepper;
  const auto system = [](const Array2& x, Array2& rate, double t) {
    const State2 value = nonlinear(t, State2(x[0], x[1]));
    rate = {value[0], value[1]};
  };
  Array2 theirs{1.0, 0.5};
  State2 ours(1.0, 0.5);
  const double h = 0.05;
  for (int k = 0; k < 200; ++k) {
    stepper.do_step(system, theirs, k * h, h);
    ours = step(nonlinear, k * h, ours, h);
    ASSERT_NEAR(ours[0], theirs[0], 1e-14) << k;
    ASSERT_NEAR(ours[1], theirs[1], 1e-14) << k;
  }
}

TEST(RungeKutta, OneStepOfLinearDecayIsTheTaylorPolynomial) {
  const auto decay = [](auto /*t*/, auto x) { return -x; };
  EXPECT_DOUBLE_EQ(step<UserEuler>(decay, 0.0, 1.0, 0.5), 1 - 0.5);
  EXPECT_DOUBLE_EQ(step<UserHeun3>(decay, 0.0, 1.0, 0.5), 1 - 0.5 + 0.125 - 0.125 / 6);
  EXPECT_DOUBLE_EQ(step(decay, 0.0, 1.0, 0.5), 1 - 0.5 + 0.125 - 0.125 / 6 + 0.0625 / 24);
  EXPECT_FLOAT_EQ(step(decay, 0.0F, 1.0F, 0.5F), 0.6067708F);
  // The coefficients are not rounded to double on their way.
  const long double expected = 1 - 0.5L + 0.125L - 0.125L / 6 + 0.0625L / 24;
  EXPECT_LT(std::abs(step(decay, 0.0L, 1.0L, 0.5L) - expected), 2e-19L);
}

TEST(RungeKutta, PolynomialsInTimeUseTheNodes) {
  const auto cube = [](double t, double /*x*/) { return 4.0 * t * t * t; };
  EXPECT_NEAR(step(cube, 1.0, 1.0, 1.0), 16.0, 1e-14);
  const auto square = [](double t, double /*x*/) { return 3.0 * t * t; };
  EXPECT_NEAR(step<UserHeun3>(square, 1.0, 1.0, 1.0), 8.0, 1e-14);
}

TEST(RungeKutta, EvaluatesOncePerStage) {
  int calls = 0;
  const auto count = [&calls](double /*t*/, double x) {
    ++calls;
    return x;
  };
  (void)step<UserEuler>(count, 0.0, 1.0, 0.1);
  EXPECT_EQ(calls, 1);
  (void)step(count, 0.0, 1.0, 0.1);
  EXPECT_EQ(calls, 5);
}

// The least that a state must offer; the count shows if a zero of the tableau is multiplied.
struct Counted {
  explicit Counted(double initial) : value(initial) {}
  double value;
  static inline int products = 0;
  friend Counted operator+(Counted a, Counted b) { return Counted(a.value + b.value); }
  friend Counted operator*(double s, Counted a) {
    ++products;
    return Counted(s * a.value);
  }
};

TEST(RungeKutta, ZerosOfTheTableauCostNothing) {
  const auto decay = [](double /*t*/, const Counted& x) { return Counted(-x.value); };
  Counted::products = 0;
  const Counted next = step(decay, 0.0, Counted{1.0}, 0.5);
  EXPECT_EQ(Counted::products, 3 + 4);
  EXPECT_DOUBLE_EQ(next.value, 1 - 0.5 + 0.125 - 0.125 / 6 + 0.0625 / 24);
  Counted::products = 0;
  (void)step<UserHeun3>(decay, 0.0, Counted{1.0}, 0.5);
  EXPECT_EQ(Counted::products, 2 + 2);
}

TEST(RungeKutta, IntegrateDoesNotDriftInTime) {
  double last = -1.0;
  const auto watch = [&last](double t, double /*x*/) {
    last = t;
    return 0.0;
  };
  (void)integrate<UserEuler>(watch, 1.0, 0.0, 0.1, 1001);
  EXPECT_DOUBLE_EQ(last, 1.0 + 1000 * 0.1);
}

TEST(RungeKutta, DynamicStates) {
  const auto decay = [](double, const Eigen::VectorXd& x) -> Eigen::VectorXd { return -x; };
  const Eigen::VectorXd start = Eigen::VectorXd::LinSpaced(3, 1.0, 3.0);
  const Eigen::VectorXd end = integrate(decay, 0.0, start, 0.01, 100);
  EXPECT_NEAR((end - std::exp(-1.0) * start).norm(), 0.0, 1e-9);
}

}  // namespace sim_runge_kutta_test
