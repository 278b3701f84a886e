# Functions for .ci/run: repeat failed tests once, and count them. Sourced by bash.
#
# A shared machine can stall a process for longer than a drive waits. A failed test is therefore
# repeated once, by itself, and has to pass then. More than MAX_REPEATED of them fail the check.
MAX_REPEATED=3
REPEATED=$(mktemp)  # one line for each repeated test

# once_more LANE ARGUMENT...: run the function LANE; if it fails, run it again with ARGUMENTs.
once_more() {
  local lane=$1 log failed
  log=$(mktemp)
  if "$lane" 2>&1 | tee "$log"; then
    rm -f "$log"
    return
  fi
  failed=$(sed -nE 's/^(FAILED|ERROR) ([^ ]+).*/\2/p' "$log" | sort -u)
  rm -f "$log"
  sed "s/^/  $lane: /" <<<"${failed:-ended without naming a failed test}" >>"$REPEATED"
  printf '\n== %s: repeating what failed\n' "$lane"
  "$@"
}

# Print the repeated tests; fail if there are too many.
report_repeated() {
  local count
  count=$(wc -l <"$REPEATED")
  printf '%s tests needed a second run (at most %s)\n' "$count" "$MAX_REPEATED"
  cat "$REPEATED"
  [ "$count" -le "$MAX_REPEATED" ]
}
