/// @file
/// Traits that a type declares in one place, and the check that the type has what it
/// declares.
///
/// A type declares what it can do in a static constant `traits`; without it the defaults apply. A
/// member is never called only because it has the name of a hook (an optional member function). A
/// member with such a name that is not declared is a mistake, and so is a declared hook that is
/// missing.
#pragma once

#include <concepts>
#include <esokit/core/language.hpp>
#include <type_traits>

namespace esokit::detail {

template <auto>
struct Constant;

/// Defines `names_NAME<T>`: T has a member of this name, of any kind, even overloaded or private.
// Looks the name up in a class that inherits from T and from a class with a member of that name: if
// T has one too, the lookup is ambiguous and fails.
#define ESOKIT_MEMBER_NAME(name)                               \
  struct Naming_##name {                                       \
    int name;                                                  \
  };                                                           \
  template <class T>                                           \
  struct NamingTwice_##name : T, Naming_##name {};             \
  template <class T>                                           \
  inline constexpr bool names_##name = [] {                    \
    if constexpr (std::is_class_v<T> && !std::is_final_v<T>) { \
      return !requires { &NamingTwice_##name<T>::name; };      \
    } else {                                                   \
      return requires { &T::name; };                           \
    }                                                          \
  }();

/// Defines `calls_NAME<T>`: T has a member function of this name. Used to find misspelled hooks.
#define ESOKIT_MEMBER_FUNCTION(name)                                \
  template <class T>                                                \
  inline constexpr bool calls_##name = requires {                   \
    requires std::is_member_function_pointer_v<decltype(&T::name)>; \
  };

ESOKIT_MEMBER_NAME(traits)
ESOKIT_MEMBER_NAME(validate)

/// The traits that T declares, or the defaults.
template <class T, class Traits>
inline constexpr Traits declared_traits = [] {
  if constexpr (names_traits<T>) {
    return T::traits;
  } else {
    return Traits{};
  }
}();

/// Whether a hook agrees with its declaration. If it is not declared, no member may have its name.
constexpr bool as_declared(bool declared, bool named, bool right) noexcept {
  return declared ? right : !named;
}

}  // namespace esokit::detail

namespace esokit {

/// If T has a member `traits`, it is a public static constexpr Traits.
template <class T, class Traits>
concept DeclaresTraits = !detail::names_traits<T> || requires {
  { T::traits } -> std::same_as<const Traits&>;
  typename detail::Constant<T::traits>;
};

}  // namespace esokit
