// Prints pasted.hpp, on the host: designs as words.

#include <cstdio>
#include <esokit/core/snapshot_text.hpp>

#include "designs.hpp"
#include "drive_design.hpp"

int main() {
  const auto observer = firmware::FrozenFilter::Observer::make(firmware::FrozenFilter::config());
  const auto controller = drive::Controller::make(drive::config());
  if (!observer || !controller) return 1;
  std::printf(
      "/// @file\n"
      "/// Printed by print_pasted.cpp; `run.sh --paste` writes it anew.\n"
      "#pragma once\n\n"
      "#include <array>\n"
      "#include <cstdint>\n\n"
      "namespace firmware {\n\n"
      "/// FrozenFilter of designs.hpp.\n"
      "%s\n"
      "}  // namespace firmware\n\n"
      "namespace drive {\n\n"
      "/// The controller of drive_design.hpp.\n"
      "%s\n"
      "}  // namespace drive\n",
      esokit::snapshot_text("frozen_filter", esokit::snapshot(*observer)).c_str(),
      esokit::snapshot_text("words", esokit::snapshot(*controller)).c_str());
}
