// The chain against its matrices written down by hand, and the scaled chain against the chain.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/model/scaled_chain.hpp>
#include <limits>
#include <support/exact_plant.hpp>
#include <support/numbers.hpp>

// The references compute in long double on purpose; the library above is still checked.
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace analysis_integrator_chain_test {

using esokit::EigenMatrix;
using esokit::IntegratorChain;
using esokit::ScaledChain;
using esokit_test::Random;

TEST(IntegratorChain, LiteralMatricesOfOrderTwo) {
  using Chain = IntegratorChain<2>;
  EigenMatrix<double, 3, 3> a;
  a << 0, 1, 0, 0, 0, 1, 0, 0, 0;
  EXPECT_EQ(Chain::state_matrix(), a);
  EXPECT_EQ(Chain::input_matrix(-3), (EigenMatrix<double, 3>(0, -3, 0)));
  EXPECT_EQ(Chain::output_matrix(), (esokit::EigenMatrix<double, 1, 3>(1, 0, 0)));
  // T = 1/2: exact in binary.
  EigenMatrix<double, 3, 3> phi;
  phi << 1, 0.5, 0.125, 0, 1, 0.5, 0, 0, 1;
  EXPECT_EQ(Chain::transition_matrix(0.5), phi);
  EXPECT_EQ(Chain::sampled_input_matrix(0.5, -4), (EigenMatrix<double, 3>(-0.5, -2, 0)));
}

TEST(IntegratorChain, LiteralMatricesOfOrderThreeWithTwoExtensions) {
  using Chain = IntegratorChain<3, float, 2>;
  static_assert(Chain::size == 5 && Chain::order == 3 && Chain::extension == 2);
  EigenMatrix<float, 5, 5> phi;
  const float t4 = 16.0f / 24.0f;
  const float t3 = 8.0f / 6.0f;
  phi << 1, 2, 2, t3, t4, 0, 1, 2, 2, t3, 0, 0, 1, 2, 2, 0, 0, 0, 1, 2, 0, 0, 0, 0, 1;
  EXPECT_TRUE(eigen(Chain::transition_matrix(2.0f)).isApprox(phi, 1e-7f));
  EigenMatrix<float, 5> gamma;
  gamma << 3 * t3, 6, 6, 0, 0;
  EXPECT_TRUE(eigen(Chain::sampled_input_matrix(2.0f, 3.0f)).isApprox(gamma, 1e-7f));
  EXPECT_EQ(Chain::input_matrix(3.0f)(2), 3.0f);
  EXPECT_EQ(Chain::input_matrix(3.0f).sum(), 3.0f);
}

TEST(IntegratorChain, TransitionsCompose) {
  using Chain = IntegratorChain<4, double, 2>;
  const double t = 0.3;
  const double s = 0.45;
  EXPECT_TRUE(eigen(Chain::transition_matrix(t) * Chain::transition_matrix(s))
                  .isApprox(eigen(Chain::transition_matrix(t + s)), 1e-14));
  EXPECT_TRUE(eigen(Chain::transition_matrix(t) * Chain::transition_matrix(-t))
                  .isApprox(EigenMatrix<double, 6, 6>::Identity(), 1e-14));
  // Gamma(s + t) = Phi(t) Gamma(s) + Gamma(t).
  EXPECT_TRUE(eigen(Chain::transition_matrix(t) * Chain::sampled_input_matrix(s, 2.5) +
                    Chain::sampled_input_matrix(t, 2.5))
                  .isApprox(eigen(Chain::sampled_input_matrix(s + t, 2.5)), 1e-14));
}

template <class ChainType>
class Scaled : public ::testing::Test {};
using Chains = ::testing::Types<ScaledChain<1>, ScaledChain<2>, ScaledChain<3, double, 2>,
                                ScaledChain<1, double, 4>, ScaledChain<8, double, 4>>;
TYPED_TEST_SUITE(Scaled, Chains);

TYPED_TEST(Scaled, PredictsLikeTheMatrices) {
  constexpr int n = TypeParam::order;
  constexpr int m = TypeParam::extension;
  using Chain = IntegratorChain<n, double, m>;
  Random random(1);
  for (const double t : {1e-3, 0.7, 40.0}) {
    EigenMatrix<double, TypeParam::size> z;
    for (int r = 0; r < TypeParam::size; ++r) {
      z(r) = random.uniform(-1, 1) / static_cast<double>(esokit_test::nordsieck(r, t));
    }
    const double b0 = -2.5;
    const double u = 0.8 / static_cast<double>(esokit_test::nordsieck(n, t));
    const EigenMatrix<double, TypeParam::size> expected =
        Chain::transition_matrix(t) * z + Chain::sampled_input_matrix(t, b0) * u;
    const auto next = TypeParam::template predict<1>(TypeParam::scaled(z, t),
                                                     {TypeParam::scaled_input_gain(b0, t) * u});
    const auto physical = TypeParam::physical(next, 1 / t);
    for (int r = 0; r < TypeParam::size; ++r) {
      const double unit =
          std::ldexp(1.0, TypeParam::size) / static_cast<double>(esokit_test::nordsieck(r, t));
      EXPECT_NEAR(physical(r), expected(r), 1e-14 * unit) << r;
    }
  }
}

/// In whole numbers there is nothing to round.
TYPED_TEST(Scaled, PredictsWholeNumbersExactly) {
  constexpr int size = TypeParam::size;
  typename TypeParam::State x;
  std::vector<esokit_test::ExactPlant::Integer> whole;
  for (int r = 0; r < size; ++r) {
    whole.push_back(r % 2 == 0 ? r + 1 : -r - 2);
    x[static_cast<std::size_t>(r)] = static_cast<double>(whole.back());
  }
  esokit_test::ExactPlant plant(TypeParam::order, whole);
  for (int k = 0; k < 10; ++k) {
    plant.step(k - 4);
    x = TypeParam::template predict<1>(x, {static_cast<double>(k - 4)});
    for (int r = 0; r < size; ++r) {
      ASSERT_EQ(x[static_cast<std::size_t>(r)], static_cast<double>(plant.state(r)));
    }
  }
}

/// A drive with derivatives acts on the plant states as a disturbance with derivatives would, and
/// on the disturbance not at all.
TYPED_TEST(Scaled, DriveActsOnThePlantStatesAlone) {
  constexpr int n = TypeParam::order;
  constexpr int m = TypeParam::extension;
  typename TypeParam::State x;
  typename TypeParam::State with_drive;
  esokit::Array<double, m> drive;
  for (int r = 0; r < TypeParam::size; ++r) {
    x[static_cast<std::size_t>(r)] = 3 * r - 4;
    with_drive[static_cast<std::size_t>(r)] = 3 * r - 4;
  }
  for (int r = 0; r < m; ++r) {
    drive[static_cast<std::size_t>(r)] = 7 - 2 * r;
    with_drive[static_cast<std::size_t>(n + r)] += 7 - 2 * r;
  }
  const auto driven = TypeParam::template predict<m>(x, drive);
  const auto plant = TypeParam::template predict<1>(with_drive, {0.0});
  const auto free = TypeParam::template predict<1>(x, {0.0});
  for (std::size_t r = 0; r < TypeParam::size; ++r) {
    EXPECT_EQ(driven[r], r < n ? plant[r] : free[r]) << r;
  }
}

TYPED_TEST(Scaled, ScalingGoesThereAndBack) {
  const double t = 3e-4;
  EigenMatrix<double, TypeParam::size> z;
  for (int r = 0; r < TypeParam::size; ++r) z(r) = r + 1.25;
  const auto x = TypeParam::scaled(z, t);
  const auto back = TypeParam::physical(x, 1 / t);
  for (int r = 0; r < TypeParam::size; ++r) {
    EXPECT_NEAR(
        x[static_cast<std::size_t>(r)] / (z(r) * static_cast<double>(esokit_test::nordsieck(r, t))),
        1, 1e-14);
    EXPECT_NEAR(back(r) / z(r), 1, 1e-14);
  }
  const double gain = TypeParam::scaled_input_gain(-7.5, t);
  EXPECT_NEAR(gain / (-7.5 * static_cast<double>(esokit_test::nordsieck(TypeParam::order, t))), 1,
              1e-14);
  EXPECT_NEAR(TypeParam::template physical<TypeParam::order>(gain, 1 / t), -7.5, 1e-13);
}

TYPED_TEST(Scaled, ProbeSeesEveryState) {
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t r = 0; r < TypeParam::size; ++r) {
    for (const double bad : {inf, -inf, nan}) {
      typename TypeParam::State x{};
      EXPECT_TRUE(std::isfinite(TypeParam::finite_probe(x, 1000)));
      x[r] = bad;
      EXPECT_FALSE(std::isfinite(TypeParam::finite_probe(x, 1000))) << r;
    }
    // Finite in scaled form, not in physical units.
    if (r > 0) {
      typename TypeParam::State x{};
      x[r] = 1e306;
      EXPECT_FALSE(std::isfinite(TypeParam::finite_probe(x, 1e4))) << r;
      EXPECT_FALSE(std::isfinite(TypeParam::physical(x, 1e4)(static_cast<int>(r))));
    }
  }
}

TEST(ScaledChain, PredictsAtCompileTime) {
  using Chain = ScaledChain<2, float>;
  constexpr Chain::State x = Chain::predict<1>({1.0f, 2.0f, 3.0f}, {10.0f});
  static_assert(x[0] == 16 && x[1] == 28 && x[2] == 3);
}

/// Float at T = 1e-4 and N = 12: T^-11 = 1e44 does not fit, the estimate does.
TEST(ScaledChain, SurvivesSmallSampleTimesInFloat) {
  using Chain = ScaledChain<8, float, 4>;
  EigenMatrix<float, 12> z = EigenMatrix<float, 12>::Zero();
  z(8) = 3.0f;
  const auto x = Chain::scaled(z, 1e-4f);
  EXPECT_GT(x[8], 0.0f);
  EXPECT_NEAR(Chain::physical(x, 1e4f)(8), 3.0f, 1e-5f);
}

}  // namespace analysis_integrator_chain_test
