// One device of the engine and what hangs on it. One call of the SDK per function.
#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <string>
#include <vector>

// The SDK's headers define names that others use too: they come last.
#include <AdvancedMotionApi.h>
#include <CoreMotionApi.h>
#include <EcApi.h>
#include <IOApi.h>
#include <WMX3Api.h>

namespace robotd {

namespace nb = nanobind;

// Class of an error code, by which its text is found; the order of ErrorClass in _native.pyi.
enum class Api { Engine, CoreMotion, AdvancedMotion, Io, Ecat, CyclicBuffer };

// An SDK call that did not return 0; becomes _native.CallError.
struct CallFailed {
    std::string call;
    Api api;
    int code;
};

// Throws CallFailed unless `code` is 0.
void check(const char *call, Api api, long code);

// The call with the name and the number of its error, for people.
std::string describe(const CallFailed &failed);

class Device {
public:
    wmx3Api::WMX3Api engine;
    wmx3Api::CoreMotion core;
    wmx3Api::AdvancedMotion advanced;
    wmx3Api::Io io;
    wmx3Api::ecApi::Ecat ecat;

    Device() : core(&engine), advanced(&engine), io(&engine), ecat(&engine) {}
};

inline wmx3Api::AxisSelection selection(const std::vector<int> &axes) {
    wmx3Api::AxisSelection chosen;
    if (axes.size() > static_cast<std::size_t>(wmx3Api::constants::maxAxes))
        throw nb::value_error("too many axes");
    chosen.axisCount = static_cast<int>(axes.size());
    for (std::size_t index = 0; index < axes.size(); index++) chosen.axis[index] = axes[index];
    return chosen;
}

void bind_errors(nb::module_ &module);
void bind_device(nb::class_<Device> &device, nb::module_ &module);
void bind_status(nb::module_ &module);
void bind_motion(nb::class_<Device> &device);
void bind_io(nb::class_<Device> &device);
void bind_ecat(nb::class_<Device> &device, nb::module_ &module);
void bind_position_stream(nb::module_ &module);  // where the SDK has cyclic buffers

using Unlocked = nb::call_guard<nb::gil_scoped_release>;

}  // namespace robotd
