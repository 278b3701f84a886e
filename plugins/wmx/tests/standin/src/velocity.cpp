// libcoremotionapi: velocity and torque mode.
#include "axes.hpp"

using namespace standin;

namespace {
const auto stop_velocity = in_mode(AxisCommandMode::Velocity, stop_normally);
const auto quick_velocity = in_mode(AxisCommandMode::Velocity, stop_quickly);
}  // namespace

namespace wmx3Api {

WMX3APIFUNC Velocity::StartVel(VelCommand *pCommand) { return StartVel(1u, pCommand); }
WMX3APIFUNC Velocity::StartVel(unsigned int numCommands, VelCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const VelCommand &command) {
        return start_speed(block, command.axis, command.profile, OperationState::Velocity);
    });
}
WMX3APIFUNC Velocity::StartVel(VelCommand *pCommand, double maxTrqLimit) {
    if (!pCommand) return ErrorCode::ArgumentIsNull;
    if (int code = cmApi->torque->SetMaxTrqLimit(pCommand->axis, maxTrqLimit)) return code;
    return StartVel(pCommand);
}
WMX3APIFUNC Velocity::StartVel(TimedVelCommand *pCommand) { return StartVel(1u, pCommand); }
WMX3APIFUNC Velocity::StartVel(unsigned int numCommands, TimedVelCommand *pCommands) {
    return each_command(cmApi, numCommands, pCommands, [](Block &block, const TimedVelCommand &each) {
        return start_speed(block, each.axis, each.profile, OperationState::Velocity,
                           each.runTimeMilliseconds);
    });
}
WMX3APIFUNC Velocity::OverrideVel(VelCommand *pCommand) { return StartVel(pCommand); }
WMX3APIFUNC Velocity::OverrideVel(unsigned int numCommands, VelCommand *pCommands) {
    return StartVel(numCommands, pCommands);
}
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

WMX3APIFUNC Velocity::ExecTimedStop(AxisSelection *selection, double milliseconds) {
    return for_axes(cmApi, selection, in_mode(AxisCommandMode::Velocity, timed_stop(milliseconds)));
}
WMX3APIFUNC Velocity::ExecTimedStop(unsigned int numCommands, TimeCommand *pCommands) {
    int result = ErrorCode::None;
    for (unsigned int index = 0; index < numCommands; index++)
        if (int code = ExecTimedStop(pCommands[index].axis, pCommands[index].timeMilliseconds))
            result = code;
    return result;
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

WMX3APIFUNC Torque::StartTrq(TrqCommand *pCommand) {
    return each_command(cmApi, 1, pCommand, [](Block &block, const TrqCommand &command) {
        return start_torque(block, command.axis, command.torque);
    });
}
WMX3APIFUNC Torque::StopTrq(int axis) {
    return for_axis(cmApi, axis, in_mode(AxisCommandMode::Torque, [](Block &block, int which) {
        interrupt(block, which);
        return 0;
    }));
}

}  // namespace wmx3Api
