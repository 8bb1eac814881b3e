/// @file
/// From what was found to a controller: the choice, what it does, and the log through its observer.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/loop.hpp>

#include "from_log/parts/from_log.hpp"
#include "from_log/parts/page.hpp"

namespace from_log {

/// A controller that could be taken.
struct Candidate {
  std::string name;      ///< of its observer
  std::string type;      ///< as C++ writes it
  std::string settings;  ///< of its config, as C++ writes them
  std::vector<std::string> headers;
  esokit::LinearController form;
  double control_noise = 0;       ///< standard deviation of u by the measurement noise
  double load_error = 0;          ///< largest error of y after a load of a tenth of the range of u
  double modulus = 0, delay = 0;  ///< margins; s
  double settling = 0;            ///< s
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

  [[nodiscard]] bool made() const { return chosen_.has_value(); }
  /// A few sentences.
  [[nodiscard]] std::vector<std::string> summary() const { return summary_; }
  /// C++ that compiles as it is.
  [[nodiscard]] const std::string& code() const { return code_; }
  /// The controller as a linear system.
  [[nodiscard]] const esokit::LinearController& form() const { return all_[*chosen_].form; }

  /// Sections of the page: observers, loop, replay, code.
  void show_on(Page& page, const Settings& settings, const Findings& findings) const;

 private:
  std::optional<std::size_t> chosen_;
  std::vector<Candidate> all_;
  std::optional<esokit::Loop> loop_;
  std::pair<double, double> limits_{};
  std::vector<std::string> summary_;
  std::string code_;
  std::string why_not_;
  Replay replay_;
};

}  // namespace from_log
