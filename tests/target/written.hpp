// The objects of the tests of written code, the C compiled and loaded, and both in the same loop.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <esokit/adapter/guarded.hpp>
#include <esokit/gain/riccati_settings.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#if __has_include(<dlfcn.h>) && __has_include(<unistd.h>)
#define ESOKIT_LOADS_C 1
#include <dlfcn.h>
#include <unistd.h>
#endif

#include <control/loop_traits.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
inline namespace written {

using namespace esokit;

template <class V>
bool equal_bits(V a, V b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// The config of an observer; that of an adapter has one inside.
template <class Observer>
auto observer_config(double input_gain) {
  using V = typename Observer::scalar_type;
  typename Observer::Config config{};
  if constexpr (requires { config.observer; }) {
    config.observer = observer_config<typename Observer::Adapted>(input_gain);
    if constexpr (requires { config.delay; }) config.delay = 3;
    if constexpr (requires { config.curve; }) {
      config.curve = decltype(config.curve)::dead_zone(V(0.5), V(0.25));
      config.curve.input[0] = V(-0.6);
      config.curve.slope_above = V(1.25);
    }
    if constexpr (requires { config.inputs; }) {
      config.inputs[0] = {V(-3), V(0.03), V(0.02)};
      if (config.inputs.size() > 1) config.inputs[1] = {V(2), V(0), V(0.011)};
      if (config.inputs.size() > 2) config.inputs[2] = {V(-1), V(0.05), V(0)};
      config.most_lost = 7;
    }
    if constexpr (requires { config.disturbance_bound; }) {
      config.disturbance_bound = V(1.5);
      config.leak_time = V(2);
    }
    if constexpr (requires { config.period; }) config.period = V(2.5);
    if constexpr (requires { config.threshold; }) {
      config.threshold = V(0.05);
      config.running_factor = V(6);
    }
  } else {
    config.sample_time = V(0.0078125);
    config.input_gain = V(input_gain);
    config.max_gap = 5;
    if constexpr (requires { config.bandwidth_factor; }) {
      config.observer_bandwidth = V(15);
      config.bandwidth_factor = V(1.5);
    } else if constexpr (requires { config.observer_bandwidth; }) {
      config.observer_bandwidth = Observer::order == 3 ? V(15) : V(30);
    } else if constexpr (requires { config.measurement_variance; }) {
      config.measurement_variance = V(1e-6);
      config.disturbance_bounds[Observer::size - 1] = V(0.5);
      config.inflation = V(0.02);
    } else {
      config.poles[0] = {-20, 5};
      config.poles[1] = {-20, -5};
      config.poles[2] = {-9, 0};
    }
    if constexpr (requires { config.bandwidth_ratio; }) config.bandwidth_ratio = V(0.75);
    if constexpr (requires { config.gain_min; }) config.gain_min = V(0.55);
    if constexpr (requires { config.frequency_shift; }) config.frequency_shift = V(20);
    if constexpr (requires { config.shape.exponent; }) {
      config.shape.exponent = V(0.5);
      config.shape.linear_width = V(0.05);
    } else if constexpr (requires { config.shape.gain_alpha; }) {
      config.shape.gain_alpha = V(0.6);
      config.shape.alpha = V(0.75);
      config.shape.gain_beta = V(0.25);
      config.shape.beta = V(0.5);
    }
    if constexpr (requires { config.model.plant.size(); }) {
      config.model.plant.fill(V(0.5));
    } else if constexpr (requires { config.model.plant; }) {
      config.model.plant =
          LinearPlant<2, V>::chain({.coefficients = {V(0.5), V(0.5)}, .input_gain = V(input_gain)})
              .value();
    }
    if constexpr (requires { config.model.actuator.time_constant; }) {
      config.model.actuator.time_constant = V(0.05);
    }
    if constexpr (requires { config.model.sensor.time_constant; }) {
      config.model.sensor.time_constant = V(0.03);
    }
    if constexpr (requires { config.model.resonators; }) {
      for (auto& resonance : config.model.resonators) resonance.frequency = V(25);
    }
    if constexpr (requires { config.model.first_order; }) config.model.first_order.fill(V(0.5));
  }
  return config;
}

/// Another mode of an ExtendedStateFilter.
template <class Config>
void set_filter(Config& filter, RiccatiMode mode, InflationRule rule, double threshold) {
  using V = decltype(filter.inflation);
  filter.mode = mode;
  filter.inflation_rule = rule;
  if (rule != InflationRule::fixed) filter.inflation = V(0);
  filter.outlier_threshold = V(threshold);
}
/// An AlgebraicEso that never settles, and publishes late.
template <class Config>
void slow_down(Config& schedule) {
  schedule.frequency_shift = {};
  schedule.blanking = decltype(schedule.frequency_shift)(0.25);
  schedule.start_index = 2;
}

template <class C>
auto config(double input_gain) {
  using V = typename C::scalar_type;
  if constexpr (requires(C c) { c.controller(); }) {
    using Controller = std::remove_cvref_t<decltype(std::declval<C>().controller())>;
    return typename C::Config{.controller = config<Controller>(input_gain),
                              .rest = {.error = V(1), .time = V(0.03)}};
  } else {
    typename C::Config config{};
    config.observer = observer_config<typename detail::ObserverOfController<C>::type>(input_gain);
    if constexpr (requires { config.controller_bandwidth; }) {
      config.controller_bandwidth = C::order == 3 ? V(1.5) : V(4);
    }
    config.limits = {V(-3), V(2.5), V(60)};
    config.start_hold = {.time = V(0.1), .input = V(0.5)};
    config.missing = {.most = 9, .input = V(-0.5)};
    return config;
  }
}

/// The settings of the controller in a Resting, or of itself.
template <class Config>
auto& of_controller(Config& config) {
  if constexpr (requires { config.controller; }) {
    return config.controller;
  } else {
    return config;
  }
}

inline constexpr ModelParts lag{.order = 1, .actuator = 1};
inline constexpr ModelParts everything{
    .order = 1, .plant_poles = true, .actuator = 1, .sensor = 1, .resonators = 1, .first_order = 1};
inline constexpr ModelParts sine{.order = 2, .resonators = 1};

#ifdef ESOKIT_LOADS_C

/// A folder of this process, removed at the end.
class Folder {
 public:
  Folder()
      : path_(std::filesystem::temp_directory_path() /
              ("esokit_c_code_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
  }

 private:
  std::filesystem::path path_;
};

inline bool runs(const std::string& command) { return std::system(command.c_str()) == 0; }
inline bool there(const std::string& program) {
  return runs("command -v " + program + " >/dev/null 2>&1");
}

inline constexpr const char* strict = " -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror ";

/// The rules of MISRA C:2012 of which cppcheck finds a violation, but for those that are allowed.
/// Its exit code leaves out what it finds of a whole program.
inline std::string misra_findings(const Folder& folder, const std::string& name,
                                  const std::vector<std::string>& allowed) {
  std::string command = "cppcheck --addon=misra --std=c99 -q --suppress=missingIncludeSystem ";
  for (const std::string& rule : allowed) command += "--suppress=misra-c2012-" + rule + " ";
  const std::string found = folder.file("misra.txt");
  EXPECT_TRUE(runs(command + folder.file(name + ".c") +
                   " 2>&1 | grep -o '\\[[a-zA-Z].*\\]' | sort -u >" + found));
  std::ifstream text(found);
  return {std::istreambuf_iterator<char>(text), {}};
}

/// Of C that is named `name`: by an old C++, Clang, small compilers, and that MISRA C:2012 finds
/// nothing in it but the deviations that the file names.
inline void compiles_elsewhere(const CCode& code, const std::string& name) {
  const Folder folder;
  folder.write(name + ".h", code.header);
  folder.write(name + ".c", code.source);
  folder.write(name + ".cpp", code.source);
  std::string upper = name;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  for (const std::string compiler :
       {"g++ -std=c++11", "clang -std=c99", "tcc", "gcc -std=c99 -Wdouble-promotion"}) {
    const std::string program = compiler.substr(0, compiler.find(' '));
    if (!there(program)) continue;
    EXPECT_TRUE(runs(compiler + (program == "tcc" ? " -Wall -Werror" : strict) + " -D" + upper +
                     "_SELF_TEST -c -o " + folder.file("other.o") + " " +
                     folder.file(name + (program == "g++" ? ".cpp" : ".c"))))
        << compiler;
  }
  if (there("cppcheck")) {
    EXPECT_EQ(misra_findings(folder, name, {"2.5", "15.5", "21.15"}), "");
  }
}

/// Would a test notice? ESOKIT_MUTANT='o->gap > 1u@@o->gap > 2u' changes the text once, if it has
/// it.
inline std::string mutant(std::string text) {
  const char* given = std::getenv("ESOKIT_MUTANT");
  if (given == nullptr) return text;
  const std::string change = given;
  const std::size_t middle = change.find("@@");
  const std::size_t at = text.find(change.substr(0, middle));
  if (at != std::string::npos) text.replace(at, middle, change.substr(middle + 2));
  return text;
}

/// Compiled and loaded C, with what a test adds to it.
class Library {
 public:
  Library(const Folder& folder, const CCode& code, const std::string& more,
          const std::string& compiler = "gcc -std=c99") {
    folder.write("loop.h", code.header);
    folder.write("loop.c", mutant(code.source));
    folder.write("probe.c", "#include \"loop.h\"\n" + more);
    const std::string out = folder.file("loop" + std::to_string(count++) + ".so");
    if (!runs(compiler + " -O2 -shared -fPIC -DLOOP_SELF_TEST" + std::string(strict) + "-o " + out +
              " " + folder.file("loop.c") + " " + folder.file("probe.c") + " -lm")) {
      return;
    }
    handle_ = dlopen(out.c_str(), RTLD_NOW | RTLD_LOCAL);
  }
  ~Library() {
    if (handle_ != nullptr) dlclose(handle_);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  [[nodiscard]] bool loaded() const { return handle_ != nullptr; }
  [[nodiscard]] bool has(const char* name) const {
    return loaded() && dlsym(handle_, name) != nullptr;
  }
  template <class F>
  void find(F& function, const char* name) const {
    ASSERT_TRUE(has(name)) << name;
    if constexpr (std::is_same_v<F, const void*>) {
      function = dlsym(handle_, name);
    } else {
      function = reinterpret_cast<F>(dlsym(handle_, name));
    }
  }

 private:
  static inline int count = 0;
  void* handle_ = nullptr;
};

/// What gcov says of loop.c in per cent: lines, and branches that were taken. @param given to the
/// self-test @param least_lines, least_branches what it has to reach
inline void reaches(const CCode& code, const std::string& given = "0.0f", double least_lines = 95,
                    double least_branches = 85) {
  const Folder folder;
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("main.c",
               "#include \"loop.h\"\nint main(void) { return loop_self_test(" + given + "); }\n");
  ASSERT_TRUE(runs("cd " + folder.file("") +
                   " && gcc -std=c99 -O0 --coverage -DLOOP_SELF_TEST main.c loop.c -o all -lm && "
                   "./all && gcov -b all-loop.gcda >found.txt 2>&1"));
  std::ifstream text(folder.file("found.txt"));
  double lines = 0;
  double branches = 0;
  bool is_it = false;
  for (std::string line; std::getline(text, line);) {
    if (line.rfind("File ", 0) == 0) is_it = line == "File 'loop.c'";
    if (!is_it) continue;
    std::sscanf(line.c_str(), "Lines executed:%lf", &lines);
    std::sscanf(line.c_str(), "Taken at least once:%lf", &branches);
  }
  EXPECT_GE(lines, least_lines);
  EXPECT_GE(branches, least_branches);
}

struct Change {
  const char *from, *to;
};

/// That the self-test passes, and no longer after any of the changes. @param given to it
template <class... Given>
void notices(const CCode& code, const std::vector<Change>& changes, Given... given) {
  std::vector<Change> all{{"", ""}};
  all.insert(all.end(), changes.begin(), changes.end());
  for (const auto& [from, to] : all) {
    SCOPED_TRACE(from);
    CCode changed = code;
    const std::size_t at = changed.source.find(from);
    ASSERT_NE(at, std::string::npos);
    changed.source.replace(at, std::string(from).size(), to);
    const Folder folder;
    const Library library(folder, changed, "", "gcc -std=c99 -Wno-error");
    int (*self_test)(Given...) = nullptr;
    library.find(self_test, "loop_self_test");
    ASSERT_NE(self_test, nullptr);
    EXPECT_EQ(self_test(given...) == 0, from[0] == '\0');
  }
}

/// The compiled C of a controller or an observer.
template <class V>
class InC {
 public:
  InC(const Folder& folder, const CCode& code, bool is_controller,
      const std::string& compiler = "gcc -std=c99")
      : library_(folder, code,
                 std::string("unsigned loop_size(void);\n"
                             "unsigned loop_size(void) { return sizeof(loop_state); }\n"
                             "unsigned loop_probe(const loop_state *o);\n"
                             "unsigned loop_probe(const loop_state *o) { return ") +
                     (is_controller ? "o->status + 512u * o->mode + " : "") +
                     "65536u * o->gap; }\n" +
                     (code.header.find("loop_saved;") == std::string::npos
                          ? ""
                          : "unsigned loop_saved_size(void);\n"
                            "unsigned loop_saved_size(void) { return sizeof(loop_saved); }\n"),
                 compiler) {
    if (!loaded()) return;
    const auto find = [this](auto& function, const char* name) { library_.find(function, name); };
    find(init_, "loop_init");
    find(update_, "loop_update");
    find(estimate_, "loop_estimate");
    find(probe_, "loop_probe");
    find(self_test_, "loop_self_test");
    if (is_controller) {
      find(start_, "loop_start");
      find(miss_, "loop_update_without_measurement");
      find(applied_, "loop_applied");
    } else {
      find(observe_, "loop_update");
      find(predict_, "loop_predict");
      find(correct_, "loop_correct");
      find(reset_, "loop_reset");
    }
    if (library_.has("loop_measured")) {
      find(measured_, "loop_measured");
      find(all_measured_, "loop_measured");
    }
    if (library_.has("loop_set_trust")) {
      find(trust_, "loop_set_trust");
      find(pin_, "loop_set_pin");
      find(hold_, "loop_hold");
      find(hold_observer_, "loop_hold");
      find(hold_with_, "loop_hold");
      if (library_.has("loop_release")) find(release_, "loop_release");
      if (library_.has("loop_set_input_gain")) find(gain_, "loop_set_input_gain");
    }
    unsigned (*bytes)() = nullptr;
    if (library_.has("loop_save")) {
      find(save_, "loop_save");
      find(load_, "loop_load");
      find(bytes, "loop_saved_size");
      saved_size_ = bytes();
    }
    find(bytes, "loop_size");
    state_.resize(bytes() / sizeof(std::uint64_t) + 1);
    init_(state_.data());
  }

  [[nodiscard]] bool loaded() const { return library_.loaded(); }
  V update(V y, V r) { return update_(state_.data(), y, r); }
  V miss(V r) { return miss_(state_.data(), r); }
  void measured(V w) { measured_(state_.data(), w); }
  void measured(const V* all) { all_measured_(state_.data(), all); }
  void set_pin(Pin where) { pin_(state_.data(), static_cast<std::uint8_t>(where)); }
  V hold(V y, V u) { return hold_(state_.data(), y, u); }
  V hold(V y, V r, V u) { return hold_with_(state_.data(), y, r, u); }
  V hold() { return hold_observer_(state_.data()); }
  void release() { release_(state_.data()); }
  bool takes_gain() const { return gain_ != nullptr; }
  bool set_input_gain(V b) { return gain_(state_.data(), b); }
  unsigned set_trust(V trust) { return trust_(state_.data(), trust); }
  unsigned applied(V u) { return applied_(state_.data(), u); }
  unsigned start(V y, V u) { return start_(state_.data(), y, u); }
  unsigned observe(V y, V u) { return observe_(state_.data(), y, u); }
  unsigned predict(V u) { return predict_(state_.data(), u); }
  unsigned correct(V y) { return correct_(state_.data(), y); }
  unsigned reset(V y) { return reset_(state_.data(), y); }
  V estimate(unsigned row) { return estimate_(state_.data(), row); }
  /// status + 512 mode + 65536 gap
  unsigned probe() { return probe_(state_.data()); }
  int self_test(V tolerance) { return self_test_(tolerance); }
  [[nodiscard]] std::vector<std::uint64_t> save() const {
    std::vector<std::uint64_t> saved(saved_size_ / sizeof(std::uint64_t) + 1);
    save_(state_.data(), saved.data());
    return saved;
  }
  bool load(const std::vector<std::uint64_t>& saved, std::uint32_t samples, V u) {
    return load_(state_.data(), saved.data(), samples, u);
  }
  /// Its bytes: a copy of them may be put back.
  std::vector<std::uint64_t>& state() { return state_; }

 private:
  Library library_;
  std::vector<std::uint64_t> state_;
  void (*init_)(void*) = nullptr;
  unsigned (*start_)(void*, V, V) = nullptr;
  V (*update_)(void*, V, V) = nullptr;
  V (*miss_)(void*, V) = nullptr;
  unsigned (*applied_)(void*, V) = nullptr;
  unsigned (*trust_)(void*, V) = nullptr;
  void (*pin_)(void*, std::uint8_t) = nullptr;
  V (*hold_)(void*, V, V) = nullptr;
  V (*hold_with_)(void*, V, V, V) = nullptr;
  V (*hold_observer_)(void*) = nullptr;
  void (*release_)(void*) = nullptr;
  bool (*gain_)(void*, V) = nullptr;
  void (*measured_)(void*, V) = nullptr;
  void (*all_measured_)(void*, const V*) = nullptr;
  unsigned (*observe_)(void*, V, V) = nullptr;
  unsigned (*predict_)(void*, V) = nullptr;
  unsigned (*correct_)(void*, V) = nullptr;
  unsigned (*reset_)(void*, V) = nullptr;
  V (*estimate_)(void*, unsigned) = nullptr;
  unsigned (*probe_)(const void*) = nullptr;
  int (*self_test_)(V) = nullptr;
  void (*save_)(const void*, void*) = nullptr;
  bool (*load_)(void*, const void*, std::uint32_t, V) = nullptr;
  unsigned saved_size_ = 0;
};

/// What the environment asks for instead of what a test does: ESOKIT_WRITTEN_SAMPLES of each kind,
/// ESOKIT_WRITTEN_SEED added to each seed.
inline std::uint64_t asked(const char* name, std::uint64_t usual) {
  const char* given = std::getenv(name);
  return given == nullptr ? usual : std::strtoull(given, nullptr, 10);
}

struct Seen {
  int odd = 0, limited = 0, safe = 0, bad_references = 0, rests = 0;
  int of_status[64] = {};
};

template <class Observer, class V>
void compare_estimates(const Observer& observer, InC<V>& in_c, int k) {
  detail::unroll<Observer::size>([&](auto row) {
    EXPECT_TRUE(equal_bits(V(observer.template estimate<row>()), in_c.estimate(row)))
        << "sample " << k << ", estimate " << row;
  });
}

/// How many disturbances are measured.
template <class Object>
constexpr int measured_inputs() {
  if constexpr (requires { Object::inputs; }) {
    return Object::inputs;
  } else if constexpr (requires { typename Object::Adapted; }) {
    return measured_inputs<typename Object::Adapted>();
  } else if constexpr (requires { typename detail::ObserverOfController<Object>::type; }) {
    return measured_inputs<typename detail::ObserverOfController<Object>::type>();
  } else {
    return 0;
  }
}

/// Tells several, each lost by itself.
template <int Count, class Object, class V>
void tell_several(Object& object, InC<V>& in_c, Random& random, int k) {
  if (k % 100 > 85) return;
  Vector<V, Count> w{};
  for (int i = 0; i < Count; ++i) {
    w(i) = static_cast<V>(std::sin(0.02 * k + i) + 0.1 * random.uniform(-1, 1));
    const bool lost = k / 200 % 5 == i || random.index(40) == 0;
    if (lost) w(i) = random.index(9) > 0 ? hidden_nan<V>() : anything<V>(random);
  }
  object.measured(w);
  in_c.measured(&w(0));
}

/// Tells both a measured w, if the object takes one: mostly a good one, none for a while, bad ones.
template <class Object, class V>
void tell_measured(Object& object, InC<V>& in_c, Random& random, int k) {
  constexpr int count = measured_inputs<Object>();
  if constexpr (count == 1) {
    if (random.index(40) == 0 || k % 100 > 85) return;
    V w = static_cast<V>(std::sin(0.02 * k) + 0.1 * random.uniform(-1, 1));
    if (random.index(50) == 0) w = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
    object.measured(w);
    in_c.measured(w);
  } else if constexpr (count > 1) {
    tell_several<count>(object, in_c, random, k);
  }
}

/// Pin and b0 of both, now and then. @param gain b0 @param guarded the observer
template <class Object, class Guard, class V>
void tell_guard(Object& object, Guard& guarded, InC<V>& in_c, Random& random, double gain) {
  if (random.index(60) == 0) {
    const Pin where = random.index(2) == 0 ? Pin::free : static_cast<Pin>(random.index(4));
    guarded.set_pin(where);
    in_c.set_pin(where);
  }
  if (in_c.takes_gain() && random.index(150) == 0) {
    const V b = random.index(5) == 0 ? anything<V>(random)
                                     : static_cast<V>(gain * random.uniform(0.7, 1.5));
    EXPECT_EQ(static_cast<bool>(object.set_input_gain(b)), in_c.set_input_gain(b)) << b;
  }
}

template <class C>
inline constexpr bool is_compensator = false;
template <class Observer>
inline constexpr bool is_compensator<DisturbanceCompensator<Observer>> = true;

/// Both in the same loop, so many samples. @return what was met
template <class C>
Seen compare(const C& fresh, InC<typename C::scalar_type>& in_c, double input_gain, int samples,
             std::uint64_t seed) {
  using V = typename C::scalar_type;
  C controller = fresh;
  ChainPlant plant(C::order, 0.0078125, input_gain, 1.5);
  Random random(seed);
  Seen seen;
  V r(1);
  int lost = 0;
  int held = 0;
  int bad_for = 0;  // samples with such references
  double u = 0;
  for (int k = 0; k < samples; ++k) {
    plant.set_disturbance(2 * std::sin(0.01 * k));
    plant.step(u);
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
    if (k % 5000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if constexpr (
        observer_traits<std::remove_cvref_t<decltype(controller.observer())>>.wraps_output) {
      y = std::remainder(y, V(2.5));
    }
    constexpr int runs[] = {1, 2, 4, 6, 8, 12, 30};
    if (lost > 0) --lost;
    if (random.index(200) == 0) lost = runs[random.index(7)];
    if (lost > 0 || random.index(300) == 0) y = hidden_nan<V>();
    if (random.index(150) == 0) y = anything<V>(random);
    if constexpr (requires { controller.observer().set_trust(y); }) {
      if (random.index(50) == 0) {
        const V trust = random.index(9) == 0   ? anything<V>(random)
                        : random.index(2) == 0 ? V(1)
                                               : static_cast<V>(random.uniform(-0.2, 1.2));
        EXPECT_EQ(static_cast<unsigned>(controller.observer().set_trust(trust)),
                  in_c.set_trust(trust));
      }
      tell_guard(controller, controller.observer(), in_c, random, input_gain);
      if (random.index(100) == 0) held = random.index(6);
    }
    tell_measured(controller, in_c, random, k);
    V given = r;
    if constexpr (is_compensator<C>) given = (r - y) / static_cast<V>(input_gain);
    if (bad_for > 0 || random.index(400) == 0) given = anything<V>(random);
    if (bad_for > 0) --bad_for;
    if (random.index(1000) == 0) bad_for = random.index(30);
    if (held > 0) {
      --held;
      const V under = random.index(10) == 0 ? anything<V>(random) : static_cast<V>(0.9 * u);
      V mine{};
      V its{};
      if constexpr (requires { controller.hold(y, given, under); }) {
        mine = controller.hold(y, given, under);
        its = detail::ObserverOfController<C>::error_based ? in_c.hold(y, given, under)
                                                           : in_c.hold(y, under);
      } else if constexpr (requires { controller.hold(y, under); }) {
        mine = controller.hold(y, under);
        its = in_c.hold(y, under);
      }
      EXPECT_TRUE(equal_bits(mine, its)) << "sample " << k << ", held";
    } else if (random.index(30) == 0) {
      const V told = random.index(10) == 0 ? anything<V>(random) : static_cast<V>(0.9 * u);
      for (int i = random.index(3); i >= 0; --i) {  // again and again, also after a start or a hold
        const V then = i > 0 ? static_cast<V>(random.uniform(-3, 3)) : told;
        EXPECT_EQ(static_cast<unsigned>(controller.applied(then)), in_c.applied(then)) << k;
      }
      const V mine = controller.update(y, given);
      EXPECT_TRUE(equal_bits(mine, in_c.update(y, given))) << "sample " << k << ", reported";
    } else if (random.index(100) == 0) {
      controller.update_without_measurement(given);
      in_c.miss(given);
    } else if (random.index(2000) == 0) {
      const V at = random.index(4) == 0 ? anything<V>(random) : static_cast<V>(plant.output());
      const V under = random.index(4) == 0 ? anything<V>(random) : static_cast<V>(u);
      EXPECT_EQ(static_cast<unsigned>(controller.start(at, under)), in_c.start(at, under)) << k;
      if (random.index(2) == 0) {
        const V moved = random.index(4) == 0 ? under : static_cast<V>(random.uniform(-3, 3));
        EXPECT_EQ(static_cast<unsigned>(controller.applied(moved)), in_c.applied(moved)) << k;
      }
      const V mine = controller.update(y, given);
      EXPECT_TRUE(equal_bits(mine, in_c.update(y, given))) << "sample " << k << ", started";
    } else {
      const V mine = controller.update(y, given);
      const V its = in_c.update(y, given);
      EXPECT_TRUE(equal_bits(mine, its)) << "sample " << k << ": " << mine << ", C " << its;
    }
    u = static_cast<double>(controller.output());
    const unsigned told = in_c.probe();
    const auto status = static_cast<unsigned>(controller.status());
    EXPECT_EQ(told % 512, status) << "sample " << k;
    EXPECT_EQ(told / 512 % 128, static_cast<unsigned>(controller.mode())) << "sample " << k;
    EXPECT_EQ(told / 65536, static_cast<unsigned>(controller.observer().missed()))
        << "sample " << k;
    compare_estimates(controller.observer(), in_c, k);
    seen.odd += status != 0;
    seen.limited += !equal_bits(controller.output(), controller.requested());
    seen.safe += controller.mode() == LoopMode::safe;
    seen.rests += controller.mode() == LoopMode::rest;
    seen.bad_references += has(controller.status(), StepStatus::reference_rejected);
    ++seen.of_status[status % 64];
    if (testing::Test::HasFailure()) return seen;
  }
  return seen;
}

/// @param change of the settings
template <class C, class Change>
void equals_changed(int samples, std::uint64_t seed, const std::string& compiler,
                    const Change& change) {
  samples = static_cast<int>(asked("ESOKIT_WRITTEN_SAMPLES", static_cast<std::uint64_t>(samples)));
  seed += asked("ESOKIT_WRITTEN_SEED", 0);
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  const Folder folder;
  for (const double input_gain : {8.0, -8.0}) {
    auto settings = config<C>(input_gain);
    change(settings);
    const int divider = of_controller(settings).measurement_divider;
    const C controller = C::make(settings).value();
    const CCode code = to_c(controller, {.name = "loop", .comment = "a test"}).value();
    InC<V> in_c(folder, code, true, compiler);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    const Seen seen = compare(controller, in_c, input_gain, samples, seed++);
    EXPECT_GT(seen.odd, samples / 100);
    EXPECT_GT(seen.limited, samples / 10);
    EXPECT_GT(seen.bad_references, samples / 4000);
    if constexpr (detail::IsResting<C>::value) {
      EXPECT_GT(seen.rests, samples / 300);
    }
    // Of fewer measurements more have to be lost.
    EXPECT_GT(seen.safe, samples / (500 * divider));
    for (const StepStatus status :
         {StepStatus::measurement_rejected, StepStatus::gap_bridged, StepStatus::restarted}) {
      EXPECT_GT(seen.of_status[static_cast<int>(status)], samples / 2000);
    }
  }
}

template <class C>
void equals_controller(int samples, std::uint64_t seed,
                       const std::string& compiler = "gcc -std=c99", int divider = 1) {
  equals_changed<C>(samples, seed, compiler, [divider](auto& settings) {
    of_controller(settings).measurement_divider = divider;
  });
}

template <class Observer>
void equals(int samples, std::uint64_t seed, const std::string& compiler = "gcc -std=c99") {
  equals_controller<Adrc<Observer>>(samples, seed, compiler);
}

/// An observer alone, with its halves, resets and gaps.
template <class Observer>
void observes(int samples, std::uint64_t seed) {
  samples = static_cast<int>(asked("ESOKIT_WRITTEN_SAMPLES", static_cast<std::uint64_t>(samples)));
  seed += asked("ESOKIT_WRITTEN_SEED", 0);
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  const Folder folder;
  for (const double input_gain : {8.0, -8.0}) {
    auto observer = Observer::make(observer_config<Observer>(input_gain)).value();
    const CCode code = to_c(observer, {.name = "loop"}).value();
    InC<V> in_c(folder, code, false);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    Random random(seed++);
    const auto signal = [&] {
      return random.index(20) == 0 ? anything<V>(random) : static_cast<V>(random.uniform(-1, 1));
    };
    int odd = 0;
    for (int k = 0; k < samples && !testing::Test::HasFailure(); ++k) {
      const V y = signal();
      const V u = signal();
      tell_measured(observer, in_c, random, k);
      if constexpr (requires { observer.set_pin(Pin::free); }) {
        tell_guard(observer, observer, in_c, random, input_gain);
        if (random.index(50) == 0) {
          EXPECT_TRUE(equal_bits(observer.hold(u), in_c.hold())) << "sample " << k;
        }
        if (random.index(20) == 0) {
          observer.release();
          in_c.release();
        }
      }
      const int what = random.index(1000);
      unsigned mine = 0;
      unsigned its = 0;
      if (what < 930) {
        mine = static_cast<unsigned>(observer.update(y, u));
        its = in_c.observe(y, u);
      } else if (what < 970) {
        for (int i = random.index(10); i >= 0; --i) {
          mine = static_cast<unsigned>(observer.predict(u));
          its = in_c.predict(u);
        }
      } else if (what < 995) {
        mine = static_cast<unsigned>(observer.correct(y));
        its = in_c.correct(y);
      } else {
        mine = static_cast<unsigned>(observer.reset(y));
        its = in_c.reset(y);
      }
      EXPECT_EQ(mine, its) << "sample " << k << ", call " << what;
      EXPECT_EQ(in_c.probe() / 65536, static_cast<unsigned>(observer.missed())) << "sample " << k;
      compare_estimates(observer, in_c, k);
      odd += mine != 0;
    }
    EXPECT_GT(odd, samples / 20);
  }
}

/// The config of the observer in a controller's, inside its adapters.
template <class Config>
auto& innermost(Config& config) {
  if constexpr (requires { config.observer; }) {
    return innermost(config.observer);
  } else {
    return config;
  }
}

/// The C of a controller, elsewhere, see above. @param change of the settings
template <class C, class Change>
void compiles_changed(const Change& change) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  auto settings = config<C>(8);
  change(settings);
  compiles_elsewhere(to_c(C::make(settings).value(), {.name = "loop"}).value(), "loop");
}
template <class C>
void compiles() {
  compiles_changed<C>([](auto&) {});
}

/// Bad numbers are refused whatever the compiler assumes of them. @param silent whether nothing
/// else is in the status
template <class C>
void refuses_under_fast_math(bool silent = false) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  const Folder folder;
  InC<V> in_c(folder, to_c(C::make(config<C>(8)).value(), {.name = "loop"}).value(), true,
              "gcc -std=gnu99 -ffast-math -Wno-error");
  ASSERT_TRUE(in_c.loaded());
  const unsigned seen = silent ? 255 : 1;
  EXPECT_TRUE(!silent || in_c.self_test(V(1e-3)) == 0);
  for (const V bad : {hidden_nan<V>(), hidden_infinity<V>(), -hidden_infinity<V>()}) {
    for (int k = 0; k < 20; ++k) EXPECT_TRUE(is_finite(in_c.update(V(0.1), V(0.2))));
    EXPECT_EQ(in_c.probe() & seen, 0u);
    EXPECT_TRUE(is_finite(in_c.update(bad, V(0.2))));
    EXPECT_EQ(in_c.probe() & seen, 1u) << "measurement_rejected";
    EXPECT_TRUE(is_finite(in_c.update(V(0.1), bad)));
    in_c.applied(bad);
    EXPECT_TRUE(is_finite(in_c.update(V(0.1), V(0.2))));
    EXPECT_NE(in_c.start(bad, V(0)), 0u);
    EXPECT_NE(in_c.start(V(0), bad), 0u);
    for (unsigned row = 0; row < detail::ObserverOfController<C>::type::size; ++row) {
      EXPECT_TRUE(is_finite(in_c.estimate(row)));
    }
  }
}

/// Other settings while it runs, as by `adopt`. @param is_slow whether there is a limit of rate
/// @param bandwidth of the observer, at first and after a change; 0: that of the others, then 20
template <class C>
void adopts(std::uint64_t seed, bool is_slow, double bandwidth = 0) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  auto all = config<C>(8);
  auto& settings = of_controller(all);
  const V rate = is_slow ? V(60) : esokit::Limits<V>{}.rate;
  settings.limits.rate = rate;
  if (bandwidth > 0) {
    innermost(settings).observer_bandwidth = V(bandwidth);
    innermost(settings).max_gap = 20;
  }
  const C first = C::make(all).value();
  innermost(settings).observer_bandwidth = bandwidth > 0 ? V(0.7 * bandwidth) : V(20);
  if constexpr (requires { settings.controller_bandwidth; }) settings.controller_bandwidth = V(3);
  settings.limits = {V(-1), V(1.5), rate};
  if constexpr (detail::IsResting<C>::value) {
    all.rest = {};
    if (!is_slow) all.rest = {.error = V(0.5), .time = V(0.05)};
  }
  const C second = C::make(all).value();
  settings.missing.most = 3;  // not one of the settings
  const C third = C::make(all).value();
  CodeOptions options{.name = "loop", .comment = "a test", .settings_in_struct = true};
  CCode code = to_c(first, options).value();
  options.comment = "another";
  options.settings_name = "slow";
  const auto slow = to_c(second, options).value();
  options.settings_name = "other";
  const auto other = to_c(third, options).value();
  const Folder folder;
  const Library library(folder, code,
                        slow.settings + other.settings +
                            "unsigned loop_size(void);\n"
                            "unsigned loop_size(void) { return sizeof(loop_state); }\n");
  ASSERT_TRUE(library.loaded());
  void (*init)(void*) = nullptr;
  V (*update)(void*, V, V) = nullptr;
  V (*estimate)(const void*, unsigned) = nullptr;
  bool (*adopt)(void*, const void*) = nullptr;
  unsigned (*applied)(void*, V) = nullptr;
  int (*self_test)(V) = nullptr;
  unsigned (*size)() = nullptr;
  const void* sets[3] = {};
  library.find(init, "loop_init");
  library.find(update, "loop_update");
  library.find(estimate, "loop_estimate");
  library.find(adopt, "loop_adopt");
  library.find(applied, "loop_applied");
  library.find(self_test, "loop_self_test");
  library.find(size, "loop_size");
  library.find(sets[0], "loop_design");
  library.find(sets[1], "loop_slow");
  library.find(sets[2], "loop_other");
  EXPECT_EQ(self_test(V(0)), 0);
  std::vector<std::uint64_t> state(size() / sizeof(std::uint64_t) + 1);
  init(state.data());
  C mine = first;
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed);
  V r(1);
  int limited = 0;
  int rests = 0;
  int lost = 0;
  for (int k = 0; k < 30000 && !testing::Test::HasFailure(); ++k) {
    plant.step(static_cast<double>(mine.output()));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if (detail::IsResting<C>::value && k % 200 < 100) y = r + V(0.25);
    if (random.index(20) == 0) y = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
    if (random.index(10) == 0) {
      const V told = random.index(2) == 0 ? static_cast<V>(random.uniform(-5, 5)) : mine.output();
      EXPECT_EQ(applied(state.data(), told), 0u);
      (void)mine.applied(told);
    }
    if (lost > 0 && lost-- > 0) y = hidden_nan<V>();
    if (bandwidth > 0 && random.index(30) == 0) lost = random.index(15);
    const int set = random.index(100);
    if (set < 2) {
      EXPECT_TRUE(mine.adopt(set == 0 ? first : second));
      EXPECT_TRUE(adopt(state.data(), sets[set]));
    }
    if (set == 2) {
      EXPECT_FALSE(adopt(state.data(), sets[2]));
    }
    V given = r;
    if constexpr (is_compensator<C>) given = (r - y) / V(8);
    if (random.index(20) == 0 || set < 2) given = hidden_nan<V>();
    const V u = mine.update(y, given);
    EXPECT_TRUE(equal_bits(u, update(state.data(), y, given))) << "sample " << k;
    detail::unroll<std::remove_cvref_t<decltype(mine.observer())>::size>([&](auto row) {
      EXPECT_TRUE(equal_bits(V(mine.observer().template estimate<row>()),
                             estimate(state.data(), unsigned{row})))
          << "sample " << k << ", estimate " << row;
    });
    limited += !equal_bits(mine.output(), mine.requested());
    rests += mine.mode() == LoopMode::rest;
  }
  EXPECT_GT(limited, 3000);
  EXPECT_TRUE(!detail::IsResting<C>::value || rests > 600) << rests;
}

#endif  // ESOKIT_LOADS_C

}  // namespace written
}  // namespace esokit_test
