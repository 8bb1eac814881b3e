#include "system.hpp"

#include <csignal>
#include <cstdio>
#include <random>
#include <system_error>

#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#include <sys/stat.h>
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>
#else
#include <fcntl.h>
#include <unistd.h>
#endif

namespace esokit::examples {

std::filesystem::path path_of(const std::string& text) {
  return std::filesystem::path(std::u8string(text.begin(), text.end()));
}

bool create_new(const std::string& file) {
  // Not by fopen's "x", which the older C library of Windows ignores.
#ifdef _WIN32
  const int made = _open(file.c_str(), _O_CREAT | _O_EXCL | _O_WRONLY, _S_IREAD | _S_IWRITE);
  if (made >= 0) _close(made);
#else
  const int made = open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY, 0666);
  if (made >= 0) close(made);
#endif
  return made >= 0;
}

std::string new_scratch_folder() {
  std::error_code problem;
  const auto folder = std::filesystem::temp_directory_path(problem);
  if (problem) return {};
  std::random_device random;
  for (int attempt = 0; attempt < 100; ++attempt) {
    const auto path = folder / ("esokit." + std::to_string(random()));
    // False for a folder that is there.
    if (std::filesystem::create_directory(path, problem)) return path.string();
  }
  return {};
}

std::filesystem::path this_program() {
#ifdef _WIN32
  wchar_t text[4096];
  const auto count = GetModuleFileNameW(nullptr, text, 4096);
  return std::filesystem::path(text, text + (count < 4096 ? count : 0));
#else
  std::error_code none;
  return std::filesystem::read_symlink("/proc/self/exe", none);
#endif
}

bool run_python(const std::filesystem::path& script, const std::string& input) {
  std::fflush(nullptr);
#ifdef _WIN32
  std::FILE* pipe = _wpopen((L"python \"" + script.wstring() + L"\"").c_str(), L"wb");
  const auto end = _pclose;
#else
  std::signal(SIGPIPE, SIG_IGN);  // where there is no Python: pclose says so
  std::FILE* pipe = popen(("python3 '" + script.string() + "'").c_str(), "w");
  const auto end = pclose;
#endif
  if (pipe == nullptr) return false;
  std::fwrite(input.data(), 1, input.size(), pipe);
  return end(pipe) == 0;
}

void print_utf8() {
#ifdef _WIN32
  SetConsoleOutputCP(CP_UTF8);
#endif
}

}  // namespace esokit::examples
