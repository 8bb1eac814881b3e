/// @file
/// The best PIDs for the problem that `tune` solved: the same J, margins, intervals and noise in u,
/// each at its own optimum.
///
/// A baseline keeps what any controller has to keep. The rules for k_1 / k_0 and for omega_c /
/// omega_o are rules for laws; a PID has none and is simulated instead, with back-calculation. A
/// law that was given (TuneSpecification::controller_bandwidth, settling_time) only sets rho for
/// it.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/tune/pid_conversion.hpp>
#include <esokit/tune/plain_pid.hpp>
#include <esokit/tune/tune.hpp>
#include <optional>
#include <string>
#include <vector>

namespace esokit {

/// Which PID.
enum class PidKind : unsigned char {
  pi,               ///< PI without a filter
  derivative,       ///< PID, filter of first order on the derivative
  filtered,         ///< PID, filter of second order on y, damping 0.707
  freely_filtered,  ///< the same with any damping from 0.001 to 30
  given             ///< not tuned
};

/// A PID beside the designs of a Tuning.
struct TunedPid {
  PidKind kind{};        ///< its structure
  PlainPidConfig pid{};  ///< its settings
  TunedDesign design{};  ///< the columns of the ranking; has no observer and no law
};

namespace detail {

/// A PID that knows the applied u.
LinearController pid_form(const PlainPidConfig& pid);

/// A search for the PIDs of a problem. Its variables are the logarithms of (K_p b0)^(1/n), 1 / T_i,
/// 1 / T_d and of the filter: frequency or 1 / T_f, and damping.
struct PidSearch {
  const Tuning* tuning;
  TuneSearch search;
  LoopCost coarse, fine;
  const LoopCost* cost = &coarse;
  double gain = 1.0;  ///< 1 / abs(b0), of order 3 with a pole a / b0
  int power = 1;      ///< integrations that it sees

  PidSearch(const PidSearch&) = delete;
  explicit PidSearch(const Tuning& of);

  [[nodiscard]] static int numbers(PidKind kind) {
    return kind == PidKind::pi ? 2 : kind == PidKind::freely_filtered ? 5 : 4;
  }

  [[nodiscard]] PlainPidConfig settings(PidKind kind, const std::vector<double>& x) const;

  /// log J plus a penalty on broken rules.
  [[nodiscard]] double value(PidKind kind, const std::vector<double>& x, double price) const;

  /// What it lacks of the rules.
  [[nodiscard]] double lack(PidKind kind, const std::vector<double>& x) const;

  /// The PID with a filter of second order that equals a controller of three states; none if its
  /// filter oscillates from sample to sample or its gains have other signs.
  [[nodiscard]] std::vector<double> equal_to(const LinearController& c) const;

  /// The best two starts: of PIDs of rules of thumb for many bandwidths, and of these.
  [[nodiscard]] std::vector<std::vector<double>> starts(
      PidKind kind, const std::vector<std::vector<double>>& more) const;

  /// The minimum from these starts. @param rules whether it has to keep them
  [[nodiscard]] SearchPoint least(PidKind kind, bool rules,
                                  const std::vector<std::vector<double>>& starts) const;
};

/// The numbers that stand in the source.
PlainPidConfig as_printed(PlainPidConfig pid);

/// What a PID does. @param chosen whether its weight of the reference and its tracking time are
/// free: the weight with which a step settles soonest, and the first of sqrt(T_i T_d), T_i and T_d
/// with which it recovers
void judge(TunedPid& baseline, const TuneSearch& search, const LoopCost& fine, double optimum,
           double free_cost, bool chosen);

}  // namespace detail

/// The best PIDs for the problem of a tuning, in the order of J; those that do not recover from
/// an overload behind, those that cannot keep the rules last.
/// @return none if the tuning has no designs
[[nodiscard]] std::vector<TunedPid> tune_pids(const Tuning& tuning);

/// A PID as it is, in the columns of the ranking: the present controller of a machine, say.
/// @param pid its limits and sample time are those of the model
/// @return error for a number that is not allowed, or a tuning without designs
[[nodiscard]] Expected<TunedPid, Error<double>> given_pid(const Tuning& tuning, PlainPidConfig pid);

/// What changes from a PID to a design, in words; ties (within 1 %) are called ties.
struct Migration {
  std::vector<std::string> gains{};   ///< what becomes better
  std::vector<std::string> losses{};  ///< what becomes worse
  std::vector<std::string> ties{};    ///< what stays
  /// The ADRC that has the gains of the PID, see adrc_from_pid; none for order 3, or if there is
  /// none.
  std::optional<AdrcTuning<double>> equal{};  ///< see above
};

/// From this PID to this design, both of one tuning.
[[nodiscard]] Migration migration(const Tuning& tuning, const TunedPid& from,
                                  const TunedDesign& to);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/pid_baselines.ipp>
#endif
