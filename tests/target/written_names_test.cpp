// Names and comments that a user gives to a written text: any of them is written, and compiles, or
// is refused by name. The words are typed from IEC 61131-3 (both editions), C99, C11 and C++20.
#include <target/written.hpp>

#include <cctype>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/health_code.hpp>
#include <esokit/target/profile_code.hpp>
#include <esokit/target/structured_text.hpp>
#include <esokit/target/time_proportioned_code.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace esokit_test {
namespace target_written_names_test {

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}
const std::vector<std::string> structured_text_words = words_of(
    // 2nd edition, Annex C: keywords.
    "ACTION END_ACTION ARRAY OF AT CASE ELSE END_CASE CONFIGURATION END_CONFIGURATION CONSTANT EN "
    "ENO "
    "EXIT FALSE F_EDGE FOR TO BY DO END_FOR FUNCTION END_FUNCTION FUNCTION_BLOCK "
    "END_FUNCTION_BLOCK IF "
    "THEN ELSIF END_IF INITIAL_STEP END_STEP NOT MOD AND XOR OR PROGRAM WITH END_PROGRAM R_EDGE "
    "READ_ONLY READ_WRITE REPEAT UNTIL END_REPEAT RESOURCE ON END_RESOURCE RETAIN NON_RETAIN "
    "RETURN "
    "STEP STRUCT END_STRUCT TASK TRANSITION FROM END_TRANSITION TRUE TYPE END_TYPE VAR END_VAR "
    "VAR_INPUT VAR_OUTPUT VAR_IN_OUT VAR_TEMP VAR_EXTERNAL VAR_ACCESS VAR_CONFIG VAR_GLOBAL WHILE "
    "END_WHILE "
    // 3rd edition.
    "ABSTRACT CLASS END_CLASS CONTINUE EXTENDS FINAL IMPLEMENTS INTERFACE END_INTERFACE INTERNAL "
    "METHOD "
    "END_METHOD NAMESPACE END_NAMESPACE NULL OVERLAP OVERRIDE PRIVATE PROTECTED PUBLIC REF REF_TO "
    "SUPER "
    "THIS USING INTERVAL PRIORITY SINGLE "
    // Types.
    "BOOL SINT INT DINT LINT USINT UINT UDINT ULINT REAL LREAL TIME LTIME DATE LDATE TIME_OF_DAY "
    "TOD "
    "LTOD LTIME_OF_DAY DATE_AND_TIME DT LDT LDATE_AND_TIME STRING WSTRING CHAR WCHAR BYTE WORD "
    "DWORD "
    "LWORD ANY ANY_DERIVED ANY_ELEMENTARY ANY_MAGNITUDE ANY_NUM ANY_REAL ANY_INT ANY_BIT "
    "ANY_STRING "
    "ANY_DATE ANY_UNSIGNED ANY_SIGNED ANY_DURATION ANY_CHARS ANY_CHAR "
    // Standard functions.
    "ABS SQRT LN LOG EXP SIN COS TAN ASIN ACOS ATAN ATAN2 ADD MUL SUB DIV EXPT MOVE SHL SHR ROR "
    "ROL SEL "
    "MAX MIN LIMIT MUX GT GE EQ LE LT NE LEN LEFT RIGHT MID CONCAT INSERT DELETE REPLACE FIND "
    "TRUNC "
    "ADD_TIME ADD_TOD_TIME ADD_DT_TIME SUB_TIME SUB_DATE_DATE SUB_TOD_TIME SUB_TOD_TOD SUB_DT_TIME "
    "SUB_DT_DT MULTIME DIVTIME CONCAT_DATE_TOD CONCAT_DATE SPLIT_DATE SPLIT_TOD SPLIT_DT "
    "DAY_OF_WEEK "
    "IS_VALID IS_VALID_BCD UPPER_BOUND LOWER_BOUND TO_BIG_ENDIAN FROM_LITTLE_ENDIAN INT_TO_REAL "
    "REAL_TO_INT BOOL_TO_BYTE DINT_TO_STRING WORD_BCD_TO_UINT UINT_TO_BCD_WORD REAL_TRUNC_INT "
    "TRUNC_INT "
    "TO_INT TO_LREAL DATE_AND_TIME_TO_TIME_OF_DAY DT_TO_TOD LREAL_TO_REAL UDINT_TO_UINT "
    // Standard function blocks.
    "SR RS SEMA R_TRIG F_TRIG CTU CTD CTUD TP TON TOF RTC CTU_DINT CTD_LINT CTUD_UDINT CTU_ULINT "
    "TP_TIME TON_LTIME TOF_TIME SEMAPHORE "
    // Operators of lists.
    "LD LDN ST STN S R ANDN ORN XORN JMP JMPC JMPCN CAL CALC CALCN RET RETC RETCN");
const std::vector<std::string> c_words = words_of(
    // C99 and C11.
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline "
    "int long register restrict return short signed sizeof static struct switch typedef union "
    "unsigned "
    "void volatile while _Alignas _Alignof _Atomic _Bool _Complex _Generic _Imaginary _Noreturn "
    "_Static_assert _Thread_local "
    // C++20.
    "alignas alignof and and_eq asm atomic_cancel bitand bitor bool catch char8_t char16_t "
    "char32_t "
    "class compl concept consteval constexpr constinit const_cast co_await co_return co_yield "
    "decltype "
    "delete dynamic_cast explicit export false friend mutable namespace new noexcept not not_eq "
    "nullptr "
    "operator or or_eq private protected public reinterpret_cast requires static_assert "
    "static_cast "
    "template this thread_local throw true try typeid typename using virtual wchar_t xor xor_eq "
    // Of stdint.h, stdbool.h, stddef.h, math.h, stdio.h, string.h, and a main program.
    "int8_t int32_t uint8_t uint16_t uint32_t int64_t uint64_t size_t ptrdiff_t fabs fabsf sqrt "
    "sqrtf "
    "round roundf floor ceil exp expf log pow powf sin cos tan tanh isnan isinf isfinite signbit "
    "nan "
    "y0 y1 yn j0 j1 jn gamma lgamma hypot fmin fmax trunc lround cbrt ldexp frexp modf printf puts "
    "memcpy "
    "memset strlen main abs labs div exit free malloc atoi rand index link time_t tm clock "
    "errno_t");

using Plain = Adrc<LinearEso<1>>;
using Other = Adrc<Measured<OutlierGate<LinearEso<2>>>>;
Plain plain(double T = 1e-2) {
  return Plain::make({.observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = T},
                      .controller_bandwidth = 5,
                      .limits = {.lower = -3, .upper = 3}})
      .value();
}
const CodeOptions few{.self_test_samples = 1};
CodeOptions named(const std::string& name) {
  CodeOptions options = few;
  options.name = name;
  return options;
}
CodeOptions with_settings(const std::string& settings) {
  CodeOptions options = few;
  options.settings_in_struct = true;
  options.settings_name = settings;
  return options;
}
template <class T>
std::string answer(const T& made) {
  return made ? "written" : made.error().field + std::string(": ") + made.error().rule;
}
std::string in_small(std::string word) {
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

constexpr const char* word_of_st =
    "name: must be no word of Structured Text, without two _ or one at its end";

TEST(WrittenNames, WordsOfStructuredTextAreNoNames) {
  const auto object = plain();
  EXPECT_EQ(answer(to_structured_text(object, named("motor"))), "written");
  for (const std::string& word : structured_text_words) {
    if (word == "SEMA") continue;  // the 2nd edition's name of SEMAPHORE: no compiler has it
    const std::string small = in_small(word);
    if (detail::is_header_of_c(small)) {
      EXPECT_NE(answer(to_structured_text(object, named(small))), "written") << word;
      continue;
    }
    EXPECT_EQ(answer(to_structured_text(object, named(small))), word_of_st) << word;
    std::string mixed = small;
    mixed[0] = word[0];
    if (mixed.size() > 1) {
      EXPECT_EQ(answer(to_structured_text(object, named(mixed))), word_of_st);
    }
    EXPECT_NE(answer(to_structured_text(object, named(word))), "written") << word;
    // Behind another word it is one of many.
    EXPECT_EQ(answer(to_structured_text(object, named("my_" + small))), "written") << word;
  }
  // Variables of the block, and what the language does not allow.
  for (const char* word : {"y", "R", "u_held", "Done", "o", "starts", "mode", "flags", "e0"}) {
    EXPECT_NE(answer(to_structured_text(object, named(word))), "written") << word;
  }
  EXPECT_EQ(answer(to_structured_text(object, named("a__b"))), word_of_st);
  EXPECT_EQ(answer(to_structured_text(object, named("a_"))), word_of_st);
}

// No name that is in the text is a word: keywords are written in capitals, names are not.
TEST(WrittenNames, NoVariableIsAWordOfStructuredText) {
  std::vector<std::string> texts{to_structured_text(plain(), named("motor")).value()};
  const auto other = Other::make({.observer = {.observer = {.observer = {.observer_bandwidth = 20,
                                                                         .input_gain = 2,
                                                                         .sample_time = 1e-2},
                                                            .threshold = 1}},
                                  .controller_bandwidth = 5})
                         .value();
  texts.push_back(to_structured_text(other, named("motor")).value());
  texts.push_back(
      to_structured_text(
          PredictiveAdrc<LinearEso<2>>::make(
              {.observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = 1e-2},
               .controller_bandwidth = 5})
              .value(),
          named("motor"))
          .value());
  texts.push_back(
      to_structured_text(SmoothProfile<3>::make({.limits = {1, 1, 1}, .sample_time = 1e-2}).value(),
                         named("motor"))
          .value());
  texts.push_back(to_structured_text(ApproachProfile<2, 4>::make({.pole = 0.1,
                                                                  .lag = 1,
                                                                  .input_gain = 2,
                                                                  .limits = {-1, 1},
                                                                  .dead_time = 0.02,
                                                                  .bandwidth = 1,
                                                                  .sample_time = 1e-2})
                                         .value(),
                                     named("motor"))
                      .value());
  texts.push_back(
      to_structured_text(FollowProfile<2>::make({.limits = {1, 1}, .sample_time = 1e-2}).value(),
                         named("motor"))
          .value());
  texts.push_back(to_structured_text(
                      TimeProportioned<>::make({.on = 1, .window = 1, .sample_time = 1e-2}).value(),
                      named("motor"))
                      .value());
  for (const std::string& text : texts) {
    for (const std::string& word : detail::identifiers_in(text)) {
      const bool capitals = in_small(word) != word;
      if (!capitals) {
        EXPECT_FALSE(detail::is_word_of_structured_text(word)) << word;
      }
    }
  }
}

// Everything that the text has behind its name, of any kind.
TEST(WrittenNames, SettingsHaveANameOfTheirOwn) {
  std::set<std::string> ends;
  const auto collect = [&](const auto& code) {
    ASSERT_TRUE(code) << answer(code);
    const std::string all = code->header + code->source + code->settings;
    const std::regex own("\\bcontroller_(\\w+)");
    for (std::sregex_iterator at(all.begin(), all.end(), own), end; at != end; ++at) {
      ends.insert((*at)[1]);
    }
  };
  const auto object = plain();
  collect(to_c(object, with_settings("design")));
  ends.erase("design");
  EXPECT_GT(ends.size(), 8u);
  for (const std::string& word : ends) {
    const std::string rule =
        "settings_name: is one that the text has already behind `name`: take another one";
    EXPECT_EQ(answer(to_c(object, with_settings(word))), rule) << word;
    std::string capital = word;
    capital[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(capital[0])));
    EXPECT_EQ(answer(to_c(object, with_settings(capital))), "written") << word;
    CodeOptions unused = with_settings(word);
    unused.settings_in_struct = false;
    EXPECT_EQ(answer(to_c(object, unused)), "written") << word;
  }
  for (const char* word : {"settings", "Settings", "STATE", "update", "Adopt"}) {
    EXPECT_NE(answer(to_structured_text(object, with_settings(word))), "written") << word;
    EXPECT_NE(answer(to_structured_settings(object, with_settings(word))), "written") << word;
  }
  EXPECT_EQ(answer(to_structured_settings(object, with_settings("slow"))), "written");
}

#ifdef ESOKIT_LOADS_C

// A name that a function of the text begins with: `update`_measured is such a function.
TEST(WrittenNames, BeginNoFunctionOfTheText) {
  const auto object =
      Adrc<Measured<LinearEso<2>>>::make({.observer = {.observer = {.observer_bandwidth = 20,
                                                                    .input_gain = 2,
                                                                    .sample_time = 1e-2}},
                                          .controller_bandwidth = 5})
          .value();
  const Folder folder;
  const auto good = to_c(object, few).value();
  std::set<std::string> begins;
  for (const std::string& word : detail::identifiers_in(good.header + good.source)) {
    for (std::size_t at = word.find('_', 1); at != std::string::npos; at = word.find('_', at + 1)) {
      begins.insert(word.substr(0, at));
    }
  }
  int refused = 0;
  std::string files;
  for (const std::string& name : begins) {
    const auto made = to_c(object, named(name));
    if (!made) {
      ++refused;
      continue;
    }
    folder.write(name + ".h", made->header);
    folder.write(name + ".c", made->source);
    files += " " + folder.file(name + ".c");
  }
  EXPECT_GT(refused, 1);
  EXPECT_GT(begins.size(), 20u);
  EXPECT_TRUE(runs("gcc -std=c99 -fsyntax-only" + std::string(strict) + files));
}

// As names of designs and of settings, in C and C++: all of them begin or end longer ones.
TEST(WrittenNames, WordsOfCAreNamesThatCompile) {
  const Folder folder;
  std::string files, some;
  const auto object = plain();
  for (std::size_t i = 0; i < c_words.size(); ++i) {
    const std::string& word = c_words[i];
    if (detail::is_header_of_c(word)) continue;
    CodeOptions options = with_settings(c_words[(i + 1) % c_words.size()]);
    options.name = word;
    const auto made = to_c(object, options);
    ASSERT_TRUE(made) << word << answer(made);
    folder.write(word + ".h", made->header);
    folder.write(word + ".c", made->source);
    files += " " + folder.file(word + ".c");
    if (i % 8 == 0) some += " " + folder.file(word + ".c");
  }
  EXPECT_TRUE(runs("gcc -std=c99 -fsyntax-only -Wall -Wextra -Werror" + files));
  EXPECT_TRUE(runs("g++ -x c++ -std=c++11 -fsyntax-only -Wall -Wextra -Werror" + some));
  for (const char* header : {"math", "stdio", "Float", "string", "time"}) {
    EXPECT_EQ(answer(to_c(object, named(header))),
              "name: is that of a header of the C library: name.h would be taken for it");
  }
}

// Two designs whose names differ in capitals alone, in one file: no guard and no constant is
// common.
TEST(WrittenNames, DifferAlsoByCapitalsAlone) {
  const Folder folder;
  int designs = 0;
  std::string program;
  for (const char* name : {"loop", "Loop", "lOOP", "loop_a", "Loop_a"}) {
    const auto code = to_c(plain(1e-2 / ++designs), named(name)).value();
    folder.write(std::string(name) + ".h", code.header);
    folder.write(std::string(name) + ".c", code.source);
    program += "#include \"" + std::string(name) + ".h\"\n#include \"" + name + ".c\"\n";
  }
  folder.write("all.h", "");
  // All headers in one file, each with its own sample time.
  std::string headers;
  for (const char* name : {"loop", "Loop", "lOOP", "loop_a", "Loop_a"}) {
    headers += "#include \"" + std::string(name) + ".h\"\n";
  }
  headers +=
      "static loop_state a;\nstatic Loop_state b;\nstatic lOOP_state c;\nint main(void) {\n"
      "  loop_init(&a);\n  Loop_init(&b);\n  lOOP_init(&c);\n"
      "  return LOOP_SAMPLE_TIME > Loop_SAMPLE_TIME && Loop_SAMPLE_TIME > lOOP_SAMPLE_TIME ? 0 : "
      "1;\n}\n";
  folder.write("all.c", headers);
  const std::string out = folder.file("all");
  ASSERT_TRUE(runs("gcc -std=c99" + std::string(strict) + "-o " + out + " " + folder.file("all.c") +
                   " " + folder.file("loop.c") + " " + folder.file("Loop.c") + " " +
                   folder.file("lOOP.c") + " -lm"));
  EXPECT_TRUE(runs(out));
  EXPECT_EQ(answer(to_c(plain(), named("LOOP"))),
            "name: must have a small letter: in capitals it begins the constants of another name");
}

TEST(WrittenNames, NoCommentLeavesItsComment) {
  const auto object = plain();
  const std::string rule =
      "comment: must not begin or end a comment, nor a line of it with a backslash";
  const auto of = [&](const std::string& comment) {
    CodeOptions options = few;
    options.comment = comment;
    return to_c(object, options);
  };
  for (const std::string comment : {"a */ b", "/* b", "(* b", "b *)", "a *\\\n/ b", "a *\\ \n/ b",
                                    "a *\\\r\n/ b", "a *?\?/\n/ b", "a *?\?/ \t\n/ b",
                                    "ends with \\", "ends with ?\?/", "\\\n", "a *\\\n\\\n/"}) {
    EXPECT_EQ(answer(of(comment)), rule) << comment;
    CodeOptions options = few;
    options.comment = comment;
    EXPECT_EQ(answer(to_structured_text(object, options)), rule) << comment;
  }
  const Folder folder;
  std::string files;
  int count = 0;
  for (const std::string comment :
       {"a\\b", "C:\\motors\\left", "what?\?", "?\?/ is a trigraph", "100 % * / $name", "a\nb\n/ c",
        "ends with *", "* /", "\"quoted\" 'x", "// two", "a *\n/ b"}) {
    const auto made = of(comment);
    ASSERT_TRUE(made) << comment;
    const std::string name = "comment" + std::to_string(count++);
    folder.write("controller.h", made->header);
    folder.write(name + ".c", made->header + "\nint main(void) {\n  return 0;\n}\n");
    files += " " + folder.file(name + ".c");
  }
  EXPECT_TRUE(runs("gcc -std=c99 -fsyntax-only" + std::string(strict) + files));
  EXPECT_TRUE(runs("g++ -x c++ -std=c++11 -fsyntax-only" + std::string(strict) + files));
}

#endif  // ESOKIT_LOADS_C

TEST(WrittenNames, ThePlaceOfAWrongCharacterIsSaid) {
  const auto object = plain();
  for (const auto& [name, place] : std::vector<std::pair<std::string, int>>{
           {"", 1}, {"1a", 1}, {"a-b", 2}, {"ab c", 3}, {"motor\xc3\xa4", 6}, {"a.b", 2}}) {
    const auto made = to_c(object, named(name));
    EXPECT_EQ(answer(made),
              "name: must be an identifier of C: this is the place of its first wrong character");
    EXPECT_EQ(made.error().value, place) << name;
    const auto settings = to_c(object, with_settings(name));
    EXPECT_EQ(settings.error().field, std::string("settings_name"));
    EXPECT_EQ(settings.error().value, place) << name;
  }
}

}  // namespace target_written_names_test
}  // namespace esokit_test
