// Differences between editions of the SDK, detected by what compiles, not by version numbers.
#pragma once

#include <type_traits>
#include <utility>

#include <CoreMotionApi.h>

namespace robotd {

template <class Control, class = void>
struct TakesTime : std::false_type {};
template <class Control>
struct TakesTime<Control, std::void_t<decltype(std::declval<Control>().SetServoOn(0, 1, 0))>>
    : std::true_type {};

// Asks for the servo state and does not wait for it: the caller watches the status. Where a time
// can be given, 0 says so; that it is over says nothing of the request.
template <class Control>
int request_servo(Control &control, int axis, int on) {
    using Core = wmx3Api::CoreMotionErrorCode;
    if constexpr (TakesTime<Control>::value) {
        const int code = static_cast<int>(control.SetServoOn(axis, on, 0));
        return code == Core::ServoOnError || code == Core::WaitTimeout ? 0 : code;
    } else {
        return static_cast<int>(control.SetServoOn(axis, on));
    }
}

template <class Api, class = void>
struct HasExitFlag : std::false_type {};
template <class Api>
struct HasExitFlag<Api, std::void_t<decltype(std::declval<Api>().CloseDevice(false))>>
    : std::true_type {};

// Closes the device; the last one ends the engine, unless `keep_engine` can be asked for.
template <class Api>
int close_device(Api &api, bool keep_engine) {
    if constexpr (HasExitFlag<Api>::value) return static_cast<int>(api.CloseDevice(!keep_engine));
    else return static_cast<int>(api.CloseDevice());
}

template <class Axis, class = void>
struct HasModeFeedback : std::false_type {};
template <class Axis>
struct HasModeFeedback<Axis, std::void_t<decltype(std::declval<Axis>().axisCommandModeFeedback)>>
    : std::true_type {};

// Command mode reported by the drive, in editions that have it.
template <class Axis>
auto command_mode(const Axis &axis) {
    if constexpr (HasModeFeedback<Axis>::value) return axis.axisCommandModeFeedback;
    else return axis.axisCommandMode;
}

}  // namespace robotd
