// The observer for any order n and any number m of extended states (our addition; the paper treats
// n = 2, m = 1 and names the rest as future work). n = 1..4, m = 1..3 on polynomial disturbances,
// beside the linear observer.
//
// J. Kasac, A. Pender, M. Pranjic, D. Kotarski, "Frequency-shifting-based algebraic approach to
// extended state observer design", Asian Journal of Control 23 (2021) 2171-2184,
// doi:10.1002/asjc.2516.
//
// Way: sampled. Observers are sampled with period T, current-estimator form; the input
// is held; the plant is a chain of integrators and advanced exactly.
//
// Plant      y^(n) = d(t) + b0 u,  d = sum_{i<m} d_i t^i / i!, and then with a term t^m / m!
// Observers  LinearEso: all poles at exp(-omega_o T);  AlgebraicEso: deadbeat for N = n + m
// samples,
//            then the bandwidth falls as mu(t) = lambda + N q / (e^{qt} - 1)
// Errors     degree < m: none from sample N - 1 on (algebraic), decaying (linear);
//            degree m:   in the end both lag, d - dhat -> C(N, n) d^(m) / lambda^m
//
// symbol      code         value                       unit
// lambda,     bandwidth    8                           rad/s
// omega_o
// q           q            2                           rad/s
// T           period       0.01                        s
// b0          b0           2                           -
// d_i         (truth)      1, -0.7, 1                  s^-i
// y^(i)(0)    (truth)      1, -0.7, 1, -0.7            s^-i; the observers start at zero

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/math/combinatorics.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/report.hpp"
#include "paper2_fsb_algebraic_eso/paper2.hpp"

using namespace esokit::examples;
using namespace paper2;

namespace {

constexpr double bandwidth = 8.0;  // rad/s
constexpr double q = 2.0;          // rad/s
constexpr double period = 0.01;    // s
constexpr double b0 = 2.0;
constexpr int samples = 1000;   // 10 s
constexpr double shown = 4.0;   // s
constexpr double close = 0.01;  // error that counts as settled, unit of d

/// Errors of dhat at the samples.
struct Errors {
  std::vector<double> linear, shifted;
};

/// Chain of n + m + 1 integrators, the last of which is the constant d^(m) (0 or 1).
template <int Order, int Extension>
Errors run(double highest) {
  constexpr int size = Order + Extension;
  esokit::Array<long double, size + 1> z{};
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t power = i < Order ? i : i - Order;
    z[i] = power % 2 == 0 ? 1.0L : -0.7L;
  }
  z[size] = static_cast<long double>(highest);
  constexpr auto T = static_cast<long double>(period);
  auto shifted =
      esokit::AlgebraicEso<Order, double, Extension>::make({.observer_bandwidth = bandwidth,
                                                            .frequency_shift = q,
                                                            .input_gain = b0,
                                                            .sample_time = period})
          .value();
  auto linear = esokit::LinearEso<Order, double, Extension>::make(
                    {.observer_bandwidth = bandwidth, .input_gain = b0, .sample_time = period})
                    .value();
  Errors errors;
  double u = 0.0;
  for (int k = 0; k <= samples; ++k) {
    const auto y = static_cast<double>(z[0]);
    (void)shifted.update(y, u);
    (void)linear.update(y, u);
    const auto d = static_cast<double>(z[Order]);
    errors.shifted.push_back(std::abs(d - shifted.total_disturbance()));
    errors.linear.push_back(std::abs(d - linear.total_disturbance()));
    u = std::sin(0.05 * k);
    const auto before = z;
    for (std::size_t i = 0; i <= size; ++i) {
      long double power = 1.0L;
      for (std::size_t j = i + 1; j <= size; ++j) {
        power *= T / static_cast<long double>(j - i);
        z[i] += power * before[j];
      }
      if (i >= Order) continue;
      power = static_cast<long double>(b0);
      for (std::size_t j = 1; j <= Order - i; ++j) power *= T / static_cast<long double>(j);
      z[i] += power * static_cast<long double>(u);
    }
  }
  return errors;
}

/// Time after which the error stays below a limit, s.
std::optional<double> settling(const std::vector<double>& errors, double limit) {
  for (std::size_t k = errors.size(); k-- > 0;) {
    if (errors[k] >= limit) {
      if (k + 1 == errors.size()) return std::nullopt;
      return static_cast<double>(k + 1) * period;
    }
  }
  return 0.0;
}

double largest(const std::vector<double>& errors, std::size_t from) {
  double most = 0.0;
  for (std::size_t k = from; k < errors.size(); ++k) most = std::max(most, errors[k]);
  return most;
}

struct Page {
  Report& report;
  Figure& figure;
  std::vector<CsvRow>& lines;
  std::vector<double> time;
};

template <int Order, int Extension>
void add(Page& page) {
  constexpr int size = Order + Extension;
  const std::string name = "n = " + std::to_string(Order) + ", m = " + std::to_string(Extension);
  const Errors exact = run<Order, Extension>(0.0);
  const Errors lagging = run<Order, Extension>(1.0);

  // y is about 1 (it grows to 1e3 in 10 s for the largest n + m) and is rounded to double; the
  // n-fold difference in dhat magnifies that by n! / T^n times binomials.
  const std::size_t first = size - 1;
  const double rounding = std::ldexp(esokit::factorial(Order), 2 * size) / std::pow(period, Order) *
                          std::numeric_limits<double>::epsilon();
  const double worst =
      largest(std::vector<double>(exact.shifted.begin(), exact.shifted.begin() + 100), first);
  page.report.expect(name, "FSB: error of dhat in the first second, from sample N - 1", worst,
                     worst < rounding, "below the rounding of y, " + number_text(rounding, 2));
  const auto linear_time = settling(exact.linear, close);
  page.report.expect(name, "LESO: time to an error of 0.01 (s)", linear_time.value_or(1e9),
                     linear_time && *linear_time > 20.0 * size * period,
                     "more than 20 times the N samples of FSB");
  // Late: the common lag.
  const double lag = esokit::binomial(size, Order) / std::pow(bandwidth, Extension);
  for (const auto& [observer, errors] :
       {std::pair<std::string, const std::vector<double>&>{"FSB", lagging.shifted},
        {"LESO", lagging.linear}}) {
    page.report.check_reference(name, observer + ": lag behind a disturbance of degree m", lag,
                                errors.back(), 0.5 * bandwidth * period * Extension,
                                "C(N,n) d^(m) / lambda^m for T = 0");
  }
  page.lines.push_back(
      {name, std::to_string(size), number_text(worst, 2), number_text(largest(exact.linear, 0), 3),
       linear_time ? number_text(*linear_time, 3) : "more than 10", number_text(lag, 3),
       number_text(lagging.shifted.back(), 3), number_text(lagging.linear.back(), 3)});

  auto& panel = page.figure.panel(Extension - 1, Order - 1);
  panel.title(name).log_y().y_range(1e-14, 1e4).y_tick(1e6).x_range(0.0, shown).x_tick(1.0);
  panel.legend(Order == 1 && Extension == 1 ? Legend::bottom_left : Legend::none);
  if (Extension == 3) {
    panel.x_label("t (s)");
  } else {
    panel.hide_x_numbers();
  }
  if (Order == 1) panel.y_label("|d - dhat|");
  const auto drawn = [&](const std::vector<double>& errors) {
    std::vector<double> values;
    for (std::size_t k = 0; k < page.time.size(); ++k) values.push_back(std::max(errors[k], 1e-16));
    return values;
  };
  panel.line(page.time, drawn(exact.linear), {.name = "LESO", .color = Color::vermillion})
      .line(page.time, drawn(exact.shifted), {.name = "FSB", .color = Color::blue, .width = 1.1})
      .line(page.time, drawn(lagging.linear),
            {.color = Color::orange, .dash = Dash::dashed, .column = "LESO degree m"})
      .line(page.time, drawn(lagging.shifted),
            {.color = Color::sky, .dash = Dash::dashed, .column = "FSB degree m"});
}

template <int Extension>
void add_row(Page& page) {
  add<1, Extension>(page);
  add<2, Extension>(page);
  add<3, Extension>(page);
  add<4, Extension>(page);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "general_observer",
                about("Any order, any number of extended states (our addition)",
                      "n = 1..4 and m = 1..3 with polynomial disturbances: error over time of "
                      "AlgebraicEso and LinearEso. Sampled observers at 10 ms.",
                      4, true));
  report.remark(
      "Both observers start at zero, the plant does not. If the disturbance is a polynomial of "
      "degree below m, the algebraic observer is exact from sample N - 1 = n + m - 1 on. What "
      "remains is the rounding of the measurement, amplified n times by 1/T, which averages out. "
      "If it is of degree m, both observers end with the same lag, and the algebraic one starts "
      "without it.");
  Figure figure("general", {.rows = 3, .columns = 4, .panel_height = 150});
  figure.title("solid: disturbance of degree m - 1; dashed: of degree m");
  figure.caption(
      "Error of the disturbance estimate for n = 1..4 (columns) and m = 1..3 (rows). Solid: a "
      "disturbance of degree m - 1. Dashed: a disturbance of degree m. lambda = omega_o = 8 rad/s, "
      "q = 2 rad/s, T = 10 ms.");
  std::vector<CsvRow> lines;
  Page page{report, figure, lines, {}};
  for (int k = 0; k * period <= shown; ++k) page.time.push_back(k * period);
  add_row<1>(page);
  add_row<2>(page);
  add_row<3>(page);
  report.table(
      "general",
      "Error of the disturbance estimate; the lag is that behind a disturbance of degree m",
      {"case", "N", "FSB: largest from sample N - 1 (first s)", "LESO: largest",
       "LESO: time to 0.01 (s)", "lag, formula", "lag, FSB", "lag, LESO"},
      lines);
  report.add(figure);
  return report.finish();
}
