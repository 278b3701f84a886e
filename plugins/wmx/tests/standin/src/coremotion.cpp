// libcoremotionapi: status, axis control, homing, motion, velocity, torque.
#include <algorithm>
#include <cstring>

#include "client.hpp"

using namespace standin;

namespace {
// Runs `command(block, axis)` for every axis of a selection, checked whole first.
template <class Command>
int each_axis(Block &block, const AxisSelection *selection, Command command) {
    if (!selection) return ErrorCode::ArgumentIsNull;
    const int count = selection->axisCount;
    if (count < 1 || count > AXES) return ErrorCode::AxisCountOutOfRange;
    const int *first = selection->axis, *last = first + count;
    for (const int *axis = first; axis != last; axis++) {
        if (*axis < 0 || *axis >= AXES) return ErrorCode::AxisOutOfRange;
        if (std::count(first, last, *axis) > 1) return ErrorCode::DuplicateAxis;
    }
    int result = ErrorCode::None;
    for (const int *axis = first; axis != last; axis++)
        if (int code = command(block, *axis)) result = code;
    return result;
}

template <class Command>
int for_axes(CoreMotion *core, const AxisSelection *selection, Command command) {
    return with_engine(core->wmx3Api,
                       [&](Block &block) { return each_axis(block, selection, command); });
}

template <class Command>
int for_axis(CoreMotion *core, int axis, Command command) {
    const AxisSelection selection(1, &axis);
    return for_axes(core, &selection, command);
}

int clear_amp_alarm(Block &block, int axis) {
    if (int code = check_drive(block, axis)) return code;
    block.axes[axis].clear_alarm = true;
    return ErrorCode::None;
}

int clear_axis_alarm(Block &block, int axis) {
    block.status.axesStatus[axis].followingErrorAlarm = false;
    return ErrorCode::None;
}

int stop_normally(Block &block, int axis) { return stop_axis(block, axis); }
int stop_quickly(Block &block, int axis) { return stop_axis(block, axis, 0, true); }

// Stops of one family refuse axes in the other family's mode.
template <class Command>
auto in_mode(AxisCommandMode::T mode, Command command) {
    return [=](Block &block, int axis) -> int {
        const bool fits = block.status.axesStatus[axis].axisCommandMode == mode;
        if (fits) return command(block, axis);
        return mode == AxisCommandMode::Position ? CoreMotionErrorCode::NotPosMode
                                                 : CoreMotionErrorCode::NotVelocityMode;
    };
}

const auto stop_position = in_mode(AxisCommandMode::Position, stop_normally);
const auto quick_position = in_mode(AxisCommandMode::Position, stop_quickly);
const auto stop_velocity = in_mode(AxisCommandMode::Velocity, stop_normally);
const auto quick_velocity = in_mode(AxisCommandMode::Velocity, stop_quickly);

// What ends a Wait before the axis is idle.
int wait_error(const CoreMotionAxisStatus &status) {
    if (status.servoOffline) return ErrorCode::ServoOffline;
    if (status.ampAlarm) return ErrorCode::AxisAmpAlarm;
    return status.servoOn ? ErrorCode::None : ErrorCode::ServoOff;
}

int wait_idle(CoreMotion *core, const int *axes, int count, unsigned int milliseconds) {
    if (int code = with_engine(core->wmx3Api, [](Block &) { return 0; })) return code;
    int result = ErrorCode::None;
    const bool done = wait_for(milliseconds, [&](Block &block) {
        if (!engine_alive(block)) return (result = CoreMotionErrorCode::WaitEngineError) != 0;
        bool idle = true;
        for (int index = 0; index < count; index++) {
            const CoreMotionAxisStatus &status = block.status.axesStatus[axes[index]];
            if (!result) result = wait_error(status);
            idle = idle && status.opState == OperationState::Idle;
        }
        return idle || result;
    });
    return done ? result : static_cast<int>(CoreMotionErrorCode::WaitTimeout);
}
}  // namespace

namespace wmx3Api {

// ---------------------------------------------------------------- CoreMotion

static void bind(CoreMotion &core) {
    core.axisControl = new AxisControl(&core);
    core.motion = new Motion(&core);
    core.home = new Home(&core);
    core.velocity = new Velocity(&core);
    core.torque = new Torque(&core);
    core.sync = new Sync(&core);
    core.config = new Config(&core);
}

CoreMotion::CoreMotion() : wmx3Api(nullptr) { bind(*this); }
CoreMotion::CoreMotion(WMX3Api *f) : wmx3Api(f) { bind(*this); }
CoreMotion::CoreMotion(const CoreMotion &other) : wmx3Api(other.wmx3Api) { bind(*this); }
CoreMotion &CoreMotion::operator=(const CoreMotion &other) {
    wmx3Api = other.wmx3Api;
    return *this;
}
CoreMotion::~CoreMotion() {
    delete axisControl;
    delete motion;
    delete home;
    delete velocity;
    delete torque;
    delete sync;
    delete config;
}

bool CoreMotion::IsDeviceValid() { return wmx3Api && wmx3Api->IsDeviceValid(); }
bool CoreMotionPart::IsDeviceValid() { return cmApi->IsDeviceValid(); }

WMX3APIFUNC CoreMotion::GetStatus(CoreMotionStatus *pStatus) {
    if (!pStatus) return ErrorCode::ArgumentIsNull;
    if (!wmx3Api || !wmx3Api->dev) return ErrorCode::DeviceIsNull;
    Lock block;
    if (!engine_alive(*block)) return ErrorCode::StatusChannelError;
    std::memcpy(static_cast<void *>(pStatus), &block->status, sizeof *pStatus);
    return ErrorCode::None;
}

WMX3APIFUNC CoreMotion::GetVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}
WMX3APIFUNC CoreMotion::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}
WMX3APIFUNC CoreMotion::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode CoreMotionErrorCode", pString, size);
}

WMX3APIFUNC CoreMotion::ExecEStop(EStopLevel::T level) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (block.status.emergencyStop && level < block.status.emergencyStopLevel)
            return CoreMotionErrorCode::CurrentEmergencyStopLevelIsHigher;
        block.status.emergencyStop = true;
        block.status.emergencyStopLevel = level;
        for (int axis = 0; axis < AXES; axis++) stop_axis(block, axis, 0, true);
        return ErrorCode::None;
    });
}

WMX3APIFUNC CoreMotion::ReleaseEStop() {
    return with_engine(wmx3Api, [](Block &block) {
        block.status.emergencyStop = false;
        return 0;
    });
}

// --------------------------------------------------------------- AxisControl

static int switch_servo(CoreMotion *core, const AxisSelection *selection, int on, long wait) {
    int code = for_axes(core, selection, [on](Block &block, int axis) {
        return set_servo(block, axis, on != 0);
    });
    if (code || wait <= 0) return code;
    const bool done = wait_for(static_cast<unsigned int>(wait), [&](Block &block) {
        bool all = true;
        for (int index = 0; index < selection->axisCount; index++)
            all = all && block.status.axesStatus[selection->axis[index]].servoOn == (on != 0);
        return all;
    });
    return done ? static_cast<int>(ErrorCode::None)
                : static_cast<int>(CoreMotionErrorCode::ServoOnError);
}

#if STANDIN_SERVO_ON == 0 || STANDIN_SERVO_ON == 2
WMX3APIFUNC AxisControl::SetServoOn(int axis, int newStatus) {
    const AxisSelection one(1, &axis);
    return switch_servo(cmApi, &one, newStatus, 0);
}
WMX3APIFUNC AxisControl::SetServoOn(AxisSelection *selection, int newStatus) {
    return switch_servo(cmApi, selection, newStatus, 0);
}
#endif
#if STANDIN_SERVO_ON == 1
WMX3APIFUNC AxisControl::SetServoOn(int axis, int newStatus, unsigned int wait) {
    const AxisSelection one(1, &axis);
    return switch_servo(cmApi, &one, newStatus, wait);
}
WMX3APIFUNC AxisControl::SetServoOn(AxisSelection *selection, int newStatus, unsigned int wait) {
    return switch_servo(cmApi, selection, newStatus, wait);
}
#elif STANDIN_SERVO_ON >= 2
WMX3APIFUNC AxisControl::SetServoOn(int axis, int newStatus, int wait) {
    const AxisSelection one(1, &axis);
    return switch_servo(cmApi, &one, newStatus, wait);
}
WMX3APIFUNC AxisControl::SetServoOn(AxisSelection *selection, int newStatus, int wait) {
    return switch_servo(cmApi, selection, newStatus, wait);
}
#endif

WMX3APIFUNC AxisControl::ClearAmpAlarm(int axis) { return for_axis(cmApi, axis, clear_amp_alarm); }
WMX3APIFUNC AxisControl::ClearAmpAlarm(AxisSelection *selection) {
    return for_axes(cmApi, selection, clear_amp_alarm);
}
WMX3APIFUNC AxisControl::ClearAxisAlarm(int axis) {
    return for_axis(cmApi, axis, clear_axis_alarm);
}
WMX3APIFUNC AxisControl::ClearAxisAlarm(AxisSelection *selection) {
    return for_axes(cmApi, selection, clear_axis_alarm);
}
WMX3APIFUNC AxisControl::SetAxisCommandMode(int axis, AxisCommandMode::T mode) {
    return for_axis(cmApi, axis, [mode](Block &block, int which) {
        return set_mode(block, which, mode);
    });
}
WMX3APIFUNC AxisControl::SetAxisCommandMode(AxisSelection *selection, AxisCommandMode::T mode) {
    return for_axes(cmApi, selection, [mode](Block &block, int which) {
        return set_mode(block, which, mode);
    });
}

#define READ_VALUE(function, type, expression)                          \
    WMX3APIFUNC AxisControl::function(int axis, type *pValue) {         \
        return for_axis(cmApi, axis, [&](Block &block, int which) {     \
            const CoreMotionAxisStatus &status = block.status.axesStatus[which]; \
            *pValue = expression;                                       \
            return 0;                                                   \
        });                                                             \
    }
READ_VALUE(GetAxisCommandMode, AxisCommandMode::T, status.axisCommandMode)
READ_VALUE(GetPosCommand, double, status.posCmd)
READ_VALUE(GetPosFeedback, double, status.actualPos)
READ_VALUE(GetVelCommand, double, status.velocityCmd)
READ_VALUE(GetVelFeedback, double, status.actualVelocity)

// ---------------------------------------------------------------------- Home

WMX3APIFUNC Home::StartHome(int axis) {
    return with_motion(cmApi->wmx3Api, [&](Block &block) {
        const AxisSelection one(1, &axis);
        return each_axis(block, &one, start_home);
    });
}
WMX3APIFUNC Home::StartHome(AxisSelection *selection) {
    return with_motion(cmApi->wmx3Api,
                       [&](Block &block) { return each_axis(block, selection, start_home); });
}
WMX3APIFUNC Home::Continue(int axis) {
    return for_axis(cmApi, axis, [](Block &, int) -> int {
        return CoreMotionErrorCode::NotPausedDuringHoming;
    });
}
WMX3APIFUNC Home::Cancel(int axis) { return Continue(axis); }

static int relabel(Block &block, int axis, double position) {
    if (int code = check_axis(block, axis)) return code;
    if (block.status.axesStatus[axis].opState != OperationState::Idle)
        return ErrorCode::NotIdleState;
    set_home(block, axis, position);
    return ErrorCode::None;
}
WMX3APIFUNC Home::SetCommandPos(int axis, double position) {
    return for_axis(cmApi, axis, [&](Block &block, int which) {
        return relabel(block, which, position);
    });
}
WMX3APIFUNC Home::SetFeedbackPos(int axis, double position) { return SetCommandPos(axis, position); }
WMX3APIFUNC Home::SetCommandPosToFeedbackPos(int axis, double) {
    return for_axis(cmApi, axis, [](Block &block, int which) -> int {
        if (block.status.axesStatus[which].opState != OperationState::Idle)
            return ErrorCode::NotIdleState;
        rescale(block, which);
        return ErrorCode::None;
    });
}
WMX3APIFUNC Home::SetHomeDone(int axis, unsigned char value) {
    return for_axis(cmApi, axis, [value](Block &block, int which) {
        block.status.axesStatus[which].homeDone = value != 0;
        return 0;
    });
}

// -------------------------------------------------------------------- Motion

WMX3APIFUNC Motion::StartPos(PosCommand *pCommand) { return StartPos(1u, pCommand); }
WMX3APIFUNC Motion::StartPos(unsigned int numCommands, PosCommand *pCommands) {
    if (!pCommands) return ErrorCode::ArgumentIsNull;
    return with_motion(cmApi->wmx3Api, [&](Block &block) {
        for (unsigned int index = 0; index < numCommands; index++) {
            const PosCommand &command = pCommands[index];
            if (int code = start_move(block, command.axis, command.target, command.profile))
                return code;
        }
        return 0;
    });
}
WMX3APIFUNC Motion::StartMov(PosCommand *pCommand) { return StartMov(1u, pCommand); }
WMX3APIFUNC Motion::StartMov(unsigned int numCommands, PosCommand *pCommands) {
    if (!pCommands) return ErrorCode::ArgumentIsNull;
    return with_motion(cmApi->wmx3Api, [&](Block &block) {
        for (unsigned int index = 0; index < numCommands; index++) {
            const PosCommand &command = pCommands[index];
            if (int code = check_axis(block, command.axis)) return code;
            const CoreMotionAxisStatus &status = block.status.axesStatus[command.axis];
            const double from = status.opState == OperationState::Pos
                                    ? status.profileTargetPos : block.axes[command.axis].command;
            if (int code = start_move(block, command.axis, from + command.target, command.profile))
                return code;
        }
        return 0;
    });
}
WMX3APIFUNC Motion::StartJog(JogCommand *pCommand) { return StartJog(1u, pCommand); }
WMX3APIFUNC Motion::StartJog(unsigned int numCommands, JogCommand *pCommands) {
    if (!pCommands) return ErrorCode::ArgumentIsNull;
    return with_motion(cmApi->wmx3Api, [&](Block &block) {
        for (unsigned int index = 0; index < numCommands; index++)
            if (int code = start_speed(block, pCommands[index].axis, pCommands[index].profile,
                                       OperationState::Jog))
                return code;
        return 0;
    });
}
WMX3APIFUNC Motion::StartLinearIntplPos(LinearIntplCommand *pCommand) {
    return with_motion(cmApi->wmx3Api,
                       [&](Block &block) { return start_line(block, *pCommand, false); });
}
WMX3APIFUNC Motion::StartLinearIntplMov(LinearIntplCommand *pCommand) {
    return with_motion(cmApi->wmx3Api,
                       [&](Block &block) { return start_line(block, *pCommand, true); });
}
WMX3APIFUNC Motion::Stop(int axis) { return for_axis(cmApi, axis, stop_position); }
WMX3APIFUNC Motion::Stop(int axis, double dec) {
    return for_axis(cmApi, axis, [dec](Block &block, int which) {
        return stop_axis(block, which, dec);
    });
}
WMX3APIFUNC Motion::Stop(AxisSelection *selection) {
    return for_axes(cmApi, selection, stop_position);
}
WMX3APIFUNC Motion::Stop(unsigned int numCommands, StopCommand *pCommands) {
    int result = ErrorCode::None;
    for (unsigned int index = 0; index < numCommands; index++)
        if (int code = Stop(pCommands[index].axis, pCommands[index].dec)) result = code;
    return result;
}
WMX3APIFUNC Motion::ExecQuickStop(int axis) { return for_axis(cmApi, axis, quick_position); }
WMX3APIFUNC Motion::ExecQuickStop(AxisSelection *selection) {
    return for_axes(cmApi, selection, quick_position);
}
static auto timed_stop(double milliseconds) {
    return [milliseconds](Block &block, int axis) {
        const double speed = std::max(std::abs(block.axes[axis].velocity), 1e-9);
        return stop_axis(block, axis, speed / std::max(milliseconds / 1000, CYCLE_S));
    };
}
WMX3APIFUNC Motion::ExecTimedStop(int axis, double milliseconds) {
    return for_axis(cmApi, axis, timed_stop(milliseconds));
}
WMX3APIFUNC Motion::ExecTimedStop(AxisSelection *selection, double milliseconds) {
    return for_axes(cmApi, selection, timed_stop(milliseconds));
}
WMX3APIFUNC Motion::Wait(int axis) { return wait_idle(cmApi, &axis, 1, INFINITE); }
WMX3APIFUNC Motion::Wait(AxisSelection *selection) { return Wait(selection, INFINITE); }
WMX3APIFUNC Motion::Wait(WaitCondition *condition) { return Wait(condition, INFINITE); }
WMX3APIFUNC Motion::Wait(int axis, unsigned int wait) { return wait_idle(cmApi, &axis, 1, wait); }
WMX3APIFUNC Motion::Wait(AxisSelection *selection, unsigned int wait) {
    return wait_idle(cmApi, selection->axis, selection->axisCount, wait);
}
WMX3APIFUNC Motion::Wait(WaitCondition *condition, unsigned int wait) {
    if (condition->waitConditionType != WaitConditionType::AxisIdle)
        return ErrorCode::NoSupportedFunction;
    return wait_idle(cmApi, condition->axis, condition->axisCount, wait);
}
WMX3APIFUNC Motion::OverridePos(PosCommand *pCommand) { return StartPos(pCommand); }
WMX3APIFUNC Motion::OverrideVel(PosCommand *pCommand) {
    return with_motion(cmApi->wmx3Api, [&](Block &block) -> int {
        if (int code = check_axis(block, pCommand->axis)) return code;
        const CoreMotionAxisStatus &status = block.status.axesStatus[pCommand->axis];
        if (status.opState != OperationState::Pos) return CoreMotionErrorCode::NotPosState;
        return start_move(block, pCommand->axis, status.profileTargetPos, pCommand->profile);
    });
}

// ------------------------------------------------------------------ Velocity

WMX3APIFUNC Velocity::StartVel(VelCommand *pCommand) { return StartVel(1u, pCommand); }
WMX3APIFUNC Velocity::StartVel(unsigned int numCommands, VelCommand *pCommands) {
    if (!pCommands) return ErrorCode::ArgumentIsNull;
    return with_motion(cmApi->wmx3Api, [&](Block &block) {
        for (unsigned int index = 0; index < numCommands; index++)
            if (int code = start_speed(block, pCommands[index].axis, pCommands[index].profile,
                                       OperationState::Velocity))
                return code;
        return 0;
    });
}
WMX3APIFUNC Velocity::OverrideVel(VelCommand *pCommand) { return StartVel(pCommand); }
WMX3APIFUNC Velocity::Stop(int axis) { return for_axis(cmApi, axis, stop_velocity); }
WMX3APIFUNC Velocity::Stop(AxisSelection *selection) {
    return for_axes(cmApi, selection, stop_velocity);
}
WMX3APIFUNC Velocity::ExecQuickStop(int axis) { return for_axis(cmApi, axis, quick_velocity); }
WMX3APIFUNC Velocity::ExecQuickStop(AxisSelection *selection) {
    return for_axes(cmApi, selection, quick_velocity);
}

WMX3APIFUNC Velocity::ExecTimedStop(int axis, double milliseconds) {
    return for_axis(cmApi, axis, in_mode(AxisCommandMode::Velocity, timed_stop(milliseconds)));
}

#define COLUMN_VALUE(owner, set, get, member)                             \
    WMX3APIFUNC owner::set(int axis, double value) {                      \
        return for_axis(cmApi, axis, [&](Block &block, int which) -> int { \
            if (!(value >= 0)) return ErrorCode::ArgumentOutOfRange;      \
            block.axis.member[which] = value;                             \
            return ErrorCode::None;                                       \
        });                                                               \
    }                                                                     \
    WMX3APIFUNC owner::get(int axis, double *value) {                     \
        return for_axis(cmApi, axis, [&](Block &block, int which) {       \
            *value = block.axis.member[which];                            \
            return 0;                                                     \
        });                                                               \
    }
COLUMN_VALUE(Velocity, SetMaxMotorSpeed, GetMaxMotorSpeed, maxMotorSpeed)
COLUMN_VALUE(Torque, SetMaxTrqLimit, GetMaxTrqLimit, maxTrqLimit)
COLUMN_VALUE(Torque, SetPositiveTrqLimit, GetPositiveTrqLimit, positiveTrqLimit)
COLUMN_VALUE(Torque, SetNegativeTrqLimit, GetNegativeTrqLimit, negativeTrqLimit)

// The torque mode is not simulated.
WMX3APIFUNC Torque::StartTrq(TrqCommand *) { return ErrorCode::NoSupportedFunction; }
WMX3APIFUNC Torque::StopTrq(int) { return ErrorCode::NoSupportedFunction; }

}  // namespace wmx3Api
