// The C that to_c writes equals the controller bit for bit: u, estimates, status, mode and gap,
// with noise, overload, bad samples, gaps beyond every limit, reported u and starts. It is compiled
// here, strictly, by the C compiler of the machine.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#if __has_include(<dlfcn.h>) && __has_include(<unistd.h>)
#define ESOKIT_LOADS_C 1
#include <dlfcn.h>
#include <unistd.h>
#endif

#include <control/loop_traits.hpp>

namespace esokit_test {
namespace target_c_code_test {

using namespace esokit;

template <class V>
bool equal_bits(V a, V b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

template <class C>
auto config(double input_gain) {
  using V = typename C::scalar_type;
  typename C::Config config{};
  config.observer.sample_time = V(0.0078125);
  config.observer.input_gain = V(input_gain);
  config.observer.max_gap = 5;
  if constexpr (requires { config.observer.bandwidth_factor; }) {
    config.observer.observer_bandwidth = V(15);
    config.observer.bandwidth_factor = V(1.5);
  } else if constexpr (requires { config.observer.observer_bandwidth; }) {
    config.observer.observer_bandwidth = C::order == 3 ? V(15) : V(30);
  } else {
    config.observer.poles[0] = {-20, 5};
    config.observer.poles[1] = {-20, -5};
    config.observer.poles[2] = {-9, 0};
  }
  config.controller_bandwidth = C::order == 3 ? V(1.5) : V(4);
  config.limits = {V(-3), V(2.5), V(60)};
  config.start_hold = {.time = V(0.1), .input = V(0.5)};
  config.missing = {.most = 9, .input = V(-0.5)};
  return config;
}

// What has gains of another kind, or runs lane by lane.
static constexpr ModelParts parts{.order = 1, .actuator = 1};
static_assert(detail::GainIsKept<LinearEso<2>> && detail::GainIsKept<CascadeEso<2, 3>>);
static_assert(!detail::GainIsKept<AlgebraicEso<2>> && !detail::GainIsKept<ModelEso<parts>> &&
              !detail::GainIsKept<AdjustableBandwidthEso<2>> &&
              !detail::GainIsKept<ExtendedStateFilter<2>> &&
              !detail::GainIsKept<OutlierGate<LinearEso<2>>>);

#ifdef ESOKIT_LOADS_C

/// A folder of this process, removed at the end.
class Folder {
 public:
  Folder()
      : path_(std::filesystem::temp_directory_path() /
              ("esokit_c_code_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
  }

 private:
  std::filesystem::path path_;
};

bool runs(const std::string& command) { return std::system(command.c_str()) == 0; }
bool there(const std::string& program) {
  return runs("command -v " + program + " >/dev/null 2>&1");
}

constexpr const char* strict = " -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror ";

/// The compiled C of a controller.
template <class V>
class InC {
 public:
  InC(const Folder& folder, const CCode& code, bool is_controller,
      const std::string& compiler = "gcc -std=c99") {
    folder.write("loop.h", code.header);
    folder.write("loop.c", code.source);
    folder.write("probe.c", std::string("#include \"loop.h\"\n"
                                        "unsigned loop_size(void);\n"
                                        "unsigned loop_size(void) { return sizeof(loop_state); }\n"
                                        "unsigned loop_probe(const loop_state *o);\n"
                                        "unsigned loop_probe(const loop_state *o) { return ") +
                                (is_controller ? "o->status + 256u * o->mode + " : "") +
                                "65536u * o->gap; }\n");
    const std::string out = folder.file("loop" + std::to_string(count++) + ".so");
    built_ = runs(compiler + " -O2 -shared -fPIC -DLOOP_SELF_TEST" + std::string(strict) + "-o " +
                  out + " " + folder.file("loop.c") + " " + folder.file("probe.c") + " -lm");
    if (!built_) return;
    handle_ = dlopen(out.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle_ == nullptr) return;
    find(init_, "loop_init");
    find(update_, "loop_update");
    find(estimate_, "loop_estimate");
    find(probe_, "loop_probe");
    find(self_test_, "loop_self_test");
    if (is_controller) {
      find(start_, "loop_start");
      find(miss_, "loop_update_without_measurement");
      find(applied_, "loop_applied");
    } else {
      find(observe_, "loop_update");
      find(predict_, "loop_predict");
      find(correct_, "loop_correct");
      find(reset_, "loop_reset");
    }
    unsigned (*bytes)() = nullptr;
    find(bytes, "loop_size");
    state_.resize(bytes() / sizeof(std::uint64_t) + 1);
    init_(state_.data());
  }
  ~InC() {
    if (handle_ != nullptr) dlclose(handle_);
  }
  InC(const InC&) = delete;
  InC& operator=(const InC&) = delete;

  [[nodiscard]] bool loaded() const { return handle_ != nullptr; }
  V update(V y, V r) { return update_(state_.data(), y, r); }
  V miss(V r) { return miss_(state_.data(), r); }
  void applied(V u) { applied_(state_.data(), u); }
  unsigned start(V y, V u) { return start_(state_.data(), y, u); }
  unsigned observe(V y, V u) { return observe_(state_.data(), y, u); }
  unsigned predict(V u) { return predict_(state_.data(), u); }
  unsigned correct(V y) { return correct_(state_.data(), y); }
  unsigned reset(V y) { return reset_(state_.data(), y); }
  V estimate(unsigned row) { return estimate_(state_.data(), row); }
  /// status + 256 mode + 65536 gap
  unsigned probe() { return probe_(state_.data()); }
  int self_test(V tolerance) { return self_test_(tolerance); }

 private:
  template <class F>
  void find(F& function, const char* name) {
    function = reinterpret_cast<F>(dlsym(handle_, name));
    ASSERT_NE(function, nullptr) << name;
  }

  static inline int count = 0;
  bool built_ = false;
  void* handle_ = nullptr;
  std::vector<std::uint64_t> state_;
  void (*init_)(void*) = nullptr;
  unsigned (*start_)(void*, V, V) = nullptr;
  V (*update_)(void*, V, V) = nullptr;
  V (*miss_)(void*, V) = nullptr;
  void (*applied_)(void*, V) = nullptr;
  unsigned (*observe_)(void*, V, V) = nullptr;
  unsigned (*predict_)(void*, V) = nullptr;
  unsigned (*correct_)(void*, V) = nullptr;
  unsigned (*reset_)(void*, V) = nullptr;
  V (*estimate_)(void*, unsigned) = nullptr;
  unsigned (*probe_)(const void*) = nullptr;
  int (*self_test_)(V) = nullptr;
};

struct Seen {
  int odd = 0, limited = 0, safe = 0;
  int of_status[64] = {};
};

template <class Observer, class V>
void compare_estimates(const Observer& observer, InC<V>& in_c, int k) {
  detail::unroll<Observer::size>([&](auto row) {
    EXPECT_TRUE(equal_bits(V(observer.template estimate<row>()), in_c.estimate(row)))
        << "sample " << k << ", estimate " << row;
  });
}

/// Both in the same loop, so many samples. @return what was met
template <class C>
Seen compare(const C& fresh, InC<typename C::scalar_type>& in_c, double input_gain, int samples,
             std::uint64_t seed) {
  using V = typename C::scalar_type;
  C controller = fresh;
  ChainPlant plant(C::order, 0.0078125, input_gain, 1.5);
  Random random(seed);
  Seen seen;
  V r(1);
  int lost = 0;
  double u = 0;
  for (int k = 0; k < samples; ++k) {
    plant.set_disturbance(2 * std::sin(0.01 * k));
    plant.step(u);
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
    if (k % 5000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    constexpr int runs[] = {1, 2, 4, 6, 8, 12, 30};
    if (lost > 0) --lost;
    if (random.index(200) == 0) lost = runs[random.index(7)];
    if (lost > 0 || random.index(300) == 0) y = hidden_nan<V>();
    if (random.index(150) == 0) y = anything<V>(random);
    const V given = random.index(400) == 0 ? anything<V>(random) : r;
    if (random.index(30) == 0) {
      const V held = random.index(10) == 0 ? anything<V>(random) : static_cast<V>(0.9 * u);
      controller.applied(held);
      controller.update(y, given);
      in_c.applied(held);
      in_c.update(y, given);
    } else if (random.index(100) == 0) {
      controller.update_without_measurement(given);
      in_c.miss(given);
    } else if (random.index(2000) == 0) {
      const V at = random.index(4) == 0 ? anything<V>(random) : static_cast<V>(plant.output());
      const V under = random.index(4) == 0 ? anything<V>(random) : static_cast<V>(u);
      EXPECT_EQ(static_cast<unsigned>(controller.start(at, under)), in_c.start(at, under)) << k;
      controller.update(y, given);
      in_c.update(y, given);
    } else {
      const V mine = controller.update(y, given);
      const V its = in_c.update(y, given);
      EXPECT_TRUE(equal_bits(mine, its)) << "sample " << k << ": " << mine << ", C " << its;
    }
    u = static_cast<double>(controller.output());
    const unsigned told = in_c.probe();
    const auto status = static_cast<unsigned>(controller.status());
    EXPECT_EQ(told % 256, status) << "sample " << k;
    EXPECT_EQ(told / 256 % 256, static_cast<unsigned>(controller.mode())) << "sample " << k;
    EXPECT_EQ(told / 65536, static_cast<unsigned>(controller.observer().missed()))
        << "sample " << k;
    compare_estimates(controller.observer(), in_c, k);
    seen.odd += status != 0;
    seen.limited += !equal_bits(controller.output(), controller.requested());
    seen.safe += controller.mode() == LoopMode::safe;
    ++seen.of_status[status % 64];
    if (testing::Test::HasFailure()) return seen;
  }
  return seen;
}

template <class Observer>
void equals(int samples, std::uint64_t seed, const std::string& compiler = "gcc -std=c99") {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using C = Adrc<Observer>;
  using V = typename C::scalar_type;
  const Folder folder;
  for (const double input_gain : {8.0, -8.0}) {
    const C controller = C::make(config<C>(input_gain)).value();
    const CCode code = to_c(controller, {.name = "loop", .comment = "a test"}).value();
    InC<V> in_c(folder, code, true, compiler);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    const Seen seen = compare(controller, in_c, input_gain, samples, seed++);
    EXPECT_GT(seen.odd, samples / 100);
    EXPECT_GT(seen.limited, samples / 10);
    EXPECT_GT(seen.safe, samples / 500);
    for (const StepStatus status :
         {StepStatus::measurement_rejected, StepStatus::gap_bridged, StepStatus::restarted}) {
      EXPECT_GT(seen.of_status[static_cast<int>(status)], samples / 2000);
    }
  }
}

/// An observer alone, with its halves, resets and gaps.
template <class Observer>
void observes(int samples, std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  const Folder folder;
  for (const double input_gain : {8.0, -8.0}) {
    auto observer = Observer::make(config<Adrc<Observer>>(input_gain).observer).value();
    const CCode code = to_c(observer, {.name = "loop"}).value();
    InC<V> in_c(folder, code, false);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    Random random(seed++);
    const auto signal = [&] {
      return random.index(20) == 0 ? anything<V>(random) : static_cast<V>(random.uniform(-1, 1));
    };
    int odd = 0;
    for (int k = 0; k < samples && !testing::Test::HasFailure(); ++k) {
      const V y = signal();
      const V u = signal();
      const int what = random.index(1000);
      unsigned mine = 0;
      unsigned its = 0;
      if (what < 930) {
        mine = static_cast<unsigned>(observer.update(y, u));
        its = in_c.observe(y, u);
      } else if (what < 970) {
        for (int i = random.index(10); i >= 0; --i) {
          mine = static_cast<unsigned>(observer.predict(u));
          its = in_c.predict(u);
        }
      } else if (what < 995) {
        mine = static_cast<unsigned>(observer.correct(y));
        its = in_c.correct(y);
      } else {
        mine = static_cast<unsigned>(observer.reset(y));
        its = in_c.reset(y);
      }
      EXPECT_EQ(mine, its) << "sample " << k << ", call " << what;
      EXPECT_EQ(in_c.probe() / 65536, static_cast<unsigned>(observer.missed())) << "sample " << k;
      compare_estimates(observer, in_c, k);
      odd += mine != 0;
    }
    EXPECT_GT(odd, samples / 20);
  }
}

constexpr int million =
#if defined(ESOKIT_ONE_TYPE)
    10000;
#else
    500000;  // for each sign of b0
#endif

TEST(CCode, OfALinearObserverInDouble) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<LinearEso<2, double>>(million, 11);
}
TEST(CCode, OfALinearObserverInFloat) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<LinearEso<2, float>>(million, 21);
}
TEST(CCode, OfAnObserverAlone) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  observes<LinearEso<2, float>>(million, 101);
#ifndef ESOKIT_ONE_TYPE
  observes<LinearEso<2, double>>(million, 111);
  observes<CascadeEso<2, 3, double>>(30000, 121);
#endif
}

#ifndef ESOKIT_ONE_TYPE
TEST(CCode, OfOtherObservers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<LinearEso<1, float>>(30000, 31);
  equals<LinearEso<3, double>>(30000, 41);  // it softens
  equals<HalfGainEso<2, double>>(30000, 51);
  equals<ReducedOrderEso<2, double>>(30000, 61);
  equals<LinearEso<1, double, 2, PoleSet>>(30000, 71);
  equals<CascadeEso<1, 2, float>>(30000, 81);
  equals<CascadeEso<2, 3, double>>(30000, 91);
}
#endif

TEST(CCode, ByClang) {
  if (!there("clang")) GTEST_SKIP() << "no clang";
  equals<LinearEso<2, float>>(20000, 131, "clang -std=c99 -ffp-contract=off");
}

/// Whatever the compiler may assume of numbers, bad ones never get into the state.
TEST(CCode, RefusesBadNumbersUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto refuses = [&](auto v) {
    using V = decltype(v);
    using C = Adrc<LinearEso<2, V>>;
    const Folder folder;
    InC<V> in_c(folder, to_c(C::make(config<C>(8)).value(), {.name = "loop"}).value(), true,
                "gcc -std=gnu99 -ffast-math -Wno-error");
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(1e-3)), 0);
    for (const V bad : {hidden_nan<V>(), hidden_infinity<V>(), -hidden_infinity<V>()}) {
      for (int k = 0; k < 20; ++k) EXPECT_EQ(is_finite(in_c.update(V(0.1), V(0.2))), true);
      EXPECT_EQ(in_c.probe() % 256, 0u);
      EXPECT_TRUE(is_finite(in_c.update(bad, V(0.2))));
      EXPECT_EQ(in_c.probe() % 256, 1u) << "measurement_rejected";
      EXPECT_TRUE(is_finite(in_c.update(V(0.1), bad)));
      in_c.applied(bad);
      EXPECT_TRUE(is_finite(in_c.update(V(0.1), V(0.2))));
      EXPECT_NE(in_c.start(bad, V(0)), 0u);
      EXPECT_NE(in_c.start(V(0), bad), 0u);
      for (unsigned row = 0; row < 3; ++row) EXPECT_TRUE(is_finite(in_c.estimate(row)));
    }
  };
  refuses(float{});
  refuses(double{});
}

/// What else has to take it: an old C++, Clang, and the compiler of a microcontroller.
TEST(CCode, CompilesWithOtherCompilers) {
  using C = Adrc<LinearEso<2, float>>;
  const CCode code =
      to_c(C::make(config<C>(8)).value(), {.name = "loop", .self_test_samples = 10}).value();
  const Folder folder;
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("loop.cpp", code.source);
  const auto compiles = [&](const std::string& compiler, const std::string& file) {
    return runs(compiler + strict + "-DLOOP_SELF_TEST -c -o " + folder.file("loop.o") + " " +
                folder.file(file));
  };
  if (there("g++")) {
    EXPECT_TRUE(compiles("g++ -std=c++11", "loop.cpp"));
  }
  if (there("clang")) {
    EXPECT_TRUE(compiles("clang -std=c99", "loop.c"));
  }
  if (there("arm-none-eabi-gcc")) {
    EXPECT_TRUE(
        compiles("arm-none-eabi-gcc -std=c99 -Os -mcpu=cortex-m4 -mthumb -mfloat-abi=hard "
                 "-mfpu=fpv4-sp-d16 -Wdouble-promotion",
                 "loop.c"));
  }
}

#endif  // ESOKIT_LOADS_C

TEST(CCode, RefusesByName) {
  using C = Adrc<LinearEso<1>>;
  const auto refusal = [](const C::Config& config, const CCodeOptions& options) {
    const auto code = to_c(C::make(config).value(), options);
    return code ? std::string() : code.error().field + std::string(": ") + code.error().rule;
  };
  C::Config plain = config<C>(8);
  plain.observer.max_gap = 20;
  EXPECT_EQ(refusal(plain, {}), "");
  for (const char* name : {"", "2nd", "a-b", "a b"}) {
    EXPECT_EQ(refusal(plain, {.name = name}), "name: must be an identifier of C");
  }
  EXPECT_EQ(refusal(plain, {.name = "_a2"}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 0}), "self_test_samples: must be 1 .. 10000");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 1}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 10000}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 10001}), "self_test_samples: must be 1 .. 10000");
  for (const char* comment : {"ends */ here", "begins /* here"}) {
    EXPECT_EQ(refusal(plain, {.comment = comment}),
              "comment: must not begin or end a comment of C");
  }
  const std::string odd = "$name, $TIME, $COMMENT * / 50 %";
  const auto commented = to_c(C::make(plain).value(), {.comment = odd});
  EXPECT_NE(commented->header.find(" * " + odd + "\n"), std::string::npos);
  plain.measurement_divider = 2;
  EXPECT_EQ(refusal(plain, {}),
            "measurement_divider: must be 1: regular gaps cannot be written yet");
}

}  // namespace target_c_code_test
}  // namespace esokit_test
