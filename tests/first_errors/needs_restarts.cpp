// expect: esokit: VariableTime needs an observer
#include <esokit/adapter/variable_time.hpp>
auto c = esokit::VariableTime<float>::make({});
