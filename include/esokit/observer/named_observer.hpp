/// @file
/// NamedObserver: the common base of all named observers: design from a config.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <type_traits>

namespace esokit {

/// Base of the named observers: `make` and `retune`.
///
/// A named observer is a model, a law, a config and their documentation. Your own observer is
///
///     template <int Order, Scalar S = double>
///     class MyEso : public NamedObserver<MyEso<Order, S>,
///                                        PredictorCorrector<Order, S, 1, MyGain<Order + 1, S>>> {
///      public:
///       struct Config {
///         S observer_bandwidth{};
///         S input_gain{};
///         S sample_time{};
///         int max_gap = 100;
///       };
///       using MyEso::NamedObserver::NamedObserver;
///       static auto design(const Config& config, const auto& model) {
///         return MyGain<Order + 1, S>::make(config.observer_bandwidth, model.sample_time());
///       }
///     };
///
/// `design` returns the gain law (for a cascade all laws) as an Expected. It is called after b0, T
/// and max_gap have been checked. An observer whose packs compute all lanes at once also declares
/// `with_scalar`, see core/packed.hpp.
/// @tparam Self the observer itself @tparam Base PredictorCorrector
template <class Self, class Base>
class NamedObserver : public Base {
 public:
  using scalar_type = typename Base::scalar_type;  ///< type of states and settings

  /// Checks the settings and does all the design work.
  /// @return the observer (at rest at zero), or an error that names the field
  template <class O = Self>
  static Expected<Self, Error<scalar_type>> make(const typename O::Config& config) {
    if constexpr (Base::order < 1) {
      // Nothing else is instantiated: further errors would hide this one.
      static_assert(Base::order >= 1, "esokit: the plant order must be at least 1");
      return Error<scalar_type>{};
    } else {
      static_assert(detail::refuses_packs<scalar_type>());
      using Model = typename Base::PlantModel;
      // The chain is checked first: laws divide by what it checks.
      if (auto ok = Base::check_chain({config.input_gain, config.sample_time, config.max_gap}); !ok)
        return ok.error();
      const auto model = detail::make_model<Model>(config);
      if (!model) return model.error();
      const auto laws = O::design(config, *model);
      if (!laws) return laws.error();
      return Self(config, *model, *laws, config.max_gap);
    }
  }

  /// New settings while running. The estimates of all levels are kept; a change of b0 is moved into
  /// the disturbance (of level 1). A refused config changes nothing.
  template <class O = Self>
  Check<scalar_type> retune(const typename O::Config& config) {
    return detail::retune(static_cast<Self&>(*this), config);
  }

 protected:
  using Laws = typename Base::Laws;       ///< one for each level
  using Law = typename Laws::value_type;  ///< result of `design`

  /// From checked parts: the config, for observers that store more than their laws, and the
  /// arguments of the constructor of `Base`.
  template <class Config, class Part, class... Parts>
  NamedObserver(const Config&, const Part& part, const Parts&... parts) noexcept
      : Base(part, parts...) {}
};

}  // namespace esokit
