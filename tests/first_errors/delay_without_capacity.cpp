// expect: template arguments.*|too few template arguments.*DelayedInput
// also: DelayedInput
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::DelayedInput<esokit::LinearEso<2>>::make({});
