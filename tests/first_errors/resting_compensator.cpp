// expect: esokit: Resting goes around Adrc
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/observer/linear_eso.hpp>

using Controller = esokit::Resting<esokit::DisturbanceCompensator<esokit::LinearEso<2>>>;
auto controller = Controller::make({});
