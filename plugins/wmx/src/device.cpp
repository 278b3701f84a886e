// The life of a device and of the engine behind it.
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>
#include <vector>

#include "native.hpp"
#include "detect.hpp"

namespace robotd {

namespace {
using namespace wmx3Api;

// Numbers of our own, so that nothing in Python depends on the SDK's.
enum class State { Idle, Running, Communicating, Shutdown, Unknown };

State state_of(EngineState::T state) {
    switch (state) {
        case EngineState::Idle: return State::Idle;
        case EngineState::Running: return State::Running;
        case EngineState::Communicating: return State::Communicating;
        case EngineState::Shutdown: return State::Shutdown;
        default: return State::Unknown;
    }
}

State engine_state(Device &device) {
    EngineStatus status;
    check("GetEngineStatus", Api::Engine, device.engine.GetEngineStatus(&status));
    return state_of(status.state);
}

std::vector<std::tuple<unsigned int, std::string>> devices(Device &device) {
    auto all = std::make_unique<DevicesInfoA>();
    check("GetAllDevices", Api::Engine, device.engine.GetAllDevices(all.get()));
    std::vector<std::tuple<unsigned int, std::string>> found;
    for (unsigned int index = 0; index < all->count; index++)
        found.emplace_back(all->devices[index].id, all->devices[index].name);
    return found;
}

int device_id(Device &device) {
    int id = -1;
    check("GetDeviceID", Api::Engine, device.engine.GetDeviceID(&id));
    return id;
}

std::tuple<int, int, int, int> library_version() {
    int major = 0, minor = 0, revision = 0, fix = 0;
    check("GetLibVersion", Api::Engine, WMX3Api::GetLibVersion(&major, &minor, &revision, &fix));
    return {major, minor, revision, fix};
}
}  // namespace

void bind_device(nb::class_<Device> &device, nb::module_ &module) {
    nb::enum_<State>(module, "State")
        .value("IDLE", State::Idle)
        .value("RUNNING", State::Running)
        .value("COMMUNICATING", State::Communicating)
        .value("SHUTDOWN", State::Shutdown)
        .value("UNKNOWN", State::Unknown);
    module.def("library_version", &library_version);
    device.def(nb::init<>())
        .def("create", [](Device &self, const std::string &path, unsigned int wait_ms) {
            check("CreateDevice", Api::Engine,
                  self.engine.CreateDevice(path.c_str(), DeviceType::DeviceTypeNormal, wait_ms));
        }, Unlocked())
        .def("close", [](Device &self, bool keep_engine) {
            check("CloseDevice", Api::Engine, close_device(self.engine, keep_engine));
        }, Unlocked())
        .def("set_name", [](Device &self, const std::string &name) {
            check("SetDeviceName", Api::Engine, self.engine.SetDeviceName(name.c_str()));
        }, Unlocked())
        .def("set_watchdog", [](Device &self, unsigned int milliseconds) {
            check("SetWatchdog", Api::Engine, self.engine.SetWatchdog(milliseconds));
        }, Unlocked())
        .def("state", &engine_state, Unlocked())
        .def("devices", &devices, Unlocked())
        .def("id", &device_id, Unlocked())
        .def("start_communication", [](Device &self, unsigned int wait_ms) {
            check("StartCommunication", Api::Engine, self.engine.StartCommunication(wait_ms));
        }, Unlocked())
        .def("stop_communication", [](Device &self, unsigned int wait_ms) {
            check("StopCommunication", Api::Engine, self.engine.StopCommunication(wait_ms));
        }, Unlocked())
        .def("stop_engine", [](Device &self, unsigned int wait_ms) {
            check("StopEngine", Api::Engine, self.engine.StopEngine(wait_ms));
        }, Unlocked())
        .def("import_parameters", [](Device &self, std::string path) {
            check("ImportAndSetAll", Api::CoreMotion,
                  self.core.config->ImportAndSetAll(path.data()));
        }, Unlocked())
        .def("export_parameters", [](Device &self, std::string path) {
            check("GetAndExportAll", Api::CoreMotion,
                  self.core.config->GetAndExportAll(path.data()));
        }, Unlocked());
}

}  // namespace robotd
