// expect: esokit: a branch on a value cannot be recorded: .* write select
#include <esokit/adapter/known_model.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>

struct Friction {
  template <class E>
  auto operator()(const E& x) const noexcept {
    return x(1) > 0 ? -0.5 : 0.5;
  }
};
using Controller = esokit::Adrc<esokit::KnownModel<esokit::LinearEso<2>, Friction>>;
void write(const Controller& controller) { (void)esokit::to_c(controller); }
