// Prints pasted.hpp, on the host: designs of designs.hpp as words.

#include <cstdio>
#include <esokit/core/snapshot_text.hpp>

#include "designs.hpp"

int main() {
  const auto observer = firmware::FrozenFilter::Observer::make(firmware::FrozenFilter::config());
  if (!observer) return 1;
  std::printf(
      "/// @file\n"
      "/// Printed by print_pasted.cpp; `run.sh --paste` writes it anew.\n"
      "#pragma once\n\n"
      "#include <array>\n"
      "#include <cstdint>\n\n"
      "namespace firmware {\n\n"
      "/// FrozenFilter of designs.hpp.\n"
      "%s\n"
      "}  // namespace firmware\n",
      esokit::snapshot_text("frozen_filter", esokit::snapshot(*observer)).c_str());
}
