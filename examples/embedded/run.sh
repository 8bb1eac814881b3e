#!/usr/bin/env bash
# Builds the firmware of this folder for four microcontrollers, runs it in an emulator, compares it
# with the host, checks what was linked, and compares the tables of README.md. See usage below.
set -euo pipefail
folder=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
root=$(cd -- "$folder/../.." && pwd)

usage() {
  cat <<'END'
usage: examples/embedded/run.sh [--no-install] [--write | --self-test | --paste]

  --no-install   do not install missing Debian packages, only name them (status 3)
  --write        write what the code has changed instead of comparing it: firmware/pasted.hpp, the
                 tables of README.md and the numbers that other pages take from them
  --self-test    instead: see the checks refuse what they are there to refuse
  --paste        instead: write firmware/pasted.hpp, the design that the host makes
  --help         this text

The last line is "N passed, N failed"; the status is 0 only if nothing failed.
END
}

no_install=()
self_test=no
paste=no
write=no
for option in "$@"; do
  case $option in
    --no-install) no_install=(--no-install) ;;
    --write) write=yes ;;
    --self-test) self_test=yes ;;
    --paste) paste=yes ;;
    -h | --help)
      usage
      exit 0
      ;;
    *)
      echo "run.sh: unknown option $option" >&2
      usage >&2
      exit 2
      ;;
  esac
done

# shellcheck source=cmake/debian_packages.sh
source "$root/cmake/debian_packages.sh"
require_packages ${no_install[@]+"${no_install[@]}"} "${ESOKIT_BUILD_PACKAGES[@]}" \
  "${ESOKIT_FIRMWARE_PACKAGES[@]}"

cores=(cortex-m4f cortex-m7 cortex-m0plus riscv32)
declare -A title=([cortex-m4f]="Cortex-M4F" [cortex-m7]="Cortex-M7"
  [cortex-m0plus]="Cortex-M0+ (soft float)" [riscv32]="RV32IMAFC")
declare -A binutils=([cortex-m4f]=arm-none-eabi- [cortex-m7]=arm-none-eabi-
  [cortex-m0plus]=arm-none-eabi- [riscv32]=riscv64-unknown-elf-)
# Of the M0+ QEMU has no board; the micro:bit's M0 knows the same instructions.
declare -A emulator=([cortex-m4f]="qemu-system-arm -M mps2-an386"
  [cortex-m7]="qemu-system-arm -M mps2-an500" [cortex-m0plus]="qemu-system-arm -M microbit"
  [riscv32]="qemu-system-riscv32 -M virt -bios none")
observers=(LinearEso CascadeEso AlgebraicEso AdjustableBandwidthEso NonlinearEso
  ExtendedStateFilter-frozen ExtendedStateFilter-recursive)
declare -A shown=([LinearEso]="LinearEso<2>" [CascadeEso]="CascadeEso<2, 3>"
  [AlgebraicEso]="AlgebraicEso<2>" [AdjustableBandwidthEso]="AdjustableBandwidthEso<2>"
  [NonlinearEso]="NonlinearEso<2> (m = 2)"
  [ExtendedStateFilter-frozen]="ExtendedStateFilter<2>, frozen"
  [ExtendedStateFilter-recursive]="ExtendedStateFilter<2>, recursive")
controllers=(Adrc AdrcLimited MimoAdrc)
shown+=([Adrc]="Adrc<LinearEso<2>>" [AdrcLimited]="the same, u limited in its rate, too"
  [MimoAdrc]="MimoAdrc of two LinearEso<2>")
models=(MotorLag1 MotorLag2 SensorLag1 SensorLag2 Resonator)
shown+=([MotorLag1]="a motor lag, order 1" [MotorLag2]="a motor lag, order 2"
  [SensorLag1]="a sensor lag, order 1" [SensorLag2]="a sensor lag, order 2"
  [Resonator]="a resonator, order 2")
clocks=(48 72 168)  # MHz

out=$root/build/firmware
mkdir -p "$out"
jobs=${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}
passed=0
failed=0

pass() { passed=$((passed + 1)); }
fail() {
  failed=$((failed + 1))
  echo "FAILED $*"
}

finish() {
  echo "$passed passed, $failed failed"
  ((failed == 0 && passed > 0))
  exit
}

# build PRESET TARGET...
build() {
  local preset=$1 log=$out/build-$1.log
  shift
  if (cd "$root" && cmake --preset "$preset" && cmake --build --preset "$preset" \
    --parallel "$jobs" --target "$@") >"$log" 2>&1; then
    return 0
  fi
  grep -vE '^(: && )?/[^ ]*(g\+\+|gcc) ' "$log" | tail -n 40
  return 1
}

image() { echo "$root/build/$1/examples/embedded/$2"; }

# run PRESET IMAGE OUTPUT: each instruction takes 1024 ns of the emulated clock.
run() {
  # shellcheck disable=SC2086
  timeout 60 ${emulator[$1]} -nographic -monitor none -serial none -net none \
    -semihosting-config enable=on,target=native -icount shift=10,align=off,sleep=off \
    -kernel "$(image "$1" "$2").elf" </dev/null >"$3" 2>&1
}

# linked PRESET FILE: one line "KIND what" for each thing that has no place in an image or object.
# Except what a C library needs for itself: picolibc rounds the results of its errors from double.
linked() {
  local file=$2
  : >"$out/needed_by_picolibc"
  if [[ -e $file.map ]]; then
    awk '/^Discarded input sections|^Memory Configuration/ { exit }
      /picolibc.*\(__[a-z0-9_]*\)$/ { sub(/.*\(/, ""); sub(/\)$/, ""); print }' "$file.map" \
      >"$out/needed_by_picolibc"
  fi
  "${binutils[$1]}nm" "$file" | awk '{ print $NF }' | sort -u | grep -vxFf "$out/needed_by_picolibc" |
    awk '
    # The heap, under its C, C++ and newlib names.
    /^_?(malloc|calloc|realloc|free|memalign)(_r)?$|^_?sbrk(_r)?$|^_Zn[wa]|^_Zd[la]/ { print "heap", $0 }
    # The unwinder, the personality, and what throws.
    /^__gxx_personality|^_Unwind_|^__aeabi_unwind|^__cxa_(throw|rethrow|begin_catch|allocate_exc)/ {
      print "exceptions", $0
    }
    # Arithmetic and functions in double. sf: between single and double.
    /^__aeabi_(c?d[a-z]|i2d|ui2d|l2d|ul2d|f2d)/ || /^__[a-z]*df[a-z0-9]*$/ || /^__(mul|div)dc3$/ ||
    /^(__ieee754_)?(exp|expm1|log|log1p|pow|sqrt|sin|cos|tanh|floor|ceil|fabs|rint|scalbn)$/ {
      print "doubles", $0
    }
    # printf and the streams.
    /ios_base|^_ZSt4c(out|err|in)$|^_ZNS[oi]|printf(_r)?$|^(puts|fputs|fwrite)$/ {
      print "text", $0
    }
    # Code that would have to run before main.
    /^_GLOBAL__sub_I|^__cxa_guard_acquire$|^__cxa_atexit$|^atexit$/ { print "constructors", $0 }'
  "${binutils[$1]}size" -A "$file" | awk '
    $1 ~ /^\.(init_array|preinit_array|ctors)$/ && $2 > 0 { print "constructors", $1, $2, "bytes" }
    $1 ~ /^\.(ARM\.extab|gcc_except_table)$/ && $2 > 0 { print "exceptions", $1, $2, "bytes" }'
}
kinds=(heap exceptions doubles text constructors)

# text_bytes PRESET IMAGE: code and constants without board and output, from the link map.
text_bytes() {
  local map file
  map=$(image "$1" "$2").elf.map
  file=$(image "$1" "$2").elf
  awk '
    function hex(text,  i, value) {
      for (i = 3; i <= length(text); ++i) {
        value = value * 16 + index("0123456789abcdef", substr(text, i, 1)) - 1
      }
      return value
    }
    /^Linker script and memory map/ { inside = 1 }
    !inside { next }
    /^ \.(text|rodata|vectors)[^ ]*$/ { held = 1; next }
    /^ \.(text|rodata|vectors)[^ ]* +0x/ { add($3, $4) }
    held && /^ +0x/ { add($2, $3) }
    { held = 0 }
    function add(size, object) { if (object ~ /(board_[a-z_]*|output)\.cpp/) runtime += hex(size) }
    END { print runtime + 0 }' "$map" >"$out/runtime"
  "${binutils[$1]}size" "$file" | awk -v runtime="$(<"$out/runtime")" 'NR == 2 { print $1 - runtime }'
}

# written_bytes PRESET NAME: flash of a C file without its self-test
written_bytes() {
  find "$root/build/$1" -path '*written_*objects*' -name "$2.c.obj" \
    -exec "${binutils[$1]}size" -A {} + | awk '
    ($1 ~ /^\.(text|rodata)/) && $1 !~ /self_test|samples|called|calls/ { bytes += $2 }
    END { print bytes + 0 }'
}

# object PRESET NAME: of the image as built
object() {
  find "$root/build/$1/examples/embedded" \( -path "*firmware_o[bt]*" -o -path "*controllers.dir*" \
    -name "controller*" \) -name "$2.cpp.obj"
}

# measures PRESET OBJECT: a line "UPDATE code guarded stack deepest" for each update function. Code and stack
# are those of the function with all it calls, but for the guarded path of bad samples, which is the
# second number and in the deepest stack. The C library and the soft-float helpers are in none.
measures() {
  local updates
  updates=$(object "$1" "$2")
  { "${binutils[$1]}nm" -S -t d "$updates" | awk 'NF == 4 { print "size", $4, $2 + 0 }'
    cat "${updates%.obj}.ci"; } | awk '
    function name(text) { sub(/^"/, "", text); sub(/"$/, "", text); sub(/.*:/, "", text); return text }
    function walk(f,  i, list, count, below, deepest) {
      if (!(f in seen)) { seen[f] = 1; total += size[f] + size[f ".cold"] }
      count = split(calls[f], list, " ")
      for (i = 1; i <= count; ++i) {
        if (f == list[i] || (!with_guarded && list[i] ~ /update_guarded/)) continue
        below = walk(list[i])
        if (below > deepest) deepest = below
      }
      return stack[f] + deepest
    }
    $1 == "size" { size[$2] = $3; next }
    $1 == "node:" {
      f = name($4)
      if (match($0, /[0-9]+ bytes \(/)) stack[f] = substr($0, RSTART, RLENGTH - 8) + 0
      if (f ~ /^update_[A-Z]/) updates[++number] = f
    }
    $1 == "edge:" { calls[name($4)] = calls[name($4)] " " name($6) }
    END {
      for (n = 1; n <= number; ++n) {
        with_guarded = 0; total = 0; split("", seen); plain = walk(updates[n]); code = total
        with_guarded = 1; total = 0; split("", seen); deep = walk(updates[n])
        print updates[n], code, total - code, plain, deep
      }
    }'
}

# value FILE KIND NAME COLUMN: of a line that the firmware printed
value() { awk -v kind="$2" -v name="$3" -v c="$4" '$1 == kind && $2 == name { print $c }' "$1"; }

# limit WHAT NUMBER MOST
limit() {
  if [[ $2 =~ ^[0-9]+$ ]] && (($2 > 0 && $2 <= $3)); then
    pass
    echo "ok     $1: $2, at most $3"
  else
    fail "$1: $2, at most $3"
  fi
}

# compare PRESET IMAGE [--exact]
compare() {
  local line reference=host
  [[ $2 != drive* ]] || reference=host-drive
  while IFS= read -r line; do
    if [[ $line == ok* ]]; then pass; else fail "$1, $2: ${line#FAILED }"; fi
  done < <("$(image firmware-host compare_runs)" ${3+"$3"} "$out/$reference.txt" "$out/$1-$2.txt")
}

# check_links PRESET FILE
check_links() {
  local kind found all
  if [[ ! -s $2 ]]; then
    fail "$1: there is no $2"
    return
  fi
  all=$(linked "$1" "$2")
  for kind in "${kinds[@]}"; do
    found=$(grep "^$kind " <<<"$all" | head -n 5 | tr '\n' ';') || true
    if [[ -z $found ]]; then pass; else fail "$1, $(basename -- "$2") links $found"; fi
  done
}

# with_table PAGE TABLE: the page with these tables
with_table() {
  awk -v table="$2" '
    /^<!-- table/ { print; while ((getline line < table) > 0) print line; print ""; inside = 1 }
    /^<!-- end of table/ { inside = 0 }
    !inside' "$1"
}

host_run() {
  mkdir -p "$out/written" &&
    build firmware-host firmware_exact drive compare_runs write_c fixed_bounds &&
    "$(image firmware-host write_c)" "$out/written" &&
    "$(image firmware-host firmware_exact)" >"$out/host.txt" </dev/null &&
    "$(image firmware-host drive)" >"$out/host-drive.txt" </dev/null
}

if [[ $paste == yes || $write == yes ]]; then
  build firmware-host print_pasted
  "$(image firmware-host print_pasted)" >"$out/pasted.hpp"
  cp "$out/pasted.hpp" "$folder/firmware/pasted.hpp"
  ! command -v clang-format-14 >/dev/null || clang-format-14 -i "$folder/firmware/pasted.hpp"
  echo "written: $folder/firmware/pasted.hpp"
  [[ $write == yes ]] || exit 0
fi

if [[ $self_test == yes ]]; then
  images=("${kinds[@]/#/violates_}")
  if host_run && build cortex-m4f firmware "${images[@]}"; then pass; else
    fail "the host's run or the images to refuse"
    finish
  fi
  for kind in "${kinds[@]}"; do
    found=$(linked cortex-m4f "$(image cortex-m4f "violates_$kind").elf" | grep "^$kind ") || true
    if [[ -n $found ]]; then
      pass
      echo "ok     refused: $(head -n 3 <<<"$found" | tr '\n' ';')"
    else
      fail "an image with $kind is not refused"
    fi
  done
  # The last bit of one estimate, a run that breaks off, a controller gone elsewhere.
  sed -E '/^open CascadeEso 207 /s/[0-7]$/f/; t; /^open CascadeEso 207 /s/[89a-f]$/0/' \
    "$out/host.txt" >"$out/bit.txt"
  grep -v '^done' "$out/host.txt" >"$out/short.txt"
  sed -E '/^closed LinearEso 399 /s/[^ ]+$/41a00000/' "$out/host.txt" >"$out/elsewhere.txt"
  for run in bit short elsewhere; do
    if "$(image firmware-host compare_runs)" --exact "$out/host.txt" "$out/$run.txt" \
      >"$out/compare.txt"; then
      fail "compare_runs accepts $run.txt"
    else
      pass
      echo "ok     refused: $(grep FAILED "$out/compare.txt")"
    fi
  done
  before=$failed
  limit "exceeded" 43 42 >"$out/limits.txt"
  limit "without a number" "" 42 >>"$out/limits.txt"
  if ((failed == before + 2)); then
    failed=$before
    pass
    sed 's/^FAILED/ok     refused: a limit that is/' "$out/limits.txt"
  else
    fail "a limit does not bind"
  fi
  # A page with another number.
  sed '/^| LinearEso<2> /s/[0-9][0-9]* |$/1 |/' "$folder/README.md" >"$out/stale.md"
  sed -n '/^<!-- table/,/^<!-- end of table/p' "$folder/README.md" | sed '1d;$d' | sed '$d' >"$out/stale_table.md"
  if with_table "$folder/README.md" "$out/stale_table.md" | cmp -s - "$folder/README.md" &&
    ! with_table "$out/stale.md" "$out/stale_table.md" | cmp -s - "$out/stale.md"; then
    pass
    echo "ok     refused: a page whose table is not that of the run"
  else
    fail "a page with another number in its table is not refused"
  fi
  finish
fi

started=$SECONDS
if host_run; then pass; else
  fail "the firmware on the host; is firmware/pasted.hpp of this version (run.sh --paste)?"
  grep -m 3 -E '^(refused|astray)' "$out/host.txt" || true
  finish
fi
# A design that was pasted runs as the one that is made.
if diff <(sed -n 's/^open pasted //p' "$out/host.txt") \
  <(sed -n 's/^open ExtendedStateFilter-frozen //p' "$out/host.txt") >"$out/pasted.diff" &&
  grep -q '^open pasted' "$out/host.txt"; then pass; else
  fail "the pasted observer does not run as the made one (run.sh --paste writes it anew):"
  head -n 4 "$out/pasted.diff"
fi
built=()
for core in "${cores[@]}"; do
  echo "building for $core, $((SECONDS - started)) s"
  # Without a floating-point unit nothing is fused, and there is one image.
  images=(firmware drive drive_make controllers written_c written_fixed fixed_drive)
  [[ $core == cortex-m0plus ]] || images+=(firmware_exact)
  [[ $core != cortex-m4f ]] || images+=(firmware_others)
  if build "$core" "${images[@]}"; then
    pass
    built+=("$core")
  else
    fail "$core does not build"
  fi
done
echo "built in $((SECONDS - started)) s"

# Without QEMU: an 8-bit core, whose int has 16 bits. simavr colours what comes by the serial port.
if avr-gcc -mmcu=atmega328p -std=gnu99 -Os -DESO_FIXED_SELF_TEST -DESO_FIXED16_SELF_TEST \
  -DLOOP_FIXED_SELF_TEST -I "$out/written/avr" -o "$out/avr.elf" "$folder/firmware/avr_fixed.c" \
  "$out"/written/avr/{eso_fixed,eso_fixed16,loop_fixed}.c; then
  pass
  timeout 60 simavr -m atmega328p -f 16000000 "$out/avr.elf" 2>&1 |
    sed 's/\x1b\[[0-9;]*m//g; s/\.$//' >"$out/avr.txt" || true
else
  fail "the C in integers for the AVR"
  : >"$out/avr.txt"
fi

for core in ${built[@]+"${built[@]}"}; do
  for image in firmware firmware_exact drive drive_make controllers written_c written_fixed \
    fixed_drive; do
    [[ $core-$image != cortex-m0plus-firmware_exact ]] || continue
    if run "$core" "$image" "$out/$core-$image.txt"; then pass; else
      fail "$core, $image: status $? in the emulator; the end of what it said:"
      tail -n 5 "$out/$core-$image.txt"
    fi
  done
  if [[ $core == cortex-m0plus ]]; then
    compare "$core" firmware --exact
  else
    compare "$core" firmware_exact --exact
    compare "$core" firmware
  fi
  for image in drive drive_make; do compare "$core" "$image"; done
  for image in firmware drive drive_make controllers written_c written_fixed fixed_drive; do
    check_links "$core" "$(image "$core" "$image").elf"
  done
  [[ $core != cortex-m4f ]] || check_links "$core" "$(object "$core" others)"
  { measures "$core" updates; measures "$core" controller_updates; } >"$out/$core.measures"
done

{
  for core in ${built[@]+"${built[@]}"}; do
    runs=$out/$core-firmware.txt
    echo
    echo "**${title[$core]}**"
    echo
    echo "| float, -O2 | code | guarded path | state | stack | deepest | instructions | at most |"
    echo "|---|---:|---:|---:|---:|---:|---:|---:|"
    for observer in "${observers[@]}"; do
      read -r _ code guarded stack deepest < <(grep "^update_${observer%-*} " "$out/$core.measures") ||
        code=- guarded=- stack=- deepest=-
      echo "| ${shown[$observer]} | $code | $guarded | $(value "$runs" size "$observer" 3) |" \
        "$stack | $deepest | $(value "$runs" count "$observer" 3) | $(value "$runs" count "$observer" 4) |"
    done
  done
  echo
  echo "**Images**, bytes of flash: all that runs here, and \`drive.cpp\` alone"
  echo
  echo "| | everything | drive, from a snapshot | drive, with make | make takes |"
  echo "|---|---:|---:|---:|---:|"
  for core in ${built[@]+"${built[@]}"}; do
    snapshot=$(text_bytes "$core" drive) made=$(text_bytes "$core" drive_make)
    echo "| ${title[$core]} | $(text_bytes "$core" firmware) | $snapshot | $made | $((made - snapshot)) |"
  done
  echo
  echo "**Controllers**, the whole step: law, limits and observer. Microseconds are the most instructions" \
    "by the clock (MHz), one a cycle"
  echo
  echo "| float, -O2 | code | guarded path | state | stack | deepest | instructions | at most |$(printf ' %s MHz |' "${clocks[@]}")"
  echo "|---|---:|---:|---:|---:|---:|---:|---:|$(printf -- '---:|%.0s' "${clocks[@]}")"
  for core in ${built[@]+"${built[@]}"}; do
    runs=$out/$core-controllers.txt
    for controller in "${controllers[@]}"; do
      read -r _ code guarded stack deepest < <(grep "^update_$controller " "$out/$core.measures") ||
        code=- guarded=- stack=- deepest=-
      most=$(value "$runs" count "$controller" 4)
      echo "| ${title[$core]}: ${shown[$controller]} | $code | $guarded | $(value "$runs" size "$controller" 3) |" \
        "$stack | $deepest | $(value "$runs" count "$controller" 3) | $most |$(for clock in "${clocks[@]}"; do
          awk -v n="$most" -v f="$clock" 'BEGIN { printf " %.3g us |", n / f }'; done)"
    done
  done
  echo
  echo "**Observers with a model** (\`ModelEso\`), instructions of \`update\`"
  echo
  echo "| in the model |$(for core in ${built[@]+"${built[@]}"}; do printf ' %s |' "${title[$core]}"; done)"
  echo "|---|$(for core in ${built[@]+"${built[@]}"}; do printf -- '---:|'; done)"
  for model in "${models[@]}"; do
    echo "| ${shown[$model]} |$(for core in ${built[@]+"${built[@]}"}; do
      printf ' %s |' "$(value "$out/$core-controllers.txt" count "$model" 3)"; done)"
  done
  echo
  echo "**The C of \`to_c\`**, -Os, \`max_gap\` 10: bytes of flash with all its functions, bytes of state, and" \
    "instructions of \`update\`; 10,000 samples equal those of the host bit for bit"
  echo
  echo "| | LinearEso<2> | state | instructions | Adrc<LinearEso<2>> | state | instructions |"
  echo "|---|---:|---:|---:|---:|---:|---:|"
  for core in ${built[@]+"${built[@]}"}; do
    row="| ${title[$core]} |"
    for name in eso loop; do
      row+=" $(written_bytes "$core" $name) | $(value "$out/$core-written_c.txt" size $name 3) |"
      row+=" $(value "$out/$core-written_c.txt" count $name 3) |"
    done
    echo "$row"
  done
  echo
  echo "**The C of \`to_fixed_c\`**, in integers: y of 12 bits, u of 1000 counts, -Os, \`max_gap\` 10; bytes of" \
    "flash, bytes of state, and instructions of \`update\`; each sample equals those of the host"
  echo
  echo "| | LinearEso<2> | state | instructions | with an innovation of 16 bits | with settings in a struct | Adrc<LinearEso<2>>, both limits | state | instructions |"
  echo "|---|---:|---:|---:|---:|---:|---:|---:|---:|"
  for core in ${built[@]+"${built[@]}"}; do
    runs=$out/$core-written_fixed.txt
    echo "| ${title[$core]} | $(written_bytes "$core" eso_fixed) | $(value "$runs" size eso_fixed 3) |" \
      "$(value "$runs" count eso_fixed 3) | $(value "$runs" count eso_fixed16 3) | $(value "$runs" count eso_open 3) |" \
      "$(written_bytes "$core" loop_fixed) | $(value "$runs" size loop_fixed 3) | $(value "$runs" count loop_fixed 3) |"
  done
  echo
  echo "On an ATmega328P (\`max_gap\` 2, -Os, simavr): $(value "$out/avr.txt" count eso_fixed 3) cycles," \
    "$(value "$out/avr.txt" count eso_fixed16 3) with 16 bits, $(value "$out/avr.txt" count loop_fixed 3) for the controller"
  echo
  echo "**What rounding does at most** to the disturbance of \`LinearEso<2>\`, as a share of what half a count" \
    "of y does"
  echo
  "$(image firmware-host fixed_bounds)"
} >"$out/table.md"
cat "$out/table.md"
echo

for core in cortex-m4f cortex-m7; do
  runs=$out/$core-firmware.txt
  code=$(awk '$1 == "update_LinearEso" { print $2 }' "$out/$core.measures")
  limit "$core: instructions of LinearEso<2>" "$(value "$runs" count LinearEso 4)" 36
  limit "$core: code bytes of LinearEso<2>" "$code" 200
  limit "$core: state bytes of LinearEso<2>" "$(value "$runs" size LinearEso 3)" 60
  limit "$core: instructions of CascadeEso<2, 3>" "$(value "$runs" count CascadeEso 4)" 84
  limit "$core: most instructions of AlgebraicEso<2>" "$(value "$runs" count AlgebraicEso 4)" 260
  limit "$core: instructions of Adrc<LinearEso<2>>" "$(value "$out/$core-controllers.txt" count Adrc 4)" 76
  limit "$core: instructions of MimoAdrc" "$(value "$out/$core-controllers.txt" count MimoAdrc 4)" 203
  limit "$core: bytes of the C of LinearEso<2>" "$(written_bytes "$core" eso)" 921
  limit "$core: bytes of the C of Adrc<LinearEso<2>>" "$(written_bytes "$core" loop)" 1401
  limit "$core: instructions of the C of LinearEso<2>" \
    "$(value "$out/$core-written_c.txt" count eso 3)" 50
  # The step of Adrc stands where it is called, in each of its forms: faster by 3 %, larger by 6 KB in all.
  limit "$core: bytes of the whole image" "$(text_bytes "$core" firmware)" 77824
done

# The C in integers: LinearEso, with 16 bits, Adrc, LinearEso with settings in a struct.
declare -A most_fixed=([cortex-m4f]="50 50 170 105" [cortex-m7]="50 50 170 105"
  [cortex-m0plus]="70 50 170 105" [riscv32]="70 70 170 105")
for core in ${built[@]+"${built[@]}"}; do
  read -r -a most <<<"${most_fixed[$core]}"
  names=(eso_fixed eso_fixed16 loop_fixed eso_open)
  for i in 0 1 2 3; do
    limit "$core: instructions of ${names[i]}" \
      "$(value "$out/$core-written_fixed.txt" count "${names[i]}" 3)" "${most[i]}"
  done
done

limit "AVR: cycles of eso_fixed" "$(value "$out/avr.txt" count eso_fixed 3)" 1100
if grep -q '^done' "$out/avr.txt"; then pass; else fail "the C in integers differs on the AVR"; fi

# The page says what this run measured.
with_table "$folder/README.md" "$out/table.md" >"$out/README.md"
if cmp -s "$out/README.md" "$folder/README.md"; then
  pass
elif [[ $write == yes ]] && ((${#built[@]} == ${#cores[@]})); then  # a complete table
  cp "$out/README.md" "$folder/README.md"
  echo "note: the tables of examples/embedded/README.md were written"
  "$root/examples/common/check_readme.py" --pages --write "$root"/{,examples/*/}*.md || fail "see above"
else
  fail "the tables of examples/embedded/README.md are not those of this run; with --write they are:"
  diff "$folder/README.md" "$out/README.md" | head -n 20 || true
fi
echo "all in $((SECONDS - started)) s"
finish
