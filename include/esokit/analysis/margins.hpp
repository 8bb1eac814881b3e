/// @file
/// Stability margins of a loop: gain increase and decrease, phase, modulus; and the range of b0 /
/// b.
#pragma once

#include <esokit/analysis/detail/loop_scan.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/interval.hpp>
#include <limits>
#include <optional>

namespace esokit {

/// A margin, and the frequency at which the loop oscillates at this limit. Without a limit it is
/// infinite (for a factor below one: zero), and there is no frequency.
struct Margin {
  double value = std::numeric_limits<double>::infinity();       ///< unit of the margin
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< rad/s; NaN: no limit

  /// False if the loop stays stable for any change in this direction.
  [[nodiscard]] bool limited() const noexcept { return is_finite(frequency); }
};

/// The stability limits nearest to the nominal loop. All crossings are examined.
struct Margins {
  Margin gain_increase;  ///< smallest factor > 1 on L at which the loop oscillates; else infinity
  Margin gain_decrease;  ///< largest factor in (0, 1) on L at which it oscillates; else 0
  Margin phase;          ///< smallest phase shift, rad, as lag or lead; else infinity
  Margin modulus;        ///< smallest abs(1 + L), the inverse of the peak of S
};

namespace detail {

inline constexpr const char* unstable_loop_rule =
    "must be negative: the nominal loop is not stable, it has no margins";

/// Finds the minimum of a function while the frequency advances.
class LeastDistance {
 public:
  /// @param size the function @param value its value at w
  template <class Size>
  void operator()(const Size& size, double w, double value) {
    if (!least_ || value < least_->value) least_ = Margin{value, w};
    // The middle one of three is a local minimum: search between its neighbours.
    if (seen_ >= 2 && last_.value <= before_.value && last_.value <= value &&
        last_.value < 1.5 * least_->value) {
      const double place = golden_section(size, before_.frequency, w);
      const double there = size(place);
      if (there < least_->value) least_ = Margin{there, place};
    }
    before_ = last_;
    last_ = {value, w};
    ++seen_;
  }

  /// The next frequency does not follow the last one.
  void restart() noexcept { seen_ = 0; }

  [[nodiscard]] const std::optional<Margin>& found() const noexcept { return least_; }

 private:
  std::optional<Margin> least_;
  Margin before_{}, last_{};
  long seen_ = 0;
};

/// Finds the nearest stability limits while the frequency advances.
template <class Response>
class MarginFinder {
 public:
  explicit MarginFinder(const Response& response) : response_(response) {}

  /// First: frequency zero, where L is real; nothing if it is not finite.
  void at_zero(double l) {
    if (!is_finite(l)) return;
    real_axis(l, 0.0);
    modulus_(distance(), 0.0, (std::abs)(1.0 + l));
  }

  void operator()(double w1, std::complex<double> l1, double w2, std::complex<double> l2) {
    if (std::signbit(l1.imag()) != std::signbit(l2.imag()) &&
        (std::min)(l1.real(), l2.real()) < 0.0) {
      const double w = bisect([&](double x) { return response_(x).imag(); }, w1, w2);
      const std::complex<double> l = response_(w);
      // At a pole on the axis the imaginary part changes its sign at infinity.
      if ((std::abs)(l) < 10.0 * (std::max)((std::abs)(l1), (std::abs)(l2))) real_axis(l.real(), w);
    }
    if (((std::abs)(l1) < 1.0) != ((std::abs)(l2) < 1.0)) {
      const double w = bisect([&](double x) { return (std::abs)(response_(x)) - 1.0; }, w1, w2);
      const double shift = (std::abs)(std::arg(-response_(w)));
      if (!phase_ || shift < phase_->value) phase_ = Margin{shift, w};
    }
    if (!modulus_.found()) modulus_(distance(), w1, (std::abs)(1.0 + l1));
    modulus_(distance(), w2, (std::abs)(1.0 + l2));
  }

  /// Evaluates a point at which L crosses or touches the real axis.
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
            phase_.value_or(Margin{}), modulus_.found().value_or(Margin{})};
  }

 private:
  [[nodiscard]] auto distance() const {
    return [this](double w) { return (std::abs)(1.0 + response_(w)); };
  }

  const Response& response_;
  std::optional<Margin> increase_, decrease_, phase_;
  LeastDistance modulus_;
};

}  // namespace detail

/// Margins of a loop at one actuator, sampled or continuous; the other channels stay closed.
///
/// Gain and phase change in L = -P C, that is in the plant, the actuator or anywhere else in the
/// loop, but the controller still gets its own u. A phase shift multiplies positive frequencies by
/// e^(-i phi).
/// @param channel 0 .. q - 1
/// @return error for a nominal loop that is not stable, or if there is no such channel
Expected<Margins, Error<double>> margins(const Loop& loop, int channel = 0);

/// The margins of the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<Margins, Error<double>> margins(const LinearPlant<States, S, Inputs, Outputs>& plant,
                                         const Controller& controller, int channel = 0) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return margins(*loop, channel);
}

/// Range of b0 for which the loop with this plant is stable while the rest of the design stays the
/// same; an end is infinite if there is no limit.
///
/// The loop gain depends only on b / b0, where b is the plant's. Divided by b this is the range of
/// b0 / b; the gain of the plant may be multiplied by b0 / upper .. b0 / lower.
/// @return error for a nominal loop that is not stable, and a controller whose u is not
///         proportional to 1 / b0 (a compensator, several channels)
Expected<Interval<>, Error<double>> input_gain_range(const Loop& loop);

/// The same for the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, class Controller>
Expected<Interval<>, Error<double>> input_gain_range(const LinearPlant<States, S>& plant,
                                                     const Controller& controller) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return input_gain_range(*loop);
}

/// The factor f > 1 such that the loop is stable while the loop gain at this actuator (and so b /
/// b0) varies arbitrarily between samples, from 1/f to f times its nominal value. By the circle
/// criterion that is f + 1/f < (1 + abs(L)^2) / -Re L at all frequencies. The bound is sufficient,
/// not necessary. Lag, delay and sensor are included if they are part of the plant.
/// @return the factor and the frequency that limits it; infinity if Re L is never negative; error
/// for a nominal loop that is not stable, or if there is no such channel
Expected<Margin, Error<double>> gain_variation(const Loop& loop, int channel = 0);

/// The same for the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<Margin, Error<double>> gain_variation(const LinearPlant<States, S, Inputs, Outputs>& plant,
                                               const Controller& controller, int channel = 0) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return gain_variation(*loop, channel);
}

/// Largest singular value of the sensitivity over all frequencies, and its frequency: the largest
/// amplification of a disturbance at the outputs. For one channel it is the inverse of the modulus
/// margin. See Loop::largest_sensitivity.
/// @return error for a loop that is not stable
Expected<Margin, Error<double>> sensitivity_peak(const Loop& loop);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/margins.ipp>
#endif
