// expect: esokit: to_c writes
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/structured_text.hpp>
using Controller = esokit::MimoAdrc<esokit::LinearEso<2>, esokit::LinearEso<2>>;
void write(const Controller& c) { esokit::to_structured_text(c); }
