// The C of a profile equals it bit for bit: moves, targets that change on the way, bad ones,
// starts.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/target/profile_code.hpp>
#include <limits>
#include <target/written.hpp>
#include <vector>

namespace esokit_test {
namespace target_profile_code_test {

using namespace esokit;

template <int Order, class S>
SmoothProfile<Order, S> profile(S shortest_time = S(0)) {
  SmoothProfileConfig<Order, S> config{.shortest_time = shortest_time, .sample_time = S(0.004)};
  config.limits[Order - 1] = S(20);
  if constexpr (Order > 1) config.limits[0] = S(3);
  return SmoothProfile<Order, S>::make(config).value();
}

template <int Order, int Capacity, class S>
ApproachProfile<Order, Capacity, S> approach(double gain, double pole) {
  return ApproachProfile<Order, Capacity, S>::make({.pole = S(pole),
                                                    .lag = Order == 2 ? S(0.3) : S(0),
                                                    .input_gain = S(gain),
                                                    .limits = {.lower = S(-10), .upper = S(70)},
                                                    .dead_time = S(0.02 * (Capacity - 1)),
                                                    .bandwidth = S(1.5),
                                                    .sample_time = S(0.02)})
      .value();
}

/// @param fastest 0: no limit of speed @param filter_time in samples
template <int Order, class S>
FollowProfile<Order, S> follower(double fastest, double filter_time, double sample_time = 0.004) {
  FollowProfileConfig<Order, S> config{.filter_time = static_cast<S>(filter_time * sample_time),
                                       .sample_time = static_cast<S>(sample_time)};
  config.limits[Order - 1] = S(20);
  if (fastest > 0 || Order == 2) config.limits[0] = static_cast<S>(fastest);
  return FollowProfile<Order, S>::make(config).value();
}

#ifdef ESOKIT_LOADS_C

template <int Order, class S>
void equals_profile(std::uint64_t seed, S shortest_time = S(0)) {
  SCOPED_TRACE(testing::Message() << "order " << Order << ", " << sizeof(S) << " bytes");
  auto mine = profile<Order, S>(shortest_time);
  const Folder folder;
  const Library library(folder, to_c(mine, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  struct State {
    S start, target;
    std::int32_t sample, samples;
  } its{};
  bool (*reset)(State*, S) = nullptr;
  bool (*update)(State*, S) = nullptr;
  bool (*moves)(const State*) = nullptr;
  void (*motion)(const State*, S*) = nullptr;
  int (*self_test)(S) = nullptr;
  library.find(reset, "loop_reset");
  library.find(update, "loop_update");
  library.find(moves, "loop_moves");
  library.find(motion, "loop_motion");
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(S(0)), 0);
  Random random(seed);
  S target(0);
  int finished = 0;
  int refused = 0;
  for (int k = 0; k < 40000 && !testing::Test::HasFailure(); ++k) {
    if (random.index(50) == 0) target = static_cast<S>(random.uniform(-3, 3));
    S given = target;
    if (random.index(100) == 0) given = anything<S>(random);
    if (random.index(1000) == 0) {
      const S at = random.index(4) == 0 ? hidden_nan<S>() : given;
      EXPECT_EQ(mine.reset(at), reset(&its, at));
    }
    const bool moved = mine.moving();
    const bool good = mine.update(given);
    EXPECT_EQ(good, update(&its, given)) << k;
    EXPECT_EQ(mine.moving(), moves(&its)) << k;
    std::array<S, std::size_t{Order} + 1> of_c{};
    motion(&its, of_c.data());
    const auto of_cpp = mine.motion();
    for (int i = 0; i <= Order; ++i) {
      EXPECT_TRUE(equal_bits(S(of_cpp(i)), of_c[static_cast<std::size_t>(i)]))
          << "sample " << k << ", derivative " << i;
    }
    finished += moved && !mine.moving();
    refused += !good;
    // A move over an absurd way would last for the rest of the test.
    if (detail::absolute(S(of_cpp(0))) > S(100)) {
      EXPECT_EQ(mine.reset(S(0)), reset(&its, S(0)));
    }
  }
  EXPECT_GT(finished, 40);
  EXPECT_GT(refused, 40);
  // Which way is too far: to the last digit.
  const auto accepts = [&](S to) {
    EXPECT_TRUE(mine.reset(S(0)) && reset(&its, S(0)));
    const bool good = mine.update(to);
    EXPECT_EQ(good, update(&its, to)) << to;
    return good;
  };
  S good(1);
  S bad(1);
  while (accepts(bad)) bad = bad * S(2);
  for (S middle = bad / 2; good < middle && middle < bad; middle = good + (bad - good) / 2) {
    (accepts(middle) ? good : bad) = middle;
  }
  EXPECT_GT(good, S(1));
}

TEST(ProfileCode, EqualsTheProfile) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_profile<1, double>(1);
  equals_profile<2, float>(2);
  equals_profile<2, double>(3, 0.5);
  equals_profile<3, double>(4);
  equals_profile<4, float>(5);
}

/// Targets that change on the way, starts elsewhere, and bad numbers of both.
template <int Order, int Capacity, class S>
void equals_approach(std::uint64_t seed, double gain, double pole) {
  SCOPED_TRACE(testing::Message() << Order << " " << Capacity << ", " << sizeof(S) << " bytes");
  auto mine = approach<Order, Capacity, S>(gain, pole);
  const Folder folder;
  const Library library(folder, to_c(mine, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  std::vector<std::uint64_t> its(1000);
  bool (*start)(void*, S, S) = nullptr;
  bool (*update)(void*, S) = nullptr;
  void (*motion)(const void*, S*) = nullptr;
  S (*feed)(const void*) = nullptr;
  int (*self_test)(S) = nullptr;
  library.find(start, "loop_start");
  library.find(update, "loop_update");
  library.find(motion, "loop_motion");
  library.find(feed, "loop_feed");
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(S(0)), 0);
  Random random(seed);
  const auto same = [&](int k) {
    std::array<S, std::size_t{Order} + 1> of_c{};
    motion(its.data(), of_c.data());
    for (int i = 0; i <= Order; ++i) {
      EXPECT_TRUE(equal_bits(S(mine.motion()(i)), of_c[static_cast<std::size_t>(i)]))
          << "sample " << k << ", derivative " << i;
    }
    EXPECT_TRUE(equal_bits(mine.feed(), feed(its.data()))) << k;
  };
  S target(0);
  int refused = 0, starts = 0, exact = 0;
  for (int k = 0; k < 40000 && !testing::Test::HasFailure(); ++k) {
    // Far away for float, whose digits do not hold a small step there.
    if (random.index(80) == 0) target = static_cast<S>(random.uniform(-30, 30) + 3000);
    S given = target;
    if (random.index(100) == 0)
      given = random.index(4) == 0 ? hidden_nan<S>() : anything<S>(random);
    if (random.index(1000) == 0 || k == 50) {
      S y = static_cast<S>(random.uniform(2970, 3030));
      S u = static_cast<S>(random.uniform(-20, 80));
      if (random.index(3) == 0) (random.index(2) == 0 ? y : u) = anything<S>(random);
      const bool started = mine.start(y, u);
      EXPECT_EQ(started, start(its.data(), y, u)) << y << " " << u;
      ++(started ? starts : refused);
      same(k);
    }
    const bool good = mine.update(given);
    EXPECT_EQ(good, update(its.data(), given)) << k;
    refused += !good;
    same(k);
    exact += mine.motion()(0) == target;
    // Back from an absurd place, which would take the rest of the test.
    if (detail::absolute(S(mine.motion()(0))) > S(1e5)) {
      EXPECT_TRUE(mine.start(target, S(1)) && start(its.data(), target, S(1)));
    }
  }
  EXPECT_GT(refused, 40);
  EXPECT_GT(starts, 20);
  EXPECT_GT(exact, 10);
  // What is too far: to the last digit.
  const auto accepts = [&](S y, S u) {
    const bool good = mine.start(y, u);
    EXPECT_EQ(good, start(its.data(), y, u)) << y << " " << u;
    return good;
  };
  for (const bool of_place : {true, false}) {
    const auto fits = [&](S x) { return of_place ? accepts(x, S(1)) : accepts(S(1), x); };
    S good(1);
    S bad = std::numeric_limits<S>::max();
    EXPECT_FALSE(fits(bad));
    for (int i = 0; i < 4000; ++i) {
      // Half way between the exponents first.
      const S middle =
          bad / 2 > good ? S(std::sqrt(good) * std::sqrt(bad)) : good + (bad - good) / 2;
      if (!(good < middle && middle < bad)) break;
      (fits(middle) ? good : bad) = middle;
    }
    EXPECT_GT(good, S(1));
  }
}

TEST(ProfileCode, EqualsTheApproach) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_approach<1, 1, double>(11, 2.0, 0.05);
  equals_approach<1, 6, float>(12, -0.3, 0.0);
  equals_approach<2, 1, float>(13, 0.7, 0.1);
  equals_approach<2, 9, double>(14, -40.0, 0.3);
}

TEST(ProfileCode, AnApproachIsTested) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  const CCode code = to_c(approach<2, 1, float>(0.7, 0.1), {.name = "loop"}).value();
  reaches(code);
  notices(code,
          {{"o->held = u;", "o->held = 0.0f;"},
           {"inside = down;", "inside = change;"},
           {"o->behind = 0.0f;", ""}},
          0.0F);
}

/// A FollowProfile and its C, each call of which has to give the same.
template <int Order, class S>
class Followers {
 public:
  using Profile = FollowProfile<Order, S>;
  using Motion = typename Profile::Motion;

  Followers(const Folder& folder, const Profile& profile)
      : mine_(profile), library_(folder, to_c(profile, {.name = "loop"}).value(), "") {
    if (!library_.loaded()) return;
    library_.find(start_, "loop_start");
    library_.find(update_, "loop_update");
    library_.find(wait_, "loop_wait");
    library_.find(motion_, "loop_motion");
    library_.find(self_test_, "loop_self_test");
    EXPECT_EQ(self_test_(S(0)), 0);
  }
  [[nodiscard]] bool loaded() const { return library_.loaded(); }
  [[nodiscard]] Motion motion() const { return mine_.motion(); }

  bool start(S y, S speed) {
    const bool good = mine_.start(y, speed);
    EXPECT_EQ(good, start_(its_.data(), y, speed)) << y << " " << speed;
    same();
    return good;
  }
  bool update(const Motion& target) {
    std::array<S, std::size_t{Order} + 1> given{};
    for (int i = 0; i <= Order; ++i) given[static_cast<std::size_t>(i)] = target(i);
    const bool good = mine_.update(target);
    EXPECT_EQ(good, update_(its_.data(), given.data()));
    same();
    return good;
  }
  void wait() {
    mine_.wait();
    wait_(its_.data());
    same();
  }

 private:
  void same() {
    std::array<S, std::size_t{Order} + 1> of_c{};
    motion_(its_.data(), of_c.data());
    for (int i = 0; i <= Order; ++i) {
      const S its = of_c[static_cast<std::size_t>(i)];
      EXPECT_TRUE(equal_bits(S(mine_.motion()(i)), its))
          << "call " << calls_ << ", derivative " << i << ": " << mine_.motion()(i) << " " << its;
      EXPECT_TRUE(is_finite(its));
    }
    ++calls_;
  }

  Profile mine_;
  Library library_;
  std::array<S, 32> its_{};
  int calls_ = 0;
  bool (*start_)(void*, S, S) = nullptr;
  bool (*update_)(void*, const S*) = nullptr;
  void (*wait_)(void*) = nullptr;
  void (*motion_)(const void*, S*) = nullptr;
  int (*self_test_)(S) = nullptr;
};

/// What a following reference gets: targets that rest, jump in each sample, move and accelerate,
/// are lost for a while; an axis that is held, and starts.
template <int Order, class S>
class Targets {
 public:
  explicit Targets(std::uint64_t seed) : random_(seed) {}

  int refused = 0, waits = 0, starts = 0;

  void call(Followers<Order, S>& all, double T) {
    if (random_.index(150) == 0) begin();
    for (int i = 0; i < Order; ++i) target_(i) = target_(i) + static_cast<S>(T) * target_(i + 1);
    auto given = target_;
    if (jumps_) given(0) = number(0.5);
    if (random_.index(60) == 0) lost_ = random_.index(20);
    if (lost_ > 0) given(random_.index(Order + 1)) = hidden_nan<S>();
    if (random_.index(100) == 0) given(random_.index(Order + 1)) = anything<S>(random_);
    if (random_.index(100) == 0) held_ = random_.index(30);
    if (random_.index(300) == 0) {
      const bool odd = random_.index(3) == 0;
      starts += all.start(odd ? anything<S>(random_) : number(3), number(20));
      if (random_.index(3) == 0) refused += !all.start(number(3), anything<S>(random_));
    }
    if (held_ > 0) {
      all.wait();
      ++waits;
    } else {
      refused += !all.update(given);
    }
    --lost_;
    --held_;
    // Back from an absurd place, which would take the rest of the test.
    if (detail::absolute(S(all.motion()(0))) > S(1e5) && random_.index(20) == 0) {
      EXPECT_TRUE(all.start(S(1), S(0)));
      begin();
    }
  }

 private:
  S number(double most) { return static_cast<S>(random_.uniform(-most, most)); }

  void begin() {
    target_ = Vector<S, Order + 1>::Zero();
    target_(0) = random_.index(5) == 0 ? S(3000) : number(2);
    if (random_.index(2) == 0) target_(1) = number(3);
    if (random_.index(2) == 0) target_(Order) = number(25);
    jumps_ = random_.index(3) == 0;
  }

  Random random_;
  Vector<S, Order + 1> target_ = Vector<S, Order + 1>::Zero();
  bool jumps_ = false;
  int lost_ = 0, held_ = 0;
};

template <int Order, class S>
void equals_follow(std::uint64_t seed, double fastest, double filter_time) {
  SCOPED_TRACE(testing::Message() << Order << " " << fastest << ", " << sizeof(S) << " bytes");
  const Folder folder;
  Followers<Order, S> all(folder, follower<Order, S>(fastest, filter_time));
  ASSERT_TRUE(all.loaded());
  Targets<Order, S> targets(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  const auto samples = asked("ESOKIT_WRITTEN_SAMPLES", 40000);
  for (std::uint64_t k = 0; k < samples && !testing::Test::HasFailure(); ++k) {
    targets.call(all, 0.004);
  }
  EXPECT_GT(targets.refused, 400);
  EXPECT_GT(targets.waits, 400);
  EXPECT_GT(targets.starts, 40);
  // What is too far or too fast: to the last digit, and what follows from the last that is not.
  for (const int what : {0, 1, 2, 3}) {
    const auto fits = [&](S x) {
      typename FollowProfile<Order, S>::Motion target = FollowProfile<Order, S>::Motion::Zero();
      target(what % 2) = x;
      if (what > 1) return all.update(target);
      return what == 0 ? all.start(x, S(1)) : all.start(S(1), x);
    };
    S good(1);
    S bad = std::numeric_limits<S>::max();
    if (fits(bad)) continue;  // a speed that is limited
    for (int i = 0; i < 4000; ++i) {
      const S middle =
          bad / 2 > good ? S(std::sqrt(good) * std::sqrt(bad)) : good + (bad - good) / 2;
      if (!(good < middle && middle < bad)) break;
      (fits(middle) ? good : bad) = middle;
    }
    EXPECT_GT(good, S(1));
    EXPECT_TRUE(fits(good));
    for (int k = 0; k < 200; ++k) (void)fits(k % 40 < 20 ? S(-good) : good);
  }
}

TEST(ProfileCode, EqualsTheFollower) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_follow<1, double>(21, 20, 0);
  equals_follow<1, float>(22, 20, 3);
  equals_follow<2, double>(23, 3, 0);
  equals_follow<2, float>(24, 3, 4);
  equals_follow<2, double>(25, 0, 2);
  equals_follow<2, float>(26, 0, 0);
}

/// Where the samples of its self-test are beyond the scalar.
TEST(ProfileCode, ATestOfItselfHasNumbers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto profile = ApproachProfile<1, 0, float>::make({.input_gain = 1e36F,
                                                           .limits = {.lower = -10, .upper = 10},
                                                           .bandwidth = 0.1F,
                                                           .sample_time = 100})
                           .value();
  const Folder folder;
  const Library library(folder, to_c(profile, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  int (*self_test)(float) = nullptr;
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(0), 0);
}

TEST(ProfileCode, CompilesWithOtherCompilers) {
  const CCode code = to_c(profile<2, float>(), {.name = "move", .comment = "of the axis"}).value();
  EXPECT_NE(code.header.find(" * of the axis\n"), std::string::npos);
  compiles_elsewhere(code, "move");
  compiles_elsewhere(to_c(approach<2, 4, float>(2, 0.1), {.name = "heat"}).value(), "heat");
  const CodeOptions loop{.name = "cut"};
  compiles_elsewhere(to_c(follower<1, float>(3, 0), loop).value(), "cut");
  compiles_elsewhere(to_c(follower<2, float>(0, 0), loop).value(), "cut");
  compiles_elsewhere(to_c(follower<2, double>(3, 2), loop).value(), "cut");
}

#endif  // ESOKIT_LOADS_C

TEST(ProfileCode, RefusesByName) {
  const auto code = to_c(profile<2, double>(), {.name = "2nd"});
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "name");
  const auto other = to_c(approach<1, 1, double>(2, 0), {.self_test_samples = 0});
  ASSERT_FALSE(other);
  EXPECT_STREQ(other.error().field, "self_test_samples");
  const auto follow = to_c(follower<2, double>(3, 0), {.name = "a b"});
  ASSERT_FALSE(follow);
  EXPECT_STREQ(follow.error().field, "name");
}

}  // namespace target_profile_code_test
}  // namespace esokit_test
