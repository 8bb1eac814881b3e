// To copy for an observer of your own: the observer, what the law suite has to know of it, the
// laws, and a study of a loop with it. Here it is LinearEso set by a time constant.
#include "law_suite.hpp"
//
#include <esokit/control/adrc.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/monte_carlo.hpp>

namespace esokit_test {

/// Order 2, all poles at -1 / time_constant.
template <class S = double>
class OwnEso : public esokit::NamedObserver<
                   OwnEso<S>, esokit::PredictorCorrector<2, S, 1, esokit::ConstantGain<3, S>>> {
  using Shell = typename OwnEso::NamedObserver;
  friend Shell;
  using Shell::Shell;

 public:
  struct Config {
    S time_constant{}, input_gain{}, sample_time{};
    int max_gap = 100;
  };

 private:
  static auto design(const Config& config, const typename Shell::PlantModel& model) {
    return Shell::Law::make("time_constant", S(1) / config.time_constant, model);
  }
};

template <class S>
struct ObserverTraits<OwnEso<S>>
    : BandwidthTraits<OwnEso<S>, esokit::ContinuousLinearEso<2, double>> {
  template <class T>
  using Rebind = OwnEso<T>;
  static constexpr const char* field = "time_constant";
  static auto config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    return typename OwnEso<S>::Config{static_cast<S>(1 / omega), static_cast<S>(input_gain),
                                      static_cast<S>(sample_time), max_gap};
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(
      const typename OwnEso<S>::Config& config) {
    return {equal_poles(3, 1.0L / config.time_constant)};
  }
};

const bool own_observer_registered =
    register_laws<ObserverLaws>("OwnEso", TypeList<OwnEso<>, OwnEso<float>>{});

/// In a controller, and in a study of it as it is: run 3 of the study is that of its settings.
TEST(OwnEso, RunsInAStudy) {
  using Loop = esokit::Adrc<OwnEso<>>;
  const auto loop =
      Loop::make({.observer = {.time_constant = 0.0125, .input_gain = 50, .sample_time = 1e-3},
                  .controller_bandwidth = 12,
                  .limits = {.lower = -6, .upper = 6}});
  ASSERT_TRUE(loop);
  const auto plant = esokit::LinearPlant<2>::chain({.input_gain = 50.0}).value();
  std::vector<double> ends;
  const auto study = esokit::sim::monte_carlo(
      plant, *loop,
      {.runs = 20,
       .loop = {.duration = 1, .reference = 0.5, .noise = 1e-4},
       .on_run = [&](std::int64_t, std::span<const double> n) { ends.push_back(n[0]); }},
      [](auto& trial, esokit::sim::Draw& draw) {
        trial.plant.b(1) *= draw.uniform_ratio(0.7, 1.4);
      });
  const auto outcome = study.run(
      esokit::sim::final_value("error", [](const auto& s) { return s.output - s.reference; }));
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->failed, 0);
  EXPECT_LT(outcome->numbers[0].largest(), 1e-2);
  EXPECT_EQ(ends[3], study.replay(3)->output.back() - 0.5);
}

}  // namespace esokit_test
