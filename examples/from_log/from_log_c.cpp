// from_log, and beside its page the controller and the profile of its reference as C99 and as
// Structured Text, in float: drive.h, drive.c, drive.st, drive_profile.h, .. A program of its own,
// as its fifteen types of controllers take as long to compile as all of from_log.
//
//   from_log_c drive.csv --y angle --u torque --limits -5,5

#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <variant>

#include <esokit/core/error_text.hpp>
#include <esokit/target/profile_code.hpp>
#include <esokit/tune/tuned_code.hpp>

#include "from_log/parts/command.hpp"

namespace {

/// An identifier from the name of a file.
std::string identifier(const std::string& stem) {
  std::string name;
  for (const char c : stem) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) != 0 ? "loop_" + name
                                                                                : name;
}

void put(const std::filesystem::path& folder, const std::string& name, const esokit::CCode& c,
         const std::string& structured_text) {
  const auto write = [&](const char* ending, const std::string& text) {
    const auto path = folder / (name + ending);
    std::ofstream(path) << text;
    std::printf("%s\n", path.string().c_str());
  };
  write(".h", c.header);
  write(".c", c.source);
  write(".st", structured_text);
}

/// Says the first error. @return whether there is one
template <class Code>
bool fails(const Code& code) {
  if (!code) std::fprintf(stderr, "no C: %s\n", esokit::to_text(code.error()).c_str());
  return !code;
}

void write_code(const from_log::Design& design, const std::string& page) {
  const from_log::Pasting& pasting = design.pasting();
  esokit::TuneModel model = design.tuning().model;
  const auto stem = std::filesystem::path(page).replace_extension();
  const std::string name = identifier(stem.filename().string());
  std::string recipe = "The law gets its motion.";
  if (pasting.order == 1) {
    const auto number = esokit::detail::source;
    const std::string within = " plus the feed, within " + number(model.u_min) + " .. " +
                               number(model.u_max) + "; then " + name + "_applied gets ";
    const std::string to_u = name + "_input_for", of_law = name + "_update(.., motion)";
    recipe = pasting.actuator.curved()
                 ? "u is " + to_u + "(e) of the effect e: " + name + "_effect_of(" + of_law + ")" +
                       within + to_u +
                       "(e without the feed), and the profile starts under the effect of u"
                 : "u is " + of_law + within + "u without the feed";
    recipe += ". While its mode is safe (2), nothing is added.";
    // As pasted: the law may ask for what is added to it, too.
    model.u_min -= pasting.pole_reach;
    model.u_max += pasting.pole_reach;
  }
  const auto code = esokit::detail::with_number<1, 3>(model.order, [&](auto order) {
    return esokit::tuned_code<order(), float>(
        model, design.taken(), pasting.actuator.seen.curve(),
        {.name = name, .comment = design.taken().name, .moving_reference = true});
  });
  if (fails(code)) return;
  const auto profile = from_log::Runner::profile_of<float>(
      pasting, design.tuning().model, static_cast<int>(design.taken().settings.gains.size()));
  std::visit(
      [&](const auto& any) {
        const esokit::CodeOptions options{.name = name + "_profile", .comment = recipe};
        const auto c = esokit::to_c(any, options);
        const auto text = esokit::to_structured_text(any, options);
        if (fails(c) || fails(text)) return;
        put(stem.parent_path(), name, code->c, code->structured_text);
        put(stem.parent_path(), options.name, *c, *text);
      },
      profile);
}

}  // namespace

int main(int argc, char** argv) { return from_log::command(argc, argv, write_code); }
