// The fault port: commands that reach into the engine, for tests. `standin-port` lists all.
#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>

#include "sim.hpp"

using namespace standin;

namespace {
using Command = void (*)(Block &, const long *);

struct Entry {
    const char *name, *arguments;
    int count;
    Command run;
};

CoreMotionAxisStatus &status(Block &block, long axis) { return block.status.axesStatus[axis]; }

const Entry COMMANDS[] = {
    {"device_locked", "TIMES", 1, [](Block &b, const long *a) { b.faults.device_locked = a[0]; }},
    {"process_locked", "TIMES", 1, [](Block &b, const long *a) { b.faults.process_locked = a[0]; }},
    {"communication_rejected", "TIMES", 1,
     [](Block &b, const long *a) { b.faults.communication_rejected = a[0]; }},
    {"communication_ms", "MS", 1, [](Block &b, const long *a) { b.faults.communication_ms = a[0]; }},
    {"name_rejected", "TIMES", 1, [](Block &b, const long *a) { b.faults.name_rejected = a[0]; }},
    {"idle_ms", "MS", 1, [](Block &b, const long *a) { b.faults.idle_ms = a[0]; }},
    {"topology", "DRIVES IO_MODULES", 2,
     [](Block &b, const long *a) { b.faults.drives = a[0], b.faults.io_modules = a[1]; }},
    {"licence_expired", "0|1", 1, [](Block &b, const long *a) { b.faults.licence_expired = a[0]; }},
    {"loop_back", "0|1", 1, [](Block &b, const long *a) { b.faults.loop_back = a[0]; }},
    {"slave_lost", "SLAVE", 1,
     [](Block &b, const long *a) { b.slaves[a[0]].lost = true, b.packet_loss += 10; }},
    {"slave_back", "SLAVE", 1, [](Block &b, const long *a) { b.slaves[a[0]].lost = false; }},
    {"mend", "", 0, [](Block &b, const long *) {
         for (Slave &slave : b.slaves) slave.lost = false;
         for (Axis &axis : b.axes) axis.stuck = false;
         for (CoreMotionAxisStatus &axis : b.status.axesStatus) axis.ampAlarm = false;
         b.faults.frozen = b.faults.licence_expired = b.faults.status_lost = false;
         b.faults.busy = 0;
         b.faults.half_spline = b.faults.fast_spline = b.faults.swapped_spline = false;
     }},
    {"hot_connect_ms", "MS", 1, [](Block &b, const long *a) { b.faults.hot_connect_ms = a[0]; }},
    {"hot_connect_abort", "CODE", 1,
     [](Block &b, const long *a) { b.faults.hot_connect_abort = a[0]; }},
    {"amp_alarm", "AXIS CODE", 2,
     [](Block &b, const long *a) {
         // The code first: whoever sees the alarm also sees its code.
         status(b, a[0]).ampAlarmCode = static_cast<int>(a[1]);
         status(b, a[0]).ampAlarm = a[1] != 0;
     }},
    {"stuck", "AXIS 0|1", 2, [](Block &b, const long *a) { b.axes[a[0]].stuck = a[1]; }},
    {"push", "AXIS COUNTS", 2, [](Block &b, const long *a) {
         b.axes[a[0]].counts += a[1], b.axes[a[0]].sent_counts += a[1];
     }},
    {"turn", "AXIS MICRO_UNITS", 2, [](Block &b, const long *a) {
         const double delta = a[1] * 1e-6 * counts_per_unit(b, static_cast<int>(a[0]));
         b.axes[a[0]].counts += delta, b.axes[a[0]].sent_counts += delta;
     }},
    {"freeze", "0|1", 1, [](Block &b, const long *a) { b.faults.frozen = a[0]; }},
    {"busy", "TIMES", 1, [](Block &b, const long *a) { b.faults.busy = a[0]; }},
    {"status_lost", "0|1", 1, [](Block &b, const long *a) { b.faults.status_lost = a[0]; }},
    {"servo_off", "AXIS", 1, [](Block &b, const long *a) {
         status(b, a[0]).servoOn = false;
         interrupt(b, static_cast<int>(a[0]));
     }},
    {"drop_communication", "", 0, [](Block &b, const long *) {
         if (communicating(b)) b.communicate_ns = -1;
     }},
    {"max_acc", "AXIS VALUE", 2, [](Block &b, const long *a) { b.axes[a[0]].queue.max_acc = a[1]; }},
    {"half_spline", "0|1", 1, [](Block &b, const long *a) { b.faults.half_spline = a[0]; }},
    {"fast_spline", "0|1", 1, [](Block &b, const long *a) { b.faults.fast_spline = a[0]; }},
    {"swapped_spline", "0|1", 1, [](Block &b, const long *a) { b.faults.swapped_spline = a[0]; }},
    {"input_bit", "BYTE BIT", 2,
     [](Block &b, const long *a) { b.inputs[a[0]] |= 1 << a[1]; }},
    {"no_input_bit", "BYTE BIT", 2,
     [](Block &b, const long *a) { b.inputs[a[0]] &= ~(1 << a[1]); }},
    {"torque", "AXIS PERCENT", 2,
     [](Block &b, const long *a) { b.axes[a[0]].torque_override = a[1]; }},
    {"positive_limit", "AXIS 0|1", 2,
     [](Block &b, const long *a) { status(b, a[0]).positiveLS = a[1]; }},
    {"negative_limit", "AXIS 0|1", 2,
     [](Block &b, const long *a) { status(b, a[0]).negativeLS = a[1]; }},
    {"home_switch", "AXIS 0|1", 2,
     [](Block &b, const long *a) { status(b, a[0]).homeSwitch = a[1]; }},
    {"input", "BYTE VALUE", 2, [](Block &b, const long *a) { b.inputs[a[0]] = a[1]; }},
    {"output", "BYTE", 1, [](Block &b, const long *a) { std::printf("%d\n", b.outputs[a[0]]); }},
    {"hang", "", 0, [](Block &, const long *) {  // every call, until standard input ends
         std::puts("hanging");
         std::fflush(stdout);
         while (std::getchar() != EOF) {}
     }},
    {"stop_engine", "", 0, [](Block &b, const long *) { b.quit = true; }},
    {"kill_engine", "", 0, [](Block &b, const long *) {
         if (b.engine_pid) kill(b.engine_pid, SIGKILL);
     }},
    {"show", "", 0, [](Block &b, const long *) {
         std::printf("engine %d state %d cycle %lld\n", b.engine_pid, b.state, b.cycle);
         for (int axis = 0; axis < b.faults.drives; axis++)
             std::printf("axis %d servo %d state %d position %.9f command %.9f\n", axis,
                         status(b, axis).servoOn, status(b, axis).opState,
                         status(b, axis).actualPos, status(b, axis).posCmd);
     }},
};
}  // namespace

namespace {
// Ends the engine and forgets everything, faults and devices included.
int reset() {
    {
        Lock block;
        if (block->stepped) end_engine(*block);
        else block->quit = true;
    }
    for (int tries = 0; tries < 3000; tries++) {
        sleep_ms(1);
        Lock block;
        if (block->stepped || !running(block->engine_pid)) break;
    }
    Lock block;
    block->faults = Faults();
    block->auto_quit = true;
    block->quit = block->stopped = false;
    block->engine_pid = 0;
    block->starting_ns = 0;
    for (Device &device : block->devices) device.used = false;
    for (double &counts : block->absolute_counts) counts = 0;
    for (Slave &slave : block->slaves) slave.lost = false;
    reset_engine(*block);
    return 0;
}
}  // namespace

// Runs the command `words[1]`.
extern "C" int standin_port(int count, char **words) {
    if (count == 2 && std::strcmp(words[1], "reset") == 0) return reset();
    for (const Entry &entry : COMMANDS) {
        if (count < 2 || std::strcmp(entry.name, words[1]) != 0) continue;
        if (count != entry.count + 2) break;
        long arguments[2] = {};
        for (int index = 0; index < entry.count; index++)
            arguments[index] = std::strtol(words[index + 2], nullptr, 0);
        Lock block;
        entry.run(*block, arguments);
        return 0;
    }
    std::fprintf(stderr, "usage: standin-port COMMAND ARGUMENTS\n");
    for (const Entry &entry : COMMANDS)
        std::fprintf(stderr, "  %s %s\n", entry.name, entry.arguments);
    return 2;
}
