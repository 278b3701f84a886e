// libcoremotionapi: homing and the position of zero.
#include "axes.hpp"

using namespace standin;

namespace wmx3Api {

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
WMX3APIFUNC Home::Continue(AxisSelection *selection) {
    return for_axes(cmApi, selection, [](Block &, int) -> int {
        return CoreMotionErrorCode::NotPausedDuringHoming;
    });
}
WMX3APIFUNC Home::Cancel(int axis) { return Continue(axis); }
WMX3APIFUNC Home::Cancel(AxisSelection *selection) { return Continue(selection); }

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

}  // namespace wmx3Api
