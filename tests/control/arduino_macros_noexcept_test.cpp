// Arduino's macros, defined before our headers, do no harm to what runs in a controller. (Before
// the standard library and Eigen they do: that is theirs to say.)
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <variant>

#define min(a, b) ((a) < (b) ? (a) : (b))
#define max(a, b) ((a) > (b) ? (a) : (b))
#define abs(x) ((x) > 0 ? (x) : -(x))
#define round(x) ((x) >= 0 ? (long)((x) + 0.5) : (long)((x)-0.5))
#define constrain(x, low, high) ((x) < (low) ? (low) : ((x) > (high) ? (high) : (x)))
#define radians(deg) ((deg)*DEG_TO_RAD)
#define degrees(rad) ((rad)*RAD_TO_DEG)
#define sq(x) ((x) * (x))
#define bit(b) (1UL << (b))
#define bitRead(value, bit) (((value) >> (bit)) & 0x01)
#define bitSet(value, bit) ((value) |= (1UL << (bit)))
#define bitClear(value, bit) ((value) &= ~(1UL << (bit)))
#define lowByte(w) ((unsigned char)((w)&0xff))
#define highByte(w) ((unsigned char)((w) >> 8))
#define interrupts() 1
#define noInterrupts() 0
#define F(text) (text)
#define _BV(b) (1UL << (b))
#define PI 3.1415926535897932384626433832795
#define HALF_PI 1.5707963267948966192313216916398
#define TWO_PI 6.283185307179586476925286766559
#define DEG_TO_RAD 0.017453292519943295769236907684886
#define RAD_TO_DEG 57.295779513082320876798154814105
#define EULER 2.718281828459045235360287471352
#define HIGH 0x1
#define LOW 0x0
#define INPUT 0x0
#define OUTPUT 0x1
#define INPUT_PULLUP 0x2
#define SERIAL 0x0
#define DISPLAY 0x1
#define LSBFIRST 0
#define MSBFIRST 1
#define CHANGE 1
#define FALLING 2
#define RISING 3
#define DEFAULT 1
#define EXTERNAL 0
#define INTERNAL 3
#define B0 0
#define B00 0
#define B1 1
#define B01 1
#define B10 2
#define B11 3
#define B100 4
#define A0 14
#define A1 15
#define A2 16

#include "controller_headers.hpp"  // all of core, model, design, observer and control; CMake writes it

namespace {

using Angle = esokit::WrappedOutput<esokit::LinearEso<2, float>>;

bool runs() {
  auto controller =
      esokit::Adrc<Angle>::make({.observer = {.observer = {.observer_bandwidth = 50.0f,
                                                           .input_gain = 2.0f,
                                                           .sample_time = 1e-3f},
                                              .period = 6.2831853f},
                                 .controller_bandwidth = 10.0f,
                                 .limits = {.lower = -1.0f, .upper = 1.0f, .rate = 10.0f}});
  if (!controller) return false;
  controller->update(3.0f, 1.0f);
  auto switched = esokit::AdjustableBandwidthEso<2>::make(
      {.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = 1e-3});
  auto filter = esokit::ExtendedStateFilter<2>::make(
      {.input_gain = 1.0, .sample_time = 1e-3, .measurement_variance = 1e-3});
  if (switched) switched->update(1.0, 0.0);
  if (filter) filter->update(1.0, 0.0);
  auto smooth = esokit::TrackingDifferentiator<>::make({.acceleration = 10.0, .sample_time = 1e-3});
  return controller->output() < 0.0f && smooth.has_value();
}

}  // namespace

int main() { return runs() ? 0 : 1; }
