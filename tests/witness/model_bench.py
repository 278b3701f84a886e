"""Robots on drive models in this process, with a tap on each setpoint that a model executes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from tests.features.conformance.runs.whole_arm import Controller, WholeArm
from tests.witness.bench import CR3A_BENT, OVERCURRENT, TRAJECTORY, Bench
from tests.witness.judge import SILENT_PERIODS, Command

from robotd.clock import NANOSECONDS
from robotd.descriptor import RobotDescriptor, load_robot_descriptor, parse_override
from robotd.errors import RobotdError
from robotd.plugin.manager import Backend, PluginOrigin, load_backend
from robotd.robot import Robot


class ModelBench(Bench):
    """A robot on a model; faults are those of the model's injector."""

    def __init__(self, axes: int = 2, rate_hz: float = 100.0, *, base: bool = False) -> None:
        self.prepare(axes, rate_hz, base=base)
        self._rate_hz = rate_hz
        self._ends: list[tuple[float, Callable[[], None]]] = []  # of faults
        self.clock.advanced = self.settle
        self.robot = self.make_robot()

    def backend(self) -> Backend:
        raise NotImplementedError

    def tap(self, robot: Robot) -> None:
        """Hand the commands of the model to the judges from now on."""
        raise NotImplementedError

    def make_robot(self) -> Robot:
        robot = self.take(Robot(self.descriptor(), self.backend(), self.clock))
        self.tap(robot)
        return robot

    def descriptor(self) -> RobotDescriptor:
        name = self.backend().name
        chosen = {"backend": name, "backends": {name: {}}}
        return RobotDescriptor.model_validate(self.describe(self._rate_hz) | chosen)

    def restart(self, *, kill: bool) -> None:
        """End robotd and make it anew, with a new model: it is part of the process."""
        self.robot.shutdown()
        self.robot = self.make_robot()

    def settle(self) -> None:
        for end in [end for end in self._ends if end[0] <= self.now_s]:
            self._ends.remove(end)
            self._try(end[1])

    def _try(self, action: Callable[[], None]) -> None:
        try:
            action()
        except (RobotdError, NotImplementedError):
            return  # not of this model, or not now

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        faults = self.robot.fault_injector
        if not axes or how == "answers":
            self._try(lambda: faults.freeze(True))
            self._ends.append((self.now_s + seconds, lambda: faults.freeze(False)))
            return
        self.is_cut = True
        for axis in axes:
            self._try(lambda axis=axis: faults.disconnect(axis))  # type: ignore[misc]
            self._ends.append((self.now_s + seconds, lambda a=axis: faults.reconnect(a)))  # type: ignore[misc]

    def reset(self, axis: int) -> None:
        """Cut the cable to the device: it gets nothing any more."""
        self.is_cut = True
        self._try(self.robot.fault_injector.drop_communication)

    def trip(self, axis: int) -> None:
        self._try(lambda: self.robot.fault_injector.trip(axis, OVERCURRENT))

    def heal(self) -> None:
        self.is_cut = False
        for _, end in self._ends:
            self._try(end)
        self._ends.clear()
        self._try(lambda: self.robot.fieldbus.start_hot_connect(0))


class SimBench(ModelBench):
    """The simulation: taps on each setpoint that it takes, and on its servo once a period."""

    def backend(self) -> Backend:
        return load_backend("sim")

    def tap(self, robot: Robot) -> None:
        simulation = robot.device.simulation
        self._servo, self._states = simulation.servo, simulation.states
        self._places: list[float | None] = [None] * len(self.judges)  # None: it counts anew
        self._stream = stream = simulation.motion.stream
        take, self._due_s = stream.setpoint, 0.0

        def taken(position: Any, velocity: Any, due_ns: int) -> None:
            self._power()
            places = self._servo.command.tolist()
            speeds = self._servo.command_velocity.tolist()
            take(position, velocity, due_ns)  # raises where it does not execute it
            due_s, last_s = due_ns / NANOSECONDS, self._due_s
            self._due_s = due_s
            for axis, judge in enumerate(self.judges):
                if due_s - last_s > SILENT_PERIODS * judge.period_s:
                    judge.own_ramp()  # the model has gone on by itself: it begins where that led
                if not stream.following[axis]:
                    judge.own_ramp()
                elif stream.by_velocity[axis]:
                    judge.execute(
                        Command(due_s, float(velocity[axis]), "velocity", place=speeds[axis])
                    )
                else:
                    judge.execute(Command(due_s, float(position[axis]), place=places[axis]))

        stream.setpoint = taken
        self._tap_servo(simulation.world)
        robot.control_loop.every(self._rate_hz, "power", lambda _: self._power(), first=True)

    def _tap_servo(self, world: Any) -> None:
        servo = self._servo
        run, place, relabel = servo.run, servo.place, servo.relabel
        period = round(1 / self._rate_hz / servo.tick_s)

        def tapped(tick: int, stop: int, check: Callable[[], bool] | None) -> tuple[int, bool]:
            while tick < stop:
                due = min(stop, tick // period * period + period)
                tick, seen = run(tick, due, check)
                if tick % period == 0:
                    time_s = (world._start_ns / NANOSECONDS) + tick * servo.tick_s
                    self._sample(time_s, period * servo.tick_s)
                if seen:
                    return tick, True
            return tick, False

        def placed(axis: int, *state: float) -> None:
            place(axis, *state)
            self._places[axis] = None
            self.judges[axis].own_ramp()

        def relabelled(*units: Any) -> None:
            relabel(*units)
            for axis, judge in enumerate(self.judges):
                self._places[axis] = None
                judge.own_ramp()

        servo.run, servo.place, servo.relabel = tapped, placed, relabelled

    def _sample(self, time_s: float, period_s: float) -> None:
        for axis, (judge, now) in enumerate(zip(self.judges, self._servo.command, strict=True)):
            before = self._places[axis]
            on = self._states.servo_on[axis]
            self._places[axis] = float(now) if on else None
            if not self._stream.following[axis]:
                judge.own_ramp()
            if on and before is not None:
                judge.profile(time_s, (now - before) / period_s)
                judge.bounds(time_s, float(now), before)

    def _power(self) -> None:
        for judge, on in zip(self.judges, self._states.servo_on, strict=False):
            judge.power(self.now_s, bool(on))


class TargetBench(ModelBench):
    """A device that takes a target each period: it executes each one that it is sent."""

    def arm(self, robot: Robot) -> tuple[Any, str, Callable[[int], bool]]:
        """Return what executes targets, the name of its method, and whether a servo is on."""
        raise NotImplementedError

    def tap(self, robot: Robot) -> None:
        target, name, is_on = self.arm(robot)
        execute = getattr(target, name)

        def tapped(positions: Any) -> None:
            execute(positions)
            self._power(is_on)
            for axis, judge in enumerate(self.judges):
                if is_on(axis):
                    judge.execute(Command(self.now_s, float(positions[axis])))

        setattr(target, name, tapped)
        robot.control_loop.every(self._rate_hz, "power", lambda _: self._power(is_on), first=True)

    def _power(self, is_on: Callable[[int], bool]) -> None:
        for axis, judge in enumerate(self.judges):
            judge.power(self.now_s, is_on(axis))


class ArmBench(TargetBench):
    """The imaginary controller of a whole arm, of the conformance kit's tests."""

    def backend(self) -> Backend:
        origin = PluginOrigin("whole", WholeArm.__module__, "whole", "1.0")
        return Backend(origin, WholeArm())

    def arm(self, robot: Robot) -> tuple[Any, str, Callable[[int], bool]]:
        controller: Controller = robot.device.controller
        return vars(robot.axes._driver)["wrapped"], "send_targets", lambda _: controller.on


class MujocoBench(TargetBench):
    """MuJoCo's drives, of an arm of six joints."""

    bent_joints = CR3A_BENT

    def __init__(self, axes: int = 6, rate_hz: float = 100.0) -> None:
        # What the arm touches stops it: following errors, from which it cannot recover.
        mujoco = {"self_collision": "false", "scene": "null"}
        keys = [f"backends.mujoco.{key}={value}" for key, value in mujoco.items()]
        margin = TRAJECTORY["acceleration_margin"]
        values = f"cycle.rate_hz={rate_hz:g}", f"trajectory.acceleration_margin={margin}", *keys
        overrides = [parse_override(value) for value in values]
        self._descriptor = load_robot_descriptor("cr3a", overrides=overrides)
        super().__init__(axes, rate_hz)
        for judge, joint in zip(self.judges, self._descriptor.joints, strict=True):
            judge.velocity, judge.acceleration = joint.velocity, joint.acceleration
            judge.lower, judge.upper = joint.lower, joint.upper

    def descriptor(self) -> RobotDescriptor:
        return self._descriptor

    def backend(self) -> Backend:
        return load_backend("mujoco")

    def arm(self, robot: Robot) -> tuple[Any, str, Callable[[int], bool]]:
        physics = robot.device.physics
        return physics, "follow", lambda axis: bool(physics.servo_on[axis])
