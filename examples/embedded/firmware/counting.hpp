/// @file
/// Instructions of a call, counted by the emulator: with `-icount shift=10` each instruction takes
/// 1024 ns of the emulated clock, neither more nor less, so the counter tells them exactly. What an
/// instruction costs on real hardware is another question.
#pragma once

#include "board.hpp"
#include "updates.hpp"

namespace firmware {

class InstructionCounter {
 public:
  InstructionCounter() {
    empty_ = elapsed(update_nothing, nullptr, 0.0f, 0.0f);
    known_ = elapsed(update_known, nullptr, 0.0f, 0.0f) - empty_;
  }

  /// Instructions of `update(observer, y, u)`, its return included.
  std::uint32_t count(Update* update, void* observer, float y, float u) const {
    return to_instructions(elapsed(update, observer, y, u) - empty_) + empty_instructions;
  }

 private:
  static constexpr std::uint32_t empty_instructions = 2;  // sets the result, returns

  static constexpr std::uint32_t known_instructions = 1025;

  [[nodiscard]] std::uint32_t to_instructions(std::uint32_t time) const {
    // In steps of the known time, so that 32 bits will do.
    const std::uint32_t whole = time / known_;
    const std::uint32_t rest = time % known_;
    return whole * known_instructions + (rest * known_instructions + known_ / 2) / known_;
  }

  // Never inlined: the same instructions around every call.
  [[gnu::noinline]] static std::uint32_t elapsed(Update* update, void* observer, float y, float u) {
    const std::uint32_t before = board::counter();
    update(observer, y, u);
    const std::uint32_t time = board::counter() - before;
    return board::counter_modulus == 0 ? time : time % board::counter_modulus;
  }

  std::uint32_t known_ = 0;
  std::uint32_t empty_ = 0;
};

}  // namespace firmware
