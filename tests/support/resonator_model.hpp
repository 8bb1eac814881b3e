/// @file
/// The smallest model that is no chain: y^(n) = d + b0 u, d a constant and a sine of known
/// frequency. States (y, .., y^(n-1), D, q, r): D the sum, q the sine, r = q' / w.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/model/sampled_model.hpp>
#include <esokit/model/scaled_chain.hpp>

namespace esokit_test {

template <int Order, class S>
class ResonatorModel {
  using Chain = esokit::ScaledChain<Order, S, 1>;

 public:
  static constexpr esokit::ModelTraits traits{.shifts_output = true, .adds_levels = true};
  static constexpr int order = Order;
  static constexpr int extension = 3;
  static constexpr int size = Order + 3;
  using State = esokit::Array<S, size>;
  using Estimate = esokit::Vector<S, size>;
  template <class T>
  using with_scalar = ResonatorModel<Order, T>;
  struct Settings {
    S frequency{};  ///< rad/s
  };

  static esokit::Expected<ResonatorModel, esokit::Error<S>> make(const Settings& settings,
                                                                 const S& input_gain,
                                                                 const S& sample_time) {
    esokit::Rules<S> rules;
    rules.positive("model.frequency", settings.frequency)
        .demand(settings.frequency * sample_time < S(3.1), "model.frequency", settings.frequency,
                "must be below half the sample rate");
    if (!rules) return rules.error();
    return ResonatorModel(settings.frequency, input_gain, sample_time);
  }

  [[nodiscard]] const S& input_gain() const noexcept { return input_gain_; }
  [[nodiscard]] const S& sample_time() const noexcept { return sample_time_; }

  [[nodiscard]] S drive(const S& u) const noexcept { return scaled_input_gain_ * u; }

  [[nodiscard]] State predict(const State& x, const S& drive) const noexcept {
    const S q = x[Order + 1];
    const S r = x[Order + 2];
    esokit::Array<S, Order + 1> plant{};
    for (std::size_t i = 0; i <= Order; ++i) plant[i] = x[i];
    const auto ahead = Chain::template predict<1>(plant, {drive});
    State next{};
    for (std::size_t i = 0; i < Order; ++i) {
      next[i] = ahead[i] + of_q_[i] * q + of_r_[i] * r;
    }
    next[Order] = x[Order] + cosine_less_one_ * x[Order + 1] + sine_ * x[Order + 2];
    next[Order + 1] = x[Order + 1] + cosine_less_one_ * x[Order + 1] + sine_ * x[Order + 2];
    next[Order + 2] = x[Order + 2] + cosine_less_one_ * x[Order + 2] - sine_ * x[Order + 1];
    return next;
  }
  [[nodiscard]] State add_input(const State& x, const S& u) const noexcept {
    State sum = x;
    for (int i = 0; i < Order; ++i) {
      sum[static_cast<std::size_t>(i)] =
          sum[static_cast<std::size_t>(i)] + S(esokit::binomial(Order, i)) * drive(u);
    }
    return sum;
  }

  [[nodiscard]] Estimate physical(const State& x) const noexcept {
    Estimate z;
    for (int i = 0; i < size; ++i) z(i) = x[static_cast<std::size_t>(i)] / unit(i);
    return z;
  }
  template <int Row>
  [[nodiscard]] S physical(const State& x) const noexcept {
    return x[Row] / unit(Row);
  }
  [[nodiscard]] State scaled(const Estimate& z) const noexcept {
    State x{};
    for (int i = 0; i < size; ++i) x[static_cast<std::size_t>(i)] = z(i) * unit(i);
    return x;
  }
  [[nodiscard]] State rescaled(const State& x, const ResonatorModel& before) const noexcept {
    return scaled(before.physical(x));
  }
  [[nodiscard]] S scaled_disturbance(const S& d) const noexcept { return d * unit(Order); }
  [[nodiscard]] bool same_drive(const ResonatorModel& other) const noexcept {
    return scaled_input_gain_ == other.scaled_input_gain_ && sample_time_ == other.sample_time_;
  }
  [[nodiscard]] S finite_probe(const State& x) const noexcept {
    S sum(0.0);
    for (int i = 0; i < size; ++i) {
      sum = sum + esokit::detail::absolute(x[static_cast<std::size_t>(i)]) / unit(i);
    }
    return sum;
  }
  [[nodiscard]] Estimate equilibrium(const S& y, const S& u) const noexcept {
    Estimate z = Estimate::Zero();
    z(0) = y;
    z(Order) = -(input_gain_ * u);
    return z;
  }
  [[nodiscard]] esokit::Matrix<S, size, size> increment() const noexcept {
    esokit::Matrix<S, size, size> step;
    for (int j = 0; j < size; ++j) {
      State unit_state{};
      unit_state[static_cast<std::size_t>(j)] = S(1.0);
      const State next = predict(unit_state, S(0.0));
      for (int i = 0; i < size; ++i) {
        step(i, j) = next[static_cast<std::size_t>(i)] - unit_state[static_cast<std::size_t>(i)];
      }
    }
    // 1 + (c - 1) - 1 would lose digits.
    step(Order + 1, Order + 1) = cosine_less_one_;
    step(Order + 2, Order + 2) = cosine_less_one_;
    return step;
  }
  [[nodiscard]] static constexpr int state_of_row(int row) noexcept { return row; }
  [[nodiscard]] static constexpr int degree(int row) noexcept { return row < Order ? row : Order; }

 private:
  ResonatorModel(const S& frequency, const S& input_gain, const S& sample_time)
      : input_gain_(input_gain),
        sample_time_(sample_time),
        scaled_input_gain_(Chain::scaled_input_gain(input_gain, sample_time)) {
    const S angle = frequency * sample_time;
    const S half = std::sin(angle / S(2.0));
    cosine_less_one_ = S(-2.0) * half * half;
    sine_ = std::sin(angle);
    // j! sum (-1)^i a^(2i) / (2i + j)! and the same of odd powers, j = n - row.
    for (int row = 0; row < Order; ++row) {
      const int j = Order - row;
      S even(0.0);
      S odd(0.0);
      S term(1.0);
      for (int power = 1; power < 40; ++power) {
        term = term * angle / S(static_cast<double>(power + j));
        const S sign = S(power / 2 % 2 == 0 ? 1.0 : -1.0);
        if (power % 2 == 0) {
          even = even + sign * term;
        } else {
          odd = odd + sign * term;
        }
      }
      of_q_[static_cast<std::size_t>(row)] = S(esokit::binomial(Order, row)) * even;
      of_r_[static_cast<std::size_t>(row)] = S(esokit::binomial(Order, row)) * odd;
    }
  }

  /// T^r / r! of the plant's rows, T^n / n! of all others.
  [[nodiscard]] S unit(int row) const noexcept {
    S unit(1.0);
    for (int i = 1; i <= degree(row); ++i) {
      unit = unit * sample_time_ / S(static_cast<double>(i));
    }
    return unit;
  }

  S input_gain_;
  S sample_time_;
  S scaled_input_gain_;
  S cosine_less_one_{};
  S sine_{};
  esokit::Array<S, Order> of_q_{};
  esokit::Array<S, Order> of_r_{};
};

}  // namespace esokit_test
