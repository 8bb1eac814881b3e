/// @file
/// The study of a log in seven stages: from rows to b0, its interval and all that is seen beside
/// it.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/plateau.hpp>
#include <functional>
#include <optional>
#include <vector>

namespace esokit {

namespace detail {

/// What is known of a log before its rows are studied, and how.
struct RowSettings {
  IdentifyOptions options{};
  bool wide = false;                               ///< bounds are those of a chosen order
  std::function<void(double)> progress = nullptr;  ///< called with 0 .. 1
};

/// The study of rows that were averaged by `fold`. The stages come in the order of the members;
/// each uses what those before it found.
class RowStudy {
 public:
  /// @param rows without the scheduling column @param along the scheduling column, or empty
  /// @param result what is known of the log before; returned with the rest
  RowStudy(FitData rows, const std::vector<double>& along, const RowSettings& settings,
           Identified result);

  /// All stages. Without a plateau only the first four, and b0 without an interval.
  /// @param raw_noise noise from the fast part of the innovations of the plain rows
  Identified run(Estimate& raw_noise);

 private:
  void choose_order(Estimate& raw_noise);  // and what acts beside u: forces, sines, friction
  void choose_extension();                 // of the disturbance: constant or ramp
  void find_noise(const Estimate& raw_noise);
  void find_plateau_of_b0();    // where b0 does not depend on the bandwidth
  void find_gain_and_times();   // b0, latency and pole with their intervals
  void find_other_effects();    // columns, friction, force of position, sines, schedule
  void compare_with_the_log();  // what else could explain it

  [[nodiscard]] bool may_be_late() const;
  void find_late_columns(const OrderFit& with, bool search);
  void find_position_force(std::vector<OrderFit>& of_speed);
  void find_disturbance();
  /// Friction of order 1 that the likelihood misses. At its bandwidth, what turns round now and
  /// then is a disturbance; at that of the plateau, b0 would have to follow it. It has to leave
  /// less than `friction_left` of the mean square, and its interval must not reach to zero.
  void find_plateau_with_friction();
  void find_plateau_in_motion();
  [[nodiscard]] double friction_spread() const;
  [[nodiscard]] double position_spread() const;
  [[nodiscard]] Estimate gain_over(std::size_t down, double resolved) const;
  [[nodiscard]] Estimate linear(std::size_t column) const;
  void find_columns();
  [[nodiscard]] MeasuredEffect late_effect(MeasuredEffect effect, std::size_t c,
                                           const TimedColumn& column) const;
  void find_position_factors();
  void find_sinusoids();
  void find_second_opinion();
  void find_curves();
  void find_rise();
  void widen_latency();
  [[nodiscard]] const PlateauPoint& here() const;
  [[nodiscard]] const std::vector<double>& speed();

  FitData rows_;
  const std::vector<double>& along_;
  IdentifyOptions options_;
  std::function<void(double)> progress_;
  Identified result_;
  std::size_t known_;
  FitBounds bounds_;
  IdentifyOptions tried_;
  std::vector<OrderFit> orders_{};
  OrderFit chosen_{};
  std::vector<double> sines_{};
  FitData used_{};               // with friction
  std::vector<double> speed_{};  // for the friction, empty until it is needed
  FitModel model_{};
  Fit likely_{};
  std::optional<InnovationsFit> fit_{};  // of likely_
  Plateau of_all_{};                     // of all rows, also where only those in motion count
  double friction_spread_ = 0.0;
};

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/row_study.ipp>
#endif
