#!/usr/bin/env bash
# What a law does not use is not an instruction more: no_map_test.sh COMPILER
# The seams of MappedInput, Resting and VariableTime::elapsed are taken out of a copy of the headers.
# GCC has to make the same code of controllers, compensators and monitors with them and without, but
# for what is called where the law does not determine u: there a rest is a comparison.
set -euo pipefail
compiler=${1:?usage: no_map_test.sh COMPILER}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cp -r "$root/include" without
grep -rlE 'detail::(effect_of|input_for)\(observer' without/esokit/control |
  xargs sed -i -E 's/detail::(effect_of|input_for)\(observer(_|\(\))?, /(/'
sed -i -E '/^ *(pass_pause\(drive\)|if \(too_soon\(\)\) return output\(\)|if constexpr \(has_step_time\) steps_\.asked = 0|if \(mode_ == LoopMode::rest\) return output\(\));$/d
  s/if \(!too_soon\(\)\) observe_/observe_/' without/esokit/control/control_loop.hpp
seams=$(diff -r "$root/include" without | grep -c '^<') || true
((seams >= 15)) || { echo "only $seams seams are found: has their text changed?"; exit 1; }
if grep -rnE '(effect_of|input_for)\(observer|^ *if \(too_soon|LoopMode::rest\) return' without/esokit/control; then
  echo "a seam that is not taken out"
  exit 1
fi

cat >laws.cpp <<'END'
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
using namespace esokit;
using Law = Adrc<LinearEso<2>>;
using Held = Adrc<Guarded<LinearEso<1, float>>, ErrorBased>;
using Sum = DisturbanceCompensator<DelayedInput<LinearEso<1>, 4>>;
using Foretold = PredictiveAdrc<LinearEso<2>>;
double law(Law& c, double y, double r) { return c.update(y, r); }
double moving(Law& c, double y, const Law::Reference& r) { return c.update(y, r); }
double lost(Law& c, double r) { return c.update_without_measurement(r); }
auto applied(Law& c, double u) { return c.applied(u); }
auto start(Law& c, double y, double u) { return c.start(y, u); }
float held(Held& c, float y, float r) { return c.update(y, r); }
double sum(Sum& c, double y, double r) { return c.update(y, r); }
double base(const Sum& c) { return c.base_output(); }
double foretold(Foretold& c, double y, double r) { return c.update(y, r); }
void watch(HealthMonitor<3>& m, const Law& c) { m.look(c); }
END
# Each instruction behind the name of its function. Numbers of labels count functions that are
# inlined, too.
code() {
  "$compiler" -std=c++20 -O2 -I "$1" -S -o - laws.cpp |
    awk '/^[A-Za-z_][^ ]*:$/ { name = $0 }
         /^\t[a-z]/ && name !~ /12other_output/ { gsub(/\.L[A-Z]*[0-9]+/, ".L"); print name $0 }' |
    sort -s -k 1,1
}
code "$root/include" >with.s
code without >without.s
(($(wc -l <with.s) > 1000))
diff with.s without.s >difference || {
  echo "laws without a map, a rest or a pause differ by $(wc -l <difference) lines of code:"
  head -n 20 difference
  exit 1
}
echo "$(wc -l <with.s) instructions, equal without the $seams seams"
