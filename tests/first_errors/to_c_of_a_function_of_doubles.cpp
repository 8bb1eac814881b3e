// expect: esokit: to_c records the function of a KnownModel: it has to be generic, template
#include <esokit/adapter/known_model.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>

struct Friction {
  double operator()(const esokit::Vector<double, 3>& x) const noexcept {
    return x(1) > 0 ? -0.5 : 0.5;
  }
};
using Controller = esokit::Adrc<esokit::KnownModel<esokit::LinearEso<2>, Friction>>;
void write(const Controller& controller) { (void)esokit::to_c(controller); }
