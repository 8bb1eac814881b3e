// The worker's way in.
#include <cstdlib>
#include <exception>
#include <string>
#include <typeinfo>

#include "log.hpp"
#include "play.hpp"

#define EXPORTED(name) extern "C" __attribute__((export_name(#name)))
#define IMPORTED(name) extern "C" __attribute__((import_module("page"), import_name(#name)))

IMPORTED(refuse) void page_refuse(const char* why);
IMPORTED(progress) void page_progress(const char* what, double share);

// The library for WebAssembly has no exceptions. What is thrown is an error for the reader, and the
// end: the worker is not used again.
extern "C" void* __cxa_allocate_exception(std::size_t size) noexcept { return std::malloc(size); }
extern "C" [[noreturn]] void __cxa_throw(void* thrown, std::type_info*, void (*)(void*)) {
  page_refuse(static_cast<const std::exception*>(thrown)->what());
  std::abort();
}

namespace {
std::string bytes, arguments;
playground::LogResult result;
playground::Settings settings{};
std::array<std::string, 2> c_code;
}  // namespace

// Room for what the page writes.
EXPORTED(file) char* file(int size) {
  bytes.resize(static_cast<std::size_t>(size));
  return bytes.data();
}
EXPORTED(arguments) char* arguments_here(int size) {
  arguments.resize(static_cast<std::size_t>(size));
  return arguments.data();
}
EXPORTED(study) int study() {
  result = playground::study_log(arguments, bytes, page_progress);
  return result.status;
}
EXPORTED(header) const char* header() { return result.header.c_str(); }
EXPORTED(main_text) const char* main_text() { return result.main.c_str(); }
EXPORTED(code) const char* code() { return result.code.c_str(); }
EXPORTED(address) const char* address() { return result.address.c_str(); }
EXPORTED(taken) const char* taken() { return result.taken.c_str(); }
EXPORTED(design) const char* design() { return result.design.c_str(); }
EXPORTED(figures) int figures() { return static_cast<int>(result.figures.size()); }
EXPORTED(description) const char* description(int i) {
  return result.figures[static_cast<std::size_t>(i)].description.c_str();
}
EXPORTED(points) const char* points(int i) {
  return result.figures[static_cast<std::size_t>(i)].numbers.c_str();
}

// Of the simulation.
EXPORTED(settings) double* settings_here() { return settings.data(); }
EXPORTED(c_header) const char* c_header() {
  c_code = playground::c_of(settings);
  return c_code[0].c_str();
}
EXPORTED(c_source) const char* c_source() { return c_code[1].c_str(); }
