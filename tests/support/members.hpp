/// @file
/// The members of a config, found without any list of them: a config is an aggregate, whose members
/// structured bindings name. A new member is seen by every law that uses this.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <limits>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>

namespace esokit_test {

namespace members {

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

}  // namespace members

/// f(member) for each direct member of an aggregate, as the library finds them for packs.
template <class T, class F>
void each_member(T& o, const F& f) {
  esokit::detail::LaneAccess::with_members(o, [&](auto&... all) { (f(all), ...); });
}

/// What a setting of one number may be changed to: its neighbours, or what other settings are.
class Change {
 public:
  /// @param leaf number of the setting, in the order of the members @param kind of change, 0, 1, ..
  Change(int leaf, int kind) : left_(leaf), kind_(kind) {}

  /// Changes the setting; false if there are fewer, or no such kind of change.
  template <class Config>
  bool operator()(Config& config) {
    visit(config);
    return changed_;
  }
  /// Number of settings of a config.
  template <class Config>
  static int settings(Config config) {
    Change none(1 << 30, 0);
    none.visit(config);
    return (1 << 30) - none.left_;
  }

 private:
  template <class T>
  void visit(T& o) {
    if constexpr (std::is_empty_v<T>) {
    } else if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      if (left_-- == 0) change(o);
    } else if constexpr (requires { o.real(); }) {
      if (left_-- == 0) {
        auto real = o.real();
        change(real);
        o = {real, o.imag()};
      }
    } else if constexpr (members::IsOptional<T>::value) {
      visit_optional(o);
    } else if constexpr (requires { o.rows(); }) {
      visit_matrix(o);
    } else if constexpr (requires {
                           o[0];
                           o.size();
                         }) {
      for (auto& each : o) visit(each);
    } else if constexpr (requires { std::tuple_size<T>::value; }) {
      std::apply([this](auto&... each) { (this->visit(each), ...); }, o);
    } else {
      each_member(o, [this](auto& member) { this->visit(member); });
    }
  }

  /// Of one number also whether it is given. Counted the same whether it is or not.
  template <class T>
  void visit_optional(std::optional<T>& o) {
    if constexpr (std::is_arithmetic_v<T>) {
      if (left_-- == 0) {
        if (o) {
          o.reset();
          changed_ = kind_ == 0;
        } else {
          change(o.emplace());
        }
      }
    }
    if (o) return visit(*o);
    const bool changed = changed_;
    T none{};
    visit(none);
    changed_ = changed;
  }
  template <class M>
  void visit_matrix(M& o) {
    for (int i = 0; i < o.rows(); ++i) {
      for (int j = 0; j < o.cols(); ++j) {
        if (left_-- != 0) continue;
        // As it is, or as a covariance wants it.
        const bool symmetric = kind_ % 2 == 1 && o.rows() == o.cols();
        kind_ /= 2;
        change(o(i, j));
        if (symmetric) o(j, i) = o(i, j);
      }
    }
  }

  template <class T>
  void change(T& x) {
    if constexpr (std::is_same_v<T, bool>) {
      changed_ = kind_ == 0;
      x = !x;
    } else if constexpr (std::is_integral_v<T> || std::is_enum_v<T>) {
      constexpr int by[] = {1, -1, 2, 5};
      changed_ = kind_ < (std::is_integral_v<T> ? 6 : 4);
      if (kind_ < 4) {
        x = static_cast<T>(static_cast<int>(x) + by[kind_]);
      } else if (changed_) {  // what overflows where it is used before it is checked
        x = kind_ == 4 ? (std::numeric_limits<T>::max)() : (std::numeric_limits<T>::min)();
      }
    } else if (x < T(0) || x > T(0)) {
      constexpr double by[] = {1.25, 0.8, 1.05, 2, -1};
      changed_ = kind_ < 5;
      if (changed_) x *= static_cast<T>(by[kind_]);
    } else {
      constexpr double to[] = {0.5, 0.05, 5, 50, 1e-3, -0.5};
      changed_ = kind_ < 6;
      if (changed_) x = static_cast<T>(to[kind_]);
    }
  }

  int left_, kind_;
  bool changed_ = false;
};

}  // namespace esokit_test
