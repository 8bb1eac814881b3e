// expect: esokit needs C\+\+20: compile with -std=c\+\+20
// language: c++17
#include <esokit/esokit.hpp>

int run() { return esokit::LinearEso<2>::order; }
