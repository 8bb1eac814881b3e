/// @file
/// Tuning: the designs of `tune` with their numbers, and what speaks against them.
#pragma once

#include <cstddef>
#include <cstdio>
#include <esokit/analysis/controllers.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/play.hpp>
#include <esokit/tune/problem.hpp>
#include <string>
#include <vector>

namespace esokit {

/// The best design of a family, or the one closest to the margins if it cannot keep them.
struct TunedDesign {
  std::string name;         ///< description in words
  TuneFamily family{};      ///< how its gains are chosen
  int extension = 1;        ///< m
  int levels = 1;           ///< p
  int numbers = 0;          ///< how many were chosen for J; what the model tells does not count
  TuneKnowledge knows{};    ///< what its observer knows
  TuneSettings settings{};  ///< the chosen parameters
  bool feasible = false;    ///< keeps all rules: margins, noise in u, and what lets it come back
  std::string constraint;   ///< the rule that limits it, or that it cannot keep; or "none"
  bool played = false;      ///< within the limits, see TuneRules::play
  bool comes_back = true;   ///< from all that was played; true if nothing was
  std::string lost;         ///< in words, what it does not come back from
  PlayEvent lost_in{};      ///< this event, on variant `lost_on` of the plant
  int lost_on = 0;          ///< see played_variants
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
  PlayedLaw law{};                 ///< what softening has to know, see `played_law`

  /// The law for `play`: none, that is the linear one, unless it softens at the limits.
  [[nodiscard]] PlayedLaw played_law() const { return settings.soften ? law : PlayedLaw{}; }
  /// The settling time for `play` on one of `played_variants`, s: with friction 32 / omega_c of a
  /// law.
  [[nodiscard]] double played_settling(const TuneModel& variant) const {
    return variant.friction.value_or(0.0) > 0.0 && !settings.gains.empty()
               ? 32.0 / detail::law_mean(settings.gains, variant.order)
               : settling_time;
  }
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
  std::vector<TunedDesign> designs{};  ///< the best one first, then what does not come back when
                                       ///< played, infeasible ones last

  /// The first design, or null if it does not keep the rules or does not come back.
  [[nodiscard]] const TunedDesign* chosen() const noexcept {
    return !designs.empty() && designs.front().feasible && designs.front().comes_back
               ? &designs.front()
               : nullptr;
  }
};

/// Something that has to be looked at before a design is used.
struct TuneAlarm {
  const char* name = "";  ///< one word
  std::string text;       ///< a sentence
};

/// What speaks against a design that keeps its rules: a settling time above the one asked, noise in
/// u above usual_control_noise, more than three times the deviations of the best linear controller,
/// and what it does not come back from, or that nothing was played.
inline std::vector<TuneAlarm> alarms(const Tuning& tuning, const TunedDesign& design) {
  std::vector<TuneAlarm> all;
  const double range = tuning.model.u_max - tuning.model.u_min;
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  if (!design.comes_back) {
    all.push_back(
        {"overload", "This design does not come back from " + design.lost +
                         ": u goes from limit to limit or stays at one, or y swings for ever."});
  } else if (!design.played) {
    all.push_back({"overload",
                   "This design was not played within the limits of u: whether it "
                   "comes back from an overload is not known."});
  }
  if (tuning.settling_time > 0.0 && design.settling_time > 1.05 * tuning.settling_time) {
    all.push_back(
        {"settling",
         "A step of the reference settles in " + number(design.settling_time) + " s, asked was " +
             number(tuning.settling_time) +
             " s: its slowest poles are those of the observer, or the rules allow no faster law."});
  }
  if (design.control_noise > 1.001 * usual_control_noise * range) {
    all.push_back({"noise", "Noise moves u by " + number(100.0 * design.control_noise / range) +
                                " % of its range (standard deviation); usual is " +
                                number(100.0 * usual_control_noise) +
                                " %. The least that cancels the disturbance of the log is " +
                                number(100.0 * tuning.least_noise / range) +
                                " %. Measure y with less noise, or sample faster."});
  }
  if (design.excess > 3.0) {
    all.push_back({"excess", "Deviations of y and u are " + number(design.excess) +
                                 " times those of the best linear controller: the rules leave "
                                 "little of what this machine could do. It is limited by: " +
                                 design.constraint + "."});
  }
  return all;
}

/// Operations of an update of the observer: additions, products, comparisons and the like in its
/// recorded list, of which the C of `target` consists. A test compares the two.
inline int update_operations(int order, int extension, int levels, const TuneKnowledge& knows) {
  const auto n = static_cast<std::size_t>(order - 1);
  constexpr int chain[4] = {13, 21, 30, 41};
  constexpr int cascade[3][2] = {{26, 37}, {42, 60}, {60, 86}};
  constexpr int lag[3] = {24, 34, 45}, sensor[3] = {23, 33, 44}, sinusoid[3] = {35, 47, 60};
  constexpr int lag_sensor[3] = {36, 48, 61}, lag_sinusoid[3] = {52, 66, 81};
  if (knows.lag && knows.sensor) return lag_sensor[n];
  if (knows.lag && knows.sinusoid) return lag_sinusoid[n];
  if (knows.lag) return lag[n];
  if (knows.sensor) return sensor[n];
  if (knows.sinusoid) return sinusoid[n];
  if (levels > 1) return cascade[n][static_cast<std::size_t>(levels - 2)];
  return chain[n + static_cast<std::size_t>(extension - 1)];
}

}  // namespace esokit
