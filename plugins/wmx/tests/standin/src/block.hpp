// The one engine: a block of memory that all processes on the machine share.
#pragma once

#include <pthread.h>
#include <sys/types.h>

#include <cstdint>

#include "CoreMotionApi.h"
#include "EcApi.h"

namespace standin {

using namespace wmx3Api;

constexpr int AXES = constants::maxAxes;
constexpr int SLAVES = 32;
constexpr int CHANNELS = constants::maxSplineChannel;
constexpr int DIMENSIONS = constants::maxSplineDimensions;
constexpr int SPLINE_POINTS = 8192;  // invented: the largest buffer of one channel
constexpr int REGISTERS = 4096;
constexpr int CYCLIC_COMMANDS = 4096;  // invented: the largest cyclic buffer of one axis
constexpr double CYCLE_S = 0.001;

struct Segment {
    double start_s, position, velocity, acceleration;
};

// Constant acceleration piece by piece; the last piece has no end (rest or constant speed).
struct Path {
    Segment pieces[6];
    int count;
    double duration_s, target;
    void begin(double position, double velocity);
    void accelerate(double acceleration, double seconds);
    void at(double time_s, double &position, double &velocity) const;
};

// The order of CyclicBufferState; an older edition knows the first four.
enum QueueState { STOPPED, EXECUTING, WAITING, MAX_ACC_ERROR, MODE_MISMATCH, BUSY, SERVO_OFF };

// The cyclic buffer of an axis. `from` and `to` are those of the command under way.
struct CyclicQueue {
    struct Command {
        double position;
        unsigned int cycles;
        bool relative;
        long long added;  // cycle of the engine
    };
    unsigned int capacity, first, count, done, cycles;
    bool executing;
    QueueState state;
    double max_acc, from, to;
    long long age;  // cycles since the command under way was added
    Command commands[CYCLIC_COMMANDS];
};

struct Axis {
    double counts, sent_counts;  // the encoder; the counts that the drive will have next cycle
    double home_counts;          // counts at position 0
    double command, velocity, torque_percent;
    Path path;
    double time_s;     // on the path
    double speed, acc, dec;  // of the running command
    int run_cycles;    // until a timed command is stopped; 0: until it is stopped
    bool completes;    // the running command sets motionComplete when it ends
    bool stuck;        // fault: the motor does not follow
    int channel;       // spline channel that moves the axis, -1: none
    int servo_request, servo_delay;
    int mode_delay;
    int home_delay;
    bool clear_alarm;
    double torque_override;  // NaN: none
    AxisCommandMode::T mode;
    CyclicQueue queue;
};

struct Channel {
    unsigned int points;  // of the buffer; 0: none
    bool running, stopping, timed;  // timed: the rate's fall was given by a timed stop
    int dimensions, axes[DIMENSIONS], knots;
    double time_s, rate, rate_slope;  // path time, its speed, and how that falls while stopping
    double acceleration;              // largest composite acceleration of the path
    double times_s[SPLINE_POINTS + 1];
    double position[DIMENSIONS][SPLINE_POINTS + 1];
    double curvature[DIMENSIONS][SPLINE_POINTS + 1];
};

struct Device {
    bool used;
    pid_t pid;
    DeviceType::T type;
    unsigned int watchdog_ms;
    std::int64_t fed_ns;
    int life;  // of the process, where time is stepped
    char name[constants::maxDeviceName];
};

struct Slave {
    int axis;  // -1: an I/O module
    bool lost;
    unsigned char registers[REGISTERS];
    unsigned int window;  // object 0x6065:00 of a drive
};

struct Faults {  // survive a restart of the engine, so that they can be set before it starts
    int device_locked, process_locked, communication_rejected, name_rejected;
    int idle_ms, communication_ms, hot_connect_ms, hot_connect_abort, drives, io_modules;
    int busy;  // so many calls are rejected; below 0: all
    bool licence_expired, loop_back, frozen, status_lost;
    bool half_spline, fast_spline, swapped_spline;  // a spline is run in another way than asked
    Faults();  // none
};

struct Block {
    std::uint64_t magic;
    pthread_mutex_t mutex;
    pid_t holder;  // of the mutex
    Faults faults;
    Device devices[constants::maxDevices];
    pid_t engine_pid;
    bool stopped, auto_quit, quit;
    bool stepped;  // time is `time_ns`, and the engine runs in `standin_run`
    int life;
    std::int64_t time_ns, needed_ns;
    std::int64_t starting_ns, heartbeat_ns, running_ns, communicate_ns;
    EngineState::T state;
    long long cycle;
    double absolute_counts[AXES];  // what absolute encoders remember without the engine
    // From here on everything is lost when the engine stops.
    CoreMotionStatus status;
    Axis axes[AXES];
    Config::SystemParam system;
    Config::AxisParam axis;
    unsigned char inputs[constants::maxIoInSize], outputs[constants::maxIoOutSize];
    unsigned char writable[constants::maxIoOutSize];  // bits, where masks are on
    unsigned char initial[constants::maxIoOutSize], has_initial[constants::maxIoOutSize];
    bool masked;
    ModuleSuspend suspend;
    Slave slaves[SLAVES];
    int slave_count;
    unsigned int packet_loss, over_cycle, max_delay;
    ecApi::EcHotconnectState::T hot_connect;
    std::int64_t hot_connect_ns;  // when it ends
    Channel channels[CHANNELS];
};

std::int64_t now_ns();
void sleep_ms(double milliseconds);
extern void (*sleep_hook)(double milliseconds);  // in place of a sleep, where time is stepped

// The block, mapped and set up by the first process. Aborts when there is no shared memory.
Block &block();
bool running(pid_t pid);  // a process, and no zombie
bool engine_alive(const Block &block);
bool communicating(const Block &block);
void reset_engine(Block &block);  // what a start of the engine finds
void begin_engine(Block &block, std::int64_t now);  // by the process that runs its cycles
void run_cycle(Block &block, std::int64_t now);
bool is_needed(Block &block, std::int64_t now);  // some process uses the engine, or did a moment ago
void end_engine(Block &block);
double counts_per_unit(const Block &block, int axis);

// Holds the block's mutex; the death of a holder is survived. With `engine` a stopped holder is, too:
// the engine goes on without the mutex, as a real one does not depend on the processes that use it.
class Lock {
public:
    explicit Lock(bool engine = false);
    ~Lock();
    Lock(const Lock &) = delete;
    Lock &operator=(const Lock &) = delete;
    Block *operator->() { return &shared; }
    Block &operator*() { return shared; }

private:
    Block &shared;
    bool held = true;
};

}  // namespace standin
