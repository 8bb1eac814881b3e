/// @file
/// The design of ExtendedStateFilter: from its config the Riccati law or an error.
#pragma once

#include <cmath>
#include <esokit/gain/detail/noise_settings.hpp>
#include <esokit/gain/riccati_gain_design.hpp>

namespace esokit::detail {

/// @tparam Law a RiccatiGain @tparam has_model the disturbance has a nominal model
template <class Law, class PlantModel, bool has_model, class Config>
class FilterDesign {
  using S = typename Law::scalar_type;
  static constexpr int Order = PlantModel::order;
  static constexpr int N = PlantModel::size;
  using Covariance = Matrix<S, N, N>;

 public:
  /// The law, or an error. Sample time and input gain of the config are already checked.
  static Expected<Law, Error<S>> make(const Config& config, const PlantModel& plant) {
    Rules<S> rules;
    rules.all_of(check_inflation<S>(config));
    if (config.inflation_rule == InflationRule::adaptive) {
      rules.positive("trace_weights", config.trace_weights);
    }
    rules.not_negative("outlier_threshold", config.outlier_threshold);
    if (!rules) return rules.error();
    auto settings = law_settings(config, plant);
    if (!settings) return settings.error();
    Law law(*settings, transition_of<S>(plant));
    for (const S& k : law.gain_before_measurement()) {
      if (!all(is_finite(k))) {
        return Error<S>{"initial_covariance", config.initial_covariance(0, 0),
                        "gives a gain that the scalar cannot hold"};
      }
    }
    if (!law.fits()) {
      return Error<S>{"inflation", law.inflation(),
                      "lets the covariance grow beyond what the scalar can hold"};
    }
    if (config.mode != RiccatiMode::recursive) {
      if (auto ok = freeze(law, config); !ok) return ok.error();
    }
    return law;
  }

 private:
  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }

  /// For each state of the law the factor from its row of the estimate (T^r / r! for the chain),
  /// divided by `root`, the root of the unit of variances.
  static Array<S, N> scaled_units(const PlantModel& plant, const S& root) {
    return plant.scaled(PlantModel::Estimate::Constant(S(1.0) / root));
  }

  static Expected<RiccatiSettings<N, S>, Error<S>> law_settings(const Config& config,
                                                                const PlantModel& plant) {
    using std::sqrt;
    const S& r = config.measurement_variance;
    Rules<S> rules;
    rules.not_negative("measurement_variance", r)
        .all_of(check_covariance("initial_covariance", config.initial_covariance));
    Covariance q = Covariance::Zero();
    if (config.process_covariance) {
      q = *config.process_covariance;
      rules.all_of(check_covariance("process_covariance", q));
    }
    // With a model of the disturbance the unmodelled change is the difference of two changes, each
    // within the bound: it can be twice the bound.
    rules.all_of(add_bounds(config, q, has_model ? Order : -1));
    const S& change = config.disturbance_bounds[Order];
    rules.demand(!has_model || all(change > S(0.0)), "disturbance_bounds", change,
                 "must say by how much the model may change the disturbance in a sample", Order);
    if (!rules) return rules.error();

    // The unit of all variances: R, or without noise the largest variance of the config.
    S unit = r;
    const Array<S, N> plain = scaled_units(plant, S(1.0));
    bool driven = false;
    for (int i = 0; i < N; ++i) {
      driven = driven || all(q(i, i) > S(0.0));
      if (all(r > S(0.0))) continue;
      for (const S& variance : {q(i, i), config.initial_covariance(i, i)}) {
        const S& factor = plain[index(PlantModel::state_of_row(i))];
        const S seen = (variance * factor) * factor;
        unit = select(unit < seen, seen, unit);
      }
    }
    rules
        .demand(driven || all(r > S(0.0)), "measurement_variance", r,
                "must be positive if nothing disturbs the plant")
        .demand(driven || config.inflation_rule != InflationRule::adaptive, "disturbance_bounds",
                S(0.0), "(or process_covariance) must not be zero if the inflation is adaptive")
        .all_of(check_way_back(config, q));
    if (!rules) return rules.error();
    const Array<S, N> units = scaled_units(plant, S(sqrt(unit)));
    const auto in_law = [&units](const char* field, const Covariance& p) {
      // The config is in rows of the estimate, the law in states of the model.
      Covariance of_states;
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) {
          of_states(PlantModel::state_of_row(i), PlantModel::state_of_row(j)) = p(i, j);
        }
      }
      return factored<N, S>(
          field, of_states, units.data(),
          "in the scaling T^2r / r!^2 and divided by R is a variance that the scalar cannot hold",
          "must be positive semidefinite", N * N - 1);
    };
    const auto start = in_law("initial_covariance", config.initial_covariance);
    if (!start) return start.error();
    const auto noise = in_law(noise_field(config), q);
    if (!noise) return noise.error();
    if (auto ok = check_alternating(config, *noise, unit, plant); !ok) return ok.error();
    return RiccatiSettings<N, S>{.start = *start,
                                 .noise = *noise,
                                 .measurement = r / unit,
                                 .unit = unit,
                                 .rule = config.inflation_rule,
                                 .inflation = config.inflation,
                                 .trace_weights = config.trace_weights};
  }

  static int place_of_highest(const Config& config) noexcept {
    return config.process_covariance ? N * N - 1 : N - 1;
  }

  /// A state that is known exactly is never corrected, and one that is never disturbed is corrected
  /// less and less.
  static Check<S> check_way_back(const Config& config, const Covariance& q) {
    const S& highest = q(N - 1, N - 1);
    // In a composed model it depends on the parts which state is the highest; a known actuator need
    // not be disturbed.
    if (model_traits<PlantModel>.corrects_part) return {};
    if (config.allow_vanishing_gain || all(highest > S(0.0))) return {};
    if (config.inflation_rule == InflationRule::none) {
      return Error<S>{noise_field(config), highest,
                      "must disturb the highest state: without inflation its gain tends to zero "
                      "(or set allow_vanishing_gain)",
                      place_of_highest(config)};
    }
    const S& start = config.initial_covariance(N - 1, N - 1);
    if (config.mode != RiccatiMode::frozen && !all(start > S(0.0))) {
      return Error<S>{"initial_covariance", start,
                      "must leave the highest state uncertain if nothing disturbs it "
                      "(or set allow_vanishing_gain)",
                      N * N - 1};
    }
    return {};
  }

  static Check<S> check_alternating(const Config& config, const CovarianceFactor<N, S>& noise,
                                    const S& unit, const PlantModel& plant) {
    if (config.inflation_rule == InflationRule::adaptive || all(config.inflation >= S(0.01))) {
      return {};
    }
    const S least = least_measurement_variance<N, S>(noise, transition_of<S>(plant));
    const S& r = config.measurement_variance;
    if (all(r / unit >= least)) return {};
    return alternating("measurement_variance", r, -1, S(least * unit));
  }

  static Check<S> freeze(Law& law, const Config& config) {
    const char* field = noise_field(config);
    const S highest = config.process_covariance ? (*config.process_covariance)(N - 1, N - 1)
                                                : config.disturbance_bounds[N - 1];
    if (config.mode == RiccatiMode::start_table && Law::table_size == 0) {
      return Error<S>{"mode", S(0.0), "needs a filter with a TableSize above 0 for a start table"};
    }
    if (!model_traits<PlantModel>.corrects_part && config.inflation_rule == InflationRule::none &&
        !all(highest > S(0.0))) {
      return Error<S>{field, highest,
                      "must disturb the highest state if the gain is frozen without inflation: its "
                      "limit is zero",
                      place_of_highest(config)};
    }
    if (!law.freeze(config.mode)) {
      return Error<S>{field, highest, "gives no limit gain that the scalar can hold"};
    }
    if constexpr (Law::table_size > 0) {
      if (config.mode == RiccatiMode::start_table) {
        for (int i = 0; i < N; ++i) {
          const S limit = law.limit_gain()[index(i)];
          const S last = law.last_table_gain()[index(i)];
          if (!all(absolute(S(last - limit)) <= S(0.1) * absolute(limit))) {
            return Error<S>{
                "mode",
                last,
                "has too short a start table: its last gain is more than a tenth off the limit",
                i,
                limit,
                true};
          }
        }
      }
    }
    return {};
  }
};

}  // namespace esokit::detail
