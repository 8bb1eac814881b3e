/// @file
/// The laws that every observer must obey, written once (law_suite.cpp). A translation unit runs
/// them for its types: `register_laws<ObserverLaws>("Name", TypeList<..>{})`.
/// `ObserverTraits` says which laws do not apply to a type; those are skipped with the reason.
///
/// Scaled quantities are in Nordsieck scaling, x_r = T^r z_r / r!, as in the library, but computed
/// here from the physical estimates.
#pragma once

#include <gtest/gtest.h>

#include <complex>
#include <cstddef>
#include <functional>
#include <limits>
#include <support/any_observer.hpp>
#include <support/law_registration.hpp>
#include <support/numbers.hpp>
#include <support/observer_traits.hpp>
#include <vector>

// The laws compute references in long double on purpose; the library is still checked.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace esokit_test {

using esokit::StepStatus;

/// What the laws set of a config; the traits of the observer make the rest of it.
struct Settings {
  double omega, sample_time, input_gain;  // rad/s, s, unit of y^(n) per unit of u
  int max_gap = 100;
};

/// The continuous form of an observer as an ODE.
struct ContinuousForm {
  using State = std::vector<double>;
  std::function<State(double t, const State& z, double y, double u)> derivative;
  State (*state_at)(const State& estimate);
  State (*estimate)(const State& z);
};

/// What the laws know of a type of observer.
struct ObserverKind {
  int order, size, levels;          // n, N, p
  Real epsilon, smallest, largest;  // of its scalar
  const char* field;                // see ObserverTraits, as what follows
  double slowest, fastest;
  std::vector<int> degree;  // of each row
  std::vector<bool> is_output;
  const char* (*excuse)(Law);
  Made (*make)(const Settings&);
  std::string (*retune)(AnyObserver&, const Settings&);  // "accepted", or what was refused
  // Null where an excuse says why it is not there.
  std::vector<std::vector<std::complex<Real>>> (*level_poles)(const Settings&) = nullptr;
  double (*unknown_amplitude)(const Settings&, double nu) = nullptr;
  ContinuousForm (*continuous)(const Settings&) = nullptr;
  const ObserverKind* in_double = nullptr;
};

template <class Observer>
struct KindOf {
  using S = typename Observer::scalar_type;
  using Traits = ObserverTraits<Observer>;
  using Config = typename Observer::Config;

  static Config config(const Settings& of) {
    return Traits::config(of.omega, of.sample_time, of.input_gain, of.max_gap);
  }
  static Made make(const Settings& settings) { return Made(Observer::make(config(settings))); }
  static std::string retune(AnyObserver& observer, const Settings& settings) {
    return refusal(observer.as<Observer>().retune(config(settings)));
  }

  /// Between the vectors of the laws and those of a continuous observer.
  template <class Column>
  static Column column(const std::vector<double>& x) {
    Column result;
    for (std::size_t i = 0; i < x.size(); ++i) result(static_cast<int>(i)) = x[i];
    return result;
  }
  template <class Column>
  static std::vector<double> numbers(const Column& x) {
    return {x.begin(), x.end()};
  }
  static ContinuousForm continuous(const Settings& of) {
    using Form = typename Traits::Continuous;
    using State = typename Form::State;
    using Numbers = std::vector<double>;
    const auto form = Form::make(Traits::continuous_config(of.omega, of.input_gain)).value();
    return {[form](double t, const Numbers& z, double y, double u) {
              return numbers(form.derivative(t, column<State>(z), y, u));
            },
            [](const Numbers& estimate) {
              return numbers(Form::state_at(column<typename Form::Estimate>(estimate)));
            },
            [](const Numbers& z) { return numbers(Form::estimate(column<State>(z))); }};
  }

  static ObserverKind kind() {
    ObserverKind of{.order = Observer::order,
                    .size = Observer::size,
                    .levels = Observer::levels,
                    .epsilon = std::numeric_limits<S>::epsilon(),
                    .smallest = (std::numeric_limits<S>::min)(),
                    .largest = (std::numeric_limits<S>::max)(),
                    .field = Traits::field,
                    .slowest = Traits::slowest,
                    .fastest = Traits::fastest,
                    .degree = {},
                    .is_output = std::vector<bool>(Observer::size),
                    .excuse = &Traits::excuse,
                    .make = &make,
                    .retune = &retune};
    for (int r = 0; r < Observer::size; ++r) {
      of.degree.push_back(r);
      if constexpr (requires { Traits::degree(r); }) of.degree.back() = Traits::degree(r);
      if constexpr (requires { Traits::is_output(r); }) {
        of.is_output[static_cast<std::size_t>(r)] = Traits::is_output(r);
      }
    }
    if constexpr (requires(Config c) { Traits::level_poles(c); }) {
      of.level_poles = [](const Settings& s) { return Traits::level_poles(config(s)); };
    }
    if constexpr (requires(Config c) { Traits::unknown_amplitude(c, 1.0); }) {
      of.unknown_amplitude = [](const Settings& s, double nu) {
        return Traits::unknown_amplitude(config(s), nu);
      };
    }
    if constexpr (Traits::excuse(Law::order_of_accuracy) == nullptr) of.continuous = &continuous;
    if constexpr (Traits::excuse(Law::float_agrees_with_double) == nullptr) {
      using Wide = typename Traits::template Rebind<double>;
      static const ObserverKind wide = KindOf<Wide>::kind();
      of.in_double = &wide;
    }
    return of;
  }
};

template <class Observer>
const ObserverKind& kind_of() {
  static const ObserverKind kind = KindOf<Observer>::kind();
  return kind;
}

/// Every observable of two observers is the same, bit for bit.
::testing::AssertionResult same_observer(const AnyObserver& a, const AnyObserver& b);

/// The laws of one type, and what it takes to write more of them.
struct LawSuite {
  static constexpr double period = 0.01;    ///< T, s
  static constexpr double gain = 2;         ///< b0, a power of two: u = -d / b0 is exact
  static constexpr double bridging = 0.02;  ///< omega_o T at which all types bridge some gaps

  const ObserverKind& kind;
  int n = kind.order;
  int N = kind.size;
  int p = kind.levels;
  Real epsilon = kind.epsilon;
  bool in_float = kind.epsilon == std::numeric_limits<float>::epsilon();

  [[nodiscard]] AnyObserver make(const Settings& settings) const;
  [[nodiscard]] AnyObserver make(double omega_t, double b0 = gain, int max_gap = 100) const;
  /// Rounded to the scalar.
  [[nodiscard]] Real s(Real x) const;
  /// An input whose effect over a sample is `x` in scaled units, so that u weighs as much as y.
  [[nodiscard]] Real input(double x) const;
  /// A run of measurements and inputs, and the observer in its middle.
  [[nodiscard]] AnyObserver warm(double omega_t = 0.5, double b0 = gain) const;
  /// By what estimate r is scaled; a model may have rows that are no derivatives of y.
  [[nodiscard]] Real row_unit(int r, Real sample_time = period) const;
  /// A state of which each row is `of(r)` in scaled units.
  template <class F>
  [[nodiscard]] std::vector<Real> state(F&& of, Real sample_time = period) const {
    std::vector<Real> result;
    for (int r = 0; r < N; ++r) result.push_back(Real(of(r)) / row_unit(r, sample_time));
    return result;
  }
  /// 1 in row `of` in scaled units, else 0.
  [[nodiscard]] std::vector<Real> unit_state(int of) const;
  /// What a rounding error in x_`from` at every step can do to estimate `to` in physical units: the
  /// sum of its response to that one error, as the observer itself computes it. A level of a
  /// cascade makes errors of its own.
  [[nodiscard]] Real rounding_gain(double omega_t, int from, int to) const;
  /// Roundings of a step: N terms of the prediction, the innovation, its product with the gain, the
  /// sum with the state, and the measurement before it came.
  [[nodiscard]] Real roundings() const { return (N + 4) * epsilon; }
  /// Samples after which an initial error is below rounding. The error falls like
  /// C(k, Np) rho^k; its logarithm is at most 6 Np above -k omega T before it is lost.
  [[nodiscard]] int settling_samples(double omega_t) const;

  [[nodiscard]] std::vector<NamedLaw> laws() const;
};

/// The suite for `register_laws`.
template <class Observer>
struct ObserverLaws {
  static std::vector<NamedLaw> laws() { return LawSuite{kind_of<Observer>()}.laws(); }
};

}  // namespace esokit_test

#pragma GCC diagnostic pop
