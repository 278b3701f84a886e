# Functions for .ci/run: lanes that run side by side, and second runs of failed tests. Sourced by bash.
#
# A shared machine can stall a process for longer than a drive waits. A failed test is therefore
# repeated once, when the lanes have ended, and has to pass then. More than MAX_REPEATED of them fail
# the check.
MAX_REPEATED=3
RECORDS=$(mktemp -d)
REPEATED=$RECORDS/repeated  # one line for each failed test
SECOND=$RECORDS/second      # one line for each second run: a function and its arguments
touch "$REPEATED" "$SECOND"

section() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

# side_by_side A B: run two functions at the same time; the output of the second one comes last.
# An error ends the function, and fails this one when both have ended.
side_by_side() {
  local second status=0
  "$2" >"$RECORDS/$2" 2>&1 &
  second=$!
  "$1" &
  wait $! || status=$?
  section "$1 has ended; $2:"
  wait "$second" || status=$?
  cat "$RECORDS/$2"
  return "$status"
}

# attempt FUNCTION ARGUMENT...: run it without arguments; note its failed tests for a second run.
attempt() {
  local log=$RECORDS/$1.log failed began=$SECONDS
  if "$1" 2>&1 | tee "$log"; then
    printf '== %s passed in %s s\n' "$1" "$((SECONDS - began))"
    return
  fi
  failed=$(sed -nE 's/^(FAILED|ERROR) ([^ ]+).*/\2/p' "$log" | sort -u)
  sed "s/^/  $1: /" <<<"${failed:-ended without naming a failed test}" >>"$REPEATED"
  echo "$*" >>"$SECOND"
}

# Run the noted functions again, each with its arguments; fail at the first that fails.
repeat_failed() {
  local words
  while read -r -a words; do
    printf '\n== %s: repeating what failed\n' "${words[0]}"
    "${words[@]}" </dev/null
  done <"$SECOND"
}

# Print the repeated tests; fail if there are too many.
report_repeated() {
  local count
  count=$(wc -l <"$REPEATED")
  printf '%s tests needed a second run (at most %s)\n' "$count" "$MAX_REPEATED"
  cat "$REPEATED"
  [ "$count" -le "$MAX_REPEATED" ]
}
