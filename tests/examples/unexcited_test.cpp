// A loop at rest: u follows from y of its row. Taken a row earlier it would tell the law, with the
// sign turned, and no machine.
#include <gtest/gtest.h>

#include <cstdint>

#include <esokit/identify/identify.hpp>

#include "identify/random_plant.hpp"

namespace esokit_test {
namespace examples_unexcited_test {

TEST(Unexcited, IsRefusedHoweverEarlyUIsTaken) {
  // Two that were accepted as logged late, and one that never was.
  for (const std::uint64_t seed : {23008u, 23010u, 23001u}) {
    const auto made = identify_example::random_log(seed, identify_example::Kind::unexcited);
    esokit::Log log;
    log.u = made.u;
    log.y = made.y;
    log.sample_time = made.truth.sample_time;
    const auto found = esokit::identify(log);
    ASSERT_FALSE(found) << seed;
    EXPECT_STREQ(found.error().field, "own_input") << seed;
  }
}

}  // namespace examples_unexcited_test
}  // namespace esokit_test
