/// @file
/// From what was found to a controller: the choice, what it does, and the log through its observer.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/loop.hpp>
#include <esokit/tune/tune.hpp>

#include "from_log/parts/from_log.hpp"
#include "from_log/parts/page.hpp"

namespace from_log {

/// Half of what u can do, unit of y / s^2, of order 2.
[[nodiscard]] double profile_acceleration(const esokit::TuneModel& model);

/// A design as it runs, within its limits: what `Adrc` computes, whatever its type.
class Runner {
 public:
  Runner(const esokit::Tuning& tuning, const esokit::TunedDesign& design);
  /// Once a sample. @param motion (r, r', r'') of the reference
  double update(double y, const esokit::Vector<double, 3>& motion);

 private:
  esokit::LinearController form_;
  double lower_, upper_;
  std::array<double, 3> weights_{};  ///< of r, r', r'' in u
  std::vector<double> state_;
};

/// The log through an observer.
struct Replay {
  std::vector<double> t, estimate, load, innovation;  ///< load: dhat / b0
  double band = 0;    ///< 95 % of the innovations are within this, says the model
  double inside = 0;  ///< share of the log's that are
};

/// A choice, or why there is none.
class Design {
 public:
  Design() = default;

  [[nodiscard]] static Design make(const Settings& settings, const Input& input,
                                   const Findings& findings);

  [[nodiscard]] bool made() const { return loop_.has_value(); }
  /// A few sentences.
  [[nodiscard]] std::vector<std::string> summary() const { return summary_; }
  /// Why there is none; empty if there is one or none was wanted.
  [[nodiscard]] const std::string& why_not() const { return why_not_; }
  /// C++ that compiles as it is.
  [[nodiscard]] const std::string& code() const { return code_; }
  /// The design that was taken.
  [[nodiscard]] const esokit::TunedDesign& taken() const { return tuning_->designs[taken_]; }
  /// The choice, its model and its rivals.
  [[nodiscard]] const esokit::Tuning& tuning() const { return *tuning_; }
  /// The controller as a linear system that is told what the actuator held.
  [[nodiscard]] esokit::LinearController form() const {
    return esokit::detail::told_of_input(taken().controller);
  }
  /// What speaks against it.
  [[nodiscard]] const std::vector<Alarm>& alarms() const { return alarms_; }

  /// Sections of the page: observers, loop, replay, code.
  void show_on(Page& page, const Settings& settings, const Findings& findings) const;

 private:
  std::optional<esokit::Tuning> tuning_;
  std::size_t taken_ = 0;
  std::optional<esokit::Loop> loop_;
  std::vector<std::string> summary_;
  std::string code_;
  std::string why_not_;
  std::vector<Alarm> alarms_;
  Replay replay_;
};

}  // namespace from_log
