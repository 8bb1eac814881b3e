// expect: no matching (function|constructor).*LinearEso|deleted default constructor of .*LinearEso
#include <esokit/observer/linear_eso.hpp>

void run() {
  esokit::LinearEso<2> observer;
  observer.update(1.0, 2.0);
}
