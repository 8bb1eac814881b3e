// A controller as a member of a class in a control loop that says what goes wrong.
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <iostream>
#include <limits>
#include <utility>

class Heater {
  using Controller = esokit::Adrc<esokit::LinearEso<1>>;  // heat to temperature: one integration

 public:
  // Settings from a file, say: what is wrong with them is an error, not an exception.
  static esokit::Expected<Heater, esokit::Error<double>> make(double bandwidth) {
    auto controller =
        Controller::make({.observer = {.observer_bandwidth = 5.0 * bandwidth,
                                       .input_gain = 0.02,
                                       .sample_time = 0.1},
                          .controller_bandwidth = bandwidth,
                          .limits = {.lower = 0.0, .upper = 100.0},  // %
                          .missing = {.most = 5, .input = 0.0}});  // off, if the sensor stays away
    if (!controller) return controller.error();
    return Heater(*controller);
  }

  double step(double temperature, double wanted) {
    const double power = controller_.update(temperature, wanted);
    if (controller_.status() != reported_) std::cout << (reported_ = controller_.status()) << '\n';
    if (controller_.mode() == esokit::LoopMode::safe) std::cout << "safe: no measurements\n";
    return power;
  }

 private:
  explicit Heater(const Controller& controller) : controller_(controller) {}
  Controller controller_;
  esokit::StepStatus reported_ = esokit::StepStatus::ok;
};

int main() {
  std::cout << Heater::make(-0.1).error() << '\n';  // the field, the value, the rule
  auto heater = Heater::make(0.1).value();
  double temperature = 20.0, power = 0.0;
  for (int k = 0; k < 1200; ++k) {
    const bool unplugged = k >= 1190;
    power = heater.step(unplugged ? std::numeric_limits<double>::quiet_NaN() : temperature, 60.0);
    temperature += 0.1 * (0.02 * power - 0.01 * (temperature - 20.0));
  }
  return temperature > 59.0 && temperature < 61.0 && power == 0.0 ? 0 : 1;
}
