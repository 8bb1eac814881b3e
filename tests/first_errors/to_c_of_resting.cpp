// expect: esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso, CascadeEso
#include <esokit/control/resting.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>

using Controller = esokit::Resting<esokit::Adrc<esokit::LinearEso<2>>>;
void write(const Controller& controller) { (void)esokit::to_c(controller); }
