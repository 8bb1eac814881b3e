/// @file
/// Running gnuplot as a child process.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

namespace esokit::examples::detail {

/// Between single quotes nothing but the quote itself is special to gnuplot.
[[nodiscard]] inline std::string gnuplot_quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') quoted += '\'';
    quoted += c == '\n' ? ' ' : c;
  }
  return quoted + '\'';
}

[[nodiscard]] inline std::string shell_quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + '\'';
}

/// Runs the script in its folder; returns what went wrong, with gnuplot's own words.
[[nodiscard]] inline std::optional<std::string> run_gnuplot(const std::filesystem::path& script) {
  // -d: without the user's own start-up file, which could change every figure.
  const std::string command = "cd -- " + shell_quoted(script.parent_path().string()) +
                              " && exec gnuplot -d " + shell_quoted(script.filename().string()) +
                              " 2>&1";
  std::fflush(nullptr);
  std::FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return "cannot start a shell for gnuplot";
  std::string words;
  std::array<char, 512> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) {
    words += buffer.data();
  }
  const int status = pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return std::nullopt;
  while (!words.empty() && words.back() == '\n') words.pop_back();
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127) {
    return "cannot run gnuplot (Debian package gnuplot-nox): " + words;
  }
  return "gnuplot failed on " + script.string() + ": " + words;
}

}  // namespace esokit::examples::detail
