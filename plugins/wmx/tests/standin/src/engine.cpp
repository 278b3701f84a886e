// The engine process: starts communication when asked, ticks once a millisecond, ends on request.
#include <sched.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "sim.hpp"

using namespace standin;

namespace {
constexpr std::int64_t TICK_NS = 1'000'000;
constexpr std::int64_t CATCH_UP_NS = 1000 * TICK_NS;   // beyond it time is lost, as cycles are
constexpr std::int64_t ORPHAN_NS = 10'000'000'000;    // invented: no living process uses the engine

// Record of the axes in every cycle, in the file that WMX_STANDIN_TRACE names.
class Trace {
public:
    Trace() {
        if (const char *path = std::getenv("WMX_STANDIN_TRACE")) file_ = std::fopen(path, "ab");
    }
    ~Trace() {
        if (file_) std::fclose(file_);
    }
    void add(const Block &block, std::int64_t due_ns) {
        if (!file_ || !communicating(block)) return;
        Row row{due_ns, {}, {}};
        for (int axis = 0; axis < TRACED; axis++) {
            row.command[axis] = block.status.axesStatus[axis].posCmd;
            row.position[axis] = block.status.axesStatus[axis].actualPos;
        }
        std::fwrite(&row, sizeof row, 1, file_);
    }

private:
    static constexpr int TRACED = 6;
    struct Row {
        std::int64_t due_ns;
        double command[TRACED], position[TRACED];
    };
    std::FILE *file_ = nullptr;
};

void start_communication(Block &block) {
    block.state = block.status.engineState = EngineState::Communicating;
    block.communicate_ns = 0;
    block.cycle = 0;
    block.slave_count = block.faults.drives + block.faults.io_modules;
    for (int index = 0; index < block.slave_count; index++) {
        Slave &slave = block.slaves[index];
        slave.axis = index < block.faults.drives ? index : -1;
        slave.window = 10000;
        std::memset(slave.registers, 0, sizeof slave.registers);
        slave.registers[0] = 0x11;               // ESC type
        slave.registers[0x04] = 8;               // FMMUs
        slave.registers[0x05] = 8;               // sync managers
        slave.registers[0x06] = 8;               // RAM in KiB
        slave.registers[0x07] = 0x0F;            // ports 0 and 1: MII
        slave.registers[0x10] = static_cast<unsigned char>(1 + index);  // station address 0x1001...
        slave.registers[0x11] = 0x10;
        slave.registers[0x110] = index + 1 < block.slave_count ? 0x3B : 0x13;  // DL status
    }
    for (int axis = 0; axis < block.faults.drives; axis++) {
        Axis &mine = block.axes[axis];
        mine.home_counts = block.axis.absoluteEncoderMode[axis]
                               ? block.axis.absoluteEncoderHomeOffset[axis] : mine.counts;
        mine.mode = block.axis.axisCommandMode[axis];
        mine.sent_counts = mine.counts;
        rescale(block, axis);
    }
    for (int byte = 0; byte < constants::maxIoOutSize; byte++)
        if (block.has_initial[byte]) block.outputs[byte] = block.initial[byte];
    block.status.numOfInterrupts = 1;
    block.status.cycleTimeMilliseconds[0] = CYCLE_S * 1000;
}

void stop_communication(Block &block) {
    block.state = block.status.engineState = EngineState::Running;
    block.communicate_ns = 0;
    for (int axis = 0; axis < AXES; axis++) {
        CoreMotionAxisStatus &status = block.status.axesStatus[axis];
        status.servoOn = false;
        block.axes[axis].channel = block.axes[axis].servo_request = -1;
        interrupt(block, axis);
        status.servoOffline = true;
        if (block.system.homeParam[axis].clearHomeDoneOnCommStop) status.homeDone = false;
    }
    for (Channel &channel : block.channels) channel.running = false;
}

// Closes devices whose process no longer feeds them; true while a process uses the engine.
bool watch(Block &block, std::int64_t now, std::int64_t &needed_ns) {
    bool any = false, died = false;
    for (Device &device : block.devices) {
        if (!device.used) continue;
        const std::int64_t age_ns = now - device.fed_ns;
        if (device.watchdog_ms && age_ns > device.watchdog_ms * 1'000'000ll) device.used = !(died = true);
        else any = true;
        if (device.used && kill(device.pid, 0) == 0) needed_ns = now;
    }
    if (died && !any && block.auto_quit) return false;
    return now - needed_ns < ORPHAN_NS;
}

// The end of a hot connect: all slaves are back, or it was aborted.
void hot_connect(Block &block) {
    using ecApi::EcHotconnectState;
    const bool failed = block.faults.hot_connect_abort != 0;
    block.hot_connect = failed ? EcHotconnectState::Abort : EcHotconnectState::Idle;
    for (Slave &slave : block.slaves) slave.lost = slave.lost && failed;
}

void step(Block &block, std::int64_t now) {
    if (block.state == EngineState::Idle && now >= block.running_ns)
        block.state = block.status.engineState = EngineState::Running;
    block.status.invalidLicenseError = block.faults.licence_expired;
    if (communicating(block) && (block.faults.licence_expired || block.communicate_ns < 0))
        stop_communication(block);
    if (block.state == EngineState::Running && block.communicate_ns > 0 &&
        now >= block.communicate_ns)
        start_communication(block);
    if (block.hot_connect == ecApi::EcHotconnectState::Running && now >= block.hot_connect_ns)
        hot_connect(block);
    if (communicating(block) && !block.faults.frozen) tick(block);
}
}  // namespace

int main() {
    setsid();
    // Like the vendor's engine it goes before everything else, where it may.
    const sched_param priority{50};
    sched_setscheduler(0, SCHED_FIFO, &priority);
    signal(SIGHUP, SIG_IGN);
    Trace trace;
    std::int64_t due = now_ns(), needed_ns = due;
    {
        Lock block;
        if (engine_alive(*block)) return 1;
        reset_engine(*block);
        block->engine_pid = getpid();
        block->quit = block->stopped = false;
        block->heartbeat_ns = due;
        block->running_ns = due + block->faults.idle_ms * TICK_NS;
        block->state = block->status.engineState = EngineState::Idle;
        if (block->faults.idle_ms == 0) step(*block, due);
        block->starting_ns = 0;
    }
    for (bool needed = true; needed;) {
        due += TICK_NS;
        timespec wake{static_cast<time_t>(due / 1'000'000'000),
                      static_cast<long>(due % 1'000'000'000)};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr) == EINTR) {}
        Lock block(true);
        const std::int64_t now = now_ns();
        if (now - due > CATCH_UP_NS) {
            block->over_cycle++;
            due = now;
        }
        block->heartbeat_ns = now;
        // Late cycles are made up for before a process can read the axes: they are always where
        // they would be on a computer that is never late.
        for (;; due += TICK_NS) {
            step(*block, now);
            trace.add(*block, due);
            if (due + TICK_NS > now) break;
        }
        needed = !block->quit && watch(*block, now, needed_ns);
    }
    Lock block;
    stop_communication(*block);
    block->state = block->status.engineState = EngineState::Shutdown;
    block->engine_pid = 0;
    block->stopped = true;
    block->quit = false;
    return 0;
}
