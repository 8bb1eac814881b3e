// What a written text says of its design: version, structure, bandwidths, a hash, and what each
// number of the state is.
#include <target/written.hpp>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/structured_text.hpp>
#include <string>

namespace esokit_test {
namespace target_design_text_test {

using namespace esokit;

template <class C, class Change = void (*)(typename C::Config&)>
C controller_of(
    double gain = 8, const Change& change = [](auto&) {}) {
  auto settings = config<C>(gain);
  change(settings);
  return C::make(settings).value();
}

/// What stands between `from` and `to`.
std::string between(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) return "no " + from;
  const std::size_t begin = at + from.size();
  return text.substr(begin, text.find(to, begin) - begin);
}

template <class Object>
std::string header(const Object& object, CodeOptions options = {}) {
  options.name = "loop";
  return to_c(object, options).value().header;
}

template <class Object>
std::string constant(const Object& object, const CodeOptions& options = {}) {
  return between(header(object, options), "#define LOOP_DESIGN \"", "\"\n");
}

template <class Object>
std::string hash(const Object& object, const CodeOptions& options = {}) {
  return between(constant(object, options) + "\n", "design ", "\n");
}

template <class Object>
std::string dynamics(const Object& object) {
  return between(constant(object), "states, ", ", design");
}

TEST(DesignText, SaysWhichDesignItIs) {
  const std::string text = header(controller_of<Adrc<LinearEso<2, float>>>());
  EXPECT_EQ(between(text, " b0 = ", "\n *\n"),
            "8.0f, u within -3.0f .. 2.5f.\n"
            " * esokit 0.1.0: order 2, 3 states, float\n"
            " * omega_o = 30 rad/s, omega_c = 4 rad/s.\n"
            " * Design " +
                hash(controller_of<Adrc<LinearEso<2, float>>>()) + ".");
  EXPECT_EQ(between(text, "#define LOOP_DESIGN \"", ", design "),
            "esokit 0.1.0: order 2, 3 states, float, omega_o = 30 rad/s, omega_c = 4 rad/s");
  EXPECT_EQ(dynamics(controller_of<Adrc<DelayedInput<OutlierGate<LinearEso<1, double>>, 4>>>()),
            "double, delay 3, gate, omega_o = 30 rad/s, omega_c = 4 rad/s");
}

/// Bandwidths are computed from what is written, so they are those of each observer, or its poles.
TEST(DesignText, PolesAreThoseOfTheObserver) {
  EXPECT_EQ(dynamics(controller_of<Adrc<LinearEso<2, double>, ErrorBased>>(-8)),
            "double, error-based, omega_o = 30 rad/s, omega_c = 4 rad/s");
  EXPECT_EQ(dynamics(LinearEso<3, float>::make(observer_config<LinearEso<3, float>>(8)).value()),
            "float, omega_o = 15 rad/s");
  using Placed = LinearEso<1, double, 2, PoleSet>;
  EXPECT_EQ(dynamics(Placed::make(observer_config<Placed>(8)).value()),
            "double, observer poles -20 +- 5j, -9 1/s");
  using Levels = CascadeEso<1, 2, double>;
  EXPECT_EQ(dynamics(Levels::make(observer_config<Levels>(8)).value()),
            "double, observer poles -22.5, -22.5, -15, -15 1/s");
  const auto given = controller_of<Adrc<LinearEso<2, double>>>(8, [](auto& settings) {
    settings.gains = {{30.0, 4.0}};
    settings.controller_bandwidth = 0;
  });
  EXPECT_EQ(dynamics(given), "double, omega_o = 30 rad/s, law k = 30, 4");
  using Fal = NonlinearEso<2, double>;
  EXPECT_EQ(dynamics(Fal::make(observer_config<Fal>(8)).value()),
            "double, gains by the innovation");
  using Shifted = AlgebraicEso<2, double>;
  EXPECT_EQ(dynamics(Shifted::make(observer_config<Shifted>(8)).value()),
            "double, gains by a schedule, gains by the innovation");
}

TEST(DesignText, StatesAreNamedWithTheirScale) {
  const std::string text = header(controller_of<Adrc<LinearEso<2, float>>>());
  EXPECT_NE(
      text.find("  float z1; /* y */\n  float z2; /* y' T */\n  float z3; /* dhat T^2/2 */\n"),
      std::string::npos)
      << text;
  const std::string of_error = header(controller_of<Adrc<LinearEso<1, double>, ErrorBased>>());
  EXPECT_NE(of_error.find("  double z1; /* e */\n  double z2; /* dhat T */\n"), std::string::npos);
}

/// One bit of a gain or a rule changes it, a name does not.
TEST(DesignText, HashIsOfTheDesign) {
  using C = Adrc<LinearEso<2, float>>;
  const std::string first = hash(controller_of<C>());
  EXPECT_EQ(first.size(), 8U);
  EXPECT_EQ(hash(controller_of<C>(), {.comment = "a machine", .self_test_samples = 7}), first);
  const CCode other = to_c(controller_of<C>(), {.name = "axis"}).value();
  EXPECT_NE(other.header.find("design " + first + "\""), std::string::npos);
  EXPECT_NE(hash(controller_of<C>(8, [](auto& settings) { settings.missing.most = 10; })), first);
  EXPECT_NE(hash(controller_of<C>(8, [](auto& settings) { settings.limits.upper = 2.5000002F; })),
            first);
  EXPECT_NE(hash(controller_of<C>(), {.moving_reference = true}), first);

  const auto block = to_structured_text(controller_of<C>(), {.name = "loop"}).value();
  EXPECT_NE(block.find("float, design " + first + "."), std::string::npos);
  FixedPointOptions fixed;
  fixed.code.name = "loop";
  fixed.y = {.unit = 1e-3, .most = 4000};
  fixed.u = {.unit = 1e-3, .most = 3000};
  fixed.most_deviation = {1, 1, 1000};
  const auto counts = to_fixed_c(controller_of<C>(8,
                                                  [](auto& settings) {
                                                    settings.limits = {-2.5F, 2.5F};
                                                  }),
                                 fixed);
  ASSERT_TRUE(counts) << counts.error().field << ": " << counts.error().rule;
  EXPECT_NE(
      counts->code.header.find("#define LOOP_DESIGN \"esokit 0.1.0: order 2, 3 states, float, "
                               "design "),
      std::string::npos);
}

/// Settings are named where they stand; the header is one for all.
TEST(DesignText, OfSettings) {
  using C = Adrc<LinearEso<2, float>>;
  CodeOptions options{.name = "loop", .settings_in_struct = true};
  const CCode fast = to_c(controller_of<C>(), options).value();
  options.settings_name = "slow";
  const CCode slow = to_c(controller_of<C>(8,
                                           [](auto& settings) {
                                             settings.observer.observer_bandwidth = 20;
                                             settings.controller_bandwidth = 3;
                                           }),
                          options)
                         .value();
  EXPECT_EQ(between(slow.header, "#define LOOP_DESIGN", "\n"),
            between(fast.header, "#define LOOP_DESIGN", "\n"));
  EXPECT_EQ(between(fast.settings, "/* ", " */"), "omega_o = 30 rad/s, omega_c = 4 rad/s");
  EXPECT_EQ(between(slow.settings, "/* ", " */"), "omega_o = 20 rad/s, omega_c = 3 rad/s");
}

}  // namespace target_design_text_test
}  // namespace esokit_test
