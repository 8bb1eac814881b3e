/// @file
/// The continuous-time observer as an ODE, to simulate as the papers do.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/model/integrator_chain.hpp>

namespace esokit {

/// z' = A z + B u + l(t, e) e on `Levels` chains in series. This type only defines the equations:
/// the caller holds the state, usually stacked with that of a plant.
///
/// As in PredictorCorrector, level i is driven by u and the disturbances of the levels below it;
/// its innovation is e_1 = y - x_1, e_i = x_{i-1} - x_i (first elements).
/// @tparam Order n @tparam Extension m @tparam Law ContinuousGainLaw @tparam Levels p
template <int Order, Scalar S, int Extension, class Law, int Levels = 1>
requires ContinuousGainLaw<Law, Order + Extension, S>
class ContinuousObserver {
 public:
  static constexpr int order = Order;                             ///< n, order of the plant
  static constexpr int extension = Extension;                     ///< m, extended states
  static constexpr int size = ChainSize<Order, Extension>::size;  ///< N = n + m
  static constexpr int levels = Levels;                           ///< p
  static constexpr int states = Levels * size;                    ///< N p
  using scalar_type = S;                                          ///< type of states and settings
  using Estimate = Vector<S, size>;  ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using State = Vector<S, states>;   ///< states of all levels, stacked, N p x 1
  using Laws = Array<Law, Levels>;   ///< one for each level

  /// From finished gain laws; use this for a law of your own.
  /// @param input_gain b0, unit of y^(n) per unit of u @param laws one for each level
  /// @return error if b0 is zero or not finite
  static Expected<ContinuousObserver, Error<S>> make(const S& input_gain, const Laws& laws) {
    if (Rules<S> rules; !rules.nonzero("input_gain", input_gain)) return rules.error();
    return ContinuousObserver(input_gain, laws);
  }

  /// dz/dt, N p x 1. @param t s @param z N p x 1 @param y measurement @param u input
  [[nodiscard]] State derivative(const S& t, const State& z, const S& y, const S& u) const {
    State rate;
    S measured = y;
    S drive = input_gain_ * u;
    for (int level = 0; level < Levels; ++level) {
      const int first = level * size;
      const S innovation = measured - z(first);
      const Estimate gain = laws_[static_cast<std::size_t>(level)].gain(t, innovation);
      for (int i = 0; i < size; ++i) {
        rate(first + i) = gain(i) * innovation;
        if (i + 1 < size) rate(first + i) = rate(first + i) + z(first + i + 1);
      }
      rate(first + Order - 1) = rate(first + Order - 1) + drive;
      drive = drive + z(first + Order);
      measured = z(first);
    }
    return rate;
  }

  /// Call this at the start of each integration step: a switched law may change its mode only
  /// there.
  void begin_step([[maybe_unused]] const S& t, [[maybe_unused]] const State& z,
                  [[maybe_unused]] const S& y) {
    if constexpr (detail::declared_traits<Law, ContinuousGainLawTraits>.begins_steps) {
      S measured = y;
      for (int level = 0; level < Levels; ++level) {
        laws_[static_cast<std::size_t>(level)].begin_step(t, measured - z(level * size));
        measured = z(level * size);
      }
    }
  }

  /// (y, .., y^(n-1), d, .., d^(m-1)): plant states of the last level, disturbance summed over all
  /// levels, equation (24) of the cascade paper (K. Lakomy, R. Madonski, ISA Transactions 109
  /// (2021) 1-10).
  [[nodiscard]] static Estimate estimate(const State& z) {
    Estimate estimate = z.template segment<size>(states - size);
    for (int level = 0; level + 1 < Levels; ++level) {
      for (int i = Order; i < size; ++i) estimate(i) = estimate(i) + z(level * size + i);
    }
    return estimate;
  }

  /// dhat, unit of y^(n).
  [[nodiscard]] static S total_disturbance(const State& z) {
    S sum = z(Order);
    for (int level = 1; level < Levels; ++level) sum = sum + z(level * size + Order);
    return sum;
  }

  /// State in which every level has the given estimate; the first level holds the disturbance.
  [[nodiscard]] static State state_at(const Estimate& estimate) {
    State state;
    for (int level = 0; level < Levels; ++level) {
      const int given = level == 0 ? size : Order;
      for (int i = 0; i < given; ++i) state(level * size + i) = estimate(i);
    }
    return state;
  }

  /// b0.
  [[nodiscard]] const S& input_gain() const noexcept { return input_gain_; }

 protected:
  /// `input_gain` is already checked. @param laws one for each level, or one law for one level
  template <class Given>
  ContinuousObserver(const S& input_gain, const Given& laws)
      : laws_{laws}, input_gain_(input_gain) {}

 private:
  Laws laws_;
  S input_gain_;
};

}  // namespace esokit
