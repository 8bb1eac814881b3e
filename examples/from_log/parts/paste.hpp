/// @file
/// The code that a page gives to paste: a design with its reference profile, what is known of the
/// machine, guards and a self-check; and the same as from_log runs it.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <esokit/control/approach_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/tune/tune.hpp>

#include "from_log/parts/from_log.hpp"

namespace from_log {

/// What a measured disturbance asks of u: it acts on y^(n) later than u or sooner, so it goes to u
/// through what is between the two.
struct Feed {
  std::string name;
  std::size_t column = 0;  ///< of the log
  double rest = 0;         ///< w at which it asks for nothing
  double factor = 0;       ///< u per unit of w in the end
  double at_once = 1;      ///< share of it that is not behind the lag
  double decay = 0;        ///< of the lag in a sample
  double delay = 0;        ///< samples
  double reach = 0;        ///< its largest u in the log
  double swing = 0;        ///< a usual move of w, for the self-check

  /// Those of what the log tells, and of no function of y, which would change the margins.
  [[nodiscard]] static std::vector<Feed> make(const Input& input, const esokit::Identified& found,
                                              const esokit::TuneModel& model,
                                              const esokit::FitData& rows);
  /// Samples of w that it remembers.
  [[nodiscard]] std::size_t samples() const { return static_cast<std::size_t>(delay) + 2; }
};

/// It at work.
class FeedPath {
 public:
  explicit FeedPath(const Feed& feed) : feed_(&feed), past_(feed.samples()) { start(feed.rest); }
  /// As if w had been there for long.
  void start(double w);
  /// Part of u. @param w NaN: lost, so the last one is held
  double update(double w);

 private:
  const Feed* feed_;
  std::vector<double> past_;
  double held_ = 0, before_ = 0, v_ = 0;
};

/// Rows with the u that the observer receives: without what measured disturbances ask for.
[[nodiscard]] esokit::FitData told_rows(const std::vector<Feed>& feeds,
                                        const esokit::FitData& rows);

/// The log through an observer.
struct Replay {
  std::vector<double> t, estimate, load, innovation;  ///< load: dhat / b0
  std::vector<double> before;                         ///< estimate of y^(n-1)
  double band = 0;    ///< 95 % of the innovations are within this, says the model
  double inside = 0;  ///< share of the log's that are
};

/// Rows through the observer of a controller, each piece from rest.
[[nodiscard]] Replay through(const esokit::LinearController& form, double input_gain, int order,
                             const esokit::FitData& rows);

/// Absolute values of those that count: not while the observer finds the state.
[[nodiscard]] std::vector<double> settled(const std::vector<double>& values,
                                          const esokit::FitData& rows, std::size_t settling);

/// The value that this share of them is below.
[[nodiscard]] double quantile(std::vector<double> values, double share);

/// The numbers as the code prints them, so that all that is said is said of the code.
[[nodiscard]] esokit::TuneModel as_printed(esokit::TuneModel model);

/// The way from the effect, for which the law asks, to u.
struct ActuatorCode {
  esokit::SeenCurve seen;  ///< its numbers as printed

  /// Whether the code has a map: not where u only has limits.
  [[nodiscard]] bool curved() const { return seen.curve().points > 0; }
  [[nodiscard]] double input(double effect) const {
    return esokit::ActuatorMap<>::make(seen.curve()).value().input(effect);
  }
  /// As the code says it: the map, and the u with an effect.
  [[nodiscard]] std::string made() const;
  [[nodiscard]] std::string from(const std::string& effect) const {
    return curved() ? "actuator.input(" + effect + ")" : effect;
  }
  /// Largest change of u with an effect.
  [[nodiscard]] double steepest() const;
};

/// What the code has beside the design: the same for all designs of a page.
struct Pasting {
  std::string head;                 ///< the comment at its beginning
  std::string not_known;            ///< a sentence about what remains part of d
  int order = 1;                    ///< n
  double input_gain = 1;            ///< b0
  double friction = 0;              ///< Coulomb friction, unit of y^(n); 0: not used
  double friction_scale = 1;        ///< tanh(speed / this)
  bool by_position = false;         ///< the force by y is used
  esokit::PositionForce force;      ///< it
  double start_y = 0, start_u = 0;  ///< the machine rests there before the self-check
  double pole = 0;                  ///< of y^(n-1), where it is known well; part of u along r
  double pole_reach = 0;            ///< what it may ask of u
  double dead_time = 0;             ///< of u, s
  double room = 0;                  ///< what the forces of the log leave of u, unit of y^(n)
  double shortest = 0;              ///< no move of the profile is shorter, s
  std::vector<Feed> feeds;          ///< of the measured disturbances
  ActuatorCode actuator;            ///< u of all else is its effect

  /// @param replay of the log
  [[nodiscard]] static Pasting make(const Settings& settings, const Input& input,
                                    const Findings& findings, const esokit::TuneModel& model,
                                    const Replay& replay, std::vector<Feed> feeds);

  /// Whether the code adds what is known of the machine to u.
  [[nodiscard]] bool feeds_forward() const {
    return order == 1 || friction > 0.0 || by_position || pole > 0.0 || !feeds.empty();
  }
  /// What measured disturbances may ask of u, together: by so much the limits of the law are wider
  /// than those of u.
  [[nodiscard]] double reach() const;
  /// What of the machine is used and what is not, after "with settings from the log".
  [[nodiscard]] std::string used() const;
  /// What friction, the force by y and the damping need of u along the reference.
  [[nodiscard]] double known(double r, double rate) const;
  /// Largest derivatives of the profile of a law with so many gains: n, or n + 1 where its observer
  /// knows the lag.
  [[nodiscard]] std::vector<double> limits(const esokit::TuneModel& model, std::size_t gains) const;
  /// Order 1: bandwidth of the profile of a law with so many gains, rad/s. What it overshoots with
  /// a wrong model is measured by from_log_settling.
  [[nodiscard]] double approach(const esokit::TuneModel& model, int gains) const;
};

/// Samples of the longest dead time that `tune` takes.
inline constexpr int most_delay = 100;

/// What the code computes, sample by sample, whatever its types: a design within its limits, with
/// the profile and what is known.
class Runner {
 public:
  Runner(const Pasting& pasting, const esokit::Tuning& tuning, const esokit::TunedDesign& design);
  /// From rest at y under u.
  void start(double y, double u);
  /// Once a sample. @param target where y shall go @param w measured disturbances; NaN: lost
  double update(double y, double target, const std::vector<double>& w = {});
  /// What measured disturbances asked of u in the last sample.
  [[nodiscard]] double fed() const { return fed_; }
  /// (r, r', ..) of the last sample.
  [[nodiscard]] const std::array<double, 5>& motion() const { return motion_; }

  template <class S>
  using ProfileOf =
      std::variant<esokit::ApproachProfile<1, most_delay, S>,
                   esokit::ApproachProfile<2, most_delay, S>, esokit::SmoothProfile<2, S>,
                   esokit::SmoothProfile<3, S>, esokit::SmoothProfile<4, S>>;
  using Profile = ProfileOf<double>;
  /// In double or float. @param gains of the law
  template <class S = double>
  [[nodiscard]] static ProfileOf<S> profile_of(const Pasting& pasting,
                                               const esokit::TuneModel& model, int gains);

 private:
  const Pasting* pasting_;
  esokit::LinearController form_;
  Profile profile_;
  std::vector<FeedPath> feeds_;
  double lower_, upper_, fed_ = 0;
  std::array<double, 5> weights_{};  ///< of r, r', .. in u
  std::array<double, 5> motion_{};
  std::vector<double> state_;
  double y_ = 0, u_ = 0;  ///< where it started, without what is known
};

/// A step of the reference, as the machine that was found answers to the code, within the limits.
struct StepOfCode {
  double height = 0;
  double settling = 0;   ///< s, to within 2 %
  double overshoot = 0;  ///< share of the height
  std::vector<double> y, u;
};
/// Measured disturbances that act meanwhile.
struct Acting {
  std::vector<std::vector<double>> w{};  ///< of each feed, one a sample
  std::vector<double> force{};           ///< what they add to y^(n), straight between the samples
};
/// @param noise standard deviation @param digits of y: those that are printed; 0: all
[[nodiscard]] StepOfCode step_of_code(const Pasting& pasting, const esokit::Tuning& tuning,
                                      const esokit::TunedDesign& design, double height,
                                      double duration, double noise, int digits,
                                      const Acting* measured = nullptr);

/// The same of a PID, whose reference steps at once.
[[nodiscard]] StepOfCode step_of_pid(const Pasting& pasting, const esokit::TuneModel& model,
                                     const esokit::PlainPidConfig& config, double height,
                                     double duration);

/// What the code watches, from the log and from what was simulated.
struct Watch {
  double threshold = 0;  ///< a larger innovation is an outlier, unit of y
  double bound = 0;      ///< of dhat, unit of y^(n)
  bool guarded = false;  ///< the design is proven with a bound
  double bandwidth = 0;  ///< of the observer, rad/s
  double noise = 0;      ///< that makes the innovations of the log, unit of y
  double latency = 0;    ///< that the observer does not have, s
  double memory = 0;     ///< s
  int divider = 1;
};

[[nodiscard]] Watch watch_of(const esokit::Tuning& tuning, const esokit::TunedDesign& design,
                             const esokit::FitData& rows);

/// C++ that compiles as it is. @param rows the log, as of `told_rows`
[[nodiscard]] std::string pasted_code(const Pasting& pasting, const esokit::Tuning& tuning,
                                      const esokit::TunedDesign& design,
                                      const esokit::FitData& rows);

}  // namespace from_log
