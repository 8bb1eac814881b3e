// The page's way in: numbers and texts by address, as WebAssembly has no other.
#include "play.hpp"

#define EXPORTED(name) extern "C" __attribute__((export_name(#name)))

namespace {
playground::Settings settings = playground::standard_settings();
playground::Result result;
std::string text;
}  // namespace

EXPORTED(fields) const char* fields() {
  text = playground::fields_json();
  return text.c_str();
}
EXPORTED(settings) double* settings_here() { return settings.data(); }
EXPORTED(play) int play(int whole) {
  result = playground::play(settings, whole != 0);
  return result.refusal.empty();
}
EXPORTED(refusal) const char* refusal() { return result.refusal.c_str(); }
EXPORTED(pid_note) const char* pid_note() { return result.pid_note.c_str(); }
EXPORTED(code) const char* code() { return result.code.c_str(); }
EXPORTED(signal_length) int signal_length(int i) {
  return static_cast<int>(result.signals[static_cast<std::size_t>(i)].size());
}
EXPORTED(signal) const double* signal(int i) {
  return result.signals[static_cast<std::size_t>(i)].data();
}
EXPORTED(numbers) const double* numbers(int which) {
  return result.numbers[static_cast<std::size_t>(which)].data();
}
EXPORTED(curve_length) int curve_length(int i) {
  return static_cast<int>(result.curves[static_cast<std::size_t>(i)].size());
}
EXPORTED(curve) const double* curve(int i) {
  return result.curves[static_cast<std::size_t>(i)].data();
}
