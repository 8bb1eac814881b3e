/// @file
/// The planar vertical take-off and landing aircraft of Sim2A and Sim2B and its closed loop, the
/// simulated continuously. Two channels are coupled through the aircraft, so plant and both
/// observers are stacked here by hand; sim::ContinuousLoop does the same for one channel.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/sim/continuous_observer.hpp>
#include <numbers>
#include <optional>
#include <vector>

#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/signals.hpp>
#include <esokit/sim/trapezoid.hpp>

namespace paper1 {

using esokit::EigenMatrix;
namespace sim = esokit::sim;

/// x'' = -sin th (v1 + d1),  z'' = cos th (v1 + d1) - 1,  th'' = v2 + d2, with the input of the two
/// channels (34): (v1'', v2) = M(th, v1)^-1 (u_x, u_z).
///
/// State: x, x', z, z', th, th', v1, v1'.
struct Pvtol {
  using State = EigenMatrix<double, 8>;
  using Pair = EigenMatrix<double, 2>;  ///< (x, z) channels

  bool wind = false;

  /// A value and its first two derivatives.
  using Jet = std::array<double, 3>;

  /// d1 = 0.3 + 0.2 sin t cos t
  Jet d1(double t) const {
    if (!wind) return {};
    return {0.3 + 0.1 * std::sin(2.0 * t), 0.2 * std::cos(2.0 * t), -0.4 * std::sin(2.0 * t)};
  }
  /// d2 = 0.2 + 0.1 sin(t/2) cos(t/2)
  double d2(double t) const { return wind ? 0.2 + 0.05 * std::sin(t) : 0.0; }

  /// (v1'', v2) = M^-1 u. M is singular where v1 = 0.
  static Pair actuation(const State& s, const Pair& u) {
    const double sine = std::sin(s(4));
    const double cosine = std::cos(s(4));
    return {-sine * u(0) + cosine * u(1), -(cosine * u(0) + sine * u(1)) / s(6)};
  }

  State derivative(double t, const State& s, const Pair& u) const {
    const double sine = std::sin(s(4));
    const double cosine = std::cos(s(4));
    const double thrust = s(6) + d1(t)[0];
    const double v1_rate2 = -sine * u(0) + cosine * u(1);
    const double v2 = -(cosine * u(0) + sine * u(1)) / s(6);
    State rate;
    rate << s(1), -sine * thrust, s(3), cosine * thrust - 1.0, s(5), v2 + d2(t), s(7), v1_rate2;
    return rate;
  }

  /// Fourth derivatives of x and z less u: the exact total disturbance of the two channels.
  Pair total_disturbance(double t, const State& s, const Pair& u) const {
    const double sine = std::sin(s(4));
    const double cosine = std::cos(s(4));
    const Pair v = actuation(s, u);
    const Jet wind_force = d1(t);
    const double a = s(6) + wind_force[0];
    const double a1 = s(7) + wind_force[1];
    const double a2 = v(0) + wind_force[2];
    const double w = s(5);
    const double w1 = v(1) + d2(t);
    return {sine * w * w * a - cosine * w1 * a - 2.0 * cosine * w * a1 - sine * a2 - u(0),
            -cosine * w * w * a - sine * w1 * a - 2.0 * sine * w * a1 + cosine * a2 - u(1)};
  }

  /// (x, x', x'', x''') and (z, ..): what the observers estimate.
  std::array<EigenMatrix<double, 4>, 2> chain_states(double t, const State& s) const {
    const double sine = std::sin(s(4));
    const double cosine = std::cos(s(4));
    const Jet wind_force = d1(t);
    const double a = s(6) + wind_force[0];
    const double a1 = s(7) + wind_force[1];
    return {EigenMatrix<double, 4>(s(0), s(1), -sine * a, -cosine * s(5) * a - sine * a1),
            EigenMatrix<double, 4>(s(2), s(3), cosine * a - 1.0, -sine * s(5) * a + cosine * a1)};
  }
};

/// A set-up of Sim2.
struct PvtolSetup {
  double bandwidth = 200.0;  ///< omega_o1, rad/s
  double factor = 2.5;       ///< alpha
  bool wind = false;         ///< the printed wind
  bool printed_gains =
      true;                 ///< 6, 13.5, 13.5, 5.0625 on yd - y .. yd''' - y'''; false: (s + 1.5)^4
  bool true_start = false;  ///< observers start from the true states; false: from zero
  double step = 1e-3;       ///< s
  double noise_power = 0.0;  ///< Sim2B: 1e-17, held over 1 ms
};

/// The criteria of Table 4, over 5..40 s.
struct PvtolCriteria {
  double error = 0.0;           ///< int sqrt(ex^2 + ez^2) dt
  double control = 0.0;         ///< int v1^2 + v2^2 dt
  double estimate = 0.0;        ///< int sqrt(error of dhat_x^2 + error of dhat_z^2) dt
  double end = 0.0;             ///< time at which the run ended, s: 40, or earlier if it diverged
  double whole_error = 0.0;     ///< the first criterion from 0 s on
  double singular_time = -1.0;  ///< first time at which v1 < 0.05, where M is all but singular, s
};

/// The signals of Figs 6 to 9.
struct PvtolSeries {
  std::vector<double> t;
  std::vector<double> reference_x, reference_z, x, z, error_x, error_z, v1, v2, estimate_error_x,
      estimate_error_z;
};

inline constexpr double pvtol_end = 40.0;
inline constexpr double pvtol_from = 5.0;
inline constexpr double pvtol_noise_power = 1e-17;
inline constexpr double pvtol_noise_hold = 1e-3;

/// One run with two cascades of `Levels` levels.
template <int Levels>
PvtolCriteria run_pvtol(const PvtolSetup& setup, std::uint64_t seed = 0,
                        PvtolSeries* series = nullptr) {
  using Observer = esokit::ContinuousCascadeEso<4, Levels>;
  constexpr int n = Observer::states;
  using Stacked = EigenMatrix<double, 8 + 2 * n>;
  using Pair = Pvtol::Pair;

  typename Observer::Config config{.observer_bandwidth = setup.bandwidth, .input_gain = 1.0};
  if (Levels > 1) config.bandwidth_factor = setup.factor;
  const auto observer = Observer::make(config).value();
  using Law = esokit::AdrcLaw<4>;
  const auto law = setup.printed_gains
                       ? Law::make({.gains = {{6.0, 13.5, 13.5, 5.0625}}, .input_gain = 1.0})
                       : Law::make({.controller_bandwidth = 1.5, .input_gain = 1.0});
  // sin(3 t/4) and cos(3 t/4)/2 + 1
  const auto reference_x = sim::Sine<>::make({.amplitude = 1.0, .angular_frequency = 0.75}).value();
  const auto reference_z = sim::Sine<>::make({.amplitude = 0.5,
                                              .angular_frequency = 0.75,
                                              .phase = std::numbers::pi / 2.0,
                                              .offset = 1.0})
                               .value();
  const auto make_noise = [&](std::uint64_t number) {
    return sim::HeldNoise<>::make({.power = setup.noise_power,
                                   .hold = pvtol_noise_hold,
                                   .step = setup.step,
                                   .seed = number})
        .value();
  };
  auto noise_x = make_noise(2 * seed);
  auto noise_z = make_noise(2 * seed + 1);
  const Pvtol plant{setup.wind};

  Stacked start = Stacked::Zero();
  start(4) = 0.6;
  start(6) = 1.5;
  if (setup.true_start) {
    const auto truth = plant.chain_states(0.0, start.template head<8>());
    for (int channel = 0; channel < 2; ++channel) {
      typename Observer::Estimate estimate = Observer::Estimate::Zero();
      eigen(estimate).template head<4>() = truth[static_cast<std::size_t>(channel)];
      start.template segment<n>(8 + channel * n) = eigen(Observer::state_at(estimate));
    }
  }

  // Two stages of a step share their time, the first one and the sample too.
  double reference_time = -1.0;
  EigenMatrix<double, 5> r_x, r_z;
  const auto references_at = [&](double t) {
    if (t == reference_time) return;
    reference_time = t;
    r_x = EigenMatrix<double, 5>(reference_x.derivatives<5>(t).data());
    r_z = EigenMatrix<double, 5>(reference_z.derivatives<5>(t).data());
  };
  const auto control = [&](double t, const Stacked& s) {
    references_at(t);
    const auto channel = [&](int first, const EigenMatrix<double, 5>& reference) {
      const typename Observer::State z = s.template segment<n>(first);
      return law->control(Observer::estimate(z), reference);
    };
    return Pair(channel(8, r_x), channel(8 + n, r_z));
  };

  const auto window = sim::Window<>::make({.start = pvtol_from, .end = pvtol_end}).value();
  sim::Trapezoid<> error(window);
  sim::Trapezoid<> whole_error;
  sim::Trapezoid<> effort(window);
  sim::Trapezoid<> estimate(window);
  PvtolCriteria result;
  Stacked s = start;
  const auto steps = static_cast<std::int64_t>(std::llround(pvtol_end / setup.step));
  for (std::int64_t k = 0;; ++k) {
    const double t = static_cast<double>(k) * setup.step;
    const Pair noise(noise_x.at(k), noise_z.at(k));
    const Pvtol::State plant_state = s.template head<8>();
    const Pair u = control(t, s);
    const Pair v(plant_state(6), Pvtol::actuation(plant_state, u)(1));
    const Pair d = plant.total_disturbance(t, plant_state, u);
    const Pair e(r_x(0) - plant_state(0) - noise(0), r_z(0) - plant_state(2) - noise(1));
    const Pair d_error(d(0) - Observer::total_disturbance(s.template segment<n>(8)),
                       d(1) - Observer::total_disturbance(s.template segment<n>(8 + n)));
    error.add(t, e.norm());
    whole_error.add(t, e.norm());
    effort.add(t, v.squaredNorm());
    estimate.add(t, d_error.norm());
    result.end = t;
    if (plant_state(6) < 0.05 && result.singular_time < 0.0) result.singular_time = t;
    if (series != nullptr) {
      series->t.push_back(t);
      series->reference_x.push_back(r_x(0));
      series->reference_z.push_back(r_z(0));
      series->x.push_back(plant_state(0));
      series->z.push_back(plant_state(2));
      series->error_x.push_back(e(0));
      series->error_z.push_back(e(1));
      series->v1.push_back(v(0));
      series->v2.push_back(v(1));
      series->estimate_error_x.push_back(d_error(0));
      series->estimate_error_z.push_back(d_error(1));
    }
    // 100 m from the reference: it will not recover.
    if (k == steps || !(e.norm() < 100.0)) break;

    const auto rate = [&](double time, const Stacked& state) -> Stacked {
      const Pair input = control(time, state);
      const typename Observer::State z_x = state.template segment<n>(8);
      const typename Observer::State z_z = state.template segment<n>(8 + n);
      Stacked result_rate;
      result_rate << plant.derivative(time, state.template head<8>(), input),
          eigen(observer.derivative(time, z_x, state(0) + noise(0), input(0))),
          eigen(observer.derivative(time, z_z, state(2) + noise(1), input(1)));
      return result_rate;
    };
    s = sim::step(rate, t, s, setup.step);
  }
  result.error = error.value();
  result.whole_error = whole_error.value();
  result.control = effort.value();
  result.estimate = estimate.value();
  return result;
}

/// The same with the number of levels chosen at run time, 1 to 3.
inline PvtolCriteria run_pvtol(int levels, const PvtolSetup& setup, std::uint64_t seed = 0,
                               PvtolSeries* series = nullptr) {
  if (levels == 1) return run_pvtol<1>(setup, seed, series);
  if (levels == 2) return run_pvtol<2>(setup, seed, series);
  return run_pvtol<3>(setup, seed, series);
}

}  // namespace paper1
