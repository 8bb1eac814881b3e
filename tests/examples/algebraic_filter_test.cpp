// AlgebraicFilter against the matrices that the paper prints (J. Kasac, A. Pender, M. Pranjic,
// D. Kotarski, Asian Journal of Control 23 (2021) 2171-2184), and against the chain form.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/eigen.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <limits>
#include <paper2_fsb_algebraic_eso/algebraic_filter.hpp>
#include <support/high_precision.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <utility>

namespace esokit_test {
namespace examples_algebraic_filter_test {

using esokit::examples::AlgebraicFilter;

template <class T, std::size_t Rows, std::size_t Columns>
using Table = std::array<std::array<T, Columns>, Rows>;

template <class T, std::size_t N, std::size_t K, std::size_t M>
Table<T, N, M> times(const Table<T, N, K>& a, const Table<T, K, M>& b) {
  Table<T, N, M> product{};
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < M; ++j) {
      T sum(0);
      for (std::size_t k = 0; k < K; ++k) sum += a[i][k] * b[k][j];
      product[i][j] = sum;
    }
  }
  return product;
}

template <class T, std::size_t N, std::size_t M>
Table<T, N, M> plus(const Table<T, N, M>& a, const Table<T, N, M>& b) {
  Table<T, N, M> sum = a;
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < M; ++j) sum[i][j] += b[i][j];
  }
  return sum;
}

template <class T, std::size_t N, std::size_t M>
Table<T, N, M> scaled(const T& factor, const Table<T, N, M>& a) {
  Table<T, N, M> product = a;
  for (auto& row : product) {
    for (T& x : row) x *= factor;
  }
  return product;
}

/// Eqs. (35)-(51) for y'' = d + b0 u as they are printed, corrected where the print is wrong.
template <class T>
struct Printed {
  Table<T, 3, 3> a;       ///< (40)
  Table<T, 3, 1> b1, b2;  ///< (39)
  Table<T, 3, 3> c;       ///< (45)-(51)

  Printed(const T& q, const T& l, const T& b0, const T& t) {
    using std::exp;
    const T e1 = exp(-q * t);
    const T e2 = e1 * e1;
    const T e3 = e2 * e1;
    const Table<T, 4, 1> phi{{{T(1)}, {e1}, {e2}, {e3}}};
    const Table<T, 4, 1> phi_rate{{{T(0)}, {-q * e1}, {-2 * q * e2}, {-3 * q * e3}}};
    const T q2 = q * q;
    const T q3 = q2 * q;
    const Table<T, 4, 4> gamma1{{{T(0), 3 * q3, -24 * q3, 27 * q3},
                                 {T(0), 9 * q2, -36 * q2, 27 * q2},
                                 {T(0), 9 * q, -18 * q, 9 * q},
                                 {T(-1), T(3), T(-3), T(1)}}};
    const Table<T, 2, 4> gamma2{{{T(0), 3 * q, -6 * q, 3 * q}, {T(-1), T(3), T(-3), T(1)}}};
    const Table<T, 4, 2> input{{{-b0, T(0)}, {T(0), -b0}, {T(0), T(0)}, {T(0), T(0)}}};
    const Table<T, 3, 4> lambda{{{T(0), T(0), T(-1), 3 * l},
                                 {T(0), T(-1), 2 * l, -3 * l * l},
                                 {T(-1), l, -l * l, l * l * l}}};
    a = {{{-l, T(1), T(0)}, {T(0), -l, T(1)}, {T(0), T(0), -l}}};
    b1 = times(times(lambda, gamma1), phi);
    b2 = times(times(times(lambda, input), gamma2), phi);
    const Table<T, 3, 1> b1_rate = times(times(lambda, gamma1), phi_rate);

    const T shifted = e1 - 1;
    const T g = shifted * shifted * shifted;
    const T g1 = 3 * shifted * shifted * (-q * e1);
    const T g2 = 6 * shifted * q2 * e2 + 3 * shifted * shifted * q2 * e1;
    const Table<T, 3, 3> one{{{T(1), T(0), T(0)}, {T(0), T(1), T(0)}, {T(0), T(0), T(1)}}};
    const Table<T, 1, 3> c1{{{1 / g, T(0), T(0)}}};
    // c2 = c1 (-g'/g I + A + b1 c1)
    const auto c2 = times(c1, plus(plus(scaled(T(-g1 / g), one), a), times(b1, c1)));
    // c3 = c1 A^2 + (-2 g'/g + c1 b1) c2 + (-g''/g + c1 A b1 + c1 b1') c1
    const T c1b1 = times(c1, b1)[0][0];
    const T rest = -g2 / g + times(times(c1, a), b1)[0][0] + times(c1, b1_rate)[0][0];
    const auto c3 =
        plus(plus(times(times(c1, a), a), scaled(T(-2 * g1 / g + c1b1), c2)), scaled(rest, c1));
    c = {c1[0], c2[0], c3[0]};
  }
};

struct Setting {
  double lambda;
  double q;
};
constexpr std::array settings{Setting{60, 0.1}, Setting{1, 0.1}, Setting{8, 0.2},
                              Setting{0, 0.5},  Setting{2, 30},  Setting{0.3, 1e-3}};
constexpr std::array times_of_test{1e-3, 0.02, 0.1, 0.7, 3.0, 10.0};

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Entry by entry in high precision, where the printed sums of e^{-iqt} may cancel as they like.
/// The tolerance is that of the entry's largest term, as some entries change their sign.
TEST(AlgebraicFilter, EqualsThePrintedMatrices) {
  constexpr double b0 = -3.5;
  for (const auto& [lambda, q] : settings) {
    for (const double t : times_of_test) {
      SCOPED_TRACE(::testing::Message() << "lambda " << lambda << ", q " << q << ", t " << t);
      const auto filter =
          AlgebraicFilter<2>::make(
              {.observer_bandwidth = lambda, .frequency_shift = q, .input_gain = b0})
              .value();
      const Printed<Big> printed{Big(q), Big(lambda), Big(b0), Big(t)};
      const auto a = filter.state_matrix();
      const auto b1 = filter.measurement_vector(t);
      const auto b2 = filter.input_vector(t);
      const auto c = filter.output_matrix(t);
      const Big scale = pow(-Big(q), 3);  // the paper's x is (-q)^N times ours
      const double w = -std::expm1(-q * t) / q;
      for (int i = 0; i < 3; ++i) {
        const auto r = static_cast<std::size_t>(i);
        // Terms of G_{i+1}: (lambda + N (1/w + q))^(i+1) w^N bounds their sum.
        const double rate = lambda + 3 * (1 / w + q);
        const double b1_terms = 3 * std::pow(rate, i + 1) * w * w * w;
        EXPECT_LE(static_cast<double>(abs(Big(b1(i)) - printed.b1[r][0] / scale)),
                  64 * epsilon * b1_terms)
            << "b1 " << i;
        const double b2_terms = i == 0 ? 0 : std::abs(b0) * std::pow(rate, i - 1) * w * w * w;
        EXPECT_LE(static_cast<double>(abs(Big(b2(i)) - printed.b2[r][0] / scale)),
                  64 * epsilon * b2_terms)
            << "b2 " << i;
        for (int j = 0; j < 3; ++j) {
          const auto s = static_cast<std::size_t>(j);
          EXPECT_EQ(a(i, j), static_cast<double>(printed.a[r][s]));
          if (j > i) {
            EXPECT_EQ(c(i, j), 0);
            EXPECT_LE(abs(printed.c[r][s] * scale), Big(1e-60)) << "C " << i << j;
          } else {
            // Positive sums: good to a few units in the last place.
            EXPECT_LE(static_cast<double>(abs(Big(c(i, j)) / (printed.c[r][s] * scale) - 1)),
                      64 * epsilon)
                << "C " << i << j;
          }
        }
      }
    }
  }
}

/// L(t) = C(t) b1(t) by the printed matrices in double, where they are well conditioned, to 1e-9.
TEST(AlgebraicFilter, PrintedMatricesGiveTheFallingBandwidthGain) {
  int compared = 0;
  for (const auto& [lambda, q] : settings) {
    const esokit::ContinuousAlgebraicGain<3, double> law(lambda, q);
    for (const double t : times_of_test) {
      // g is a difference of numbers about 1 that is (qt)^3; C b1 divides by it twice over.
      if (q * t < 0.02) continue;
      const Printed<double> printed(q, lambda, 1.0, t);
      const auto gain = times(printed.c, printed.b1);
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(gain[static_cast<std::size_t>(i)][0] / law.gain(t, 0.0)(i), 1.0, 1e-9)
            << lambda << ", " << q << ", " << t << ", row " << i;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 40);
}

/// The paper's own setting, q epsilon = 0.002, in float: the printed sums lose all digits there.
TEST(AlgebraicFilter, FloatHasDigitsWhereThePrintedSumsHaveNone) {
  const Printed<float> printed(0.1f, 60.0f, 1.0f, 0.02f);
  const Printed<Big> truth(Big(0.1f), Big(60.0f), Big(1), Big(0.02f));
  const auto filter = AlgebraicFilter<2, float>::make(
                          {.observer_bandwidth = 60, .frequency_shift = 0.1f, .input_gain = 1})
                          .value();
  const Big scale = pow(-Big(0.1f), 3);
  const Big b1 = truth.b1[2][0];
  EXPECT_GT(static_cast<double>(abs(Big(printed.b1[2][0]) / b1 - 1)), 0.1);
  EXPECT_LT(static_cast<double>(abs(Big(filter.measurement_vector(0.02f)(2)) * scale / b1 - 1)),
            2e-5);
}

template <int Order, int Extension>
void gain_is_c_times_b1() {
  constexpr int size = Order + Extension;
  for (const auto& [lambda, q] :
       {Setting{60, 0.1}, Setting{2, 3}, Setting{0, 0}, Setting{5, 0}, Setting{0, 1}}) {
    const auto filter = AlgebraicFilter<Order, double, Extension>::make(
                            {.observer_bandwidth = lambda, .frequency_shift = q, .input_gain = 1})
                            .value();
    const esokit::ContinuousAlgebraicGain<size, double> law(lambda, q);
    for (const double t : {1e-6, 1e-3, 0.02, 0.3, 2.0}) {
      const auto c = filter.output_matrix(t);
      const auto b1 = filter.measurement_vector(t);
      const auto gain = law.gain(t, 0.0);
      for (int i = 0; i < size; ++i) {
        double value = 0;
        double terms = 0;
        for (int j = 0; j < size; ++j) {
          value += c(i, j) * b1(j);
          terms += std::abs(c(i, j) * b1(j));
        }
        ASSERT_LE(std::abs(value - gain(i)), 1e-9 * gain(i) + 32 * epsilon * terms)
            << Order << ", " << Extension << ", lambda " << lambda << ", q " << q << ", t " << t
            << ", row " << i;
        // The bound says something: the terms do not cancel away.
        ASSERT_LT(32 * epsilon * terms, 1e-9 * gain(i));
      }
    }
  }
}

TEST(AlgebraicFilter, GainIsOutputTimesMeasurementVector) {
  gain_is_c_times_b1<1, 1>();
  gain_is_c_times_b1<2, 1>();
  gain_is_c_times_b1<3, 1>();
  gain_is_c_times_b1<2, 2>();
  gain_is_c_times_b1<1, 3>();
  gain_is_c_times_b1<4, 3>();
}

TEST(AlgebraicFilter, LimitsOfTheGain) {
  // q = lambda = 0, N = 3: 9/t, 36/t^2, 60/t^3.
  const auto least_squares = esokit::ContinuousAlgebraicGain<3, double>(0.0, 0.0).gain(0.5, 0.0);
  EXPECT_NEAR(least_squares(0), 18.0, 1e-13);
  EXPECT_NEAR(least_squares(1), 144.0, 1e-12);
  EXPECT_NEAR(least_squares(2), 480.0, 1e-12);
  // q -> 0 is continuous.
  const auto zero = esokit::ContinuousAlgebraicGain<4, double>(3.0, 0.0).gain(0.2, 0.0);
  const auto tiny = esokit::ContinuousAlgebraicGain<4, double>(3.0, 1e-14).gain(0.2, 0.0);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(tiny(i) / zero(i), 1.0, 1e-12);
  // t -> infinity: the linear ESO.
  const auto late = esokit::ContinuousAlgebraicGain<3, double>(6.0, 0.5).gain(100.0, 0.0);
  const auto linear = esokit::continuous_gain<3, double>(6.0);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(late(i) / linear(i), 1.0, 1e-14);
}

/// y, u and the truth of a plant y^(n) = d + b0 u with a smooth d.
template <int Order, int Extension>
struct Motion {
  static constexpr int size = Order + Extension;
  static constexpr double b0 = 2.0;
  static double input(double t) { return std::cos(3 * t); }
  /// y^(i): y = 0.4 + sin(1.3 t).
  static double output(double t, int i = 0) {
    return (i == 0 ? 0.4 : 0.0) + std::pow(1.3, i) * std::sin(1.3 * t + i * std::acos(0.0));
  }
};

/// Both forms from the same moment on give the same estimates: the chain starts at what the filter
/// shows at t0.
template <int Order, int Extension>
void filter_and_chain_agree(double lambda, double q) {
  using Signals = Motion<Order, Extension>;
  const auto filter =
      AlgebraicFilter<Order, double, Extension>::make(
          {.observer_bandwidth = lambda, .frequency_shift = q, .input_gain = Signals::b0})
          .value();
  const auto chain =
      esokit::ContinuousAlgebraicEso<Order, double, Extension>::make(
          {.observer_bandwidth = lambda, .frequency_shift = q, .input_gain = Signals::b0})
          .value();
  using State = typename AlgebraicFilter<Order, double, Extension>::State;
  const auto step = [](const auto& rate, double t, const State& x, double h) -> State {
    const State k1 = rate(t, x);
    const State k2 = rate(t + h / 2, x + h / 2 * k1);
    const State k3 = rate(t + h / 2, x + h / 2 * k2);
    const State k4 = rate(t + h, x + h * k3);
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  };
  const auto filter_rate = [&](double t, const State& x) -> State {
    return filter.derivative(t, x, Signals::output(t), Signals::input(t));
  };
  const auto chain_rate = [&](double t, const State& z) -> State {
    return chain.derivative(t, z, Signals::output(t), Signals::input(t));
  };
  State x = State::Zero();
  constexpr double h = 1.0 / 4096;
  constexpr int start = 1024;
  for (int k = 0; k < start; ++k) x = step(filter_rate, k * h, x, h);
  State z = filter.estimate(start * h, x);
  for (int k = start; k < 4 * start; ++k) {
    x = step(filter_rate, k * h, x, h);
    z = step(chain_rate, k * h, z, h);
    if (k % 512 != 0) continue;
    const State shown = filter.estimate((k + 1) * h, x);
    const double rate = lambda + Signals::size / ((k + 1) * h);
    for (int i = 0; i < Signals::size; ++i) {
      // RK4 of the chain with mu h about 1e-2.
      EXPECT_NEAR(shown(i), z(i), 1e-6 * std::pow(rate, i))
          << Order << ", " << Extension << ", row " << i << ", t " << (k + 1) * h;
    }
  }
}

TEST(AlgebraicFilter, AgreesWithTheChain) {
  filter_and_chain_agree<2, 1>(5, 0.1);
  filter_and_chain_agree<2, 1>(5, 0);
  filter_and_chain_agree<1, 1>(3, 2);
  filter_and_chain_agree<2, 2>(6, 0.1);
  filter_and_chain_agree<1, 3>(6, 1);
}

/// Exact from the first moment for a disturbance of degree < m, whatever the initial state; the
/// integration of smooth inputs by RK4 is what is left.
template <int Order, int Extension>
void exact_on_its_own_model_class() {
  constexpr int size = Order + Extension;
  constexpr double b0 = 2.0;
  const auto filter = AlgebraicFilter<Order, double, Extension>::make(
                          {.observer_bandwidth = 3, .frequency_shift = 0.1, .input_gain = b0})
                          .value();
  using State = typename AlgebraicFilter<Order, double, Extension>::State;
  // Coefficients z_i(0) of the motion without input; the input is 1 throughout.
  const auto truth = [&](double t) -> State {
    State z;
    for (int i = 0; i < size; ++i) {
      double sum = 0;
      double power = 1;
      for (int j = i; j < size; ++j) {
        sum += (j % 2 == 0 ? 1.0 : -0.7) * (1 + j) * power;
        power *= t / (j - i + 1);
      }
      if (i < Order) {
        double gamma = b0;
        for (int j = 1; j <= Order - i; ++j) gamma *= t / j;
        sum += gamma;
      }
      z(i) = sum;
    }
    return z;
  };
  State x = State::Zero();
  constexpr double h = 1e-3;
  for (int k = 0; k < 1000; ++k) {
    const double t = k * h;
    const auto rate = [&](double s, const State& state) -> State {
      return filter.derivative(s, state, truth(s)(0), 1.0);
    };
    const State k1 = rate(t, x);
    const State k2 = rate(t + h / 2, x + h / 2 * k1);
    const State k3 = rate(t + h / 2, x + h / 2 * k2);
    const State k4 = rate(t + h, x + h * k3);
    x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    if (k + 1 != 300 && k + 1 != 1000) continue;
    const State shown = filter.estimate(t + h, x);
    const State z = truth(t + h);
    for (int i = 0; i < size; ++i) {
      EXPECT_NEAR(shown(i), z(i), 1e-5 * (1 + std::abs(z(i))))
          << Order << ", " << Extension << ", row " << i << ", t " << t + h;
    }
  }
}

TEST(AlgebraicFilter, IsExactOnItsOwnModelClass) {
  exact_on_its_own_model_class<1, 1>();
  exact_on_its_own_model_class<2, 1>();
  exact_on_its_own_model_class<3, 1>();
  exact_on_its_own_model_class<2, 2>();
  exact_on_its_own_model_class<1, 3>();
}

TEST(AlgebraicFilter, DerivativeIsThatOfItsMatrices) {
  const auto filter = AlgebraicFilter<2, double, 2>::make(
                          {.observer_bandwidth = 4, .frequency_shift = 0.3, .input_gain = -1.5})
                          .value();
  const esokit::EigenMatrix<double, 4> x(0.3, -0.2, 0.7, 1.1);
  for (const double t : {0.0, 0.4, 2.0}) {
    const esokit::EigenMatrix<double, 4> expected = filter.state_matrix() * x +
                                                    filter.measurement_vector(t) * 0.6 +
                                                    filter.input_vector(t) * -0.9;
    const auto rate = filter.derivative(t, x, 0.6, -0.9);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(rate(i), expected(i), 1e-14);
    if (t == 0.0) continue;
    const esokit::EigenMatrix<double, 4> shown = filter.output_matrix(t) * x;
    const auto estimate = filter.estimate(t, x);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(estimate(i), shown(i), 1e-12 * std::abs(shown(i)));
  }
}

TEST(AlgebraicFilter, RefusesBadConfigByName) {
  using Config = AlgebraicFilter<2>::Config;
  const double nan = hidden_nan<double>();
  const double infinity = hidden_infinity<double>();
  const std::pair<Config, const char*> bad[] = {
      {{.observer_bandwidth = -1, .frequency_shift = 1, .input_gain = 1},
       "observer_bandwidth: must be finite and not negative"},
      {{.observer_bandwidth = nan, .frequency_shift = 1, .input_gain = 1},
       "observer_bandwidth: must be finite and not negative"},
      {{.observer_bandwidth = infinity, .frequency_shift = 1, .input_gain = 1},
       "observer_bandwidth: must be finite and not negative"},
      {{.observer_bandwidth = 1, .frequency_shift = -1, .input_gain = 1},
       "frequency_shift: must be finite and not negative"},
      {{.observer_bandwidth = 1, .frequency_shift = nan, .input_gain = 1},
       "frequency_shift: must be finite and not negative"},
      {{.observer_bandwidth = 1, .frequency_shift = 1, .input_gain = 0},
       "input_gain: must be finite and not zero (negative is fine)"},
      {{.observer_bandwidth = 1, .frequency_shift = 1, .input_gain = infinity},
       "input_gain: must be finite and not zero (negative is fine)"},
  };
  for (const auto& [config, expected] : bad) {
    const auto filter = AlgebraicFilter<2>::make(config);
    EXPECT_EQ(refusal(filter), expected);
    const auto chain =
        esokit::ContinuousAlgebraicEso<2>::make({.observer_bandwidth = config.observer_bandwidth,
                                                 .frequency_shift = config.frequency_shift,
                                                 .input_gain = config.input_gain});
    EXPECT_EQ(refusal(chain), expected);
  }
}

}  // namespace examples_algebraic_filter_test
}  // namespace esokit_test
