/// @file
/// ChainModel: the chain of integrators as the model of an observer, used if nothing else is known.
#pragma once

#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/model/sampled_model.hpp>
#include <esokit/model/scaled_chain.hpp>

namespace esokit {

/// The model y^(n) = d + b0 u with d^(m) = 0, sampled at T.
///
/// States are those of ScaledChain.
template <int Order, class S = double, int Extension = 1>
requires(detail::is_a_scalar<S>()) class ChainModel {
  using Chain = ScaledChain<Order, S, Extension>;
  static constexpr int N = Order + Extension;

 public:
  static constexpr int order = Order;          ///< n, order of the plant
  static constexpr int extension = Extension;  ///< m, extended states
  static constexpr int size = N;               ///< N = n + m

  static constexpr ModelTraits traits{
      .is_chain = true, .shifts_output = true, .adds_levels = true};  ///< what it is
  using Settings = NoModelSettings;                                   ///< settings of make

  using State = Array<S, N>;      ///< x, scaled, N elements
  using Estimate = Vector<S, N>;  ///< z, physical units, N x 1
  template <class T>
  using with_scalar = ChainModel<Order, T, Extension>;  ///< the same with another scalar

  /// @param input_gain b0, unit of y^(n) per unit of u @param sample_time T, s; both already
  /// checked
  constexpr ChainModel(const S& input_gain, const S& sample_time) noexcept
      : sample_time_(sample_time),
        input_gain_(input_gain),
        rate_(S(1.0) / sample_time),
        scaled_input_gain_(Chain::scaled_input_gain(input_gain, sample_time)) {}

  /// b0, unit of y^(n) per unit of u, as it was given.
  [[nodiscard]] constexpr const S& input_gain() const noexcept { return input_gain_; }
  /// T, s, as it was given.
  [[nodiscard]] constexpr const S& sample_time() const noexcept { return sample_time_; }

  /// b0 u, scaled like the disturbance: a u held over the sample acts on the chain like a part of
  /// its disturbance.
  [[nodiscard]] ESOKIT_INLINE constexpr S drive(const S& u) const noexcept {
    return scaled_input_gain_ * u;
  }

  /// `drive` plus the disturbance (with its derivatives) in the estimate x of a level: what drives
  /// the next level of a cascade.
  /// @{
  [[nodiscard]] ESOKIT_INLINE static constexpr Array<S, Extension> joined(const S& drive,
                                                                          const State& x) noexcept {
    Array<S, Extension> all;
    detail::unroll<Extension>(
        [&](auto r) ESOKIT_INLINE_LAMBDA { std::get<r>(all) = std::get<Order + r>(x); });
    std::get<0>(all) = std::get<0>(all) + drive;
    return all;
  }
  [[nodiscard]] ESOKIT_INLINE static constexpr Array<S, Extension> joined(
      const Array<S, Extension>& drive, const State& x) noexcept {
    Array<S, Extension> all;
    detail::unroll<Extension>([&](auto r) ESOKIT_INLINE_LAMBDA {
      std::get<r>(all) = std::get<Order + r>(x) + std::get<r>(drive);
    });
    return all;
  }
  /// @}

  /// x one sample ahead: Phi x + Gamma u. @param drive result of `drive` or `joined`
  /// @{
  [[nodiscard]] ESOKIT_INLINE constexpr State predict(const State& x,
                                                      const S& drive) const noexcept {
    return Chain::template predict<1>(x, {drive});
  }
  [[nodiscard]] ESOKIT_INLINE constexpr State predict(
      const State& x, const Array<S, Extension>& drive) const noexcept {
    return Chain::template predict<Extension>(x, drive);
  }
  /// @}

  /// x + Gamma u.
  [[nodiscard]] ESOKIT_INLINE constexpr State add_input(const State& x, const S& u) const noexcept {
    const S of_u = drive(u);
    State sum = x;
    detail::unroll<Order>([&](auto r) ESOKIT_INLINE_LAMBDA {
      constexpr double weight = binomial(Order, r);
      std::get<r>(sum) = std::get<r>(sum) + detail::constant<S>(weight) * of_u;
    });
    return sum;
  }

  /// The estimates in physical units.
  [[nodiscard]] constexpr Estimate physical(const State& x) const noexcept {
    return Chain::physical(x, rate_);
  }
  /// One of the estimates.
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE constexpr S physical(const State& x) const noexcept {
    return Chain::template physical<Row>(std::get<Row>(x), rate_);
  }
  /// The state from estimates in physical units.
  [[nodiscard]] constexpr State scaled(const Estimate& estimate) const noexcept {
    return Chain::scaled(estimate, sample_time_);
  }

  /// d in the scaling of the state. @param disturbance unit of y^(n)
  [[nodiscard]] constexpr S scaled_disturbance(const S& disturbance) const noexcept {
    return Chain::scaled_input_gain(disturbance, sample_time_);
  }

  /// A number that is finite only if all estimates are finite, see ScaledChain::finite_probe.
  [[nodiscard]] ESOKIT_INLINE constexpr S finite_probe(const State& x) const noexcept {
    return Chain::finite_probe(x, rate_);
  }

  /// A state of the model `before` in the scaling of this one.
  [[nodiscard]] constexpr State rescaled(const State& x, const ChainModel& before) const noexcept {
    if (same_time(before)) return x;
    const S ratio = sample_time_ * before.rate_;
    State next = x;
    S factor(1.0);
    for (std::size_t r = 1; r < next.size(); ++r) {
      factor = factor * ratio;
      next[r] = next[r] * factor;
    }
    return next;
  }

  /// The estimate for a plant at rest at y under a constant u: (y, 0, .., 0, -b0 u, 0, ..).
  [[nodiscard]] constexpr Estimate equilibrium(const S& y, const S& u) const noexcept {
    Estimate state = Estimate::Zero();
    state(0) = y;
    state(Order) = -(input_gain_ * u);
    return state;
  }

  /// Phi - I: Pascal's triangle without its diagonal.
  [[nodiscard]] static constexpr Matrix<S, N, N> increment() noexcept {
    Matrix<S, N, N> step = Matrix<S, N, N>::Zero();
    for (int i = 0; i < N; ++i) {
      for (int j = i + 1; j < N; ++j) {
        step(i, j) = S(binomial_table<N, detail::TableScalar<S>>[static_cast<std::size_t>(j)]
                                                                [static_cast<std::size_t>(i)]);
      }
    }
    return step;
  }
  /// Place of row r of the estimate among the states: r.
  [[nodiscard]] static constexpr int state_of_row(int row) noexcept { return row; }
  /// Power of T in the scaling of a state, see SampledModel: r.
  [[nodiscard]] static constexpr int degree(int row) noexcept { return row; }

  /// True if u has the same effect in both models.
  [[nodiscard]] constexpr bool same_drive(const ChainModel& other) const noexcept {
    return same_time(other) &&
           !all(detail::absolute(S(scaled_input_gain_ - other.scaled_input_gain_)) > S(0.0));
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 4;

  [[nodiscard]] constexpr bool same_time(const ChainModel& other) const noexcept {
    return !all(detail::absolute(S(rate_ - other.rate_)) > S(0.0));
  }

  S sample_time_;
  S input_gain_;
  S rate_;               ///< 1/T
  S scaled_input_gain_;  ///< used in every sample
};

}  // namespace esokit
