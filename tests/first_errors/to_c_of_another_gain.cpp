// expect: esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso, CascadeEso
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/target/c_code.hpp>

void write(const esokit::Adrc<esokit::AlgebraicEso<2>>& controller) { esokit::to_c(controller); }
