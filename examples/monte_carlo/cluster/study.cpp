// A study in parts, by files: start one of these a part, on as many machines as you like, then
// merge.
//
//   study --part 3/8 --records part3 [--runs N] [--threads N]   computes part 3 of the parts 0 ..
//   7;
//                       started again it computes only what is not in the file yet
//   study merge [--runs N] FILE...   the figures of all runs; names the blocks that are missing
//   study replay RUN [--runs N]      one of the runs again, as a table of t, y, u
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "monte_carlo/cluster/print.hpp"
#include "monte_carlo/drives.hpp"

namespace {

int usage() {
  std::cerr << "usage: study --part I/N --records FILE [--runs N] [--threads N]\n"
               "       study merge [--runs N] FILE...\n"
               "       study replay RUN [--runs N]\n";
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  std::string what, part_text, file;
  std::vector<std::string> others;
  long long runs = 100000, threads = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "--part" && has_value) {
      part_text = argv[++i];
    } else if (word == "--records" && has_value) {
      file = argv[++i];
    } else if (word == "--runs" && has_value) {
      runs = std::atoll(argv[++i]);
    } else if (word == "--threads" && has_value) {
      threads = std::atoll(argv[++i]);
    } else if (word.starts_with("--")) {
      return usage();
    } else if (what.empty() && part_text.empty()) {
      what = word;
    } else {
      others.push_back(word);
    }
  }
  const auto study = drives::study(runs, static_cast<int>(threads));

  if (!part_text.empty() && !file.empty() && what.empty()) {
    const auto part = esokit::sim::Part::parse(part_text);
    if (!part) return drives::refused(part.error());
    const auto records = study.run_part(file, *part, drives::overshoot, drives::settling,
                                        drives::dip, drives::chatter);
    if (!records) return drives::refused(records.error());
    std::cout << file << ": " << records->blocks().size() << " blocks of " << runs << " runs";
    if (records->damaged() > 0) std::cout << ", " << records->damaged() << " damaged left out";
    std::cout << '\n';
    return 0;
  }
  if (what == "merge" && !others.empty()) {
    const auto own =
        study.identity(drives::overshoot, drives::settling, drives::dip, drives::chatter);
    if (!own) return drives::refused(own.error());
    esokit::sim::StudyRecords all(*own);
    for (const std::string& name : others) {
      std::ifstream in(name);
      const auto records = esokit::sim::StudyRecords::read(in);
      const auto ok = records ? all.add(*records) : esokit::Check<double>(records.error());
      if (!ok) {
        std::cerr << name << ": ";
        return drives::refused(ok.error());
      }
    }
    return drives::print(study, all);
  }
  if (what == "replay" && others.size() == 1) {
    const auto run = study.replay(std::atoll(others.front().c_str()));
    if (!run) return drives::refused(run.error());
    std::puts("t,y,u");
    for (std::size_t k = 0; k < run->t.size(); ++k) {
      std::printf("%.17g,%.17g,%.17g\n", run->t[k], run->output[k], run->input[k]);
    }
    return 0;
  }
  return usage();
}
