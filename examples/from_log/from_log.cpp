// One command from a log to a controller. It reads a CSV file, finds the machine in it, chooses an
// observer and its bandwidths, and writes one HTML page with all that was seen and the C++ to
// paste.
//
//   from_log drive.csv --y angle --u torque --limits -5,5

#include "from_log/parts/command.hpp"

int main(int argc, char** argv) { return from_log::command(argc, argv); }
