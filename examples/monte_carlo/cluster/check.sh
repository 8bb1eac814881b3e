#!/usr/bin/env bash
# A study in parts gives the figures of the whole, to the last bit: check.sh STUDY [STUDY_MPI]
# By a loop of the shell, GNU parallel and MPI; with a part that was killed, one that was cut off, one
# of another study, one that is missing. The last line is "N passed, N failed".
set -uo pipefail
study=$(realpath "${1:?usage: check.sh STUDY [STUDY_MPI]}")
self=$(realpath "$0")
mpi=${2:+$(realpath "$2")}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
passed=0
failed=0
runs=13000  # four blocks, the last one short

check() {  # check TEXT COMMAND...: must succeed
  local text=$1
  shift
  if "$@"; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    echo "FAILED: $text"
  fi
}
says() {  # says TEXT COMMAND...: ends with exit code 3 and this on stderr
  local text=$1 status=0
  shift
  "$@" >says.out 2>says.err || status=$?
  ((status == 3)) && grep -qF "$text" says.err || { cat says.err && false; }
}
part() { "$study" --runs "$runs" --part "$1" --records "$2" --threads 1 >part.out 2>&1; }
merged() {  # merged FILE...: what it prints is that of the whole
  "$study" merge --runs "$runs" "$@" >merged.txt && cmp merged.txt whole.txt
}

part 0/1 whole
check "the whole" "$study" merge --runs "$runs" whole >whole.txt
check "it has the four figures" test "$(grep -c mean whole.txt)" = 4

for i in 0 1 2; do part "$i/3" "loop$i"; done
check "three parts by a loop" merged loop2 loop0 loop1
check "parts of different cuts" merged loop0 whole loop2
cat loop2 loop0 loop1 >cat
check "three parts in one file" merged cat
cat loop0 loop1 loop0 >twice
check "a part twice in one file" says "records.block = 0: is there twice" "$study" merge --runs "$runs" twice
"$study" --runs 13001 --part 2/3 --records foreign --threads 1 >part.out
cat loop0 loop1 foreign >two_studies
check "one file of two studies" says "records.runs = 13001: must be the number of runs of the study, which is 13000" \
  "$study" merge --runs "$runs" two_studies
says_missing=(says "missing: block 1" "$study" merge --runs "$runs" loop0 loop2)
check "a part is missing" "${says_missing[@]}"
check "it was block 1 alone" test "$(grep -c missing: says.err)" = 1
check "a part of another study" says "records.runs" "$study" merge --runs 13001 loop0 loop1 loop2

# Killed while it computes: after its first record is in the file.
"$study" --runs "$runs" --part 0/1 --records killed --threads 1 >part.out 2>&1 &
for ((i = 0; i < 600; ++i)); do
  ! grep -q '^end ' killed 2>/dev/null || break
  sleep 0.05
done
kill -9 $!
wait $! 2>/dev/null
check "killed in the middle" test "$(grep -c '^end ' killed)" -lt 4
check "it names what is missing" says "missing: block" "$study" merge --runs "$runs" killed
part 0/1 killed
check "and goes on" merged killed

# Cut off by a full disk, in the middle of a record.
head -c "$(($(stat -c %s loop1) - 500))" loop1 >cut
check "a record that is cut off" says "missing: block 1" "$study" merge --runs "$runs" loop0 cut loop2
part 1/3 cut
check "is computed again" merged loop0 cut loop2

check "no such part" says "part.index" "$study" --part 3/3 --records none
check "nor such a file" says "records = 0: must begin" "$study" merge "$self"
check "nor a file that is not there" says "records = 0: cannot be read" "$study" merge nowhere
"$study" replay --runs "$runs" 4711 >run.csv
check "a run alone" test "$(wc -l <run.csv)" = 1001

if command -v parallel >/dev/null; then
  check "GNU parallel" parallel --will-cite -j 2 "$study" --runs "$runs" --part {}/5 \
    --records parallel{} --threads 1 ::: 0 1 2 3 4 >parallel.out
  check "gives the same" merged parallel?
fi
if [[ -n $mpi ]]; then
  for ranks in 1 2 4; do
    mpirun --allow-run-as-root --oversubscribe -np "$ranks" "$mpi" "$runs" >mpi.txt 2>mpi.err
    check "MPI, $ranks ranks" cmp mpi.txt whole.txt
  done
fi

echo "$passed passed, $failed failed"
((failed == 0))
