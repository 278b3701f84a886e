// Positions streamed through the engine's cyclic buffers, by a thread of their own.
#include "position_stream.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace robotd {

namespace {
using namespace wmx3Api;

constexpr unsigned int CAPACITY = 4000;     // commands of a buffer; a stop must fit
constexpr double GAP_PERIODS = 1.5;         // as the core's: a longer gap is an underrun
constexpr double BURST_PERIODS = 2;
constexpr double MAX_RATE_CHANGE = 0.01, RATE_PER_TARGET = 0.05, DEPTH_FILTER = 0.05;
constexpr double RATE_STEP = 4e-4;          // of the rate in a cycle: at 3 rad/s it asks for 1.2 rad/s²
constexpr double STEEPEST_S = 1e-3;         // shortest ramp to rest
constexpr double STANDING = 1e-9;           // user units/s

// One cycle of the engine for an axis.
void set(CyclicBufferMultiAxisCommands &command, int axis, double position) {
    command.cmd[axis].type = CyclicBufferCommandType::AbsolutePos;
    command.cmd[axis].command = position;
    command.cmd[axis].intervalCycles = 1;
}

template <class Buffer, class = void>
struct HasQuickStop : std::false_type {};
template <class Buffer>
struct HasQuickStop<Buffer, std::void_t<decltype(std::declval<Buffer>().ExecQuickStop(0))>>
    : std::true_type {};

// Returns false where this edition has no quick stop of a buffer.
template <class Buffer>
bool exec_quick_stop(Buffer &buffer, AxisSelection &axes) {
    if constexpr (HasQuickStop<Buffer>::value) {
        check("CyclicBuffer::ExecQuickStop", Api::CyclicBuffer, buffer.ExecQuickStop(&axes));
        return true;
    } else {
        return false;
    }
}
}  // namespace

PositionStream::PositionStream(Device &device, Settings settings)
    : device_(device), buffer_(&device.engine), settings_(std::move(settings)),
      // A setpoint for half a period later is a gap for the control loop, too.
      queue_(settings_.units, bridged_s() + settings_.period_s / 2), axes_(settings_.units.size()),
      states_(axes_.size()), open_(axes_.size(), false) {
    for (auto &state : states_) state = OFF;
    commands_.reserve(256);
    if (!settings_.threaded) return;
    thread_ = std::thread(&PositionStream::run, this);
    if (settings_.priority > 0) {
        const sched_param priority{settings_.priority};
        pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &priority);  // as far as allowed
    }
}

PositionStream::~PositionStream() { close(); }

void PositionStream::close() {
    queue_.close();
    if (thread_.joinable()) thread_.join();
    std::lock_guard guard(engine_);
    for (std::size_t axis = 0; axis < axes_.size(); axis++) {
        if (open_[axis]) buffer_.CloseCyclicBuffer(static_cast<int>(axis));
        open_[axis] = false;
        states_[axis] = OFF;
    }
}

std::string PositionStream::fault() const {
    std::lock_guard guard(reporting_);
    return fault_;
}

std::vector<int> PositionStream::in_state(State state) const {
    std::vector<int> chosen;
    for (std::size_t axis = 0; axis < axes_.size(); axis++)
        if (states_[axis] == state) chosen.push_back(static_cast<int>(axis));
    return chosen;
}

// A buffer that a killed process has left is closed first.
void PositionStream::open(const std::vector<int> &axes) {
    for (int axis : axes) {
        if (open_[axis]) continue;
        int code = static_cast<int>(buffer_.OpenCyclicBuffer(axis, CAPACITY));
        if (code == CyclicBufferErrorCode::BufferAlreadyOpened) {
            buffer_.Abort(axis);
            buffer_.CloseCyclicBuffer(axis);
            code = static_cast<int>(buffer_.OpenCyclicBuffer(axis, CAPACITY));
        }
        check("OpenCyclicBuffer", Api::CyclicBuffer, code);
        open_[axis] = true;
    }
}

void PositionStream::begin(const std::vector<int> &axes) {
    std::lock_guard guard(engine_);
    for (int axis : axes)  // clears a latched MaxAccError; the engine may have lost the buffer
        if (open_[axis])
            open_[axis] = buffer_.Abort(axis) != CyclicBufferErrorCode::BufferIsNotOpened;
    open(axes);
    auto status = std::make_unique<CoreMotionStatus>();
    check("GetStatus", Api::CoreMotion, device_.core.GetStatus(status.get()));
    cycle_s_ = status->cycleTimeMilliseconds[0] / 1000.0;
    target_ = std::max(1u, static_cast<unsigned int>(std::lround(settings_.buffer_s / cycle_s_)));
    for (int axis : axes) {
        axes_[axis] = Axis();
        axes_[axis].position = axes_[axis].sent = status->axesStatus[axis].posCmd;
    }
    if (in_state(STREAMING).empty()) last_due_ns_ = 0;
    commands_.clear();
    hold(axes, target_);
    add(axes);
    AxisSelection chosen = selection(axes);
    const int code = static_cast<int>(buffer_.Execute(&chosen));
    if (code != 0)  // the axes before the one that the engine rejects execute
        for (int axis : axes) buffer_.Abort(axis);
    check("CyclicBuffer::Execute", Api::CyclicBuffer, code);
    {
        std::lock_guard lock(reporting_);
        fault_.clear();
    }
    queue_.restart(last_due_ns_ == 0);  // without the setpoints of an earlier stream
    for (int axis : axes) states_[axis] = STREAMING;
}

// Longest time between two setpoints that is not an underrun, here and in the control loop.
double PositionStream::bridged_s() const {
    return GAP_PERIODS * settings_.period_s + settings_.buffer_s;
}

void PositionStream::stop(const std::vector<int> &axes) {
    {
        std::lock_guard guard(engine_);
        for (int axis : axes)
            if (states_[axis] == STREAMING) slow(axis);
    }
    queue_.wake();
}

void PositionStream::quick_stop(const std::vector<int> &axes) {
    std::lock_guard guard(engine_);
    std::vector<int> moving;
    for (int axis : axes)
        if (states_[axis] != OFF) moving.push_back(axis);
    if (moving.empty()) return;
    AxisSelection chosen = selection(moving);
    try {
        if (exec_quick_stop(buffer_, chosen)) {
            for (int axis : moving) states_[axis] = OFF;
            return;
        }
    } catch (const CallFailed &failed) {  // it stopped the axes before the one that it rejects
        for (int axis : moving) abort(axis, failed);
    }
    for (int axis : moving)
        if (states_[axis] == STREAMING) slow(axis);
}

void PositionStream::run() {
    while (queue_.wait(!in_state(STOPPING).empty())) turn();
}

bool PositionStream::turn() {
    const bool next = queue_.take(taken_);
    std::lock_guard guard(engine_);
    if (queue_.closed()) return false;
    try {
        if (next) send(taken_);
    } catch (const CallFailed &failed) {
        report(describe(failed));
        for (int axis : in_state(STREAMING)) slow(axis);
    }
    end_drained();
    return next;
}

// Takes those out of `axes` whose buffer does not run: after a failure of the drive, or a stop that
// was not ours.
PositionStream::Fill PositionStream::look(std::vector<int> &axes) {
    constexpr unsigned int MOST = std::numeric_limits<unsigned int>::max();
    Fill fill{MOST, MOST, false};
    AxisSelection chosen = selection(axes);
    auto status = std::make_unique<CyclicBufferMultiAxisStatus>();
    check("CyclicBuffer::GetStatus", Api::CyclicBuffer, buffer_.GetStatus(&chosen, status.get()));
    const auto ended = [&](int axis) {
        const CyclicBufferSingleAxisStatus &one = status->status[axis];
        if (one.state == CyclicBufferState::ExecutingCommand ||
            one.state == CyclicBufferState::WaitingForCommand) {
            const unsigned int room = one.availableCount - std::min(one.availableCount, one.remainCount);
            fill.depth = std::min(fill.depth, one.remainCount);
            fill.room = std::min(fill.room, room);
            fill.dry |= one.state == CyclicBufferState::WaitingForCommand && one.remainCount == 0;
            return false;
        }
        states_[axis] = OFF;
        if (one.state == CyclicBufferState::MaxAccError)
            report("a setpoint of axis " + std::to_string(axis) + " exceeded the acceleration limit"
                   " of the engine's cyclic buffer (MaxAccError)");
        return true;
    };
    axes.erase(std::remove_if(axes.begin(), axes.end(), ended), axes.end());
    return fill;
}

// A process may be stopped between the look at the buffers and the new commands. Where these have run
// dry meanwhile, the commands would start at speed from rest: look again.
void PositionStream::send(const Setpoint &setpoint) {
    before_ = axes_;
    const double sampled_s = sampled_s_, mean_depth = mean_depth_, rate = rate_;
    while (!try_send(setpoint)) {
        axes_ = before_;
        sampled_s_ = sampled_s, mean_depth_ = mean_depth, rate_ = rate;
    }
}

bool PositionStream::try_send(const Setpoint &setpoint) {
    std::vector<int> axes;
    for (int axis : in_state(STREAMING))
        if (std::isfinite(setpoint.position[axis]) && std::isfinite(setpoint.velocity[axis]))
            axes.push_back(axis);
    if (axes.empty()) return true;
    const auto looked = std::chrono::steady_clock::now();
    const Fill fill = look(axes);
    const double gap_s = (setpoint.due_ns - last_due_ns_) * 1e-9;
    if (axes.empty()) return true;
    // The engine does not execute: what it were given would be executed when it does, late. The
    // control loop waits as for dry buffers, until these are less full, and continues from rest.
    if (fill.depth > overfull() || fill.room < CAPACITY / 2) {
        commands_.clear();
        slow_down(axes);
        add(axes);
        queue_.wait_for_gap();
        return true;
    }
    const bool first = last_due_ns_ == 0 && begins(axes, setpoint);
    const bool gap = gap_s <= 0 || gap_s > bridged_s();
    if (fill.dry && !gap && !begins(axes, setpoint)) {
        queue_.wait_for_gap();  // the setpoints that wait are as old as the dry buffers
        return true;
    }
    commands_.clear();
    if (!first && (gap || fill.dry)) {
        rejoin(axes, setpoint, fill);
    } else {
        start_s_ = first ? -settings_.period_s : -gap_s;
        sampled_s_ = first ? start_s_ : sampled_s_ - gap_s;
        mean_depth_ += first ? target_ - mean_depth_ : DEPTH_FILTER * (fill.depth - mean_depth_);
        const double excess = (mean_depth_ - target_) / target_;
        wanted_rate_ = 1 + std::clamp(RATE_PER_TARGET * excess, -MAX_RATE_CHANGE, MAX_RATE_CHANGE);
        if (first && fill.depth < target_) hold(axes, target_ - fill.depth);
        sample(axes, setpoint);
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - looked;
    if (!fill.dry && took.count() > (fill.depth + 0.5) * cycle_s_) return false;
    add(axes);
    last_due_ns_ = setpoint.due_ns;
    return true;
}

// Commands in a buffer that an engine which executes never has: twice as many as are kept, and those
// of the setpoints that come at once after a delay here.
unsigned int PositionStream::overfull() const {
    const double periods = BURST_PERIODS * settings_.period_s / cycle_s_;
    return 2 * target_ + static_cast<unsigned int>(std::lround(periods));
}

// True for a setpoint that the axes can reach from rest within a period.
bool PositionStream::begins(const std::vector<int> &axes, const Setpoint &setpoint) const {
    const double square = settings_.period_s * settings_.period_s;
    return std::all_of(axes.begin(), axes.end(), [&](int axis) {
        const double distance = std::fabs(setpoint.position[axis] - axes_[axis].position);
        return distance <= settings_.limits[axis].acceleration * square;
    });
}

// After a gap, the commands continue where the axes are: at rest at the last command where a buffer
// has run dry. Their difference from the setpoint fades from now on. A setpoint that is as old as a
// stall, or the last of several, makes no motion by itself.
void PositionStream::rejoin(const std::vector<int> &axes, const Setpoint &setpoint,
                            const Fill &fill) {
    for (int axis : axes) {
        Axis &mine = axes_[axis];
        if (fill.dry) mine.sent_velocity = 0;
        mine.position = setpoint.position[axis];
        mine.velocity = setpoint.velocity[axis];
        mine.deviation = {mine.sent - mine.position, mine.sent_velocity - mine.velocity, mine.velocity};
    }
    if (fill.dry && fill.depth < target_) hold(axes, target_ - fill.depth);
    sampled_s_ = 0;
    mean_depth_ = fill.depth + static_cast<double>(commands_.size());
    rate_ = wanted_rate_ = 1;
}

// Commands up to the setpoint, along the cubic from the last one. Times count from its due time.
void PositionStream::sample(const std::vector<int> &axes, const Setpoint &setpoint) {
    const double length_s = -start_s_;
    for (double time_s = sampled_s_ + cycle_s_ * rate_; time_s <= 1e-9;
         time_s += cycle_s_ * rate_) {
        rate_ = rate_ + std::clamp(wanted_rate_ - rate_, -RATE_STEP, RATE_STEP);
        const double u = 1 + time_s / length_s;
        const double from = (1 + 2 * u) * (1 - u) * (1 - u), to = 1 - from;
        const double out = u * (1 - u) * (1 - u) * length_s, in = u * u * (u - 1) * length_s;
        const double slope = 6 * u * (1 - u) / length_s;
        const double slope_out = (1 - u) * (1 - 3 * u), slope_in = u * (3 * u - 2);
        CyclicBufferMultiAxisCommands &command = commands_.emplace_back();
        for (int axis : axes) {
            Axis &mine = axes_[axis];
            const double position = from * mine.position + to * setpoint.position[axis] +
                                    out * mine.velocity + in * setpoint.velocity[axis];
            const double velocity = slope * (setpoint.position[axis] - mine.position) +
                                    slope_out * mine.velocity + slope_in * setpoint.velocity[axis];
            mine.deviation.fade(velocity, cycle_s_, settings_.limits[axis]);
            mine.sent = position + mine.deviation.offset;
            mine.sent_velocity = velocity * rate_ + mine.deviation.rate;
            set(command, axis, mine.sent);
        }
        sampled_s_ = time_s;
    }
    for (int axis : axes) {
        axes_[axis].position = setpoint.position[axis];
        axes_[axis].velocity = setpoint.velocity[axis];
    }
}

// Commands that keep the axes at their last one.
void PositionStream::hold(const std::vector<int> &axes, unsigned int cycles) {
    CyclicBufferMultiAxisCommands command;
    for (int axis : axes) set(command, axis, axes_[axis].sent);
    commands_.insert(commands_.end(), cycles, command);
}

void PositionStream::add(const std::vector<int> &axes) {
    if (commands_.empty()) return;
    AxisSelection chosen = selection(axes);
    check("CyclicBuffer::AddCommand", Api::CyclicBuffer,
          buffer_.AddCommand(&chosen, commands_.data(), static_cast<int>(commands_.size())));
}

// Commands from the last one to rest: all axes in the time that the slowest of them needs.
void PositionStream::slow_down(const std::vector<int> &axes) {
    double ramp_s = 0;
    for (int axis : axes)
        if (const double speed = std::fabs(axes_[axis].sent_velocity); speed > STANDING)
            ramp_s = std::max({ramp_s, speed / settings_.limits[axis].acceleration, STEEPEST_S});
    ramp_s = std::min(ramp_s, CAPACITY / 2 * cycle_s_);
    if (ramp_s == 0) return;
    for (double time_s = cycle_s_; time_s < ramp_s + cycle_s_; time_s += cycle_s_) {
        const double t = std::min(time_s, ramp_s);
        CyclicBufferMultiAxisCommands &command = commands_.emplace_back();
        for (int axis : axes)
            set(command, axis, axes_[axis].sent + axes_[axis].sent_velocity * (t - t * t / (2 * ramp_s)));
    }
    for (int axis : axes) {
        axes_[axis].sent += axes_[axis].sent_velocity * ramp_s / 2;
        axes_[axis].sent_velocity = 0;
    }
}

// Slow down from the last command; ``end_drained`` does the rest.
void PositionStream::brake(int axis) {
    CyclicBufferSingleAxisStatus status;
    check("CyclicBuffer::GetStatus", Api::CyclicBuffer, buffer_.GetStatus(axis, &status));
    if (status.state == CyclicBufferState::WaitingForCommand) axes_[axis].sent_velocity = 0;
    commands_.clear();
    slow_down({axis});
    states_[axis] = STOPPING;
    add({axis});
}

// Abort stops within a cycle: only where the last command has been executed.
void PositionStream::end_drained() {
    for (int axis : in_state(STOPPING)) {
        CyclicBufferSingleAxisStatus status;
        try {
            check("CyclicBuffer::GetStatus", Api::CyclicBuffer, buffer_.GetStatus(axis, &status));
        } catch (const CallFailed &failed) {
            abort(axis, failed);
            continue;
        }
        if (status.state == CyclicBufferState::ExecutingCommand) continue;
        if (status.state == CyclicBufferState::WaitingForCommand && status.remainCount) continue;
        buffer_.Abort(axis);
        states_[axis] = OFF;
    }
}

// Brakes; an axis that cannot stops within a cycle, and the others brake all the same.
void PositionStream::slow(int axis) {
    try {
        brake(axis);
    } catch (const CallFailed &failed) {
        abort(axis, failed);
    }
}

void PositionStream::abort(int axis, const CallFailed &failed) {
    report(describe(failed));
    buffer_.Abort(axis);
    states_[axis] = OFF;
}

void PositionStream::report(const std::string &reason) {
    std::lock_guard guard(reporting_);
    if (fault_.empty()) fault_ = reason;
}

}  // namespace robotd
