// Simulated time: the engine runs in the process of the test, as far as that asks it to.
//
// Time is a number. What a call of the SDK waits for comes while the hook of the test lets time pass.
#include "sim.hpp"

using namespace standin;

namespace {
constexpr std::int64_t TICK_NS = 1'000'000;
bool starved;  // the process feeds no watchdog

// What an axis was commanded in a cycle, for the witness of the tests; `Row` in witness_bench.py.
struct Row {
    double command, velocity;  // user units
    double zero;               // encoder counts at position 0
    double age;                // cycles since the command of the cyclic buffer was added
    std::int32_t servo_on;     // the power stage
    std::int32_t queue;        // 0: not executing; else 1 + its state
};

Row row_of(const Block &block, int index) {
    const Axis &axis = block.axes[index];
    return {axis.command, axis.velocity, axis.home_counts, static_cast<double>(axis.queue.age),
            block.status.axesStatus[index].servoOn,
            axis.queue.executing ? 1 + axis.queue.state : 0};
}

void cycle(Block &block) {
    block.heartbeat_ns = block.time_ns;
    for (Device &device : block.devices)
        if (device.used && device.life == block.life && !starved) device.fed_ns = block.time_ns;
    run_cycle(block, block.time_ns);
    if (block.quit || !is_needed(block, block.time_ns)) end_engine(block);
}
}  // namespace

extern "C" {

// From now on time is stepped; `hook` lets so many milliseconds pass.
void standin_step_time(std::int64_t now_ns, void (*hook)(double)) {
    Lock block;
    sleep_hook = hook;
    block->stepped = true;
    block->life++;
    block->time_ns = now_ns;
}

// Runs the engine until a time, at most a cycle; returns the number of rows: one per axis of a cycle,
// none where the drives are told nothing.
int standin_run(std::int64_t until_ns, Row *rows, int axes) {
    Lock block;
    const bool due = until_ns / TICK_NS > block->time_ns / TICK_NS;
    block->time_ns = until_ns;
    if (!due) return 0;
    if (block->engine_pid) cycle(*block);
    if (communicating(*block) && block->faults.frozen) return 0;
    for (int axis = 0; axis < axes; axis++) rows[axis] = row_of(*block, axis);
    return axes;
}

// A process that gets no processor feeds no watchdog.
void standin_starve(int on) { starved = on; }

// As the end of a process by a signal: its devices are fed no longer, and its calls are rejected.
void standin_kill() {
    Lock block;
    block->life++;
}

}  // extern "C"
