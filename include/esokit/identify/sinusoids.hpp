/// @file
/// Sinusoidal disturbances: lines in the spectrum of the innovations, fitted as sines that enter
/// where the disturbance does.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/spectrum.hpp>
#include <vector>

namespace esokit {

/// A sinusoidal disturbance.
struct Sinusoid {
  Estimate frequency{};  ///< rad/s
  Estimate amplitude{};  ///< unit of y^(n)
};

namespace detail {

/// Calls `use(row, time)` for each row; the middle of the log is at time zero.
template <class Use>
void each_time(const FitData& data, const Use& use) {
  const double T = data.sample_time;
  const bool timed = data.start_times.size() == data.starts.size();
  const auto start = [&](std::size_t piece) {
    return timed ? data.start_times[piece] : T * static_cast<double>(data.starts[piece]);
  };
  const std::size_t last = data.starts.size() - 1;
  const double end = start(last) + T * static_cast<double>(data.y.size() - data.starts[last]);
  const double middle = 0.5 * (start(0) + end);
  for (std::size_t piece = 0; piece <= last; ++piece) {
    const std::size_t to = piece < last ? data.starts[piece + 1] : data.y.size();
    for (std::size_t k = data.starts[piece]; k < to; ++k) {
      use(k, start(piece) + T * static_cast<double>(k - data.starts[piece]) - middle);
    }
  }
}

/// Adds cos(w t) and sin(w t) to the data as further columns.
void add_sine(FitData& data, int order, double frequency);

/// A line in a spectrum.
struct Line {
  double frequency = 0.0;  ///< rad/s
  double height = 0.0;     ///< power divided by the mean of its neighbourhood
};

/// The line of e that is highest in comparison with its neighbourhood; zeros if the rows are too
/// far apart in time.
Line highest_line(const FitData& data, const std::vector<double>& e);

/// A sine that is fitted together with the linear parameters: amplitude, and correction of its
/// frequency.
struct FittedSine {
  Sinusoid sine{};    ///< with one standard error as half width
  double gain = 0.0;  ///< twice the rise of the log-likelihood
};

/// Fits the sine near `frequency` in the disturbance, with the other parameters at `point`.
FittedSine fit_sine(const FitData& data, const FitModel& model, const FitBounds& bounds,
                    const FitPoint& point, double frequency);

/// Frequencies (rad/s) of the sines in the innovations of `data`, the largest first. A sine counts
/// if it improves the likelihood by more than amplitude, phase, frequency and the search for it
/// cost, and if its amplitude is at least three standard errors. Also it must not be small in
/// comparison with the effect of u at its frequency: it could be a model error at a frequency of
/// the reference.
std::vector<double> find_sines(FitData data, const FitModel& model, const FitBounds& bounds,
                               const FitPoint& point, int most);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/sinusoids.ipp>
#endif
