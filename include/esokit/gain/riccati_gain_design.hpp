/// @file
/// The design of RiccatiGain in make: its limit, the start table, and whether the scalar can hold
/// what the recursion computes.
#pragma once

#include <esokit/gain/riccati.hpp>
#include <esokit/gain/riccati_gain.hpp>

namespace esokit {

template <int Size, Scalar S, int TableSize, class Transition>
bool RiccatiGain<Size, S, TableSize, Transition>::freeze(RiccatiMode mode) {
  const auto limit = find_limit();
  if (!limit) return false;
  limit_ = *limit;
  RiccatiGain run = *this;
  run.mode_ = RiccatiMode::recursive;
  run.reset();
  for (Point& point : table_) {
    run.advance();
    point = run.now_;
    run.accept(S(0.0));
  }
  mode_ = mode;
  reset();
  return true;
}

template <int Size, Scalar S, int TableSize, class Transition>
bool RiccatiGain<Size, S, TableSize, Transition>::fits(const S& room) const noexcept {
  for (int i = 0; i < Size; ++i) {
    if (!all(is_finite(now_.gain[index(i)])) ||
        !all(is_finite(S(now_.factor.variance(i) * room)))) {
      return false;
    }
  }
  return true;
}

template <int Size, Scalar S, int TableSize, class Transition>
bool RiccatiGain<Size, S, TableSize, Transition>::fits() const noexcept {
  const bool usual = all(start_inflation_ <= S(1e6)) && all(start_inflation_ >= S(1e-6));
  const int most_missing = usual ? 0 : Size;
  // Leaves room for two more missing samples.
  const S growth = S(1.0) + start_inflation_;
  const S room = usual ? S(1.0) : S(growth * growth);
  for (int missing = 0; missing <= most_missing; ++missing) {
    RiccatiGain run = *this;
    run.mode_ = RiccatiMode::recursive;
    run.reset();
    for (int k = 0; k < 8 * Size; ++k) {
      if (!run.fits(room)) return false;
      for (int i = 0; i < missing; ++i) run.advance();
      if (!run.fits(room)) return false;
      run.advance();
      run.accept(S(0.0));
    }
    for (int k = 0; k < 2 * most_missing; ++k) {
      run.advance();
      if (!run.fits(room)) return false;
    }
  }
  return true;
}

template <int Size, Scalar S, int TableSize, class Transition>
auto RiccatiGain<Size, S, TableSize, Transition>::find_limit() const -> std::optional<Point> {
  RiccatiGain run = *this;
  run.mode_ = RiccatiMode::recursive;
  run.reset();
  // theta and its limit depend on each other: repeated until they agree.
  const bool adaptive = rule_ == InflationRule::adaptive;
  const int rounds = adaptive ? 500 : 1;
  S theta(1.0);
  for (int round = 0; round < rounds; ++round) {
    Factor noise = noise_;
    if (adaptive) {
      run.set_inflation(theta);
      noise.scale(S(run.now_.growth / theta));
    }
    const auto factor = steady_covariance<Size, S>(noise, S(measurement_ * run.now_.shrink),
                                                   run.now_.growth, transition_);
    if (!factor) return std::nullopt;
    run.now_.factor = *factor;
    run.set_gain();
    for (const S& k : run.now_.gain) {
      if (!all(is_finite(k))) return std::nullopt;
    }
    if (std::is_same_v<Transition, PascalTransition> && rule_ == InflationRule::fixed &&
        !all(noise_trace_ > S(0.0))) {
      // Nothing disturbs the plant: all poles are exactly at 1/(1+theta).
      const EqualSampledPoles<Size, S> poles{run.now_.inflation * run.now_.shrink};
      run.now_.gain = current_gain<Size, S>(poles.weights());
    }
    if (!adaptive) return run.now_;
    RiccatiGain next = run;
    next.accept(S(0.0));
    next.recur();
    const S change = detail::absolute(S(next.inflation() - theta));
    if (all(change <= S(1e3) * detail::rounding<S>() * theta)) return run.now_;
    theta = next.inflation();
  }
  return std::nullopt;
}

}  // namespace esokit
