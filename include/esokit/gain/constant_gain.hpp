/// @file
/// The constant gain law of the linear observers, sampled and continuous.
#pragma once

#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/model/chain_model.hpp>

namespace esokit {

/// Constant gain from a placement, with the gain for M T after a gap of M samples.
template <int Size, Scalar S, class Placement = EqualPoles>
class ConstantGain {
 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{
      .kind = GainKind::preset, .bridges_gaps = true, .recovers = true};
  using Spec = typename Placement::template Spec<Size, LaneScalar<S>>;  ///< bandwidth or poles
  template <class T>
  using with_scalar = ConstantGain<Size, T, Placement>;  ///< the same with another scalar

  /// The same as the overload below, with the sample time of `chain`.
  template <class Chain>
  static Expected<ConstantGain, Error<S>> make(const char* field, const Spec& spec,
                                               const Chain& chain,
                                               int index = -1) requires requires {
    chain.sample_time();
  }
  { return make(field, spec, chain.sample_time(), index); }

  /// The gain for a set of poles.
  /// @param field name of the config member that holds `spec`, for the error
  /// @param spec poles of the error, checked by the placement
  /// @param sample_time T, s; already checked
  /// @param index element of `field` that the error names, -1: none
  /// @return error for a spec that the placement refuses, or a gain that the scalar cannot hold
  static Expected<ConstantGain, Error<S>> make(const char* field, const Spec& spec,
                                               const S& sample_time, int index = -1) {
    Rules<S> rules;
    rules.all_of(Placement::template validate<Size, S>(field, spec, index));
    if (!rules) return rules.error();
    ConstantGain law;
    law.poles_ = Placement::template sample<Size, S>(spec, sample_time);
    law.gain_ = current_gain<Size, S>(law.poles_.weights());
    if constexpr (ListsPoles<Placement>) {
      law.proven_ = Placement::template recovery<Size, S>(law.poles_);
    }
    // The last gain is prod(1 - rho_i) / (N-1)!, the smallest one for slow poles.
    rules.representable(field, Placement::template representative<Size, S>(spec),
                        law.gain_[Size - 1],
                        "times sample_time gives a gain that the scalar cannot hold", index);
    if (!rules) return rules.error();
    return law;
  }

  /// k, scaled; the same for every innovation.
  /// @{
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain(const S&) const noexcept { return gain_; }

  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain_before_measurement() const noexcept {
    return gain_;
  }
  /// @}

  /// Gain for a gap: places the poles of the step over `samples` T at rho_i^samples, scaled with T.
  [[nodiscard]] ScaledGain<Size, S> gap_gain(const S&, unsigned samples) const noexcept {
    return esokit::gap_gain<Size, S>(poles_, samples);
  }

  /// The largest number of missing samples, at most `asked`, up to which errors decay in any
  /// sequence of gaps.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    const int longest = proven().longest_step;
    return asked < longest ? asked : longest - 1;
  }

  /// What a correction after `samples` means for the next gap beyond `longest_gap`, see
  /// GainLawTraits.
  [[nodiscard]] constexpr int recovery(unsigned samples, int lane = 0) const noexcept {
    return proven(lane).due_after(samples);
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 3;

  ConstantGain() = default;

  /// By a bandwidth it takes some products to find; of a list of poles it is kept.
  [[nodiscard]] constexpr auto proven(int lane = 0) const noexcept {
    const auto& poles = detail::of_lane(poles_, lane);
    if constexpr (ListsPoles<Placement>) {
      return detail::of_lane(proven_, lane);
    } else if constexpr (requires { Placement::template recovery<Size, LaneScalar<S>>(poles); }) {
      return Placement::template recovery<Size, LaneScalar<S>>(poles);
    } else {
      return Recovery{};
    }
  }

  using Recovery = detail::GapRecovery<detail::TableScalar<S>>;
  struct Nothing {};
  ScaledGain<Size, S> gain_{};
  Lanes<typename Placement::template Sampled<Size, LaneScalar<S>>, S> poles_{};
  [[no_unique_address]] std::conditional_t<ListsPoles<Placement>, Lanes<Recovery, S>, Nothing>
      proven_{};
};

template <int Size, Scalar S, class Placement = EqualPoles, int MostBridged = 401>
class ModelGain;  // gain/model_gain.hpp, to be included with a model other than the chain

template <int Size, Scalar S, class Placement = EqualPoles, int Count = 9, int MostBridged = 16>
class ScheduledGain;  // gain/scheduled_gain.hpp, with a model that follows a speed

namespace detail {

/// Gap that is bridged by a law with varying gains, which has the gap gain of `linear`: half the
/// step.
template <class Linear>
constexpr int half_gap(const Linear& linear, int asked) noexcept {
  const int step = (linear.longest_gap(most_bridged) + 1) / 2;
  return asked < step ? asked : (step > 1 ? step - 1 : 0);
}

}  // namespace detail

/// The constant gain law for a model: ConstantGain for the chain, else ModelGain or ScheduledGain.
template <class Model, int Size, Scalar S, class Placement>
using ConstantGainOf = std::conditional_t<
    model_traits<Model>.is_chain, ConstantGain<Size, S, Placement>,
    std::conditional_t<model_traits<Model>.follows_speed, ScheduledGain<Size, S, Placement>,
                       ModelGain<Size, S, Placement>>>;

namespace detail {

/// Has the interface of an Expected, but always holds a value: for designs that cannot fail.
template <class T, class S>
struct Certain {
  T value;
  constexpr explicit operator bool() const noexcept { return true; }
  constexpr const T& operator*() const noexcept { return value; }
  [[nodiscard]] constexpr Error<S> error() const noexcept { return {}; }
};

/// Makes the model of a config that was checked.
template <class Model, class Config>
auto make_model(const Config& config) {
  using S = std::remove_cvref_t<decltype(config.input_gain)>;
  if constexpr (model_traits<Model>.is_chain) {
    return Certain<Model, S>{Model(config.input_gain, config.sample_time)};
  } else if constexpr (requires { config.plant_model; }) {
    return Model::make(config.plant_model, config.input_gain, config.sample_time);
  } else {
    return Model::make(config.model, config.input_gain, config.sample_time);
  }
}

/// The law for a config with a bandwidth or poles. @param chain the chain, for a sampled observer
template <class Law, class Config, class... Chain>
auto placed_law(const Config& config, const Chain&... chain) {
  if constexpr (requires { config.poles; }) {
    return Law::make("poles", config.poles, chain...);
  } else {
    return Law::make("observer_bandwidth", config.observer_bandwidth, chain...);
  }
}

}  // namespace detail

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, class Placement>
inline constexpr std::uint32_t type_tag<ConstantGain<Size, S, Placement>> =
    make_type_tag<S, Placement>("ConstantGain", Size);

}  // namespace esokit
