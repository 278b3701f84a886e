// libwmx3api: devices, the engine's life, names.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "client.hpp"

extern char **environ;

namespace standin {

Handle::Handle(int id, const Block &block) : id(id), life(block.life) {
    if (!block.stepped) feeder = std::thread(&Handle::feed, this);
}

Handle::~Handle() {
    {
        std::lock_guard<std::mutex> guard(mutex);
        closing = true;
    }
    wake.notify_all();
    if (feeder.joinable()) feeder.join();
}

void Handle::feed() {
    std::unique_lock<std::mutex> guard(mutex);
    while (!closing) {
        {
            Lock block;
            block->devices[id].fed_ns = now_ns();
        }
        wake.wait_for(guard, std::chrono::milliseconds(10));
    }
}

int check_device(const Block &block, const WMX3Api *api) {
    if (!api || !api->dev) return ErrorCode::DeviceIsNull;
    if (!engine_alive(block)) return ErrorCode::APIChannelError;
    const Handle &handle = *static_cast<Handle *>(api->dev);
    const Device &device = block.devices[handle.id];
    const bool mine = device.pid == getpid() && device.life == handle.life && handle.life == block.life;
    return device.used && mine ? ErrorCode::None : ErrorCode::DeviceIsNotInUse;
}

namespace {
std::string engine_program(const char *path) {
    return std::string(path ? path : "") + "/bin/standin-engine";
}

// Starts the engine unless it runs or is being started.
int start_engine(const char *path) {
    {
        Lock block;
        if (engine_alive(*block)) return ErrorCode::None;
        const std::int64_t now = now_ns();
        if (block->stepped) {
            if (block->engine_pid) end_engine(*block);
            begin_engine(*block, now);
            return ErrorCode::None;
        }
        if (block->starting_ns && now - block->starting_ns < 2'000'000'000) return ErrorCode::None;
        const std::string program = engine_program(path);
        if (access(program.c_str(), X_OK) != 0) return ErrorCode::RtssFileNotFoundError;
        block->starting_ns = now;
        block->quit = false;
        block->engine_pid = 0;
    }
    // A shell in between, so that the engine has no parent and leaves no zombie.
    std::string line = "\"" + engine_program(path) + "\" </dev/null >/dev/null 2>&1 &";
    char shell[] = "/bin/sh", flag[] = "-c";
    char *arguments[] = {shell, flag, line.data(), nullptr};
    pid_t child = 0;
    if (posix_spawn(&child, shell, nullptr, nullptr, arguments, environ) != 0)
        return ErrorCode::StartProcessFailed;
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {}
    return ErrorCode::None;
}

int wait_engine(unsigned int milliseconds) {
    const auto up = [](Block &block) {
        return engine_alive(block) && block.state != EngineState::Idle;
    };
    return wait_for(milliseconds, up) ? ErrorCode::None : ErrorCode::SystemInitializationNotDone;
}

int take(int &counter, int code) {
    if (counter <= 0) return ErrorCode::None;
    counter--;
    return code;
}

int injected() {
    Lock block;
    if (int code = take(block->faults.device_locked, ErrorCode::CreateDeviceLockError)) return code;
    return take(block->faults.process_locked, ErrorCode::StartProcessLockError);
}
}  // namespace

int version(int *major, int *minor, int *revision, int *fix) {
    if (!major || !minor || !revision || !fix) return ErrorCode::ArgumentIsNull;
    *major = 3, *minor = 7, *revision = 0, *fix = 0;
    return ErrorCode::None;
}

}  // namespace standin

namespace wmx3Api {

using namespace standin;

WMX3Api::WMX3Api() : dev(nullptr) {}

WMX3Api::~WMX3Api() {
    if (dev) CloseDevice();
}

WMX3APIFUNC WMX3Api::CreateDevice(const char *path, DeviceType::T type, unsigned int wait, int,
                                  DWORD_PTR) {
    if (dev) return ErrorCode::ResourceInUse;
    if (!path) return ErrorCode::ArgumentIsNull;
    if (int code = injected()) return code;
    if (int code = start_engine(path)) return code;
    if (!wait_for(5000, [](Block &block) { return engine_alive(block); }))
        return ErrorCode::StartProcessWaitTimeout;
    if (wait > 0)
        if (int code = wait_engine(wait)) return code;
    Lock block;
    for (int id = 0; id < constants::maxDevices; id++) {
        if (block->devices[id].used) continue;
        block->devices[id] = Device{true, getpid(), type, 0, now_ns(), block->life, {}};
        dev = new Handle(id, *block);
        return ErrorCode::None;
    }
    return ErrorCode::ReachMaxChannelNumber;
}

WMX3APIFUNC WMX3Api::CreateDevice(const wchar_t *path, DeviceType::T type, unsigned int wait,
                                  int core, DWORD_PTR mask) {
    const std::wstring wide(path);
    return CreateDevice(std::string(wide.begin(), wide.end()).c_str(), type, wait, core, mask);
}

#if STANDIN_CLOSE_DEVICE_FLAG
WMX3APIFUNC WMX3Api::CloseDevice(bool exitNoDev) {
#else
WMX3APIFUNC WMX3Api::CloseDevice() {
    const bool exitNoDev = true;
#endif
    if (!dev) return ErrorCode::DeviceIsNull;
    Handle *handle = static_cast<Handle *>(dev);
    const int id = handle->id, life = handle->life;
    dev = nullptr;
    delete handle;
    Lock block;
    if (block->devices[id].life != life) return ErrorCode::DeviceIsNotInUse;
    if (block->devices[id].pid == getpid() && life == block->life) block->devices[id].used = false;
    bool last = exitNoDev && block->auto_quit;
    for (const Device &device : block->devices) last = last && !device.used;
    if (last && engine_alive(*block)) block->quit = true;
    return ErrorCode::None;
}

WMX3APIFUNC WMX3Api::StartEngine(const char *path, unsigned int wait, int, DWORD_PTR) {
    if (int code = start_engine(path)) return code;
    if (wait > 0 && wait_engine(wait)) return ErrorCode::EngineNotStartedInSpecifiedTime;
    return ErrorCode::None;
}

WMX3APIFUNC WMX3Api::RestartEngine(const char *path, unsigned int wait, int core, DWORD_PTR mask) {
    if (int code = StopEngine(wait)) return code;
    return StartEngine(path, wait, core, mask);
}

WMX3APIFUNC WMX3Api::StopEngine(unsigned int wait) {
    {
        Lock block;
        if (!engine_alive(*block)) return ErrorCode::None;
        block->quit = true;
    }
    if (wait == 0) return ErrorCode::None;
    return wait_for(wait, [](Block &block) { return block.engine_pid == 0; })
               ? ErrorCode::None : ErrorCode::EngineNotStoppedInSpecifiedTime;
}

WMX3APIFUNC WMX3Api::StartCommunication(unsigned int wait) {
    const int code = with_engine(this, [](Block &block) -> int {
        if (block.state != EngineState::Running) return ErrorCode::None;
        if (block.faults.licence_expired) return ErrorCode::StartCommunicationError;
        if (int code = take(block.faults.communication_rejected, ErrorCode::StartCommunicationError))
            return code;
        block.communicate_ns = now_ns() + block.faults.communication_ms * 1'000'000ll;
        return ErrorCode::None;
    });
    if (code || wait == 0) return code;
    return wait_for(wait, communicating) ? ErrorCode::None : ErrorCode::CommNotStartedInSpecifiedTime;
}

WMX3APIFUNC WMX3Api::StopCommunication(unsigned int wait) {
    const int code = with_engine(this, [](Block &block) {
        block.communicate_ns = communicating(block) ? -1 : 0;
        return ErrorCode::None;
    });
    if (code || wait == 0) return code;
    int result = ErrorCode::None;
    const bool done = wait_for(wait, [&](Block &block) {
        if (!engine_alive(block)) result = ErrorCode::APIChannelTimeOut;
        return result || !communicating(block);
    });
    return done ? result : static_cast<int>(ErrorCode::CommNotStoppedInSpecifiedTime);
}

WMX3APIFUNC WMX3Api::GetEngineStatus(EngineStatus *status) {
    if (!status) return ErrorCode::ArgumentIsNull;
    if (!dev) return ErrorCode::DeviceIsNull;
    Lock block;
    *status = EngineStatus();
    if (!engine_alive(*block)) {
        status->state = block->stopped || block->quit ? EngineState::Shutdown : EngineState::Unknown;
        return status->state == EngineState::Shutdown ? ErrorCode::None
                                                      : ErrorCode::StatusChannelError;
    }
    status->state = block->state;
    status->numOfInterrupts = 1;
    status->interrupts[0].numOfAxes = block->faults.drives;
    status->interrupts[0].cycleTimeMicroseconds = 1000;
    status->interrupts[0].cycleCounter = block->cycle;
    return ErrorCode::None;
}

WMX3APIFUNC WMX3Api::SetDeviceName(const char *name) {
    if (!name) return ErrorCode::ArgumentIsNull;
    return with_engine(this, [&](Block &block) {
        if (int code = take(block.faults.name_rejected, ErrorCode::SetDeviceNameTimeout))
            return code;
        Device &device = block.devices[static_cast<Handle *>(dev)->id];
        std::memset(device.name, 0, sizeof device.name);
        std::memcpy(device.name, name, strnlen(name, sizeof device.name - 1));
        return 0;
    });
}

WMX3APIFUNC WMX3Api::GetDeviceName(char *nameBuf, unsigned int bufSize) {
    return with_engine(this, [&](Block &block) -> int {
        const Device &device = block.devices[static_cast<Handle *>(dev)->id];
        if (!nameBuf) return ErrorCode::ArgumentIsNull;
        if (std::strlen(device.name) >= bufSize) return ErrorCode::BufferTooSmall;
        std::strcpy(nameBuf, device.name);
        return ErrorCode::None;
    });
}

WMX3APIFUNC WMX3Api::GetDeviceID(int *id) {
    return with_engine(this, [&](Block &) {
        *id = static_cast<Handle *>(dev)->id;
        return 0;
    });
}

bool WMX3Api::IsDeviceValid() {
    return with_engine(this, [](Block &) { return 0; }) == ErrorCode::None;
}

WMX3APIFUNC WMX3Api::GetAllDevices(DevicesInfoA *devices) {
    if (!devices) return ErrorCode::ArgumentIsNull;
    return with_engine(this, [&](Block &block) {
        *devices = DevicesInfoA();
        for (int id = 0; id < constants::maxDevices; id++) {
            const Device &device = block.devices[id];
            if (!device.used) continue;
            DeviceInfoA &info = devices->devices[devices->count++];
            info.id = id;
            info.type = device.type;
            info.watchdog = device.watchdog_ms;
            std::memcpy(info.name, device.name, sizeof info.name);
        }
        return 0;
    });
}

WMX3APIFUNC WMX3Api::SetWatchdog(unsigned int watchdog) {
    return with_engine(this, [&](Block &block) {
        block.devices[static_cast<Handle *>(dev)->id].watchdog_ms = watchdog;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::SetWatchdog(int deviceId, unsigned int watchdog) {
    if (deviceId < 0 || deviceId >= constants::maxDevices) return ErrorCode::IDOutOfRange;
    return with_engine(this, [&](Block &block) {
        block.devices[deviceId].watchdog_ms = watchdog;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::GetWatchdog(unsigned int *watchdog, unsigned int *watchdogCount) {
    return with_engine(this, [&](Block &block) {
        *watchdog = block.devices[static_cast<Handle *>(dev)->id].watchdog_ms;
        if (watchdogCount) *watchdogCount = 0;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::ResetWatchdogTimer() {
    return with_engine(this, [](Block &) { return 0; });
}

WMX3APIFUNC WMX3Api::AutoQuitWithoutActiveDev(bool quit) {
    return with_engine(this, [&](Block &block) {
        block.auto_quit = quit;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::SetInterruptId(unsigned int interruptId) {
    return interruptId < constants::maxInterrupts ? ErrorCode::None : ErrorCode::IDOutOfRange;
}

WMX3APIFUNC WMX3Api::GetInterruptId(unsigned int *interruptId) {
    *interruptId = 0;
    return ErrorCode::None;
}

WMX3APIFUNC WMX3Api::SetModuleSuspend(ModuleSuspend *suspend) {
    return with_engine(this, [&](Block &block) {
        block.suspend = *suspend;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::GetModuleSuspend(ModuleSuspend *suspend) {
    return with_engine(this, [&](Block &block) {
        *suspend = block.suspend;
        return 0;
    });
}

WMX3APIFUNC WMX3Api::AbortModuleSuspend() {
    return with_engine(this, [](Block &block) {
        block.suspend = ModuleSuspend();
        return 0;
    });
}

WMX3APIFUNC WMX3Api::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode", pString, size);
}

WMX3APIFUNC WMX3Api::ErrorToString(int errCode, wchar_t *pString, unsigned int size) {
    char text[256] = {};
    const int code = error_text(errCode, "ErrorCode", text, std::min(size, 256u));
    for (unsigned int index = 0; index < size && index < 256; index++) pString[index] = text[index];
    return code;
}

WMX3APIFUNC WMX3Api::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}

WMX3APIFUNC WMX3Api::GetIMDllVersion(int *ver, int *revision) {
    *ver = 3, *revision = 7;
    return ErrorCode::None;
}

}  // namespace wmx3Api
