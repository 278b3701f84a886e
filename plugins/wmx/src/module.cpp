// The Python module `_native`: constants of the SDK, and what each of the other files binds.
#include "native.hpp"

using namespace robotd;

NB_MODULE(_native, module) {
    nb::set_leak_warnings(false);  // threads of the engine may outlive the interpreter
    module.attr("SDK_PATH") = WMX3_SDK_ROOT;
    module.attr("MAX_AXES") = static_cast<int>(wmx3Api::constants::maxAxes);
    module.attr("MAX_SPLINE_AXES") = static_cast<int>(wmx3Api::constants::maxSplineDimensions);
    module.attr("SPLINE_CHANNELS") = static_cast<int>(wmx3Api::constants::maxSplineChannel);
    module.attr("INPUT_BYTES") = static_cast<int>(wmx3Api::constants::maxIoInSize);
    module.attr("OUTPUT_BYTES") = static_cast<int>(wmx3Api::constants::maxIoOutSize);
    module.attr("MAX_MASTERS") = static_cast<int>(wmx3Api::ecApi::constants::maxMasters);
    module.attr("CYCLIC_BUFFER") = static_cast<bool>(ROBOTD_CYCLIC_BUFFER);
    bind_errors(module);
    nb::class_<Device> device(module, "Device");
    bind_device(device, module);
    bind_status(module);
    bind_motion(device);
    bind_io(device);
    bind_ecat(device, module);
#if ROBOTD_CYCLIC_BUFFER
    bind_position_stream(module);
#endif
}
