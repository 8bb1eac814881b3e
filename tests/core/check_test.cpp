#include <gtest/gtest.h>

#include <array>
#include <esokit/core/check.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/core/matrix.hpp>
#include <limits>
#include <string>
#include <vector>

#include "../support/pack.hpp"

namespace core_check_test {

using esokit::Check;
using esokit::Error;
using esokit::Rules;

template <class S>
class RulesOf : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, long double>;
TYPED_TEST_SUITE(RulesOf, Scalars);

template <class S>
struct Numbers {
  static constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  static constexpr S infinity = std::numeric_limits<S>::infinity();
  static constexpr S least = (std::numeric_limits<S>::min)();
  static constexpr S most = (std::numeric_limits<S>::max)();
  static constexpr S subnormal = std::numeric_limits<S>::denorm_min();
};

template <class S>
std::string said(const Rules<S>& rules) {
  return rules ? "kept" : esokit::to_text(rules.error());
}

TYPED_TEST(RulesOf, RefuseFromEachSideOfTheirBoundary) {
  using S = TypeParam;
  using N = Numbers<S>;
  const auto kept = [](const auto& rule, std::initializer_list<S> values) {
    for (const S value : values) EXPECT_TRUE(rule(value)) << value;
  };
  const auto broken = [](const auto& rule, const std::string& text,
                         std::initializer_list<S> values) {
    for (const S value : values) {
      const Rules<S> rules = rule(value);
      ASSERT_FALSE(rules) << value;
      EXPECT_EQ(rules.error().rule, text);
      EXPECT_STREQ(rules.error().field, "x");
      EXPECT_EQ(rules.error().index, 3);
      EXPECT_FALSE(rules.error().has_limit);
    }
  };
  const auto finite = [](S x) { return Rules<S>{}.finite("x", x, 3); };
  kept(finite, {S(0), N::most, -N::most, N::subnormal});
  broken(finite, "must be finite", {N::nan, N::infinity, -N::infinity});

  const auto positive = [](S x) { return Rules<S>{}.positive("x", x, 3); };
  kept(positive, {N::subnormal, S(1), N::most});
  broken(positive, "must be finite and positive",
         {S(0), -S(0), -N::subnormal, N::nan, N::infinity, -N::infinity});

  const auto not_negative = [](S x) { return Rules<S>{}.not_negative("x", x, 3); };
  kept(not_negative, {S(0), -S(0), N::subnormal, N::most});
  broken(not_negative, "must be finite and not negative",
         {-N::subnormal, S(-1), N::nan, N::infinity, -N::infinity});

  const auto nonzero = [](S x) { return Rules<S>{}.nonzero("x", x, 3); };
  kept(nonzero, {N::subnormal, -N::subnormal, N::most, -N::most});
  broken(nonzero, "must be finite and not zero (negative is fine)",
         {S(0), -S(0), N::nan, N::infinity, -N::infinity});

  const auto invertible = [](S x) { return Rules<S>{}.invertible("x", x, 3); };
  kept(invertible, {N::least, -N::least, S(1) / N::least});
  broken(invertible, "must be finite and not zero (negative is fine)", {S(0), N::nan, N::infinity});
  broken(invertible, "has an inverse that the scalar cannot hold",
         {N::subnormal, -N::subnormal, N::most, -N::most});

  const auto representable = [](S derived) {
    return Rules<S>{}.representable("x", S(7), derived, "gives what cannot be held", 3);
  };
  kept(representable, {N::least, -N::least, N::most});
  broken(representable, "gives what cannot be held",
         {N::least / S(2), S(0), N::nan, N::infinity, -N::infinity});
  EXPECT_EQ(representable(S(0)).error().value, S(7));

  for (const S above : {S(2.5), N::most}) EXPECT_TRUE(Rules<S>{}.above("x", above, S(2)));
  for (const S not_above : {S(2), S(1), N::nan, N::infinity}) {
    const auto rules = Rules<S>{}.above("x", not_above, S(2));
    ASSERT_FALSE(rules) << not_above;
    EXPECT_EQ(said(rules).substr(said(rules).find(": ")), ": must be finite and above 2");
  }

  for (const S none : {S(0), -S(0)}) EXPECT_TRUE(Rules<S>{}.left_out("x", none, "not here"));
  for (const S some : {N::subnormal, S(-1), N::nan, N::infinity}) {
    const auto rules = Rules<S>{}.left_out("x", some, "not here");
    ASSERT_FALSE(rules) << some;
    EXPECT_STREQ(rules.error().rule, "not here");
  }
}

TYPED_TEST(RulesOf, FirstBrokenOneIsTheErrorWhateverComesAfter) {
  using S = TypeParam;
  const S bad = Numbers<S>::nan;
  const Rules<S> rules = Rules<S>{}
                             .positive("a", S(1))
                             .finite("b", S(2), 0)
                             .not_negative("c", S(-4), 5)
                             .finite("d", bad)
                             .invertible("e", S(0))
                             .above("f", S(0), S(1))
                             .demand(false, "g", S(0), "never")
                             .demand(false, {"h", S(0), "never", 1, S(2), true})
                             .all_of(Check<S>(Error<S>{"i", S(0), "never"}));
  ASSERT_FALSE(rules);
  EXPECT_EQ(said(rules), "c[5] = -4: must be finite and not negative");
  EXPECT_FALSE(rules.error().has_limit);
}

TYPED_TEST(RulesOf, ListIsCheckedByElementAndNamesIt) {
  using S = TypeParam;
  const S bad = Numbers<S>::infinity;
  const std::array<S, 3> good{S(1), S(2), S(3)};
  EXPECT_TRUE(Rules<S>{}.finite("a", good).positive("a", good).not_negative("a", good));
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::array<S, 3> list = good;
    list[i] = S(0);
    const auto index = "a[" + std::to_string(i) + "]";
    EXPECT_EQ(said(Rules<S>{}.positive("a", list)), index + " = 0: must be finite and positive");
    EXPECT_TRUE(Rules<S>{}.not_negative("a", list).finite("a", list));
    list[i] = S(-1);
    EXPECT_EQ(said(Rules<S>{}.not_negative("a", list)),
              index + " = -1: must be finite and not negative");
    list[i] = bad;
    EXPECT_EQ(said(Rules<S>{}.finite("a", list)), index + " = inf: must be finite");
  }
  EXPECT_TRUE(Rules<S>{}.finite("a", std::vector<S>{}));
}

TYPED_TEST(RulesOf, OwnRuleHasWhatItSays) {
  using S = TypeParam;
  EXPECT_EQ(said(Rules<S>{}.demand(true, "a", S(1), "x")), "kept");
  EXPECT_EQ(said(Rules<S>{}.demand(false, "a", S(1), "must be another", 2)),
            "a[2] = 1: must be another");
  EXPECT_EQ(said(Rules<S>{}.demand(false, {"a", S(1), "must be below", -1, S(0.5), true})),
            "a = 1: must be below 0.5");
}

TYPED_TEST(RulesOf, ThenIsNotEvaluatedOnceARuleIsBroken) {
  using S = TypeParam;
  int calls = 0;
  const auto check = [&calls] {
    ++calls;
    return Check<S>(Error<S>{"b", S(2), "is asked"});
  };
  EXPECT_EQ(said(Rules<S>{}.positive("a", S(0)).and_then(check)),
            "a = 0: must be finite and positive");
  EXPECT_EQ(calls, 0);
  EXPECT_EQ(said(Rules<S>{}.positive("a", S(1)).and_then(check)), "b = 2: is asked");
  EXPECT_EQ(calls, 1);
}

TYPED_TEST(RulesOf, GoIntoAndComeFromACheck) {
  using S = TypeParam;
  const auto check = [](S x) -> Check<S> { return Rules<S>{}.positive("x", x); };
  EXPECT_TRUE(check(S(1)));
  ASSERT_FALSE(check(S(0)));
  EXPECT_EQ(esokit::to_text(check(S(0)).error()), "x = 0: must be finite and positive");
  EXPECT_TRUE(Rules<S>{}.all_of(check(S(1))));
  EXPECT_EQ(said(Rules<S>{}.all_of(check(S(-1)))), "x = -1: must be finite and positive");
}

TEST(Rules, AreReadAtCompileTime) {
  constexpr Rules<float> kept = Rules<float>{}.positive("a", 1.0f).invertible("b", -2.0f);
  static_assert(kept);
  // The quotient by zero would not be a constant expression.
  constexpr Rules<double> broken = Rules<double>{}.invertible("b", 0.0).finite("c", 1.0);
  static_assert(!broken && broken.error().value == 0.0);
  SUCCEED();
}

TEST(Rules, OnAPackAreKeptByEveryLane) {
  using Pack = esokit_test::Pack<double, 4>;
  Pack one(1.0);
  EXPECT_TRUE(Rules<Pack>{}.positive("a", one).invertible("a", one).nonzero("a", one));
  for (std::size_t lane = 0; lane < 4; ++lane) {
    Pack bad = one;
    bad[lane] = 0.0;
    EXPECT_FALSE(Rules<Pack>{}.positive("a", bad));
    EXPECT_FALSE(Rules<Pack>{}.nonzero("a", bad));
    EXPECT_FALSE(Rules<Pack>{}.invertible("a", bad));
    EXPECT_TRUE(Rules<Pack>{}.not_negative("a", bad));
    bad[lane] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(Rules<Pack>{}.finite("a", bad));
  }
}

TEST(RulesDeathTest, ErrorOfKeptRulesEndsTheProgram) {
  EXPECT_DEATH(static_cast<void>(Rules<double>{}.positive("a", 1.0).error()), "");
}

}  // namespace core_check_test
