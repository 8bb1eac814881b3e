// The same observer and the same controller in double, in float, and in the 32-bit integers that
// to_fixed_c writes: how far the latter two are from the first, beside the bound that is promised.
// The integers are those of the written C: the program runs its list of operations.
//
// Way: sampled observers as deployed; the servo is a linear plant, sampled exactly.
//
// symbol     code          value                               unit
// y          counts        encoder of 4096 counts a turn       -
// u          counts        12 V in 1000 counts                 -
// omega_o    slow          10, at 20 kHz                       rad/s
// omega_o    fast          200, omega_c = 40, at 1 kHz         rad/s

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>

#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double turn = 2.0 * std::numbers::pi / 4096.0;  // rad a count
constexpr double volt = 12.0 / 1000.0;                    // V a count
constexpr double gain = 50.0;                             // b0, rad/s2 per V

FixedPointOptions ranges(int innovation_bits = 32) {
  FixedPointOptions options;
  options.y = {.unit = turn, .most = 2048};
  options.u = {.unit = volt, .most = 1000};
  options.innovation_bits = innovation_bits;
  return options;
}

/// What was written, as it computes.
struct Integers {
  template <class Object>
  explicit Integers(const Object& object)
      : code(to_fixed_c(object, ranges()).value()),
        recorded(detail::recorded_design(object, {}).value()),
        design(recorded, ranges()),
        player((design.make(), design)) {}

  /// dhat in its unit.
  [[nodiscard]] double disturbance() const {
    const std::size_t last = code.written.scale.size() - 1;
    return std::ldexp(
        static_cast<double>(player.next_word(last)) * code.written.estimates[last][last],
        -code.written.scale[last]);
  }

  FixedCode code;
  detail::RecordedDesign recorded;
  detail::FixedDesign design;
  detail::FixedPlayer player;
};

template <class S>
LinearEso<2, S> observer(double bandwidth, double sample_time) {
  return LinearEso<2, S>::make({.observer_bandwidth = static_cast<S>(bandwidth),
                                .input_gain = static_cast<S>(gain),
                                .sample_time = static_cast<S>(sample_time)})
      .value();
}
template <class S>
Adrc<LinearEso<2, S>> controller() {
  return Adrc<LinearEso<2, S>>::make({.observer = {.observer_bandwidth = S(200),
                                                   .input_gain = static_cast<S>(gain),
                                                   .sample_time = static_cast<S>(1e-3)},
                                      .controller_bandwidth = S(40),
                                      .limits = {.lower = S(-12), .upper = S(12)}})
      .value();
}

std::int64_t counts(double value, double unit) {
  return static_cast<std::int64_t>(std::round(value / unit));
}

struct Curves {
  std::vector<double> t;
  std::array<std::vector<double>, 3> values;     // double, float, integers
  std::array<std::vector<double>, 2> deviation;  // of float and integers from double
  std::array<double, 2> largest{};

  void add(double time, const std::array<double, 3>& now, bool keep) {
    for (std::size_t i = 0; i < 2; ++i) {
      largest[i] = std::max(largest[i], std::abs(now[i + 1] - now[0]));
    }
    if (!keep) return;
    t.push_back(time);
    for (std::size_t i = 0; i < 3; ++i) values[i].push_back(now[i]);
    for (std::size_t i = 0; i < 2; ++i) deviation[i].push_back(std::abs(now[i + 1] - now[0]));
  }
};

/// A slow observer at a high rate: its gains are below the rounding of float beside y.
Curves slow_observer(Integers& integers) {
  constexpr double T = 5e-5;
  auto exact = observer<double>(10, T);
  auto single = observer<float>(10, T);
  Curves curves;
  for (int k = 0; k < 60000; ++k) {
    const double t = k * T;
    // A load that turns the shaft slowly by almost half a turn, and a u that works against it.
    const double angle = 2.8 * std::sin(1.5 * t) + 0.2 * std::sin(9.0 * t);
    const std::int64_t y = counts(angle, turn);
    const std::int64_t u = counts(0.5 * std::sin(2.0 * t), volt);
    (void)exact.update(static_cast<double>(y) * turn, static_cast<double>(u) * volt);
    (void)single.update(static_cast<float>(static_cast<double>(y) * turn),
                        static_cast<float>(static_cast<double>(u) * volt));
    integers.player.observe(y, u);
    curves.add(t,
               {exact.total_disturbance(), static_cast<double>(single.total_disturbance()),
                integers.disturbance()},
               k % 60 == 0);
  }
  return curves;
}

/// A servo under a step and a load, each controller with a servo of its own; u in counts of a
/// timer, for all three.
struct Servo {
  double position = 0.0, speed = 0.0;
  double held = 0.0;

  [[nodiscard]] std::int64_t seen() const { return counts(position, turn); }
  void run(double volts, double load, double T) {
    // y'' = 45 u - 2 y' + load, exactly.
    const double target = (45.0 * volts + load) / 2.0;
    const double decay = std::exp(-2.0 * T);
    position += target * T + (speed - target) * (1.0 - decay) / 2.0;
    speed = target + (speed - target) * decay;
    held = volts;
  }
};

struct Played {
  Curves position, voltage;
  std::array<double, 3> error{};  // mean of abs(r - y), rad
};

Played servo(Integers& integers) {
  constexpr double T = 1e-3;
  constexpr int samples = 3000;
  auto exact = controller<double>();
  auto single = controller<float>();
  std::array<Servo, 3> plants;
  Played played;
  for (int k = 0; k < samples; ++k) {
    const double t = k * T;
    const std::int64_t r = t < 0.1 ? 0 : t < 1.5 ? 1000 : -700;
    const double load = t > 0.8 && t < 1.2 ? -150.0 : 0.0;
    const double reference = static_cast<double>(r) * turn;
    std::array<std::int64_t, 3> u{};
    exact.applied(plants[0].held);
    u[0] = counts(exact.update(static_cast<double>(plants[0].seen()) * turn, reference), volt);
    single.applied(static_cast<float>(plants[1].held));
    u[1] = counts(static_cast<double>(single.update(
                      static_cast<float>(static_cast<double>(plants[1].seen()) * turn),
                      static_cast<float>(reference))),
                  volt);
    integers.player.observe(plants[2].seen(), integers.player.held);
    u[2] = integers.player.control(r);
    std::array<double, 3> position{};
    std::array<double, 3> voltage{};
    for (std::size_t i = 0; i < 3; ++i) {
      position[i] = plants[i].position;
      voltage[i] = static_cast<double>(u[i]) * volt;
      played.error[i] += std::abs(reference - position[i]) / samples;
      plants[i].run(voltage[i], load, T);
    }
    played.position.add(t, position, k % 3 == 0);
    played.voltage.add(t, voltage, k % 3 == 0);
  }
  return played;
}

template <class Object>
CsvRow bounds(const std::string& name, const Object& object, int bits) {
  const auto made = to_fixed_c(object, ranges(bits));
  if (!made) return {name, std::to_string(bits), "refused", "", made.error().field};
  const FixedBound& d = made->estimates.back();
  return {name, std::to_string(bits), number_text(d.deviation, 3), number_text(d.half_count, 3),
          number_text(d.by_gains, 2)};
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "embedded", "fixed_point",
                {.paper_title = "On a microcontroller",
                 .citation = "Our own designs, written by include/esokit/target",
                 .title = "Fixed point, float and double",
                 .description = "A slow observer at a high rate and a servo loop in double, float "
                                "and the 32-bit integers of to_fixed_c, with the bound that is "
                                "promised. Sampled, as deployed."});

  Integers slow(observer<double>(10, 5e-5));
  const Curves estimate = slow_observer(slow);
  const FixedBound& bound = slow.code.estimates.back();
  Integers loop(controller<double>());
  const Played played = servo(loop);

  Figure figure("fixed_point", {.rows = 2, .columns = 2, .panel_height = 220});
  figure.caption(
      "Top: an observer of 10 rad/s at 20 kHz, y in counts of an encoder. Its estimate of the "
      "disturbance in double, and how far float and the integers are from it; dashed: the bound "
      "for the written gains, for any y and u, and what the rounding of the gains adds. Bottom: a "
      "servo with an encoder and a timer of 1000 counts under steps and a load, each controller "
      "with a servo of its own.");
  auto& disturbance = figure.panel(0, 0).title("disturbance estimate").name("estimate");
  auto& apart = figure.panel(0, 1).title("distance to double").name("distance");
  auto& position = figure.panel(1, 0).title("servo: position").name("position");
  auto& voltage = figure.panel(1, 1).title("servo: voltage").name("voltage");
  constexpr std::array names = {"double", "float", "integers"};
  constexpr std::array colors = {Color::grey, Color::vermillion, Color::blue};
  disturbance.x_label("t (s)").y_label("dhat (rad/s^2)").legend(Legend::bottom_right);
  apart.x_label("t (s)").y_label("abs(dhat − dhat of double)").log_y().y_range(1e-6, 1.0);
  apart.legend(Legend::bottom_right);
  position.x_label("t (s)").y_label("y (rad)").legend(Legend::top_right);
  voltage.x_label("t (s)").y_label("u (V)").legend(Legend::top_right);
  for (std::size_t i = 0; i < 3; ++i) {
    const Style style{.name = names[i], .color = colors[i], .width = i == 0 ? 3.0 : 1.2};
    disturbance.line(estimate.t, estimate.values[i], style);
    position.line(played.position.t, played.position.values[i], style);
    voltage.line(played.voltage.t, played.voltage.values[i], style);
    if (i > 0) apart.line(estimate.t, estimate.deviation[i - 1], style);
  }
  const std::vector<double> ends = {estimate.t.front(), estimate.t.back()};
  const double promised = bound.deviation + bound.by_gains;
  apart.line(ends, std::vector<double>(2, promised),
             {.name = "bound", .color = Color::blue, .dash = Dash::dashed});
  report.add(figure);

  std::vector<CsvRow> rows;
  for (const double speed : {0.0005, 0.01, 0.1, 0.5, 1.0}) {
    const double T = speed < 0.001 ? 5e-5 : 1e-3;
    const std::string name = "LinearEso, omega_o T = " + number_text(speed, 2);
    for (const int bits : {32, 16})
      rows.push_back(bounds(name, observer<double>(speed / T, T), bits));
  }
  report.table("bounds",
               "Bounds of dhat (rad/s2), for any y and u in their ranges: of the integers with the "
               "written gains, of half a count of y, and of the rounding of the gains",
               {"observer", "bits of the innovation", "integers", "half a count", "gains"}, rows);

  report.expect("slow observer", "integers: largest distance to double (rad/s2)",
                estimate.largest[1], estimate.largest[1] <= promised, "within what is promised");
  report.check("slow observer", "float: largest distance to double (rad/s2)", std::nullopt,
               estimate.largest[0]);
  report.check("slow observer", "promised, with the rounding of the gains (rad/s2)", std::nullopt,
               promised);
  for (std::size_t i = 1; i < 3; ++i) {
    const double ratio = played.error[i] / played.error[0];
    report.expect(std::string("servo, ") + names[i], "mean abs(r - y) by that of double", ratio,
                  std::abs(ratio - 1.0) < 0.01, "within 1 %");
  }
  return report.finish();
}
