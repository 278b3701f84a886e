// Position setpoints as commands of the engine's cyclic buffers, sent by a thread of its own.
#pragma once

#include <CyclicBufferApi.h>

#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "deviation.hpp"
#include "native.hpp"
#include "setpoint_queue.hpp"

namespace robotd {

// Between two setpoints runs the cubic through their positions and velocities, one command for
// each cycle of the engine. The buffers are kept `target` cycles full, by sampling the cubics up to
// 1 % faster or slower than the clock. A gap that the buffers cannot bridge ends in rest; from there
// the commands come back to the setpoints within the limits, see Deviation. Where buffers run dry in
// motion without such a gap, setpoints are ignored until there is one (`ran_dry`); likewise where the
// engine stands still, and the buffers become too full.
//
// `put` is for one thread and never waits for the engine; everything else may be called by any
// thread, without the interpreter's lock.
class PositionStream {
public:
    struct Settings {
        std::vector<double> units;         // user units per SI unit
        std::vector<AxisLimits> limits;    // their acceleration is that of a stop, too
        double period_s, buffer_s;
        int priority;   // SCHED_FIFO of the sending thread, 0: as it is
        bool threaded;  // false: `turn` is called instead, where time is simulated
    };
    PositionStream(Device &device, Settings settings);
    ~PositionStream();

    void begin(const std::vector<int> &axes);
    // Ignored while `ran_dry`.
    void put(const double *position, const double *velocity, long long due_ns) {
        queue_.put(position, velocity, due_ns);
    }
    bool ran_dry(long long due_ns) const { return queue_.ignores(due_ns); }
    void stop(const std::vector<int> &axes);
    void quick_stop(const std::vector<int> &axes);
    void close();
    // Sends the oldest setpoint, and ends streams that have come to rest; false without a setpoint.
    bool turn();

    bool active(int axis) const { return states_[axis] != OFF; }
    bool stopping(int axis) const { return states_[axis] == STOPPING; }
    std::string fault() const;
    double rate() const { return rate_; }
    std::size_t axes() const { return axes_.size(); }

private:
    // STOPPING: its last commands are in the buffer.
    enum State { OFF, STREAMING, STOPPING };
    struct Axis {
        double position = 0, velocity = 0;   // of the last setpoint
        double sent = 0, sent_velocity = 0;  // of the last command
        Deviation deviation;
    };

    struct Fill {
        unsigned int depth, room;  // fewest commands that wait in a buffer, and least room
        bool dry;                  // a buffer has executed its last command
    };

    double bridged_s() const;
    void run();
    void send(const Setpoint &setpoint);
    bool try_send(const Setpoint &setpoint);
    unsigned int overfull() const;
    bool begins(const std::vector<int> &axes, const Setpoint &setpoint) const;
    void rejoin(const std::vector<int> &axes, const Setpoint &setpoint, const Fill &fill);
    void sample(const std::vector<int> &axes, const Setpoint &setpoint);
    void hold(const std::vector<int> &axes, unsigned int cycles);
    void add(const std::vector<int> &axes);
    void slow_down(const std::vector<int> &axes);
    void brake(int axis);
    void end_drained();
    void open(const std::vector<int> &axes);
    void slow(int axis);
    void abort(int axis, const CallFailed &failed);
    void report(const std::string &reason);
    Fill look(std::vector<int> &axes);
    std::vector<int> in_state(State state) const;

    Device &device_;
    wmx3Api::CyclicBuffer buffer_;
    const Settings settings_;
    SetpointQueue queue_;
    Setpoint taken_;  // needs no lock: of the sending thread
    std::vector<Axis> axes_, before_;  // before_: of the setpoint before
    std::vector<std::atomic<State>> states_;
    std::vector<bool> open_;
    double cycle_s_ = 0;
    unsigned int target_ = 0;
    long long last_due_ns_ = 0;  // of the last setpoint; 0: none since the streams began
    double start_s_ = 0, sampled_s_ = 0;  // since `last_due_ns_`: of the cubic, of the last command
    double mean_depth_ = 0;
    std::atomic<double> rate_{1.0};
    double wanted_rate_ = 1;  // which `rate_` approaches
    std::vector<wmx3Api::CyclicBufferMultiAxisCommands> commands_;

    std::mutex engine_;  // calls of the engine and everything above
    mutable std::mutex reporting_;
    std::string fault_;  // needs `reporting_`
    std::thread thread_;
};

}  // namespace robotd
