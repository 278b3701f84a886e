"""Composition: descriptor + backend → connection, axes, I/O, fieldbus → control loop.

The one file that sees every step of the path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from robotd.clock import Clock, MonotonicClock
from robotd.clock.simulated import PacedClock, SimulatedClock, SteppedClock
from robotd.control.axis_limits import axis_names, fit_device
from robotd.control.control_loop import ControlLoop
from robotd.control.joint_group import JointGroups
from robotd.control.joint_stream import JointStreams
from robotd.control.mobile_base import MobileBase
from robotd.control.motion_stop import MotionStop
from robotd.control.problem import Problem
from robotd.control.problem_finder import Problems
from robotd.control.rearming import Rearming
from robotd.control.recovery import Recovery, Report
from robotd.control.servos import Servos
from robotd.control.setpoint_mixer import SetpointMixer
from robotd.control.torque_stream import TorqueStreams
from robotd.control.trajectory_follower import TrajectoryFollower
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.device.axes import Axes
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.fault_injector import FaultInjector
from robotd.device.fieldbus import Fieldbus
from robotd.device.gripper import Gripper
from robotd.device.io import Io, check_names
from robotd.device.passive_joints import PassiveJoints, finger_reader
from robotd.device.process_image import ProcessImage
from robotd.device.reconnector import Reconnector
from robotd.device.soft_limits import SoftLimitGuard
from robotd.device.tool_pose import ToolPose, tool_poses
from robotd.errors import InvalidArgument, RobotdError, Unsupported
from robotd.events import EventLog
from robotd.feature import installed_features
from robotd.log import get_logger
from robotd.plugin.call_timeout import end_idle_threads
from robotd.plugin.driver_set import Drivers
from robotd.plugin.manager import Backend, load_backend

log = get_logger("robot")

STOPS_JOIN_TIMEOUT_S = 1.0  # at shutdown; the thread of a stop that hangs is abandoned


class Robot:
    """A robot on a backend. Made by ``build_robot``; nothing is opened before ``start``.

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
        gripper: None if the robot has none.
        control_loop: reads the device and sends setpoints, once a period.
        rearming: sources of commands that have to begin anew after a stop or a fault.
        groups: joint groups by name; ``follower`` and ``stream`` are those of the only one.
        base: moves the wheels; None if the robot has none.
        wheel_axes: axes of the wheels; empty if the robot has none.
        servos: switches the servos of joints and wheels on and off.
        world: surroundings of a simulated robot; None where the backend has none.
    """

    def __init__(
        self,
        descriptor: RobotDescriptor,
        backend: Backend,
        clock: Clock,
        drivers: Drivers | None = None,
    ) -> None:
        """Compose the robot; ``drivers`` None: ``backend`` makes them.

        Raises Unsupported: ``clock`` is simulated and the backend is not, or there are several
        joint groups and the device interpolates trajectories itself. Raises as ``fit_device``.
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
        self.descriptor = descriptor
        self.backend = backend
        self.capabilities = capabilities
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
        self.gripper = self._make_gripper(drivers.passive_joints)
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
        self.wheel_axes = descriptor.drive.axes if descriptor.drive else ()
        self.servos = Servos(descriptor, self.axes, self.groups, self.base)
        self.connection.before_stop = self.servos.disable
        self._reconnector = Reconnector(self.connection)
        self._problems = Problems(self.axes, self.rearming, self.servos.used, backend.advise)
        self._recovery = Recovery(self.axes, self.fieldbus, self._problems, self.servos)

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
        if enable and self.connection.commandable:
            self.servos.enable()

    def step(self, periods: int) -> None:
        """Let ``periods`` of the control loop pass, on a ``SteppedClock`` or a ``PacedClock``.

        Afterwards time stands. The same commands between the same steps lead to the same motion,
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

    def attribute(self, name: str) -> Any:
        """Return what a feature adds under ``name``, made at the first call; ``robot.name`` too.

        Any thread, but the first call is to end before another one. Raises AttributeError: no
        feature that is installed adds it; and what making it raises.
        """
        if name not in self._added:
            targets = [each.attributes.get(name) for each in installed_features().values()]
            target = next(filter(None, targets), None)
            if target is None:
                raise AttributeError(f"'Robot' has no attribute {name!r}, nor has a feature")
            self._added[name] = resolve_name(target)(self)
        return self._added[name]

    @cached_property
    def _added(self) -> dict[str, Any]:
        """Attributes of features that have been made."""
        return {}

    if not TYPE_CHECKING:  # a checker is to find misspelt attributes

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):
                raise AttributeError(name)
            return self.attribute(name)

    @cached_property
    def tools(self) -> tuple[ToolPose, ...]:
        """Tool of each joint group; empty for a robot without joints or a usable URDF."""
        return tool_poses(self.descriptor)

    @property
    def problems(self) -> list[str]:
        """Texts of ``find_problems``."""
        return [str(problem) for problem in self.find_problems()]

    def find_problems(self) -> list[Problem]:
        """Return the reasons why axes do not move, root cause first; empty without one.

        Any thread that may wait: a driver that hangs is asked for its reason for 0.5 s.
        """
        return self._problems.find()

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
        """Wait for standstill after ``axes.stop_latch`` was engaged; raises as ``stop``."""
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
        """Allow motion again after ``stop`` or the stop input; return what was reset. Any worker.

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

    def shutdown(self) -> None:
        """Stop motion in a controlled way, servos off, stop communication, close.

        Every step is tried whatever the one before it did. Twice is not an error.
        """
        if isinstance(self.clock, PacedClock):
            self.clock.release()
        self.connection.abort_start()
        self._reconnector.stop()
        try:
            self.connection.shutdown()
        except RobotdError as error:
            log.error("shut-down failed", reason=str(error))
        finally:
            if self.base is not None:
                self.base.close()
            self.control_loop.stop()
            self.axes.stops.close(STOPS_JOIN_TIMEOUT_S)
            end_idle_threads()
            if isinstance(self.clock, PacedClock):
                self.clock.end()

    def _look_each_period(self, rate_hz: float) -> None:
        """Add what the control loop looks at in each period."""
        every, guard = self.control_loop.every, SoftLimitGuard(self.axes, 1.0 / rate_hz)
        every(rate_hz, "silence", self.rearming.listen, first=True)
        every(rate_hz, "stop", self._motion_stop.enforce, first=True)
        every(rate_hz, "standstill", self._motion_stop.note_image)
        every(rate_hz, "interruptions", self.rearming.interruptions.look)
        every(rate_hz, "travel", guard.look)
        if self.gripper is not None:
            every(rate_hz, "gripper", self.gripper.advance)

    def _make_gripper(self, joints: PassiveJoints | None) -> Gripper | None:
        settings = self.descriptor.gripper
        if settings is None:
            return None
        return Gripper(self.io, settings, self.clock, finger_reader(joints, settings.joints))

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
    try:
        robot.start(enable=enable)
        yield robot
    finally:
        robot.shutdown()
