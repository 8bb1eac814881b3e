#pragma once

#include <esokit/analysis/detail/loop_scan.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/core/interval.hpp>
#include <limits>

namespace esokit {

ESOKIT_FUNCTION Expected<Margins, Error<double>> margins(const Loop& loop, int channel) {
  Rules<double> rules;
  rules.all_of(loop.check_channel("channel", channel))
      .demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
              detail::unstable_loop_rule);
  if (!rules) return rules.error();
  const auto response = detail::loop_gain_of(loop, channel);
  const detail::ScanRange range = detail::scan_range(loop, channel);
  detail::MarginFinder finder(response);
  finder.at_zero(detail::loop_gain_at_zero(response, range));
  detail::scan(response, range, finder);
  // L is real at z = -1, too.
  if (loop.sample_time() > 0.0) {
    const double nyquist = std::numbers::pi / loop.sample_time();
    const std::complex<double> l = response.at(-2.0);
    if (is_finite(l.real())) finder.real_axis(l.real(), nyquist);
  }
  return finder.margins();
}

ESOKIT_FUNCTION Expected<Interval<>, Error<double>> input_gain_range(const Loop& loop) {
  const double b0 = loop.input_gain();
  Rules<double> rules;
  rules.nonzero("input_gain", b0);
  if (!rules) {
    return Error<double>{"input_gain", b0,
                         "does not scale all of u in this controller: use gain_increase and "
                         "gain_decrease of its margins"};
  }
  const auto found = margins(loop);
  if (!found) return found.error();
  const double one = b0 / found->gain_increase.value;
  const double other = b0 / found->gain_decrease.value;
  return b0 > 0.0 ? Interval<>{one, other} : Interval<>{other, one};
}

ESOKIT_FUNCTION Expected<Margin, Error<double>> gain_variation(const Loop& loop, int channel) {
  Rules<double> rules;
  rules.all_of(loop.check_channel("channel", channel))
      .demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
              detail::unstable_loop_rule);
  if (!rules) return rules.error();
  const auto response = detail::loop_gain_of(loop, channel);
  // The bound on f + 1/f.
  const auto sum_at = [](std::complex<double> l) {
    return l.real() < 0.0 ? (1.0 + std::norm(l)) / -l.real()
                          : std::numeric_limits<double>::infinity();
  };
  const auto size = [&](double w) { return sum_at(response(w)); };
  const detail::ScanRange range = detail::scan_range(loop, channel);
  detail::LeastDistance least;
  if (const double l = detail::loop_gain_at_zero(response, range); is_finite(l)) {
    least(size, 0.0, sum_at(l));
  }
  const auto look = [&](double w1, std::complex<double> l1, double w2, std::complex<double> l2) {
    if (!least.found()) least(size, w1, sum_at(l1));
    least(size, w2, sum_at(l2));
  };
  detail::scan(response, range, look);
  Margin sum = least.found().value_or(Margin{});
  if (loop.sample_time() > 0.0) {
    const double at_nyquist = sum_at(response.at(-2.0));
    if (at_nyquist < sum.value) sum = {at_nyquist, std::numbers::pi / loop.sample_time()};
  }
  if (!is_finite(sum.value)) return Margin{};
  const double half = 0.5 * sum.value;
  // f from f + 1/f, without a difference of nearly equal numbers; never below 1.
  return Margin{half + std::sqrt((std::max)((half - 1.0) * (half + 1.0), 0.0)), sum.frequency};
}

ESOKIT_FUNCTION Expected<Margin, Error<double>> sensitivity_peak(const Loop& loop) {
  if (!loop.stable()) {
    return Error<double>{"stability_abscissa", loop.stability_abscissa(),
                         detail::unstable_loop_rule};
  }
  const auto size = [&](double w) {
    return 1.0 / loop.sensitivity_at(detail::frequency_operator(w, loop.sample_time()));
  };
  detail::LeastDistance least;
  const auto look = [&](double w1, std::complex<double>, double w2, std::complex<double>) {
    least(size, w1, size(w1));
    least(size, w2, size(w2));
  };
  for (int channel = 0; channel < loop.channels(); ++channel) {
    const auto response = detail::loop_gain_of(loop, channel);
    const detail::ScanRange range = detail::scan_range(loop, channel);
    if (loop.channels() == 1 && is_finite(detail::loop_gain_at_zero(response, range))) {
      least(size, 0.0, size(0.0));
    }
    detail::scan(response, range, look);
    least.restart();
  }
  return Margin{1.0 / least.found()->value, least.found()->frequency};
}

}  // namespace esokit
