// Commands to the axes. Units are the engine's; every call returns when it is accepted.
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <vector>

#include "native.hpp"
#include "detect.hpp"

namespace robotd {

namespace {
using namespace wmx3Api;

using Times = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using AxisList = std::vector<int>;

Profile trapezoid(double velocity, double acceleration, double deceleration) {
    Profile profile;
    profile.type = ProfileType::Trapezoidal;
    profile.velocity = velocity;
    profile.acc = acceleration;
    profile.dec = deceleration;
    profile.startingVelocity = profile.endVelocity = 0;
    return profile;
}

// Makes the present position the home position when homing starts.
void set_home_type_current(Device &device, int axis) {
    Config::HomeParam parameters;
    check("GetHomeParam", Api::CoreMotion, device.core.config->GetHomeParam(axis, &parameters));
    parameters.homeType = Config::HomeType::CurrentPos;
    check("SetHomeParam", Api::CoreMotion, device.core.config->SetHomeParam(axis, &parameters));
}

AxisCommandMode::T mode_of(int mode) {
    return mode == 0 ? AxisCommandMode::Position
           : mode == 1 ? AxisCommandMode::Velocity : AxisCommandMode::Torque;
}

void start_spline(Device &device, int channel, const AxisList &axes, Times times_ms, Points points) {
    const std::size_t count = times_ms.shape(0), dimensions = axes.size();
    if (dimensions > static_cast<std::size_t>(wmx3Api::constants::maxSplineDimensions) ||
        points.shape(0) != count || points.shape(1) != dimensions)
        throw nb::value_error("times must be (n,), points (n, axes), axes within MAX_SPLINE_AXES");
    AdvMotion::PointTimeSplineCommand command;
    command.dimensionCount = static_cast<unsigned int>(dimensions);
    for (std::size_t index = 0; index < dimensions; index++) command.axis[index] = axes[index];
    std::vector<AdvMotion::SplinePoint> list(count);
    std::vector<double> times(times_ms.data(), times_ms.data() + count);
    for (std::size_t row = 0; row < count; row++)
        for (std::size_t column = 0; column < dimensions; column++)
            list[row].pos[column] = points.data()[row * dimensions + column];
    nb::gil_scoped_release unlocked;
    check("StartCSplinePos", Api::AdvancedMotion,
          device.advanced.advMotion->StartCSplinePos(channel, &command,
                                                     static_cast<unsigned int>(count), list.data(),
                                                     times.data()));
}

unsigned int spline_buffer_points(Device &device, int channel) {
    unsigned int points = 0;
    check("GetSplineBufferPoints", Api::AdvancedMotion,
          device.advanced.advMotion->GetSplineBufferPoints(channel, &points));
    return points;
}

void bind_axis_control(nb::class_<Device> &device) {
    device
        .def("set_servo", [](Device &self, int axis, bool on) {
            check("SetServoOn", Api::CoreMotion, request_servo(*self.core.axisControl, axis, on));
        }, Unlocked())
        .def("clear_amp_alarm", [](Device &self, int axis) {
            check("ClearAmpAlarm", Api::CoreMotion, self.core.axisControl->ClearAmpAlarm(axis));
        }, Unlocked())
        .def("clear_axis_alarm", [](Device &self, int axis) {
            check("ClearAxisAlarm", Api::CoreMotion, self.core.axisControl->ClearAxisAlarm(axis));
        }, Unlocked())
        .def("set_command_mode", [](Device &self, int axis, int mode) {
            check("SetAxisCommandMode", Api::CoreMotion,
                  self.core.axisControl->SetAxisCommandMode(axis, mode_of(mode)));
        }, Unlocked())
        .def("set_polarity", [](Device &self, int axis, int polarity) {
            check("SetAxisPolarity", Api::CoreMotion,
                  self.core.config->SetAxisPolarity(axis, static_cast<char>(polarity)));
        }, Unlocked())
        .def("set_gear_ratio", [](Device &self, int axis, double numerator, double denominator) {
            check("SetGearRatio", Api::CoreMotion,
                  self.core.config->SetGearRatio(axis, numerator, denominator));
        }, Unlocked())
        .def("command_to_feedback", [](Device &self, int axis) {
            check("SetCommandPosToFeedbackPos", Api::CoreMotion,
                  self.core.home->SetCommandPosToFeedbackPos(axis));
        }, Unlocked())
        .def("set_home_type_current", &set_home_type_current, Unlocked())
        .def("start_home", [](Device &self, int axis) {
            check("StartHome", Api::CoreMotion, self.core.home->StartHome(axis));
        }, Unlocked());
}
}  // namespace

void bind_motion(nb::class_<Device> &device) {
    bind_axis_control(device);
    device
        .def("start_pos", [](Device &self, int axis, double target, double velocity,
                             double acceleration, double deceleration) {
            Motion::PosCommand command;
            command.axis = axis;
            command.target = target;
            command.profile = trapezoid(velocity, acceleration, deceleration);
            check("StartPos", Api::CoreMotion, self.core.motion->StartPos(&command));
        }, Unlocked())
        .def("start_jog", [](Device &self, int axis, double velocity, double acceleration,
                             double deceleration) {
            Motion::JogCommand command;
            command.axis = axis;
            command.profile = trapezoid(velocity, acceleration, deceleration);
            check("StartJog", Api::CoreMotion, self.core.motion->StartJog(&command));
        }, Unlocked())
        .def("start_vel", [](Device &self, int axis, double velocity, double acceleration,
                             double deceleration) {
            Velocity::VelCommand command;
            command.axis = axis;
            command.profile = trapezoid(velocity, acceleration, deceleration);
            check("StartVel", Api::CoreMotion, self.core.velocity->StartVel(&command));
        }, Unlocked())
        .def("start_vels", [](Device &self, const AxisList &axes,
                              const std::vector<double> &velocities, double ramp_ms) {
            if (axes.size() != velocities.size()) throw nb::value_error("one velocity per axis");
            std::vector<Velocity::VelCommand> commands(axes.size());
            for (std::size_t index = 0; index < axes.size(); index++) {
                commands[index].axis = axes[index];
                Profile &profile = commands[index].profile;
                profile = trapezoid(velocities[index], 0, 0);
                profile.type = ProfileType::TimeAccTrapezoidal;
                profile.accTimeMilliseconds = profile.decTimeMilliseconds = ramp_ms;
            }
            check("StartVel", Api::CoreMotion,
                  self.core.velocity->StartVel(static_cast<unsigned int>(commands.size()),
                                               commands.data()));
        }, Unlocked())
        .def("timed_stop_velocity", [](Device &self, int axis, double milliseconds) {
            check("Velocity::ExecTimedStop", Api::CoreMotion,
                  self.core.velocity->ExecTimedStop(axis, milliseconds));
        }, Unlocked())
        .def("timed_stop_motion", [](Device &self, const AxisList &axes, double milliseconds) {
            AxisSelection chosen = selection(axes);
            check("Motion::ExecTimedStop", Api::CoreMotion,
                  self.core.motion->ExecTimedStop(&chosen, milliseconds));
        }, Unlocked())
        .def("stop_motion", [](Device &self, const AxisList &axes) {
            AxisSelection chosen = selection(axes);
            check("Motion::Stop", Api::CoreMotion, self.core.motion->Stop(&chosen));
        }, Unlocked())
        .def("stop_velocity", [](Device &self, const AxisList &axes) {
            AxisSelection chosen = selection(axes);
            check("Velocity::Stop", Api::CoreMotion, self.core.velocity->Stop(&chosen));
        }, Unlocked())
        .def("quick_stop_motion", [](Device &self, const AxisList &axes) {
            AxisSelection chosen = selection(axes);
            check("Motion::ExecQuickStop", Api::CoreMotion,
                  self.core.motion->ExecQuickStop(&chosen));
        }, Unlocked())
        .def("quick_stop_velocity", [](Device &self, const AxisList &axes) {
            AxisSelection chosen = selection(axes);
            check("Velocity::ExecQuickStop", Api::CoreMotion,
                  self.core.velocity->ExecQuickStop(&chosen));
        }, Unlocked())
        .def("create_spline_buffer", [](Device &self, int channel, unsigned int points) {
            check("CreateSplineBuffer", Api::AdvancedMotion,
                  self.advanced.advMotion->CreateSplineBuffer(channel, points));
        }, Unlocked())
        .def("free_spline_buffer", [](Device &self, int channel) {
            check("FreeSplineBuffer", Api::AdvancedMotion,
                  self.advanced.advMotion->FreeSplineBuffer(channel));
        }, Unlocked())
        .def("spline_buffer_points", &spline_buffer_points, Unlocked())
        .def("start_spline", &start_spline);
}

}  // namespace robotd
