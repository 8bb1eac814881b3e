// expect: esokit: PredictiveAdrc needs an observer that knows its next correction
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::PredictiveAdrc<esokit::OutlierGate<esokit::LinearEso<2>>>::make({});
