#include <algorithm>
#include <cmath>
#include <esokit/core/error_text.hpp>
#include <esokit/identify/smooth.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "common/system.hpp"
#include "from_log/parts/log_observer.hpp"
#include "from_log/parts/show.hpp"

namespace from_log {

using namespace esokit::examples;

namespace {

using Smoothed = esokit::Expected<esokit::SmoothedLog, esokit::Error<double>>;

/// The log under the model of the observer, each row known from all others.
template <int Order>
Smoothed smoothed(const LogSettings& how, const esokit::Log& log) {
  const auto observer = esokit::LinearEso<Order>::make({.observer_bandwidth = how.bandwidth,
                                                        .input_gain = how.input_gain,
                                                        .sample_time = how.sample_time});
  if (!observer) return observer.error();
  return esokit::smooth(log, *observer);
}

Smoothed smoothed(const LogSettings& how, const esokit::Log& log) {
  return how.order == 1   ? smoothed<1>(how, log)
         : how.order == 2 ? smoothed<2>(how, log)
                          : smoothed<3>(how, log);
}

std::vector<double> divided(std::vector<double> values, double by) {
  for (double& value : values) value /= by;
  return values;
}

/// What the curve beside dhat is, or why there is none.
std::string about_smoothed(const Smoothed& found, double input_gain) {
  if (!found) return "The disturbance was not smoothed: " + esokit::to_text(found.error()) + ".";
  std::vector<double> deviations = divided(found->deviation, std::abs(input_gain));
  const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
  std::nth_element(deviations.begin(), middle, deviations.end());
  return "dhat lags. The other curve does not: each of its values is from the whole log, before "
         "and after (esokit::smooth), with a standard deviation of " +
         number_text(*middle, 3) + " in units of u, if order and b0 are right.";
}

}  // namespace

std::string stem_of(const Settings& settings) {
  // A name of nothing but dots would be a hidden file.
  const std::string stem = esokit::examples::path_of(settings.file).stem().string();
  return stem.find_first_not_of('.') == std::string::npos ? "log" + stem : stem;
}

std::string show_observer(const Settings& settings, const Input& input) {
  if (settings.orders.size() != 1) throw LogError("--observer: --order is missing");
  if (!settings.expected_gain) throw LogError("--observer: --b0 is missing");
  if (!(settings.bandwidth > 0)) throw LogError("--observer: --bandwidth is missing");
  LogSettings how{.observer = settings.observer,
                  .order = settings.orders[0],
                  .input_gain = *settings.expected_gain,
                  .bandwidth = settings.bandwidth,
                  .sample_time = settings.sample_time};
  const auto& time = input.log.time;
  if (!(how.sample_time > 0)) how.sample_time = median_step(time);
  const LogEstimates found = run_observer(how, time, input.log.y, input.log.u);
  std::vector<double> t = time;
  for (std::size_t k = t.size(); k < input.log.y.size(); ++k)
    t.push_back(static_cast<double>(k) * how.sample_time);
  const Smoothed smooth = smoothed(how, {.time = t, .u = input.log.u, .y = input.log.y});
  std::string text = "t_s";
  for (int r = 0; r < how.order; ++r) text += ",y" + std::string(static_cast<std::size_t>(r), '\'');
  text += smooth ? ",d,d_smoothed,deviation\n" : ",d\n";
  for (std::size_t k = 0; k < t.size(); ++k) {
    text += number_text(t[k], 15);
    for (const auto& column : found.columns) text += ',' + number_text(column[k], 12);
    if (smooth) {
      text += ',' + number_text(smooth->disturbance[k], 12) + ',' +
              number_text(smooth->deviation[k], 4);
    }
    text += '\n';
  }
  const std::filesystem::path file = esokit::examples::path_of(settings.file);
  const std::string numbers = new_file(settings.out, stem_of(settings) + "-estimates", ".csv");
  if (numbers.empty() || !write_text(numbers, text)) return {};
  Page page(file.filename().string() + ", run through an observer");
  page.text(
      "Observer " + how.observer + ", order " + std::to_string(how.order) +
      ", b0 = " + number_text(how.input_gain, 6) + ", omega_o = " + number_text(how.bandwidth, 6) +
      " rad/s, T = " + number_text(how.sample_time, 6) + " s. The gains follow the time stamps.");
  page.table(
      "log", "The log",
      {{"", "rows"},
       {"in the log", std::to_string(t.size())},
       {"measurements missing or bad, bridged by prediction", std::to_string(found.rejected)},
       {"inputs missing or bad, replaced by the one before", std::to_string(found.inputs)},
       {"restarts, because a gap was too long to bridge", std::to_string(found.restarts)}});
  Figure figure("estimates", {.rows = 2, .panel_height = 170});
  figure.caption(
      "Top: y and its estimate. Bottom: u, and the estimated total disturbance in units of u.");
  figure.panel(0, 0)
      .y_label("y (unit of the log)")
      .legend(Legend::above)
      .name("output")
      .line(t, input.log.y, {.name = "y", .color = Color::grey, .width = 1.0})
      .line(t, found.columns[0], {.name = "estimate", .color = Color::blue, .width = 1.1});
  auto& load =
      figure.panel(1, 0)
          .x_label("t (s)")
          .y_label("u, d / b0 (unit of u)")
          .legend(Legend::above)
          .name("load")
          .line(t, input.log.u, {.name = "u", .color = Color::grey, .width = 1.0})
          .line(t, divided(found.columns[static_cast<std::size_t>(how.order)], how.input_gain),
                {.name = "dhat / b0", .color = Color::vermillion, .width = 1.1});
  if (smooth) {
    load.line(t, divided(smooth->disturbance, how.input_gain),
              {.name = "smoothed", .color = Color::blue, .width = 1.1});
  }
  page.figure(figure);
  page.text(about_smoothed(smooth, how.input_gain));
  page.text("All estimates are in the file " +
            esokit::examples::path_of(numbers).filename().string() + ".");
  return page.write(settings.out, stem_of(settings));
}

}  // namespace from_log
