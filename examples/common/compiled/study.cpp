#include "study.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace esokit::examples::compiled {

Expected<PreparedLog, Error<double>> prepare(const Log& log) { return esokit::prepare(log); }

Expected<Identified, Error<double>> study(const Log& log, const IdentifyOptions& options) {
  return esokit::study(log, options);
}

Expected<Identified, Error<double>> identify(const Log& log, const IdentifyOptions& options) {
  return esokit::identify(log, options);
}

Fit minimised(const FitData& data, const FitModel& model, const FitBounds& bounds,
              const FitPoint& start) {
  InnovationsFit fit(data, model, bounds);
  return fit.minimise(start, false);
}

Residual residual_of(const Identified& found, const FitData& rows) {
  const auto& chosen =
      *std::find_if(found.orders.begin(), found.orders.end(),
                    [&](const OrderFit& order) { return order.model.order == found.order; });
  FitData data = excerpt(averaged(rows, found.averaged), IdentifyOptions{}.rows_max);
  for (std::size_t c = 0; c < found.columns.size(); ++c) {
    const auto& column = found.columns[c];
    data.columns[c] = esokit::detail::late(data.columns[c], data.starts, data.sample_time,
                                           column.lag.value, column.dead_time.value);
  }
  if (found.position) esokit::detail::add_position(data);
  if (chosen.friction_scale > 0.0) {
    const auto speed =
        esokit::detail::friction_speed(data, found.order, chosen.fit.noise, chosen.fit.at.latency);
    data = esokit::detail::with_friction(data, speed, chosen.friction_scale);
  }
  InnovationsFit fit(data, chosen.model, chosen.bounds);
  (void)fit.at(chosen.fit.at);
  std::vector<double> values = fit.residual();
  return {std::move(data), std::move(values)};
}

std::optional<double> line_of(const Residual& residual) {
  const auto line = esokit::detail::highest_line(residual.rows, residual.values);
  const double rows = static_cast<double>(residual.values.size());
  // White noise exceeds h times its mean at one frequency with probability exp(-h).
  if (!(line.height > 2.0 * std::log(rows))) return std::nullopt;
  return line.frequency;
}

}  // namespace esokit::examples::compiled
