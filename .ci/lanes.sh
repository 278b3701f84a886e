# Functions for .ci/run: commands that are noted when they fail, and lanes side by side. Sourced by bash.
RECORDS=$(mktemp -d)
FAILED=$RECORDS/failed  # one line for each command that failed
SECOND=$RECORDS/second  # one line for each command to be run once more
touch "$FAILED" "$SECOND"
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$RECORDS"' EXIT

section() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

# check COMMAND ARGUMENT...: run it, print what it took, and note it when it fails.
check() {
  local TIMEFORMAT="== $*: %R s, processor time %U s + %S s"
  time "$@" || {
    echo "== FAILED: $*"
    echo "$*" >>"$FAILED"
  }
}

# check_robots COMMAND ARGUMENT...: as above, of tests in real time. What fails is noted for `alone`.
check_robots() {
  local TIMEFORMAT="== $*: %R s, processor time %U s + %S s" word words=()
  time "$@" && return
  for word in "$@"; do [[ $word == *=* ]] || words+=("$word"); done
  # Once: of two commands that differ in ARGS only the second run is the same.
  grep -qxF "${words[*]}" "$SECOND" || echo "${words[*]}" >>"$SECOND"
}

# Run the tests in real time that failed once more, with nothing beside them. They have to pass.
alone() {
  local words
  while read -r -a words; do
    section "${words[*]}: what failed, alone"
    check "${words[@]}" ARGS='--last-failed --last-failed-no-failures=none' WORKERS=0 </dev/null
  done <"$SECOND"
  : >"$SECOND"
}

# side_by_side A B: run two functions at the same time; the output of the second one comes last.
side_by_side() {
  local second
  "$2" >"$RECORDS/$2" 2>&1 &
  second=$!
  "$1" || echo "$1" >>"$FAILED"
  section "$1 has ended; $2:"
  wait "$second" || echo "$2" >>"$FAILED"
  cat "$RECORDS/$2"
}

# Say how the commands went; fail if any of them has.
report() {
  section "$(wc -l <"$FAILED") commands failed"
  cat "$FAILED"
  [ ! -s "$FAILED" ]
}
