/// @file
/// From what was found to a controller: the choice, what it does, and the log through its observer.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/loop.hpp>
#include <esokit/tune/pid_baselines.hpp>

#include "from_log/parts/from_log.hpp"
#include "from_log/parts/page.hpp"
#include "from_log/parts/paste.hpp"

namespace from_log {

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
  /// The choice, its model and its baselines.
  [[nodiscard]] const esokit::Tuning& tuning() const { return *tuning_; }
  /// The controller as a linear system that knows what the actuator held.
  [[nodiscard]] esokit::LinearController form() const {
    return esokit::detail::given_input_form(taken().controller);
  }
  /// What its code has beside the design.
  [[nodiscard]] const Pasting& pasting() const { return pasting_; }
  /// What speaks against it.
  [[nodiscard]] const std::vector<Alarm>& alarms() const { return alarms_; }

  /// Sections of the page: observers, loop, replay, code.
  void show_on(Page& page, const Findings& findings) const;

 private:
  std::optional<esokit::Tuning> tuning_;
  std::size_t taken_ = 0;
  std::optional<esokit::Loop> loop_;
  std::vector<std::string> summary_;
  std::string code_;
  Pasting pasting_;
  std::string why_not_;
  std::vector<Alarm> alarms_;
  Replay replay_;
  esokit::FitData told_;                     ///< the log as the observer knows it
  std::vector<esokit::TunedPid> baselines_;  ///< the best PIDs, and the given one
  esokit::Migration migration_;              ///< from the given PID
  esokit::Migration to_best_;                ///< from it to the best PID
  bool migrates_ = false;                    ///< there is one
};

}  // namespace from_log
