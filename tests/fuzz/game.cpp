#include "fuzz/game.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace fuzz {

using esokit::has;
using esokit::StepStatus;

Failure Game::play() {
  Tape& tape = episode_.config;
  if (episode_.random != nullptr)
    tape.record(*episode_.random, episode_.mix);
  else
    tape.play();
  fill();
  calm_ = tape.plain();
  if (episode_.random == nullptr) say("make(" + tape.text() + ")");
  episode_.made = make();
  if (!episode_.made) return failure_;
  invariants();
  if (failure_) return "after make: " + *failure_;

  for (int k = 0;; ++k) {
    Call* call = nullptr;
    if (episode_.random != nullptr) {
      if (k == episode_.length) break;
      call = &episode_.calls.emplace_back();
      call->action = episode_.random->index(static_cast<int>(actions_.size()));
      call->tape.record(*episode_.random, episode_.call_mix);
    } else {
      if (k == static_cast<int>(episode_.calls.size())) break;
      call = &episode_.calls[static_cast<std::size_t>(k)];
      call->tape.play();
    }
    const Action& action = actions_[static_cast<std::size_t>(call->action)];
    tape_ = &call->tape;
    copy();
    const auto twin = memory_of(twin_at_, size_);

    act(action);
    calm_ = calm_ && tape_->plain();
    ++episode_.played;
    if (episode_.random == nullptr) say(std::string(action.name) + "(" + tape_->text() + ")");
    if (!failure_) invariants();
    if (memory_of(twin_at_, size_) != twin) fail("a copy changed with the original");
    if (failure_) return std::string(action.name) + ": " + *failure_;
  }
  if (episode_.recover && recoverable()) recover();
  return failure_;
}

void Game::say(std::string text) {
  if (episode_.loud) std::fprintf(stderr, "  %s\n", text.c_str());
  episode_.text.push_back(std::move(text));
}

void Game::fail(const char* text) {
  if (!failure_) failure_ = text;
}
void Game::fail(const char* of, const char* text) {
  if (!failure_) failure_ = std::string(of) + ": " + text;
}

void Game::remember() { before_ = memory_of(object_at_, size_); }
bool Game::changed() const { return memory_of(object_at_, size_) != before_; }

void Game::answered(bool accepted) {
  if (!accepted && changed()) fail("refused, but something changed");
  accepted_ = accepted;
}

void Game::stepped(StepStatus status, bool y_fine, bool u_fine) {
  if (!y_fine && !has(status, StepStatus::measurement_rejected)) fail("a bad y is not reported");
  if (!u_fine && !has(status, StepStatus::input_rejected)) fail("a bad u is not reported");
  if (calm_ && promise_.certain && tape_->plain()) {
    for (const StepStatus flag : {StepStatus::measurement_rejected, StepStatus::input_rejected,
                                  StepStatus::prediction_dropped, StepStatus::state_rejected}) {
      if (has(status, flag)) fail("good numbers are reported as bad");
    }
  }
}

bool Game::recoverable() const {
  if (!promise_.certain || !far_from_ringing()) return false;
  // Settings out of range promise nothing but to stay finite.
  if (!episode_.config.plain()) return false;
  for (const Call& call : episode_.calls) {
    const auto* name = actions_[static_cast<std::size_t>(call.action)].name;
    if (std::strcmp(name, "retune") == 0 && !call.tape.plain()) return false;
    if (std::strcmp(name, "set_step_time") == 0 && !call.tape.plain()) return false;
    // A variance of the measurement's noise is a setting.
    if (std::strstr(name, "weighted") != nullptr && !call.tape.plain()) return false;
  }
  return true;
}

/// The stated number of samples: an estimate of the largest finite size falls as k^(N-1) rho^k; a
/// gap and a hold may come before. Several times that, for laws that vary.
void Game::set_out(double close, int decades_of_scalar) {
  close_ = close;
  const double decades = std::log(10.0) * (decades_of_scalar + 20);
  most_ = static_cast<long>(500 + promise_.waiting + 12 * decades / promise_.slowest);
  good_samples_ = 0;
  in_a_row_ = 0;
}

bool Game::back(StepStatus status, double off) {
  if (failure_) {
    failure_ = "on the way back: " + *failure_;
    return true;
  }
  in_a_row_ = status == StepStatus::ok && off < close_ ? in_a_row_ + 1 : 0;
  if (in_a_row_ == 8) {
    episode_.recovery = good_samples_;
    return true;
  }
  if (++good_samples_ < most_) return false;
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "%ld good samples do not bring it back: off by %g", most_,
                off);
  fail(text.data());
  return true;
}

void add_action(std::vector<Action>& actions, const char* name, void (*act)()) {
  actions.push_back({name, act});
}

}  // namespace fuzz
