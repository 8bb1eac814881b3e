// expect: esokit: put WrappedOutput around OutlierGate, not inside it
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/observer/linear_eso.hpp>

using Angle = esokit::WrappedOutput<esokit::LinearEso<2>>;
auto observer = esokit::OutlierGate<Angle>::make({});
