// Device functions for every library of the SDK.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "sim.hpp"

namespace standin {

// Behind WMX3Api::dev. Its thread feeds the device's watchdog.
class Handle {
public:
    Handle(int id, const Block &block);
    ~Handle();
    const int id, life;

private:
    void feed();
    std::mutex mutex;
    std::condition_variable wake;
    bool closing = false;
    std::thread feeder;
};

// 0 when the device of `api` can be used; expects the lock to be held.
int check_device(const Block &block, const WMX3Api *api);

// Runs `command(block)` under the lock for a device that can be used.
template <class Command>
int with_engine(const WMX3Api *api, Command command) {
    Lock block;
    if (int code = check_device(*block, api)) return code;
    if (block->faults.busy) {
        if (block->faults.busy > 0) block->faults.busy--;
        return ErrorCode::APIChannelTimeOut;
    }
    return command(*block);
}

// The same, and waits until the engine has taken the command in (ApiWaitUntilMotionStart),
// unless time is stepped.
template <class Command>
int with_motion(const WMX3Api *api, Command command) {
    long long cycle = 0;
    const int code = with_engine(api, [&](Block &block) {
        cycle = block.cycle;
        return command(block);
    });
    for (int tries = 0; code == 0 && !sleep_hook && tries < 100; tries++) {
        sleep_ms(0.5);
        Lock block;
        if (block->cycle > cycle || !communicating(*block)) break;
    }
    return code;
}

// Polls `done(block)` every millisecond; false when the time (INFINITE: never) is over.
template <class Condition>
bool wait_for(unsigned int milliseconds, Condition done) {
    const std::int64_t end_ns = now_ns() + milliseconds * 1'000'000ll;
    while (true) {
        {
            Lock block;
            if (done(*block)) return true;
        }
        if (milliseconds != INFINITE && now_ns() >= end_ns) return false;
        sleep_ms(1);
    }
}

// Texts of the codes of a class and of those it inherits.
int error_text(int code, const char *classes, char *text, unsigned int size);
int version(int *major, int *minor, int *revision, int *fix);

}  // namespace standin
