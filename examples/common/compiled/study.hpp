/// @file
/// `study`, `identify` and their parts, compiled once for all programs that call them: nine seconds
/// of compile in each otherwise.
#pragma once

#include <optional>
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

/// Innovations of the fit that was chosen.
struct Residual {
  FitData rows{};                ///< that it was fitted to
  std::vector<double> values{};  ///< one a row
};
[[nodiscard]] Residual residual_of(const Identified& found, const FitData& rows);

/// What of them is periodic: the line of their spectrum that is highest above its neighbourhood. It
/// must be higher than that of white noise is in all but one of as many logs as there are rows.
[[nodiscard]] std::optional<double> line_of(const Residual& residual);

}  // namespace esokit::examples::compiled
