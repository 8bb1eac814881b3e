// The scalar customisation points and what the Scalar concept takes and refuses.
#include <gtest/gtest.h>

#include <complex>
#include <esokit/core/scalar.hpp>
#include <limits>
#include <string>
#include <support/dual.hpp>
#include <support/numbers.hpp>
#include <support/pack.hpp>

namespace core_scalar_test {

using esokit::is_finite;
using esokit::PlainScalar;
using esokit::Scalar;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;

static_assert(PlainScalar<float> && PlainScalar<double> && PlainScalar<long double>);
static_assert(Scalar<float> && Scalar<double> && Scalar<long double>);
static_assert(Scalar<esokit_test::Dual> && !PlainScalar<esokit_test::Dual>);
static_assert(Scalar<esokit_test::Pack<double, 4>> && Scalar<esokit_test::Pack<float, 8>>);
static_assert(!PlainScalar<esokit_test::Pack<float, 8>>);
// Not even an integer: 1/T would be zero.
static_assert(!PlainScalar<int> && !Scalar<int>);
static_assert(!Scalar<std::string> && !Scalar<void*> && !Scalar<std::complex<double>>);

// Near misses: what a scalar is made of, each without one thing.
template <int Missing>
struct Almost {
  double value = 0;
  Almost() = default;
  explicit Almost(double v) : value(v) {}
  friend Almost operator+(Almost a, Almost b) { return Almost(a.value + b.value); }
  friend Almost operator-(Almost a, Almost b) { return Almost(a.value - b.value); }
  friend Almost operator*(Almost a, Almost b) { return Almost(a.value * b.value); }
  friend Almost operator/(Almost a, Almost b) requires(Missing != 1) {
    return Almost(a.value / b.value);
  }
  friend Almost operator-(Almost a) requires(Missing != 2) { return Almost(-a.value); }
  friend bool operator<(Almost a, Almost b) requires(Missing != 3) { return a.value < b.value; }
  friend bool is_finite(Almost a) requires(Missing != 4) { return esokit::is_finite(a.value); }
  friend Almost select(bool c, Almost a, Almost b) requires(Missing != 5) { return c ? a : b; }
};
static_assert(Scalar<Almost<0>>);
static_assert(!Scalar<Almost<1>>, "no division");
static_assert(!Scalar<Almost<2>>, "no negation");
static_assert(!Scalar<Almost<3>>, "no comparison");
static_assert(!Scalar<Almost<4>>, "no is_finite");
static_assert(!Scalar<Almost<5>>, "no select");

/// A comparison of several numbers, of which nothing says how many.
struct Undeclared : Almost<0> {
  using Almost<0>::Almost;
  Undeclared() = default;
  Undeclared(Almost<0> one) : Almost<0>(one) {}
  struct Mask {};
  [[maybe_unused]] friend Mask operator<(Undeclared, Undeclared) { return {}; }
  [[maybe_unused]] friend Mask is_finite(Undeclared) { return {}; }
  [[maybe_unused]] friend bool all(Mask) { return true; }
  [[maybe_unused]] friend Undeclared select(Mask, Undeclared a, Undeclared) { return a; }
};
/// It says so, and has no numbers to be taken out.
struct WithoutNumbers : Undeclared {
  using Undeclared::Undeclared;
};

}  // namespace core_scalar_test
template <>
inline constexpr int esokit::lane_count<core_scalar_test::WithoutNumbers> = 2;
namespace core_scalar_test {

static_assert(!Scalar<Undeclared>, "a scalar whose comparison is a mask has to declare its lanes");
static_assert(!Scalar<WithoutNumbers>, "and to give the number of each");

struct MoveOnly : Almost<0> {
  using Almost<0>::Almost;
  MoveOnly(const MoveOnly&) = delete;
  MoveOnly(MoveOnly&&) = default;
};
static_assert(!Scalar<MoveOnly>);

template <class T>
class IsFinite : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, long double>;
TYPED_TEST_SUITE(IsFinite, Scalars);

TYPED_TEST(IsFinite, TellsNumbersFromTheRest) {
  using Limits = std::numeric_limits<TypeParam>;
  for (const TypeParam good : {TypeParam(0), -TypeParam(0), TypeParam(1), Limits::max(),
                               Limits::lowest(), Limits::min(), Limits::denorm_min()}) {
    EXPECT_TRUE(is_finite(good)) << good;
  }
  for (const TypeParam bad :
       {hidden_nan<TypeParam>(), -hidden_nan<TypeParam>(), hidden_infinity<TypeParam>(),
        -hidden_infinity<TypeParam>(), Limits::signaling_NaN()}) {
    EXPECT_FALSE(is_finite(bad)) << bad;
  }
}

TEST(IsFiniteAtCompileTime, Works) {
  static_assert(is_finite(1.0f) && is_finite(1.0));
  static_assert(!is_finite(std::numeric_limits<float>::infinity()));
  static_assert(!is_finite(std::numeric_limits<double>::quiet_NaN()));
  static_assert(esokit::select(true, 1.0f, 2.0f) == 1.0f);
  static_assert(esokit::select(false, 1.0, 2.0) == 2.0);
  static_assert(esokit::all(true) && !esokit::all(false));
}

}  // namespace core_scalar_test
