/// @file
/// RecordedDesign: a finished controller or observer as lists and counts, without its type.
#pragma once

#include <array>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <vector>

namespace esokit {

/// How a text of another language is to be written.
struct CodeOptions {
  ByName<CodeOptions> by_name{};    ///< nothing to set, see ByName
  std::string name = "controller";  ///< begins every name and the files: an identifier of C with a
                                    ///< small letter, none of a header of C (`math`); in Structured
                                    ///< Text none of its words. Its capitals begin the constants,
                                    ///< of a name with capitals itself
  std::string comment{};            ///< at the head: which machine, which design; no marks of a
                                    ///< comment, no backslash at the end of a line
  int self_test_samples = 100;      ///< samples of the self-test, 1 .. 10000
  bool watched = false;  ///< keeps what a HealthMonitor looks at: innovation, and u that was asked

  /// `update` takes r, r', .., r^(n) instead of r alone, for a reference that moves, such as what
  /// `name_motion` of a SmoothProfile gives. Of Adrc (not the error-based form) and PredictiveAdrc,
  /// not in fixed point.
  bool moving_reference = false;

  /// `name_save` and `name_load` for a state that is kept over a restart, with a CRC and the hash
  /// of the design; in C, not for PredictiveAdrc.
  bool saves_state = false;

  /// Gains, those of the law, and limits in a struct that can be changed while it runs, instead of
  /// constants: in C, for gains that do not depend on the innovation or the time.
  bool settings_in_struct = false;
  std::string settings_name = "design";  ///< of that struct, behind `name`: an identifier
                                         ///< that is not there yet, as `name_update` is
};

namespace detail {

/// The rules of a loop: plain numbers.
struct LoopRules {
  unsigned hold_left = 0;
  unsigned missing_limit = 0;
  int divider = 1;
  bool holds_safe = false;
  bool stays_safe = false;
  double hold_input = 0;
  double safe_input = 0;
  bool elsewhere = false;  ///< the last u was commanded by something else
  double kept = 0;         ///< the last u, if the actuator holds another, too
  unsigned hold = 0;       ///< samples of the hold that a reset begins
};

/// An OutlierGate: its settings, and what it has seen.
struct GateNumbers {
  double threshold = 0;  ///< 0: there is no gate
  double running_factor = 0;
  double mean = 0;
  unsigned most_in_a_row = 0;
  unsigned count = 0;
  bool open = true;
};

/// A gain law that goes on at each sample, around lists of its own: the schedule of AlgebraicEso or
/// the recursion of ExtendedStateFilter.
enum class RunningLaw : unsigned char { none, schedule, filter };

/// What such a law counts.
struct LawNumbers {
  RunningLaw kind = RunningLaw::none;
  unsigned start = 0;      ///< of a schedule: its first sample,
  unsigned least_age = 0;  ///< the samples before it may settle, and as long estimates are blanked,
  unsigned age = 0;        ///< the samples so far,
  bool pending = false;    ///< whether the last one was not corrected,
  bool settled = false;    ///< whether it stands, for ever if no sample is missing,
  double decay = 0;        ///< p,
  double shift = 0;        ///< 1 - p
  double contraction = 0;  ///< and that of the poles in the end
  unsigned since = 0;      ///< of a filter: what happened since the last step,
  bool returns = false;    ///< whether the recursion ends at a limit,
  bool watches = false;    ///< whether it refuses outliers
};

/// Its count of turns.
struct TurnNumbers {
  double y = 0;
  double turns = 0;
  double motion = 0;
  unsigned samples = 0;
  unsigned gaps = 0;
  unsigned doubts = 0;
  bool begun = false;
};

/// A WrappedOutput.
struct WrapNumbers {
  double period = 0;  ///< 0: there is none
  double inverse_period = 0;
  double most_turns = 0;  ///< more cannot be distinguished
  TurnNumbers count{};
  bool gated = false;  ///< around a gate: the rest counts over all measurements
  TurnNumbers seen{};
  unsigned seen_at = 0;
  unsigned seen_steady = 0;
  unsigned seen_rejected = 0;
  std::string angle{};  ///< the estimate that the law subtracts from the reference
};

/// A Guarded: its bound, in the scaling of the states, and its leak.
struct GuardNumbers {
  bool on = false;
  int levels = 1;
  double bound = 0;  ///< 0: there is none
  double leak = 0;
  double trust = 1;
  double bound_as_given = 0;  ///< of `by_input`
  bool by_input = false;      ///< unit of u: the bound follows b0
  double gain = 1;            ///< b0 of the observer
  double inverse_gain = 1;
  double gain_ratio = 1;  ///< see Guarded, as what follows
  double given_ratio = 1;
  double input_factor = 1;
  double weight_up = 1;
  double weight_down = 1;
  unsigned release_samples = 0;
  unsigned release_left = 0;
  unsigned settling_samples = 0;
  unsigned settling_left = 0;
  unsigned pin = 0;
  unsigned side = 0;  ///< 1: upper, 2: lower
  bool held = false;
  bool unsettled = false;
  bool gated = false;
  bool frozen = false;
};

/// One of the disturbances of a Measured.
struct MeasuredPathNumbers {
  double gain = 0;
  std::array<double, 2> share{};  ///< of a sample in which the older and the newer w arrive,
  std::array<double, 2> late{};   ///< and what the lag does in these
  std::array<double, 2> reached{};
  std::vector<double> memory{};  ///< the newest last
  double lagged = 0;
  double last = 0;
  unsigned lost = 0;
};

/// A Measured.
struct MeasuredNumbers {
  bool on = false;
  unsigned most_lost = 0;
  double told = 0;
  std::vector<MeasuredPathNumbers> paths{};
};

/// A KnownModel.
struct KnownNumbers {
  bool on = false;
  bool around_angle = false;  ///< a WrappedOutput is inside
};

/// The curve of a MappedInput, with at least a point.
struct MapNumbers {
  std::vector<double> inputs{};
  std::vector<double> effects{};
  std::vector<std::array<double, 3>> lines{};  ///< offset, slope and inverse, one more
};

/// A Resting, and what it has seen.
struct RestNumbers {
  bool on = false;  ///< with these settings or others it may rest
  double error = 0;
  unsigned samples = 0;
  double reference = 0;
  unsigned inside = 0;
  bool rests = false;
};

/// A finished design as lists and counts, without its type.
struct RecordedDesign {
  CodeOptions options{};
  bool single = false;         ///< float
  bool is_controller = false;  ///< else an observer
  std::vector<NamedCall> names{};
  std::vector<RecordedCall> calls{};   ///< one for each name
  std::vector<std::string> members{};  ///< a name for each number of the object
  std::vector<bool> live{};            ///< whether its state needs it
  std::vector<bool> settings{};        ///< whether it is a setting, see CodeOptions; or empty
  std::vector<double> numbers{};       ///< what it is at first
  int size = 0;                        ///< N: rows of the estimate
  int order = 0;                       ///< the row of the disturbance
  std::string first_state{};           ///< the predicted measurement
  double sample_time = 0;
  double input_gain = 0;
  std::vector<double> law_gains{};               ///< k_0, .. of a controller's own law
  std::vector<std::vector<double>> gap_gains{};  ///< all gains after 1, 2, .. samples
  bool gain_is_kept = true;    ///< without a gap they are the first row, else computed by the list
  std::vector<double> line{};  ///< of DelayedInput: the inputs, the newest last
  GateNumbers gate{};
  LawNumbers law{};
  WrapNumbers wrap{};
  GuardNumbers guard{};
  MeasuredNumbers measured{};
  KnownNumbers known{};
  MapNumbers map{};
  int max_gap = 0;                        ///< missing samples that are bridged by each correction
  std::vector<std::uint16_t> recovery{};  ///< of a row of gap_gains: 1 + what is due after it
  bool recovers = false;                  ///< whether with some setting something may be due
  LoopRules loop{};
  RestNumbers rest{};
  double lower = 0;
  double upper = 0;
  double rate = 0;     ///< largest change of u in a sample; 0: any
  bool waits = false;  ///< whether it may be too small for the digits of u
  bool error_based = false;
  bool softens = false;
  bool compensates = false;                    ///< r is the output of another controller
  bool predictive = false;                     ///< in two phases
  std::vector<std::vector<double>> samples{};  ///< y, r or u, and the result
  /// What of it is called, see self_test.hpp, and the status then.
  std::vector<std::array<unsigned, 2>> test_calls{};

  /// The mode in which it begins.
  [[nodiscard]] unsigned mode() const { return rest.rests ? 3 : loop.hold_left > 0 ? 1 : 0; }
  /// The call of a name, or null.
  [[nodiscard]] const RecordedCall* called(const std::string& name) const {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i].name == name) return &calls[i];
    }
    return nullptr;
  }
  /// Which numbers are states.
  [[nodiscard]] std::vector<std::size_t> states() const {
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < members.size(); ++i) {
      if (members[i][0] == 'z') all.push_back(i);
    }
    return all;
  }
  /// How many numbers the reference is.
  [[nodiscard]] int references() const { return options.moving_reference ? order + 1 : 1; }
  /// Their names: `r`, r1, ..
  [[nodiscard]] std::vector<std::string> references(const std::string& r) const {
    std::vector<std::string> all{r};
    for (int i = 1; i < references(); ++i) all.push_back(r + std::to_string(i));
    return all;
  }
};

}  // namespace detail
}  // namespace esokit
