// What to follow a moving target with: the carriage of a lathe that cuts a thread goes with the
// spindle, which only an encoder shows.
//
// Way: sampled. The spindle is known exactly; what follows it gets counts once a sample.
//
// Spindle     n' = ((1 - load) n_set - n) / tau,  target = pitch * turns
// Reference   of a differentiator, of LinearEso<2> alone, and of FollowProfile with and without the
//             speed and acceleration that LinearEso<2> finds
//
// symbol    code               value       unit
//           count              1 / 4000    of a turn
//           pitch              0.1         in a turn
// n_set     spindle_speed      10          turns/s, after a smooth start in 0.5 s
// load      load               0.05        of n_set, from 1.5 s on: the cut begins
// tau       droop              0.1         s
// A, R      acceleration       40          in/s2, limit of the carriage
// V         speed              1.5         in/s, limit of the carriage
// omega_o   bandwidth          200         rad/s
// T         sample_time        1e-3        s

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <esokit/control/follow_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/report.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;

namespace {

constexpr double sample_time = 1e-3;
constexpr double pitch = 0.1;
constexpr double count = pitch / 4000;
constexpr double spindle_speed = 10;
constexpr double start_time = 0.5;
constexpr double cut = 1.5;
constexpr double load = 0.05;
constexpr double droop = 0.1;
constexpr double acceleration = 40;
constexpr double speed = 1.5;
constexpr double bandwidth = 200;
constexpr double filter_time = 4 * sample_time;
constexpr double ahead = 0.05;  // of the carriage, where the target is when it is engaged, in
constexpr int samples = 2500;

using Motion = esokit::Vector<double, 3>;

/// Where the carriage should be, in.
std::vector<double> targets() {
  constexpr int parts = 20;
  std::vector<double> all;
  double turns = 0, n = 0;
  for (int k = 0; k < samples; ++k) {
    all.push_back(pitch * turns);
    for (int i = 0; i < parts; ++i) {
      const double t = (k + static_cast<double>(i) / parts) * sample_time;
      const double set = spindle_speed * esokit::smooth_step<2>(t / start_time)(0);
      turns += n * sample_time / parts;
      n += (set * (t < cut ? 1 : 1 - load) - n) / droop * sample_time / parts;
    }
  }
  return all;
}

double counted(double position) { return count * std::round(position / count); }

/// What makes a reference of counts; while `held`, the carriage stands at `place`.
struct Way {
  std::string name;
  std::function<Motion(double counts, bool held, double place)> next;
};

std::vector<Way> ways() {
  const auto differentiator = esokit::TrackingDifferentiator<>::make(
                                  {.acceleration = acceleration, .sample_time = sample_time})
                                  .value();
  const auto profile = [](double width) {
    return esokit::FollowProfile<2>::make(
               {.limits = {speed, acceleration}, .filter_time = width, .sample_time = sample_time})
        .value();
  };
  // u = 0: what it takes for a disturbance is the acceleration.
  const auto observed = [observer = esokit::LinearEso<2>::make({.observer_bandwidth = bandwidth,
                                                                .input_gain = 1,
                                                                .sample_time = sample_time})
                                        .value()](double y) mutable {
    (void)observer.update(y, 0);
    return Motion(observer.estimate());
  };
  const auto held_at = [](auto& follower, double place) {
    (void)follower.start(place);
    return Motion{place, 0, 0};
  };
  return {{"TrackingDifferentiator",
           [d = differentiator](double y, bool held, double place) mutable {
             (void)(held ? d.reset(place) : d.update(y));
             return Motion(d.motion());
           }},
          {"LinearEso alone",
           [o = observed](double y, bool held, double place) mutable {
             const Motion found = o(y);
             return held ? Motion{place, 0, 0} : found;
           }},
          {"FollowProfile, position alone",
           [p = profile(0), held_at](double y, bool held, double place) mutable {
             if (held) return held_at(p, place);
             (void)p.update(y);
             return p.motion();
           }},
          {"FollowProfile, with LinearEso", [p = profile(filter_time), o = observed, held_at](
                                                double y, bool held, double place) mutable {
             const Motion found = o(y);
             if (held) return held_at(p, place);
             (void)p.update(found);
             return p.motion();
           }}};
}

struct Run {
  std::vector<double> t, error;
  double largest = 0;   ///< abs(r - target) from 1 s on, in
  double asked = 0;     ///< largest r'' by the differences of r, in/s2
  double together = 0;  ///< from the engagement until abs(r - target) stays below 1e-4 in, s
};

/// From the start of the spindle; or engaged at its full speed, from a place before the target.
Run follow(Way way, const std::vector<double>& target, bool at_speed) {
  constexpr int engagement = 1000;
  const double place = at_speed ? target[engagement] - ahead : 0;
  Run run;
  double last = place, before = place;
  for (int k = 0; k < samples; ++k) {
    const double exact = target[static_cast<std::size_t>(k)];
    const bool held = at_speed && k < engagement;
    const double r = way.next(counted(exact), held, place)(0);
    run.asked = std::max(run.asked, std::abs(r - 2 * last + before) / (sample_time * sample_time));
    before = last;
    last = r;
    if (held) continue;
    run.t.push_back(k * sample_time);
    run.error.push_back(r - exact);
    if (k >= engagement) run.largest = std::max(run.largest, std::abs(r - exact));
    if (std::abs(r - exact) > 1e-4) run.together = (k - engagement + 1) * sample_time;
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "following",
      about("What to follow a moving target with",
            "The carriage of a lathe that cuts a thread has to go with the spindle, which "
            "only an encoder shows. Four references, sampled each millisecond."));
  const std::vector<double> target = targets();
  Figure figure("following", {.rows = 2, .columns = 1, .panel_height = 150});
  figure.caption(
      "References for a carriage that is engaged while the spindle turns, 0.05 in behind its "
      "target, with 40 in/s2 at most. Below: the last thousandths.");
  auto& far = figure.panel(0, 0).y_label("r - target (in)").legend(Legend::above).name("engaged");
  auto& close = figure.panel(1, 0).x_label("t (s)").y_label("r - target (in)").name("close");
  far.x_range(0.95, 2.5);
  close.x_range(0.95, 2.5).y_range(-2e-4, 2e-4);
  const Color colors[] = {Color::vermillion, Color::black, Color::orange, Color::blue};
  std::vector<CsvRow> rows;
  for (std::size_t i = 0; const Way& way : ways()) {
    const Run from_start = follow(way, target, false), at_speed = follow(way, target, true);
    const bool has_speed = i == 1 || i == 3, limited = i != 1;
    report.expect(way.name, "largest abs(r - target) at speed and into the cut (in)",
                  from_start.largest, (from_start.largest < 5e-5) == has_speed,
                  has_speed ? "below 5e-5" : "above 5e-5");
    report.expect(way.name, "engaged at speed, asks for (in/s2)", at_speed.asked,
                  (at_speed.asked < acceleration * (1 + 1e-6)) == limited,
                  limited ? "at most 40" : "above 40");
    if (has_speed) {
      report.expect(way.name, "engaged, until within 1e-4 in for good (s)", at_speed.together,
                    at_speed.together < 0.2, "below 0.2");
    }
    rows.push_back({way.name, number_text(from_start.largest, 2), number_text(from_start.asked, 2),
                    number_text(at_speed.asked, 2),
                    has_speed ? number_text(at_speed.together, 3) : "never"});
    if (limited) {
      far.line(at_speed.t, at_speed.error,
               {.name = way.name, .color = colors[i], .width = i == 3 ? 2.0 : 1.2});
    }
    close.line(at_speed.t, at_speed.error,
               {.name = limited ? "" : way.name, .color = colors[i], .width = i == 3 ? 2.0 : 1.0});
    ++i;
  }
  report.table("following", "A carriage that goes with a spindle, in units of in and s",
               {"reference", "largest abs(r - target) at speed and into the cut",
                "largest r'' while the spindle starts", "largest r'' if engaged at speed",
                "until within 1e-4 then"},
               rows);
  report.add(figure);
  return report.finish();
}
