// Queue of setpoints that wait for the sending thread.
#include "setpoint_queue.hpp"

#include <chrono>
#include <utility>

namespace robotd {

namespace {
constexpr std::size_t CAPACITY = 64;  // setpoints between two turns of the sending thread
constexpr auto POLL = std::chrono::milliseconds(2);
}  // namespace

SetpointQueue::SetpointQueue(std::vector<double> units, double gap_s)
    : units_(std::move(units)), gap_s_(gap_s), ring_(CAPACITY) {
    for (Setpoint &setpoint : ring_) {
        setpoint.position.resize(units_.size());
        setpoint.velocity.resize(units_.size());
    }
}

void SetpointQueue::put(const double *position, const double *velocity, long long due_ns) {
    {
        std::lock_guard guard(mutex_);
        if (too_early(due_ns)) return;
        waits_for_gap_ = false;
        put_ns_ = due_ns;
        if (count_ == CAPACITY) {  // the sending thread hangs in the engine: the newest counts
            first_ = (first_ + 1) % CAPACITY;
            count_--;
        }
        Setpoint &setpoint = ring_[(first_ + count_++) % CAPACITY];
        setpoint.due_ns = due_ns;
        for (std::size_t axis = 0; axis < units_.size(); axis++) {
            setpoint.position[axis] = position[axis] * units_[axis];
            setpoint.velocity[axis] = velocity[axis] * units_[axis];
        }
    }
    changed_.notify_one();
}

bool SetpointQueue::ignores(long long due_ns) const {
    std::lock_guard guard(mutex_);
    return too_early(due_ns);
}

bool SetpointQueue::too_early(long long due_ns) const {
    return waits_for_gap_ && (due_ns - put_ns_) * 1e-9 <= gap_s_;
}

void SetpointQueue::wait_for_gap() {
    std::lock_guard guard(mutex_);
    count_ = 0;
    waits_for_gap_ = true;
}

void SetpointQueue::restart(bool discard) {
    std::lock_guard guard(mutex_);
    waits_for_gap_ = false;
    if (discard) count_ = 0;
}

bool SetpointQueue::wait(bool polling) {
    std::unique_lock lock(mutex_);
    const auto any = [this] { return count_ > 0 || woken_ || closed_; };
    if (polling) changed_.wait_for(lock, POLL, any);
    else changed_.wait(lock, any);
    woken_ = false;
    return !closed_;
}

bool SetpointQueue::take(Setpoint &setpoint) {
    std::lock_guard guard(mutex_);
    if (count_ == 0) return false;
    setpoint = ring_[first_];
    first_ = (first_ + 1) % CAPACITY;
    count_--;
    return true;
}

void SetpointQueue::wake() {
    std::lock_guard guard(mutex_);
    woken_ = true;
    changed_.notify_one();
}

void SetpointQueue::close() {
    std::lock_guard guard(mutex_);
    closed_ = true;
    changed_.notify_all();
}

bool SetpointQueue::closed() const {
    std::lock_guard guard(mutex_);
    return closed_;
}

}  // namespace robotd
