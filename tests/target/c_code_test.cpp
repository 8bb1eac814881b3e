// The C that to_c writes equals the controller bit for bit: u, estimates, status, mode and gap,
// with noise, overload, bad samples, gaps beyond every limit, reported u and starts. It is compiled
// here, strictly, by the C compiler of the machine.
#include <target/written.hpp>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit/target/c_code.hpp>

namespace esokit_test {
namespace target_c_code_test {

// What cannot be written: it computes its gains at each sample, or lies in an adapter of another
// kind.
static constexpr ModelParts follows{.order = 1, .resonators = 1, .follows_speed = true};
using detail::Writable;
static_assert(Writable<LinearEso<2>> && Writable<CascadeEso<2, 3>> &&
              Writable<ModelEso<everything>> &&
              Writable<DelayedInput<OutlierGate<LinearEso<2>>, 4>> &&
              Writable<Adrc<LinearEso<2>, ErrorBased>>);
static_assert(Writable<AlgebraicEso<2>> && Writable<ExtendedStateFilter<2>> &&
              Writable<DelayedInput<WrappedOutput<OutlierGate<LinearEso<2>>>, 4>>);
struct NominalSpring {
  double operator()(const Vector<double, 2>& x, double, double) const { return -x(0); }
};
static_assert(!Writable<ExtendedStateFilter<2, double, 1, NominalSpring>> &&
              !Writable<ExtendedStateFilter<2, double, 1, NoNominalModel, 10>> &&
              !Writable<ModelEso<follows>> && !Writable<Guarded<LinearEso<2, double, 2>>> &&
              !Writable<Guarded<ModelEso<lag>>> && !Writable<VariableTime<LinearEso<2>>> &&
              !Writable<PredictiveAdrc<ExtendedStateFilter<2, double, 1, NominalSpring>>> &&
              !Writable<MimoAdrc<LinearEso<1>, LinearEso<1>>>);

#ifdef ESOKIT_LOADS_C

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

/// A lost sensor ends in zero, or by name in the last u, with a limit of rate and without.
TEST(CCode, OfWhatIsSafe) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const bool hold : {false, true}) {
    for (const bool free : {false, true}) {
      equals_changed<Adrc<LinearEso<2, float>>>(20000, 141, "gcc -std=c99", [=](auto& settings) {
        settings.missing = {.most = 5, .hold = hold};
        if (free) settings.limits.rate = Limits<float>{}.rate;
      });
    }
  }
}

/// The first missing measurement is one too many, with each and with every second sample measured.
TEST(CCode, OfNoneMissing) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const int divider : {1, 2}) {
    equals_changed<Adrc<LinearEso<2, double>>>(20000, 151, "gcc -std=c99", [=](auto& settings) {
      settings.missing.most = 0;
      settings.measurement_divider = divider;
    });
  }
}

TEST(CCode, ByClang) {
  if (!there("clang")) GTEST_SKIP() << "no clang";
  equals<LinearEso<2, float>>(20000, 131, "clang -std=c99 -ffp-contract=off");
}

/// What a prover reads in place of the bits of a number refuses the same numbers.
TEST(CCode, AsAProverReadsIt) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<LinearEso<2, float>>(20000, 161, "gcc -std=c99 -D__FRAMAC__");
  equals<LinearEso<2, double>>(20000, 171, "gcc -std=c99 -D__FRAMAC__");
}

/// Whatever the compiler may assume of numbers, bad ones never get into the state.
TEST(CCode, RefusesBadNumbersUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_under_fast_math<Adrc<LinearEso<2, float>>>(true);
  refuses_under_fast_math<Adrc<LinearEso<2, double>>>(true);
}

/// What else has to take it: an old C++, Clang, small compilers, and that of a microcontroller; and
/// of MISRA C:2012 nothing is found but the deviations that the file names.
TEST(CCode, CompilesWithOtherCompilers) {
  using C = Adrc<DelayedInput<LinearEso<2, float>, 4>>;
  auto settings = config<C>(8);
  settings.measurement_divider = 2;
  const CCode code =
      to_c(C::make(settings).value(), {.name = "loop", .self_test_samples = 10}).value();
  const Folder folder;
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("loop.cpp", code.source);
  const auto compiles = [&](const std::string& compiler, const std::string& file,
                            const std::string& options = strict) {
    return !there(compiler.substr(0, compiler.find(' '))) ||
           runs(compiler + " " + options + " -DLOOP_SELF_TEST -c -o " + folder.file("loop.o") +
                " " + folder.file(file));
  };
  EXPECT_TRUE(compiles("g++ -std=c++11", "loop.cpp"));
  EXPECT_TRUE(compiles("clang -std=c99", "loop.c"));
  EXPECT_TRUE(compiles("tcc", "loop.c", "-Wall -Werror"));
  EXPECT_TRUE(compiles("sdcc -mstm8 --std-c99", "loop.c", ">/dev/null 2>&1"));
  EXPECT_TRUE(
      compiles("arm-none-eabi-gcc -std=c99 -Os -mcpu=cortex-m4 -mthumb -mfloat-abi=hard "
               "-mfpu=fpv4-sp-d16 -Wdouble-promotion",
               "loop.c"));
  if (there("cppcheck")) {
    EXPECT_EQ(misra_findings(folder, "loop", {"2.5", "15.5"}), "[misra-c2012-21.15]\n");
    EXPECT_EQ(misra_findings(folder, "loop", {"2.5", "15.5", "21.15"}), "");
  }
}

#endif  // ESOKIT_LOADS_C

TEST(CCode, RefusesByName) {
  using C = Adrc<LinearEso<1>>;
  const auto refusal = [](const C::Config& config, const CodeOptions& options) {
    const auto code = to_c(C::make(config).value(), options);
    return code ? std::string() : code.error().field + std::string(": ") + code.error().rule;
  };
  C::Config plain = config<C>(8);
  plain.observer.max_gap = 20;
  EXPECT_EQ(refusal(plain, {}), "");
  for (const char* name : {"", "2nd", "a-b", "a b"}) {
    EXPECT_EQ(refusal(plain, {.name = name}),
              "name: must be an identifier of C: this is the place of its first wrong character");
  }
  EXPECT_EQ(refusal(plain, {.settings_in_struct = true, .settings_name = "a-b"}),
            "settings_name: must be an identifier of C: this is the place of its first wrong "
            "character");
  EXPECT_EQ(refusal(plain, {.settings_in_struct = true, .settings_name = "slow"}), "");
  EXPECT_EQ(refusal(plain, {.name = "_a2"}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 0}), "self_test_samples: must be 1 .. 10000");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 1}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 10000}), "");
  EXPECT_EQ(refusal(plain, {.self_test_samples = 10001}), "self_test_samples: must be 1 .. 10000");
  for (const char* comment : {"ends */ here", "begins /* here", "ends *) here"}) {
    EXPECT_EQ(refusal(plain, {.comment = comment}),
              "comment: must not begin or end a comment, nor a line of it with a backslash");
  }
  const std::string odd = "$name, $TIME, $COMMENT * / 50 %";
  const auto commented = to_c(C::make(plain).value(), {.comment = odd});
  EXPECT_NE(commented->header.find(" * " + odd + "\n"), std::string::npos);
}

}  // namespace target_c_code_test
}  // namespace esokit_test
