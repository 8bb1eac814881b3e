#include "study.hpp"

#include <algorithm>

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

std::vector<double> residual_of(const Identified& found, const FitData& rows, double& sample_time) {
  const auto& chosen =
      *std::find_if(found.orders.begin(), found.orders.end(),
                    [&](const OrderFit& order) { return order.model.order == found.order; });
  FitData data = averaged(excerpt(rows, 60000), found.averaged);
  sample_time = data.sample_time;
  if (found.position) esokit::detail::add_position(data);
  if (chosen.friction_scale > 0.0) {
    const auto speed =
        esokit::detail::friction_speed(data, found.order, chosen.fit.noise, chosen.fit.at.latency);
    data = esokit::detail::with_friction(data, speed, chosen.friction_scale);
  }
  InnovationsFit fit(data, chosen.model, chosen.bounds);
  (void)fit.at(chosen.fit.at);
  return fit.residual();
}

}  // namespace esokit::examples::compiled
