// The observers on scalars that are no numbers of the machine: a dual number, and one of three
// bytes. Packs: pack_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/gain/switched_gain.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <support/dual.hpp>
#include <support/numbers.hpp>

namespace observer_archetype_scalars_test {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::Dual;
using esokit_test::hidden_nan;

/// An estimate after a run, as a function of one setting.
template <class S>
struct Settings {
  S bandwidth{40.0};
  S input_gain{2.0};
  S sample_time{0.01};
};

template <class S>
S linear_outcome(const Settings<S>& s) {
  auto eso = LinearEso<2, S>::make({.observer_bandwidth = s.bandwidth,
                                    .input_gain = s.input_gain,
                                    .sample_time = s.sample_time})
                 .value();
  const auto law =
      esokit::AdrcLaw<2, S>::make({.controller_bandwidth = S(3.0), .input_gain = s.input_gain})
          .value();
  S u(0.0);
  for (int k = 0; k < 40; ++k) {
    if (k % 6 == 4) {
      eso.predict(u);
    } else {
      eso.update(S(std::sin(0.1 * k)), u);
    }
    u = law.control(eso.estimate(), S(1.0));
  }
  return u;
}

template <class S>
S cascade_outcome(const Settings<S>& s) {
  auto eso = CascadeEso<1, 2, S, 2>::make({.observer_bandwidth = s.bandwidth,
                                           .bandwidth_factor = S(2.0),
                                           .input_gain = s.input_gain,
                                           .sample_time = s.sample_time})
                 .value();
  for (int k = 0; k < 30; ++k) eso.update(S(std::cos(0.2 * k)), S(0.3 * k));
  return eso.total_disturbance();
}

/// Central difference of step h: error h^2, rounding eps / h.
template <class F>
void expect_derivative(F&& outcome) {
  const auto check = [&](double Settings<double>::*plain, Dual Settings<Dual>::*dual) {
    Settings<Dual> seeded;
    (seeded.*dual).derivative = 1;
    const Dual exact = outcome(seeded);
    Settings<double> settings;
    const double h = 1e-5 * settings.*plain;
    settings.*plain += h;
    const double high = outcome(settings);
    settings.*plain -= 2 * h;
    const double low = outcome(settings);
    EXPECT_NEAR(exact.derivative / ((high - low) / (2 * h)), 1, 1e-6);
    EXPECT_DOUBLE_EQ(exact.value, outcome(Settings<double>{}));
    EXPECT_NE(exact.derivative, 0);
  };
  check(&Settings<double>::bandwidth, &Settings<Dual>::bandwidth);
  check(&Settings<double>::input_gain, &Settings<Dual>::input_gain);
  check(&Settings<double>::sample_time, &Settings<Dual>::sample_time);
}

TEST(Dual, DerivativeOfALinearEsoAndItsController) {
  expect_derivative([](const auto& settings) { return linear_outcome(settings); });
}

TEST(Dual, DerivativeOfACascade) {
  expect_derivative([](const auto& settings) { return cascade_outcome(settings); });
}

/// An infinite derivative is as bad as an infinite value.
TEST(Dual, BadDerivativeIsABadMeasurement) {
  auto eso = LinearEso<1, Dual>::make(
                 {.observer_bandwidth = Dual(10), .input_gain = Dual(1), .sample_time = Dual(0.1)})
                 .value();
  eso.update(Dual(1), Dual(0));
  EXPECT_EQ(eso.update(Dual(1, hidden_nan<double>()), Dual(0)), StepStatus::measurement_rejected);
  EXPECT_TRUE(std::isfinite(eso.estimate()(1).derivative));
}

/// Of no other size and without alignment: no flag or count hides in the padding beside it.
struct ThreeBytes {
  unsigned char bytes[3];
  ThreeBytes() = default;
  explicit ThreeBytes(double);
  friend ThreeBytes operator+(const ThreeBytes&, const ThreeBytes&);
  friend ThreeBytes operator-(const ThreeBytes&, const ThreeBytes&);
  friend ThreeBytes operator*(const ThreeBytes&, const ThreeBytes&);
  friend ThreeBytes operator/(const ThreeBytes&, const ThreeBytes&);
  friend ThreeBytes operator-(const ThreeBytes&);
  friend bool operator<(const ThreeBytes&, const ThreeBytes&);
  friend bool operator>(const ThreeBytes&, const ThreeBytes&);
  friend bool operator<=(const ThreeBytes&, const ThreeBytes&);
  friend bool operator>=(const ThreeBytes&, const ThreeBytes&);
  friend bool is_finite(const ThreeBytes&);
  friend ThreeBytes select(bool, const ThreeBytes&, const ThreeBytes&);
};
static_assert(sizeof(ThreeBytes) == 3 && alignof(ThreeBytes) == 1);
static_assert(esokit::Scalar<ThreeBytes>);

using esokit::detail::LaneAccess;

/// Bytes of the scalars in an object.
template <class T>
std::size_t scalars_in(const T& object) {
  if constexpr (std::is_same_v<T, ThreeBytes>) {
    return sizeof object;
  } else if constexpr (esokit::detail::HoldsElements<T>) {
    std::size_t sum = 0;
    for (decltype(object.size()) i = 0; i < object.size(); ++i) sum += scalars_in(object.data()[i]);
    return sum;
  } else if constexpr (std::is_empty_v<T>) {
    return 0;
  } else if constexpr (LaneAccess::has_members<T>) {
    return LaneAccess::with_members(
        object, [](const auto&... member) { return (scalars_in(member) + ...); });
  } else {
    return 0;
  }
}
template <class T>
void expect_numbers_only(const T& object = esokit::detail::blank<T>()) {
  EXPECT_EQ(scalars_in(object), sizeof(T));
}

/// What a good sample of an observer writes.
template <class Observer>
void expect_that_samples_write_numbers() {
  const auto observer = esokit::detail::blank<Observer>();
  EXPECT_LT(scalars_in(observer), sizeof observer);  // it counts gaps
  LaneAccess::with_members(observer, [](const auto& numbers, const auto&...) {
    EXPECT_GE(scalars_in(numbers.kept), 3 * (Observer::levels * Observer::size + 2));
    expect_numbers_only(numbers.kept);
  });
}

TEST(ThreeBytes, AreAllThatASampleWrites) {
  using S = ThreeBytes;
  expect_that_samples_write_numbers<LinearEso<2, S>>();
  expect_that_samples_write_numbers<CascadeEso<2, 3, S>>();
  constexpr esokit::ModelParts parts{.order = 2, .plant_poles = true, .actuator = 1};
  expect_that_samples_write_numbers<esokit::ModelEso<parts, S>>();
  expect_that_samples_write_numbers<esokit::ModelCascadeEso<parts, 2, S>>();
}

TEST(ThreeBytes, AreAllThatModelsAndConstantLawsHold) {
  using S = ThreeBytes;
  expect_numbers_only<esokit::ChainModel<2, S, 2>>();
  expect_numbers_only<esokit::ConstantGain<3, S>>();
  expect_numbers_only<esokit::SwitchedGain<3, S>>();
  expect_numbers_only<esokit::AdrcLaw<2, S>>();
}

}  // namespace observer_archetype_scalars_test
