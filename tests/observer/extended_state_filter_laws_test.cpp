// The law suite on ExtendedStateFilter. Without disturbance bounds and with theta = e^(omega T) - 1
// it has all its poles at e^(-omega T): frozen, and by the recursion from the covariance of the
// steady state. Those of a sine keep its frequency: e^(-omega T +- j w T).
#include "law_suite.hpp"
//
#include <algorithm>
#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit_test {

/// Those of one state and its disturbances by the recursion, the others frozen.
template <int Order, class S, int Extension, class PlantModel>
struct ObserverTraits<
    esokit::ExtendedStateFilter<Order, S, Extension, esokit::NoNominalModel, 0, PlantModel>> {
  using Observer =
      esokit::ExtendedStateFilter<Order, S, Extension, esokit::NoNominalModel, 0, PlantModel>;
  static constexpr bool recursive = Order == 1;
  static constexpr bool is_chain = esokit::model_traits<PlantModel>.is_chain;
  using Config = typename Observer::Config;
  using Continuous = esokit::ContinuousLinearEso<Order, double, Extension>;
  template <class T>
  using Rebind = esokit::ExtendedStateFilter<Order, T, Extension, esokit::NoNominalModel, 0,
                                             esokit::detail::WithScalar<PlantModel, T>>;
  static constexpr const char* field = "inflation";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config{.input_gain = static_cast<S>(input_gain),
                  .sample_time = static_cast<S>(sample_time),
                  .measurement_variance = S(1),
                  .inflation = static_cast<S>(std::expm1(omega * sample_time)),
                  .mode = esokit::RiccatiMode::frozen,
                  .max_gap = max_gap};
    // A sine of half omega, 10 rad/s at most: the same before and after a retune.
    if constexpr (!is_chain) {
      config.plant_model.resonators[0].frequency =
          static_cast<S>(omega > 0 ? std::min(omega / 2, 10.0) : 10.0);
    }
    if constexpr (recursive) {
      config.mode = esokit::RiccatiMode::recursive;
      config.initial_covariance = eigen(steady_covariance(config)).template cast<S>();
    }
    return config;
  }

  /// P after a correction in the steady state: (I - k C) P- (I - k C)' + k R k' / (1 + theta).
  static auto steady_covariance(const Config& config) {
    using Wide = Rebind<double>;
    typename Wide::Covariance p = Wide::Covariance::Zero();
    const auto theta = static_cast<double>(config.inflation);
    const auto frozen = Wide::make({.input_gain = 1,
                                    .sample_time = static_cast<double>(config.sample_time),
                                    .measurement_variance = 1,
                                    .inflation = theta,
                                    .mode = esokit::RiccatiMode::frozen});
    if (!frozen) return p;
    const auto before = frozen->covariance();
    const auto k = frozen->gain();
    const auto rest = [&](int i, int j) { return before(i, j) - k(i) * before(0, j); };
    for (int i = 0; i < Observer::size; ++i) {
      for (int j = 0; j <= i; ++j) {
        p(i, j) = rest(i, j) - rest(i, 0) * k(j) + k(i) * k(j) / (1 + theta);
        p(j, i) = p(i, j);
      }
    }
    return p;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.observer_bandwidth = omega, .input_gain = input_gain};
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    const auto omega = std::log1p(static_cast<long double>(config.inflation)) /
                       static_cast<long double>(config.sample_time);
    return {equal_poles(Observer::size, omega)};
  }
  static constexpr int degree(int row) { return PlantModel::degree(PlantModel::state_of_row(row)); }
  static constexpr const char* excuse(Law law) {
    if constexpr (!is_chain) {
      if (law == Law::gains_equal_reference || law == Law::polynomial_equals_reference) {
        return "the reference is a chain's; see ItsLimitIsThatOfAKalmanFilter in "
               "model_eso_test.cpp";
      }
      if (law == Law::unbiased_on_own_model_class) {
        return "its plant is a chain; see ASwingIsEstimatedToRounding";
      }
      if (law == Law::order_of_accuracy) return "an observer with a model has no continuous form";
    }
    if (law == Law::gap_gain_is_that_of_longer_sample) {
      return "the gain after a gap is that of the grown covariance, as if one sample had been "
             "missed "
             "and not as for a filter that always runs slower; see extended_state_filter_test.cpp";
    }
    if ((law == Law::gains_equal_reference || law == Law::polynomial_equals_reference) &&
        (std::is_same_v<S, float> || Observer::size > 3)) {
      return "at omega T = 50 variances differ by e^(50 (N-1)), for which the scalar has no "
             "digits; "
             "see riccati_test.cpp";
    }
    if (recursive &&
        (law == Law::gains_equal_reference || law == Law::polynomial_equals_reference)) {
      return "its gain comes out of the recursion; see extended_state_filter_test.cpp";
    }
    if (recursive &&
        (law == Law::retune_keeps_estimate || law == Law::retune_rescales_sample_time)) {
      return "the covariance is kept too; see retune_keeps_estimate_and_covariance";
    }
    return common_excuse<S, Observer::size>(law);
  }
};

template <class S>
using Frozen = esokit::ExtendedStateFilter<2, S, 1>;
template <class S>
using Recursive = esokit::ExtendedStateFilter<1, S, 2>;
inline constexpr esokit::ModelParts filter_swing{.order = 2, .resonators = 1};
template <class S>
using Swing = esokit::ExtendedStateFilter<2, S, 3, esokit::NoNominalModel, 0,
                                          esokit::AugmentedModel<filter_swing, S>>;

using FilterTypes = TypeList<Frozen<double>, Frozen<float>, Recursive<double>, Recursive<float>,
                             Swing<double>, Swing<float>>;
const bool extended_state_filter_registered =
    register_laws<ObserverLaws>("ExtendedStateFilter", FilterTypes{});

/// y'' = 3 + 2 sin(w t). All that may be wrong in the end is what rounding of the states, as large
/// as they are, can do to an estimate.
TEST(ExtendedStateFilterModel, ASwingIsEstimatedToRounding) {
  using Column = std::array<double, 5>;
  const LawSuite laws{kind_of<Swing<double>>()};
  const auto truth = [](double t, double w) {
    const double sine = std::sin(w * t);
    const double cosine = std::cos(w * t);
    return Column{1.5 * t * t - 2 / (w * w) * sine, 3 * t - 2 / w * cosine, 3 + 2 * sine, 2 * sine,
                  2 * cosine};
  };
  for (const double omega_t : {0.1, 0.5, 3.0}) {
    SCOPED_TRACE(omega_t);
    AnyObserver filter = laws.make(omega_t);
    const double w = filter.as<Swing<double>>().model().settings().resonators[0].frequency;
    constexpr int samples = 600;
    Column largest = truth(samples * laws.period, w);
    largest[2] = 5;
    largest[3] = largest[4] = 2;
    Column tolerance{};
    for (std::size_t to = 0; to < 5; ++to) {
      for (std::size_t from = 0; from < 5; ++from) {
        tolerance[to] +=
            static_cast<double>(laws.roundings() * laws.rounding_gain(omega_t, int(from), int(to)) *
                                largest[from] * laws.row_unit(int(from)));
      }
      ASSERT_LT(tolerance[to], 1e-5) << "would hide a wrong estimate " << to;
    }
    for (int k = 1; k <= samples; ++k) {
      const Column x = truth(k * laws.period, w);
      ASSERT_EQ(filter->update(x[0], 0), StepStatus::ok);
      if (k <= samples - 100) continue;
      for (std::size_t r = 0; r < 5; ++r) {
        ASSERT_NEAR(static_cast<double>(filter->estimate(int(r))), x[r], tolerance[r])
            << k << ", estimate " << r;
      }
    }
  }
}

}  // namespace esokit_test
