// The engine process: a cycle each millisecond, until it ends on request.
#include <sched.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>

#include "sim.hpp"

using namespace standin;

namespace {
constexpr std::int64_t TICK_NS = 1'000'000;
constexpr std::int64_t CATCH_UP_NS = 1000 * TICK_NS;   // beyond it time is lost, as cycles are

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

}  // namespace

int main() {
    setsid();
    // Like the vendor's engine it goes before everything else, where it may.
    const sched_param priority{50};
    sched_setscheduler(0, SCHED_FIFO, &priority);
    signal(SIGHUP, SIG_IGN);
    Trace trace;
    std::int64_t due = now_ns();
    {
        Lock block;
        if (engine_alive(*block)) return 1;
        begin_engine(*block, due);
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
            run_cycle(*block, now);
            trace.add(*block, due);
            if (due + TICK_NS > now) break;
        }
        needed = !block->quit && is_needed(*block, now);
    }
    Lock block;
    end_engine(*block);
    return 0;
}
