// The life of the engine, cycle by cycle. The lock is held in all of it.
#include <signal.h>
#include <unistd.h>

#include <cstring>

#include "sim.hpp"

namespace standin {

namespace {
constexpr std::int64_t ORPHAN_NS = 10'000'000'000;    // invented: no living process uses the engine

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

// The end of a hot connect: all slaves are back, or it was aborted.
void hot_connect(Block &block) {
    using ecApi::EcHotconnectState;
    const bool failed = block.faults.hot_connect_abort != 0;
    block.hot_connect = failed ? EcHotconnectState::Abort : EcHotconnectState::Idle;
    for (Slave &slave : block.slaves) slave.lost = slave.lost && failed;
}
}  // namespace

void begin_engine(Block &block, std::int64_t now) {
    reset_engine(block);
    block.engine_pid = getpid();
    block.quit = block.stopped = false;
    block.heartbeat_ns = block.needed_ns = now;
    block.running_ns = now + block.faults.idle_ms * 1'000'000ll;
    block.state = block.status.engineState = EngineState::Idle;
    if (block.faults.idle_ms == 0) run_cycle(block, now);
    block.starting_ns = 0;
}

void run_cycle(Block &block, std::int64_t now) {
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

// Closes devices whose process no longer feeds them.
bool is_needed(Block &block, std::int64_t now) {
    bool any = false, died = false;
    for (Device &device : block.devices) {
        if (!device.used) continue;
        const std::int64_t age_ns = now - device.fed_ns;
        if (device.watchdog_ms && age_ns > device.watchdog_ms * 1'000'000ll) device.used = !(died = true);
        else any = true;
        if (device.used && kill(device.pid, 0) == 0) block.needed_ns = now;
    }
    if (died && !any && block.auto_quit) return false;
    return now - block.needed_ns < ORPHAN_NS;
}

void end_engine(Block &block) {
    stop_communication(block);
    block.state = block.status.engineState = EngineState::Shutdown;
    block.engine_pid = 0;
    block.stopped = true;
    block.quit = false;
}

}  // namespace standin
