// What a whole step of a controller costs, in a loop that has to come to its reference; and an
// update of observers with a model.
//
//   size NAME bytes
//   count NAME last most      instructions of update: of the last sample, of any
//   done

#include "controllers.hpp"

#include <optional>

#include "board.hpp"
#include "counting.hpp"
#include "output.hpp"
#include "servo.hpp"

namespace firmware {

namespace {

template <class Design>
constinit std::optional<typename Design::Controller> controller;

template <class Design>
bool count(const InstructionCounter* counter) {
  const auto made = Design::make();
  if (!made) {
    Line("refused").word(Design::name).word(made.error().field).word(made.error().rule);
    return false;
  }
  auto& running = controller<Design>;
  running.emplace(*made);
  Line("size").word(Design::name).number(sizeof(*running));
  Servo servo;
  std::uint32_t last = 0;
  std::uint32_t most = 0;
  for (int k = 0; k < 400; ++k) {
    // A load that comes and stays, and a reference that takes u to its limits.
    float u = 0.0f;
    if constexpr (requires { running->output()(0); }) {
      u = 1.2f * running->output()(0);  // both channels alike
    } else {
      u = running->output();
    }
    servo.step(u, k < 200 ? 0.0f : 20.0f);
    const float y = servo.measure();
    if (counter != nullptr) {
      last = counter->count(Design::update, &*running, y, 1.0f);
      most = most < last ? last : most;
    } else {
      (void)Design::update(&*running, y, 1.0f);
    }
  }
  if (counter != nullptr) Line("count").word(Design::name).number(last).number(most);
  const bool there = servo.position() > 0.99f && servo.position() < 1.01f;
  if (!there) Line("astray").word(Design::name).bits(servo.position());
  return there;
}

template <class Design>
constinit std::optional<typename Design::Observer> observer;

/// An observer beside a servo that u = 0.1 V drives.
template <class Design>
bool count_alone(const InstructionCounter* counter) {
  const auto made = Design::make();
  if (!made) {
    Line("refused").word(Design::name).word(made.error().field).word(made.error().rule);
    return false;
  }
  auto& running = observer<Design>;
  running.emplace(*made);
  Line("size").word(Design::name).number(sizeof(*running));
  Servo servo;
  std::uint32_t last = 0;
  std::uint32_t most = 0;
  for (int k = 0; k < 400; ++k) {
    servo.step(0.1f, 0.0f);
    const float y = servo.measure();
    if (counter != nullptr) {
      last = counter->count(Design::update, &*running, y, 0.1f);
      most = most < last ? last : most;
    } else {
      (void)Design::update(&*running, y, 0.1f);
    }
  }
  if (counter != nullptr) Line("count").word(Design::name).number(last).number(most);
  return true;
}

}  // namespace

}  // namespace firmware

int run_firmware() {
  using namespace firmware;
  std::optional<InstructionCounter> counter;
  if (board::counts()) counter.emplace();
  const InstructionCounter* counts = counter ? &*counter : nullptr;
  const bool fine = count<Single>(counts) && count<Limited>(counts) && count<Double>(counts) &&
                    count_alone<MotorLag1>(counts) && count_alone<MotorLag2>(counts) &&
                    count_alone<SensorLag1>(counts) && count_alone<SensorLag2>(counts) &&
                    count_alone<Resonator>(counts);
  if (fine) Line("done");
  return fine ? 0 : 1;
}
