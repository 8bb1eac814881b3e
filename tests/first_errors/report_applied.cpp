// expect: deleted function
// also: its name is applied\(u\)
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

auto report(esokit::PredictiveAdrc<esokit::LinearEso<2>>& loop, double held) {
  return loop.report_applied(held);
}
