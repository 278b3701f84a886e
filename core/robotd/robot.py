"""Composition: descriptor + backend → connection, axes, I/O, fieldbus → control loop.

The one file that sees every step of the path.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from robotd.call_timeout import end_idle_threads
from robotd.clean_up import finally_run, run_all
from robotd.clock import Clock, MonotonicClock
from robotd.clock.simulated import PacedClock, SimulatedClock, SteppedClock
from robotd.control.groups.descriptor_limits import axis_names, fit_device
from robotd.control.groups.joint_group import JointGroups
from robotd.control.groups.joint_stream import JointStreams
from robotd.control.groups.mobile_base import MobileBase
from robotd.control.groups.problem import Problem
from robotd.control.groups.problem_finder import Problems
from robotd.control.groups.recovery import Recovery, Report
from robotd.control.groups.servos import Servos
from robotd.control.groups.torque_stream import TorqueStreams
from robotd.control.groups.trajectory_follower import TrajectoryFollower
from robotd.control.loop.control_loop import ControlLoop
from robotd.control.loop.motion_stop import MotionStop
from robotd.control.loop.rearming import Rearming
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.device.axes import Axes
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.fault_injector import FaultInjector
from robotd.device.fieldbus import Fieldbus
from robotd.device.gripper import Gripper
from robotd.device.io import Io, check_names
from robotd.device.passive_joints import PassiveJoints, driven_fingers, finger_reader
from robotd.device.payload import PayloadSetting
from robotd.device.process_image import ProcessImage
from robotd.device.reconnector import Reconnector
from robotd.device.servo_gripper import ServoGripper, servo_grippers
from robotd.device.soft_limits import SoftLimitGuard
from robotd.device.tool_pose import ToolPose, tool_poses
from robotd.device.wrench import Wrenches
from robotd.errors import InvalidArgument, RobotdError, Unsupported
from robotd.events import EventLog
from robotd.guards import make_guards, warn_unread
from robotd.log import get_logger
from robotd.plugin.driver_set import Drivers
from robotd.plugin.manager import Backend, load_backend

log = get_logger("robot")

Part = TypeVar("Part")

STOPS_JOIN_TIMEOUT_S = 1.0  # at shutdown; the thread of a stop that hangs is abandoned


class Robot:
    """A robot on a backend. Made by ``build_robot``; nothing is opened before ``start``.

    What features add is returned by ``feature``, as ``robot.feature(ToolGroups)``. What guards the
    robot by its file is made with it.

    Attributes:
        descriptor: the robot's description, with the variant applied.
        backend: the backend that made the drivers.
        capabilities: of the backend with this robot.
        clock: source of time of the control loop.
        device: what ``robotd_open_device`` of the backend returned, for the backend's own nodes;
            its failures are not isolated.
        joint_names: names of the joints, in the order of trajectories.
        joint_axes: axis of each joint.
        image: live process image, written by the control loop only.
        events: commands, goals, results, faults and log lines of this robot.
        mixer: sends the setpoints of all sources.
        connection: to the device.
        axes: servo, moves, jog and stop of single axes.
        io: digital inputs and outputs.
        fieldbus: fieldbus diagnostics.
        payload: what the arm carries, where the device compensates it.
        gripper: on an output bit; None if the robot has none.
        servo_grippers: grippers that are a joint, by name.
        control_loop: reads the device and sends setpoints, once a period.
        rearming: sources of commands that have to begin anew after a stop or a fault.
        groups: joint groups by name; ``follower`` and ``stream`` are those of the only one.
        base: moves the wheels; None if the robot has none.
        servos: switches the servos of joints and wheels on and off.
        world: surroundings of a simulated robot; None where the backend has none.
    """

    _parts: dict[Callable[[Robot], Any], Any]

    def __init__(
        self,
        descriptor: RobotDescriptor,
        backend: Backend,
        clock: Clock,
        drivers: Drivers | None = None,
    ) -> None:
        """Compose the robot; ``drivers`` None: ``backend`` makes them.

        Raises Unsupported: ``clock`` is simulated and the backend is not, or there are several
        joint groups and the device interpolates trajectories itself; DescriptorError: a guard that
        the robot's file asks for cannot be made. Raises the errors of ``fit_device``.
        """
        name = backend.name
        if isinstance(clock, SimulatedClock) and Capability.SIMULATED not in backend.capabilities:
            raise Unsupported("simulated time", name)
        if drivers is None:
            drivers = backend.drivers(backend.context(descriptor, clock))
        capabilities = drivers.capabilities(backend.info.capabilities)
        self._make_fault_injector = drivers.make_fault_injector
        driver, rate_hz = drivers.axes, descriptor.cycle.rate_hz
        limits, notes = fit_device(descriptor, driver, name)
        for note in notes:
            log.warning("limit of the device applies", reason=note)
        self.descriptor, self.capabilities = descriptor, capabilities
        self.backend, self._driver, self._wrench_driver = backend, driver, drivers.wrenches
        self.clock = clock
        self.device: Any = getattr(drivers.device, "wrapped", drivers.device)
        self.joint_names = descriptor.joint_names
        self.joint_axes = tuple(joint.axis for joint in descriptor.joints)
        self.image, self.events = ProcessImage(descriptor.axes), EventLog(clock.now_ns)
        self.connection = Connection(
            drivers.device,
            descriptor.engine,
            descriptor.parameters_file,
            name,
            has_parameters=Capability.PARAMETERS_FILE in capabilities,
        )
        self.axes = Axes(
            driver,
            self.image,
            self.connection,
            limits,
            axis_names(descriptor),
            capabilities,
            name,
            clock,
            1.0 / descriptor.cycle.rate_hz,
            self.events,
        )
        self.io = Io(
            drivers.io,
            self.connection,
            name,
            self.events,
            descriptor.inputs,
            descriptor.outputs,
        )
        check_names(descriptor, self.io)
        self.fieldbus = Fieldbus(
            drivers.fieldbus,
            self.connection,
            capabilities,
            name,
            self.events,
            self.axes.kept_at_rest,
        )
        self.payload = PayloadSetting(drivers.payload, self.axes, self.joint_axes)
        self.gripper = self._make_gripper(drivers.passive_joints)
        self.servo_grippers = servo_grippers(descriptor, self.axes)
        self.world = drivers.world
        self.mixer = mixer = SetpointMixer(driver, descriptor.axes, rate_hz, clock)
        self.control_loop = ControlLoop(
            driver,
            self.connection,
            self.image,
            mixer,
            self.axes.stops.request,
            realtime_priority=descriptor.cycle.realtime_priority,
            clock=clock,
        )
        self.rearming = Rearming(self.axes, self.control_loop.period_ns)
        self._motion_stop = MotionStop(self.axes, mixer, self.io, descriptor.stop_input)
        self._look_each_period(rate_hz)
        self.groups = JointGroups(descriptor, self.axes, mixer, driver, self.rearming)
        self.base = self._make_base()
        self.servos = self._make_servos(driver)
        self._reconnector = Reconnector(self.connection)
        self._problems = Problems(self.axes, self.rearming, self.servos.used, backend.advise)
        self._recovery = Recovery(self.axes, self.fieldbus, self._problems, self.servos)
        self._parts, self._parts_lock = {}, threading.RLock()  # one part may use others
        make_guards(self.descriptor, self.feature)

    @property
    def follower(self) -> TrajectoryFollower:
        """Executes trajectories of all joints. Raises InvalidArgument with several groups."""
        return self.groups.only.follower

    @property
    def stream(self) -> JointStreams:
        """Opens streams of the joints. Raises InvalidArgument with several groups."""
        return self.groups.only.stream

    @property
    def torque_stream(self) -> TorqueStreams:
        """Opens torque streams of the joints. Raises InvalidArgument with several groups."""
        return self.groups.only.torque_stream

    def start(self, *, enable: bool = True) -> None:
        """Bring the robot up: control loop, device, communication, parameters, then the servos.

        Blocks until done (seconds where the device needs tries). Any one thread. After
        ``connection.abort_start`` from another one nothing more is begun or switched on.

        ``enable``: clear alarms and switch the servos of joints and wheels on; False leaves them as
        they are.

        Raises:
            ConnectError: the device did not open, or an axis did not come up (all are named).
            RobotdError: communication or parameters failed.
        """
        self.connection.require_alive()
        warn_unread(self.descriptor.path, self.descriptor.unread_keys)
        if not isinstance(self.clock, SimulatedClock):
            self.axes.stops.start()
        self.connection.ask_fault()
        self.control_loop.start()
        if self.base is not None:
            self.base.start()
        try:
            self.connection.start()
        finally:
            if self.descriptor.engine.reconnect:
                self._reconnector.start()
        for caution in self.cautions:
            log.warning("caution", reason=caution)
        if enable and self.connection.commandable:
            self.servos.enable()

    @property
    def cautions(self) -> Sequence[str]:
        """Dangers of its drives that a person beside the robot has to know, see ``AxisDriver``."""
        return self._driver.cautions

    def step(self, periods: int) -> None:
        """Let ``periods`` of the control loop pass, on a ``SteppedClock`` or a ``PacedClock``.

        Afterwards time is held. The same commands between the same steps lead to the same motion,
        bit for bit. Raises InvalidArgument on a clock that cannot be stepped.
        """
        time_ns = periods * self.control_loop.period_ns
        match self.clock:
            case SteppedClock():
                self.clock.sleep_until_ns(self.clock.now_ns() + time_ns)
            case PacedClock():
                self.clock.step(time_ns)
            case _:
                raise InvalidArgument("only simulated time can be stepped")

    @cached_property
    def fault_injector(self) -> FaultInjector:
        """The world around the simulated robot, where faults are made.

        Raises Unsupported on a backend that is not simulated or has no bench.
        """
        simulated = Capability.SIMULATED in self.capabilities
        injector = self._make_fault_injector() if simulated else None
        if injector is None:
            raise Unsupported("faults on request", self.backend.name)
        return injector

    def feature(self, kind: Callable[[Robot], Part]) -> Part:
        """Return the robot's only object of a class of a feature, made at the first call.

        ``kind``: the class, or a function, called with the robot. Raises what it raises. Any
        thread.
        """
        with self._parts_lock:
            if kind not in self._parts:
                self._parts[kind] = kind(self)
            return cast(Part, self._parts[kind])

    @cached_property
    def tools(self) -> tuple[ToolPose, ...]:
        """Tool of each joint group; empty for a robot without joints or a usable URDF."""
        return tool_poses(self.descriptor)

    @cached_property
    def wrenches(self) -> Wrenches:
        """Force and torque at links, by their names; empty where the backend has none."""
        return Wrenches(self._wrench_driver, self.descriptor, self.clock, self.backend.name)

    @property
    def problems(self) -> list[str]:
        """Texts of ``find_problems``."""
        return [str(problem) for problem in self.find_problems()]

    def find_problems(self, max_age_s: float = 0.0) -> list[Problem]:
        """Return the reasons why axes do not move, root cause first; empty without one.

        Any thread that may wait: a driver that hangs is asked for its reason for 0.5 s.

        ``max_age_s``: those that were found within this time, of the computer's clock, will do.
        """
        return self._problems.find(max_age_s)

    def stop(self, reason: str = "by the operator") -> None:
        """Stop all motion on its path; no motion starts until ``reset``. Any worker.

        Returns at standstill. No safety function: it needs this program, the computer, the bus and
        the drives to work.

        ``reason``: reported to every client whose motion ends or is rejected.

        Raises:
            DeviceTimeout: axes still move after a quick stop; motion stays stopped.
            NotReady: the device is lost, so that nothing shows whether they do; likewise.
        """
        self._motion_stop.stop(reason, self.descriptor.engine.shutdown_s)

    def wait_stopped(self) -> None:
        """Wait for standstill with the stop latch engaged. Raises the errors of ``stop``."""
        self._motion_stop.wait_at_rest(self.descriptor.engine.shutdown_s)

    def set_speed(self, speed: float) -> str:
        """Scale the time of all motion, by ramps; return the speed in words. Any thread.

        The paths stay. Trajectories and the base follow while they move; moves and jogs of single
        axes, and streams, take the speed at their start.

        ``speed``: 0 (hold on the path), or 0.01 to 1.

        Raises:
            InvalidArgument: another number.
            OperationError: the axes are read-only.
            Unsupported: the device interpolates trajectories itself.
        """
        self._require_streamed("speed scaling")
        self.axes.speed.set(speed)
        return self.axes.speed.text

    def pause(self) -> str:
        """Bring motion to rest on its path until ``resume``; otherwise as ``set_speed``."""
        self._require_streamed("pausing")
        self.axes.speed.pause()
        return self.axes.speed.text

    def resume(self) -> str:
        """Continue after ``pause``, at the speed as set; return it in words. Any thread."""
        self.axes.speed.resume()
        return self.axes.speed.text

    def reset(self) -> str:
        """Allow motion again after ``stop`` or the stop input; return the reason. Any worker.

        Nothing moves: each client has to command motion anew, and one that went on commanding has
        to be released first.

        Raises:
            NotReady: the stop input forbids motion.
            DeviceTimeout: axes still move.
        """
        return self._motion_stop.reset(self.descriptor.engine.shutdown_s)

    def recover(self, report: Report = lambda line: None) -> None:
        """Reconnect, clear alarms, switch servos on and verify, as far as needed. Nothing moves.

        Any worker; seconds where the device needs them. The steps are logged too.

        ``report``: called with the cause, and with each step when it begins or has ended.

        Raises:
            NotReady: another recovery runs, axes are not at rest, or the robot is shutting down.
            ConnectError: the step that failed, with the reason of each axis.
            RobotdError: the device cannot be opened or started.
        """
        self._recovery.run(report)
        if stopped := self.axes.stop_latch.rejection:
            report(stopped)

    def shutdown(self) -> list[str]:
        """Stop motion in a controlled way, servos off, stop communication, close.

        Every step is tried whatever the one before it did. Twice is not an error.

        Returns the names of axes whose drives have not confirmed to be off: cut their power.
        """
        if isinstance(self.clock, PacedClock):
            self.clock.release()
        self.connection.abort_start()
        self._reconnector.stop()
        unconfirmed: list[str] = []
        run_all(
            self._close_connection,
            *([] if self.base is None else [self.base.close]),
            self.control_loop.stop,
            lambda: self.axes.stops.close(STOPS_JOIN_TIMEOUT_S),
            lambda: unconfirmed.extend(self.servos.unconfirmed()),
            end_idle_threads,
            *([self.clock.end] if isinstance(self.clock, PacedClock) else []),
        )
        return unconfirmed

    def _close_connection(self) -> None:
        try:
            self.connection.shutdown()
        except RobotdError as error:
            log.error("shut-down failed", reason=str(error))

    def _look_each_period(self, rate_hz: float) -> None:
        """Add what the control loop looks at in each period."""
        drive = self.descriptor.drive
        guard = SoftLimitGuard(self.axes, drive.axes if drive else ())
        every = self.control_loop.every
        every(rate_hz, "silence", self.rearming.listen, first=True)
        every(rate_hz, "stop", self._motion_stop.enforce, first=True)
        every(rate_hz, "standstill", self._motion_stop.note_image)
        every(rate_hz, "interruptions", self.rearming.interruptions.look)
        every(rate_hz, "travel", guard.look)
        if self.gripper is not None:
            every(rate_hz, "gripper", self.gripper.advance)

    @property
    def grippers(self) -> dict[str, Gripper | ServoGripper]:
        """All grippers by name; "" is the one on an output bit."""
        on_output = {} if self.gripper is None else {"": self.gripper}
        return {**self.servo_grippers, **on_output}

    def _make_gripper(self, joints: PassiveJoints | None) -> Gripper | None:
        settings = self.descriptor.gripper
        if settings is None:
            return None
        fingers = finger_reader(joints, settings.joints), driven_fingers(joints, settings.joints)
        return Gripper(self.io, settings, self.clock, self.axes.stop_latch, *fingers)

    def _make_servos(self, driver: AxisDriver) -> Servos:
        """Compose the servos; the control loop notes which are on."""
        servos = Servos(self.descriptor, self.axes, self.groups, self.base, driver.confirmed_off)
        self.control_loop.every(self.descriptor.cycle.rate_hz, "power", servos.note_image)
        self.connection.before_stop = servos.disable
        return servos

    def _make_base(self) -> MobileBase | None:
        """Compose the base; the control loop tracks its odometry."""
        drive = self.descriptor.drive
        if drive is None:
            return None
        base = MobileBase(self.axes, self.mixer.slot(), drive, self.rearming)
        self.connection.on_ready(base.on_ready)
        self.control_loop.every(self.descriptor.cycle.rate_hz, "wheel odometry", base.track)
        return base

    def _require_streamed(self, feature: str) -> None:
        self.axes.stop_latch.check_commandable()
        if self.joint_axes and self.axes.trajectories_on_device:
            raise Unsupported(feature, self.backend.name)


def build_robot(
    name_or_path: str | Path,
    backend: str | None = None,
    variant: str | None = None,
    *,
    search_path: Sequence[Path] | None = None,
    clock: Clock | None = None,
) -> Robot:
    """Load descriptor and backend and put them together, touching no hardware.

    Args:
        name_or_path: a robot's name, or the path of its ``robot.yaml``.
        backend: None takes the descriptor's own.
        variant: None takes the descriptor's default variant.
        search_path: folders of robots; None: those that come with robotd.
        clock: None: real time.

    Raises DescriptorError, PluginError: with every problem that was found.
    """
    descriptor = load_robot_descriptor(name_or_path, variant, search_path=search_path)
    return Robot(descriptor, load_backend(backend or descriptor.backend), clock or MonotonicClock())


@contextmanager
def open_robot(
    name_or_path: str | Path,
    backend: str | None = None,
    variant: str | None = None,
    *,
    enable: bool = True,
    clock: Clock | None = None,
) -> Iterator[Robot]:
    """Start a robot without ROS and shut it down after the block.

    Args:
        name_or_path, backend, variant: as for ``build_robot``.
        enable: as for ``Robot.start``.
        clock: a ``SteppedClock`` for a simulation in one thread; None: real time.
    """
    robot = build_robot(name_or_path, backend, variant, clock=clock)
    with finally_run(robot.shutdown):
        robot.start(enable=enable)
        yield robot
