// expect: esokit: a cascade needs a model that separates the disturbance
#include <esokit/observer/cascade_eso.hpp>

/// Says no more than that it predicts.
struct Mine : esokit::ChainModel<2> {
  using esokit::ChainModel<2>::ChainModel;
  static constexpr esokit::ModelTraits traits{};
};

using Law = esokit::ConstantGain<3, double>;
constexpr auto size = sizeof(esokit::PredictorCorrector<2, double, 1, Law, 2, Mine>);
