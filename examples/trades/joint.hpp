// A joint of a robot as a member of a node: parameters by name, one call a cycle, a log that
// from_log reads, a diagnosis in words. It needs no ROS; the comments say where ROS would be.
//
// angle, wanted  rad                          torque  N m, at most most_torque
// inertia        kg m^2, motor and load: b0 = 1 / inertia, which from_log finds in the log
#pragma once

#include <array>
#include <esokit/analysis/health_text.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <map>
#include <ostream>
#include <string>

namespace trades {

class Joint {
  using Loop = esokit::Adrc<esokit::LinearEso<2>>;  // torque to angle: two integrations
  using Monitor = esokit::HealthMonitor<3>;

 public:
  using Parameters = std::map<std::string, double>;  // in a node: get_parameter(name).as_double()

  /// The error is a sentence; in a node: RCLCPP_FATAL it and return.
  static esokit::Expected<Joint, std::string> make(const Parameters& parameters) {
    for (const char* name : {"inertia", "settling_time", "most_torque", "rate"}) {
      const auto found = parameters.find(name);
      if (found == parameters.end() || !(found->second > 0)) {
        return std::string("parameter ") + name + " is missing or not positive";
      }
    }
    const double bandwidth = 6 / parameters.at("settling_time");
    const double torque = parameters.at("most_torque");
    const double sample_time = 1 / parameters.at("rate");
    const auto loop = Loop::make({.observer = {.observer_bandwidth = 5 * bandwidth,
                                               .input_gain = 1 / parameters.at("inertia"),
                                               .sample_time = sample_time},
                                  .controller_bandwidth = bandwidth,
                                  .limits = {.lower = -torque, .upper = torque},
                                  // no torque if 20 measurements are missing
                                  .missing = {.most = 20, .input = 0}});
    if (!loop) return to_text(loop.error());
    const auto monitor = Monitor::make(
        {.observer_bandwidth = 5 * bandwidth, .sample_time = sample_time, .input_range = torque});
    if (!monitor) return to_text(monitor.error());
    return Joint(*loop, *monitor);
  }

  /// In the timer's callback. @param angle NaN where the encoder did not answer @param wanted
  /// angle, speed, acceleration @return torque
  double cycle(double angle, const std::array<double, 3>& wanted) {
    const double torque = loop_.update(angle, {wanted[0], wanted[1], wanted[2]});
    monitor_.look(loop_);
    if (log_) esokit::write_row(*log_, esokit::telemetry(loop_, time_, angle, wanted[0]));
    time_ += loop_.observer().sample_time();
    return torque;
  }

  /// Once a second: what is likely wrong and what to do; empty if nothing is.
  [[nodiscard]] std::string complaint() const {
    const esokit::LoopFault fault = diagnose(monitor_.health());
    return fault == esokit::LoopFault::none ? "" : esokit::to_text(fault);
  }

  /// New parameters while it runs, without a jump of the torque. If they are refused, nothing
  /// changes, and the result says why. In a node: the callback for changed parameters.
  std::string set(const Parameters& parameters) {
    const auto fresh = make(parameters);
    if (!fresh) return fresh.error();
    if (const auto adopted = loop_.adopt(fresh->loop_); !adopted) return to_text(adopted.error());
    monitor_ = fresh->monitor_;
    return "";
  }

  /// From now on each cycle writes a row there, until null is given.
  void log_to(std::ostream* log) {
    log_ = log;
    if (log_) esokit::write_header<3>(*log_);
    if (log_) log_->precision(17);
  }

  /// Torque that friction, load and gravity take, N m.
  [[nodiscard]] double load() const {
    return -loop_.observer().total_disturbance() / loop_.observer().input_gain();
  }

 private:
  Joint(const Loop& loop, const Monitor& monitor) : loop_(loop), monitor_(monitor) {}

  Loop loop_;
  Monitor monitor_;
  std::ostream* log_ = nullptr;
  double time_ = 0;
};

}  // namespace trades
