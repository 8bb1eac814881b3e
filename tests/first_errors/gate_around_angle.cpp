// expect: esokit: WrappedOutput goes around OutlierGate: it counts the turns
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/outlier_gate.hpp>
#include <esokit/observer/wrapped_output.hpp>

using Angle = esokit::WrappedOutput<esokit::LinearEso<2>>;
auto observer = esokit::OutlierGate<Angle>::make({});
