// expect: esokit: to_c does not write VariableTime, .* update_without_measurement k - 1
#include <esokit/adapter/variable_time.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>

using Controller = esokit::Adrc<esokit::VariableTime<esokit::LinearEso<2>>>;
void write(const Controller& controller) { (void)esokit::to_c(controller); }
