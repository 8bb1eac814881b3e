/// @file
/// A value or the error that prevented it, without exceptions.
#pragma once

#include <cstdlib>
#include <esokit/core/detail/text.hpp>
#include <type_traits>
#include <utility>
#include <variant>

namespace esokit {

namespace detail {

struct Done {};
struct ErrorOf {};

/// A value or an error: what is copied as bytes, as nearly all that a `make` returns, in a union,
/// which costs a user a tenth less to compile than a variant of each.
template <class T, class E>
struct Either {
  constexpr explicit Either(const T& value) : content(std::in_place_index<0>, value) {}
  constexpr explicit Either(T&& value) : content(std::in_place_index<0>, std::move(value)) {}
  constexpr Either(ErrorOf, E error) : content(std::in_place_index<1>, std::move(error)) {}
  [[nodiscard]] constexpr bool has_value() const noexcept { return content.index() == 0; }
  [[nodiscard]] constexpr T* value() noexcept { return std::get_if<0>(&content); }
  [[nodiscard]] constexpr const T* value() const noexcept { return std::get_if<0>(&content); }
  [[nodiscard]] constexpr const E* error() const noexcept {
    // Neither of both, after an assignment that threw.
    if (content.valueless_by_exception()) std::abort();
    return std::get_if<1>(&content);
  }
  std::variant<T, E> content;
};
template <class T, class E>
requires(std::is_trivially_copyable_v<T>&& std::is_trivially_copyable_v<E>) struct Either<T, E> {
  constexpr explicit Either(const T& given) : one(given), good(true) {}
  constexpr explicit Either(T&& given) : one(std::move(given)), good(true) {}
  constexpr Either(ErrorOf, E given) : other(std::move(given)), good(false) {}
  [[nodiscard]] constexpr bool has_value() const noexcept { return good; }
  [[nodiscard]] constexpr T* value() noexcept { return &one; }
  [[nodiscard]] constexpr const T* value() const noexcept { return &one; }
  [[nodiscard]] constexpr const E* error() const noexcept { return &other; }
  union {
    T one;
    E other;
  };
  bool good;
};

}  // namespace detail

/// Holds either a T or an E. Access is checked in every build type: reading the value when there is
/// an error prints the error (where there is a console) and aborts.
///
/// A subset of C++23's std::expected under the same names, so that code can move to it.
template <class T, class E>
class [[nodiscard]] Expected {
 public:
  using value_type = T;  ///< type of the value
  using error_type = E;  ///< type of the error

  /// Implicit, so that both `return value;` and `return error;` compile.
  /// @{
  constexpr Expected(const T& value) : content_(value) {}
  constexpr Expected(T&& value) : content_(std::move(value)) {}
  constexpr Expected(const E& error) : content_(detail::ErrorOf{}, error) {}
  /// @}

  /// True if there is a value, false if there is an error.
  /// @{
  [[nodiscard]] constexpr bool has_value() const noexcept { return content_.has_value(); }
  constexpr explicit operator bool() const noexcept { return has_value(); }
  /// @}

  /// The value; if there is none, prints the error and ends the program. @{
  [[nodiscard]] constexpr T& value() & noexcept { return *checked(*this); }
  [[nodiscard]] constexpr const T& value() const& noexcept { return *checked(*this); }
  /// Returns by value, so that `for (x : make_grid().value())` does not use a destroyed object.
  [[nodiscard]] constexpr T value() && noexcept { return std::move(*checked(*this)); }

  [[nodiscard]] constexpr T& operator*() & noexcept { return value(); }
  [[nodiscard]] constexpr const T& operator*() const& noexcept { return value(); }
  [[nodiscard]] constexpr T operator*() && noexcept { return std::move(*this).value(); }
  [[nodiscard]] constexpr T* operator->() noexcept { return checked(*this); }
  [[nodiscard]] constexpr const T* operator->() const noexcept { return checked(*this); }
  /// @}

  /// The error; aborts if there is none.
  [[nodiscard]] constexpr const E& error() const noexcept {
    if (has_value()) std::abort();
    return *content_.error();
  }

  /// The value, or `fallback` if there is none.
  template <class U>
  [[nodiscard]] constexpr T value_or(U&& fallback) const& {
    return has_value() ? value() : static_cast<T>(std::forward<U>(fallback));
  }

  /// f(value), or the error passed on. f returns an Expected with the same error type.
  template <class F>
  constexpr auto and_then(F&& f) const& -> std::invoke_result_t<F, const T&> {
    if (has_value()) return std::forward<F>(f)(value());
    return error();
  }

 private:
  template <class Self>
  static constexpr auto checked(Self& self) noexcept -> decltype(self.content_.value()) {
    if (!self.has_value()) {
      if constexpr (requires(const E& e) { print_last_words(e); }) print_last_words(self.error());
      std::abort();
    }
    return self.content_.value();
  }

  detail::Either<T, E> content_;
};

/// Done, or an error.
template <class E>
class [[nodiscard]] Expected<void, E> {
 public:
  using value_type = void;  ///< a success carries no value
  using error_type = E;     ///< type of the error

  /// Done.
  constexpr Expected() noexcept : content_(detail::Done{}) {}
  /// Implicit, so that `return error;` compiles.
  constexpr Expected(E error) : content_(detail::ErrorOf{}, std::move(error)) {}

  /// True for success, false if there is an error.
  /// @{
  [[nodiscard]] constexpr bool has_value() const noexcept { return content_.has_value(); }
  constexpr explicit operator bool() const noexcept { return has_value(); }
  /// @}

  /// If there is an error, prints it and ends the program.
  constexpr void value() const noexcept {
    if (has_value()) return;
    if constexpr (requires(const E& e) { print_last_words(e); }) print_last_words(error());
    std::abort();
  }

  /// The error; aborts if there is none.
  [[nodiscard]] constexpr const E& error() const noexcept {
    if (has_value()) std::abort();
    return *content_.error();
  }

 private:
  detail::Either<detail::Done, E> content_;
};

/// An Expected can be written to a stream, see has_text.
template <class T, class E>
inline constexpr bool has_text<Expected<T, E>> = true;

/// Writes the error or the value; `ok` for a value that cannot be written.
template <class Stream, class T, class E>
requires detail::WritesText<Stream, E> Stream& operator<<(Stream& out,
                                                          const Expected<T, E>& result) {
  if (!result) {
    out << result.error();
  } else if constexpr (std::is_void_v<T>) {
    out << "ok";
  } else if constexpr (detail::WritesText<Stream, T>) {
    out << *result;
  } else {
    out << "ok";
  }
  return out;
}

}  // namespace esokit
