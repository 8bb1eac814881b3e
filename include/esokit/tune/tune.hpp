/// @file
/// From a model and a requirement to a ranked list of designs: which observer, which bandwidths.
///
/// ```cpp
/// auto tuning = tune(tune_model(*identified, -12.0, 12.0));
/// std::puts(tuning->designs.front().code.c_str());
/// ```
///
/// 1. J = var(y) + rho var(b0 u~), u~ = u + d / b0, at the samples: the effect of measurement noise
///    and of a random-walk disturbance on the loop (tune/loop_cost.hpp).
/// 2. The requirement sets rho: there is one LQG controller for each rho, and one of them just
/// meets it.
/// 3. J of that controller is J*, the smallest J of all linear controllers (tune/lqg.hpp).
/// 4. For each family J is minimised at this rho under the rules; if it cannot keep them, the
/// design says which one.
///    Of free poles J and margins of a chain are the same however they are divided between observer
///    and law. The division is that at which the search ends, which starts from the law of the LQG
///    controller; where a rule binds, that of all divisions that breaks the rules least.
/// 5. Designs are ranked by J; those within 1 % by the cost of an update, then by the
///    modulus margin.
/// 6. The first is simulated within the limits of u: if it does not recover from an overload, it
///    ranks behind and the next is simulated (tune/overload.hpp).
#pragma once

#include <cmath>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/detail/family_search.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/overload.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <functional>
#include <string>
#include <vector>

namespace esokit {

namespace detail {

/// The response of y to a step: largest magnitude, and the time after which it stays within 2 % of
/// `final`.
struct StepAnswer {
  double peak = 0.0;
  double settling = 0.0;
};

/// @param horizon samples to follow it; the first 50000 one by one, then in steps that double
StepAnswer step_answer(const DynamicSystem& system, int input, double size, double final,
                       double horizon);

/// An event in words.
std::string in_words(const Overload& event, const TuneModel& model);

/// Simulates all events on all variants of the plant, until one is lost.
void simulate_law(TunedDesign& d, const TuneModel& model);

/// Simulates a controller as it is; false if no other way to act at its limits can help.
bool simulate_as_is(TunedDesign& d, const TuneModel& model);

/// What the loop of a design does, and the rule that limits it.
/// @param kept what it keeps of the rules, from its LoopNumbers and the damping of its poles
void fill_in_loop(TunedDesign& d, const TuneSearch& search, LoopNumbers numbers,
                  const std::function<TuneSearch::Kept(const LoopNumbers&, double)>& kept_by,
                  double optimum, double free_cost);

/// By J; among the remaining designs within 1 % of the smallest J, the cheapest update comes next.
/// Behind is what has to be softened beyond order 2, then what does not recover, last what does
/// not keep the rules.
void rank(std::vector<TunedDesign>& designs, int order);

/// All families for a model.
std::vector<Contender> contenders(const TuneModel& model, bool law_is_given);

/// Bandwidth w of the LQG law, rho = w^(-2n), that meets a requirement: the monotonic function
/// `rises(w)` shall be `wanted`.
template <class Function>
double bandwidth_for(const Function& rises, double wanted, double low, double high) {
  for (int i = 0; i < 40 && high > low * 1.0005; ++i) {
    const double middle = std::sqrt(low * high);
    (rises(middle) < wanted ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace detail

/// Finds designs for a model, the best one first.
/// @return error for a model that `validate` refuses, more than one requirement, or a requirement
///         that no controller can meet
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& given,
                                                   const TuneSpecification& specification = {},
                                                   const TuneRules& rules = {});

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/tune.ipp>
#endif
