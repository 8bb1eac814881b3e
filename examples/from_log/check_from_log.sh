#!/usr/bin/env bash
# What from_log makes of files as people have them: check_from_log.sh PROGRAM
# Healthy logs give a design without an alarm, whatever their form; each alarm fires on its file and
# on no other; of what cannot be read it says line and column; what is pasted compiles. The last line
# is "N passed, N failed".
set -uo pipefail
program=$(realpath "${1:?usage: check_from_log.sh PROGRAM}")
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
compiler=${CXX:-c++}
eigen=${EIGEN:-/usr/include/eigen3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
passed=0
failed=0

verdict() {  # verdict STATUS TEXT...
  if (($1 == 0)); then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    shift
    echo "FAILED: $*"
  fi
}

# run FILE [OPTION...]: what it says is in $said, the page in $page, the alarms in $alarms
run() {
  local status=0
  said=$("$program" "$@" --out out 2>&1) || status=$?
  page=$(tail -n 1 <<<"$said")
  alarms=$(sed -n 's/^ALARM \([a-z0-9-]*\):.*/\1/p' <<<"$said" | tr '\n' ' ')
  return "$status"
}

refuses() {  # refuses "TEXT OF THE ERROR" FILE [OPTION...]: not understood
  local text=$1 status=0
  shift
  run "$@" || status=$?
  [[ $status == 2 && $said == *"$text"* ]]
  verdict $? "$*: expected '$text', got status $status and: $said"
}

# ---- what has to be compiled, beside the rest ----

# What a controller logs of itself: telemetry rows, a measurement missing now and then.
cat >telemetry.cpp <<'END'
#include <esokit/esokit.hpp>
#include <iomanip>
#include <iostream>
#include <limits>
using namespace esokit;
int main() {
  auto loop = Adrc<LinearEso<2>>::make({.observer = {.observer_bandwidth = 100,
                                                     .input_gain = 40,
                                                     .sample_time = 1e-3},
                                        .controller_bandwidth = 20,
                                        .limits = {.lower = -5, .upper = 5}})
                  .value();
  write_header<3>(std::cout << std::setprecision(17));
  double y = 0, v = 0;
  unsigned seed = 7;
  for (int k = 0; k < 4000; ++k) {
    seed = seed * 69069u + 12345u;
    const double r = k % 700 < 350 ? 1 : -1;
    const double measured = k % 97 == 50 ? std::numeric_limits<double>::quiet_NaN()
                                         : y + 1e-4 * (seed / 4294967296.0 - 0.5);
    const double a = 50 * loop.update(measured, r) - 2 * v + 5;
    write_row(std::cout, telemetry(loop, k * 1e-3, measured, r));
    y += 1e-3 * v + a * 0.5e-6;
    v += 1e-3 * a;
  }
}
END
{
  "$compiler" -std=c++20 -I"$root/include" -I"$eigen" telemetry.cpp -o telemetry &&
    ./telemetry >telemetry.csv
} &
telemetry=$!

# code_of PAGE: the programs of a page, each behind a line "// program"
code_of() {
  sed -n '/<pre.*<code>/,/<\/code>/p' "$1" |
    sed 's/.*<code>/\/\/ program\n/; s/<\/code>.*//; s/&lt;/</g; s/&gt;/>/g; s/&quot;/"/g; s/&amp;/\&/g'
}

# The machine of this script under the code that is pasted: steps, a load of half of what u can
# balance, a sensor that is lost for some samples and has single outliers; less u than DEAD does
# nothing.
cat >play.cpp <<'END'
#define main pasted_main
#include "pasted.cpp"
#undef main
#include <random>
int main() {
  auto loop = Loop::make();
  if (!loop) return 1;
  std::mt19937_64 bits(1);
  std::normal_distribution<double> normal;
  double x = 0, v = 0, old1 = -0.1, old2 = -0.1, error = 0, moving = 0, rest = 0;
  loop->start(0, -0.1 - DEAD);
  for (int k = 0; k < 9000; ++k) {
    const double target = k < 200 ? 0 : k < 4000 ? 1 : -0.5;
    double y = x + 1e-3 * normal(bits);
    if (k % 97 == 50) y = std::nan("");
    if (k == 6000) y += 100;
    const double u = loop->update(y, target);
    if (!(u >= -6 && u <= 6)) return 2;
    error = std::abs(x - loop->profile.motion()(0));
    if (k > 200 && k < 4000) moving = std::max(moving, error);
    if (k > 5500 && k < 7000) rest = std::max(rest, error);
    const double load = k < 7000 ? 5 : k < 7500 ? -140 : 5;
    for (int i = 0; i < 4; ++i) {
      const double a = 50 * old2 - 2 * v + load;
      x += v * 5e-4 + a * 1.25e-7;
      v += a * 5e-4;
    }
    old2 = old1;
    old1 = std::copysign(std::max(std::abs(u) - DEAD, 0.0), u);
  }
  const auto fault = esokit::diagnose(loop->monitor.health());
  std::printf("moving %g, at rest %g, after the load %g, fault %d, rejected %u\n", moving, rest,
              error, static_cast<int>(fault), loop->monitor.health().rejected);
  // A fifth and a twentieth of the step; noise alone moves y by a hundredth.
  return moving < 0.2 && rest < 0.05 && error < 0.05 && fault == esokit::LoopFault::none ? 0 : 3;
}
END

compiles() {  # compiles PAGE: all its programs, in one, say that they check; the first plays, too
  local flags=(-std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror)
  code_of "$1" | awk '/^\/\/ program$/ { ++n } n == 1' >pasted.cpp
  code_of "$1" | awk '
    /^\/\/ program$/ { if (n) text = text "}\n"; text = text "namespace program_" ++n " {\n"; next }
    /^#include/ { if (!seen[$0]++) print; next }
    { text = text $0 "\n" }
    END { print text "}\nint main() {"
          for (i = 1; i <= n; ++i) print "  if (program_" i "::main() != 0) return 1;"
          print "}" }' >all.cpp
  (($(grep -c '^namespace program_' all.cpp) >= 4)) || return 1
  "$compiler" "${flags[@]}" -O0 all.cpp -o all 2>errors && ./all >said_all || return 1
  (($(grep -c '^self-check: ok$' said_all) == $(grep -c '^namespace program_' all.cpp))) || return 1
  # Another order of the operations gives the same u to 1e-8 of half its range.
  "$compiler" "${flags[@]}" -O2 -ffast-math pasted.cpp -o pasted 2>errors &&
    [[ $(./pasted) == 'self-check: ok' ]] || return 1
  # A digit that was copied wrongly is found.
  sed 's/\(\.input_gain = \)[0-9]/\19/' pasted.cpp >wrong.cpp
  "$compiler" "${flags[@]}" wrong.cpp -o wrong 2>errors || return 1
  ./wrong >said_wrong && return 1
  grep -q '^self-check: sample' said_wrong || return 1
  "$compiler" "${flags[@]}" -O1 -DDEAD=0.0 play.cpp -o play 2>errors && ./play >said_play
}

# ---- a servo under a PD controller ----

# servo [NAME=NUMBER...]: 8 s, y'' + 2 y' = b u(t - 4 ms) - load, rows "t y u r"; the reference steps.
#   b input gain; scale of u; quantum of y; still=1: the reference does not move; noise of y; drift
#   of the load a row; friction; hold: friction that holds at standstill; push: of a measured w, the
#   last column, behind 10 ms of lag and 6 ms of dead time; every: rows in which u holds; relay: u is
#   1 or -1; dead: less u does nothing; most: more does no more; square=1: u acts as its square over 6
servo() {
  local set=() pair
  for pair in "$@"; do set+=(-v "$pair"); done
  awk -v b=50 -v scale=1 -v quantum=0 -v still=0 -v rows=4000 -v noise=1e-3 -v wander=0.02 -v friction=0 -v hold=0 -v push=0 -v every=1 -v relay=0 -v dead=0 -v most=0 -v square=0 "${set[@]}" '
    function normal() {
      seed = (seed * 69069 + 12345) % 4294967296; first = (seed + 1) / 4294967297
      seed = (seed * 69069 + 12345) % 4294967296
      return sqrt(-2 * log(first)) * cos(6.283185307 * seed / 4294967296)
    }
    BEGIN {
      T = 0.002; seed = 7; sign = b < 0 ? -1 : 1
      for (k = 0; k < rows; ++k) {
        t = k * T
        if (!still && k % 350 == 150) r = (k % 700 == 150 ? 1 : -0.7) * (1 + 0.3 * normal())
        y = x + noise * normal()
        if (quantum > 0) { y = y / quantum; y = quantum * int(y + (y < 0 ? -0.5 : 0.5)) }
        slope += 0.1 * ((y - last) / T - slope); last = y
        if (k % every == 0) u = sign * (3 * (r - y) - 0.25 * slope)
        if (relay) u = u > 0 ? 1 : -1
        if (u > 6) u = 6
        if (u < -6) u = -6
        if (push && k % 230 == 77) w = 3 + normal()
        printf "%.3f %.7g %.7g %.7g%s\n", t, y, scale * u, r, push ? sprintf(" %.5g", w) : ""
        drift += wander * normal()
        for (i = 0; i < 4; ++i) {  # u of 4 ms ago
          a = b * (i < 4 ? old2 : old1) - 2 * v + 5 + drift
          if (push) { late += (old_w3 - late) * 0.05; a += push * late }
          if (friction > 0) a -= friction * (1 - 2 / (exp(40 * v) + 1))  # tanh(20 v)
          if (hold > 0) {
            if (v == 0 && a * a <= hold * hold) continue
            a -= (v != 0 ? v : a) > 0 ? hold : -hold
            if (v * (v + a * T / 4) < 0) { v = 0; continue }
          }
          x += v * T / 4 + a * T * T / 32; v += a * T / 4
        }
        effect = u
        if (dead) effect = u > dead ? u - dead : u < -dead ? u + dead : 0
        if (most) effect = u > most ? most : u < -most ? -most : u
        if (square) effect = u * (u > 0 ? u : -u) / 6
        old2 = old1; old1 = effect; old_w3 = old_w2; old_w2 = old_w1; old_w1 = w
      }
    }'
}
servo >rows.txt

# written HEADER SEPARATOR TIME [AWK ACTION]: rows.txt as CSV; TIME is an awk expression of t, as text
written() {
  echo "$1"
  awk -v s="$2" "{ t = \$1; ${4:-} print $3 s \$2 s \$3 }" rows.txt
}

healthy() {  # healthy FILE [OPTION...]: the true b0, and no alarm
  local status=0 b0
  run "$@" $design || status=$?
  [[ $status == 0 && -z $alarms && -s $page ]]
  verdict $? "$*: status $status: $said"
  b0=$(sed -n 's/.*b0 = \([-0-9.e+]*\).*/\1/p' <<<"$said" | head -n 1)
  awk -v b="$b0" -v truth="${truth:-50}" 'BEGIN { q = b / truth; exit !(q > 0.95 && q < 1.05) }'
  verdict $? "$*: b0 is $b0, expected ${truth:-50}"
}

written t,y,u , t >plain.csv
design=
healthy plain.csv
[[ $(grep -c '<h2>Paste this' "$page") == 1 ]]
verdict $? "plain.csv: no controller on $page"
first=$(realpath "$page")
(
  mkdir -p pasted && cp play.cpp pasted && cd pasted && compiles "$first"
) &
pasted=$!
before=$(cksum <"$first")
healthy plain.csv --limits -6,6 --b0 60 --settling 0.5
[[ $page != "$first" && $(cksum <"$first") == "$before" ]]
verdict $? "a second run wrote over the first page, $first"
! grep -qE '(src|href)="(https?:|/|file:)' "$first"
verdict $? "$first needs other files"
# Friction that is found is in the code, and in its self-check.
servo friction=15 noise=2e-4 >rows.txt
written t,y,u , t >rubbing.csv
healthy rubbing.csv
code_of "$page" | awk '/^\/\/ program$/ { ++n } n == 1' >rubbing.cpp
grep -q 'force += .* \* std::tanh(rate / ' rubbing.cpp &&
  "$compiler" -std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror rubbing.cpp -o rubbing &&
  [[ $(./rubbing) == 'self-check: ok' ]]
verdict $? "rubbing.csv: no friction in the code, or its self-check fails: $(cat rubbing.cpp)"
# An actuator with a dead zone, or one that saturates: named, b0 is that of the effect, and what is
# pasted puts out u. Its controller and the last PID, on the machine with the dead zone.
servo most=1.5 >rows.txt
written t,y,u , t >saturates.csv
healthy saturates.csv --no-design
[[ $said == 'The actuator saturates: u (u) beyond ± 1.5 '* ]]
verdict $? "saturates.csv: no saturation is named: $said"
run saturates.csv --no-design --literal curve
[[ $alarms == 'large-u ' && $said != *saturates:* ]]
verdict $? "saturates.csv --literal curve: no alarm: $said"
servo dead=1 >rows.txt
written t,y,u , t >dead.csv
healthy dead.csv --limits 6
[[ $said == 'The actuator has a dead zone: u (u) does nothing between -1 and 1 '* ]]
verdict $? "dead.csv: no dead zone is named: $said"
runs_with_its_map() {  # runs_with_its_map PAGE: its first and last program
  code_of "$1" | awk '/^\/\/ program$/ { ++n } n == 1' >pasted.cpp
  code_of "$1" | awk '/^\/\/ program$/ { text = "" } { text = text $0 "\n" } END { print text }' >pid.cpp
  "$compiler" -std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror pid.cpp -o pid &&
    grep -q 'actuator.input(' pid.cpp && [[ $(./pid) == 'self-check: ok' ]] &&
    "$compiler" -std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror -O2 -ffast-math pasted.cpp -o dead &&
    [[ $(./dead) == 'self-check: ok' ]] || return 1
  "$compiler" -std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror -O1 -DDEAD=1.0 play.cpp -o play_dead &&
    ./play_dead >said_dead
}
runs_with_its_map "$page"
verdict $? "dead.csv: its code does not compile, check or hold the machine: $(cat said_dead pasted.cpp pid.cpp)"
# A load that is measured, a fifth of a unit each: what is pasted measures it, too, and holds one that
# is lost.
servo push=40 >rows.txt
{ echo t,y,u,r,load; awk '{ print $1 "," $2 "," $3 "," $4 "," (NR % 50 == 9 ? "" : $5 / 5) }' rows.txt; } >pushed.csv
healthy pushed.csv --measured load
[[ $said == *'Measuring load saves'* ]] && grep -q '80 *<.*put between its neighbours' "$page" &&
  grep -q 'load: dead time' "$page"
verdict $? "pushed.csv: what was measured is not on $page: $said"
code_of "$page" | awk '/^\/\/ program$/ { ++n } n == 1' >pushed.cpp
cat >push.cpp <<'END'
#define main pasted_main
#include "pushed.cpp"
#undef main
#include <random>
double largest(bool measures, bool loses) {
  auto loop = Loop::make();
  if (!loop) return 1e9;
  std::mt19937_64 bits(1);
  std::normal_distribution<double> normal;
  double x = 0, v = 0, old1 = -1.5, old2 = -1.5, w = 2, w1 = 2, w2 = 2, w3 = 2, late = 2, most = 0;
  if (measures) loop->measured(w / 5);
  loop->start(0, -1.7);
  for (int k = 0; k < 5000; ++k) {
    w = k < 2000 || k >= 3500 ? 2 : 4;
    if (measures && !(loses && k >= 2500 && k < 3000)) loop->measured(w / 5);
    if (loses && k == 2999 && loop->feed1.lost != 499) return 1e9;
    const double u = loop->update(x + 1e-3 * normal(bits), 0);
    if (k > 1500) most = std::max(most, std::abs(x));
    for (int i = 0; i < 4; ++i) {
      late += (w3 - late) * 0.05;
      const double a = 50 * old2 - 2 * v + 5 + 40 * late;
      x += v * 5e-4 + a * 1.25e-7;
      v += a * 5e-4;
    }
    old2 = old1;
    old1 = u;
    w3 = w2, w2 = w1, w1 = w;
  }
  return most;
}
int main() {
  const double with = largest(true, false), lost = largest(true, true);
  const double without = largest(false, false);
  std::printf("with %g, lost %g, without %g\n", with, lost, without);
  return with < 0.5 * without && lost == with ? 0 : 3;
}
END
measuring=(-std=c++20 -I"$root/include" -Wall -Wextra -Wconversion -Werror)
"$compiler" "${measuring[@]}" -O1 pushed.cpp -o pushed && [[ $(./pushed) == 'self-check: ok' ]] &&
  "$compiler" "${measuring[@]}" -O1 push.cpp -o push && ./push >said_push
verdict $? "pushed.csv: its code does not compile, check or hold the load: $(cat said_push pushed.cpp)"
sed 's/,[^,]*$/,1/; 1s/1$/fan/' pushed.csv >idle.csv
status=0
run idle.csv --measured fan --no-design || status=$?
[[ $status == 3 && $said == *'never changes'* && $said == *'Column 0 of --measured is fan.'* ]]
verdict $? "idle.csv: a constant column is not refused by name: $status $said"
refuses "--known is now --measured" pushed.csv --known load
refuses "'load,,r' has an empty name" pushed.csv --measured load,,r
servo >rows.txt
design=--no-design  # the controller takes most of the time, and does not know where a row came from
written '# recorded by hand
t;y;u' ';' t | sed 's/$/\r/; s/\([0-9]\)\.\([0-9]\)/\1,\2/g' >excel.csv
healthy excel.csv
written t,T,u , t >temperature.csv  # T is the y that is named, so t is the time
healthy temperature.csv --y T
written t_ms,y,u , '1000 * t' >milliseconds.csv
healthy milliseconds.csv
written 'time (us),y,u' , 'sprintf("%d", 1e6 * t)' >microseconds.csv
healthy microseconds.csv
written stamp,y,u , 'sprintf("%.6f", 1.7e9 + t)' >epoch.csv
healthy epoch.csv
written stamp,y,u , 'sprintf("%.0f", 1.7e12 + 1000 * t)' >epoch_ms.csv
healthy epoch_ms.csv
written %time,field.angle,field.effort , 'sprintf("%.0f", 1.7e18 + 1e9 * t)' >epoch_ns.csv
healthy epoch_ns.csv
written t,y,u , 'sprintf("%.6f", t + 0.0002 * sin(NR * NR))' >jitter.csv
healthy jitter.csv
written t,y,u , t 'if (NR % 17 == 5) next;' >rows_missing.csv
healthy rows_missing.csv
written t,y,u , t 'if (NR % 23 == 5) $2 = "";' >fields_empty.csv
healthy fields_empty.csv
written t,y,u , t 'if (NR > 2000 && NR < 2020) next;' >gap.csv
healthy gap.csv
# A process that is 30,000 times slower, a row a minute.
written t,y,u , '30000 * t' >process.csv
truth=5.5556e-8 healthy process.csv --time-unit s
# Two topics with stamps of their own; u comes 0.1 ms after y.
{
  echo /clock,/joint_states/joint1/position,/joint_states/joint1/effort
  awk '{ printf "%.4f,%s,\n%.4f,,%s\n", $1, $2, $1 + 1e-4, $3 }' rows.txt
} >topics.csv
healthy topics.csv
healthy topics.csv --time clock --y position --u effort
sed 's/^[^,]*,//' plain.csv >no_time.csv
healthy no_time.csv --sample-time 0.002
{ cat plain.csv; echo 9.9,1; } >short_last.csv  # cut, with the end of its line
healthy short_last.csv
tail -n +2 plain.csv | awk -F, '{ printf "t,%s,pos,%s,PWM,%s\n", $1, $2, $3 }' >words.csv
healthy words.csv --time-unit s --time t --y pos --u PWM
servo quantum=0.002 >rows.txt
written t,y,u , t >encoder.csv
healthy encoder.csv
servo b=-50 >rows.txt
written t,y,u , t >wrong_sign.csv
truth=-50 healthy wrong_sign.csv --b0 -45

wait "$telemetry"
healthy telemetry.csv

# ---- alarms ----

sounds() {  # sounds NAME FILE [OPTION...]: this alarm and no other, on stderr and on the page
  local name=$1 status=0
  shift
  run "$@" --no-design || status=$?
  [[ ($status == 4 || $status == 3) && $alarms == "$name " ]]
  verdict $? "$*: expected the alarm $name, got '$alarms', status $status: $said"
  grep -q "<li>$name: " "$page"
  verdict $? "$*: the page $page does not say $name"
}
sounds sign wrong_sign.csv
servo >rows.txt
sounds sign plain.csv --b0 -50
sounds b0 plain.csv --b0 5
sounds b0 plain.csv --b0 500
sounds b0 plain.csv --b0 0.87
[[ $said == *"degrees and radians"* ]]
verdict $? "b0 wrong by 57.3 is not called degrees and radians: $said"
written t,y,u , '50 * t' >tenths.csv  # 0.1 from row to row: s, or min, or ms at 10 kHz
sounds time-unit tenths.csv
truth=0.02 healthy tenths.csv --time-unit s
written t,pos,u , '10 * t' >fifty_hertz.csv  # 0.02 s, or 1.2 s in minutes: not of a position
truth=0.5 healthy fifty_hertz.csv --order 2
written t,y,u , '10 * t' >fifty_hertz.csv
sounds time-unit fifty_hertz.csv
written t,y,u , 'NR / 30' >minutes.csv  # whole numbers of 2 s, but for the digits
refuses "in which unit is the time? Nothing says it of column t, which begins at 0" minutes.csv
written t_s,y,u , '1e6 * t' >called_seconds.csv
sounds time-unit called_seconds.csv
truth=5e-11 healthy called_seconds.csv --time-unit s
written t,y,u , 'sprintf("%.3f", t + (NR > 1500 ? 3600 : 0))' >jump.csv
sounds time-jump jump.csv
[[ $said == *"line 1502"* ]]
verdict $? "the jump's line is not named: $said"
sounds u-unit plain.csv --limits -0.06,0.06
sounds u-unit plain.csv --limits 6000
# A load that is constant says nothing of what to resist: a floor stands for it, and the page says so.
servo noise=1e-5 wander=0 >rows.txt
written t,y,u , t >quiet.csv
design=
healthy quiet.csv
design=--no-design
[[ $said == *"reckons with a disturbance"* ]]
verdict $? "quiet.csv: nothing is said of the floor: $said"
servo noise=1e-5 wander=0.0005 >rows.txt
written t,y,u , t >moving_little.csv
healthy moving_little.csv
servo noise=1e-4 wander=0 hold=50 rows=6000 >rows.txt
written t,y,u , t >sticks.csv
sounds sticks sticks.csv
servo quantum=0.5 >rows.txt
written t,y,u , t >coarse.csv
sounds quantised coarse.csv

# An angle that begins anew after a turn: named, made continuous, and confirmed.
servo >rows.txt
for turn in 6.283185307 360; do
  awk -v turn="$turn" '{ y = $2 * turn * 0.35; y -= turn * int(y / turn); if (y < 0) y += turn
    print $1 "," y "," $3 }' rows.txt | { echo t,y,u; cat; } >wrapped.csv
  sounds wrapped wrapped.csv
  truth=$(awk -v turn="$turn" 'BEGIN { print 50 * turn * 0.35 }')
  healthy wrapped.csv --wrap "$turn"
done
truth=50

# ---- what is read into a file is named, and right ----

named() {  # named TEXT FILE [OPTION...]: healthy, and it says TEXT
  local text=$1
  shift
  healthy "$@"
  [[ $said == *"$text"* ]]
  verdict $? "$*: it does not say '$text': $said"
}
servo >rows.txt
written stamp,y,u , 'sprintf("%.0f", 1.7e9 + 30000 * t)' >epoch_minutes.csv
truth=5.5556e-8 named 'rows are 60 s apart' epoch_minutes.csv
written stamp,y,u , 'sprintf("%.11f", 45352.5 + 500 * t / 86400)' >excel_days.csv
truth=2e-4 named 'is in day' excel_days.csv
written t_us,y,u , 'sprintf("%.0f", (4294000000 + 1e6 * t) % 4294967296)' >wrapped_us.csv
named 'begins anew after 4294967296,' wrapped_us.csv
written t_ms,y,u , 'sprintf("%.0f", (65000 + 1e3 * t) % 65536)' >wrapped_ms.csv
named 'begins anew after 65536,' wrapped_ms.csv
sed 's/^[^,]*,/0.25,/; 1s/.*/t,y,u/' plain.csv | awk -F, -v OFS=, 'NR > 1 { $1 = int((NR - 2) / 5) / 100 } 1' >rounded.csv
sounds repeated rounded.csv
truth=50 healthy rounded.csv --sample-time 0.002
# Only what changed: fields that are empty, rows that are missing. A coarse y stands still often.
servo quantum=0.002 >rows.txt
written t,y,u , t 'y = $2; if (NR > 1 && y == last) $2 = ""; last = y;' >changes.csv
named 'Column y has a value only where it changed' changes.csv
servo quantum=0.002 every=10 >rows.txt
written t,y,u , t 'if (NR > 1 && $2 == y && $3 == u) next; y = $2; u = $3;' >changed_rows.csv
named 'Rows were written only where something changed' changed_rows.csv
servo >rows.txt
# Lines of a serial monitor, words, units, decimals.
{ echo 'started, tuning'; awk '{ print " sec: " $1 "  pos: " $2 " rad  u=" $3 " \xe2\x86\x97" }' rows.txt; } >monitor.txt
healthy monitor.txt
awk '{ print "{\"t\": " $1 ", \"y\": " $2 ", \"u\": " $3 "}" } NR == 2000 { print "warning: hot" }' rows.txt >lines.json
named '1 line without the labels' lines.json
awk '{ gsub(/\./, ","); print "t: " $1 "; y: " $2 "; u: " $3 }' rows.txt >labels_german.txt
healthy labels_german.txt
{ echo 'Zeit;Lage;Strom'; awk '{ gsub(/\./, ","); print $1 " s;" $2 "rad;" $3 " A" }' rows.txt; } >units.csv
healthy units.csv
written t,y,u , 'sprintf("%.3e", t)' 'if ($2 !~ /e/) $2 = $2 "D+00"; if (NR % 31 == 7) $2 = "ERR";' | sed '2,$s/e\([-+]\)/D\1/g' >fortran.csv
named 'an error instead of a number' fortran.csv
servo relay=1 >rows.txt
written 'time,pv,sp,output' , t '$3 = ($3 > 0 ? (NR % 2 ? "ON" : "WAHR") : NR % 2 ? "OFF" : "faux") s $3;' | sed '1s/sp,output/output,x/' >switched.csv
truth=100 named "ON or true is 1" switched.csv --time-unit s
[[ $said == *"'output' was taken for u"* ]]
verdict $? "switched.csv: nothing is said of output: $said"
servo >rows.txt
written t,y,u , t '$3 = $2;' >same.csv
refuses 'have the same numbers in all rows' same.csv
refuses 'are the same column, number 2' plain.csv --u y --y y
{ echo 'x-axis,1,2'; echo 'second,Volt,Volt'; awk '{ print $1 "," $3 "," $2 }' rows.txt; } >named_by_numbers.csv
refuses "'2' is the name of column 3 and the number of column 2" named_by_numbers.csv --time 1 --u 2 --y 3
healthy named_by_numbers.csv --time @1 --u @2 --y @3
written t,y,u , '1e6 * t' >ticks.csv
refuses 'in which unit is the time?' ticks.csv
healthy ticks.csv --time-unit us
written t,y,u , 'NR' >counted.csv
refuses 'Column t counts the rows' counted.csv
healthy counted.csv --time t --sample-time 0.002
written t,y,u , 'NR / 30000' >sixty_hertz.csv
refuses 'in which unit is the time?' sixty_hertz.csv
{ echo t,y,u; awk '{ print $1 "," $2 "," $3 (NR > 9 ? " A" : "") }' rows.txt; } >two_units.csv
refuses "has the unit A, the numbers before have none" two_units.csv
refuses "--literal: 'late' is none of changes, curve, late-u" plain.csv --literal late

# Real machines: most are refused, but nothing is wrong with their units, signs and clocks.
data=$root/examples/data
for log in servo_relay_pid/{relay,pid_sine}.csv dfki_simple_pendulum/{ddp,direct_collocation}.csv \
  dfki_pendulum_mass_change/energy_shaping{,_1kg}.csv; do
  run "$data/$log" --no-design
  status=$?
  # The servo's drive does saturate: 57 deg/s at full drive are known, and 0.857 * 67.7 = 58.
  if [[ $log == */pid_sine.csv ]]; then
    [[ $status == 0 && -z $alarms && $said == 'The actuator saturates: u (u_pct) beyond ± 67.7 '* ]]
  else
    [[ ($status == 3 || $status == 0) && -z $alarms ]]
  fi
  verdict $? "$log: alarms '$alarms', status $status: $said"
done

# What is known of some of them by other means (examples/data/README.md).
known() {  # known LEAST MOST FILE [OPTION...]: accepted, with a b0 in between
  local least=$1 most=$2 status=0 b0
  shift 2
  run "$data/$1" "${@:2}" --no-design || status=$?
  b0=$(sed -n 's/.*b0 = \([-0-9.e+]*\).*/\1/p' <<<"$said" | head -n 1)
  [[ $said != *refused:* && -n $b0 ]] && awk -v b="$b0" -v l="$least" -v m="$most" 'BEGIN { exit !(b >= l && b <= m) }'
  verdict $? "$*: b0 has to be $least to $most, got status $status: $said"
}
known 0.116 0.152 xl330_pendulum/kp100_sine.csv --u pwm_885 --y position_rad --order 2 --measured sin_pos
known 0.0024 0.0030 tclab_steps/step.csv
for log in tclab_steps/constant.csv esp32_motor_step/step.csv; do
  run "$data/$log" --no-design
  [[ $? == 3 && $said == *refused:* ]]
  verdict $? "$log tells nothing: $said"
done

# ---- refused: a page that says what to record instead ----

shows() {  # shows FIELD FILE [OPTION...]
  local field=$1 status=0
  shift
  run "$@" || status=$?
  [[ $status == 3 && $said == *"refused: "*"$field"* && -s $page ]] &&
    grep -q 'What to record instead' "$page" && ! grep -q '<h2>Paste this' "$page"
  verdict $? "$*: expected a page that refuses for $field, got status $status: $said"
}
servo still=1 >rows.txt
written t,y,u , t >standstill.csv
shows own_input standstill.csv
servo rows=150 >rows.txt
written t,y,u , t >short.csv
shows rows short.csv
servo >rows.txt
# What a controller's u was in the gaps is not known.
written t,y,u , t | awk 'NR == 1 || NR % 20 < 12' >far_apart.csv
shows rows far_apart.csv
[[ $said == *"refused: The log has "*" gaps of about "* && $said != *"too short. Record"* ]]
verdict $? "far_apart.csv does not say that it has gaps: $said"
written t,y,u , t 'if (1) $3 = 1;' >constant.csv
shows "u = 1: never changes" constant.csv
[[ $said == *"refused: u is the same in all rows. Is it the right column (--u)?"* ]]
verdict $? "constant.csv does not say what to do: $said"
[[ $said != *arning* && $said == *"never changes"* ]]
verdict $? "constant.csv: $said"
written t,y,u , t 'if (1) { x += (u - x) / 100; u = NR > 900 ? 5 : 0; $2 = x; $3 = u }' >single_step.csv
shows '' single_step.csv
[[ $said == *"u (u, 0 to 5) moves by a fifth of its range once only, at 1.8 s"* ]]
verdict $? "single_step.csv: $said"
# A u that is not this machine's.
written t,y,u , t '$3 = sin(NR * NR);' >foreign.csv
shows '' foreign.csv

# ---- an observer that is typed in, over any log ----

settings=(--observer linear --order 2 --b0 2 --bandwidth 20)

near() {  # near EXPECTED COLUMN FILE: the column's last estimate, to a millionth
  local last
  last=$(tail -n 1 "$(ls -t out/"$(basename "${3%.*}")"-estimates*.csv | head -n 1)" | cut -d, -f"$2")
  awk -v a="$last" -v b="$1" 'BEGIN { d = a - b; exit !(a != "" && d * d <= 1e-12 * (1 + b * b)) }'
  verdict $? "$3: column $2 ends at $last, expected $1"
}

reads() {  # reads FILE [OPTION...]: to the end, and with the disturbance that is in the data
  local status=0
  run "$1" "${settings[@]}" "${@:2}" || status=$?
  ((status == 0))
  verdict $? "$*: status $status: $said"
  near 3 4 "$1"
}

# y'' = 3 + 2 u, u = 0.5 and, from 1 s on, -1; rows t, y, u.
table() {  # table SEPARATOR [AWK CONDITION for a row with a measurement]
  awk -v s="$1" 'BEGIN {
    for (k = 0; k <= 400; ++k) {
      t = k * 0.01; u = t < 0.995 ? 0.5 : -1
      printf "%.2f%s%s%s%s\n", t, s, ('"${2:-1}"' ? sprintf("%.12g", y) : ""), s, u
      a = 3 + 2 * u; y += v * 0.01 + a * 0.5e-4; v += a * 0.01
    }
  }'
}

{ echo t,y,u; table ,; } >plain.csv
reads plain.csv
near 3 5 plain.csv  # smoothed
for observer in half-gain reduced cascade algebraic adjustable nonlinear; do
  reads plain.csv --observer "$observer"
done
reads plain.csv --time 1 --y 2 --u 3
table , >no_header.csv
reads no_header.csv --time 1 --y 2 --u 3
reads no_header.csv --y 2 --u 3 --sample-time 0.01
{ echo 't;y;u'; table ';'; } >semicolons.csv
reads semicolons.csv
{ echo 't|y|u'; table '|'; } >bars.csv
reads bars.csv
# As LabVIEW writes it.
{
  printf 'LabVIEW Measurement\t\nWriter_Version\t2\nX_Columns\tOne\n***End_of_Header***\t\n\t\n'
  printf 'Channels\t2\t\t\nSamples\t401\t401\t\n***End_of_Header***\t\t\t\nX_Value\ty\tu\tComment\n'
  table $'\t' | sed 's/$/\t/'
} >labview.lvm
reads labview.lvm
sed 's/X_Value/X_Other/' labview.lvm >labview_other.lvm
refuses "which column is time?" labview_other.lvm "${settings[@]}"
{ echo 't;y;u'; table ';' | tr . ,; } >decimal_commas.csv
reads decimal_commas.csv
{ echo '# logged by hand'; echo t,y,u; echo s,m,N; echo '// units above'; table ,; } >comments.csv
reads comments.csv
{ echo '% t y u'; table ' '; } >named_in_comment.csv
reads named_in_comment.csv
{ echo /clock/t,/joint_states/joint1/position,/joint_states/joint1/effort; table ,; } >paths.csv
reads paths.csv --time t --y position --u /joint_states/joint1/effort
{ echo t,y,u; table ,; printf 4.01,2; } >cut.csv
reads cut.csv
{ printf 't\ty\tu\n'; table '\t'; } >tabs.csv
reads tabs.csv
reads tabs.csv --separator tab
{ echo t y u; table ' '; } >spaces.csv
reads spaces.csv
{ printf '\xef\xbb\xbf"t","y","u"\r\n'; table , | sed 's/$/\r/'; } >spreadsheet.csv
reads spreadsheet.csv
{ echo '"time, s",y,u'; table ,; } >quoted.csv
reads quoted.csv --time 'time, s'
{ echo t,y,u; table , 'k < 100 || k > 150'; } >gaps.csv
reads gaps.csv
{ echo t,y,u; table , | awk -F, 'NR % 7 != 3'; } >irregular.csv
reads irregular.csv

# ---- files as other people's loggers write them ----

# stamped STAMP [ROW]: the same log two seconds before midnight. STAMP is an awk expression of d, the
# days since then, and c, the second of the day; ROW one of stamp, $2 and $3.
stamped() {
  table , | awk -F, "function clock() { return sprintf(\"%02d:%02d:%06.3f\", c / 3600, c % 3600 / 60, c % 60) }
    { s = 86398 + \$1; d = int(s / 86400); c = s - 86400 * d; stamp = $1; print ${2:-stamp \",\" \$2 \",\" \$3} }"
}
{ echo ,timestamp,y,u; stamped 'sprintf("2024-02-%d", 28 + d) "T" clock() "Z"' \
  'NR - 1 "," stamp "," $2 "," $3'; } >index_and_iso.csv
reads index_and_iso.csv
{ echo time,y,u; stamped 'sprintf("2023-%s", d ? "03-01" : "02-28") " " clock() "+01:00"'; } >leap_day.csv
reads leap_day.csv
stamped 'clock() " -> "' 'stamp $2 "," $3' >serial_monitor.txt
reads serial_monitor.txt --time 1 --y 2 --u 3
{ echo time,y,u; stamped 'sprintf("03/04/2024 %d:%s %sM", d ? 12 : 11, substr(clock(), 4), d ? "P" : "A")'
} >american.csv
reads american.csv
{ echo date,y,u; stamped 'sprintf("%02d-%s-2024 ", d ? 1 : 29, d ? "Mar" : "Feb") clock()'; } >matlab.csv
reads matlab.csv
{ echo date,y,u; stamped 'sprintf("2024-02-%d", 28 + d) "T" clock() "Z[UTC]"'; } >java.csv
reads java.csv
{ printf 'Messung vom 29.2.2024;;\nZeitstempel;Winkel;Stellgr\xf6\xdfe\n;rad;Nm\n'
  stamped 'sprintf("%02d.%s.2024 ", d ? 1 : 29, d ? "03" : "02") clock()' 'stamp ";" $2 ";" $3' |
    awk -F';' -v OFS=';' '{ sub(/\./, ",", $2); sub(/\./, ",", $3) } 1'; } >german.csv
reads german.csv
iconv -f LATIN1 -t UTF-16LE german.csv | { printf '\xff\xfe'; cat; } >little.csv
reads little.csv
iconv -f LATIN1 -t UTF-16BE german.csv | { printf '\xfe\xff'; cat; } | tr '\n' '\r' >big.csv
reads big.csv
table , | awk -F, '{ print "ms:" 1000 * $1 " u:" $3 " y:" $2 }' >labels.txt
reads labels.txt --time ms
# A stamp before the labels, and the names of parts of a program.
table , | awk -F, '{ printf "[%10.6f] u=%s y=%s\n", 12 + $1, $3, $2 }' >kernel.txt
reads kernel.txt --time-unit s
table , | awk -F, '{ printf "I (%d) motor: u=%s y=%s\n", 1234 + 1000 * $1, $3, $2 }' >esp.txt
reads esp.txt --time-unit ms
stamped 'sprintf("2024-02-%d %s", 28 + d, clock())' 'stamp " INFO [main] u=" $3 " y=" $2' | sed 's/\(:[0-9][0-9]\)[.]/\1,/' >logger.txt
reads logger.txt
# A number in brackets behind a word is its index, and no time.
table , | awk -F, '{ printf "motor[%d] u=%s y=%s\n", NR, $3, $2 }' >index.txt
refuses "which column is time?" index.txt
table , | awk -F, '{ printf "Time: %d ms\tU: %s Nm\tAngle: %s rad\n", 1000 * $1, $3, $2 }' >units_behind.txt
reads units_behind.txt
{ echo '['; table , | awk -F, '{ printf "{\"t\":%s,\"y\":%s,\"u\":%s},\n", $1, $2, $3 }' | sed '$ s/,$//'; echo ']'; } >array.json
reads array.json
{ echo t,y,u; table , | sed 's/-/\xe2\x88\x92/g'; } >typeset_minus.csv
reads typeset_minus.csv
{ echo '"t","y","u"'; table ';' | sed 's/[.]/,/g; s/;/","/g; s/.*/"&"/'; } >quoted_commas.csv
reads quoted_commas.csv
{ echo t,y,u; echo '1,"1,234",5'; echo '2,"2,345",6'; } >quoted_thousands.csv
refuses 'write it without separators of thousands' quoted_thousands.csv "${settings[@]}"
{ echo header.stamp.sec,header.stamp.nanosec,position,effort
  table , | awk -F, '{ printf "%d,%d,%s,%s\n", 1700000000 + int($1 + 1e-9), (100 * $1) % 100 * 1e7, $2, $3 }'; } >ros2.csv
reads ros2.csv
{ echo t,y,u; table , | awk -F, -v OFS=, 'NR % 90 == 7 { $2 = NR % 4 ? "n/a" : "unavailable" } 1'; } >missing_words.csv
reads missing_words.csv
{ echo t,setpoint,feedback,output; table , | awk -F, '{ print $1 ",0," $2 "," $3 }'; } >feedback.csv
reads feedback.csv
{ echo t,u,position,encoder; table , | awk -F, '{ print $1 "," $3 "," $2 "," int(100 * $2) }'; } >counts_beside.csv
reads counts_beside.csv
{ printf 'Trace;PLC_1;Motor\nTime;MAIN.Angle;MAIN.Torque\nms;rad;Nm\n'
  table ';' | awk -F';' -v OFS=';' '{ $1 *= 1000 } 1'; } >plc.csv
reads plc.csv
{ printf 'Model,M4\nSample Interval,0.01\n,\nLabels,CH1,CH2\nTIME,CH1,CH2\n'; table ,; } >scope.csv
reads scope.csv --y CH1 --u CH2
{ printf 'Writer_Version\t2\nDate\t2024/03/01\nX0\t0,0\t0,0\n***End***\t\t\nX_Value\tPosition\tTorque\tComment\n'
  table '\t' | tr . ,; } >labview.lvm
reads labview.lvm --time X_Value
{ printf '#datatype,string,long\n,result,table,_time,position,torque\n'
  table , | awk -F, '{ printf ",,0,%d%09d,%s,%s\n", 1700000000 + int($1), ($1 - int($1)) * 1e9 + 0.5, $2, $3 }'
} >influx.csv
reads influx.csv
{ printf 'time,u,y\n,Nm,rad\n,double,double\n,zoh,linear\n'; table , | awk -F, '{ print $1 "," $3 "," $2 }'; } >inspector.csv
reads inspector.csv
{ echo %time,field.header.stamp,field.position0,field.effort0
  table , | awk -F, '{ printf "%d%09d,9,%s,%s\n", 1700000000 + int($1), ($1 - int($1)) * 1e9 + 0.5, $2, $3 }'; } >echoed.csv
reads echoed.csv
{ echo Record,Date,UTC Time,MV,PV; stamped 'sprintf("02/%d/2024,%s", 28 + d, clock())' 'NR "," stamp "," $3 "," $2'; } >datalog.csv
reads datalog.csv
{ echo time,_field,_value; echo 1,u,2; echo 1,y,3; echo 2,u,2; } >long.csv
refuses "this is a long table" long.csv
{ echo dt,u,y; table , | awk -F, '{ print "0.01," $3 "," $2 }'; } >steps.csv
refuses "time stands still: column dt is 0.01 in all rows" steps.csv --time dt
{ printf 't/ms;y/rad;u/Nm\n'; table ';' | awk -F';' -v OFS=';' '{ $1 *= 1000 } 1'; } >din.csv
reads din.csv
{ echo 'Zeit [min],Lage,Kraft'; table , | awk -F, -v OFS=, '{ $1 = sprintf("%.12g", $1 / 60) } 1'; } >minutes.csv
reads minutes.csv
{ echo time,header.stamp,y,y_filtered,u; table , | awk -F, '{ print $1 ",9," $2 ",9," $3 }'; } >whole_names.csv
reads whole_names.csv
table ' ' | tr . , >commas_and_blanks.txt
reads commas_and_blanks.txt --time 1 --y 2 --u 3
{ echo t,y_rad,y_raw,u_Nm; table , | awk -F, '{ print $1 "," $2 ",9," $3 }'; } >begins.csv
reads begins.csv --y y_rad --u u_

# A name of nothing but dots is no folder and no hidden file.
for dots in ..csv ...csv; do
  cp plain.csv "$dots"
  run "$dots" "${settings[@]}" && [[ $page == "$PWD"/out/log*.html && -s $page ]]
  verdict $? "$dots: $said"
done

# ---- not understood: status 2, and where ----

refuses "no column 'torque'; there are t, y, u" plain.csv --u torque
refuses "there is no header and are 3 columns" no_header.csv --time 1 --y 2 --u 4
refuses "which column is y?" no_header.csv --time 1 --u 2
{ echo t,/a/position,/b/position; table ,; } >two.csv
refuses "'position' is /a/position and /b/position" two.csv --time t --y position --u 3
refuses "which column is y?" two.csv --u 3
sed '5s/.*/0.03,about 2,1/' plain.csv >word.csv
refuses "word.csv, line 5: 'about 2' in column 'y' is not a number" word.csv
sed '7s/.*/0.05,1/' plain.csv >short_line.csv
refuses "short_line.csv, line 7: only 2 fields, none for 'u'" short_line.csv
sed '90s/pos,\(.*\),PWM,/PWM,\1,pos,/' words.csv >words_swapped.csv
refuses "words_swapped.csv, line 90: 'pos' stands before column 'PWM' instead of its name" \
  words_swapped.csv --time-unit s --time t --y pos --u PWM
sed "9s/,/,'/2; 9s/\$/'/" plain.csv >quoted_once.csv
refuses "is not a number: write it without quotation marks" quoted_once.csv
{ echo 't;y;u'; table ';' | sed '9s/;.*;/;12,345.6;/'; } >thousands.csv
refuses "'12,345.6' in column 'y' is not a number: write it without separators of thousands" thousands.csv
sed '90s/^/t,y,u\n/' plain.csv >two_recordings.csv
refuses "line 90: 'u' in column 'u' is a name, not a number: a second recording begins here" two_recordings.csv
{ printf 'PK\003\004\n'; head -c 300 /dev/zero; } >book.csv
refuses "book.csv: it is packed (a workbook, a zip or gz file), no text" book.csv
{ echo t,y,u; table , | tac; } >newest_first.csv
refuses "newest_first.csv, line 3: time runs backwards in column t in all rows" newest_first.csv
written t,y,u , 'sprintf("%.3f", 20240331015940 + t)' >digits.csv
refuses "If it is a date, write it as 2024-03-01T12:00:00" digits.csv
sed '9s/^[^,]*/0.02/' plain.csv >backwards.csv
refuses "backwards.csv, line 9: time runs backwards in column t, from 0.06 to 0.02" backwards.csv
awk -F, -v OFS=, 'NR == 1 { print "cycle", $1, "t_ns", $2, $3; next }
  { print int(NR / 200), ($1 % 2) "", sprintf("17%011d00000", $1 * 1e6), $2, $3 }' plain.csv >cycles.csv
refuses "or is the time in --time 't_ns'?" cycles.csv --time t
sed '9s/^[^,]*/0.06/' plain.csv >still.csv
sounds repeated still.csv
sed '9s/^[^,]*//' plain.csv >timeless.csv
refuses "timeless.csv, line 9: the time is missing in column t" timeless.csv
stamped '"2024-02-28 " clock()' >one_day.csv  # the clock passes midnight, the date does not
refuses "one_day.csv, line 201: time runs backwards in column 1" one_day.csv --time 1 --y 2 --u 3
stamped 'sprintf("%02d/04/2024 ", 3 + d) clock()' >either.csv
refuses "line 201: '04/04/2024 00:00:00.000' in column 1 may be day/month or month/day" either.csv \
  --time 1 --y 2 --u 3
stamped 'substr(clock(), 1, 5)' >hours.csv
refuses "line 1: '23:59' in column 1 may be hours:minutes or minutes:seconds" hours.csv \
  --time 1 --y 2 --u 3
sed '9s/^[^,]*/2024-03-01 12:00:00/' plain.csv >other_stamp.csv
refuses "line 9: '2024-03-01 12:00:00' in column 't' is not written as the stamps before" other_stamp.csv
sed '9s/^[^,]*/noon/' plain.csv >noon.csv
refuses "line 9: 'noon' in column 't' is neither a number nor a time" noon.csv
{ echo t y u; table ' ' | awk '{ print NR, $0 }'; } >row_names.txt
refuses "row_names.txt, line 2: it has 4 fields, but line 1 has 3 names" row_names.txt
{ echo t,y,u; table ';' | tr .\; ,,; } >all_commas.csv
refuses "fields, but line 1 has 3 names; with decimal commas the separator must be another" all_commas.csv
{ echo 't;y;u'; table ';' | sed '9s/\./,/2'; } >mixed.csv
refuses "line 10: '0,0128' has a decimal comma, the numbers before (line 10) have a point" mixed.csv
refuses "'y' is y_rad and y_raw, columns 2 and 3" begins.csv --y y
{ echo t,y,y,u; table , | sed 's/,/,9,/'; } >twice.csv
refuses "'y' is y and y, columns 2 and 3" twice.csv --y y
sed '5s/u:/y:/' labels.txt >swapped.txt
refuses "line 5: 'y:0.5' in column 'u' does not have the label of the first row" swapped.txt --time ms
tail -c +3 little.csv >no_mark.csv
refuses "no_mark.csv, line 1: it has a zero byte" no_mark.csv
sed '2s/.*/0.00,about 2,1/' plain.csv >first_word.csv
refuses "first_word.csv, line 2: 'about 2' in column 2 is not a number" first_word.csv
sed '2s/.*/0.00,1/' plain.csv >first_short.csv
refuses "first_short.csv, line 2: it has 2 fields, the lines below have 3" first_short.csv
echo '(17.5) can0 123#0E4C' >candump.log
refuses "candump.log: no line with numbers; line 1 is '(17.5) can0" candump.log
refuses "--wrap: must not be negative" plain.csv --wrap -360
refuses "--wrap: y (y) covers" plain.csv "${settings[@]}" --wrap 1
sed '402s/^4.00/9999/' plain.csv >leap.csv
refuses "is too short or too long for the nominal sample time" leap.csv "${settings[@]}"
echo t,y,u >empty.csv
refuses "empty.csv: no line with numbers" empty.csv
refuses "cannot read nowhere.csv" nowhere.csv
refuses ". is a folder" .
said=$("$program" 2>&1)
[[ $? == 2 && $said == *"no file is given"* ]]
verdict $? "without a file: $said"
refuses "more than one file" plain.csv word.csv
refuses "unknown option --bandwith" plain.csv --bandwith 3
refuses "--bandwidth: 'fast' is not a number" plain.csv --bandwidth fast
refuses "--bandwidth: must be positive, not -1" plain.csv "${settings[@]}" --bandwidth -1
refuses "--order: must be 1, 2 or 3" plain.csv --order 4
refuses "--limits: 5,-5 is no range" plain.csv --limits 5,-5
refuses "--noise, --settling, --omega-c: one of them" plain.csv --noise 3 --settling 1
refuses "--time-unit: 'weeks' is none of" plain.csv --time-unit weeks
refuses "no observer 'luenberger'; there are linear" plain.csv "${settings[@]}" --observer luenberger

# Where Python and gnuplot are missing it draws the figures itself.
drawn() { grep -o 'data:image/svg' "$page" | wc -l; }
run plain.csv --no-design
many=$(drawn)
mkdir bare
ln -s "$(command -v sh)" bare/sh
printf '#!/bin/sh\nPATH="%s" exec "%s" "$@"\n' "$PWD/bare" "$program" >without
chmod +x without
program=./without run plain.csv --no-design
(($(drawn) == many && many > 1)) && grep -o 'svg+xml;base64,[^"]*' "$page" | cut -d, -f2 | while IFS= read -r one; do
  # Curves within the panels, and words.
  base64 -d <<<"$one" | python3 -c '
import sys, xml.etree.ElementTree as tree
drawn = [e.tag.split("}")[1] for e in tree.fromstring(sys.stdin.read()).iter()]
sys.exit(drawn.count("clipPath") == 0 or drawn.count("path") < 4 or drawn.count("text") < 8)' || exit 1
done
verdict $? "plain.csv without Python: $(drawn) of $many figures: $said"

# Half of what from_log takes to compile is to generate its code, so its amount is limited, before
# linking: 1.68 MB in three units, 0.33 of them the identification, which is optimised. A limit on
# time would depend on the machine.
objects=$(dirname "$program")/..
if [[ -s $objects/libesokit_from_log.a ]]; then
  units=0 bytes=0
  for library in from_log study; do
    units=$((units + $(ar t "$objects/libesokit_$library.a" | wc -l)))
    bytes=$((bytes + $(size -t "$objects/libesokit_$library.a" | awk 'END { print $1 }')))
  done
  ((units <= 3 && bytes < 1740000))
  verdict $? "from_log is $bytes bytes of code in $units units: it takes longer to compile than it did"
fi

# rotor [ACTION [DRY [SEED]]]: y' = 20 times the effect of u - 3 y - dry friction, steps of u; ACTION
# gives the effect
rotor() {
  awk "function random() { seed = (seed * 69069 + 12345) % 4294967296; return (seed + 0.5) / 4294967296 }
    BEGIN {
      print \"t,y,u\"; seed = ${3:-7}; dry = ${2:-0}
      for (k = 0; k < 1500; ++k) {
        if (k % 40 == 0) u = 2 * random() - 1
        printf \"%.2f,%.6g,%.6g\\n\", k / 100, y + 0.02 * (random() + random() + random() + random() - 2), u
        for (i = 0; i < 4; ++i) {
          force = 20 * (i < 2 ? old2 : old1)
          if (y == 0 && force * force <= dry * dry) continue
          last = y
          y += 0.0025 * (force - 3 * y - ((y != 0 ? y : force) > 0 ? dry : -dry))
          if (dry && y * last < 0) y = 0
        }
        effect = u; ${1:-}
        old2 = old1; old1 = effect
      }
    }"
}
# Friction that sticks may pass for a dead zone: then it is said.
rotor 'effect = u > 0.3 ? u - 0.3 : u < -0.3 ? u + 0.3 : 0' 0 4 >numb.csv
run numb.csv --order 1 --no-design
[[ $said == *'has a dead zone'* && $said != *'friction that sticks'* ]]
verdict $? "numb.csv: no dead zone, or friction: $said"
rotor '' 8 4 >sticks.csv
run sticks.csv --order 1 --no-design
[[ $said == *'has a dead zone'*'it may be friction that sticks'* ]]
verdict $? "sticks.csv: no word of friction that sticks: $said"

# from_log_c, where it was built: its C compiles, and controller and profile pass their self-tests.
# Behind the curve of an actuator it holds the machine, by the words of its comment.
cat >in_c.c <<'END'
#include <math.h>
#include <stdio.h>
#include "c/NAME.h"
#include "c/NAME_profile.h"
#if PROFILE_ORDER == 1
#define R r[0], r[1]
#elif PROFILE_ORDER == 2
#define R r[0], r[1], r[2]
#else
#define R r[0], r[1], r[2], r[3]
#endif
int main(void) {
  static NAME_profile_state profile;
  NAME_state law;
  double x = 0, v = 0, old1 = 0, old2 = 0, error = 0;
  int k, i;
  if (NAME_self_test(0.0f) != 0 || NAME_profile_self_test(0.0f) != 0) return 1;
  NAME_init(&law);
  for (k = 0; k < 4000; ++k) {
    const float target = k < 2000 ? 1.0f : -0.5f;
    float r[PROFILE_ORDER + 1], u;
    (void)NAME_profile_update(&profile, target);
    NAME_profile_motion(&profile, r);
#ifdef FEED
    {
      const float feed = NAME_profile_feed(&profile);
      float e = NAME_EFFECT(NAME_update(&law, (float)x, R)) + feed;
      e = e > LARGEST_EFFECT ? LARGEST_EFFECT : e < -LARGEST_EFFECT ? -LARGEST_EFFECT : e;
      u = NAME_INPUT(e);
      (void)NAME_applied(&law, NAME_INPUT(e - feed));
    }
#else
    u = NAME_update(&law, (float)x, R);
#endif
    for (i = 0; i < 4; ++i) {
      if (ORDER == 1) {
        x += TIME / 4 * (20 * (i < 2 ? old2 : old1) - 3 * x);
      } else {
        v += TIME / 4 * (50 * old2 - 2 * v + 5);
        x += TIME / 4 * v;
      }
    }
    old2 = old1;
    old1 = ACTUATOR(u);
    if (k % 2000 > 1500) error = fmax(error, fabs(x - target));
  }
  printf("error %g\n", error);
  return error < 0.02 ? 0 : 3;
}
END
in_c() {  # in_c NAME ACTUATOR "FLAGS" [OPTION...]: of NAME.csv
  local name=$1 actuator=$2 flags upper=${1^^}
  read -ra flags <<<"$3"
  "$(dirname "$program")/from_log_c" "$name.csv" --out c "${@:4}" >said_c 2>&1 &&
    sed "s/NAME/$name/g; s/PROFILE_ORDER/${upper}_&/; s/$name\_EFFECT/EFFECT/; s/$name\_INPUT/INPUT/g" in_c.c >"$name.c" &&
    "${CC:-cc}" -std=c99 -Wall -Wextra -Wconversion -Werror "-D${upper}_SELF_TEST" \
      "-D${upper}_PROFILE_SELF_TEST" "-DACTUATOR(u)=($actuator)" "${flags[@]}" "$name.c" "c/$name.c" \
      "c/${name}_profile.c" -lm -o in_c 2>>said_c && ./in_c >>said_c &&
    [[ -s c/$name.st && -s c/${name}_profile.st ]]
  verdict $? "$name.csv as C: $(tail -n 5 said_c)"
}
if [[ -x $(dirname "$program")/from_log_c ]]; then
  servo >rows.txt
  written t,y,u , t >turn.csv
  in_c turn u '-DORDER=2 -DTIME=0.002'
  grep -q effect_of c/turn.h
  (($? == 1))
  verdict $? "turn.csv as C: a curve where there is none"
  in_c dead 'u > 1 ? u - 1 : u < -1 ? u + 1 : 0' '-DORDER=2 -DTIME=0.002' --limits 6
  rotor >spin.csv
  in_c spin u '-DORDER=1 -DTIME=0.01 -DFEED -DLARGEST_EFFECT=1.0f -DEFFECT(u)=u -DINPUT(e)=e' --order 1 --limits 1
  rotor 'effect = u * (u > 0 ? u : -u)' >squared.csv
  in_c squared 'u * fabs(u)' \
    '-DORDER=1 -DTIME=0.01 -DFEED -DLARGEST_EFFECT=0.99f -DEFFECT(u)=squared_effect_of(u) -DINPUT(e)=squared_input_for(e)' \
    --order 1 --limits 1
  grep -q 'u is squared_input_for(e) of the effect e' c/squared_profile.h
  verdict $? "squared.csv as C: its comment does not say how"
fi

wait "$pasted"
verdict $? "what $first says does not compile, check or hold the machine: $(cd pasted && head -n 5 errors;
  cat said_all said_wrong said_play; cat pasted.cpp)"

echo "$passed passed, $failed failed"
((failed == 0))
