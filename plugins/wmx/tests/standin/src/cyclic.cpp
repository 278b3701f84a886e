// libcyclicbufferapi: commands for every cycle of the engine, executed one after the other.
#include "CyclicBufferApi.h"

#include <cmath>

#include "client.hpp"

using namespace standin;

namespace {
using Codes = CyclicBufferErrorCode;

// Runs `command(block, axis)` for the axes of a selection in their order, up to the first failure.
template <class Command>
int in_order(WMX3Api *api, const AxisSelection *selection, Command command) {
    if (!selection) return ErrorCode::ArgumentIsNull;
    return with_engine(api, [&](Block &block) -> int {
        for (int index = 0; index < selection->axisCount; index++) {
            if (int code = check_axis(block, selection->axis[index])) return code;
            if (int code = command(block, selection->axis[index])) return code;
        }
        return ErrorCode::None;
    });
}

template <class Command>
int only(WMX3Api *api, int axis, Command command) {
    const AxisSelection selection(1, &axis);
    return in_order(api, &selection, command);
}

auto open_buffer(unsigned int commands) {
    return [commands](Block &block, int axis) -> int {
        CyclicQueue &queue = block.axes[axis].queue;
        if (queue.capacity) return Codes::BufferAlreadyOpened;
        if (commands < 1 || commands > CYCLIC_COMMANDS) return ErrorCode::RequestedBufferTooLarge;
        queue.first = queue.count = queue.done = queue.cycles = 0;
        queue.state = STOPPED;
        queue.capacity = commands;
        return ErrorCode::None;
    };
}

int abort_buffer(Block &block, int axis) {
    if (!block.axes[axis].queue.capacity) return Codes::BufferIsNotOpened;
    end_queue(block, axis, STOPPED);
    return ErrorCode::None;
}

int close_buffer(Block &block, int axis) {
    if (int code = abort_buffer(block, axis)) return code;
    block.axes[axis].queue.capacity = 0;
    return ErrorCode::None;
}

// `of(index)` is the command number `index` for this axis.
template <class Of>
int add(Block &block, int axis, int count, Of of) {
    CyclicQueue &queue = block.axes[axis].queue;
    if (!queue.capacity) return Codes::BufferIsNotOpened;
    if (count < 0 || queue.count + count > queue.capacity) return Codes::BufferSizeIsNotEnough;
    for (int index = 0; index < count; index++) {
        const CyclicBufferSingleAxisCommand command = of(index);
        if (!std::isfinite(command.command) || command.intervalCycles < 1)
            return ErrorCode::ArgumentOutOfRange;
        queue.commands[(queue.first + queue.count++) % CYCLIC_COMMANDS] = {
            command.command, command.intervalCycles,
            command.type == CyclicBufferCommandType::RelativePos, block.cycle};
    }
    return ErrorCode::None;
}

auto execute(const CyclicBufferSingleAxisOption *options, bool by_axis) {
    return [=](Block &block, int axis) -> int {
        CyclicQueue &queue = block.axes[axis].queue;
        CoreMotionAxisStatus &status = block.status.axesStatus[axis];
        if (!queue.capacity) return Codes::BufferIsNotOpened;
        if (queue.executing) return ErrorCode::None;
        if (int code = check_motion(block, axis, AxisCommandMode::Position)) return code;
        if (status.opState != OperationState::Idle) return ErrorCode::NotIdleState;
        queue.executing = true;
        queue.state = WAITING;
        queue.max_acc = options ? options[by_axis ? axis : 0].maxAcc : 0;
        queue.done = queue.cycles = 0;
        status.opState = OperationState::DirectControl;
        status.detailOpState = DetailOperationState::DirectControl;
        status.motionComplete = false;
        return ErrorCode::None;
    };
}

#if STANDIN_CYCLIC_BUFFER == 1
int quick_stop(Block &block, int axis) {
    const CyclicQueue &queue = block.axes[axis].queue;
    if (!queue.capacity) return Codes::BufferIsNotOpened;
    return queue.executing ? brake_queue(block, axis, STOPPED) : 0;
}
#endif

auto status_of(CyclicBufferSingleAxisStatus *statuses, bool by_axis) {
    return [=](Block &block, int axis) -> int {
        const CyclicQueue &queue = block.axes[axis].queue;
        if (!queue.capacity) return Codes::BufferIsNotOpened;
        CyclicBufferSingleAxisStatus &status = statuses[by_axis ? axis : 0];
        const bool known = queue.state <= MAX_ACC_ERROR || STANDIN_CYCLIC_BUFFER == 1;
        status.state = static_cast<CyclicBufferState::T>(known ? queue.state : STOPPED);
        status.remainCount = queue.count;
        status.availableCount = queue.capacity;
        return ErrorCode::None;
    };
}
}  // namespace

namespace wmx3Api {

CyclicBuffer::CyclicBuffer() : wmx3Api(nullptr) {}
CyclicBuffer::CyclicBuffer(WMX3Api *f) : wmx3Api(f) {}
bool CyclicBuffer::IsDeviceValid() { return wmx3Api && wmx3Api->IsDeviceValid(); }
WMX3APIFUNC CyclicBuffer::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode CyclicBufferErrorCode", pString, size);
}
WMX3APIFUNC CyclicBuffer::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}
WMX3APIFUNC CyclicBuffer::OpenCyclicBuffer(int axis, unsigned int numOfCycles) {
    return only(wmx3Api, axis, open_buffer(numOfCycles));
}
WMX3APIFUNC CyclicBuffer::OpenCyclicBuffer(AxisSelection *axes, unsigned int numOfCycles) {
    return in_order(wmx3Api, axes, open_buffer(numOfCycles));
}
WMX3APIFUNC CyclicBuffer::CloseCyclicBuffer(int axis) { return only(wmx3Api, axis, close_buffer); }
WMX3APIFUNC CyclicBuffer::CloseCyclicBuffer(AxisSelection *axes) {
    return in_order(wmx3Api, axes, close_buffer);
}
WMX3APIFUNC CyclicBuffer::AddCommand(int axis, CyclicBufferSingleAxisCommand *pCmd) {
    return AddCommand(axis, pCmd, 1);
}
WMX3APIFUNC CyclicBuffer::AddCommand(int axis, CyclicBufferSingleAxisCommand *pCmd, int count) {
    if (!pCmd) return ErrorCode::ArgumentIsNull;
    return only(wmx3Api, axis, [=](Block &block, int which) {
        return add(block, which, count, [=](int index) { return pCmd[index]; });
    });
}
WMX3APIFUNC CyclicBuffer::AddCommand(AxisSelection *axes, CyclicBufferMultiAxisCommands *pCmds) {
    return AddCommand(axes, pCmds, 1);
}
// As documented: axes before the first one that is full have got their commands.
WMX3APIFUNC CyclicBuffer::AddCommand(AxisSelection *axes, CyclicBufferMultiAxisCommands *pCmds,
                                     int count) {
    if (!pCmds) return ErrorCode::ArgumentIsNull;
    return in_order(wmx3Api, axes, [=](Block &block, int which) {
        return add(block, which, count, [=](int index) { return pCmds[index].cmd[which]; });
    });
}
WMX3APIFUNC CyclicBuffer::Execute(int axis, CyclicBufferSingleAxisOption *pOption) {
    return only(wmx3Api, axis, execute(pOption, false));
}
WMX3APIFUNC CyclicBuffer::Execute(AxisSelection *axes, CyclicBufferMultiAxisOption *pOption) {
    return in_order(wmx3Api, axes, execute(pOption ? pOption->option : nullptr, true));
}
WMX3APIFUNC CyclicBuffer::Abort(int axis) { return only(wmx3Api, axis, abort_buffer); }
WMX3APIFUNC CyclicBuffer::Abort(AxisSelection *axes) { return in_order(wmx3Api, axes, abort_buffer); }
#if STANDIN_CYCLIC_BUFFER == 1
WMX3APIFUNC CyclicBuffer::ExecQuickStop(int axis) { return only(wmx3Api, axis, quick_stop); }
WMX3APIFUNC CyclicBuffer::ExecQuickStop(AxisSelection *axes) {
    return in_order(wmx3Api, axes, quick_stop);
}
#endif
WMX3APIFUNC CyclicBuffer::GetStatus(int axis, CyclicBufferSingleAxisStatus *pStatus) {
    if (!pStatus) return ErrorCode::ArgumentIsNull;
    return only(wmx3Api, axis, status_of(pStatus, false));
}
WMX3APIFUNC CyclicBuffer::GetStatus(AxisSelection *axes, CyclicBufferMultiAxisStatus *pStatus) {
    if (!pStatus) return ErrorCode::ArgumentIsNull;
    return in_order(wmx3Api, axes, status_of(pStatus->status, true));
}

}  // namespace wmx3Api
