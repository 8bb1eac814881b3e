/// @file
/// Han's nonlinear state error feedback.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/fal.hpp>
#include <utility>

namespace esokit {

/// u = (sum_i k_i fal(r_i - z_i, a_i, delta_i) - dhat) / b0: like AdrcLaw, with fal in place of
/// linear feedback. A function of the estimate, without state.
///
/// For finite arguments u is finite: a result that overflows, such as a power of a large error, is
/// replaced by the largest number of its sign. For limits add a Limiter.
/// @tparam Order n
template <int Order, class S = double>
requires(detail::is_a_scalar<S>()) class NonlinearFeedback {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    Array<S, Order> gains = filled(S(1.0));          ///< k_i >= 0, i = 0 .. n - 1
    Array<S, Order> exponents = filled(S(1.0));      ///< a_i > 0; 1 is linear
    Array<S, Order> linear_widths = filled(S(1.0));  ///< delta_i > 0, unit of y^(i)
    S input_gain{};  ///< b0 of the plant; not zero, negative is fine
  };
  using scalar_type = S;  ///< type of signals and settings
  template <class T>
  using with_scalar = NonlinearFeedback<Order, T>;  ///< the same with another scalar

  /// Checks the settings and does all the design work.
  /// @return the law, or an error that names the field
  static Expected<NonlinearFeedback, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    Rules<S> rules;
    for (int i = 0; i < Order; ++i) {
      const auto row = static_cast<std::size_t>(i);
      rules.not_negative("gains", config.gains[row], i)
          .positive("exponents", config.exponents[row], i)
          .positive("linear_widths", config.linear_widths[row], i);
    }
    if (!rules.invertible("input_gain", config.input_gain)) return rules.error();
    const NonlinearFeedback law(config, std::make_integer_sequence<int, Order>{});
    for (int i = 0; i < Order; ++i) {
      const auto row = static_cast<std::size_t>(i);
      // The largest slope for a_i <= 1, that of the linear part.
      const S slope = law.fal_[row].gain(S(0.0));
      rules.demand(
          all(is_finite(slope)) &&
              all(is_finite(S(config.gains[row] * slope * law.inverse_input_gain_))),
          "linear_widths", config.linear_widths[row],
          "with this exponent, gain and input_gain gives a slope that the scalar cannot hold", i);
    }
    if (!rules) return rules.error();
    return law;
  }

  /// v = sum_i k_i fal(r_i - z_i), unit of y^(n).
  /// @param given (y, .., y^(n-1), ..), at least n x 1
  /// @param reference (r, .., r^(n-1)), n x 1, for example from a TrackingDifferentiator
  template <detail::VectorOf<S> Estimate>
  [[nodiscard]] S feedback(const Estimate& given,
                           const Vector<S, Order>& reference) const noexcept {
    constexpr int Size = detail::vector_size<Estimate>;
    const Vector<S, Size>& estimate = given;
    static_assert(Size >= Order, "esokit: the estimate must hold the plant states");
    S v(0.0);
    for (int i = 0; i < Order; ++i) {
      const auto row = static_cast<std::size_t>(i);
      const S& r = reference(i);
      const S& z = estimate(i);
      const S error = bounded<2>(S(r - z), {r, z});
      const S power = bounded<1>(fal_[row](error), {error});
      v = bounded<2>(S(v + bounded<1>(S(gains_[row] * power), {power})), {v, power});
    }
    return v;
  }

  /// u = (v - dhat) / b0.
  /// @param given (y, .., y^(n-1), d, ..) of an observer with input gain b0
  /// @param reference (r, .., r^(n-1)), n x 1
  template <detail::VectorOf<S> Estimate>
  [[nodiscard]] S control(const Estimate& given, const Vector<S, Order>& reference) const noexcept {
    constexpr int Size = detail::vector_size<Estimate>;
    const Vector<S, Size>& estimate = given;
    static_assert(Size > Order, "esokit: the estimate must hold the disturbance");
    const S v = feedback(estimate, reference);
    const S& d = estimate(Order);
    const S wanted = bounded<2>(S(v - d), {v, d});
    return bounded<1>(S(wanted * inverse_input_gain_), {wanted});
  }

  /// b0, as it was given.
  [[nodiscard]] const S& input_gain() const noexcept { return input_gain_; }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 4;

  static constexpr Array<S, Order> filled(const S& value) {
    Array<S, Order> result{};
    for (S& x : result) x = value;
    return result;
  }

  /// x limited to the range of the scalar, but not finite if an element of `from` is not.
  template <int Count>
  static S bounded(const S& x, const Array<S, Count>& from) noexcept {
    S good = detail::clipped(x);
    for (const S& number : from) good = select(is_finite(number), good, x);
    return good;
  }

  template <int... Index>
  NonlinearFeedback(const Config& config, std::integer_sequence<int, Index...>)
      : gains_(config.gains),
        fal_{Fal<S>(std::get<Index>(config.exponents), std::get<Index>(config.linear_widths))...},
        inverse_input_gain_(S(1.0) / config.input_gain),
        input_gain_(config.input_gain) {}

  Array<S, Order> gains_;
  Array<Fal<S>, Order> fal_;
  S inverse_input_gain_;
  S input_gain_;
};

}  // namespace esokit
