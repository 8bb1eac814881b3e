// Every observer on a simulated servo, in float: open loop with a given input, and closed loop
// under ADRC. The lines that it prints are compared with those of the same program on the host;
// numbers are the bits of floats.
//
//   size NAME observer controller            bytes
//   open NAME k estimates ..                after sample k
//   count NAME last most                     instructions of update: of the last sample, of any
//   closed NAME k y u dhat
//   done

#include <esokit/control/adrc.hpp>
#include <esokit/core/snapshot.hpp>
#include <optional>

#include "board.hpp"
#include "counting.hpp"
#include "designs.hpp"
#include "output.hpp"
#include "pasted.hpp"
#include "servo.hpp"

namespace firmware {

namespace {

constexpr int samples = 400;
constexpr int printed = 8;  // every so many samples

/// rad/s2: a load that comes and stays.
float load(int k) { return k < 200 ? 0.0f : 20.0f; }

template <class Observer>
constinit std::optional<Observer> open_observer;

template <class Observer>
constinit std::optional<esokit::Adrc<Observer>> controller;

bool refused(const char* name, const esokit::Error<float>& error) {
  Line("refused").word(name).word(error.field).word(error.rule).bits(error.value);
  return false;
}

/// The observer beside a servo that is shaken by a given input.
/// @param print the estimates, appended to a line
void open_loop(const char* name, Update* update, void* observer, void (*print)(Line&, const void*),
               const InstructionCounter* counter) {
  Servo servo;
  std::uint32_t last = 0;
  std::uint32_t most = 0;
  for (int k = 0; k < samples; ++k) {
    const float u = (k / 50) % 2 == 0 ? 1.0f : -1.0f;
    servo.step(u, load(k));
    const float y = servo.measure();
    if (counter != nullptr) {
      last = counter->count(update, observer, y, u);
      most = most < last ? last : most;
    } else {
      update(observer, y, u);
    }
    if (k % printed == printed - 1) {
      Line line("open");
      line.word(name).number(static_cast<std::uint32_t>(k));
      print(line, observer);
    }
  }
  if (counter != nullptr) Line("count").word(name).number(last).number(most);
}

/// @param name of the run @param made by `make`, or of pasted words
template <class Design, class Made>
bool open_loop(const char* name, const Made& made, const InstructionCounter* counter) {
  using Observer = typename Design::Observer;
  if (!made) return refused(name, made.error());
  auto& observer = open_observer<Observer>;
  observer.emplace(*made);
  const auto print = [](Line& line, const void* state) {
    const auto estimate = static_cast<const Observer*>(state)->estimate();
    for (int i = 0; i < Observer::size; ++i) line.bits(estimate(i));
  };
  Line("size").word(name).number(sizeof(Observer)).number(sizeof(esokit::Adrc<Observer>));
  open_loop(name, Design::update, &*observer, print, counter);
  return true;
}

template <class Design>
bool open_loop(const InstructionCounter* counter) {
  return open_loop<Design>(Design::name, Design::Observer::make(Design::config()), counter);
}

/// The same observer without its `make`: from the words that the host printed.
bool open_loop_of_pasted(const InstructionCounter* counter) {
  using Observer = FrozenFilter::Observer;
  return open_loop<FrozenFilter>("pasted", esokit::from_snapshot<Observer>(frozen_filter), counter);
}

/// One step of a controller: u, and what else there is to print.
struct ClosedStep {
  float u;
  float total_disturbance;
  bool fine;
};

/// A step of the reference, then the load.
bool closed_loop(const char* name, ClosedStep (*step)(void*, float), void* adrc) {
  Servo servo;
  ClosedStep result{};
  bool fine = true;
  for (int k = 0; k < samples; ++k) {
    servo.step(result.u, load(k));
    const float y = servo.measure();
    result = step(adrc, y);
    fine = fine && result.fine;
    if (k % printed == printed - 1) {
      Line line("closed");
      line.word(name).number(static_cast<std::uint32_t>(k));
      line.bits(y).bits(result.u).bits(result.total_disturbance);
    }
  }
  if (!(servo.position() > 0.99f && servo.position() < 1.01f)) fine = false;
  if (!fine) Line("astray").word(name).bits(servo.position());
  return fine;
}

/// ADRC with the observer.
template <class Design>
bool closed_loop() {
  using Observer = typename Design::Observer;
  using Adrc = esokit::Adrc<Observer>;
  const auto made = Adrc::make({.observer = Design::config(),
                                .controller_bandwidth = controller_bandwidth,
                                .limits = {.lower = -5.0f, .upper = 5.0f}});
  if (!made) return refused(Design::name, made.error());
  auto& adrc = controller<Observer>;
  adrc.emplace(*made);
  const auto step = [](void* state, float y) -> ClosedStep {
    auto& running = *static_cast<Adrc*>(state);
    const float u = running.update(y, 1.0f);
    return {u, running.observer().total_disturbance(), running.status() == esokit::StepStatus::ok};
  };
  return closed_loop(Design::name, step, &*adrc);
}

template <class... Designs>
bool run_all(const InstructionCounter* counter) {
  bool fine = true;
  ((fine = open_loop<Designs>(counter) && fine), ...);
  ((fine = closed_loop<Designs>() && fine), ...);
  return fine;
}

bool run() {
  std::optional<InstructionCounter> counter;
  if (board::counts()) counter.emplace();
  bool fine = run_all<Linear, Cascade, Algebraic, AdjustableBandwidth, Nonlinear, RecursiveFilter,
                      FrozenFilter>(counter ? &*counter : nullptr);
  fine = open_loop_of_pasted(counter ? &*counter : nullptr) && fine;
  if (fine) Line("done");
  return fine;
}

}  // namespace

}  // namespace firmware

int run_firmware() { return firmware::run() ? 0 : 1; }
