/// @file
/// The constant gain law for models other than the chain, with gains for gaps that stay bounded.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/certificate/detail/gap_certificate.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/gain/detail/model_placement.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/riccati.hpp>
#include <esokit/model/sampled_model.hpp>
#include <optional>
#include <utility>

namespace esokit {

namespace detail {

/// The first step, in samples, that has gain `index` of a table: 1, 2, 3, 4, 6, 8, 11, 14, 18, ..
constexpr int first_step(int index) noexcept {
  int samples = 1;
  for (int i = 0; i < index; ++i) samples += 1 + samples / 4;
  return samples;
}

/// The index of the gain for a step.
constexpr int gain_of_step(unsigned samples) noexcept {
  int i = 0;
  for (unsigned next = 2; next <= samples; next += 1 + next / 4) ++i;
  return i;
}

/// The gains of a CorrectedPart: after one sample, and after gaps, see first_step.
/// @tparam Longest step, samples
template <int Size, Scalar S, int Longest>
struct PartDesign {
  static constexpr int count = gain_of_step(Longest) + 1;
  Array<ScaledGain<Size, S>, count> gains{};
  int longest_step = 0;  ///< longest step that is bridged, samples; 0: the poles cannot be placed
  int counted = 1;       ///< longest step that counts as an ordinary correction
  /// What is due after longer ones than longest_step, by the index of the gain.
  Array<std::uint16_t, count> due{};
  static constexpr std::uint16_t never = 65535;  ///< in it: nothing is proven

  /// True if every error decays with this gain.
  static bool decays(const Matrix<S, Size, Size>& step, const Array<S, Size>& output,
                     const ScaledGain<Size, S>& gain) {
    Array<S, Size> units{};
    units.fill(S(1.0));
    return all(decay(corrected(step, output, gain), units) > S(0.0));
  }

  PartDesign(const Matrix<S, Size, Size>& step, const Array<S, Size>& output,
             const Array<int, Size>& degrees, const PoleFactors<Size, S>& poles) {
    gains[0] = placed_gain(step, output, degrees, poles);
    const auto units = degree_units<Size>(degrees, poles.unit);
    // Rounding spreads N equal poles by its N-th root: for N = 8 in double by a third if the model
    // has a sine at three times the bandwidth. It does not matter if each sample leaves only a
    // tenth of the error (2.3 = ln 10).
    const S got = decay(corrected(step, output, gains[0]), units);
    if (!all(got >= S(0.5) * poles.decay) && !all(got >= S(2.3))) return;
    longest_step = 1;
    find_gap_gains(step, output, units, got);
  }

 private:
  using Square = Matrix<S, Size, Size>;

  // Matrices near I are stored without I: Phi - I keeps all its digits, Phi does not.

  /// (I - k C) Phi - I from Phi - I.
  static Square corrected(const Square& step, const Array<S, Size>& output,
                          const ScaledGain<Size, S>& gain) {
    return step - column(gain) * column(output_ahead<Size>(output, step)).transpose();
  }

  /// (I + A)(I + B) - I.
  static Square joined(const Square& a, const Square& b) { return a * b + (a + b); }

  /// A in these units.
  static Square in_units(Square a, const Array<S, Size>& units) {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = 0; j < Size; ++j) {
        S& x = a(static_cast<int>(i), static_cast<int>(j));
        x = x * (units[j] / units[i]);
      }
    }
    return a;
  }

  /// -ln of the magnitude of the largest pole of I + A, from its powers; -1 if they are not finite.
  /// @param units a^degree, units in which the elements of A are of similar size
  static S decay(Square a, const Array<S, Size>& units) {
    using std::log;
    a = in_units(a, units);
    S share(1.0);
    for (; all(largest_magnitude(a) < S(0.25)) && all(share > S(1e-12)); share = share * S(0.5)) {
      a = joined(a, a);
    }
    a += Square::Identity();
    S radius(0.0);
    for (int squaring = 0; squaring < 40; ++squaring) {
      const S size = largest_magnitude(a);
      if (!all(is_finite(size))) return S(-1.0);
      if (!all(size > smallest_normal<S>())) return S(1e3);  // all poles at zero
      radius = radius + share * log(size);
      share = share * S(0.5);
      a = a / size;
      a = a * a;
    }
    return -radius;
  }

  /// Gains of steps in which V of the gain without a gap falls as well, see FallingSquare.
  void find_gap_gains(Square step, Array<S, Size> output, const Array<S, Size>& units,
                      const S& decay) {
    // In units in which the elements are of similar size.
    Array<S, Size> gain{};
    S least(0.0);
    for (std::size_t i = 0; i < Size; ++i) {
      gain[i] = gains[0][i] / units[i];
      output[i] = output[i] * units[i];
      least = least + S(1e-6) * gain[i] * gain[i];
    }
    step = in_units(step, units);
    due.fill(never);
    const Square sample = corrected(step, output, gain);
    std::optional<Proven> proven;
    // Which V suits best depends on how far the poles are apart, and on how far a sine turns while
    // samples are missing. With P in the place of k k' its sum is spread over more directions. What
    // the gain does not move, as a lag that is only computed, has an error all the same. A step in
    // which V rises is added to the sum of which P consists; that lets V fall there, and rise
    // elsewhere.
    constexpr int rounds = 8;
    const Square moved = column(gain) * column(gain).transpose() + Square::Identity() * least;
    for (const S share : {S(1), S(0.2)}) {
      const S rate = share * decay;
      const auto first = FallingSquare<Size, S>::make(sample, moved, rate);
      if (!first) continue;
      for (Square spread : {moved, Square(first->covariance() * rate)}) {
        for (int round = 0; round < rounds && longest_step < Longest; ++round) {
          const auto square = FallingSquare<Size, S>::make(sample, spread, rate);
          if (!square) break;
          S noise(1.0);
          const int before = longest_step;
          const Square rising = find_gap_gains(*square, step, sample, output, units, noise);
          if (longest_step > before || !proven) proven = Proven{*square, rate, noise};
          spread = spread + (rising * square->covariance() * rising.transpose()) * (S(4) * rate);
        }
      }
    }
    if (proven) find_recovery(*proven, step, output, units);
  }

  /// The same with a given V. Nothing changes if it bridges no more than what was found before.
  /// @param noise R, see gap_gain
  /// @return (I - k C) Phi of the first step in which V rises
  Square find_gap_gains(const FallingSquare<Size, S>& square, const Square& step,
                        const Square& sample, const Array<S, Size>& output,
                        const Array<S, Size>& units, S& noise) {
    auto found = gains;
    // Phi^M - I and A^M - I of the last step that was looked at, A that of an ordinary correction.
    Square over = step, ordinary = sample, longer, error;
    for (int i = 1; i < count; ++i) {
      const int first = first_step(i),
                next = first_step(i + 1) < Longest + 1 ? first_step(i + 1) : Longest + 1;
      Square middle = over, wanted = ordinary;
      for (int samples = first; samples < next; ++samples) {
        ordinary = joined(ordinary, sample);
        if (samples > (first + next - 1) / 2) continue;
        middle = joined(middle, step);
        wanted = ordinary;
      }
      // The last step, at least first - 1, up to which V falls with a gain.
      const auto reached = [&](const Vector<S, Size>& gain) {
        longer = over;
        for (int samples = first; samples < next; ++samples) {
          longer = joined(longer, step);
          error = corrected(longer, output, elements(gain));
          if (!square.falls(error)) return samples - 1;
        }
        return next - 1;
      };
      const auto [gain, last] = gap_gain(square, middle, wanted, output, noise, next - 1, reached);
      for (std::size_t row = 0; row < Size; ++row) {
        found[static_cast<std::size_t>(i)][row] = gain(static_cast<int>(row)) * units[row];
      }
      if (last > longest_step) {
        longest_step = last;
        gains = found;
      }
      if (last < next - 1) break;
      over = longer;
    }
    return error + Square::Identity();
  }

  /// A gain for a step, and up to which one V falls with it. Its error is nearest to the one that
  /// as many ordinary corrections leave, in the mean over all errors, whose covariance is P here.
  /// Where V would rise with it, one between it and that of a Kalman filter.
  /// @param middle Phi^M - I @param ordinary A^M - I @param noise R, halved as far as V asks for
  /// @param most what `reached` returns if V falls in all steps that share the gain
  template <class Reached>
  static std::pair<Vector<S, Size>, int> gap_gain(const FallingSquare<Size, S>& square,
                                                  const Square& middle, const Square& ordinary,
                                                  const Array<S, Size>& output, S& noise, int most,
                                                  const Reached& reached) {
    const Square phi = middle + Square::Identity();
    const auto seen = square.covariance() * phi.transpose() * column(output);
    const auto grown = phi * seen;
    S variance(0.0);
    for (std::size_t row = 0; row < Size; ++row) {
      variance = variance + output[row] * grown(static_cast<int>(row));
    }
    const auto nearest = (middle - ordinary) * seen / variance;
    auto gain = nearest;
    int last = reached(gain);
    if (last == most) return {gain, last};
    // R is halved until V falls in all steps with this gain; at R = 0 it may rise, too.
    for (int halvings = 0; halvings < 16; ++halvings, noise = noise * S(0.5)) {
      gain = grown / (variance + noise);
      last = reached(gain);
      if (last == most) break;
    }
    if (last < most) return {gain, last};
    // The gains with which V falls are convex.
    for (const S share : {S(0.75), S(0.5), S(0.25)}) {
      const auto between = gain + (nearest - gain) * share;
      if (reached(between) == most) return {between, most};
    }
    return {gain, reached(gain)};
  }

  /// The V that bridges most, by what it falls in each sample, and the R of its longest step.
  struct Proven {
    FallingSquare<Size, S> square;
    S rate, noise;
  };

  /// Gains of longer steps than longest_step, and what is due after them.
  void find_recovery(const Proven& proven, const Square& step, const Array<S, Size>& output,
                     const Array<S, Size>& units) {
    const auto& [square, rate, noise] = proven;
    using std::expm1;
    using std::log;
    Square over = step;
    for (int samples = 2; samples <= Longest; ++samples) {
      over = joined(over, step);
      const int i = gain_of_step(static_cast<unsigned>(samples));
      auto& kept = gains[static_cast<std::size_t>(i)];
      if (samples > longest_step && samples == first_step(i)) {
        const Square phi = over + Square::Identity();
        kept = elements(phi * square.covariance() * phi.transpose() * column(output));
        S innovation = noise;
        for (std::size_t row = 0; row < Size; ++row)
          innovation = innovation + output[row] * kept[row];
        for (std::size_t row = 0; row < Size; ++row)
          kept[row] = kept[row] / innovation * units[row];
      }
      Array<S, Size> gain = kept;
      for (std::size_t row = 0; row < Size; ++row) gain[row] = gain[row] / units[row];
      const Square error = corrected(over, output, gain);
      if (samples == counted + 1 && samples <= longest_step && square.falls(error, -expm1(-rate))) {
        counted = samples;
      }
      if (samples <= longest_step) continue;
      const S needed = log(square.growth(error)) / rate;
      auto& most = due[static_cast<std::size_t>(i)];
      if (samples == first_step(i) || samples == longest_step + 1) most = 0;
      if (!(needed < S(60000))) {
        most = never;
      } else if (needed > S(most)) {
        most = static_cast<std::uint16_t>(needed + S(1));
      }
    }
  }
};

}  // namespace detail

/// Constant gain for a model, placed numerically. If the model declares which part is corrected
/// (CorrectedPart), the gain is designed for that part, with the poles that the model itself
/// places.
///
/// The chain bridges a gap by the gain that places the poles for a step of M T. With a resonator
/// this fails. Sampled at every M-th sample it can look like a constant, and the gain grows without
/// bound (50 Hz at 1 ms: 1e5 after 10 missing samples). Instead this law takes the gain whose error
/// is nearest to the one A^M e that M ordinary corrections leave, A = (I - k C) Phi,
///
///     k_M = (Phi^M - A^M) P Phi^M' C' / (C P_M C'),  P_M = Phi^M P Phi^M'
///
/// so that an observer with lost samples answers as it was designed. P is that of V(e) = e' P^-1 e,
/// which falls in each sample without a gap (gain/certificate/detail/gap_certificate.hpp). Where V
/// would rise in the step over M samples, the gain is nearer to that of a Kalman filter whose
/// covariance before the gap was P, or equal to it:
///
///     k_M = P_M C' / (C P_M C' + R)
///
/// with the largest R = 2^-i for which V falls. Both are bounded and tend to the gain for exact
/// measurements. Gaps are bridged up to the longest for which there is such an R, so errors decay
/// in any sequence of them. After longer gaps the last R serves, and corrections are due before the
/// next one, see `recovery`. Steps of 5 samples and more share a gain with those up to a fourth
/// longer (that of M in the middle), and V is tested in each of them. So 22 gains last for 401
/// samples.
/// @tparam MostBridged longest step to be considered, samples
template <int Size, Scalar S, class Placement, int MostBridged>
class ModelGain {
 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{
      .kind = GainKind::preset, .bridges_gaps = true, .recovers = true};
  using Spec = typename Placement::template Spec<Size, LaneScalar<S>>;  ///< bandwidth or poles
  template <class T>
  using with_scalar = ModelGain<Size, T, Placement, MostBridged>;  ///< the same with another scalar

  /// The gain for a set of poles.
  /// @param field name of the config member that holds `spec`, for the error
  /// @param spec poles of the error, checked by the placement @param model the model that is
  /// observed
  /// @param index element of `field` that the error names, -1: none
  /// @return error for a spec that the placement refuses, or for poles that rounding would make
  ///         less than half as fast as specified
  template <SampledModel<S> Model>
  static Expected<ModelGain, Error<S>> make(const char* field, const Spec& spec, const Model& model,
                                            int index = -1) {
    if (auto ok = Placement::template validate<Size, S>(field, spec, index); !ok) return ok.error();
    const S named = Placement::template representative<Size, S>(spec);
    ModelGain law;
    // Converts the gains of the part to those of the whole model.
    const auto take = [&](const auto& part, const auto& poles) -> Expected<ModelGain, Error<S>> {
      const auto design = designed(part, poles);
      if (design.longest_step == 0) {
        return Error<S>{field, named, "gives poles that the scalar cannot place for this model",
                        index};
      }
      for (std::size_t gap = 0; gap < law.gains_.size(); ++gap) {
        law.gains_[gap] = detail::elements(part.whole * detail::column(design.gains[gap]));
      }
      law.longest_step_ = design.longest_step;
      law.counted_ = design.counted;
      law.due_ = design.due;
      return law;
    };
    const S& time = model.sample_time();
    if constexpr (model_traits<Model>.corrects_part && !ListsPoles<Placement>) {
      return model.with_corrected_part(named, [&](const auto& part) {
        using Part = std::remove_cvref_t<decltype(part)>;
        constexpr int pairs = Part::own_pairs;
        constexpr int placed = Part::size - 2 * pairs;
        Array<detail::Contraction<S>, pairs> own{};
        for (std::size_t i = 0; i < own.size(); ++i) {
          own[i] = detail::contraction(S(part.pairs[i][0] * time), S(part.pairs[i][1] * time));
        }
        return take(
            part, with_pairs(pole_factors(Placement::template sample<placed, S>(spec, time)), own));
      });
    } else {
      return take(corrected_whole(model),
                  pole_factors(Placement::template sample<Size, S>(spec, time)));
    }
  }

  /// True if every error of the model decays with this gain.
  template <class Model>
  [[nodiscard]] static bool decays(const Model& model, const ScaledGain<Size, S>& gain) {
    const auto all = corrected_whole(model);
    return detail::PartDesign<Size, S, 1>::decays(all.step, all.output, gain);
  }

  /// k, scaled; the same for every innovation.
  /// @{
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain(const S&) const noexcept {
    return gains_[0];
  }
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain_before_measurement() const noexcept {
    return gains_[0];
  }
  /// @}

  /// k_M, the gain after a gap of M samples.
  [[nodiscard]] constexpr ScaledGain<Size, S> gap_gain(const S&, unsigned samples) const noexcept {
    constexpr auto most = static_cast<unsigned>(MostBridged);
    return gains_[static_cast<std::size_t>(detail::gain_of_step(samples < most ? samples : most))];
  }

  /// The largest number of missing samples that is bridged, at most `asked`.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    return asked < longest_step_ ? asked : longest_step_ - 1;
  }

  /// What a correction after `samples` means for the next gap beyond `longest_gap`, see
  /// GainLawTraits.
  [[nodiscard]] constexpr int recovery(unsigned samples, int lane = 0) const noexcept {
    constexpr int never = detail::GapRecovery<double>::never;
    const auto most = [&](const auto& steps) {
      return static_cast<unsigned>(detail::of_lane(steps, lane));
    };
    if (samples <= most(counted_)) return -1;
    if (samples <= most(longest_step_)) return 0;
    if (samples > static_cast<unsigned>(MostBridged)) return never;
    const auto& dues = detail::of_lane(due_, lane);
    const int due = dues[static_cast<std::size_t>(detail::gain_of_step(samples))];
    return due < 65535 ? due : never;
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 4;
  static constexpr int gains_count = detail::gain_of_step(MostBridged) + 1;

  ModelGain() = default;

  template <int Part, int Pairs>
  static detail::PartDesign<Part, S, MostBridged> designed(
      const CorrectedPart<Part, Size, Pairs, S>& part, const PoleFactors<Part, S>& poles) {
    return {part.step, part.output, part.degrees, poles};
  }

  Array<ScaledGain<Size, S>, gains_count> gains_{};
  Lanes<int, S> longest_step_{1};
  Lanes<int, S> counted_{1};
  Lanes<Array<std::uint16_t, gains_count>, S> due_{};
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, class Placement, int MostBridged>
inline constexpr std::uint32_t type_tag<ModelGain<Size, S, Placement, MostBridged>> =
    make_type_tag<S, Placement>("ModelGain", Size, MostBridged);

}  // namespace esokit
