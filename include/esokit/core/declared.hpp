/// @file
/// Traits that a type declares in one place, and the check that it has what it declares.
///
/// A type declares what it can do in a static constant `traits`; without it the defaults apply. A
/// member is never called only because it has the name of a hook: a member with such a name that is
/// not declared is a mistake, and so is a declared hook that is missing.
#pragma once

#include <concepts>
#include <esokit/core/language.hpp>
#include <type_traits>

namespace esokit::detail {

template <auto>
struct Constant;

/// Defines `names_NAME<T>`: T has a member of this name, whatever it is, overloaded or private.
// The name is looked up in a class that inherits it a second time: found twice it is ambiguous.
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

/// Defines `calls_NAME<T>`: T has a member function of this name, a misspelled hook.
#define ESOKIT_MEMBER_FUNCTION(name)                                \
  template <class T>                                                \
  inline constexpr bool calls_##name = requires {                   \
    requires std::is_member_function_pointer_v<decltype(&T::name)>; \
  };

ESOKIT_MEMBER_NAME(traits)
ESOKIT_MEMBER_NAME(check)

/// What T declares, or the defaults.
template <class T, class Traits>
inline constexpr Traits declared_traits = [] {
  if constexpr (names_traits<T>) {
    return T::traits;
  } else {
    return Traits{};
  }
}();

/// Whether a hook is there as it was declared: one that is not declared must not even be named.
constexpr bool as_declared(bool declared, bool named, bool right) noexcept {
  return declared ? right : !named;
}

}  // namespace esokit::detail

namespace esokit {

/// `traits`, where T has it, is a public static constexpr Traits.
template <class T, class Traits>
concept DeclaresTraits = !detail::names_traits<T> || requires {
  { T::traits } -> std::same_as<const Traits&>;
  typename detail::Constant<T::traits>;
};

}  // namespace esokit
