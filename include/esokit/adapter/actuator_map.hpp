/// @file
/// ActuatorMap: the curve of an actuator, from u to its effect and back: a dead zone, two gains, a
/// square, a table.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <limits>

namespace esokit {

/// The points of an actuator's curve: rising straight lines between them, and one beyond the first
/// and the last. `ActuatorMap::make` checks it; without a point the effect is u.
///
/// The unit of an effect is free: b0 is y^(n) per unit of it. All makers but `from_table` keep that
/// of u.
/// @tparam Points most points of a curve
template <Scalar S = double, int Points = 9>
struct ActuatorCurve {
  static_assert(Points >= 3, "esokit: a dead zone has three points");

  Array<S, Points> input{};   ///< u of each point, rising
  Array<S, Points> effect{};  ///< its effect, rising
  int points = 0;             ///< how many of them there are, 0 .. Points
  S slope_below = S(1.0);     ///< below the first point, unit of effect per unit of u, above 0
  S slope_above = S(1.0);     ///< beyond the last one

  /// Nothing happens between -width and width, beyond them u acts less `width`.
  ///
  /// Its inverse would jump at zero, and noise with it: here an effect below `softness` is a line
  /// of the slope 1 + width / softness. So noise that asks for an effect e moves u by that times e,
  /// and never by more than 2 (width + softness). Give the largest width that there may be:
  /// a smaller dead zone leaves a chatter, a larger one is a dead zone again (examples/actuator).
  /// @param width above 0, unit of u @param softness above 0, unit of u
  static constexpr ActuatorCurve dead_zone(const S& width, const S& softness) noexcept {
    ActuatorCurve curve;
    curve.points = 3;
    curve.set(0, S(-width - softness), S(-softness));
    curve.set(2, S(width + softness), softness);
    return curve;
  }
  /// The same with a softness of width / 60.
  static constexpr ActuatorCurve dead_zone(const S& width) noexcept {
    return dead_zone(width, S(width / S(60.0)));
  }

  /// Two gains, as of a heater and a cooler: a u above zero counts `up` times, one below it `down`
  /// times.
  static constexpr ActuatorCurve two_gains(const S& up, const S& down) noexcept {
    ActuatorCurve curve;
    curve.points = 1;
    curve.slope_below = down;
    curve.slope_above = up;
    return curve;
  }

  /// The effect grows as the square of u, with its sign, and is u at `full` and -full: the thrust
  /// of a propeller over its speed. In lines from -full to full; beyond them the last one goes on.
  /// What is left of the curve is at most full / (4 k^2), with k = (Points - 1) / 2 lines a side.
  /// @param full above 0, unit of u
  static constexpr ActuatorCurve square(const S& full) noexcept {
    constexpr int lines = (Points - 1) / 2;
    ActuatorCurve curve;
    curve.points = 2 * lines + 1;
    for (int i = 1; i <= lines; ++i) {
      const S part = detail::integer<S>(i) / detail::integer<S>(lines);
      curve.set(lines + i, S(full * part), S(full * part * part));
      curve.set(lines - i, S(-(full * part)), S(-(full * part * part)));
    }
    curve.slope_below = curve.slope_above =
        detail::integer<S>(2 * lines - 1) / detail::integer<S>(lines);
    return curve;
  }

  /// Measured points. Beyond the first and the last the line beside them goes on.
  /// @param u rising @param effects rising, one for each u
  template <std::size_t Count>
  static constexpr ActuatorCurve from_table(const Array<S, Count>& u,
                                            const Array<S, Count>& effects) noexcept {
    static_assert(2 <= Count && Count <= static_cast<std::size_t>(Points),
                  "esokit: a table has two points up to as many as the curve can hold");
    ActuatorCurve curve;
    curve.points = static_cast<int>(Count);
    for (std::size_t i = 0; i < Count; ++i) curve.set(static_cast<int>(i), u[i], effects[i]);
    curve.slope_below = (effects[1] - effects[0]) / (u[1] - u[0]);
    curve.slope_above = (effects[Count - 1] - effects[Count - 2]) / (u[Count - 1] - u[Count - 2]);
    return curve;
  }

 private:
  constexpr void set(int i, const S& u, const S& its_effect) noexcept {
    input[static_cast<std::size_t>(i)] = u;
    effect[static_cast<std::size_t>(i)] = its_effect;
  }
};

/// The gain that is left between the effect asked for and the one that a real actuator gives.
template <Scalar S = double>
struct GainLeft {
  S least{};    ///< smallest slope
  S largest{};  ///< largest slope: so many times more gain the margins have to bear
};

/// An actuator's curve, in both directions: `effect(u)`, and `input(effect)`, the u that has it.
/// One is the inverse of the other to four digits of rounding. Bounded work, no state.
template <Scalar S = double, int Points = 9>
class ActuatorMap {
 public:
  using scalar_type = S;  ///< type of u
  template <class T>
  using with_scalar = ActuatorMap<T, Points>;  ///< the same with another scalar
  using Curve = ActuatorCurve<S, Points>;      ///< settings of make

  /// Checks the curve. @return the map, or an error that names the field and the point
  static Expected<ActuatorMap, Error<S>> make(const Curve& curve) {
    static_assert(detail::refuses_packs<S>());
    const int count = curve.points;
    Rules<S> rules;
    rules
        .demand(0 <= count && count <= Points,
                {"curve.points", static_cast<S>(count), "must be 0 up to", -1,
                 static_cast<S>(Points), true})
        .positive("curve.slope_below", curve.slope_below)
        .positive("curve.slope_above", curve.slope_above);
    if (!rules) return rules.error();
    for (int i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      rules.finite("curve.input", curve.input[at], i).finite("curve.effect", curve.effect[at], i);
      if (i == 0) continue;
      rules
          .demand(curve.input[at - 1] < curve.input[at],
                  {"curve.input", curve.input[at], "must be above the one before, which is", i,
                   curve.input[at - 1], true})
          .demand(curve.effect[at - 1] < curve.effect[at],
                  {"curve.effect", curve.effect[at], "must be above the one before, which is", i,
                   curve.effect[at - 1], true});
    }
    if (!rules) return rules.error();
    const ActuatorMap map(curve);
    for (int i = 0; i <= count; ++i) {
      const Line& line = map.lines_[static_cast<std::size_t>(i)];
      const S& named = i == count ? curve.slope_above
                       : i == 0   ? curve.slope_below
                                  : curve.effect[static_cast<std::size_t>(i)];
      rules.demand(
          detail::normal(line.slope) && detail::normal(line.inverse) && all(is_finite(line.offset)),
          i == count ? "curve.slope_above"
          : i == 0   ? "curve.slope_below"
                     : "curve.effect",
          named, "gives a slope that the scalar cannot hold", 0 < i && i < count ? i : -1);
    }
    if (!rules) return rules.error();
    return map;
  }

  /// The effect of u.
  [[nodiscard]] ESOKIT_INLINE constexpr S effect(const S& u) const noexcept {
    return turned(inputs_, effects_, u, [&](const Line& line) ESOKIT_INLINE_LAMBDA {
      return S(line.offset + u * line.slope);
    });
  }

  /// The u that has the effect.
  [[nodiscard]] ESOKIT_INLINE constexpr S input(const S& effect) const noexcept {
    return turned(effects_, inputs_, effect, [&](const Line& line) ESOKIT_INLINE_LAMBDA {
      return S((effect - line.offset) * line.inverse);
    });
  }

  /// Whether it has no point and a slope of 1, as a curve that was left out: the effect is u.
  [[nodiscard]] constexpr bool is_straight() const noexcept {
    return !(inputs_[0] < detail::unbounded<S>()) && lines_[0].slope == S(1.0);
  }

  /// The slopes of real.effect(input(e)) over e, for effects from `lower` to `upper`. Of what a
  /// table does not say of the actuator.
  [[nodiscard]] constexpr GainLeft<S> gain_left(const ActuatorMap& real, const S& lower,
                                                const S& upper) const noexcept {
    const S from = input(lower);
    const S to = input(upper);
    GainLeft<S> left{S(detail::unbounded<S>()), S(0)};
    for (int i = 0; i <= Points; ++i) {
      for (int j = 0; j <= Points; ++j) {
        const S begin = detail::upper_one(detail::upper_one(begin_of(i), real.begin_of(j)), from);
        const S end = detail::lower_one(detail::lower_one(end_of(i), real.end_of(j)), to);
        if (!(begin < end)) continue;
        const S slope = real.lines_[static_cast<std::size_t>(j)].slope *
                        lines_[static_cast<std::size_t>(i)].inverse;
        left = {detail::lower_one(left.least, slope), detail::upper_one(left.largest, slope)};
      }
    }
    return left;
  }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 3;

  /// A straight line, effect = offset + slope u. In this form both ways lose the same digits, and
  /// none near zero where the offset is zero.
  struct Line {
    S offset{};
    S slope = S(1.0);
    S inverse = S(1.0);
  };

  constexpr explicit ActuatorMap(const Curve& curve) noexcept {
    const auto count = static_cast<std::size_t>(curve.points);
    inputs_.fill(detail::unbounded<S>());
    effects_.fill(detail::unbounded<S>());
    for (std::size_t i = 0; i < count; ++i) {
      inputs_[i] = curve.input[i];
      effects_[i] = curve.effect[i];
    }
    for (std::size_t i = 0; i <= Points; ++i) {
      Line& line = lines_[i];
      if (i == 0 || i >= count) {
        line.slope = i >= count ? curve.slope_above : curve.slope_below;
        line.inverse = S(1) / line.slope;
      } else {
        const S du = curve.input[i] - curve.input[i - 1];
        const S de = curve.effect[i] - curve.effect[i - 1];
        line.slope = de / du;
        line.inverse = du / de;
      }
      if (count == 0) continue;
      std::size_t at = i < count ? i : count - 1;  // an end of it, that nearer to zero
      if (0 < i && i < count && inputs_[at] > detail::absolute(inputs_[at - 1])) --at;
      line.offset = effects_[at] - line.slope * inputs_[at];
    }
  }

  /// What `of` gives for the line on which x is, within its ends: so the lines meet, and both ways
  /// agree on which it is. A NaN is on the first.
  template <class Of>
  ESOKIT_INLINE constexpr S turned(const Array<S, Points>& from, const Array<S, Points>& to,
                                   const S& x, const Of& of) const noexcept {
    Line line = lines_[0];
    S low(-detail::unbounded<S>());
    S high = to[0];
    if constexpr (PlainScalar<S>) {
      std::size_t i = 0;
      while (i < Points && from[i] <= x) ++i;
      line = lines_[i];
      if (i > 0) low = to[i - 1];
      high = i < Points ? to[i] : detail::unbounded<S>();
    } else {
      for (std::size_t i = 0; i < Points; ++i) {
        const auto beyond = from[i] <= x;
        const Line& next = lines_[i + 1];
        line = {select(beyond, next.offset, line.offset), select(beyond, next.slope, line.slope),
                select(beyond, next.inverse, line.inverse)};
        low = select(beyond, to[i], low);
        high = select(beyond, i + 1 < Points ? to[i + 1] : S(detail::unbounded<S>()), high);
      }
    }
    const S y = of(line);
    const S above = select(y < low, low, y);
    return select(high < above, high, above);
  }

  /// The ends of a line, in u.
  /// @{
  [[nodiscard]] constexpr S begin_of(int i) const noexcept {
    return i == 0 ? S(-detail::unbounded<S>()) : inputs_[static_cast<std::size_t>(i - 1)];
  }
  [[nodiscard]] constexpr S end_of(int i) const noexcept {
    return i == Points ? S(detail::unbounded<S>()) : inputs_[static_cast<std::size_t>(i)];
  }
  /// @}

  Array<S, Points> inputs_{};   ///< where the next line begins; no number is beyond the last
  Array<S, Points> effects_{};  ///< the same as effects
  Array<Line, Points + 1> lines_{};
};

}  // namespace esokit
