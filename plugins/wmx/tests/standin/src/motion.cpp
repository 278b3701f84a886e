// libcoremotionapi: moves, jogs, stops and waiting in position mode.
#include "axes.hpp"

using namespace standin;

namespace {
const auto stop_position = in_mode(AxisCommandMode::Position, stop_normally);
const auto quick_position = in_mode(AxisCommandMode::Position, stop_quickly);

// Conditions that end a Wait before the axis is idle.
int wait_error(const CoreMotionAxisStatus &status) {
    if (status.servoOffline) return ErrorCode::ServoOffline;
    if (status.ampAlarm) return ErrorCode::AxisAmpAlarm;
    return status.servoOn ? ErrorCode::None : ErrorCode::ServoOff;
}

Motion::PosCommand running(const Block &block, int axis) {
    const Axis &mine = block.axes[axis];
    return Motion::PosCommand(axis, block.status.axesStatus[axis].profileTargetPos,
                              Profile::SetupTrapezoidal(mine.speed, mine.acc, mine.dec));
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

WMX3APIFUNC Motion::StartPos(PosCommand *pCommand) { return StartPos(1u, pCommand); }
WMX3APIFUNC Motion::StartPos(unsigned int numCommands, PosCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const PosCommand &command) {
        return start_move(block, command.axis, command.target, command.profile);
    });
}
WMX3APIFUNC Motion::StartMov(PosCommand *pCommand) { return StartMov(1u, pCommand); }
WMX3APIFUNC Motion::StartMov(unsigned int numCommands, PosCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const PosCommand &command) {
        if (int code = check_axis(block, command.axis)) return code;
        const CoreMotionAxisStatus &status = block.status.axesStatus[command.axis];
        const double from = status.opState == OperationState::Pos
                                ? status.profileTargetPos : block.axes[command.axis].command;
        return start_move(block, command.axis, from + command.target, command.profile);
    });
}
WMX3APIFUNC Motion::StartJog(JogCommand *pCommand) { return StartJog(1u, pCommand); }
WMX3APIFUNC Motion::StartJog(unsigned int numCommands, JogCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const JogCommand &jog) {
#if STANDIN_NEWER_STATUS
        const double run_ms = jog.standinRunTime;
#else
        const double run_ms = 0;
#endif
        return start_speed(block, jog.axis, jog.profile, OperationState::Jog, run_ms);
    });
}
WMX3APIFUNC Motion::StartJog(TimedJogCommand *pCommand) { return StartJog(1u, pCommand); }
WMX3APIFUNC Motion::StartJog(unsigned int numCommands, TimedJogCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const TimedJogCommand &jog) {
        return start_speed(block, jog.axis, jog.profile, OperationState::Jog,
                           jog.runTimeMilliseconds);
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
WMX3APIFUNC Motion::ExecTimedStop(int axis, double milliseconds) {
    return for_axis(cmApi, axis, timed_stop(milliseconds));
}
WMX3APIFUNC Motion::ExecTimedStop(AxisSelection *selection, double milliseconds) {
    return for_axes(cmApi, selection, timed_stop(milliseconds));
}
WMX3APIFUNC Motion::ExecTimedStop(unsigned int numCommands, TimeCommand *pCommands) {
    int result = ErrorCode::None;
    for (unsigned int index = 0; index < numCommands; index++)
        if (int code = ExecTimedStop(pCommands[index].axis, pCommands[index].timeMilliseconds))
            result = code;
    return result;
}
WMX3APIFUNC Motion::Pause(int axis) { return for_axis(cmApi, axis, pause_move); }
WMX3APIFUNC Motion::Pause(AxisSelection *selection) {
    return for_axes(cmApi, selection, pause_move);
}
WMX3APIFUNC Motion::Resume(int axis) { return for_axis(cmApi, axis, resume_move); }
WMX3APIFUNC Motion::Resume(AxisSelection *selection) {
    return for_axes(cmApi, selection, resume_move);
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
// Values that are not overridden stay; jerk is not simulated.
#define OVERRIDE(name, change)                                                                \
    WMX3APIFUNC Motion::Override##name(PosCommand *pCommand) {                                \
        return Override##name(1u, pCommand);                                                  \
    }                                                                                         \
    WMX3APIFUNC Motion::Override##name(unsigned int numCommands, PosCommand *pCommands) {     \
        return each_command(cmApi, numCommands, pCommands, [](Block &block, PosCommand &wanted) { \
            if (int code = check_axis(block, wanted.axis)) return code;                       \
            PosCommand now = running(block, wanted.axis);                                     \
            const auto state = block.status.axesStatus[wanted.axis].opState;                  \
            if (state != OperationState::Pos)                                                 \
                return static_cast<int>(CoreMotionErrorCode::NotPosState);                    \
            change;                                                                           \
            return start_move(block, now.axis, now.target, now.profile);                      \
        });                                                                                   \
    }
OVERRIDE(Pos, now.target = wanted.target)
OVERRIDE(Mov, now.target += wanted.target)
OVERRIDE(Vel, now.profile.velocity = wanted.profile.velocity)
OVERRIDE(Acc, now.profile.acc = wanted.profile.acc)
OVERRIDE(Dec, now.profile.dec = wanted.profile.dec)
OVERRIDE(JerkAcc, now.profile.jerkAcc = wanted.profile.jerkAcc)
OVERRIDE(JerkDec, now.profile.jerkDec = wanted.profile.jerkDec)
OVERRIDE(Profile, now.profile = wanted.profile)

}  // namespace wmx3Api
