// libcoremotionapi: the status of the axes, servos, alarms and modes.
#include <cstring>

#include "axes.hpp"

using namespace standin;

namespace {
int clear_amp_alarm(Block &block, int axis) {
    if (int code = check_drive(block, axis)) return code;
    block.axes[axis].clear_alarm = true;
    return ErrorCode::None;
}

int clear_axis_alarm(Block &block, int axis) {
    block.status.axesStatus[axis].followingErrorAlarm = false;
    return ErrorCode::None;
}
}  // namespace

namespace wmx3Api {

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
    if (!engine_alive(*block) || block->faults.status_lost) return ErrorCode::StatusChannelError;
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

// The flight recorder records nothing here.
WMX3APIFUNC CoreMotion::TriggerFlightRecorder() {
    return with_engine(wmx3Api, [](Block &) { return 0; });
}
WMX3APIFUNC CoreMotion::ResetFlightRecorder() { return TriggerFlightRecorder(); }

#if STANDIN_NEWER_STATUS
static int clear_vibration(Block &block, int axis) {
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    status.vibrationPosMin = status.vibrationPosMax = status.vibrationPosAvg = 0;
    return ErrorCode::None;
}
WMX3APIFUNC CoreMotion::ClearVibrationStatus(int axis) {
    return for_axis(this, axis, clear_vibration);
}
WMX3APIFUNC CoreMotion::ClearVibrationStatus(AxisSelection *selection) {
    return for_axes(this, selection, clear_vibration);
}
#endif

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

}  // namespace wmx3Api
