// expect: the analysis needs a linear controller.*FrozenObserver
#include <esokit/analysis/margins.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

void judge(const esokit::LinearPlant<2>& plant,
           const esokit::Adrc<esokit::NonlinearEso<2>>& controller) {
  (void)esokit::margins(plant, controller);  // its gain depends on the innovation
}
