/// @file
/// A known model that no matrix is: friction that grows with the speed ever less.
#pragma once

#include <esokit/adapter/known_model.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit_test {

/// fbar = -c v / (1 + abs(v)), v = y^(Row).
template <int Row, class S>
struct Friction {
  static constexpr esokit::PlantModelTraits traits{.validates = true};
  template <class T>
  using with_scalar = Friction<Row, T>;

  S coefficient{};  ///< c

  [[nodiscard]] esokit::Check<S> validate() const {
    return esokit::Rules<S>{}.finite("model.coefficient", coefficient);
  }

  template <int Size>
  S operator()(const esokit::Vector<S, Size>& z) const noexcept {
    const S& v = z(Row);
    return -(coefficient * (v / (S(1.0) + esokit::detail::absolute(v))));
  }
};

}  // namespace esokit_test

namespace esokit {

template <int Row, class S>
inline constexpr std::uint32_t type_tag<esokit_test::Friction<Row, S>> =
    make_type_tag<S>("Friction", Row);

}  // namespace esokit
