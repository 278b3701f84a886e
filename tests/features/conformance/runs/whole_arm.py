"""A whole-arm controller as a backend: one servo switch, one alarm, feedback at 125 Hz.

The controller is imaginary: it takes position targets, moves to each within a control period, and
reports every 8 ms. Its time is the context's clock.
"""

from __future__ import annotations

import threading

import numpy as np

from robotd.api import (
    BackendInfo,
    Capability,
    Clock,
    ConnectionState,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    FloatArray,
    NotReady,
    ProcessImage,
    ProfiledAxes,
    hookimpl,
)

FEEDBACK_NS = 8_000_000


class Controller:
    """State of the arm, and the last feedback packet."""

    def __init__(self, axes: int, period_s: float, clock: Clock) -> None:
        self.lock = threading.RLock()
        self.clock, self.period_s = clock, period_s
        self.open = self.talking = self.on = self.frozen = False
        self.alarm = 0
        self.position: FloatArray = np.zeros(axes)
        self.velocity: FloatArray = np.zeros(axes)
        self.packet = (0, self.position.copy(), self.velocity.copy())

    def report(self) -> None:
        """Send a packet for each 8 ms that have passed; the newest is what counts."""
        now_ns = self.clock.now_ns() // FEEDBACK_NS * FEEDBACK_NS
        if self.talking and not self.frozen and now_ns > self.packet[0]:
            self._send(now_ns)

    def talk(self) -> None:
        """Begin a connection, with a packet: the last one was of the connection before."""
        self.talking, self.frozen = True, False
        self._send(self.clock.now_ns())

    def _send(self, now_ns: int) -> None:
        self.packet = (now_ns, self.position.copy(), self.velocity.copy())

    def switch(self, on: bool) -> None:
        self.on, self.velocity[:] = on, 0.0


class ArmDevice(DeviceDriver):
    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    def open(self, path: str = "", name: str = "") -> None:
        self.controller.open = True

    def close(self) -> None:
        self.stop_communication(0.0)
        self.controller.open = False

    def start_communication(self, timeout_s: float) -> None:
        if not self.controller.open:
            raise NotReady("the controller is not connected")
        with self.controller.lock:
            if not self.controller.talking:
                self.controller.talk()

    def stop_communication(self, timeout_s: float) -> None:
        with self.controller.lock:
            self.controller.talking = False
            self.controller.switch(False)

    def state(self) -> ConnectionState:
        if self.controller.talking:
            return ConnectionState.COMMUNICATING
        return ConnectionState.RUNNING if self.controller.open else ConnectionState.IDLE


class ArmAxes(ProfiledAxes):
    """The last three are changed by tests, for faulty controllers.

    Attributes:
        alarm_text: of any alarm.
        stamps_each_period: values are called new although the last packet is held.
        max_velocity: of every joint, which the controller does not tell; rad/s.
    """

    alarm_text = "protective stop"
    stamps_each_period = False
    max_velocity = np.inf

    def __init__(self, controller: Controller, context: DeviceContext[object]) -> None:
        super().__init__(context.robot.axes, controller.period_s, context.clock)
        self.controller = controller

    @property
    def servo_groups(self) -> tuple[tuple[int, ...], ...]:
        return (tuple(range(len(self.controller.position))),)

    @property
    def feedback_period_s(self) -> float:
        return FEEDBACK_NS * 1e-9

    def read_feedback(self, image: ProcessImage) -> None:
        with self.controller.lock:
            self.controller.report()
            image.fresh_ns, image.position[:], image.velocity[:] = self.controller.packet
            image.servo_on[:] = self.controller.on
            image.offline[:] = False
            image.set_controller_alarm(self.controller.alarm, self.alarm_text)
            if self.stamps_each_period:
                image.fresh_ns = self.clock.now_ns()

    def send_targets(self, positions: FloatArray) -> None:
        controller = self.controller
        with controller.lock:
            if controller.on:
                velocity = (positions - controller.position) / controller.period_s
                controller.velocity[:] = np.clip(velocity, -self.max_velocity, self.max_velocity)
                controller.position += controller.velocity * controller.period_s

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        controller = self.controller
        with controller.lock:
            if not controller.talking or (on and controller.alarm):
                raise NotReady("the controller is in alarm or does not communicate")
            controller.switch(on)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        self.controller.alarm = 0


class ArmFaultInjector(FaultInjector):
    uses_context_clock = True

    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    def position(self, axis: int) -> float:
        return float(self.controller.position[axis])

    def move_by_hand(self, axis: int, delta: float) -> None:
        with self.controller.lock:
            self.controller.position[axis] += delta

    def trip(self, axis: int, code: int) -> None:
        with self.controller.lock:
            self.controller.alarm = code
            self.controller.switch(False)

    def freeze(self, frozen: bool) -> None:
        self.controller.frozen = frozen

    def drop_communication(self) -> None:
        """The cable is pulled: the servos stay on, at the last target."""
        with self.controller.lock:
            self.controller.talking = False


class WholeArm:
    """The plugin object."""

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        return BackendInfo(
            "a whole-arm controller",
            1,
            frozenset(
                {Capability.VELOCITY_MODE, Capability.CONTROLLER_ALARM, Capability.SIMULATED}
            ),
        )

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[object]) -> ArmDevice:
        period_s = 1.0 / context.robot.cycle.rate_hz
        return ArmDevice(Controller(context.robot.axes, period_s, context.clock))

    @hookimpl
    def robotd_axes(self, device: ArmDevice, context: DeviceContext[object]) -> ArmAxes:
        return ArmAxes(device.controller, context)

    @hookimpl
    def robotd_fault_injector(self, device: ArmDevice) -> ArmFaultInjector:
        return ArmFaultInjector(device.controller)
