/// @file
/// Random arguments that can be played again: what a case is shrunk and printed by.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <vector>

namespace fuzz {

using esokit_test::Random;

/// How many of a hundred numbers are extreme (finite, at the ends of what the scalar holds, of the
/// wrong sign, zero) or corrupt (NaN, infinite).
struct Mix {
  int extreme = 0;
  int corrupt = 0;
};

/// Where a valid number lies.
struct Range {
  double low;
  double high;
  bool decades = false;  ///< as many numbers in each decade
  bool signs = false;    ///< negative ones as well
};

inline constexpr Range signal{-2, 2};

/// The numbers of one config or call: drawn once, then the same whenever it is played.
class Tape {
 public:
  Tape() = default;

  void record(Random& random, Mix mix) {
    random_ = &random;
    mix_ = mix;
    values_.clear();
    plain_ = true;
  }
  void play() {
    random_ = nullptr;
    next_ = 0;
    text_.clear();
  }

  template <class S>
  S number(const Range& range, const char* name = "") {
    const S value = random_ != nullptr ? draw<S>(range) : S(played());
    keep(value, name);
    return value;
  }

  /// A whole number; extreme ones are those where a check may be missing.
  int integer(int low, int high, const char* name = "") {
    int value;
    if (random_ == nullptr) {
      value = static_cast<int>(played());
    } else if (random_->index(100) < mix_.extreme + mix_.corrupt) {
      constexpr std::array<int, 9> odd{-1,    0,     1,          1001,           65000,
                                       65001, 65536, 2147483647, -2147483647 - 1};
      value = odd[static_cast<std::size_t>(random_->index(static_cast<int>(odd.size())))];
      plain_ = false;
    } else {
      value = low + random_->index(high - low + 1);
    }
    keep(static_cast<long double>(value), name);
    return value;
  }

  /// One of `count`; all are valid.
  int choice(int count, const char* name = "") {
    const int value = random_ != nullptr ? random_->index(count) : static_cast<int>(played());
    keep(static_cast<long double>(value), name);
    return value;
  }
  bool once_in(int count, const char* name = "") { return choice(count, name) == 1; }

  template <class S, int Rows, int Columns>
  esokit::Matrix<S, Rows, Columns> matrix(const Range& range) {
    esokit::Matrix<S, Rows, Columns> m;
    for (int i = 0; i < m.size(); ++i) m.data()[i] = number<S>(range);
    return m;
  }
  template <class S, int Rows>
  esokit::Vector<S, Rows> vector(const Range& range) {
    return matrix<S, Rows, 1>(range);
  }

  /// No number was extreme or corrupt.
  [[nodiscard]] bool plain() const { return plain_; }
  [[nodiscard]] std::vector<long double>& values() { return values_; }
  /// What was played, as text.
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  long double played() { return next_ < values_.size() ? values_[next_] : 0; }

  template <class S>
  void keep(S value, const char* name) {
    const auto wide = static_cast<long double>(value);
    if (random_ != nullptr) {
      values_.push_back(wide);
      return;
    }
    ++next_;
    std::array<char, 64> digits{};
    std::snprintf(digits.data(), digits.size(), "%.*Lg", std::numeric_limits<S>::max_digits10,
                  wide);
    if (!text_.empty()) text_ += ", ";
    if (*name != '\0') (text_ += name) += " = ";
    text_ += digits.data();
  }

  template <class S>
  S draw(const Range& range) {
    const int kind = random_->index(100);
    if (kind < mix_.corrupt) {
      plain_ = false;
      if (random_->index(2) == 0) return esokit_test::hidden_nan<S>();
      return random_->index(2) == 0 ? esokit_test::hidden_infinity<S>()
                                    : S(-esokit_test::hidden_infinity<S>());
    }
    if (kind < mix_.corrupt + mix_.extreme) {
      plain_ = false;
      return extreme<S>(range);
    }
    return valid<S>(range);
  }

  template <class S>
  S valid(const Range& range) {
    const double x = range.decades ? random_->log_uniform(range.low, range.high)
                                   : random_->uniform(range.low, range.high);
    return static_cast<S>(range.signs && random_->index(2) == 0 ? -x : x);
  }

  template <class S>
  S extreme(const Range& range) {
    using Limits = std::numeric_limits<S>;
    // With -ffast-math Clang orders the factors of a product anew: what is finite in the order that
    // is written may not be in another, so the ends of the scalar promise nothing there.
#if defined(__clang__) && defined(__FAST_MATH__)
    constexpr int least = Limits::min_exponent / 16;
    constexpr int most = Limits::max_exponent / 16;
    const S smallest = std::ldexp(S(1), least);
    const S largest = std::ldexp(S(1), most);
    constexpr double far = 1e2;
#else
    constexpr int least = Limits::min_exponent;
    constexpr int most = Limits::max_exponent;
    const S smallest = Limits::min();
    const S largest = Limits::max();
    constexpr double far = 1e9;
#endif
    const S sign = random_->index(2) == 0 ? S(1) : S(-1);
    switch (random_->index(9)) {
      case 0:
        return S(0) * sign;
      case 1:
        return sign * largest;
      case 2:
        return sign * largest * static_cast<S>(random_->uniform(0.01, 1));
      case 3:
        return sign * smallest * static_cast<S>(random_->log_uniform(1, 1e3));
      case 4:
        return sign * (smallest > Limits::min() ? smallest : Limits::denorm_min());
      case 5:
        return -valid<S>(range);
      case 6:
        return valid<S>(range) * static_cast<S>(random_->log_uniform(1 / far, far));
      default: {
        // Any size that the scalar holds, as many in each octave.
        const int exponent = least + random_->index(most - least - 1);
        return sign * std::ldexp(static_cast<S>(random_->uniform(1, 2)), exponent);
      }
    }
  }

  Random* random_ = nullptr;
  Mix mix_{};
  bool plain_ = true;
  std::vector<long double> values_{};
  std::size_t next_ = 0;
  std::string text_{};
};

}  // namespace fuzz
