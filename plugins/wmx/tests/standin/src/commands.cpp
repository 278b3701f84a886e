// Commands of single axes, checked in the order of the documented errors.
#include <algorithm>
#include <cmath>

#include "sim.hpp"

namespace standin {

using Core = CoreMotionErrorCode;

namespace {
struct Ramps {
    double acc, dec;
};

// Ramps of any profile type: what is not a trapezoid becomes one that takes as long.
Ramps ramps(const Profile &profile, double change) {
    const bool timed = profile.type >= ProfileType::TimeAccTrapezoidal &&
                       profile.type <= ProfileType::TimeAccAdvancedS;
    auto slope = [&](double acc, double milliseconds) {
        if (!timed) return acc > 0 ? acc : INSTANT;
        return milliseconds > 0 ? std::max(std::fabs(change), 1e-9) / milliseconds * 1000 : INSTANT;
    };
    return {slope(profile.acc, profile.accTimeMilliseconds),
            slope(profile.dec, profile.decTimeMilliseconds)};
}

int check_profile(const Profile &profile, bool may_be_zero) {
    const bool timed = profile.type >= ProfileType::TimeAccTrapezoidal;
    if (profile.type < 0 || profile.type > ProfileType::ParabolicVelocity)
        return Core::ProfileTypeNotSupported;
    if (!std::isfinite(profile.velocity)) return Core::VelocityArgumentOutOfRange;
    if (!timed && !may_be_zero && !(profile.acc > 0)) return Core::AccArgumentOutOfRange;
    if (!timed && !may_be_zero && !(profile.dec > 0)) return Core::DecArgumentOutOfRange;
    if (!timed && profile.acc < 0) return Core::AccArgumentOutOfRange;
    if (!timed && profile.dec < 0) return Core::DecArgumentOutOfRange;
    return ErrorCode::None;
}

void begin(Block &block, int axis, const Path &path, OperationState::T state, int detail,
           bool completes, Ramps slopes, double speed = 0) {
    Axis &mine = block.axes[axis];
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    mine.path = path;
    mine.time_s = 0;
    mine.run_cycles = 0;
    mine.speed = speed;
    mine.acc = slopes.acc;
    mine.dec = slopes.dec;
    mine.completes = completes;
    status.opState = state;
    status.detailOpState = static_cast<DetailOperationState::T>(detail);
    status.motionComplete = status.motionPaused = false;
    status.profileTargetPos = path.target;
    status.profileTotalMilliseconds = path.duration_s * 1000;
}

bool blocked(const CoreMotionAxisStatus &status, const Config::LimitParam &limit, double way) {
    return limit.lsType != Config::LimitSwitchType::None &&
           ((status.positiveLS && way > 0) || (status.negativeLS && way < 0));
}
}  // namespace

int check_axis(const Block &block, int axis) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    return communicating(block) ? ErrorCode::None : ErrorCode::CommNotStarted;
}

int check_drive(const Block &block, int axis) {
    if (int code = check_axis(block, axis)) return code;
    return block.status.axesStatus[axis].servoOffline ? ErrorCode::ServoOffline : ErrorCode::None;
}

int check_motion(const Block &block, int axis, AxisCommandMode::T mode) {
    if (int code = check_drive(block, axis)) return code;
    const CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.ampAlarm) return ErrorCode::AxisAmpAlarm;
    if (!status.servoOn) return Core::NotServoOn;
    if (block.status.emergencyStop) return Core::EmergencyStopSignalOn;
    if (status.axisCommandMode == mode) return ErrorCode::None;
    return mode == AxisCommandMode::Position ? Core::NotPosMode
           : mode == AxisCommandMode::Velocity ? Core::NotVelocityMode : Core::NotTrqMode;
}

int set_servo(Block &block, int axis, bool on) {
    if (int code = check_drive(block, axis)) return code;
    const CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (on && status.ampAlarm) return ErrorCode::AxisAmpAlarm;
    if (on == status.servoOn && block.axes[axis].servo_request < 0) return ErrorCode::None;
    block.axes[axis].servo_request = on;
    block.axes[axis].servo_delay = 3;
    return ErrorCode::None;
}

int set_mode(Block &block, int axis, AxisCommandMode::T mode) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    if (mode < AxisCommandMode::Position || mode > AxisCommandMode::Torque)
        return Core::AxisCommandModeOutOfRange;
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (communicating(block) && status.opState != OperationState::Idle)
        return ErrorCode::NotIdleState;
    block.axis.axisCommandMode[axis] = status.axisCommandMode = mode;
    block.axes[axis].mode = mode;
    block.axes[axis].mode_delay = 2;
    return ErrorCode::None;
}

int start_move(Block &block, int axis, double target, const Profile &profile) {
    if (int code = check_motion(block, axis, AxisCommandMode::Position)) return code;
    const CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.opState != OperationState::Idle && status.opState != OperationState::Pos &&
        status.opState != OperationState::Jog)
        return Core::NotIdleOrPosOrJogState;
    if (int code = check_profile(profile, false)) return code;
    if (!(profile.velocity > 0)) return Core::VelocityArgumentOutOfRange;
    if (!std::isfinite(target)) return Core::PositionArgumentOutOfRange;
    const Axis &mine = block.axes[axis];
    if (blocked(status, block.system.limitParam[axis], target - mine.command))
        return ErrorCode::AxisHardLimit;
    const Ramps slopes = ramps(profile, profile.velocity);
    const Path path = path_to(mine.command, mine.velocity, target, profile.velocity, slopes.acc,
                              slopes.dec);
    begin(block, axis, path, OperationState::Pos, DetailOperationState::Pos, true, slopes,
          profile.velocity);
    return ErrorCode::None;
}

int start_speed(Block &block, int axis, const Profile &profile, OperationState::T state,
                double run_ms) {
    const bool jog = state == OperationState::Jog;
    const auto mode = jog ? AxisCommandMode::Position : AxisCommandMode::Velocity;
    if (int code = check_motion(block, axis, mode)) return code;
    const CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.opState != OperationState::Idle && status.opState != state &&
        !(jog && status.opState == OperationState::Pos))
        return jog ? Core::NotIdleOrPosOrJogState : Core::NotIdleOrVelocityState;
    if (int code = check_profile(profile, !jog)) return code;
    const Axis &mine = block.axes[axis];
    if (blocked(status, block.system.limitParam[axis], profile.velocity))
        return ErrorCode::AxisHardLimit;
    const Ramps slopes = ramps(profile, profile.velocity - mine.velocity);
    const Path path =
        path_to_speed(mine.command, mine.velocity, profile.velocity, slopes.acc, slopes.dec);
    begin(block, axis, path, state,
          jog ? DetailOperationState::Jog : DetailOperationState::Velocity, false, slopes);
    block.axes[axis].run_cycles = static_cast<int>(std::ceil(run_ms / 1000 / CYCLE_S));
    return ErrorCode::None;
}

int pause_move(Block &block, int axis) {
    if (int code = check_motion(block, axis, AxisCommandMode::Position)) return code;
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.opState != OperationState::Pos) return Core::NotPosState;
    Axis &mine = block.axes[axis];
    mine.path = path_to_speed(mine.command, mine.velocity, 0, mine.dec, mine.dec);
    mine.time_s = 0;
    status.motionPaused = true;
    return ErrorCode::None;
}

int resume_move(Block &block, int axis) {
    if (int code = check_motion(block, axis, AxisCommandMode::Position)) return code;
    const CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (!status.motionPaused) return Core::AxisNotPaused;
    const Axis &mine = block.axes[axis];
    const Profile profile = Profile::SetupTrapezoidal(mine.speed, mine.acc, mine.dec);
    return start_move(block, axis, status.profileTargetPos, profile);
}

// Invented: the axis stays where it is, as if it pressed against something.
int start_torque(Block &block, int axis, double percent) {
    if (int code = check_motion(block, axis, AxisCommandMode::Torque)) return code;
    if (!(std::fabs(percent) <= block.axis.maxTrqLimit[axis])) return Core::TorqueArgumentOutOfRange;
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    status.torqueCmd = percent;
    status.opState = OperationState::Trq;
    status.detailOpState = DetailOperationState::Trq;
    return ErrorCode::None;
}

int start_line(Block &block, const Motion::LinearIntplCommand &command, bool relative) {
    const int count = static_cast<int>(command.axisCount);
    if (count < 1 || count > AXES) return ErrorCode::AxisCountOutOfRange;
    double length = 0, way[AXES];
    for (int index = 0; index < count; index++) {
        const int axis = command.axis[index];
        if (int code = check_motion(block, axis, AxisCommandMode::Position)) return code;
        if (std::count(command.axis, command.axis + count, axis) > 1)
            return ErrorCode::DuplicateAxis;
        if (block.status.axesStatus[axis].opState != OperationState::Idle)
            return Core::NotIdleOrIntplState;
        way[index] = command.target[index] - (relative ? 0 : block.axes[axis].command);
        length += way[index] * way[index];
    }
    if (int code = check_profile(command.profile, false)) return code;
    const Ramps slopes = ramps(command.profile, command.profile.velocity);
    length = std::max(std::sqrt(length), 1e-12);
    for (int index = 0; index < count; index++) {
        const double share = std::max(std::fabs(way[index]) / length, 1e-9);
        const double start = block.axes[command.axis[index]].command;
        const Path path = path_to(start, 0, start + way[index], command.profile.velocity * share,
                                  slopes.acc * share, slopes.dec * share);
        begin(block, command.axis[index], path, OperationState::Intpl,
              DetailOperationState::Intpl_Linear, true, {slopes.acc * share, slopes.dec * share});
    }
    return ErrorCode::None;
}

int start_home(Block &block, int axis) {
    if (int code = check_drive(block, axis)) return code;
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.opState != OperationState::Idle) return ErrorCode::NotIdleState;
    if (block.system.homeParam[axis].homeType != Config::HomeType::CurrentPos)
        return Core::HomeSwitchDetectionUnsupported;
    status.opState = OperationState::Home;
    status.detailOpState = DetailOperationState::Home;
    status.homeDone = false;
    status.motionComplete = false;
    block.axes[axis].home_delay = 2;
    return ErrorCode::None;
}

int stop_axis(Block &block, int axis, double dec, bool quick) {
    if (int code = check_axis(block, axis)) return code;
    Axis &mine = block.axes[axis];
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (status.opState == OperationState::Idle) return ErrorCode::None;
    status.motionComplete = false;
    if (mine.queue.executing) return brake_queue(block, axis, STOPPED);
    if (mine.channel >= 0 && !quick) {
        block.channels[mine.channel].stopping = true;
        return ErrorCode::None;
    }
    if (mine.channel >= 0) {  // each axis for itself
        Channel &channel = block.channels[mine.channel];
        channel.running = false;
        for (int index = 0; index < channel.dimensions; index++) {
            block.axes[channel.axes[index]].channel = -1;
            stop_axis(block, channel.axes[index], dec, true);
        }
        return ErrorCode::None;
    }
    const double slope = quick ? block.system.motionParam[axis].quickStopDec
                         : dec > 0 ? dec : std::max(mine.dec, 1e-6);
    if (status.opState == OperationState::Stop && !quick && dec <= 0) return ErrorCode::None;
    const Path path = path_to_speed(mine.command, mine.velocity, 0, slope, slope);
    begin(block, axis, path, OperationState::Stop,
          quick ? DetailOperationState::Stop_QStop : DetailOperationState::Stop, false,
          {slope, slope});
    return ErrorCode::None;
}

// Interpolated axes: the rate of their path falls evenly, also when it was falling already.
int stop_within(Block &block, int axis, double seconds) {
    if (int code = check_axis(block, axis)) return code;
    const Axis &mine = block.axes[axis];
    if (mine.channel < 0)
        return stop_axis(block, axis, std::max(std::fabs(mine.velocity), 1e-9) / seconds);
    Channel &channel = block.channels[mine.channel];
    block.status.axesStatus[axis].motionComplete = false;
    channel.stopping = channel.timed = true;
    channel.rate_slope = channel.rate / seconds;
    return ErrorCode::None;
}

void interrupt(Block &block, int axis) {
    Axis &mine = block.axes[axis];
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    if (mine.queue.executing) end_queue(block, axis, SERVO_OFF);
    if (mine.channel >= 0) {
        Channel &channel = block.channels[mine.channel];
        mine.channel = -1;
        if (block.system.motionParam[axis].interruptedIntplUseQuickStop)
            for (int index = 0; index < channel.dimensions; index++)
                stop_axis(block, channel.axes[index], 0, true);
        else
            channel.stopping = true;
    }
    mine.velocity = 0;
    mine.completes = false;
    status.torqueCmd = 0;
    status.motionPaused = false;
    status.opState = OperationState::Idle;
    status.detailOpState = DetailOperationState::Idle;
    status.motionComplete = status.posSet = status.delayedPosSet = false;
}

void set_home(Block &block, int axis, double position) {
    Axis &mine = block.axes[axis];
    mine.home_counts = mine.counts - position * counts_per_unit(block, axis);
    mine.command = position;
    mine.sent_counts = mine.counts;
    if (block.axis.absoluteEncoderMode[axis])
        block.axis.absoluteEncoderHomeOffset[axis] = mine.home_counts;
}

void rescale(Block &block, int axis) {
    Axis &mine = block.axes[axis];
    mine.command = (mine.counts - mine.home_counts) / counts_per_unit(block, axis);
    mine.velocity = 0;
}

}  // namespace standin
