// expect: esokit: to_c writes
#include <esokit/model/linear_plant.hpp>
#include <esokit/target/c_code.hpp>
auto f(const esokit::LinearPlant<2>& c) { return esokit::to_c(c); }
