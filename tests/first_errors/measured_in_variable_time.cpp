// expect: esokit: put Measured around VariableTime, not inside it
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/observer/linear_eso.hpp>

using Told = esokit::Measured<esokit::LinearEso<2>>;
using Jittering = esokit::VariableTime<Told>;
constexpr int states = Jittering::size;
