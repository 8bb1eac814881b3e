/// @file
/// What a guarded observer has to come back from.
#pragma once

#include <gtest/gtest.h>

#include <control/loop_traits.hpp>
#include <esokit/adapter/guarded.hpp>
#include <support/numbers.hpp>

namespace esokit_test {

/// A random sequence of guards, gaps and samples of any size, under which every estimate stays
/// finite; at the end all guards are off.
template <class Guarded>
void play_garbage(Guarded& guarded, Random& random) {
  using S = typename Guarded::scalar_type;
  for (int k = random.index(150); k > 0; --k) {
    if constexpr (Guarded::gates) {
      if (random.index(5) == 0) guarded.set_pin(static_cast<esokit::Pin>(random.index(4)));
      if (random.index(5) == 0) guarded.set_trust(anything<S>(random));
      if (random.index(5) == 0) (void)guarded.hold(anything<S>(random));
      if (random.index(5) == 0) guarded.release();
    }
    if (random.index(5) == 0) (void)guarded.set_input_gain(anything<S>(random));
    switch (random.index(6)) {
      case 0:
        (void)guarded.predict(anything<S>(random));
        break;
      case 1:
        (void)guarded.correct(anything<S>(random));
        break;
      case 2:
        (void)guarded.reset(anything<S>(random));
        break;
      default:
        (void)guarded.update(anything<S>(random), anything<S>(random));
    }
    for (int i = 0; i < Guarded::size; ++i) ASSERT_TRUE(esokit::is_finite(guarded.estimate()(i)));
  }
  if constexpr (Guarded::gates) {
    guarded.set_trust(S(1));
    guarded.set_pin(esokit::Pin::free);
    guarded.release();
  }
}

}  // namespace esokit_test
