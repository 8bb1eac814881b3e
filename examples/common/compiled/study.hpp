/// @file
/// `study`, `identify` and their parts, compiled once for all programs that call them: nine seconds
/// of compile in each otherwise.
#pragma once

#include <vector>

#include <esokit/identify/identify.hpp>

namespace esokit::examples::compiled {

/// esokit::prepare
[[nodiscard]] Expected<PreparedLog, Error<double>> prepare(const Log& log);

/// esokit::study
[[nodiscard]] Expected<Identified, Error<double>> study(const Log& log,
                                                        const IdentifyOptions& options = {});

/// esokit::identify
[[nodiscard]] Expected<Identified, Error<double>> identify(const Log& log,
                                                           const IdentifyOptions& options = {});

/// InnovationsFit::minimise at the bandwidth of `start`
[[nodiscard]] Fit minimised(const FitData& data, const FitModel& model, const FitBounds& bounds,
                            const FitPoint& start);

/// Innovations of the fit that was chosen, over the rows that it was fitted to, which are
/// `sample_time` apart.
[[nodiscard]] std::vector<double> residual_of(const Identified& found, const FitData& rows,
                                              double& sample_time);

}  // namespace esokit::examples::compiled
