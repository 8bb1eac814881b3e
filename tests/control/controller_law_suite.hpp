/// @file
/// The laws that every controller must obey, whatever observer and form it is made of. They are
/// compiled once (controller_law_suite.cpp) and call a controller of any type by virtual members. A
/// translation unit names its types:
/// `const bool registered = register_controller_laws("Name", TypeList<Adrc<..>, ..>{});`.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/eigen.hpp>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <support/law_registration.hpp>
#include <support/refusal.hpp>
#include <utility>
#include <vector>

#include "loop_traits.hpp"

namespace esokit_test {

/// What the laws set; T is always the same.
struct LoopSetup {
  static constexpr double period = 0.005;  ///< T, s
  double omega_o = 40;                     ///< rad/s
  double gain = 2;                         ///< b0
  double omega_c = 6;                      ///< rad/s
  esokit::LoopSettings<double> loop{};
  std::optional<bool> soften{};
};

/// A controller of any type. Numbers are double; one of floats rounds them.
class AnyController {
 public:
  struct State {
    double output, requested;
    StepStatus status;
    LoopMode mode;
    std::vector<double> estimate;
    double innovation, applied_input;
    int missed;
  };

  virtual ~AnyController() = default;
  [[nodiscard]] virtual std::unique_ptr<AnyController> copy() const = 0;
  virtual double update(double y, double r) = 0;
  virtual StepStatus applied(double u) = 0;
  virtual double update_with_rate(double y, double r, double rate) = 0;
  virtual double update_without_measurement(double r) = 0;
  virtual double track(double y, double r, double u_applied) = 0;
  virtual StepStatus start(double y, double u) = 0;
  /// "accepted", or the refusal.
  virtual std::string retune(const LoopSetup& setup) = 0;
  [[nodiscard]] virtual State state() const = 0;
  [[nodiscard]] virtual std::vector<double> gains() const = 0;
};

/// A type of controller, and how it and its other forms are made.
struct ControllerType {
  /// u of y and what else the form takes.
  using Form = std::function<double(double y, double other)>;

  std::string name;
  int order;
  bool single;              ///< computes in float
  bool error_based;         ///< ErrorBased
  bool approximate;         ///< LoopTraits::approximate
  bool bears_regular_gaps;  ///< ObserverTraits
  std::unique_ptr<AnyController> (*make)(const LoopSetup&);
  std::string (*refusal_of)(const LoopSetup&);  ///< "accepted", or the refusal
  Form (*compensator)(const LoopSetup&);        ///< of y and the output of the base controller
  Form (*mimo)(const LoopSetup&);               ///< of y and r; one channel
};

template <class Controller>
class ErasedController;

template <class O, class F>
class ErasedController<Adrc<O, F>> final : public AnyController {
  using Controller = Adrc<O, F>;
  using Compensator = esokit::DisturbanceCompensator<O>;
  using Mimo = esokit::MimoAdrc<O>;
  using S = typename O::scalar_type;
  static constexpr bool error_based = std::is_same_v<F, ErrorBased>;

 public:
  explicit ErasedController(const Controller& c) : c_(c) {}

  [[nodiscard]] std::unique_ptr<AnyController> copy() const override {
    return std::unique_ptr<AnyController>(new ErasedController(*this));
  }
  double update(double y, double r) override { return d(c_.update(s(y), s(r))); }
  StepStatus applied(double u) override { return c_.applied(s(u)); }
  double update_with_rate(double y, double r, double rate) override {
    return d(c_.update(s(y), esokit::EigenMatrix<S, 2>(s(r), s(rate))));
  }
  double update_without_measurement(double r) override {
    return d(c_.update_without_measurement(s(r)));
  }
  double track(double y, double r, double u_applied) override {
    return d(c_.track(s(y), s(r), s(u_applied)));
  }
  StepStatus start(double y, double u) override { return c_.start(s(y), s(u)); }
  std::string retune(const LoopSetup& setup) override { return refusal(c_.retune(config(setup))); }
  [[nodiscard]] State state() const override {
    const O& o = c_.observer();
    State now{d(c_.output()),    d(c_.requested()),    c_.status(), c_.mode(), {},
              d(o.innovation()), d(o.applied_input()), o.missed()};
    for (const S z : o.estimate()) now.estimate.push_back(d(z));
    return now;
  }
  [[nodiscard]] std::vector<double> gains() const override {
    return {c_.gains().begin(), c_.gains().end()};
  }

  static ControllerType type() {
    ControllerType type{};
    type.name = ::testing::internal::GetTypeName<Controller>();
    type.order = O::order;
    type.single = std::is_same_v<S, float>;
    type.error_based = error_based;
    type.approximate = requires { LoopTraits<O>::approximate; };
    type.bears_regular_gaps = esokit::observer_traits<O>.bears_regular_gaps;
    type.make = [](const LoopSetup& setup) -> std::unique_ptr<AnyController> {
      return std::unique_ptr<AnyController>(
          new ErasedController(Controller::make(config(setup)).value()));
    };
    type.refusal_of = [](const LoopSetup& setup) {
      return refusal(Controller::make(config(setup)));
    };
    // These two are fed y.
    if constexpr (!error_based) {
      type.compensator = [](const LoopSetup& setup) -> ControllerType::Form {
        const auto settings = config(setup);
        const typename Compensator::Config compensating{.observer = settings.observer,
                                                        .limits = settings.limits};
        return [form = Compensator::make(compensating).value()](double y, double v) mutable {
          return d(form.update(s(y), s(v)));
        };
      };
      type.mimo = [](const LoopSetup& setup) -> ControllerType::Form {
        typename Mimo::Config settings{};
        settings.observers = {LoopTraits<O>::config(setup.omega_o, LoopSetup::period, 0)};
        settings.controller_bandwidths = {s(setup.omega_c)};
        settings.input_matrix(0, 0) = s(setup.gain);
        settings.limits = {config(setup).limits};
        using One = typename Mimo::Output;
        return [form = Mimo::make(settings).value()](double y, double r) mutable {
          return d(form.update(One(s(y)), One(s(r)))(0));
        };
      };
    }
    return type;
  }

 private:
  static S s(double x) { return static_cast<S>(x); }
  static double d(S x) { return static_cast<double>(x); }
  /// No limit in double is none in float.
  static S limit(double x) {
    constexpr auto most = static_cast<double>((std::numeric_limits<S>::max)());
    return s(std::clamp(x, -most, most));
  }
  static typename Controller::Config config(const LoopSetup& setup) {
    const auto& loop = setup.loop;
    typename Controller::Config config{};
    config.observer = LoopTraits<O>::config(setup.omega_o, LoopSetup::period, setup.gain);
    config.controller_bandwidth = s(setup.omega_c);
    config.limits = {limit(loop.limits.lower), limit(loop.limits.upper), limit(loop.limits.rate)};
    config.start_hold = {s(loop.start_hold.time), s(loop.start_hold.input)};
    config.missing.most = loop.missing.most;
    if (loop.missing.input) config.missing.input = s(*loop.missing.input);
    config.missing.stay = loop.missing.stay;
    config.missing.hold = loop.missing.hold;
    config.measurement_divider = loop.measurement_divider;
    config.soften = setup.soften;
    return config;
  }

  Controller c_;
};

/// Registers all laws for one type, as tests of the suite `suite`.
void register_controller_laws_of(const std::string& suite, const ControllerType& type,
                                 const char* file);

/// For each type of the list, as suites NAME/0, NAME/1, ..; with ESOKIT_ONE_TYPE for the first
/// alone.
template <class First, class... Rest>
bool register_controller_laws(const std::string& name, TypeList<First, Rest...>,
                              const char* file = __builtin_FILE()) {
  register_controller_laws_of(name + "/0", ErasedController<First>::type(), file);
#ifndef ESOKIT_ONE_TYPE
  int index = 0;
  (register_controller_laws_of(name + "/" + std::to_string(++index), ErasedController<Rest>::type(),
                               file),
   ...);
#endif
  return true;
}

}  // namespace esokit_test
