/// @file
/// Packed: as many objects of a type as a pack has lanes, as one object.
#pragma once

#include <concepts>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/pack.hpp>
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

/// The results of f(i) for each lane of S, put together as packs.
template <class S, class Function>
constexpr auto of_all_lanes(Function&& f) noexcept {
  using Result = std::remove_cvref_t<decltype(f(0))>;
  if constexpr (std::is_void_v<Result>) {
    for (int i = 0; i < lane_count<S>; ++i) f(i);
  } else {
    typename OfPacks<Result, S>::type results{};
    for (int i = 0; i < lane_count<S>; ++i) set_lane(results, f(i), i);
    return results;
  }
}

/// A T whose form on packs computes all lanes at once. A class that is derived from one of the
/// library inherits the form of that one, which does what that one does: the form's plain one has
/// to be T.
template <class T, class S>
concept ComputesPacks = LaneAccess::has_members<T> && requires {
  typename T::template with_scalar<S>;
  requires std::same_as<typename T::template with_scalar<S>::template with_scalar<LaneScalar<S>>,
                        T>;
};

/// One T for each lane.
template <class T, class S>
struct OneByOne {
  Array<T, lane_count<S>> lanes;
};

template <class T, class S>
struct PackedForm {
  using type = OneByOne<T, S>;
};
template <class T, class S>
requires ComputesPacks<T, S>
struct PackedForm<T, S> {
  using type = typename T::template with_scalar<S>;
};

/// What a form declares.
template <class Form>
struct PackedTraits {};
template <class Form>
requires requires {
  Form::traits;
  Form::order;
}
struct PackedTraits<Form> {
  static constexpr auto traits = Form::traits;  ///< as of T
  static constexpr int order = Form::order;     ///< as of T
};

}  // namespace detail

/// `Lanes` objects of type T as one, each with its own settings, faults, gaps and status. Each lane
/// gives the results of a T alone, bit for bit with -ffp-contract=off (the compiler must not fuse
/// products and sums).
///
///     using Four = esokit::Packed<esokit::LinearEso<2>, 4>;
///     auto four = Four::make([](int lane) {
///       return esokit::LinearEso<2>::Config{.observer_bandwidth = 50.0 + 10.0 * lane,
///                                           .input_gain = 1.0, .sample_time = 1e-3};
///     }).value();
///     const auto status = four.update(y, u);  // y and u are Pack<double, 4>, status[i] is of a
///     lane
///
/// Where the type can, all lanes are computed at once (`at_once`): the linear, cascade, adjustable,
/// nonlinear and algebraic observers, `ModelEso`, `PlantEso`, `ExtendedStateFilter`, these in
/// `DelayedInput`, `Adrc` and `DisturbanceCompensator` of all these, laws, limiter and plants. If a
/// lane has a bad sample or a gap, a start hold or a measurement divider, or if lanes differ in the
/// delay, the lanes of this step go one by one. All other types go lane by lane: the other
/// adapters, a `ModelEso` that follows a speed, `PredictiveAdrc`, `MimoAdrc`, the differentiators,
/// your own. A pack of them costs as much as its lanes together.
///
/// What T has besides the members below is called through `each`, of one lane through a copy of it,
/// `packed[i]`.
/// @tparam T type of a lane, of float or double @tparam Lanes see Pack
template <class T, int Lanes = default_lanes<typename T::scalar_type>>
class Packed : public detail::PackedTraits<
                   typename detail::PackedForm<T, Pack<typename T::scalar_type, Lanes>>::type> {
  using One = typename T::scalar_type;
  using Form = typename detail::PackedForm<T, Pack<One, Lanes>>::type;
  using Indices = std::make_integer_sequence<int, Lanes>;

 public:
  using scalar_type = Pack<One, Lanes>;  ///< type of signals
  using Plain = T;                       ///< type of a lane
  static constexpr int lanes = Lanes;    ///< number of lanes

  /// Whether all lanes are computed at once while all is well.
  static constexpr bool at_once = detail::ComputesPacks<T, scalar_type>;

  using Together = Form;  ///< all lanes as one object of packs, if they are computed at once

  /// Takes the objects lane(0), lane(1), ..
  template <class Function>
  requires std::convertible_to<std::invoke_result_t<const Function&, int>, T>
  explicit constexpr Packed(const Function& lane) noexcept : Packed(lane, Indices{}) {}

  /// The same object in every lane.
  explicit constexpr Packed(const T& one) noexcept
      : Packed([&](int) -> const T& { return one; }, Indices{}) {}

  /// Checks the settings and does all the design work, lane by lane.
  /// @param config lane -> its Config @return the pack, or an error that names field and lane
  template <std::invocable<int> Function>
  static Expected<Packed, Error<One>> make(const Function& config) {
    const Expected<T, Error<One>> first = T::make(config(0));
    if (!first) return of(first.error(), 0);
    Packed all(*first);
    for (int i = 1; i < Lanes; ++i) {
      const Expected<T, Error<One>> one = T::make(config(i));
      if (!one) return of(one.error(), i);
      all.set(i, *one);
    }
    return all;
  }
  /// Does not compile: there is no common config.
  template <class Lane = T>
  static Expected<Packed, Error<One>> make(const typename Lane::Config&) {
    static_assert(!std::same_as<Lane, T>,
                  "esokit: Packed::make takes a function that gives each lane its config: "
                  "make([](int lane) { return Config{..}; })");
  }

  /// New settings while running: taken by all lanes or, on an error, by none.
  /// @param config lane -> its Config
  template <class Function>
  Check<One> retune(const Function& config) {
    return all_or_none([&](T& lane, int i) { return lane.retune(config(i)); });
  }

  /// The same with the settings of `fresh`, as returned by `make`.
  Check<One> adopt(const Packed& fresh) {
    return all_or_none([&](T& lane, int i) { return lane.adopt(fresh[i]); });
  }

  /// Calls f(lane, i) for each lane: of all lanes or, if one returns an error, of none.
  template <class Function>
  Check<One> all_or_none(const Function& f) {
    Packed next = *this;
    for (int i = 0; i < Lanes; ++i) {
      T lane = next[i];
      if (const auto ok = f(lane, i); !ok) return of(ok.error(), i);
      next.set(i, lane);
    }
    *this = next;
    return {};
  }

  /// A copy of lane `i`.
  [[nodiscard]] constexpr T operator[](int i) const noexcept {
    if constexpr (at_once) {
      return detail::get_lane<T>(form_, i);
    } else {
      return form_.lanes[static_cast<std::size_t>(i)];
    }
  }

  /// Lane `i` becomes `one`.
  constexpr void set(int i, const T& one) noexcept {
    if constexpr (at_once) {
      detail::set_lane(form_, one, i);
    } else {
      form_.lanes[static_cast<std::size_t>(i)] = one;
    }
  }

  /// Calls f(lane, i) for each lane, one after the other. @return the results of all lanes:
  /// numbers, vectors and matrices as those of packs, all else as a PerLane @{
  template <class Function>
  constexpr auto each(const Function& f) noexcept {
    return detail::of_all_lanes<scalar_type>([&](int i) {
      if constexpr (at_once) {
        struct Changed {
          Packed& all;
          int i;
          T lane = all[i];
          ~Changed() { all.set(i, lane); }
        } one{*this, i};
        return f(one.lane, i);
      } else {
        return f(form_.lanes[static_cast<std::size_t>(i)], i);
      }
    });
  }
  template <class Function>
  [[nodiscard]] constexpr auto each(const Function& f) const noexcept {
    return detail::of_all_lanes<scalar_type>([&](int i) {
      if constexpr (at_once) {
        const T lane = (*this)[i];
        return f(lane, i);
      } else {
        return f(form_.lanes[static_cast<std::size_t>(i)], i);
      }
    });
  }
  /// @}

  /// One sample, as of T: of an observer (y, u), of a controller (y, reference). @{
  template <class... Given>
  ESOKIT_INLINE auto update(const Given&... given) noexcept requires requires(T& lane) {
    lane.update(detail::lane_of<scalar_type>(given, 0)...);
  }
  {
    using Result =
        ResultOf<decltype(std::declval<T&>().update(detail::lane_of<scalar_type>(given, 0)...))>;
    if constexpr (steps) {
      const bool advanced = Access::advance(form_);
      if (advanced) [[likely]] {
        Result result{};
        if constexpr (std::is_same_v<Result, scalar_type>) {
          if (Access::step(form_, result, given...)) [[likely]]
            return result;
        } else {
          if (Access::step(form_, given...)) [[likely]]
            return result;
        }
      }
      return update_lanes(advanced, given...);
    } else {
      return each(
          [&](T& lane, int i) { return lane.update(detail::lane_of<scalar_type>(given, i)...); });
    }
  }
  template <class... Given>
  auto predict(const Given&... given) noexcept requires requires(T& lane) {
    lane.predict(detail::lane_of<scalar_type>(given, 0)...);
  }
  {
    using Result =
        ResultOf<decltype(std::declval<T&>().predict(detail::lane_of<scalar_type>(given, 0)...))>;
    if constexpr (steps) {
      const bool advanced = Access::advance_predict(form_);
      if (advanced && Access::predict_all(form_, given...)) [[likely]]
        return Result{};
      return each([&](T& lane, int i) {
        if constexpr (Access::advances<T>) {
          if (advanced) {
            return Access::predict_advanced(lane, detail::lane_of<scalar_type>(given, i)...);
          }
        }
        return lane.predict(detail::lane_of<scalar_type>(given, i)...);
      });
    } else {
      return each(
          [&](T& lane, int i) { return lane.predict(detail::lane_of<scalar_type>(given, i)...); });
    }
  }
  template <class... Given>
  auto correct(const Given&... given) noexcept requires requires(T& lane) {
    lane.correct(detail::lane_of<scalar_type>(given, 0)...);
  }
  {
    using Result =
        ResultOf<decltype(std::declval<T&>().correct(detail::lane_of<scalar_type>(given, 0)...))>;
    if constexpr (steps) {
      if (Access::correct_all(form_, given...)) [[likely]]
        return Result{};
    }
    return each(
        [&](T& lane, int i) { return lane.correct(detail::lane_of<scalar_type>(given, i)...); });
  }
  /// @}

  /// As of T, in each lane.
  /// @{
#define ESOKIT_EACH_LANE(name)                                                                 \
  template <class... Given>                                                                    \
  auto name(const Given&... given) noexcept requires requires(T & lane) {                      \
    lane.name(detail::lane_of<scalar_type>(given, 0)...);                                      \
  }                                                                                            \
  {                                                                                            \
    return each(                                                                               \
        [&](T& lane, int i) { return lane.name(detail::lane_of<scalar_type>(given, i)...); }); \
  }
  ESOKIT_EACH_LANE(update_without_measurement)
  ESOKIT_EACH_LANE(control)
  ESOKIT_EACH_LANE(prepare)
  ESOKIT_EACH_LANE(applied)
  ESOKIT_EACH_LANE(start)
  ESOKIT_EACH_LANE(reset)
#undef ESOKIT_EACH_LANE
  /// @}

  /// All lanes as one object of packs, to be read.
  [[nodiscard]] constexpr const Together& together() const noexcept requires at_once {
    return form_;
  }
  /// The observer of a controller, of packs.
  [[nodiscard]] constexpr const auto& observer() const noexcept requires at_once &&
      requires(const Together& form) {
    form.observer();
  }
  { return form_.observer(); }

  /// What all lanes say: numbers as packs, all else as a PerLane.
  /// @{
#define ESOKIT_OF_EACH_LANE(name)                                                       \
  [[nodiscard]] decltype(auto) name() const noexcept requires requires(const T& lane) { \
    lane.name();                                                                        \
  }                                                                                     \
  {                                                                                     \
    if constexpr (at_once) {                                                            \
      return form_.name();                                                              \
    } else {                                                                            \
      return each([](const T& lane, int) { return lane.name(); });                      \
    }                                                                                   \
  }
  ESOKIT_OF_EACH_LANE(estimate)
  ESOKIT_OF_EACH_LANE(total_disturbance)
  ESOKIT_OF_EACH_LANE(missed)
  ESOKIT_OF_EACH_LANE(output)
  ESOKIT_OF_EACH_LANE(status)
  ESOKIT_OF_EACH_LANE(mode)
  ESOKIT_OF_EACH_LANE(sample_time)
#undef ESOKIT_OF_EACH_LANE
  /// @}

 private:
  template <class Function, int... Index>
  constexpr Packed(const Function& lane, std::integer_sequence<int, Index...>) noexcept
      : form_([&] {
          if constexpr (at_once) {
            auto form = detail::blank<Form>();
            for (int i = 0; i < Lanes; ++i) detail::set_lane(form, T(lane(i)), i);
            return form;
          } else {
            return Form{{lane(Index)...}};
          }
        }()) {}

  using Access = detail::LaneAccess;
  /// Your own type may have a form on packs without a step of its own: its lanes go one by one.
  static constexpr bool steps = at_once && Access::steps<Form>;
  template <class Result>
  using ResultOf = typename detail::OfPacks<Result, scalar_type>::type;

  template <class... Given>
  ESOKIT_COLD auto update_lanes([[maybe_unused]] bool advanced, const Given&... given) noexcept {
    return each([&](T& lane, int i) {
      if constexpr (Access::advances<T>) {
        if (advanced) {
          return Access::update_advanced(lane, detail::lane_of<scalar_type>(given, i)...);
        }
      }
      return lane.update(detail::lane_of<scalar_type>(given, i)...);
    });
  }

  static Error<One> of(Error<One> error, int lane) {
    error.lane = lane;
    return error;
  }

  Form form_;
};

}  // namespace esokit
