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

# side_by_side A B...: run functions at the same time; the output of all but the first one comes last.
side_by_side() {
  local first=$1 lane
  local -A processes
  shift
  for lane; do
    "$lane" >"$RECORDS/$lane" 2>&1 &
    processes[$lane]=$!
  done
  "$first" || echo "$first" >>"$FAILED"
  for lane; do
    section "$lane, beside $first:"
    wait "${processes[$lane]}" || echo "$lane" >>"$FAILED"
    cat "$RECORDS/$lane"
  done
}

# Say how the commands went; fail if any of them has.
report() {
  section "$(wc -l <"$FAILED") commands failed"
  cat "$FAILED"
  [ ! -s "$FAILED" ]
}
