#include "block.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>

namespace standin {

namespace {
constexpr std::int64_t LATE_AFTER_NS = 1'500'000'000, DEAD_AFTER_NS = 15'000'000'000;
const std::uint64_t MAGIC = 0x57A4D100000000ull + sizeof(Block);

std::string shm_name() {
    const char *name = std::getenv("WMX_STANDIN_SHM");
    return name ? std::string("/") + name : "/wmx-standin-" + std::to_string(getuid());
}

void set_up(Block &block) {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&block.mutex, &attributes);
    block.faults = Faults();
    block.auto_quit = true;
    block.magic = MAGIC;
}

Block *map_block() {
    const std::string name = shm_name();
    const int file = shm_open(name.c_str(), O_RDWR | O_CREAT, 0600);
    if (file < 0) {
        std::fprintf(stderr, "WMX stand-in: no shared memory %s\n", name.c_str());
        std::abort();
    }
    flock(file, LOCK_EX);
    struct stat facts {};
    fstat(file, &facts);
    const bool grow = facts.st_size < static_cast<off_t>(sizeof(Block));
    if (grow && ftruncate(file, sizeof(Block)) != 0) std::abort();
    void *memory = mmap(nullptr, sizeof(Block), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (memory == MAP_FAILED) std::abort();
    Block *block = static_cast<Block *>(memory);
    if (block->magic != MAGIC) set_up(*block);
    flock(file, LOCK_UN);
    close(file);
    return block;
}

// True for a process that was stopped by a signal.
bool stopped(pid_t process) {
    char path[32], state = 0;
    std::snprintf(path, sizeof path, "/proc/%d/stat", static_cast<int>(process));
    if (FILE *file = std::fopen(path, "r")) {
        if (std::fscanf(file, "%*d (%*[^)]) %c", &state) != 1) state = 0;
        std::fclose(file);
    }
    return state == 'T';
}
}  // namespace

Faults::Faults() {
    std::memset(static_cast<void *>(this), 0, sizeof *this);
    drives = 6;
    io_modules = 1;
    communication_ms = hot_connect_ms = 20;
    // For engines that do not exist yet: WMX_STANDIN_LOCKED=5 refuses the first 5 devices.
    if (const char *times = std::getenv("WMX_STANDIN_LOCKED")) device_locked = std::atoi(times);
}

void (*sleep_hook)(double) = nullptr;

std::int64_t now_ns() {
    if (block().stepped) return block().time_ns;
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1'000'000'000ll + time.tv_nsec;
}

void sleep_ms(double milliseconds) {
    if (sleep_hook) sleep_hook(milliseconds);
    else usleep(static_cast<useconds_t>(milliseconds * 1000));
}

Block &block() {
    static Block *mapped = map_block();
    return *mapped;
}

Lock::Lock(bool engine) : shared(block()) {
    int code = engine ? EBUSY : pthread_mutex_lock(&shared.mutex);
    while (code == EBUSY) {
        code = pthread_mutex_trylock(&shared.mutex);
        if (code != EBUSY) break;
        if (stopped(shared.holder)) {
            held = false;
            return;
        }
        sleep_ms(0.05);
    }
    if (code == EOWNERDEAD) pthread_mutex_consistent(&shared.mutex);
    shared.holder = getpid();
}

Lock::~Lock() {
    if (held) pthread_mutex_unlock(&shared.mutex);
}

bool running(pid_t pid) {
    if (pid == 0 || kill(pid, 0) != 0) return false;
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string number, name, state;  // the name of the engine has no space
    stat >> number >> name >> state;
    return state != "Z";  // killed, and nobody has asked for its status
}

bool engine_alive(const Block &block) {
    if (block.engine_pid == 0 || block.quit) return false;
    const std::int64_t age_ns = now_ns() - block.heartbeat_ns;
    // A late heartbeat is that of a killed engine, or of one on a computer that stood still.
    return age_ns < LATE_AFTER_NS ? kill(block.engine_pid, 0) == 0
                                  : age_ns < DEAD_AFTER_NS && running(block.engine_pid);
}

bool communicating(const Block &block) { return block.state == EngineState::Communicating; }

double counts_per_unit(const Block &block, int axis) {
    return block.axis.axisPolarity[axis] * block.axis.gearRatioNumerator[axis] /
           block.axis.gearRatioDenominator[axis];
}

void reset_engine(Block &block) {
    block.status = CoreMotionStatus();
    block.system = Config::SystemParam();
    block.axis = Config::AxisParam();
    std::memset(block.inputs, 0, sizeof block.inputs);
    std::memset(block.outputs, 0, sizeof block.outputs);
    std::memset(block.writable, 0xFF, sizeof block.writable);
    std::memset(block.has_initial, 0, sizeof block.has_initial);
    block.masked = false;
    block.suspend = ModuleSuspend();
    for (auto &channel : block.channels) channel.points = 0, channel.running = false;
    for (int axis = 0; axis < AXES; axis++) {
        Axis fresh{};
        fresh.counts = fresh.sent_counts = block.absolute_counts[axis];
        fresh.channel = fresh.servo_request = -1;
        fresh.torque_override = std::numeric_limits<double>::quiet_NaN();
        block.axes[axis] = fresh;
        block.status.axesStatus[axis].servoOffline = true;
    }
    block.slave_count = 0;
    block.cycle = block.communicate_ns = 0;
    block.hot_connect = ecApi::EcHotconnectState::Idle;
    block.packet_loss = block.over_cycle = block.max_delay = 0;
}

}  // namespace standin
