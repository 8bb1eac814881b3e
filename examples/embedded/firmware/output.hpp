/// @file
/// Words, counts and the bits of floats as text. No printf: it brings the heap, and doubles.
#pragma once

#include <cstdint>

namespace firmware {

/// One line, put together and then sent at once.
class Line {
 public:
  explicit Line(const char* word);
  ~Line();
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  Line& word(const char* word);
  Line& number(std::uint32_t value);
  /// The 32 bits, in hexadecimal: nothing is rounded on the way.
  Line& bits(float value);

 private:
  void add(char c);
  void add(const char* word);

  char text_[120];
  int used_ = 0;
};

}  // namespace firmware
