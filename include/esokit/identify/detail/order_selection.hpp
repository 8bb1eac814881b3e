/// @file
/// The fits of each order, with friction and forces of position where they are seen.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <optional>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Slope (derivative 1) or value (0) at each row of a parabola fitted to 2 half + 1 rows.
std::vector<double> smoothed(const FitData& data, int half, int derivative);

double rms(const std::vector<double>& values);

/// Largest correlation of the innovations over lags 1 to 20.
double innovations_correlation(const std::vector<double>& e);

/// The speed on which friction depends: y' for order 2, y for order 1; smoothed until the noise in
/// it is a fiftieth, over at most the latency.
std::vector<double> friction_speed(const FitData& data, int order, double noise, double latency);

/// Whether a speed comes near zero, where friction turns round. Of a y that stays away from zero (a
/// temperature) nothing may depend on where zero is.
bool stops(const std::vector<double>& speed);

/// The data with an added column for friction, tanh(speed / scale).
FitData with_friction(const FitData& data, const std::vector<double>& speed, double scale);

/// A fit with friction, and its scale v_s.
struct RubbedFit {
  double scale = 0.0;
  Fit fit{};
};

/// The fit with friction that starts from the one without, with the scale that leaves least.
RubbedFit rubbed_fit(const FitData& data, const std::vector<double>& speed, const FitModel& model,
                     const FitBounds& bounds, const Fit& without, bool with_bandwidth);

/// A force that depends on the position, such as gravity or a spring: y, y^2 and y^3 as columns.
/// Without it b0 is wrong below the frequencies of the motion, by the same amount at every
/// bandwidth there: a plateau at a wrong b0.
constexpr std::size_t position_columns = 3;

/// Mean of y, and rms of the rest.
std::pair<double, double> position_scale(const FitData& data);

void add_position(FitData& data, std::size_t from = 1);

/// Bounds of the fit. A slow sensor in a short log needs wide ones, in which an order that is too
/// low can pass for a higher one: so only when the order is chosen.
FitBounds fit_bounds(const FitData& data, bool wide);

/// rows log(mean square) + parameters log(rows).
double criterion(const Fit& fit, int parameters);

/// The data for the fit of an order, with its friction.
FitData with_friction(const FitData& data, const OrderFit& order);

/// Compares how well each order explains the log at bandwidths below that of the likelihood.
void compare_orders(const FitData& data, std::vector<OrderFit>& orders);

/// The best fit of each requested order. @param before those before sines were added, or none
std::vector<OrderFit> fit_orders(const FitData& data, const IdentifyOptions& options,
                                 const FitBounds& bounds, const std::vector<OrderFit>& before = {});

/// The order with the best likelihood, unless another one leaves less than 1 / e of the mean square
/// at lower bandwidths. At its own bandwidth the likelihood depends on the fastest motion, which in
/// a flexible machine is the bending. One that is only a part of the likely one says nothing new.
[[nodiscard]] std::vector<OrderFit>::const_iterator best_order(const std::vector<OrderFit>& orders);

/// The other order that leaves least at the bandwidth of `here`, a fit of the order `chosen`. Lag
/// and pole stand for each other in orders next to each other, so it starts from there, too. Orders
/// from `lowest` on; one that was not studied, because the order was given, has no friction.
OtherOrder other_order_of(const FitData& data, const std::vector<OrderFit>& orders, int chosen,
                          int extension, const Fit& here, int lowest = 1);

/// A log without u where friction holds the machine.
struct HeldLog {
  FitData rows{};      ///< u is zero at standstill
  double scale = 0.0;  ///< v_s of the friction in motion
  double share = 0.0;  ///< of the rows, at standstill
  Fit fit{};           ///< at the bandwidth of the plateau
};

/// Friction that holds takes all of u at standstill, which no column of friction can follow: b0 of
/// all rows is up to twice too small. So the fit at the plateau, `here`, is repeated without u
/// there. It must leave less than 0.95 of the mean square: where nothing holds, u moves the machine
/// also when its speed passes zero, and the fit gets worse.
std::optional<HeldLog> held_log(const FitData& rows, const FitModel& model, const FitBounds& bounds,
                                const Fit& here, const std::vector<double>& speed);

/// Whether a force that depends on position acts. It improves the likelihood by more than its
/// parameters cost, or it leaves less than 1 / e of the mean square at a tenth of the bandwidth.
/// (At the full bandwidth everything slow is attributed to the disturbance.) Friction that holds
/// looks like such a force, as it takes most of u: not if it leaves less there.
bool position_acts(const FitData& data, const OrderFit& order, bool friction);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/order_selection.ipp>
#endif
