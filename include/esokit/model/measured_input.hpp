/// @file
/// MeasuredInput: what a disturbance that is measured does to the plant.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

/// What a measured disturbance w adds to y^(n): gain w, late by a dead time and through a lag of
/// first order, gain e^(-dead_time s) / (1 + lag s) W(s).
template <Scalar S = double>
struct MeasuredInput {
  S gain{};       ///< what w = 1 adds to y^(n) in the end, unit of y^(n) per unit of w; either sign
  S lag{};        ///< time constant, s; 0: none
  S dead_time{};  ///< from w to the beginning of its effect, s; 0: none
};

namespace detail {

/// A MeasuredInput sampled exactly: w[k] is held from k to k + 1. Within that time what arrives at
/// the lag changes once, because the dead time has a fraction of a sample.
/// @tparam Capacity longest dead time, samples
template <PlainScalar S, int Capacity>
class MeasuredPath {
 public:
  /// What the lag does in a sample.
  struct Course {
    S mean;
    S end;
  };

  MeasuredPath() = default;
  /// Settings that `validate` accepts.
  MeasuredPath(const MeasuredInput<S>& input, const S& time) noexcept : input_(input) {
    set_time(time);
  }

  static Check<S> validate(const MeasuredInput<S>& input, const S& time, int index) {
    return Rules<S>{}
        .finite("inputs.gain", input.gain, index)
        .not_negative("inputs.lag", input.lag, index)
        .demand(at_most(input.lag, S(most_lag * time)),
                {"inputs.lag", input.lag, "must be at most a million samples (in float 131072), s:",
                 index, most_lag * time, true})
        .not_negative("inputs.dead_time", input.dead_time, index)
        .demand(at_most(input.dead_time, longest(time)),
                {"inputs.dead_time", input.dead_time, "must be at most Capacity samples, s:", index,
                 longest(time), true});
  }

  /// Other settings, the same memory.
  void adopt(const MeasuredPath& fresh) noexcept {
    const MeasuredPath before = *this;
    *this = fresh;
    arrivals_ = before.arrivals_;
    newest_ = before.newest_;
    lagged_ = before.lagged_;
  }

  /// The length of a sample, s.
  void set_time(const S& time) noexcept {
    const S samples = input_.dead_time / time;
    whole_ = 0;
    while (whole_ < Capacity && static_cast<S>(whole_ + 1) <= samples) ++whole_;
    const S rest = samples - static_cast<S>(whole_);
    share_[0] = rest > S(0) ? (rest < S(1) ? rest : S(1)) : S(0);
    share_[1] = S(1) - share_[0];
    for (std::size_t i = 0; i < 2; ++i) {
      const bool lags = input_.lag > S(0);
      reached_[i] = lags ? -std::expm1(-share_[i] * time / input_.lag) : S(share_[i] > S(0));
      late_[i] = lags ? S(input_.lag / time * reached_[i]) : S(0);
    }
  }

  /// Takes w[k].
  void push(const S& w) noexcept {
    newest_ = newest_ + 1 == length ? 0 : newest_ + 1;
    arrivals_[static_cast<std::size_t>(newest_)] = w;
  }
  /// Replaces w[k].
  void replace(const S& w) noexcept { arrivals_[static_cast<std::size_t>(newest_)] = w; }
  /// As if the present w had been there for long.
  void settle() noexcept {
    const S w = arrivals_[static_cast<std::size_t>(newest_)];
    arrivals_.fill(w);
    lagged_ = w;
  }

  /// What w adds to y^(n) from k to k + 1, in the mean.
  [[nodiscard]] S mean() const noexcept { return input_.gain * course().mean; }
  /// From k to k + 1.
  void advance() noexcept { lagged_ = course().end; }

  /// The lag over a sample. @param lagged at k @param older w[k-D-1] @param newer w[k-D]
  [[nodiscard]] Course course(const S& lagged, const S& older, const S& newer) const noexcept {
    Course all{S(0), lagged};
    for (std::size_t i = 0; i < 2; ++i) {
      const S& w = i == 0 ? older : newer;
      all.mean = all.mean + share_[i] * w + (all.end - w) * late_[i];
      all.end = all.end + reached_[i] * (w - all.end);
    }
    return all;
  }
  [[nodiscard]] const MeasuredInput<S>& input() const noexcept { return input_; }
  /// D, whole samples of the dead time.
  [[nodiscard]] int whole() const noexcept { return whole_; }

  /// False for a w, one of `count`, whose effect might not be finite.
  [[nodiscard]] bool takes(const S& w, int count) const noexcept {
    const S most = S(4) * static_cast<S>(count) * w;
    return is_finite(most) && is_finite(S(input_.gain * most));
  }
  /// The same of all that it remembers.
  [[nodiscard]] bool takes_memory(int count) const noexcept {
    for (const S& w : arrivals_) {
      if (!takes(w, count)) return false;
    }
    return takes(lagged_, count);
  }

 private:
  friend struct RecordAccess;
  static constexpr int length = Capacity + 2;
  /// Samples of a lag: of a longer one the digits of w do not hold what arrives in a sample.
  static constexpr S most_lag =
      S(1) / (S(64) * rounding<S>()) < S(1e6) ? S(1) / (S(64) * rounding<S>()) : S(1e6);
  static S longest(const S& time) { return static_cast<S>(Capacity) * time; }

  [[nodiscard]] Course course() const noexcept {
    return course(lagged_, before(whole_ + 1), before(whole_));
  }
  [[nodiscard]] const S& before(int samples) const noexcept {
    const int at = newest_ - samples;
    return arrivals_[static_cast<std::size_t>(at < 0 ? at + length : at)];
  }

  MeasuredInput<S> input_{};
  Array<S, length> arrivals_{};  ///< w[k], w[k-1], .., a ring
  S lagged_{};                   ///< what has passed the lag at k, unit of w
  Array<S, 2> share_{};          ///< of the sample, in which w[k-D-1] and w[k-D] arrive
  Array<S, 2> reached_{};        ///< the part of a step that passes the lag in that time
  Array<S, 2> late_{};           ///< what the lag takes from the mean
  int whole_ = 0;
  int newest_ = 0;
};

}  // namespace detail

}  // namespace esokit
