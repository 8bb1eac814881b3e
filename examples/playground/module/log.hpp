// What a log gives: the parts of from_log, as its own command line has it.
// Built twice, as play.hpp.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "common/figure.hpp"

namespace playground {

struct LogResult {
  int status = 0;      // exit code of from_log
  std::string header;  // HTML, as on the page of from_log
  std::string main;    // figures are <div class="drawn">, in the order of `figures`
  std::vector<esokit::examples::FigureText> figures;
  std::string code;     // C++ to paste; empty: no design
  std::string address;  // of the machine and the design in the playground; empty: no design
  std::string taken;    // what is taken there, in a sentence
};

// arguments: those of from_log, by zero bytes; throws LogError
LogResult study_log(std::string_view arguments, std::string_view bytes,
                    const std::function<void(const char*, double)>& progress);

}  // namespace playground
