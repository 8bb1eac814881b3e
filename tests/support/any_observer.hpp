/// @file
/// An observer whose type is forgotten, so that a law is compiled once and not once a type.
#pragma once

#include <cstddef>
#include <esokit/core/step_status.hpp>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "refusal.hpp"

namespace esokit_test {

/// A number of any scalar, exactly; the observer rounds what it is given to its own.
using Real = long double;

/// Copied as the observer is; `->` calls it.
class AnyObserver {
  using StepStatus = esokit::StepStatus;

 public:
  class Calls {
   public:
    virtual ~Calls() = default;
    [[nodiscard]] virtual Calls* copy() const = 0;
    virtual void assign(const Calls& other) = 0;
    virtual StepStatus update(Real y, Real u) = 0;
    virtual StepStatus predict(Real u) = 0;
    virtual StepStatus correct(Real y) = 0;
    virtual StepStatus reset(Real y) = 0;
    virtual StepStatus reset(const std::vector<Real>& state) = 0;
    [[nodiscard]] virtual Real estimate(int r) const = 0;
    [[nodiscard]] virtual Real output_estimate() const = 0;  ///< estimate<0>()
    [[nodiscard]] virtual Real total_disturbance() const = 0;
    [[nodiscard]] virtual Real level_estimate(int level, int r) const = 0;
    [[nodiscard]] virtual Real innovation() const = 0;
    [[nodiscard]] virtual Real applied_input() const = 0;
    [[nodiscard]] virtual Real input_gain() const = 0;
    [[nodiscard]] virtual Real sample_time() const = 0;
    [[nodiscard]] virtual int missed() const = 0;
    [[nodiscard]] virtual int max_gap() const = 0;
    [[nodiscard]] virtual int longest_gap() const = 0;
    [[nodiscard]] virtual int recovering() const = 0;
    [[nodiscard]] virtual int size() const = 0;
    [[nodiscard]] virtual int levels() const = 0;
  };

  template <class Observer>
  explicit AnyObserver(const Observer& observer) : calls_(new Of<Observer>(observer)) {}
  AnyObserver(const AnyObserver& other) : calls_(other.calls_->copy()) {}
  AnyObserver& operator=(const AnyObserver& other) {
    calls_->assign(*other.calls_);
    return *this;
  }
  ~AnyObserver() = default;

  Calls* operator->() { return calls_.get(); }
  const Calls* operator->() const { return calls_.get(); }

  /// The observer, of a type that the caller knows.
  template <class Observer>
  Observer& as() {
    return static_cast<Of<Observer>&>(*calls_).observer;
  }

 private:
  template <class Observer>
  class Of final : public Calls {
    using S = typename Observer::scalar_type;
    static S s(Real x) { return static_cast<S>(x); }

   public:
    explicit Of(const Observer& of) : observer(of) {}
    [[nodiscard]] Calls* copy() const override { return new Of(observer); }
    void assign(const Calls& other) override { observer = static_cast<const Of&>(other).observer; }
    StepStatus update(Real y, Real u) override { return observer.update(s(y), s(u)); }
    StepStatus predict(Real u) override { return observer.predict(s(u)); }
    StepStatus correct(Real y) override { return observer.correct(s(y)); }
    StepStatus reset(Real y) override { return observer.reset(s(y)); }
    StepStatus reset(const std::vector<Real>& state) override {
      typename Observer::Estimate estimate;
      for (int r = 0; r < Observer::size; ++r) estimate(r) = s(state[static_cast<std::size_t>(r)]);
      return observer.reset(estimate);
    }
    [[nodiscard]] Real estimate(int r) const override { return observer.estimate()(r); }
    [[nodiscard]] Real output_estimate() const override { return observer.template estimate<0>(); }
    [[nodiscard]] Real total_disturbance() const override { return observer.total_disturbance(); }
    [[nodiscard]] Real level_estimate(int level, int r) const override {
      return observer.level_estimate(level)(r);
    }
    [[nodiscard]] Real innovation() const override { return observer.innovation(); }
    [[nodiscard]] Real applied_input() const override { return observer.applied_input(); }
    [[nodiscard]] Real input_gain() const override { return observer.input_gain(); }
    [[nodiscard]] Real sample_time() const override { return observer.sample_time(); }
    [[nodiscard]] int missed() const override { return observer.missed(); }
    [[nodiscard]] int max_gap() const override { return observer.max_gap(); }
    [[nodiscard]] int longest_gap() const override { return observer.longest_gap(); }
    [[nodiscard]] int recovering() const override { return observer.recovering(); }
    [[nodiscard]] int size() const override { return Observer::size; }
    [[nodiscard]] int levels() const override { return Observer::levels; }

    Observer observer;
  };

  std::unique_ptr<Calls> calls_;
};

/// What `make` gave: an observer, or what it was refused for.
struct Made {
  std::optional<AnyObserver> observer;
  std::string field, refused;

  template <class Outcome>
  explicit Made(const Outcome& outcome) : refused(refusal(outcome)) {
    if (outcome) {
      observer.emplace(*outcome);
    } else {
      field = outcome.error().field;
    }
  }
  explicit operator bool() const { return observer.has_value(); }
};

}  // namespace esokit_test
