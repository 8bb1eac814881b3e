// A joint of a robot as a member of a node: parameters by name, one call a cycle, a log that
// from_log reads, a diagnosis in words. Nothing in here needs ROS; where it would be is said.
//
// angle, wanted  rad                          torque  N m, at most most_torque
// inertia        kg m^2, motor and load: b0 = 1 / inertia. From a log: from_log FILE
#pragma once

#include <array>
#include <esokit/control/adrc.hpp>
#include <esokit/control/health_text.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <map>
#include <optional>
#include <ostream>
#include <sstream>
#include <string>

namespace trades {

class Joint {
  using Loop = esokit::Adrc<esokit::LinearEso<2>>;  // torque to angle: two integrations
  using Monitor = esokit::HealthMonitor<3>;

 public:
  using Parameters = std::map<std::string, double>;  // in a node: get_parameter(name).as_double()

  // The name and range of what is wrong goes to the caller; in a node: RCLCPP_FATAL and return.
  static esokit::Expected<Joint, std::string> make(const Parameters& parameters) {
    for (const char* name : {"inertia", "settling_time", "most_torque", "rate"}) {
      if (!parameters.contains(name)) return std::string("parameter ") + name + " is missing";
    }
    const double bandwidth = 6 / parameters.at("settling_time");
    const auto loop = Loop::make(
        {.observer = {.observer_bandwidth = 5 * bandwidth,
                      .input_gain = 1 / parameters.at("inertia"),
                      .sample_time = 1 / parameters.at("rate")},
         .controller_bandwidth = bandwidth,
         .limits = {.lower = -parameters.at("most_torque"), .upper = parameters.at("most_torque")},
         .missing = {.most = 20, .input = 0}});  // no torque if the encoder stays away
    if (!loop) return text(loop.error());
    const auto monitor = Monitor::make({.observer_bandwidth = 5 * bandwidth,
                                        .sample_time = 1 / parameters.at("rate"),
                                        .input_range = parameters.at("most_torque")});
    if (!monitor) return text(monitor.error());
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

  /// Once a second: what to say, if there is anything.
  [[nodiscard]] std::optional<std::string> complaint() const {
    const esokit::LoopFault fault = diagnose(monitor_.health());
    if (fault == esokit::LoopFault::none) return std::nullopt;
    return text(fault);
  }

  /// Parameters changed while it runs: without a jump of the torque. What is refused changes
  /// nothing.
  esokit::Expected<void, std::string> set(const Parameters& parameters) {
    const auto fresh = make(parameters);
    if (!fresh) return fresh.error();
    if (const auto adopted = loop_.adopt(fresh->loop_); !adopted) return text(adopted.error());
    monitor_ = fresh->monitor_;
    return {};
  }

  /// Every sample goes there as a row, until null. `from_log FILE` finds the inertia in it.
  void log_to(std::ostream* log) {
    log_ = log;
    if (log_ == nullptr) return;
    log_->precision(17);
    esokit::write_header<3>(*log_);
  }

  /// Torque that friction, load and gravity take, N m.
  [[nodiscard]] double load() const {
    return -loop_.observer().total_disturbance() / loop_.observer().input_gain();
  }

 private:
  Joint(const Loop& loop, const Monitor& monitor) : loop_(loop), monitor_(monitor) {}

  template <class T>
  static std::string text(const T& value) {
    std::ostringstream out;
    out << value;
    return out.str();
  }

  Loop loop_;
  Monitor monitor_;
  std::ostream* log_ = nullptr;
  double time_ = 0;
};

}  // namespace trades
