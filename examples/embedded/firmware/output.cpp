#include "output.hpp"

#include <bit>

#include "board.hpp"

namespace firmware {

Line::Line(const char* word) { add(word); }

Line::~Line() {
  text_[used_] = '\n';
  text_[used_ + 1] = '\0';
  board::write(text_);
}

Line& Line::word(const char* word) {
  add(' ');
  add(word);
  return *this;
}

Line& Line::number(std::uint32_t value) {
  char digits[10];
  int count = 0;
  do {
    digits[count++] = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  add(' ');
  while (count > 0) add(digits[--count]);
  return *this;
}

Line& Line::bits(float value) {
  const auto word = std::bit_cast<std::uint32_t>(value);
  add(' ');
  for (int shift = 28; shift >= 0; shift -= 4) add("0123456789abcdef"[(word >> shift) & 15u]);
  return *this;
}

void Line::add(char c) {
  if (used_ + 2 < static_cast<int>(sizeof text_)) text_[used_++] = c;
}

void Line::add(const char* word) {
  while (*word != '\0') add(*word++);
}

}  // namespace firmware
