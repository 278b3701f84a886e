// The state of the axes: straight into the process image's arrays, or as a snapshot.
#include <nanobind/ndarray.h>

#include <vector>

#include "native.hpp"
#include "detect.hpp"

namespace robotd {

namespace {
using namespace wmx3Api;

using Numbers = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Codes = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// robotd's Operation; a test compares the numbers.
enum Operation { IDLE, POSITION, VELOCITY, STREAM, HOMING, STOPPING };

Operation operation(OperationState::T state) {
    switch (state) {
        case OperationState::Idle: return IDLE;
        case OperationState::Pos: return POSITION;
        case OperationState::Jog:
        case OperationState::Velocity:
        case OperationState::ConstLinearVelocity: return VELOCITY;
        case OperationState::Home:
        case OperationState::GantryHome: return HOMING;
        case OperationState::Stop: return STOPPING;
        default: return STREAM;  // interpolations and whatever else leads the axis along
    }
}

int mode_of(AxisCommandMode::T mode) {
    switch (mode) {
        case AxisCommandMode::Velocity: return 1;
        case AxisCommandMode::Torque: return 2;
        default: return 0;
    }
}

void get_status(Device &device, CoreMotionStatus &status) {
    check("GetStatus", Api::CoreMotion, device.core.GetStatus(&status));
}

// Reads one device into arrays that it holds on to; shapes are (n_axes,). One thread.
class StatusReader {
public:
    StatusReader(Device &device, Numbers si_per_unit, Numbers torque_scale, Numbers position,
                 Numbers velocity, Numbers torque, Numbers position_command,
                 Numbers velocity_command, Flags servo_on, Flags amp_alarm, Flags offline,
                 Flags home_done, Flags home_switch, Flags negative_limit, Flags positive_limit,
                 Flags motion_complete, Codes alarm_code, Codes mode, Codes operation)
        : device_(device), status_(std::make_unique<CoreMotionStatus>()),
          axes_(position.shape(0)),
          numbers_{si_per_unit, torque_scale, position, velocity, torque, position_command,
                   velocity_command},
          flags_{servo_on, amp_alarm, offline, home_done, home_switch, negative_limit,
                 positive_limit, motion_complete},
          codes_{alarm_code, mode, operation} {
        bool fit = axes_ <= static_cast<std::size_t>(wmx3Api::constants::maxAxes);
        for (const Numbers &array : numbers_) fit = fit && array.shape(0) == axes_;
        for (const Flags &array : flags_) fit = fit && array.shape(0) == axes_;
        for (const Codes &array : codes_) fit = fit && array.shape(0) == axes_;
        if (!fit) throw nb::value_error("arrays must have one shape (n_axes,)");
    }

    // The engine's cycle counter. It does not count while nothing is exchanged.
    long long read() {
        {
            nb::gil_scoped_release unlocked;  // the watchdog of an engine that hangs needs it
            get_status(device_, *status_);
        }
        for (std::size_t axis = 0; axis < axes_; axis++) copy(axis, status_->axesStatus[axis]);
        return status_->cycleCounter[0];
    }

    bool communicating() const { return status_->engineState == EngineState::Communicating; }
    double cycle_ms() const { return status_->cycleTimeMilliseconds[0]; }

private:
    void copy(std::size_t axis, const CoreMotionAxisStatus &from) {
        const double scale = numbers_[0].data()[axis];
        numbers_[2].data()[axis] = from.actualPos * scale;
        numbers_[3].data()[axis] = from.actualVelocity * scale;
        numbers_[4].data()[axis] = from.actualTorque * numbers_[1].data()[axis];
        numbers_[5].data()[axis] = from.posCmd * scale;
        numbers_[6].data()[axis] = from.velocityCmd * scale;
        flags_[0].data()[axis] = from.servoOn;
        flags_[1].data()[axis] = from.ampAlarm;
        flags_[2].data()[axis] = from.servoOffline;
        flags_[3].data()[axis] = from.homeDone;
        flags_[4].data()[axis] = from.homeSwitch;
        flags_[5].data()[axis] = from.negativeLS;
        flags_[6].data()[axis] = from.positiveLS;
        flags_[7].data()[axis] = from.motionComplete && from.opState == OperationState::Idle;
        codes_[0].data()[axis] = from.ampAlarm ? from.ampAlarmCode : 0;
        codes_[1].data()[axis] = mode_of(command_mode(from));
        codes_[2].data()[axis] = operation(from.opState);
    }

    Device &device_;
    std::unique_ptr<CoreMotionStatus> status_;
    std::size_t axes_;
    Numbers numbers_[7];
    Flags flags_[8];
    Codes codes_[3];
};

// All axes at one moment, for worker threads. Units are the engine's.
class Snapshot {
public:
    explicit Snapshot(Device &device) : status(std::make_unique<CoreMotionStatus>()) {
        get_status(device, *status);
    }
    const CoreMotionAxisStatus &axis(int index) const {
        if (index < 0 || index >= wmx3Api::constants::maxAxes) throw nb::index_error("no such axis");
        return status->axesStatus[index];
    }
    std::unique_ptr<CoreMotionStatus> status;
};
}  // namespace

void bind_status(nb::module_ &module) {
    nb::class_<StatusReader>(module, "StatusReader")
        .def(nb::init<Device &, Numbers, Numbers, Numbers, Numbers, Numbers, Numbers, Numbers,
                      Flags, Flags, Flags, Flags, Flags, Flags, Flags, Flags, Codes, Codes, Codes>(),
             nb::keep_alive<1, 2>())
        .def("read", &StatusReader::read)
        .def_prop_ro("communicating", &StatusReader::communicating)
        .def_prop_ro("cycle_ms", &StatusReader::cycle_ms);

    nb::class_<Snapshot>(module, "Snapshot")
        .def(nb::init<Device &>(), Unlocked())
        .def_prop_ro("licence_invalid", [](const Snapshot &self) {
            return self.status->invalidLicenseError;
        })
        .def_prop_ro("emergency_stop", [](const Snapshot &self) {
            return self.status->emergencyStop;
        })
        .def("servo_on", [](const Snapshot &self, int axis) { return self.axis(axis).servoOn; })
        .def("offline", [](const Snapshot &self, int axis) { return self.axis(axis).servoOffline; })
        .def("alarm_code", [](const Snapshot &self, int axis) {
            const CoreMotionAxisStatus &status = self.axis(axis);
            return status.ampAlarm ? status.ampAlarmCode : 0;
        })
        .def("amp_alarm", [](const Snapshot &self, int axis) { return self.axis(axis).ampAlarm; })
        .def("following_error_alarm", [](const Snapshot &self, int axis) {
            return self.axis(axis).followingErrorAlarm;
        })
        .def("idle", [](const Snapshot &self, int axis) {
            return self.axis(axis).opState == OperationState::Idle;
        })
        .def("interpolating", [](const Snapshot &self, int axis) {
            return self.axis(axis).opState == OperationState::Intpl;
        })
        .def("mode", [](const Snapshot &self, int axis) { return mode_of(self.axis(axis).axisCommandMode); })
        .def("mode_feedback", [](const Snapshot &self, int axis) {
            return mode_of(command_mode(self.axis(axis)));
        })
        .def("home_done", [](const Snapshot &self, int axis) { return self.axis(axis).homeDone; })
        .def("motion_complete", [](const Snapshot &self, int axis) {
            return self.axis(axis).motionComplete;
        })
        .def("position", [](const Snapshot &self, int axis) { return self.axis(axis).actualPos; })
        .def("velocity_command", [](const Snapshot &self, int axis) {
            return self.axis(axis).velocityCmd;
        })
        .def("position_command", [](const Snapshot &self, int axis) { return self.axis(axis).posCmd; });
}

}  // namespace robotd
