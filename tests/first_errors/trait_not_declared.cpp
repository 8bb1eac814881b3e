// expect: esokit: controllers and adapters take .* declared in its traits
// also: PublishesChainAsDeclared
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

struct Own : esokit::LinearEso<2> {
  static esokit::Expected<Own, esokit::Error<double>> make(const Config&);
  double total_disturbance() const { return 0; }  // Adrc would take that of the base
};

esokit::Adrc<Own>* controller;
