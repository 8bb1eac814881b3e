// What the playground computes: a machine, a controller, their loop, all by the headers of esokit.
// Built twice from these lines: as WebAssembly for the page, and native to compare the page with.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace playground {

// How a field is drawn and entered.
enum class Kind { number, number_or_none, choice, on_off, hidden };

struct Field {
  const char* name;     // in the page's address
  const char* label;    // for a reader
  const char* unit;     // empty: none
  const char* group;    // Machine, Controller, Run, What happens
  Kind kind;            // number_or_none: 0 or within the range; both are drawn on a logarithm.
                        // hidden: comes with a log, in the address alone
  double low, high;     // range of the slider; a typed number may leave it
  double standard;      // at the start
  const char* choices;  // of a choice, by semicolons, the first is 0
  const char* hint;     // what it means, a sentence
};

enum Index {
  order,
  gain,
  damping,
  lag,
  dead_time,
  resonance,
  resonance_damping,
  friction,
  dead_zone,
  down_gain,
  load,
  noise,
  quantum,
  observer,
  controller_bandwidth,
  observer_bandwidth,
  gain_factor,
  knows_dead_time,
  knows_curve,
  limit,
  down,  // the least u is so many times -limit
  rate,
  reference,
  sample_time,
  samples,
  lose,
  not_a_number,
  saturate,
  twice_the_noise,
  half_gain,
  pid,
  poles,             // four, real and imaginary part, over the observer bandwidth
  law = poles + 8,   // k_0 .. k_3 over powers of the controller bandwidth; k_0 = 0: all poles there
  soften = law + 4,  // 0: as the library has it, 1: no, 2: yes
  field_count
};

const std::array<Field, field_count>& fields();
std::string fields_json();

using Settings = std::array<double, field_count>;
Settings standard_settings();

// One signal a row: of the ADRC, then what the PID gets and gives.
enum Signal {
  time,
  wanted,
  output,
  measurement,
  input,
  disturbance,
  estimate,
  pid_output,
  pid_input,
  signal_count
};
enum Number {
  stable,
  gain_increase,
  gain_decrease,
  phase,
  modulus,
  delay,
  crossover,
  noise_in_input,
  overshoot,
  settling,
  load_peak,
  load_area,
  largest_input,
  at_limit,
  refused,
  number_count
};
enum Curve {
  frequency,
  loop_gain,
  loop_phase,
  sensitivity,
  noise_gain,
  pid_loop_gain,
  pid_loop_phase,
  pid_sensitivity,
  pid_noise_gain,
  curve_count
};
inline constexpr int bode_points = 160;

struct Result {
  std::string refusal;   // why nothing was computed: field, value and rule
  std::string pid_note;  // why there is no PID, or what it is
  std::array<std::vector<double>, signal_count> signals;
  std::array<std::array<double, number_count>, 2> numbers{};  // ADRC, PID
  std::array<std::vector<double>, curve_count> curves;
  std::string code;  // C++ of it
};

// The controller as C99, header and source; empty where to_c cannot write it yet. Of the other
// module, which is there only when it is asked for.
std::array<std::string, 2> c_of(const Settings& settings);

// whole: with the delay margin, which takes longer than all the rest.
Result play(const Settings& settings, bool whole = true);

// "order=1&gain=3": what is not named is standard. False: a name or number that it does not know.
bool read_settings(const std::string& address, Settings& settings);

}  // namespace playground
