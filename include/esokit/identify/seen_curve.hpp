/// @file
/// The curve of an actuator as a log tells it: a dead zone, a limit that u went beyond, a square.
#pragma once

#include <esokit/adapter/actuator_map.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>

namespace esokit {

/// Which curve.
enum class CurveKind {
  straight,    ///< none: the effect is u, or the log tells no curve
  dead_zone,   ///< nothing happens between -size and size
  saturation,  ///< u beyond -size and size does nothing more
  square       ///< the effect is u abs(u) / size, with the largest abs(u) of the log as size
};

/// What the actuator makes of u, as the log tells it. It is there only where b0 depends on the size
/// of u. The curve then makes the log far more likely than b0 alone and than the other curve
/// (e^20), and leaves a b0 that does not depend on it. Never of u with two levels, nor where
/// friction holds the machine (`Identified::held`). Of order 1 friction that sticks counts as a
/// part of a dead zone.
///
/// The b0 beside it is that of u as it was logged: `identify(curve.acted(log))` gives that of the
/// effect, for an observer in MappedInput.
struct SeenCurve {
  CurveKind kind = CurveKind::straight;  ///< straight: none was seen
  Estimate size{};                       ///< unit of u; of a square without an interval
  double left = 1.0;  ///< mean square of the innovations with it, over that without

  /// Whether there is one.
  [[nodiscard]] bool seen() const { return kind != CurveKind::straight; }
  /// For `MappedInput` and `ActuatorMap::make`. Of a saturation it is straight: set `size` as
  /// limits of u.
  [[nodiscard]] ActuatorCurve<> curve() const;
  /// The effect of u, unit of u.
  [[nodiscard]] double effect(double u) const;
  /// The log with the effect in place of u.
  [[nodiscard]] Log acted(Log log) const;
};

namespace detail {

/// The curve that explains y best, at the bandwidth of `here`, the fit without one.
SeenCurve seen_curve(const FitData& data, const FitModel& model, const FitBounds& bounds,
                     const Fit& here, const GainBySize& sizes);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/seen_curve.ipp>
#endif
