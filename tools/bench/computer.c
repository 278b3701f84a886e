/* What every program pays on this computer, before it does anything:
 *
 *     computer
 *
 * Prints JSON: processor time of a sleep of 2 ms with its wake-up, how late that is, and the time
 * of a load from memory that no cache holds. Medians.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define PERIOD_NS 2000000L
#define WAKE_UPS 500
#define CELLS (1u << 23) /* of 8 bytes: 64 MiB, more than the caches of today's processors share out */
#define LOADS 200000
#define ROUNDS 9

static long now_ns(clockid_t clock) {
  struct timespec time;
  clock_gettime(clock, &time);
  return time.tv_sec * 1000000000L + time.tv_nsec;
}

static int compare(const void *left, const void *right) {
  long a = *(const long *)left, b = *(const long *)right;
  return (a > b) - (a < b);
}

static long median(long *values, size_t count) {
  qsort(values, count, sizeof *values, compare);
  return values[count / 2];
}

static void sleep_until(long time_ns) {
  struct timespec time = {time_ns / 1000000000L, time_ns % 1000000000L};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL) == EINTR) {
  }
}

static void wake_up(long *cost_ns, long *lateness_ns) {
  static long costs[WAKE_UPS], latenesses[WAKE_UPS];
  long due_ns = now_ns(CLOCK_MONOTONIC), used_ns = now_ns(CLOCK_THREAD_CPUTIME_ID);
  for (int i = 0; i < WAKE_UPS; i++) {
    sleep_until(due_ns += PERIOD_NS);
    latenesses[i] = now_ns(CLOCK_MONOTONIC) - due_ns;
    long until_now_ns = now_ns(CLOCK_THREAD_CPUTIME_ID);
    costs[i] = until_now_ns - used_ns;
    used_ns = until_now_ns;
  }
  *cost_ns = median(costs, WAKE_UPS);
  *lateness_ns = median(latenesses, WAKE_UPS);
}

/* Follows one cycle through all cells in random order (Sattolo's shuffle): each load waits for the
 * one before it, and no prefetcher knows where it leads. */
static double load(void) {
  static long times_ns[ROUNDS];
  size_t *next = malloc(CELLS * sizeof *next);
  uint64_t state = 88172645463325252u;
  if (next == NULL) exit(1);
  for (size_t i = 0; i < CELLS; i++) next[i] = i;
  for (size_t i = CELLS - 1; i > 0; i--) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17; /* xorshift64 */
    size_t j = state % i, cell = next[i];
    next[i] = next[j];
    next[j] = cell;
  }
  volatile size_t cell = 0;
  for (int round = 0; round < ROUNDS; round++) {
    size_t at = cell;
    long start_ns = now_ns(CLOCK_MONOTONIC);
    for (int i = 0; i < LOADS; i++) at = next[at];
    cell = at;
    times_ns[round] = now_ns(CLOCK_MONOTONIC) - start_ns;
  }
  free(next);
  return (double)median(times_ns, ROUNDS) / LOADS;
}

int main(void) {
  long cost_ns, lateness_ns;
  wake_up(&cost_ns, &lateness_ns);
  printf("{\"wake_up_us\": %.1f, \"wake_up_late_us\": %.1f, \"memory_ns\": %.0f}\n",
         (double)cost_ns / 1000.0, (double)lateness_ns / 1000.0, load());
  return 0;
}
