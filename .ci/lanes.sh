# Functions for .ci/run: lanes that run side by side, and second runs of failed tests. Sourced by bash.
#
# A shared machine can stall a process for longer than a drive waits. A failed test is therefore
# repeated once, when the lanes have ended, and has to pass then. More than MAX_REPEATED of them fail
# the check; more than MAX_REPEATED_STOLEN where the host took a noticeable part of the processor time.
MAX_REPEATED=3
MAX_REPEATED_STOLEN=12
STOLEN_PERCENT=5
RECORDS=$(mktemp -d)
REPEATED=$RECORDS/repeated  # one line for each failed test
SECOND=$RECORDS/second      # one line for each second run: a function and its arguments
touch "$REPEATED" "$SECOND"

# Ticks of all processors since the start of the machine: stolen by its host, and all of them.
ticks() { awk '/^cpu /{for (i = 2; i <= 9; i++) all += $i; print $9, all}' /proc/stat; }
FIRST_TICKS=$(ticks)

# Share of the processor time that the host took since this file was sourced.
stolen_percent() { echo "$FIRST_TICKS $(ticks)" | awk '{d = $4 - $2; print d ? int(100 * ($3 - $1) / d) : 0}'; }
takes_time() { [ "$(stolen_percent)" -ge "$STOLEN_PERCENT" ]; }

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
  # Of the last summary: a failed test may have printed one of its own.
  failed=$(awk '/short test summary info/ {n = 0} /^(FAILED|ERROR) / {one[n++] = $2}
    END {for (i = 0; i < n; i++) print one[i]}' "$log" | sort -u)
  sed "s/^/  $1: /" <<<"${failed:-ended without naming a failed test}" >>"$REPEATED"
  echo "$*" >>"$SECOND"
}

# Run the noted functions again, each with its arguments; fail at the first that fails. Where the host
# took processor time it is run once more.
repeat_failed() {
  local words
  while read -r -a words; do
    printf '\n== %s: repeating what failed\n' "${words[0]}"
    "${words[@]}" </dev/null || { takes_time && "${words[@]}" </dev/null; }
  done <"$SECOND"
}

# Print the repeated tests; fail if there are too many.
report_repeated() {
  local count most=$MAX_REPEATED
  count=$(wc -l <"$REPEATED")
  if takes_time; then most=$MAX_REPEATED_STOLEN; fi
  printf '%s tests needed a second run (at most %s; the host took %s %% of the processor time)\n' \
    "$count" "$most" "$(stolen_percent)"
  cat "$REPEATED"
  [ "$count" -le "$most" ]
}
