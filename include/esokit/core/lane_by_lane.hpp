/// @file
/// LaneByLane: makes types that gain nothing from packs usable with packs, as one plain
/// object per lane.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <tuple>
#include <type_traits>
#include <utility>

namespace esokit {

namespace detail {

/// The type that holds one T for each lane of the pack S: numbers become packs, all else a PerLane.
template <class T, class S>
struct OfPacks {
  using type = PerLane<T, lane_count<S>>;
};
template <class T, class S>
requires std::same_as<T, LaneScalar<S>>
struct OfPacks<T, S> {
  using type = S;
};
template <class T, int Rows, int Columns, class S>
struct OfPacks<Matrix<T, Rows, Columns>, S> {
  using type = Matrix<typename OfPacks<T, S>::type, Rows, Columns>;
};
template <class T, std::size_t Count, class S>
struct OfPacks<std::array<T, Count>, S> {
  using type = std::array<typename OfPacks<T, S>::type, Count>;
};

/// The type of one lane of a T made of packs. What is neither made of packs nor a PerLane is common
/// to all lanes.
template <class T, class S>
struct OfLane {
  using type = T;
};
template <class S>
struct OfLane<S, S> {
  using type = LaneScalar<S>;
};
template <class T, int Count, class S>
struct OfLane<PerLane<T, Count>, S> {
  using type = T;
};
template <class T, int Rows, int Columns, class S>
struct OfLane<Matrix<T, Rows, Columns>, S> {
  using type = Matrix<typename OfLane<T, S>::type, Rows, Columns>;
};
template <class T, std::size_t Count, class S>
struct OfLane<std::array<T, Count>, S> {
  using type = std::array<typename OfLane<T, S>::type, Count>;
};

/// Lane `i` of an argument.
template <class S, class T>
constexpr typename OfLane<T, S>::type lane_of(const T& packed, int i) noexcept {
  typename OfLane<T, S>::type plain{};
  copy_lane<false>(packed, plain, i);
  return plain;
}

template <class T>
concept Retunable = requires(T& object, const T& fresh, const typename T::Config& config) {
  object.retune(config);
  object.adopt(fresh);
};

}  // namespace detail

/// Defines member functions of this name that call those of `Plain` in each lane.
#define ESOKIT_EACH_LANE(name)                                                \
  template <class... Given>                                                   \
  auto name(const Given&... given) noexcept requires requires(Plain & lane) { \
    lane.name(std::declval<const Lane<Given>&>()...);                         \
  }                                                                           \
  {                                                                           \
    return each(*this, [&](Plain& lane, [[maybe_unused]] int i) {             \
      return lane.name(detail::lane_of<S>(given, i)...);                      \
    });                                                                       \
  }                                                                           \
  template <class... Given>                                                   \
  [[nodiscard]] auto name(const Given&... given)                              \
      const noexcept requires requires(const Plain& lane) {                   \
    lane.name(std::declval<const Lane<Given>&>()...);                         \
  }                                                                           \
  {                                                                           \
    return each(*this, [&](const Plain& lane, [[maybe_unused]] int i) {       \
      return lane.name(detail::lane_of<S>(given, i)...);                      \
    });                                                                       \
  }

/// The same for functions with the row as a template argument.
#define ESOKIT_EACH_LANE_ROW(name)                                                        \
  template <int Row>                                                                      \
  [[nodiscard]] auto name() const noexcept requires requires(const Plain& lane) {         \
    lane.template name<Row>();                                                            \
  }                                                                                       \
  {                                                                                       \
    return each(*this, [](const Plain& lane, int) { return lane.template name<Row>(); }); \
  }

/// One `Plain` object for each lane of a pack, with the members of a single one: each call goes to
/// one lane after the other, arguments are split into lanes and results are put together as packs.
/// It has the members of `Plain` that are listed below.
///
/// For types that branch on measurements or do little arithmetic, where packs would not be faster.
/// It costs as much as its lanes one by one.
/// @tparam Self the class that derives from this one @tparam Plain type of a lane @tparam S the
/// pack
/// @tparam Settings its Config, of packs
template <class Self, class Plain, PackScalar S, class Settings>
class LaneByLane : public detail::GoesLaneByLane {
  static constexpr int count = lane_count<S>;
  template <class T>
  using Lane = typename detail::OfLane<T, S>::type;
  using Plains = Array<Plain, count>;

 public:
  using scalar_type = S;    ///< type of signals and settings
  using Config = Settings;  ///< settings of make

  /// Takes one finished object for each lane.
  constexpr explicit LaneByLane(const Plains& lanes) noexcept : lanes_(lanes) {}

  /// Checks the settings and does all the design work, lane by lane.
  /// @return the object, or an error that names field and lane
  static Expected<Self, Error<S>> make(const Config& config) {
    return [&]<int... I>(std::integer_sequence<int, I...>)->Expected<Self, Error<S>> {
      const Array<Expected<Plain, Error<LaneScalar<S>>>, count> made{
          Plain::make(settings(config, I))...};
      for (int i = 0; i < count; ++i) {
        const auto& lane = made[static_cast<std::size_t>(i)];
        if (!lane) return detail::in_lane<S>(lane.error(), i);
      }
      return Self(Plains{*std::get<I>(made)...});
    }
    (std::make_integer_sequence<int, count>{});
  }

  /// New settings while running: taken by all lanes or, on an error, by none.
  Check<S> retune(const Config& config) requires detail::Retunable<Plain> {
    return all_or_none(
        [&](Plain& lane, [[maybe_unused]] int i) { return lane.retune(settings(config, i)); });
  }

  /// The same with the settings of `fresh`, as returned by `make`.
  Check<S> adopt(const Self& fresh) requires detail::Retunable<Plain> {
    return all_or_none([&](Plain& lane, [[maybe_unused]] int i) { return lane.adopt(fresh[i]); });
  }

  /// One lane, to call its other members.
  [[nodiscard]] constexpr Plain& operator[](int lane) noexcept {
    return lanes_[static_cast<std::size_t>(lane)];
  }
  /// The same, read only.
  [[nodiscard]] constexpr const Plain& operator[](int lane) const noexcept {
    return lanes_[static_cast<std::size_t>(lane)];
  }

  /// As of a `Plain`.
  /// @{
  ESOKIT_EACH_LANE(update)
  ESOKIT_EACH_LANE(update_weighted)
  ESOKIT_EACH_LANE(update_without_measurement)
  ESOKIT_EACH_LANE(predict)
  ESOKIT_EACH_LANE(correct)
  ESOKIT_EACH_LANE(correct_weighted)
  ESOKIT_EACH_LANE(correct_some)
  ESOKIT_EACH_LANE(reset)
  ESOKIT_EACH_LANE(start)
  ESOKIT_EACH_LANE(track)
  ESOKIT_EACH_LANE(control)
  ESOKIT_EACH_LANE(control_without_measurement)
  ESOKIT_EACH_LANE(prepare)
  ESOKIT_EACH_LANE(set_reference)
  ESOKIT_EACH_LANE(report_applied)
  ESOKIT_EACH_LANE(shift_output)
  ESOKIT_EACH_LANE(shift_disturbance)
  ESOKIT_EACH_LANE(revise_input)
  ESOKIT_EACH_LANE(fill_input)
  ESOKIT_EACH_LANE(rearm)
  ESOKIT_EACH_LANE(hold)
  ESOKIT_EACH_LANE(release)
  ESOKIT_EACH_LANE(set_trust)
  ESOKIT_EACH_LANE(set_pin)
  ESOKIT_EACH_LANE(measured)
  ESOKIT_EACH_LANE(revise_measured)
  ESOKIT_EACH_LANE(settle_measured)
  ESOKIT_EACH_LANE(shift_load)

  ESOKIT_EACH_LANE(estimate)
  ESOKIT_EACH_LANE_ROW(estimate)
  ESOKIT_EACH_LANE_ROW(scaled_estimate)
  ESOKIT_EACH_LANE_ROW(chain_estimate)
  ESOKIT_EACH_LANE(level_estimate)
  ESOKIT_EACH_LANE(level_gain)
  ESOKIT_EACH_LANE(total_disturbance)
  ESOKIT_EACH_LANE(residual_disturbance)
  ESOKIT_EACH_LANE(known_part)
  ESOKIT_EACH_LANE(innovation)
  ESOKIT_EACH_LANE(innovation_covariance)
  ESOKIT_EACH_LANE(normalised_innovation)
  ESOKIT_EACH_LANE(covariance)
  ESOKIT_EACH_LANE(gain)
  ESOKIT_EACH_LANE(gains)
  ESOKIT_EACH_LANE(frozen)
  ESOKIT_EACH_LANE(equilibrium)
  ESOKIT_EACH_LANE(wrap)
  ESOKIT_EACH_LANE(period)
  ESOKIT_EACH_LANE(limit)
  ESOKIT_EACH_LANE(open)
  ESOKIT_EACH_LANE(step_time)
  ESOKIT_EACH_LANE(trust)
  ESOKIT_EACH_LANE(pin)
  ESOKIT_EACH_LANE(gated)
  ESOKIT_EACH_LANE(bounded)
  ESOKIT_EACH_LANE(holding_input)
  ESOKIT_EACH_LANE(input_factor)
  ESOKIT_EACH_LANE(present_input_gain)
  ESOKIT_EACH_LANE(applied_input)
  ESOKIT_EACH_LANE(input_gain)
  ESOKIT_EACH_LANE(sample_time)
  ESOKIT_EACH_LANE(missed)
  ESOKIT_EACH_LANE(restarts)
  ESOKIT_EACH_LANE(output)
  ESOKIT_EACH_LANE(requested)
  ESOKIT_EACH_LANE(blind_output)
  ESOKIT_EACH_LANE(status)
  ESOKIT_EACH_LANE(mode)
  ESOKIT_EACH_LANE(value)
  ESOKIT_EACH_LANE(derivative)
  ESOKIT_EACH_LANE(state)
  ESOKIT_EACH_LANE(rate)
  /// @}

  /// As of a `Plain`, with a list in the place of a vector.
  template <std::size_t Count, class... Given>
  auto update(const S& y, const S (&reference)[Count], const Given&... given) noexcept {
    return update(y, detail::listed(reference), given...);
  }
  /// As of a `Plain`, with a list in the place of a vector.
  template <std::size_t Count>
  auto update_without_measurement(const S (&reference)[Count]) noexcept {
    return update_without_measurement(detail::listed(reference));
  }
  /// As of a `Plain`, with a list in the place of a vector.
  template <std::size_t Count>
  auto prepare(const S (&reference)[Count]) noexcept {
    return prepare(detail::listed(reference));
  }
  /// As of a `Plain`, with a list in the place of a vector.
  template <std::size_t Count>
  void set_reference(const S (&reference)[Count]) noexcept {
    set_reference(detail::listed(reference));
  }
  /// As of a `Plain`, with a list in the place of a vector.
  template <std::size_t Count>
  auto reset(const S (&state)[Count]) noexcept {
    return reset(detail::listed(state));
  }

  /// Sets the length of the next step of each lane, s: of all lanes or, on an error, of none.
  template <class P = Plain>
  requires requires(P& lane, const LaneScalar<S>& seconds) { lane.set_step_time(seconds); }
  Check<S> set_step_time(const S& seconds) noexcept {
    return all_or_none(
        [&](Plain& lane, [[maybe_unused]] int i) { return lane.set_step_time(seconds[i]); });
  }

  /// Sets b0 of each lane from the next sample on: of all lanes or, on an error, of none.
  template <class P = Plain>
  requires requires(P& lane, const LaneScalar<S>& b) { lane.set_input_gain(b); }
  Check<S> set_input_gain(const S& b) noexcept {
    return all_or_none(
        [&](Plain& lane, [[maybe_unused]] int i) { return lane.set_input_gain(b[i]); });
  }

  /// The same for B0. @param b0 q x q
  template <class B, class P = Plain>
  requires requires(P& lane) { typename P::InputMatrix; }
  Check<S> set_input_matrix(const B& b0) noexcept {
    return all_or_none([&](Plain& lane, int i) {
      return lane.set_input_matrix(detail::get_lane<typename P::InputMatrix>(b0, i));
    });
  }

  /// The longest gap that every lane bridges; with a model some lanes may bridge more.
  [[nodiscard]] int max_gap() const noexcept requires requires(const Plain& lane) {
    lane.max_gap();
  }
  {
    int most = lanes_[0].max_gap();
    for (const Plain& lane : lanes_) most = lane.max_gap() < most ? lane.max_gap() : most;
    return most;
  }
  /// The delay, which is the same for all lanes.
  [[nodiscard]] int delay() const noexcept requires requires(const Plain& lane) { lane.delay(); }
  { return lanes_[0].delay(); }

 protected:
  /// The results of f(lane, i) of all lanes, put together as packs.
  template <class All, class Function>
  static auto each(All& all, Function&& f) noexcept {
    using Result = std::remove_cvref_t<decltype(f(all.lanes_[0], 0))>;
    if constexpr (std::is_void_v<Result>) {
      for (int i = 0; i < count; ++i) f(all.lanes_[static_cast<std::size_t>(i)], i);
    } else {
      typename detail::OfPacks<Result, S>::type results{};
      for (int i = 0; i < count; ++i) {
        detail::set_lane(results, f(all.lanes_[static_cast<std::size_t>(i)], i), i);
      }
      return results;
    }
  }

  /// Puts the objects f(lane) of all lanes together as one `Whole` of packs.
  template <class Whole, class Function>
  [[nodiscard]] Whole gathered(Function&& f) const noexcept {
    Whole all = detail::blank<Whole>();
    for (int i = 0; i < count; ++i) detail::set_lane(all, f((*this)[i]), i);
    return all;
  }

 private:
  static auto settings(const Config& config, int i) {
    typename Plain::Config lane{};
    detail::copy_lane<false>(config, lane, i);
    return lane;
  }

  template <class Function>
  Check<S> all_or_none(Function&& f) {
    Plains next = lanes_;
    for (int i = 0; i < count; ++i) {
      if (auto ok = f(next[static_cast<std::size_t>(i)], i); !ok) {
        return detail::in_lane<S>(ok.error(), i);
      }
    }
    lanes_ = next;
    return {};
  }

  Plains lanes_;
};

#undef ESOKIT_EACH_LANE
#undef ESOKIT_EACH_LANE_ROW

}  // namespace esokit
