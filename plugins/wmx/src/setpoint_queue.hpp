// Setpoints between the control loop and the sending thread of a PositionStream.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <vector>

namespace robotd {

// A setpoint of all axes, in user units, to be reached at `due_ns` (monotonic clock).
struct Setpoint {
    long long due_ns = 0;
    std::vector<double> position, velocity;
};

// A bounded queue that allocates nothing after its construction. After `wait_for_gap` it ignores
// setpoints until one comes more than `gap_s` after the last that it took. Any thread may call; only
// `take` waits.
class SetpointQueue {
public:
    // `units`: user units per SI unit of each axis.
    SetpointQueue(std::vector<double> units, double gap_s);

    // SI units. Where the queue is full, the oldest setpoint is dropped.
    void put(const double *position, const double *velocity, long long due_ns);
    // True when a setpoint for `due_ns` would be ignored.
    bool ignores(long long due_ns) const;
    // Drops all setpoints.
    void wait_for_gap();
    // Ignores nothing any more; with `discard` it drops all setpoints, too.
    void restart(bool discard);
    // Waits for a setpoint, `wake` or `close`, and where it is `polling`, 2 ms; false after `close`.
    bool wait(bool polling);
    // Takes the oldest setpoint; false without one.
    bool take(Setpoint &setpoint);
    void wake();
    void close();
    bool closed() const;

private:
    bool too_early(long long due_ns) const;

    const std::vector<double> units_;
    const double gap_s_;
    mutable std::mutex mutex_;  // of what follows
    std::condition_variable changed_;
    std::vector<Setpoint> ring_;
    std::size_t first_ = 0, count_ = 0;
    long long put_ns_ = 0;  // due time of the last setpoint that was taken
    bool waits_for_gap_ = false;
    bool woken_ = false, closed_ = false;
};

}  // namespace robotd
