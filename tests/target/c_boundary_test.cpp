// Written C decides as the C++ does on both sides of each boundary: numbers next to each other, of
// which one is accepted, or counted as another turn, and the other is not.
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_boundary_test {

#if ESOKIT_LOADS_C

/// All estimates and the status of a sample as bits.
template <class Observer>
std::vector<std::uint64_t> result_of(Observer observer, typename Observer::scalar_type y,
                                     typename Observer::scalar_type u) {
  std::vector<std::uint64_t> all{static_cast<unsigned>(observer.update(y, u))};
  detail::unroll<Observer::size>([&](auto row) {
    const auto x = observer.template estimate<row>();
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof x);
    all.push_back(bits);
  });
  return all;
}
template <class V>
std::vector<std::uint64_t> result_of(InC<V>& in_c, int size, V y, V u) {
  const auto before = in_c.state();
  std::vector<std::uint64_t> all{in_c.observe(y, u)};
  for (int row = 0; row < size; ++row) {
    const V x = in_c.estimate(static_cast<unsigned>(row));
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof x);
    all.push_back(bits);
  }
  in_c.state() = before;
  return all;
}

/// Between two measurements of different status those next to each other.
template <class Observer, class V>
std::pair<V, V> boundary(const Observer& observer, V a, V b, V u) {
  const auto of_a = result_of(observer, a, u)[0];
  for (;;) {
    const V middle = a + (b - a) / V(2);
    if (!(middle > (std::min)(a, b) && middle < (std::max)(a, b))) return {a, b};
    (result_of(observer, middle, u)[0] == of_a ? a : b) = middle;
  }
}

/// Regular measurements, each second or third one, none for a while, jumps, and motion across the
/// end of the range; at each sample boundaries are looked for around what is measured.
template <class Observer, class Change>
void decides(double speed, std::uint64_t seed, const Change& change) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  auto config = observer_config<Observer>(8);
  change(config);
  auto observer = Observer::make(config).value();
  const Folder folder;
  InC<V> in_c(folder, to_c(observer, {.name = "loop"}).value(), false);
  ASSERT_TRUE(in_c.loaded());
  Random random(seed);
  int found = 0;
  double angle = 0;
  double jump = 0;
  int every = 1;
  for (int k = 0; k < 4000 && !testing::Test::HasFailure(); ++k) {
    if (random.index(50) == 0) every = 1 + random.index(4);
    if (random.index(120) == 0) jump = jump > 0 ? 0 : random.uniform(0.2, 1.2);
    if (random.index(200) == 0) speed = -speed * random.uniform(0.8, 1.2);
    if (std::abs(speed) > 1.3) speed *= 0.5;
    angle += speed;
    const V y = static_cast<V>(std::remainder(angle + jump + 1e-3 * random.uniform(-1, 1), 2.5));
    const V u = static_cast<V>(0.1 * random.uniform(-1, 1));
    if (k % every != 0) {
      EXPECT_EQ(static_cast<unsigned>(observer.predict(u)), in_c.predict(u)) << k;
      continue;
    }
    const V other = y + static_cast<V>(random.uniform(-1.5, 1.5));
    if (result_of(observer, y, u)[0] != result_of(observer, other, u)[0]) {
      const auto [a, b] = boundary(observer, y, other, u);
      for (const V at : {a, b}) {
        EXPECT_EQ(result_of(observer, at, u), result_of(in_c, Observer::size, at, u))
            << "sample " << k << ", y = " << at;
      }
      ++found;
    }
    EXPECT_EQ(static_cast<unsigned>(observer.update(y, u)), in_c.observe(y, u)) << k;
    compare_estimates(observer, in_c, k);
  }
  EXPECT_GT(found, 100);
}

TEST(CBoundary, OfAGate) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto patient = [](auto& config) { config.most_in_a_row = 7; };
  decides<OutlierGate<LinearEso<2, double>>>(0.002, 1, patient);
  decides<OutlierGate<LinearEso<1, float>>>(0.01, 2, patient);
}

TEST(CBoundary, OfAnAngle) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto as_it_is = [](auto&) {};
  decides<WrappedOutput<LinearEso<2, double>>>(0.3, 11, as_it_is);
  decides<WrappedOutput<LinearEso<1, float>>>(0.5, 12, as_it_is);
}

TEST(CBoundary, OfAGatedAngle) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto patient = [](auto& config) { config.observer.most_in_a_row = 40; };
  decides<WrappedOutput<OutlierGate<LinearEso<2, double>>>>(0.3, 21, patient);
  decides<WrappedOutput<OutlierGate<LinearEso<1, float>>>>(0.2, 22, patient);
}

TEST(CBoundary, OfAFilter) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  decides<ExtendedStateFilter<1, double>>(0.002, 31,
                                          [](auto& config) { config.outlier_threshold = 9; });
}

/// A prediction that overflows under the u that was applied before, or one as large, does so by the
/// state, not by u.
TEST(CBoundary, OfBlame) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Observer = LinearEso<2, double>;
  Observer observer = Observer::make(observer_config<Observer>(8)).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(observer, {.name = "loop"}).value(), false);
  ASSERT_TRUE(in_c.loaded());
  Random random(41);
  int dropped = 0;
  double u = 1.5e308;
  for (int k = 0; k < 20000 && !testing::Test::HasFailure(); ++k) {
    if (k % 100 == 0) u = random.index(2) == 0 ? 1.5e308 : 1e-3;
    if (random.index(40) == 0) u = -u;
    // Long enough in a row to overflow.
    const bool corrects = k % 100 > 60;
    const auto mine =
        static_cast<unsigned>(corrects ? observer.update(0.5, u) : observer.predict(u));
    EXPECT_EQ(mine, corrects ? in_c.observe(0.5, u) : in_c.predict(u)) << k;
    compare_estimates(observer, in_c, k);
    dropped += (mine & 4U) != 0;
  }
  EXPECT_GT(dropped, 100);
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_boundary_test
}  // namespace esokit_test
