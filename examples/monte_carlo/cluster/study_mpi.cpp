// The same study under MPI: each rank computes a part, rank 0 merges what they send.
//
//   mpirun -np 4 study_mpi [RUNS]
#include <mpi.h>

#include <cstdlib>
#include <iostream>
#include <sstream>
#include <string>

#include "monte_carlo/cluster/print.hpp"
#include "monte_carlo/drives.hpp"

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const auto study = drives::study(argc > 1 ? std::atoll(argv[1]) : 100000, 1);

  esokit::sim::StudyRecords own;
  const auto ok = study.run_part(own, {rank, ranks}, drives::overshoot, drives::settling,
                                 drives::dip, drives::chatter);
  std::ostringstream text;
  if (ok) {
    own.write(text);
  } else {
    drives::refused(ok.error());
  }
  std::string words = text.str();
  int status = ok ? 0 : 3;
  if (rank != 0) {
    const unsigned long long size = words.size();
    MPI_Send(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, 0, MPI_COMM_WORLD);
    // In pieces, as a count of MPI is an int.
    for (std::size_t at = 0; at < words.size(); at += 1u << 30u) {
      MPI_Send(words.data() + at, static_cast<int>(std::min<std::size_t>(size - at, 1u << 30u)),
               MPI_CHAR, 0, 1, MPI_COMM_WORLD);
    }
  } else {
    for (int other = 1; other < ranks; ++other) {
      unsigned long long size = 0;
      MPI_Recv(&size, 1, MPI_UNSIGNED_LONG_LONG, other, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
      words.resize(size);
      for (std::size_t at = 0; at < words.size(); at += 1u << 30u) {
        MPI_Recv(words.data() + at, static_cast<int>(std::min<std::size_t>(size - at, 1u << 30u)),
                 MPI_CHAR, other, 1, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
      }
      std::istringstream in(words);
      const auto theirs = esokit::sim::StudyRecords::read(in);
      const auto joined = theirs ? own.add(*theirs) : esokit::Check<double>(theirs.error());
      if (!joined) status = drives::refused(joined.error());
    }
    if (status == 0) status = drives::print(study, own);
  }
  MPI_Finalize();
  return status;
}
