// Macros of other people's headers, defined before ours, do no harm. (Before the standard library
// and Eigen they do: that is theirs to say.) Each is no C++ here: used once in any of our headers,
// it is an error, in a template that nobody instantiates, too.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cctype>
#include <charconv>
#include <cmath>
#include <complex>
#include <concepts>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <istream>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <ostream>
#include <random>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>
#include <version>
#if __has_include(<format>)
#include <format>
#endif

#include "all_headers.hpp"       // every header of esokit, likewise
#include "macros_of_others.hpp"  // of macros_of_others.txt, written by CMake

int main() { return 0; }
