/// @file
/// The design of NonlinearEso in make: the limits of its gain function, and a report on where the
/// given function is outside the stable range.
#pragma once

#include <esokit/gain/certificate/gain_interval.hpp>
#include <esokit/gain/nonlinear_gain.hpp>
#include <optional>

namespace esokit {

/// Ranges of |e| (unit of y) in ascending order. `lower` = 0 or `upper` = infinity means that this
/// end was not found within the tested range (2^-40 to 2^40 error scales).
template <PlainScalar S>
struct ErrorRanges {
  static constexpr int most = 4;     ///< capacity
  Array<Interval<S>, most> range{};  ///< the first `count` are valid
  int count = 0;                     ///< ranges found, 0 .. most
  bool complete = true;              ///< false: there are more than `most`
};

/// What `NonlinearEso::report` tells about a config.
template <PlainScalar S>
struct NonlinearGainReport {
  Interval<S> continuous;  ///< constant k for which the continuous observer is stable
  Interval<S> sampled;     ///< constant k for which the sampled observer is stable
  Interval<S> limits;      ///< k is limited to this interval
  bool certified = false;  ///< any variation of k within `limits` is stable
  S certified_max{};       ///< largest k_max that is certified with limits.lower; 0 if none is
  ErrorRanges<S> outside;  ///< |e| where the given k would be outside `sampled`
  ErrorRanges<S> limited;  ///< |e| where the given k is replaced by a limit
};

namespace detail {

inline constexpr int tested_octaves = 40;

/// Refuses a k that is not finite at a tested point: the smallest magnitude, and four points per
/// octave.
template <Scalar S, class Shape>
Check<S> check_shape(const Shape& shape) {
  if constexpr (even_gain_traits<Shape>.validates) {
    if (auto ok = shape.validate(); !ok) return ok.error();
  }
  const auto k = prepared(shape);
  constexpr const char* rule = "is a magnitude (in error scales) at which the gain is not finite";
  if (!is_finite(S(k(least_magnitude<S>())))) {
    return Error<S>{"shape", least_magnitude<S>(), rule};
  }
  for (int octave = -tested_octaves; octave < tested_octaves; ++octave) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      const auto octave_start = power_of_two<TableScalar<S>>(octave);
      const S x = S(octave_start) * (S(1.0) + S(0.25) * integer<S>(quarter));
      if (!is_finite(S(k(x)))) return Error<S>{"shape", x, rule};
    }
  }
  return {};
}

/// The limits of a config, see NonlinearEso.
template <Scalar S>
struct GainLimits {
  std::optional<S> lower{};
  std::optional<S> upper{};
  bool allow_uncertified = false;
  bool unlimited = false;
};

template <Scalar S>
constexpr S largest(const S& a, const S& b) noexcept {
  return select(a < b, b, a);
}

/// @param gain the bandwidth gains: scaled, or those of a continuous observer
/// @param least_with_one smallest k_min that is certified with k_max = 1
/// @param ceiling beyond this no k_max is certified
template <int Size, Scalar S, class Gain>
Expected<Interval<S>, Error<S>> find_limits(const GainLimits<S>& asked, const Gain& gain,
                                            const S& least_with_one, const S& ceiling) {
  const S widest(static_cast<TableScalar<S>>((std::numeric_limits<TableScalar<S>>::max)()));
  constexpr const char* unlimited = "must be left out with unlimited";
  Rules<S> rules;
  if (asked.lower) rules.not_negative("gain_min", *asked.lower);
  if (asked.upper) rules.positive("gain_max", *asked.upper);
  if (asked.lower) rules.demand(!asked.unlimited, "gain_min", *asked.lower, unlimited);
  if (asked.upper) rules.demand(!asked.unlimited, "gain_max", *asked.upper, unlimited);
  if (!rules) return rules.error();
  if (asked.unlimited) return Interval<S>{-widest, widest};
  const S three_quarters_down = S(0.25) * (S(1.0) + S(3.0) * least_with_one);
  S low = largest(S(0.5), three_quarters_down);
  // A gain_max below the default gain_min is not refused: it lowers gain_min.
  if (asked.upper) low = select(*asked.upper < low, *asked.upper, low);
  if (asked.lower) low = *asked.lower;
  if (asked.upper && !(*asked.upper >= low)) {
    return Error<S>{"gain_min", low,          "must not be above gain_max, which is",
                    -1,         *asked.upper, true};
  }
  const S base = largest(low, S(1.0));
  const bool room = base < ceiling;
  if (asked.upper) {
    if (asked.allow_uncertified || gain_range_certified<Size, S>(gain, low, *asked.upper)) {
      return Interval<S>{low, *asked.upper};
    }
    // The error names gain_min if no gain_max is certified with it.
    if (gain_range_certified<Size, S>(gain, low, low)) {
      return Error<S>{"gain_max",
                      *asked.upper,
                      "must be certified for a varying gain (or set allow_uncertified_gain): with "
                      "this gain_min, at most",
                      -1,
                      largest_certified_gain<Size, S>(gain, low, low, ceiling),
                      true};
    }
  } else if (room && gain_range_certified<Size, S>(gain, low, base)) {
    // Half way to the largest: there the error would be at the stability limit.
    const S most = largest_certified_gain<Size, S>(gain, low, base, ceiling);
    return Interval<S>{low, S(0.5) * (base + most)};
  } else if (asked.allow_uncertified) {
    return Error<S>{"gain_max", S(0.0), "must be given if gain_min is not certified"};
  }
  if (!(low < ceiling)) {
    return Error<S>{
        "gain_min", low,     "must be below the stability limit for a constant gain, which is",
        -1,         ceiling, true};
  }
  return Error<S>{"gain_min",
                  low,
                  "must be certified for a varying gain (or set allow_uncertified_gain): with "
                  "gain_max = 1, at least",
                  -1,
                  least_with_one,
                  true};
}

/// The ranges in which `inside(x)` is false, x in error scales; their ends are accurate to 1e-6
/// relative.
template <PlainScalar S, class Inside>
ErrorRanges<S> ranges_outside(const Inside& inside, S scale) {
  constexpr S infinite = detail::unbounded<S>();
  ErrorRanges<S> found;
  S before(0);
  bool was_inside = true;
  for (int octave = -tested_octaves; octave < tested_octaves; ++octave) {
    for (int part = 0; part < 16; ++part) {
      const S x = power_of_two<S>(octave) * (S(1) + static_cast<S>(part) / S(16));
      const bool is_inside = inside(x);
      if (is_inside != was_inside) {
        S edge(0);
        if (before > S(0)) {
          S here = before;
          edge = x;
          for (int i = 0; i < 24; ++i) {
            const S middle = S(0.5) * (here + edge);
            (inside(middle) == was_inside ? here : edge) = middle;
          }
        }
        if (!is_inside && found.count == ErrorRanges<S>::most) {
          found.complete = false;
          return found;
        }
        const auto index = static_cast<std::size_t>(found.count);
        if (is_inside) {
          found.range[index].upper = edge * scale;
          ++found.count;
        } else {
          found.range[index] = {edge * scale, infinite};
        }
      }
      was_inside = is_inside;
      before = x;
    }
  }
  if (!was_inside) ++found.count;
  return found;
}

}  // namespace detail
}  // namespace esokit
