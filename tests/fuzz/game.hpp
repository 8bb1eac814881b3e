/// @file
/// What of an episode is the same for every type: the order of events, the bookkeeping and what is
/// said of a failure. Compiled once; driver.hpp has what depends on the type.
#pragma once

#include <esokit/core/step_status.hpp>
#include <vector>

#include "fuzz/config.hpp"
#include "fuzz/run.hpp"

namespace fuzz {

/// A call by its name; `act` is a function of the type's driver.
struct Action {
  const char* name;
  void (*act)();
};

class Game {
 public:
  Game(const Game&) = delete;
  Game& operator=(const Game&) = delete;
  Failure play();

 protected:
  Game(Episode& episode, const std::vector<Action>& actions)
      : episode_(episode), actions_(actions) {}
  ~Game() = default;

  // ------------------------------------------------------------------ of the type
  /// Draws the config.
  virtual void fill() = 0;
  /// False: refused.
  virtual bool make() = 0;
  virtual void copy() = 0;
  virtual void act(const Action& action) = 0;
  virtual void invariants() = 0;
  [[nodiscard]] virtual bool far_from_ringing() const = 0;
  virtual void recover() = 0;

  // ------------------------------------------------------------------ what it tells
  void fail(const char* text);
  void fail(const char* of, const char* text);
  /// Since `before` nothing may have been allocated.
  void without_allocation(long before) {
    if (allocations() != before) fail("allocates");
  }
  /// A refusal names its reason.
  void explained(const char* field, const char* rule) {
    if (*field == '\0' || *rule == '\0') fail("a refusal without field or rule");
  }
  /// The bytes of the object as they are now.
  void remember();
  [[nodiscard]] bool changed() const;
  /// What must not change anything where it is refused; after `remember`.
  void answered(bool accepted);
  /// A step of an observer. @param y_fine true where none was given
  void stepped(esokit::StepStatus status, bool y_fine, bool u_fine);

  /// The way back: until `back` says so, good samples.
  void set_out(double close, int decades_of_scalar);
  bool back(esokit::StepStatus status, double off);

  Episode& episode_;
  const std::vector<Action>& actions_;
  Promise promise_{};
  Tape* tape_ = nullptr;
  Failure failure_{};
  bool calm_ = true;
  bool accepted_ = false;
  // The object and a copy of it.
  const void* object_at_ = nullptr;
  const void* twin_at_ = nullptr;
  std::size_t size_ = 0;

 private:
  void say(std::string text);
  [[nodiscard]] bool recoverable() const;

  std::vector<unsigned char> before_{};
  double close_ = 0;
  long most_ = 0, good_samples_ = 0;
  int in_a_row_ = 0;
};

/// Lists an action.
void add_action(std::vector<Action>& actions, const char* name, void (*act)());

}  // namespace fuzz
