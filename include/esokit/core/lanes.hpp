/// @file
/// The lanes of a pack and of objects made of packs: how an observer of packs is split into plain
/// ones and put together again. `Packed` (core/packed.hpp) is such an object for any type.
///
/// In normal operation an observer of packs computes with packs. If one lane has a bad sample, a
/// gap or a restart, each lane goes through the observer of the plain scalar. So fault handling is
/// written once, and each lane behaves exactly like a plain observer.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>

namespace esokit {

/// One value for each lane, for types that are not numbers (flags, counts).
template <class T, int Count>
struct PerLane {
  Array<T, Count> values{};  ///< of lane 0, 1, ..

  constexpr PerLane() noexcept = default;
  /// The same in every lane.
  constexpr PerLane(T value) noexcept { values.fill(value); }
  /// Converted.
  template <class Other>
  constexpr PerLane(const PerLane<Other, Count>& others) noexcept {
    for (int i = 0; i < Count; ++i) (*this)[i] = others[i];
  }

  /// The value of a lane.
  /// @{
  [[nodiscard]] constexpr T& operator[](int lane) noexcept {
    return values[static_cast<std::size_t>(lane)];
  }
  [[nodiscard]] constexpr const T& operator[](int lane) const noexcept {
    return values[static_cast<std::size_t>(lane)];
  }
  /// @}

  /// True if each lane holds the value; without a copy of it in memory.
  ESOKIT_INLINE friend constexpr bool operator==(const PerLane& a, const T& value) noexcept
      requires(std::has_unique_object_representations_v<T> && sizeof(T) <= 2) {
    using Bits = std::conditional_t<sizeof(T) == 1, std::uint8_t, std::uint16_t>;
    const auto words = std::bit_cast<Words>(a);
    constexpr Word ones =
        sizeof(Word) == sizeof(T) ? Word(1) : static_cast<Word>(static_cast<Word>(-1) / Bits(-1));
    const auto same = static_cast<Word>(ones * std::bit_cast<Bits>(value));
    Word differs = 0;
    for (const Word& word : words) differs = static_cast<Word>(differs | (word ^ same));
    return differs == 0;
  }
  /// Gives each lane the value.
  constexpr PerLane& operator=(T value) noexcept {
    values.fill(value);
    return *this;
  }

  /// True if all lanes are equal.
  ESOKIT_INLINE friend constexpr bool operator==(const PerLane& a, const PerLane& b) noexcept {
    if constexpr (std::has_unique_object_representations_v<PerLane>) {
      const auto of_a = std::bit_cast<Words>(a);
      const auto of_b = std::bit_cast<Words>(b);
      Word differs = 0;
      for (std::size_t i = 0; i < of_a.size(); ++i) {
        differs = static_cast<Word>(differs | (of_a[i] ^ of_b[i]));
      }
      return differs == 0;
    } else {
      return a.values == b.values;
    }
  }

  /// Whether all lanes hold the same; of integers.
  ESOKIT_INLINE friend constexpr bool agree(const PerLane& each) noexcept {
    const auto words = std::bit_cast<Words>(each);
    auto differs = static_cast<Word>(words[0] ^ std::rotl(words[0], 8 * int{sizeof(T)}));
    for (const Word& word : words) differs = static_cast<Word>(differs | (word ^ words[0]));
    return differs == 0;
  }

 private:
  // Compared as machine words: for an array compilers call memcmp.
  using Word =
      std::conditional_t<sizeof(T) * Count % 8 == 0, std::uint64_t,
                         std::conditional_t<sizeof(T) * Count % 4 == 0, std::uint32_t,
                                            std::conditional_t<sizeof(T) * Count % 2 == 0,
                                                               std::uint16_t, std::uint8_t>>>;
  using Words = std::array<Word, sizeof(T) * Count / sizeof(Word)>;
};

/// One T for each lane of S: T itself if S is a plain scalar.
template <class T, class S>
using Lanes = std::conditional_t<lane_count<S> == 1, T, PerLane<T, lane_count<S>>>;

namespace detail {

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

/// Converts to a member of any type. Not to an optional: that is made of what it holds, and both
/// ways would be ambiguous.
struct AnyMember {
  template <class T>
  requires(!IsOptional<T>::value) operator T() const;
};
/// The number of data members of an aggregate.
template <class T, class... Given>
consteval int count_members() {
  constexpr bool takes_these = requires { T{std::declval<Given>()...}; };
  constexpr bool takes_one_more = requires { T{std::declval<Given>()..., AnyMember{}}; };
  if constexpr (takes_these && !takes_one_more) {
    return sizeof...(Given);
  } else {
    return count_members<T, Given..., AnyMember>();
  }
}

template <class Base, class Rest>
struct WithRest : Base {
  Rest rest;
};

/// Access to the data members of a class, so that it can be split into lanes. Nobody lists them:
/// structured bindings name them, and do not compile if one is missing. An aggregate needs nothing
/// for it. Any other class declares how many there are, `data_members`, and has this as a friend. A
/// class that adds data to those of its `Base` has all of them in an aggregate `rest_`.
struct LaneAccess {
  template <class Object>
  static constexpr bool adds_rest = requires(Object& object) {
    typename Object::Base;
    object.rest_;
  };
  template <class Object>
  static constexpr bool counts = requires {
    Object::data_members;
  };
  template <class Object>
  static constexpr bool has_members = counts<std::remove_const_t<Object>> ||
                                      (std::is_aggregate_v<Object> && std::is_class_v<Object> &&
                                       !requires(Object & object) { object[0]; });
  /// Whether the class itself says that `with_members` finds all its data. Not an aggregate: one of
  /// a user may hold what cannot be named, such as an array of C.
  template <class Object>
  static constexpr bool names_members = [] {
    if constexpr (adds_rest<Object>) {
      return true;
    } else if constexpr (requires { typename Object::HoldsMembers; }) {
      return sizeof(Object) == sizeof(typename Object::HoldsMembers);  // a base, and nothing more
    } else {
      return counts<Object>;
    }
  }();
  template <class Object>
  static constexpr bool steps = requires(Object& object) {
    object.advance();
  };
  /// Whether `advance` changes something: if not, `update_advanced` is `update`.
  template <class Object>
  static constexpr bool advances = [] {
    if constexpr (requires { Object::advances; }) {
      return Object::advances;
    } else {
      return true;
    }
  }();
  /// function(all data members).
  template <class Object, class Function>
  ESOKIT_INLINE static constexpr auto with_members(Object& object, const Function& function) {
    using T = std::remove_const_t<Object>;
    if constexpr (adds_rest<Object>) {
      using Base =
          std::conditional_t<std::is_const_v<Object>, const typename T::Base, typename T::Base>;
      static_assert(sizeof(T) == sizeof(WithRest<typename T::Base, decltype(object.rest_)>),
                    "esokit: all data that a class adds to its base belongs to `rest_`");
      return function(static_cast<Base&>(object), object.rest_);
    } else {
      constexpr int count = [] {
        if constexpr (counts<T>) {
          return T::data_members;
        } else {
          return count_members<T>();
        }
      }();
      static_assert(count <= 19 || count == 21,
                    "esokit: a class of more data members needs more bindings here");
/// @cond
#define ESOKIT_BIND(number, ...)   \
  if constexpr (count == number) { \
    auto& [__VA_ARGS__] = object;  \
    return function(__VA_ARGS__);  \
  }
      ESOKIT_BIND(1, a)
      ESOKIT_BIND(2, a, b)
      ESOKIT_BIND(3, a, b, c)
      ESOKIT_BIND(4, a, b, c, d)
      ESOKIT_BIND(5, a, b, c, d, e)
      ESOKIT_BIND(6, a, b, c, d, e, f)
      ESOKIT_BIND(7, a, b, c, d, e, f, g)
      ESOKIT_BIND(8, a, b, c, d, e, f, g, h)
      ESOKIT_BIND(9, a, b, c, d, e, f, g, h, i)
      ESOKIT_BIND(10, a, b, c, d, e, f, g, h, i, j)
      ESOKIT_BIND(11, a, b, c, d, e, f, g, h, i, j, k)
      ESOKIT_BIND(12, a, b, c, d, e, f, g, h, i, j, k, l)
      ESOKIT_BIND(13, a, b, c, d, e, f, g, h, i, j, k, l, m)
      ESOKIT_BIND(14, a, b, c, d, e, f, g, h, i, j, k, l, m, n)
      ESOKIT_BIND(15, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o)
      ESOKIT_BIND(16, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p)
      ESOKIT_BIND(17, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q)
      ESOKIT_BIND(18, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r)
      ESOKIT_BIND(19, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s)
      ESOKIT_BIND(21, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u)
#undef ESOKIT_BIND
      /// @endcond
    }
  }
  /// Not constrained friend templates: Clang 16 takes their constraints for those of another
  /// template.
#define ESOKIT_FOR_PACKS(name)                                                          \
  template <class Object, class... Given>                                               \
  ESOKIT_INLINE static constexpr auto name(Object& object, Given&&... given) noexcept { \
    return object.name(given...);                                                       \
  }
  ESOKIT_FOR_PACKS(advance)          // a form on packs: whether all lanes can go on with `step`
  ESOKIT_FOR_PACKS(step)             // one sample of all lanes; false: it has changed nothing
  ESOKIT_FOR_PACKS(update_advanced)  // of a lane: `update` after `advance`
  ESOKIT_FOR_PACKS(advance_predict)  // the same for the time update ..
  ESOKIT_FOR_PACKS(predict_all)
  ESOKIT_FOR_PACKS(predict_advanced)
  ESOKIT_FOR_PACKS(correct_all)  // .. and for the measurement update
#undef ESOKIT_FOR_PACKS
};

struct RecordAccess;  // target/detail/record_access.hpp

/// A std::array or a Matrix.
template <class T>
concept HoldsElements = requires(T& elements) {
  elements.data()[elements.size() - 1];
};
template <class T>
struct IsTuple : std::false_type {};
template <class... T>
struct IsTuple<std::tuple<T...>> : std::true_type {};
/// Copies lane `i` of `packed` to `plain`, or back (`Back`). What is neither a pack nor a PerLane
/// is common to all lanes.
template <bool Back, class Packed, class Plain>
constexpr void copy_lane(Packed& packed, Plain& plain, int i) noexcept {
  if constexpr (std::is_empty_v<Packed>) {
    // Nothing to copy; the types in packed and plain objects may differ.
  } else if constexpr (std::is_same_v<std::remove_const_t<Packed>, std::remove_const_t<Plain>>) {
    if constexpr (Back) {
      packed = plain;
    } else {
      plain = packed;
    }
  } else if constexpr (HoldsElements<Packed>) {
    for (decltype(packed.size()) k = 0; k < packed.size(); ++k) {
      copy_lane<Back>(packed.data()[k], plain.data()[k], i);
    }
  } else if constexpr (IsOptional<std::remove_const_t<Packed>>::value) {
    if constexpr (!Back) {
      if (!packed) {
        plain.reset();
      } else {
        plain.emplace();
        copy_lane<Back>(*packed, *plain, i);
      }
    }
  } else if constexpr (IsTuple<std::remove_const_t<Packed>>::value) {
    constexpr auto count = std::tuple_size_v<std::remove_const_t<Packed>>;
    static_assert(count == std::tuple_size_v<std::remove_const_t<Plain>>);
    [&]<std::size_t... K>(std::index_sequence<K...>) {
      (copy_lane<Back>(std::get<K>(packed), std::get<K>(plain), i), ...);
    }
    (std::make_index_sequence<count>{});
  } else if constexpr (LaneAccess::has_members<Packed>) {
    LaneAccess::with_members(packed, [&](auto&... of_packed) ESOKIT_INLINE_LAMBDA {
      LaneAccess::with_members(plain, [&](auto&... of_plain) ESOKIT_INLINE_LAMBDA {
        (copy_lane<Back>(of_packed, of_plain, i), ...);
      });
    });
  } else if constexpr (Back) {
    packed[i] = static_cast<std::remove_cvref_t<decltype(packed[i])>>(plain);
  } else {
    plain = static_cast<Plain>(packed[i]);
  }
}

/// Lane `i` of `packed` becomes `plain`.
template <class Packed, class Plain>
constexpr void set_lane(Packed& packed, const Plain& plain, int i) noexcept {
  copy_lane<true>(packed, plain, i);
}

/// Object with the scalar T. Without a `type` if it has no such form: then no alias made of it has
/// one, and what prefers packs does without them.
template <class Object, class T>
struct WithScalarOf {};
template <class Object, class T>
requires requires { typename Object::template with_scalar<T>; }
struct WithScalarOf<Object, T> {
  using type = typename Object::template with_scalar<T>;
};
template <class Object, class T>
using WithScalar = typename WithScalarOf<Object, T>::type;

template <class Object, class S>
struct PlainTwinOf {
  using type = Object;
};
template <class Object, PackScalar S>
struct PlainTwinOf<Object, S> {
  static_assert(
      requires { typename Object::template with_scalar<LaneScalar<S>>; },
      "esokit: a type for packs needs `template <class T> using with_scalar`, the type with "
      "another scalar");
  using type = WithScalar<Object, LaneScalar<S>>;
};

/// The type of one lane of an Object with scalar S; for a plain scalar the Object itself.
template <class Object, class S>
using PlainTwin = typename PlainTwinOf<Object, S>::type;

/// The type of one lane of an observer or controller.
template <class Object>
using LaneOf = PlainTwin<Object, typename Object::scalar_type>;

/// A model or gain function with another scalar. One without `with_scalar` is used as it is for
/// every scalar.
/// @{
template <class Function, class T>
struct ForScalar {
  using type = Function;
};
template <class Function, class T>
requires requires { typename Function::template with_scalar<T>; }
struct ForScalar<Function, T> {
  using type = typename Function::template with_scalar<T>;
};
/// Whether a function is available with another scalar: it holds no data, or it has `with_scalar`.
template <class Function>
inline constexpr bool has_other_scalars = std::is_empty_v<Function> || requires {
  typename Function::template with_scalar<float>;
};
/// @}

/// The part of lane `i`: the element of a PerLane, else the object itself.
/// @{
template <class T>
[[nodiscard]] constexpr T& of_lane(T& one, int) noexcept {
  return one;
}
template <class T, int Count>
[[nodiscard]] constexpr T& of_lane(PerLane<T, Count>& each, int i) noexcept {
  return each[i];
}
template <class T, int Count>
[[nodiscard]] constexpr const T& of_lane(const PerLane<T, Count>& each, int i) noexcept {
  return each[i];
}
/// bits = (bits & keep) | set. For a PerLane in each lane, with all lanes in one machine word.
/// @{
constexpr void set_bits(std::int8_t& bits, int keep, int set) noexcept {
  bits = static_cast<std::int8_t>((bits & keep) | set);
}
template <int Count>
constexpr void set_bits(PerLane<std::int8_t, Count>& each, int keep, int set) noexcept {
  if constexpr (Count == 2 || Count == 4 || Count == 8) {
    using Word = std::conditional_t<Count == 8, std::uint64_t,
                                    std::conditional_t<Count == 4, std::uint32_t, std::uint16_t>>;
    constexpr auto ones = static_cast<Word>(0x0101010101010101u);
    const auto all = [](int bits) {
      return static_cast<Word>(ones * static_cast<Word>(bits & 255));
    };
    const auto word = std::bit_cast<Word>(each.values);
    each.values =
        std::bit_cast<Array<std::int8_t, Count>>(static_cast<Word>((word & all(keep)) | all(set)));
  } else {
    for (std::int8_t& bits : each.values) set_bits(bits, keep, set);
  }
}
/// @}
/// The number of lane `i`.
template <Scalar S>
[[nodiscard]] constexpr LaneScalar<S> number_of_lane(const S& numbers,
                                                     [[maybe_unused]] int i) noexcept {
  if constexpr (PackScalar<S>) {
    return numbers[i];
  } else {
    return numbers;
  }
}
/// @}

/// An object whose fields are still to be filled.
template <class T>
constexpr T blank() noexcept {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::bit_cast<T>(std::array<unsigned char, sizeof(T)>{});
}

/// Lane `i` of an observer, law or controller of packs, as an object of the plain scalar.
template <class Plain, class Packed>
[[nodiscard]] constexpr Plain get_lane(const Packed& packed, int i) noexcept {
  auto plain = blank<Plain>();
  copy_lane<false>(packed, plain, i);
  return plain;
}

/// Calls f(plain) for each lane of `packed` and stores the changed `plain` in it. What is plain
/// itself is its only lane.
template <class Plain, class Packed, class Function>
constexpr void for_each_lane(Packed& packed, const Function& f) noexcept {
  if constexpr (std::is_same_v<Plain, Packed>) {
    f(packed);
  } else {
    for (int i = 0; i < lane_count<typename Packed::scalar_type>; ++i) {
      Plain plain = get_lane<Plain>(packed, i);
      f(plain);
      set_lane(packed, plain, i);
    }
  }
}

}  // namespace detail
}  // namespace esokit
