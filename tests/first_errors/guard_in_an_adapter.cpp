// expect: esokit: Guarded must be the outermost adapter
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/observer/linear_eso.hpp>

using Guard = esokit::Guarded<esokit::LinearEso<2>>;
using Late = esokit::DelayedInput<Guard, 3>;
constexpr int states = Late::size;
