// The gain law of AlgebraicEso against its definition in high precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <esokit/gain/algebraic_gain.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/algebraic_reference.hpp>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test {
namespace gain_algebraic_gain_test {

using esokit::AlgebraicGain;

template <int Size, class S>
AlgebraicGain<Size, S> law_of(double bandwidth, double shift, std::uint32_t start = 0) {
  // T = 1: lambda T and q T are what is given, without a rounding of their own.
  return AlgebraicGain<Size, S>(static_cast<S>(bandwidth), static_cast<S>(shift), S(1), start);
}

template <int Size, class S>
AlgebraicReference reference_of(double bandwidth, double shift) {
  return {Size, Big(static_cast<S>(bandwidth)), Big(static_cast<S>(shift))};
}

/// Largest relative error of the gains that the scalar can hold, and of which the reference, a sum
/// of terms about 1 with 100 digits, knows 20.
template <int Size, class S>
double worst_error(const AlgebraicGain<Size, S>& law, const std::vector<Big>& reference) {
  const Big held = Big(std::numeric_limits<S>::min()) / Big(std::numeric_limits<S>::epsilon());
  const Big least = std::max(held, Big("1e-80"));
  double worst = 0;
  for (std::size_t r = 0; r < Size; ++r) {
    if (reference[r] < least) continue;
    worst = std::max(worst, relative_error(law.gain(S(0))[r], reference[r]));
  }
  return worst;
}

/// p^i and [i] run by recursion for up to 256 samples, a rounding of p and one of the product each;
/// the smallest gain has N - 1 factors u. The rest costs a few units a factor, as do the gains.
template <int Size, class S>
double tolerance() {
  return Size * (AlgebraicGain<Size, S>::anchor_interval + 16.0) *
         static_cast<double>(std::numeric_limits<S>::epsilon());
}

template <int Size, class S>
void follows_its_definition(double bandwidth, double shift, std::int64_t last) {
  SCOPED_TRACE(::testing::Message() << Size << " states, lambda T " << bandwidth << ", q T "
                                    << shift << ", digits " << std::numeric_limits<S>::digits);
  auto law = law_of<Size, S>(bandwidth, shift);
  const auto reference = reference_of<Size, S>(bandwidth, shift);
  std::int64_t check = Size - 1;
  for (std::int64_t k = 0; k <= last; ++k) {
    law.advance();
    law.accept(S(0));
    if (k != check) continue;
    const double error = worst_error(law, reference.gain(k));
    ASSERT_LE(error, (tolerance<Size, S>())) << "sample " << k;
    // Each of the first samples, then two a decade, before and after anchors.
    check = k < 2 * Size ? k + 1 : k * 31 / 10;
  }
}

constexpr std::array shifts{0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 0.7, 5.0, 20.0};
constexpr std::array bandwidths{0.0, 1e-6, 1e-3, 0.5, 8.0};

template <int Size, class S>
void follows_its_definition_everywhere(std::int64_t last) {
  for (const double shift : shifts) {
    for (const double bandwidth : bandwidths) {
      follows_its_definition<Size, S>(bandwidth, shift, last);
    }
  }
}

TEST(AlgebraicGain, FollowsItsDefinitionInDouble) {
  follows_its_definition_everywhere<3, double>(10'000);
  follows_its_definition_everywhere<7, double>(10'000);
}

TEST(AlgebraicGain, FollowsItsDefinitionInFloat) {
  follows_its_definition_everywhere<2, float>(10'000);
  follows_its_definition_everywhere<5, float>(10'000);
}

TEST(AlgebraicGain, FollowsItsDefinitionForAMillionSamples) {
  for (const double shift : {0.0, 1e-8, 1e-5}) {
    follows_its_definition<3, double>(0.0, shift, 1'000'000);
    follows_its_definition<3, double>(1e-4, shift, 1'000'000);
    follows_its_definition<3, float>(0.0, shift, 1'000'000);
    follows_its_definition<3, float>(1e-4, shift, 1'000'000);
  }
  follows_its_definition<6, float>(1e-3, 1e-8, 1'000'000);
}

/// The reference is the sheet's formula as well.
TEST(AlgebraicGain, DefinitionAgreesWithThePrintedFormula) {
  for (const std::size_t size : {2u, 3u, 5u, 7u}) {
    for (const double shift : {1e-6, 1e-2, 2.0}) {
      const AlgebraicReference reference{size, Big(0.03), Big(shift)};
      for (const std::int64_t k : {6, 7, 20, 1000}) {
        const auto defined = reference.gain(k);
        // The printed beta is that of the predictor form, whose first exact state is x[N].
        const auto printed = printed_algebraic_gain(reference, k);
        for (std::size_t r = 0; r < size; ++r) {
          EXPECT_LE(static_cast<double>(abs(printed[r] / defined[r] - 1)), 1e-25)
              << size << " states, q T " << shift << ", sample " << k << ", row " << r;
        }
      }
    }
  }
}

/// A counter or a recursion in float would stand still at 2^24.
TEST(AlgebraicGain, CountsPastTwoToThe24) {
  const std::int64_t k = (std::int64_t{1} << 24u) + 100'000;
  for (const double shift : {0.0, 1e-8}) {
    auto law = law_of<3, float>(0.0, shift);
    law.resume(static_cast<std::uint32_t>(k - 2000));
    for (int i = 0; i < 2001; ++i) {
      law.advance();
      law.accept(0.0f);
    }
    EXPECT_EQ(law.age(), k + 1);
    EXPECT_LE(worst_error(law, reference_of<3, float>(0.0, shift).gain(k)), (tolerance<3, float>()))
        << shift;
  }
}

TEST(AlgebraicGain, CounterStopsAtItsEnd) {
  using Law = AlgebraicGain<3, double>;
  auto law = law_of<3, double>(0.0, 0.0);
  law.resume(Law::max_index - 2);
  for (int i = 0; i < 1000; ++i) {
    law.advance();
    law.accept(0.0);
  }
  EXPECT_EQ(law.age(), Law::max_index);
  // From here on it runs without anchors, a thousand samples too far in 2^30.
  EXPECT_LE(worst_error(law, reference_of<3, double>(0.0, 0.0).gain(Law::max_index - 1)), 1e-5);
}

/// Up to sample N - 1: k_r of all poles at z = 0.
TEST(AlgebraicGain, FirstSamplesAreDeadbeat) {
  auto law = law_of<3, double>(0.3, 0.1);
  for (int k = 0; k < 3; ++k) {
    law.advance();
    law.accept(0.0);
    EXPECT_NEAR(law.gain(0.0)[0], 1.0, 1e-15) << k;
    EXPECT_NEAR(law.gain(0.0)[1], 1.5, 1e-15) << k;
    EXPECT_NEAR(law.gain(0.0)[2], 0.5, 1e-15) << k;
  }
  law.advance();
  EXPECT_LT(law.gain(0.0)[0], 1.0);
}

/// lambda = q = 0, N = 3, growing memory: close to 9/t, 36/t^2, 60/t^3.
TEST(AlgebraicGain, GrowsOldAsLeastSquares) {
  auto law = law_of<3, double>(0.0, 0.0);
  law.resume(10'000);
  const auto gain = esokit::physical_gain<3, double>(law.gain(0.0), 1.0);
  EXPECT_NEAR(gain(0) * 1e4 / 9.0, 1.0, 1e-3);
  EXPECT_NEAR(gain(1) * 1e8 / 36.0, 1.0, 1e-3);
  EXPECT_NEAR(gain(2) * 1e12 / 60.0, 1.0, 1e-3);
}

template <int Size, class S>
void settles_to_the_linear_gain(double bandwidth, double shift) {
  SCOPED_TRACE(::testing::Message() << Size << ", " << bandwidth << ", " << shift);
  auto law = law_of<Size, S>(bandwidth, shift);
  const auto linear = esokit::current_gain<Size, S>(
      esokit::EqualSampledPoles<Size, S>::from_bandwidth(static_cast<S>(bandwidth), S(1))
          .weights());
  int samples = 0;
  auto before = law.gain(S(0));
  while (!law.settled() && samples < 2'000'000) {
    before = law.gain(S(0));
    law.advance();
    law.accept(S(0));
    ++samples;
  }
  ASSERT_TRUE(law.settled());
  for (std::size_t r = 0; r < Size; ++r) {
    EXPECT_TRUE(same_bits(law.gain(S(0))[r], linear[r])) << r;
    // It got there by itself: the last step was one of rounding.
    EXPECT_NEAR(static_cast<double>(before[r] / linear[r]), 1.0,
                8 * Size * static_cast<double>(std::numeric_limits<S>::epsilon()))
        << r;
  }
  const auto settled_gap = law.gap_gain(S(0), 7);
  const auto linear_gap = esokit::gap_gain<Size, S>(
      esokit::EqualSampledPoles<Size, S>::from_bandwidth(static_cast<S>(bandwidth), S(1)), 7);
  for (std::size_t r = 0; r < Size; ++r) {
    EXPECT_TRUE(same_bits(settled_gap[r], linear_gap[r])) << r;
  }
  law.advance();
  EXPECT_TRUE(same_bits(law.gain(S(0))[0], linear[0]));
}

TEST(AlgebraicGain, SettlesToTheLinearGainBitForBit) {
  settles_to_the_linear_gain<3, double>(0.06, 1e-4);
  settles_to_the_linear_gain<3, double>(1e-4, 0.05);
  settles_to_the_linear_gain<2, double>(0.5, 1.0);
  settles_to_the_linear_gain<7, double>(0.01, 0.01);
  settles_to_the_linear_gain<3, float>(0.06, 1e-4);
  settles_to_the_linear_gain<3, float>(1e-4, 0.05);
  settles_to_the_linear_gain<7, float>(0.01, 0.01);
}

/// Without a shift or without a bandwidth there is nothing to settle to.
TEST(AlgebraicGain, DoesNotSettleInTheLimits) {
  for (const auto& [bandwidth, shift] : {std::pair{0.0, 0.0}, {0.1, 0.0}, {0.0, 1e-3}}) {
    auto law = law_of<3, double>(bandwidth, shift);
    for (int k = 0; k < 100'000; ++k) {
      law.advance();
      law.accept(0.0);
    }
    EXPECT_FALSE(law.settled()) << bandwidth << ", " << shift;
  }
}

TEST(AlgebraicGain, SettlesOnlyAfterItsLeastAge) {
  AlgebraicGain<3, double> law(0.1, 1.0, 1.0, 0, 500);
  for (int k = 0; k < 500; ++k) {
    law.advance();
    law.accept(0.0);
    ASSERT_FALSE(law.settled());
    ASSERT_EQ(law.age(), static_cast<std::uint32_t>(k + 1));
  }
  law.advance();
  EXPECT_TRUE(law.settled());
  EXPECT_EQ(law.age(), 501u);
}

/// To a place in the schedule at once, or sample by sample: the same gains.
TEST(AlgebraicGain, ResumesAnywhere) {
  for (const double shift : {0.0, 1e-9, 1e-3, 3.0}) {
    auto runs = law_of<4, double>(0.02, shift);
    for (std::uint32_t age = 0; age < 3000; ++age) {
      if (age % 97 == 0 || age < 12) {
        auto jumps = law_of<4, double>(0.02, shift);
        jumps.resume(age);
        if (!runs.settled()) {
          ASSERT_EQ(jumps.age(), age);
        }
        for (std::size_t r = 0; r < 4; ++r) {
          ASSERT_NEAR(jumps.gain(0.0)[r] / runs.gain(0.0)[r], 1.0, (tolerance<4, double>()))
              << shift << ", age " << age << ", row " << r;
        }
        auto next = runs;
        next.advance();
        jumps.advance();
        ASSERT_NEAR(jumps.gain(0.0)[3] / next.gain(0.0)[3], 1.0, (tolerance<4, double>())) << age;
      }
      runs.advance();
      runs.accept(0.0);
    }
  }
}

/// Soft start: the schedule from k0 on.
TEST(AlgebraicGain, StartIndexIsAPlaceInTheSchedule) {
  auto whole = law_of<3, double>(0.02, 0.01);
  whole.resume(50);
  auto late = law_of<3, double>(0.02, 0.01, 50);
  EXPECT_EQ(late.age(), 0u);
  for (int k = 0; k < 10; ++k) {
    for (std::size_t r = 0; r < 3; ++r) {
      EXPECT_TRUE(same_bits(late.gain(0.0)[r], whole.gain(0.0)[r]));
    }
    late.advance();
    late.accept(0.0);
    whole.advance();
    whole.accept(0.0);
  }
}

/// A gap takes the bandwidth of its place in the schedule for the whole of it: for one sample that
/// is nearly the gain itself.
TEST(AlgebraicGain, GapGainBelongsToThePresentBandwidth) {
  auto law = law_of<3, double>(0.01, 0.001);
  law.resume(400);
  const auto gap = law.gap_gain(0.0, 2);
  const double v = 1 / std::expm1(0.001 * 400);
  const auto frozen = esokit::gap_gain<3, double>(
      esokit::EqualSampledPoles<3, double>::from_bandwidth(0.01 + 3 * 0.001 * v, 1.0), 2);
  for (std::size_t r = 0; r < 3; ++r) EXPECT_NEAR(gap[r] / frozen[r], 1.0, 0.05) << r;
  // Deadbeat for the whole gap among the first N.
  law.restart();
  law.advance();
  const auto first = law.gap_gain(0.0, 2);
  EXPECT_NEAR(first[0], 1.0, 1e-15);
  EXPECT_NEAR(first[1], 1.5 / 2, 1e-15);
  EXPECT_NEAR(first[2], 0.5 / 4, 1e-15);
}

}  // namespace gain_algebraic_gain_test
}  // namespace esokit_test
