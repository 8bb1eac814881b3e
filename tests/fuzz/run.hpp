/// @file
/// One episode of any type: a random config, random calls, and what must hold after each of them;
/// and at last good samples, that have to bring it back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fuzz/tape.hpp"

namespace fuzz {

struct Call {
  int action = 0;
  Tape tape{};
};

/// All that there is to know of a case; `run` plays it.
struct Episode {
  Tape config{};
  std::vector<Call> calls{};
  bool recover = true;
  // What came of it.
  bool made = false;
  int played = 0;                   ///< calls
  long recovery = 0;                ///< good samples that were needed
  std::vector<std::string> text{};  ///< of a played case: config and calls

  /// While a case is drawn: gives the calls.
  Random* random = nullptr;
  Mix mix{};       ///< of the config
  Mix call_mix{};  ///< of the calls
  int length = 0;
  /// To see where a case ends that ends the program.
  bool loud = false;
};

/// What does not hold; empty: all does.
using Failure = std::optional<std::string>;

/// A type under test.
struct Kind {
  std::string name;
  std::function<Failure(Episode&)> run;
  /// Where the number of cases is given, this plays one of so many: an analysis takes as long as
  /// a hundred calls.
  std::uint64_t one_of = 1;
};

/// Lists a type.
void add_kind(std::vector<Kind>& kinds, const char* name, Failure (*run)(Episode&));

/// Of this program: operator new so far.
long allocations();

/// The bytes of an object; out of line, so that no compiler makes up its padding.
std::vector<unsigned char> memory_of(const void* object, std::size_t size);

}  // namespace fuzz
