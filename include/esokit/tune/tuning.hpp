/// @file
/// Tuning: the designs of `tune` with their numbers, and what speaks against them.
#pragma once

#include <esokit/analysis/library_systems.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/overload.hpp>
#include <esokit/tune/specification.hpp>
#include <string>
#include <vector>

namespace esokit {

/// The best design of a family, or the one closest to the margins if it cannot keep them.
struct TunedDesign {
  std::string name;         ///< description in words
  TuneFamily family{};      ///< how its gains are chosen
  int extension = 1;        ///< m
  int levels = 1;           ///< p
  int numbers = 0;          ///< how many were chosen for J; what the model gives does not count
  TuneKnowledge knows{};    ///< what its observer knows
  TuneSettings settings{};  ///< the chosen parameters
  bool feasible = false;    ///< keeps all rules: margins, noise in u, and what lets it recover
  std::string constraint;   ///< the rule that limits it, or that it cannot keep; or "none"
  bool simulated = false;   ///< within the limits, see TuneRules::simulate
  bool recovers = true;     ///< from all that was simulated; true if nothing was
  std::string lost;         ///< in words, what it does not recover from
  Overload lost_in{};       ///< this event, on variant `lost_on` of the plant
  int lost_on = 0;          ///< see simulated_variants
  double cost = 0.0;        ///< J
  double excess = 0.0;      ///< sqrt(J / J*)
  double free_excess =
      0.0;  ///< the same without margins; excess / free_excess is the price of the margins
  double output_deviation = 0.0;   ///< standard deviation of y
  double control_deviation = 0.0;  ///< standard deviation of u + d / b0
  double control_noise = 0.0;      ///< standard deviation of u from measurement noise only
  double load_peak = 0.0;          ///< largest abs(y) after a load step that one unit of u balances
  double settling_time = 0.0;      ///< s, to within 2 % after a step of the reference
  double modulus_margin = 0.0;     ///< smallest over the intervals
  double gain_tolerance = 0.0;     ///< factor by which b0 may be wrong in either direction
  double delay_margin = 0.0;       ///< smallest over the intervals, s
  double phase_margin = 0.0;       ///< smallest over the intervals, rad
  double pole_damping = 0.0;       ///< smallest damping of the poles, see TuneRules
  double damping_latencies = 0.0;  ///< k_1 / k_0 over TuneModel::latency, 0 if there is no k_1
  double bandwidth_ratio = 0.0;    ///< omega_c / omega_o, geometric means of poles
  int operations = 0;              ///< per update of the observer, see update_operations
  std::string code;                ///< C++ source of the controller, type and config, to paste
  LinearController controller{};   ///< for the analysis, see closed_loop(model, controller)
  SofteningLaw law{};              ///< what softening has to know, see `softening_law`

  /// The law for `simulate_overload`: none, that is the linear one, unless it softens at the
  /// limits.
  [[nodiscard]] SofteningLaw softening_law() const {
    return settings.soften ? law : SofteningLaw{};
  }
  /// The settling time for `simulate_overload` on one of `simulated_variants`, s: with friction 32
  /// / omega_c of a law.
  [[nodiscard]] double simulated_settling(const TuneModel& variant) const;
};

/// The result of `tune`.
struct Tuning {
  TuneModel model{};               ///< as given, with at least the disturbance of the floor
  TuneRules rules{};               ///< as given
  double model_disturbance = 0.0;  ///< that of the given model; model.disturbance may be larger
  double rho = 0.0;                ///< weight of var(b0 u~) in J
  double control_noise = 0.0;  ///< the required value, unit of u; 0 if something else was required
  double settling_time = 0.0;  ///< the required value, s; 0 if something else was required
  double least_noise = 0.0;    ///< what cancelling the given disturbance alone needs, unit of u
  double optimum = 0.0;        ///< J*
  LoopNumbers lqg{};           ///< of the controller with J*
  std::vector<TunedDesign> designs{};  ///< the best one first, then what does not recover when
                                       ///< simulated, infeasible ones last

  /// The first design, or null if it does not keep the rules or does not recover.
  [[nodiscard]] const TunedDesign* chosen() const noexcept;
};

/// Something that has to be looked at before a design is used.
struct TuneAlarm {
  const char* name = "";  ///< one word
  std::string text;       ///< a sentence
};

/// What speaks against a design that keeps its rules: a settling time above the one asked, noise in
/// u above usual_control_noise, more than three times the deviations of the best linear controller.
/// Also what it does not recover from, or that nothing was simulated.
std::vector<TuneAlarm> alarms(const Tuning& tuning, const TunedDesign& design);

/// Operations of an update of the observer: additions, products, comparisons and the like in its
/// recorded list, of which the C of `target` consists. A test compares the two.
int update_operations(int order, int extension, int levels, const TuneKnowledge& knows);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/tuning.ipp>
#endif
