#!/usr/bin/env bash
# The C of examples/start/to_c.cpp as a component of LinuxCNC's HAL, tried on a simulated axis without
# real time: installs what a fresh Debian 12 lacks, builds, runs eso_axis.hal and looks at its pins.
# usage: examples/start/linuxcnc/run.sh
# The last line is "N passed, N failed".
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
source "$root/cmake/debian_packages.sh"
require_packages "${ESOKIT_BUILD_PACKAGES[@]}" "${ESOKIT_LINUXCNC_PACKAGES[@]}"

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 777 "$folder" # the sessions of root run as nobody
as_root=()
if ((EUID == 0)); then
  export RTAPI_UID=65534
else
  as_root=(sudo)
fi
export RTAPI_FIFO_PATH=$folder/fifo

g++ -std=c++20 -I"$root/include" "$root/examples/start/to_c.cpp" -o "$folder/to_c"
"$folder/to_c" "$folder"
cp "$here"/eso_axis.* "$folder"
cd "$folder"
"${as_root[@]}" halcompile --install eso_axis.comp

passed=0
failed=0
# check name value condition: of awk, on x
check() {
  if awk -v x="$2" "BEGIN { exit !($3) }"; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    echo "$1 is '$2', which should be: $3"
  fi
}

# The values that the file asks for, a line each.
session() { halrun -f "$1" 2>/dev/null | grep -E '^ *(-?[0-9.e-]+|TRUE|FALSE) *$' | tr -d ' '; }

mapfile -t pins < <(session eso_axis.hal)
check "the number of pins" "${#pins[@]}" "x == 5"
check "the position" "${pins[0]:-}" "x != \"\" && (x - 1) ^ 2 < 1e-6"
check "the load" "${pins[1]:-}" "x != \"\" && (x + 60) ^ 2 < 0.01"
check "the status" "${pins[2]:-}" "x == \"0\""
check "wrong-period" "${pins[3]:-}" "x == \"FALSE\""
check "the output when disabled" "${pins[4]:-}" "x == \"0\""

# In a thread of another period the axis is not driven.
sed 's/period1=1000000/period1=2000000/' eso_axis.hal >slow.hal
mapfile -t pins < <(session slow.hal)
check "the position of an axis that is not driven" "${pins[0]:-}" "x != \"\" && x < -10"
check "wrong-period in a slow thread" "${pins[3]:-}" "x == \"TRUE\""
echo "$passed passed, $failed failed"
((failed == 0))
