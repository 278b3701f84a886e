// One cycle of the engine.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "sim.hpp"

namespace standin {

namespace {
void power(Block &block, int index) {
    Axis &axis = block.axes[index];
    CoreMotionAxisStatus &status = block.status.axesStatus[index];
    if (axis.clear_alarm) {
        axis.clear_alarm = status.ampAlarm = false;
        status.ampAlarmCode = 0;
    }
    const bool off = status.servoOffline ||
                     (status.ampAlarm && block.system.alarmParam[index].servoOffDuringAmpAlarm);
    if (off) axis.servo_request = -1;
    if (axis.servo_request >= 0 && --axis.servo_delay <= 0) {
        const double error = std::fabs(axis.command * counts_per_unit(block, index) +
                                       axis.home_counts - axis.counts);
        const bool rejected =
            axis.servo_request && error > block.system.alarmParam[index].servoOnFollowingError;
        status.followingErrorAlarm = rejected;
        if (!rejected) status.servoOn = axis.servo_request;
        axis.servo_request = -1;
        if (!status.servoOn) interrupt(block, index);
    }
    if (off && status.servoOn) {
        status.servoOn = false;
        interrupt(block, index);
    }
    if (!status.servoOn && status.homeDone && block.system.homeParam[index].clearHomeDoneOnServoOff)
        status.homeDone = false;
    if (axis.mode_delay > 0) axis.mode_delay--;
}

void limits(Block &block, int index) {
    const Axis &axis = block.axes[index];
    CoreMotionAxisStatus &status = block.status.axesStatus[index];
    const Config::LimitParam &limit = block.system.limitParam[index];
    if (status.opState == OperationState::Idle || status.opState == OperationState::Stop) return;
    const bool soft = limit.softLimitType != Config::LimitSwitchType::None && status.homeDone;
    const double high = limit.softLimitPositivePos, low = limit.softLimitNegativePos;
    status.positiveSoftLimit = soft && high != 0 && axis.command >= high;
    status.negativeSoftLimit = soft && low != 0 && axis.command <= low;
    const bool hard = limit.lsType != Config::LimitSwitchType::None;
    const bool up = (hard && status.positiveLS) || status.positiveSoftLimit;
    const bool down = (hard && status.negativeLS) || status.negativeSoftLimit;
    if ((up && axis.velocity > 0) || (down && axis.velocity < 0)) {
        if (axis.channel >= 0) stop_axis(block, index);
        else stop_axis(block, index, limit.lsDec);
    }
}

void move(Block &block, int index) {
    Axis &axis = block.axes[index];
    CoreMotionAxisStatus &status = block.status.axesStatus[index];
    if (axis.home_delay > 0 && --axis.home_delay == 0) {
        set_home(block, index, block.system.homeParam[index].homePosition);
        status.homeDone = true;
        status.opState = OperationState::Idle;
        status.detailOpState = DetailOperationState::Idle;
    }
    if (!status.servoOn) {
        axis.command = (axis.counts - axis.home_counts) / counts_per_unit(block, index);
        axis.velocity = 0;
        return;
    }
    limits(block, index);
    if (axis.queue.executing) return run_queue(block, index);
    const bool still =
        status.opState == OperationState::Idle || status.opState == OperationState::Trq;
    if (still || axis.channel >= 0 || axis.home_delay > 0) return;
    if (axis.run_cycles > 0 && --axis.run_cycles == 0) stop_axis(block, index);
    axis.time_s += CYCLE_S;
    axis.path.at(axis.time_s, axis.command, axis.velocity);
    const double rest_s = std::max(0.0, axis.path.duration_s - axis.time_s);
    status.profileRemainingMilliseconds = rest_s * 1000;
    status.profileCompletedMilliseconds = (axis.path.duration_s - rest_s) * 1000;
    const bool forever = status.motionPaused || status.opState == OperationState::Jog ||
                         status.opState == OperationState::Velocity;
    if (rest_s <= 1e-9 && !forever) {
        axis.path.at(axis.path.duration_s, axis.command, axis.velocity);
        axis.velocity = 0;
        status.opState = OperationState::Idle;
        status.detailOpState = DetailOperationState::Idle;
        status.motionComplete = axis.completes;
    }
}

void feed_back(Block &block, int index) {
    Axis &axis = block.axes[index];
    CoreMotionAxisStatus &status = block.status.axesStatus[index];
    const Config::FeedbackParam &widths = block.system.feedbackParam[index];
    const double scale = counts_per_unit(block, index), before = axis.counts;
    if (!axis.stuck && !status.servoOffline) axis.counts = axis.sent_counts;  // one cycle of lag
    if (status.servoOn) axis.sent_counts = std::rint(axis.command * scale + axis.home_counts);
    else axis.sent_counts = axis.counts;
    const double actual = (axis.counts - axis.home_counts) / scale;
    const bool position_mode = axis.mode == AxisCommandMode::Position;
    status.posCmd = position_mode ? axis.command : actual;
    status.actualPos = actual;
    status.compPosCmd = status.syncPosCmd = status.posCmd;
    status.compActualPos = status.syncActualPos = actual;
    status.encoderCommand = static_cast<int>(static_cast<long long>(axis.sent_counts));
    status.encoderFeedback = static_cast<int>(static_cast<long long>(axis.counts));
    status.accumulatedEncoderFeedback = static_cast<long long>(axis.counts);
    status.cmdAcc = (axis.velocity - status.velocityCmd) / CYCLE_S;
    status.velocityCmd = axis.velocity;
    status.actualVelocity = (axis.counts - before) / scale / CYCLE_S;
    status.velocityLag = status.velocityCmd - status.actualVelocity;
    status.actualFollowingError = axis.sent_counts - axis.counts;
    axis.torque_percent =
        status.servoOn ? 2 * status.actualVelocity + 0.5 * status.cmdAcc + status.torqueCmd : 0;
    status.actualTorque =
        std::isnan(axis.torque_override) ? axis.torque_percent : axis.torque_override;
    status.axisCommandMode = axis.mode;
#if STANDIN_NEWER_STATUS
    if (axis.mode_delay == 0) status.axisCommandModeFeedback = axis.mode;
#endif
    const bool idle = status.opState == OperationState::Idle;
    const double target = idle ? status.posCmd : status.profileTargetPos;
    const double error = std::fabs(actual - target);
    status.inPos = error <= widths.inPosWidth;
    status.cmdDistributionEnd = idle;
    status.commandReady = status.servoOn && idle;
    status.posSet = status.delayedPosSet =
        status.servoOn && idle && std::fabs(actual - status.posCmd) <= widths.posSetWidth;
    status.homeOffset = axis.home_counts / scale;
    block.absolute_counts[index] = axis.counts;
}

void io(Block &block) {
    if (block.faults.loop_back) std::memcpy(block.inputs, block.outputs, sizeof block.inputs);
}
}  // namespace

void tick(Block &block) {
    block.cycle++;
    CoreMotionStatus &status = block.status;
    const int axes = block.faults.drives;
    for (int slave = 0; slave < block.slave_count; slave++)
        if (const int axis = block.slaves[slave].axis; axis >= 0)
            status.axesStatus[axis].servoOffline = block.slaves[slave].lost;
    for (int axis = 0; axis < axes; axis++) power(block, axis);
    for (Channel &channel : block.channels)
        if (channel.running) move_channel(block, channel);
    for (int axis = 0; axis < axes; axis++) move(block, axis);
    for (int axis = 0; axis < axes; axis++) feed_back(block, axis);
    io(block);
    status.cycleCounter[0] = block.cycle;
    block.max_delay = std::max(block.max_delay, 9000u + static_cast<unsigned>(block.cycle % 200));
}

}  // namespace standin
