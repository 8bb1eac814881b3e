// expect: (deleted function|deleted default constructor).*LinearEso
#include <esokit/observer/linear_eso.hpp>

void run() {
  esokit::LinearEso<2> observer;
  observer.update(1.0, 2.0);
}
