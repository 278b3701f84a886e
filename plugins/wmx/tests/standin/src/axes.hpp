// Commands to one axis or a selection of axes of a CoreMotion.
#pragma once

#include <algorithm>

#include "client.hpp"

namespace standin {

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

// A command for axes in one mode; others are rejected.
template <class Command>
auto in_mode(AxisCommandMode::T mode, Command command) {
    return [=](Block &block, int axis) -> int {
        const bool fits = block.status.axesStatus[axis].axisCommandMode == mode;
        if (fits) return command(block, axis);
        return mode == AxisCommandMode::Position   ? CoreMotionErrorCode::NotPosMode
               : mode == AxisCommandMode::Velocity ? CoreMotionErrorCode::NotVelocityMode
                                                   : CoreMotionErrorCode::NotTrqMode;
    };
}

inline int stop_normally(Block &block, int axis) { return stop_axis(block, axis); }
inline int stop_quickly(Block &block, int axis) { return stop_axis(block, axis, 0, true); }

// A stop that takes so long.
inline auto timed_stop(double milliseconds) {
    return [milliseconds](Block &block, int axis) {
        return stop_within(block, axis, std::max(milliseconds / 1000, CYCLE_S));
    };
}

// Runs `command(block, value)` for every command of a list, and waits until they are taken in.
template <class Command, class Value>
int each_command(CoreMotion *core, unsigned int count, Value *values, Command command) {
    if (!values) return ErrorCode::ArgumentIsNull;
    return with_motion(core->wmx3Api, [&](Block &block) -> int {
        for (unsigned int index = 0; index < count; index++)
            if (int code = command(block, values[index])) return code;
        return ErrorCode::None;
    });
}

}  // namespace standin
