# Functions for .ci/run: commands that are noted when they fail, and lanes side by side. Sourced by bash.
RECORDS=$(mktemp -d)
FAILED=$RECORDS/failed  # one line for each command that failed
touch "$FAILED"
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
