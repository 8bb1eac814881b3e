/// @file
/// A quadratic function of the error that falls in every step of a set: then any sequence of these
/// steps decays.
///
/// P = sum_i (A k)(A k)' / rho^i is the covariance of what a noise in the measurements leaves in
/// the estimate if its share is discounted by rho a sample. With it V(e) = e' P^-1 e falls at least
/// by rho in each sample with the gain k. Another step e -> A_M e is joined to them if A_M P A_M' <
/// P, for then V falls in it, too. (With all poles in one place, P^-1 is the information of least
/// squares with exponential forgetting.)
#pragma once

#include <cmath>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/certificate/detail/bridged_steps.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/math/detail/dense.hpp>
#include <optional>

namespace esokit::detail {

/// P of V(e) = e' P^-1 e. Matrices of steps are given without I.
template <int Size, Scalar S>
class FallingSquare {
 public:
  using Square = Matrix<S, Size, Size>;

  /// @param step A - I for one sample @param spread k k', or any other term of the sum
  /// @param decay -ln of the largest abs(pole) of A
  static std::optional<FallingSquare> make(const Square& step, const Square& spread,
                                           const S& decay) {
    using std::expm1;
    FallingSquare square;
    square.margin_ = S(0.1) * -expm1(S(-decay));
    // A / sqrt(rho), without I.
    const S more = expm1(S(S(0.5) * decay));
    Square discounted = step + step * more + Square::Identity() * more;
    square.p_ = spread;
    Array<S, 2 * Size * Size> work;
    if (!sum_by_doubling(discounted.data(), square.p_.data(), work.data(),
                         work.data() + Size * Size, Size) ||
        !square.falls(step)) {
      return std::nullopt;
    }
    return square;
  }

  /// True if V falls in e -> A e, by at least a tenth of what a sample without a gap takes.
  /// @param step A - I
  [[nodiscard]] bool falls(const Square& step) const { return falls(step, margin_); }

  /// True if it falls by this share.
  [[nodiscard]] bool falls(const Square& step, const S& share) const {
    // P - A P A' = -(E P + (E P)' + E P E'), E = A - I.
    const Square half = step * p_;
    const Square rest = -(half * step.transpose() + half + half.transpose()) - p_ * share;
    Matrix<S, Size, 1> none{};
    return solve_positive<Size, 1, S>(rest, none).has_value();
  }

  /// By what V grows in e -> A e at most: the largest eigenvalue of A P A' P^-1, above it by less
  /// than the root of order 16 of N.
  [[nodiscard]] S growth(Square step) const {
    step += Square::Identity();
    auto all = solve_positive<Size, Size, S>(p_, step * p_ * step.transpose());
    if (!all) return unbounded<S>();
    const auto trace = [&] {
      S sum(0);
      for (int i = 0; i < Size; ++i) sum = sum + (*all)(i, i);
      return sum;
    };
    const S size = trace();
    *all = *all / size;
    for (int squaring = 0; squaring < 4; ++squaring) *all = *all * *all;
    return size * std::sqrt(std::sqrt(std::sqrt(std::sqrt(trace()))));
  }

  /// P.
  [[nodiscard]] const Square& covariance() const noexcept { return p_; }

 private:
  Square p_;
  S margin_{};
};

/// What has to follow longer steps of the chain. @param rate -ln of the share of V that an ordinary
/// correction leaves at most @param step for a number of samples: A - I
template <int Size, PlainScalar S, class Step>
void find_recovery(GapRecovery<S>& recovery, const FallingSquare<Size, S>& square, const S& rate,
                   const Step& step) {
  using std::expm1;
  using std::log;
  const S fallen = -expm1(-rate);
  recovery.counted = 1;
  constexpr int each = 20;
  while (recovery.counted < each && square.falls(step(recovery.counted + 1), fallen)) {
    ++recovery.counted;
  }
  if constexpr (Size > 2) recovery.per_octave = S(2 * (Size - 2)) * log(S(2)) / rate;
  const S all = recovery.per_octave;
  recovery.free = S(1e9);
  for (int last = recovery.counted; last < most_bridged;) {
    const int samples = last + 1 + last / each;
    const S grown = log(square.growth(step(samples)));
    // A twentieth of what an ordinary correction takes has to remain.
    const S more =
        recovery.octaves(static_cast<unsigned>(last + 1)) * all - (grown / rate + S(0.05));
    if (grown > S(0) && more < recovery.free) recovery.free = more;
    last = samples;
  }
}

/// What is known of steps of the chain over several samples, with the gains of `poles` after gaps:
/// each one up to 20 samples is tested, then steps that grow by a twentieth.
/// @param unit a, largest abs(1 - rho_i) @param decay -ln of the largest abs(rho_i)
template <int Size, PlainScalar S, class Poles>
GapRecovery<S> recovery_by_square(const Poles& poles, const S& unit, const S& decay) {
  const auto step = [&](int samples) {
    // Errors in units of 1 / a^r.
    auto k = column(gap_gain<Size, S>(poles, static_cast<unsigned>(samples)));
    const S over = unit * static_cast<S>(samples);
    Vector<S, Size> power;
    S of_over(1), of_unit(1);
    for (int i = 0; i < Size; ++i) {
      power(i) = of_over;
      k(i) = k(i) / of_unit;
      of_over = of_over * over;
      of_unit = of_unit * unit;
    }
    auto error = -(k * power.transpose());
    for (int i = 0; i < Size; ++i) {
      for (int j = i + 1; j < Size; ++j) {
        error(i, j) += static_cast<S>(binomial(j, i)) * power(j - i);
      }
    }
    return std::pair{error, k};
  };
  const auto [one, k] = step(1);
  GapRecovery<S> best;
  // The discount that suits best depends on how far the poles are apart.
  for (const S share : {S(0.5), S(1), S(1.5)}) {
    const auto square = FallingSquare<Size, S>::make(one, k * k.transpose(), S(share * decay));
    if (!square) continue;
    int longest = 1;
    for (int samples = 2; samples <= most_bridged; samples += 1 + samples / 20) {
      if (!square->falls(step(samples).first)) break;
      longest = samples;
    }
    if (longest > best.longest_step || best.counted == 0) {
      best = {};
      best.longest_step = longest;
      find_recovery<Size>(best, *square, S(share * decay),
                          [&](int samples) { return step(samples).first; });
    }
  }
  return best;
}

}  // namespace esokit::detail
