/// @file
/// Stability margins of a loop: gain both ways, phase, modulus; and the range of b0 / b.
#pragma once

#include <esokit/analysis/loop_scan.hpp>
#include <esokit/core/interval.hpp>
#include <limits>
#include <optional>

namespace esokit {

/// A margin and where the loop then oscillates. Without a limit it is infinite (a factor below one:
/// zero), and there is no frequency.
struct Margin {
  double value = std::numeric_limits<double>::infinity();  ///< in the unit of what is asked for
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< rad/s; NaN: no limit

  /// False: however far one goes in this direction, the loop stays stable.
  [[nodiscard]] bool limited() const noexcept { return is_finite(frequency); }
};

/// The edges of stability that are nearest to the loop as it is. Any number of crossings is looked
/// at.
struct Margins {
  Margin gain_increase;  ///< least factor > 1 on L that makes the loop oscillate; else infinity
  Margin gain_decrease;  ///< greatest factor in (0, 1) on L that does; else 0
  Margin phase;          ///< least phase shift, rad, as lag or as lead; else infinity
  Margin modulus;        ///< least abs(1 + L), the inverse of the peak of S
};

namespace detail {

inline constexpr const char* unstable_loop_rule =
    "must be negative: the nominal loop is not stable, it has no margins";

/// Keeps the nearest edges while the loop gain is walked along.
template <class Response>
class MarginFinder {
 public:
  explicit MarginFinder(const Response& response) : response_(response) {}

  void operator()(double w1, std::complex<double> l1, double w2, std::complex<double> l2) {
    if (std::signbit(l1.imag()) != std::signbit(l2.imag()) &&
        std::min(l1.real(), l2.real()) < 0.0) {
      const double w = bisect([&](double x) { return response_(x).imag(); }, w1, w2);
      const std::complex<double> l = response_(w);
      // Across a pole on the axis the imaginary part changes its sign at infinity.
      if (std::abs(l) < 10.0 * std::max(std::abs(l1), std::abs(l2))) real_axis(l.real(), w);
    }
    if ((std::abs(l1) < 1.0) != (std::abs(l2) < 1.0)) {
      const double w = bisect([&](double x) { return std::abs(response_(x)) - 1.0; }, w1, w2);
      const double shift = std::abs(std::arg(-response_(w)));
      if (!phase_ || shift < phase_->value) phase_ = Margin{shift, w};
    }
    if (!modulus_) distance(w1, std::abs(1.0 + l1));
    distance(w2, std::abs(1.0 + l2));
  }

  /// A place where L crosses or touches the real axis.
  void real_axis(double l, double w) {
    if (!(l < 0.0)) return;
    const double factor = -1.0 / l;
    if (factor > 1.0 && (!increase_ || factor < increase_->value)) increase_ = Margin{factor, w};
    if (factor <= 1.0 && (!decrease_ || factor > decrease_->value)) decrease_ = Margin{factor, w};
  }

  [[nodiscard]] Margins margins() const {
    Margin no_decrease;
    no_decrease.value = 0.0;
    return {increase_.value_or(Margin{}), decrease_.value_or(no_decrease),
            phase_.value_or(Margin{}), modulus_.value_or(Margin{})};
  }

 private:
  void distance(double w, double value) {
    if (!modulus_ || value < modulus_->value) modulus_ = Margin{value, w};
    // The middle one of three is a local least: look between its neighbours.
    if (seen_ >= 2 && last_.value <= before_.value && last_.value <= value &&
        last_.value < 1.5 * modulus_->value) {
      const auto size = [&](double x) { return std::abs(1.0 + response_(x)); };
      const double least = golden_section(size, before_.frequency, w);
      const double there = size(least);
      if (there < modulus_->value) modulus_ = Margin{there, least};
    }
    before_ = last_;
    last_ = {value, w};
    ++seen_;
  }

  const Response& response_;
  std::optional<Margin> increase_, decrease_, phase_, modulus_;
  Margin before_{}, last_{};
  long seen_ = 0;
};

}  // namespace detail

/// Margins of a loop, sampled or continuous.
///
/// Gain and phase are changed in L = -P C: in the plant's gain, the actuator's, or anywhere else in
/// the loop but between law and observer. A phase shift turns positive frequencies by e^(-i phi).
/// @return error for a nominal loop that is not stable
template <int PlantStates, class Observer>
Expected<Margins, Error<double>> margins(const AdrcLoop<PlantStates, Observer>& loop) {
  if (!loop.stable()) {
    return Error<double>{"stability_abscissa", loop.stability_abscissa(),
                         detail::unstable_loop_rule};
  }
  const auto response = detail::loop_gain_of(loop);
  detail::MarginFinder finder(response);
  detail::scan(response, detail::scan_range(loop), finder);
  // L is real at z = -1; at standstill it is infinite, as every observer integrates.
  if (loop.plant().sampled()) {
    const double nyquist = std::numbers::pi / loop.plant().sample_time;
    const std::complex<double> l = response.at(-2.0);
    if (is_finite(l.real())) finder.real_axis(l.real(), nyquist);
  }
  return finder.margins();
}

/// Range of b0 / b for which the loop is stable: b0 as the controller has it, b as the plant does;
/// 0 and infinity where there is no limit.
///
/// The loop gain depends on the two by b / b0 alone, so it does not matter which of them is wrong.
/// @param law the one that the loop was made with
/// @param plant_gain b of the loop's nominal plant, the factor of u in y^(n)
/// @return error for a nominal loop that is not stable, or a b that is zero or has the other sign
template <int PlantStates, class Observer, Scalar S>
Expected<Interval<>, Error<double>> input_gain_range(const AdrcLoop<PlantStates, Observer>& loop,
                                                     const AdrcLaw<Observer::order, S>& law,
                                                     double plant_gain) {
  const auto ratio = static_cast<double>(law.input_gain()) / plant_gain;
  if (!is_finite(ratio) || !(ratio > 0.0)) {
    return Error<double>{"plant_gain", plant_gain, "must be finite, not zero, of the sign of b0"};
  }
  const auto found = margins(loop);
  if (!found) return found.error();
  return Interval<>{ratio / found->gain_increase.value, ratio / found->gain_decrease.value};
}

}  // namespace esokit
