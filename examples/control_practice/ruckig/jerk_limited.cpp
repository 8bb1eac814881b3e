// A reference with a limit of jerk, from any state: Ruckig's community version (MIT) before an Adrc
// of order 3. Built where CMake finds the package ruckig.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <ruckig/ruckig.hpp>

int main() {
  constexpr double T = 1e-3, b0 = 500, load = -200;
  auto controller =
      esokit::Adrc<esokit::LinearEso<3>>::make(
          {.observer = {.observer_bandwidth = 150, .input_gain = b0, .sample_time = T},
           .controller_bandwidth = 30})
          .value();
  ruckig::Ruckig<1> profile(T);
  ruckig::InputParameter<1> from;
  ruckig::OutputParameter<1> to;
  from.current_position = from.current_velocity = from.current_acceleration = {0.0};
  from.target_velocity = from.target_acceleration = {0.0};
  from.max_velocity = {2.0};
  from.max_acceleration = {20.0};
  from.max_jerk = {400.0};

  double y = 0, v = 0, a = 0, error = 0, jerk = 0;
  for (int k = 0; k < 3000; ++k) {
    from.target_position = {k < 400 ? 1.0 : 0.3};  // changes its mind on the way
    if (profile.update(from, to) < 0) return 1;    // an error: r stays where it is
    to.pass_to_input(from);
    const esokit::Vector<double, 4> r{to.new_position[0], to.new_velocity[0],
                                      to.new_acceleration[0], to.new_jerk[0]};
    const double u = controller.update(y, r);
    error = std::max(error, std::abs(r(0) - y));
    jerk = std::max(jerk, std::abs(r(3)));
    const double now = b0 * u + (k < 1500 ? 0 : load);  // y''', held for a sample
    y += T * (v + T / 2 * (a + T / 3 * now));
    v += T * (a + T / 2 * now);
    a += T * now;
  }
  std::printf("largest jerk %g, largest error %g, at the end %g\n", jerk, error, y - 0.3);
  return jerk < 400.001 && std::abs(y - 0.3) < 1e-3 ? 0 : 1;
}
