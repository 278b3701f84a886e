"""Random sequences of commands and faults of the bus, judged at the drives.

Commands are those of ``tests/contract``, and what only a device on a bus has: homing, torques,
the life cycle, and the end of robotd's process. Which faults come, and when, the seed decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from random import Random
from typing import Any

import numpy as np
from tests.contract.test_any_base_sequence import Drive
from tests.contract.test_any_sequence import ArmPlay
from tests.witness.bench import WHEEL_ACCELERATION, WHEEL_VELOCITY, Bench, WheelClock
from tests.witness.draws import FAULTS, commands
from tests.witness.judge import REST_RAD_S, Judge

from robotd.control.groups.torque_stream import TorqueStream
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.planar import ZERO_TWIST, PlanarTwist
from robotd.motion.profile import Profile

QUICK_STOP_RAD_S2 = 40.0  # of the drives
QUICK_STOP_S = 0.3
OFF_S = 1.0  # after a shutdown: heartbeat time-outs and watchdogs are below
PATIENCE_S = 20.0  # for a goal of 2 s
MAX_TWIST_ERROR = 0.01  # m/s and rad/s
KEPT_FAULTS = 0.3  # part of the sequences that end in a fault
COMING_TO_REST_S = 2 * WHEEL_VELOCITY / WHEEL_ACCELERATION + 0.5  # with jerk limits, and latencies
JOG_ENDS_S = 2.0  # by the gentlest deceleration of a ``profile``
SENT_PERIODS = 3  # between two commands of a stream


def time_of(distance: float, judge: Judge) -> float:
    """Return the time for a goal of one point, with a margin."""
    return 2.0 * max(distance / judge.velocity, math.sqrt(2.0 * distance / judge.acceleration))


class Observer:
    """What the commands want of a witness; the judges are at the drives."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self.excused = 0

    @property
    def seen(self) -> list[str]:
        return self._bench.findings

    def excuse(self, seconds: float) -> None:
        self._bench.allow_ramp(QUICK_STOP_RAD_S2, QUICK_STOP_S)

    def set_enable(self, value: bool) -> None:
        for judge in self._bench.judges:
            judge.may_enable = value

    may_enable = property(None, set_enable)

    def set_stopped(self, value: bool) -> None:
        for judge in self._bench.judges:
            judge.must_rest = value

    is_stopped = property(None, set_stopped)


class WitnessPlay(ArmPlay):
    """A robot on a bench, and its clients.

    Attributes:
        log: commands so far, with the time of each.
    """

    def __init__(self, bench: Bench, faults: Mapping[str, float] = FAULTS) -> None:
        self._draws = commands(bench.joints, len(bench.judges), faults, hands=bench.has_hands)
        self.bench, self.harness, self.witness = bench, bench, Observer(bench)  # type: ignore[assignment]
        self.log: list[str] = []
        self._middle = np.array(bench.middle or [0.0] * bench.joints)
        self._take(bench)

    def _take(self, bench: Bench) -> None:
        """Take the robot of the bench, which may be a new one."""
        self.robot = bench.robot
        self._axes = range(len(self.robot.axes))
        self._joints, self._wheels = self._axes[: self.bench.joints], self._axes[bench.joints :]
        self._drives: dict[str, Drive] = {}
        if isinstance(bench.clock, WheelClock):
            bench.clock.before_period = self._send_twists
        self._later = []
        self.goals, self.streams, self.torques = [], [], list[TorqueStream]()
        rate_hz = self.robot.descriptor.cycle.rate_hz
        self.robot.control_loop.every(rate_hz, "play", self._run_due, first=True)

    def play(self, seed: int, count: int = 12) -> list[str]:
        """Run ``count`` commands, then recover and end; return the findings."""
        random, drawn = Random(seed), self._draws
        weights = [weight for weight, _ in drawn.values()]
        try:
            self.requested(self.robot.start)
            for name in random.choices(tuple(drawn), weights, k=count):
                self._do(name, [draw(random) for draw in drawn[name][1]])
                if self.bench.findings:
                    break
            else:
                self._do("end", [])
        finally:
            if random.random() < KEPT_FAULTS:
                self._do("disturb", [self._draws["disturb"][1][0](random), 0.0])
            self._end_robot()
        return self.bench.findings

    def _do(self, name: str, arguments: list[Any]) -> None:
        text = ", ".join(str(argument) for argument in arguments)
        self.log.append(f"{self.bench.now_s:.3f} s: {name} {text}")
        try:
            (self.end if name == "end" else getattr(self, f"_{name}"))(*arguments)
        except RobotdError as error:
            self.log[-1] += f" -> {type(error).__name__}: {str(error)[:100]}"
            if name == "end":
                self.bench.judges[0].findings.append(f"does not recover: {error}")

    def _end_robot(self) -> None:
        named = self.robot.shutdown()
        self.bench.run(OFF_S)
        for judge in self.bench.judges:
            if judge.is_on and not (self.bench.is_cut and judge.name in named):
                judge.findings.append(f"{judge.name} is on {OFF_S:g} s after the shutdown")
        self.bench.close()

    def _at(self, ends: Sequence[float]) -> list[float]:
        """Return positions that were drawn about the middles of the joints."""
        return [float(end) for end in self._middle[: len(ends)] + ends]

    def _goal(self, points: list[tuple[float, list[float]]], periods: int) -> None:
        super()._goal([(seconds, self._at(ends)) for seconds, ends in points], periods)

    def _send(self, values: list[float], periods: int) -> None:
        super()._send(self._at(values), periods)

    # Commands beyond those of the simulation

    def _disturb(self, drawn: tuple[str, list[int], int, str, int], seconds: float) -> None:
        self.later(seconds, lambda: self._begin_fault(*drawn))

    def _begin_fault(self, name: str, axes: list[int], periods: int, how: str, late: int) -> None:
        bench, period_s = self.bench, self.robot.control_loop.period_ns / 1e9
        match name:
            case "silence":
                bench.silence(periods * period_s, axes, how)
            case "block" if how == "both":
                bench.cut_cable(periods * period_s)
            case "block":
                bench.block(periods * period_s)
            case "delay":
                bench.delay(periods * period_s, late * period_s, axes)
            case _:
                getattr(bench, name)(axes[0] if axes else 0)

    def _struck(
        self, motion: str, ends: list[float], drawn: tuple[str, list[int], int, str, int], s: float
    ) -> None:
        """Move, with a fault in the midst; clients go on until it is over."""
        self._bring_back()
        self.release()
        self._disturb(drawn, s + 0.1)
        after = round(s * 100) + drawn[2] + 30
        match motion:
            case "path":
                distance = (
                    self.robot.image.position_command[list(self._joints)] - self._middle - ends
                )
                distance = float(np.nan_to_num(np.abs(distance).max()))
                seconds = self.bench.seconds_per_rad * max(distance, *map(abs, ends)) + 0.3
                self._goal([(seconds, ends), (2 * seconds, [-end for end in ends])], after)
            case "jog":
                for axis in self._joints:
                    self._mode(axis, 1)
                self._jog(list(self._joints), [2 * end for end in ends], self.bench.profile)
                self._step(after)
            case "move":
                self._move(list(self._joints), ends, self.bench.profile, False)
                self._step(after)
            case "torques":
                self._torque([5 * end for end in ends], after)
            case _:
                self._stream_on(motion, ends, after)

    def _stream_on(self, motion: str, ends: list[float], periods: int) -> None:
        """Send commands of a stream for a time, whatever comes of them."""
        self._open(list(self._joints), "target", 0.2)
        for number in range(periods // SENT_PERIODS):
            with suppress(RobotdError):
                match motion:
                    case "positions":
                        now = [end * np.cos(number / 8) for end in ends]
                        self._send(now, 0)
                    case "velocities":
                        self._send_velocity([2 * end for end in ends], 0)
                    case "windows":
                        self._window(ends, 0)
            self._step(SENT_PERIODS)

    # Commands of a base

    def _send_twists(self) -> None:
        """Send what clients of the base send by now; before each period."""
        now_s = self.bench.now_s
        self._drives = {name: drive for name, drive in self._drives.items() if now_s < drive.end_s}
        for name, drive in self._drives.items():
            if now_s >= drive.due_s:
                drive.due_s = now_s + drive.interval_s
                self._send_twist(name, drive.twist, drive.timeout_s)

    def _send_twist(self, client: str, sent: PlanarTwist, timeout_s: float) -> None:
        base = self.robot.base
        assert base is not None
        if sent != ZERO_TWIST:
            self._allow_wheels(timeout_s)
        with suppress(RobotdError):
            base.command(*sent, timeout_s=timeout_s, source=client)  # type: ignore[misc]

    def _allow_wheels(self, seconds: float) -> None:
        """Allow the wheels to move for that time, and until they are at rest after it."""
        until_s = self.bench.now_s + seconds + COMING_TO_REST_S
        for axis in self._wheels:
            judge = self.bench.judges[axis]
            judge.rest_s = until_s if judge.rest_s == math.inf else max(judge.rest_s, until_s)

    def _drive(
        self, client: str, sent: PlanarTwist, interval_s: float, seconds: float,
        timeout_s: float, periods: int,
    ) -> None:  # fmt: skip
        """Let a client send a twist again and again for a time."""
        end_s = self.bench.now_s + seconds
        self._drives[client] = Drive(sent, interval_s, end_s, timeout_s)
        self._step(periods)

    def _zero(self, client: str) -> None:
        self._send_twist(client, ZERO_TWIST, 0.5)
        self._step(1)

    def _end_drive(self, client: str) -> None:
        self._drives.pop(client, None)

    def _driven(
        self, client: str, sent: PlanarTwist, interval_s: float, seconds: float,
        timeout_s: float, drawn: tuple[str, list[int], int, str, int], s: float,
    ) -> None:  # fmt: skip
        """Drive, with a fault in the midst; the client goes on, or ends before it is over."""
        self._bring_back()
        self.release()
        self._disturb(drawn, s + 0.1)
        self._drive(client, sent, interval_s, seconds, timeout_s, round(s * 100) + drawn[2] + 30)

    def _wheel_jog(self, axis: int, how: Profile, periods: int) -> None:
        self._allow_wheels(periods / 100 + JOG_ENDS_S)
        self.robot.axes.jog([Jog(axis, how)])
        try:
            self._step(periods)
        finally:
            self.robot.axes.stop([axis])

    def _wheel_mode(self, axis: int, mode: int) -> None:
        self._mode(axis, mode)

    def _wheel_servo(self, axis: int, on: bool) -> None:
        self._servo(axis, on)

    def set_modes(self) -> None:
        super().set_modes()
        for axis in self._wheels:
            with suppress(RobotdError):
                self.robot.axes.set_command_mode(axis, 1)

    def release(self) -> None:
        super().release()
        self._drives.clear()

    # Hands

    def _push(self, axis: int, displacement: float) -> None:
        self.bench.push(axis, displacement)

    def _moved_off(self, axis: int, displacement: float, seconds: float, periods: int) -> None:
        """Switch off, move by hand, and switch on, whether the hand has let go or not."""
        self._servo(axis, False)
        self.bench.push(axis, displacement)
        self.bench.run(seconds)
        self._servo(axis, True)
        self._step(periods)

    def _guide(
        self, axis: int, displacement: float, drawn: tuple[str, list[int], int, str, int], s: float,
        periods: int,
    ) -> None:  # fmt: skip
        """Guide a joint, with those switched with it, perhaps with a fault; the end is a stop."""
        self._bring_back()
        self.release()
        group = self.robot.axes.servo_group(axis)
        for guided in group:
            self.bench.judges[guided].may_catch = True
        self.robot.axes.begin_guiding(group)
        self.bench.push(axis, displacement)
        if s:
            self._disturb(drawn, s)
        self._step(periods)
        self.robot.axes.stop(group)
        self._step(periods)

    def _servo(self, axis: int, on: bool) -> None:
        if not on:
            self.bench.judges[axis].may_catch = False
        super()._servo(axis, on)  # raises where it is being held again: that goes on
        self.bench.judges[axis].may_catch = False

    def _disable(self) -> None:
        super()._disable()  # brings to rest first, a guided joint too
        for judge in self.bench.judges:
            judge.may_catch = False

    # Faults and the life cycle

    def _heal(self) -> None:
        self.bench.heal()

    def _window(self, ends: list[float], periods: int) -> None:
        """Send a window of points along a straight line from where the joints are."""
        ends = self._at(ends)
        period_ns = self.robot.control_loop.period_ns
        for stream in self.streams[-1:]:
            columns = [self.robot.joint_names.index(name) for name in stream.joints]
            start = self.robot.image.position_command[columns]
            displacement = np.clip(np.array(ends[: len(columns)]) - start, -0.3, 0.3)
            now_ns = self.bench.clock.now_ns()
            times_ns = [now_ns + period_ns * 10 * n for n in range(1, 5)]
            stream.send_points(times_ns, [list(start + displacement * n / 4) for n in range(1, 5)])
            self._step(periods)

    def _torque(self, torques: list[float], periods: int) -> None:
        stream = self.robot.torque_stream(timeout_s=0.1)
        try:
            for part in (0.0, 1.0):
                stream.send([part * torque for torque in torques[: len(stream.joints)]])
                self._step(min(periods, 8))
        finally:
            stream.close()

    def _home(self, axis: int) -> None:
        self.robot.axes.home(axis)

    def _lifecycle(self, what: str) -> None:
        connection = self.robot.connection
        match what:
            case "stop":
                connection.stop_communication()
            case "start":
                connection.start_communication()
            case "close":
                connection.close()
            case "open":
                connection.open()
                connection.start_communication()

    def _restart(self, kill: bool) -> None:
        self.bench.restart(kill=kill)
        self._take(self.bench)
        self.witness.is_stopped = False
        self.requested(self.robot.start)

    def _stop(self) -> None:
        super()._stop()
        # The ramps end a little after the image has shown rest.
        for judge in self.bench.judges:
            judge.own_ramp()

    def _move(self, axes: list[int], ends: list[float], how: Profile, relative: bool) -> None:
        # Too fast to stop at its target by its own deceleration, it brakes as in a quick stop.
        self.witness.excuse(QUICK_STOP_S)
        super()._move(axes, ends if relative else self._at(ends), how, relative)

    def _bring_back(self) -> None:
        """Do all that an operator can, so that what follows moves something."""
        self.bench.heal()
        with suppress(RobotdError):
            if self.robot.connection.state.name in {"IDLE", "SHUTDOWN"}:
                self.robot.connection.open()
        super()._bring_back()

    def mend(self) -> None:
        """Do all that an operator can, until the robot is at rest and takes commands."""
        self._later.clear()
        self.bench.heal()
        self.release()
        with suppress(RobotdError):
            self.robot.connection.open()
        self.robot.resume()
        self.robot.set_speed(1.0)
        self.bench.run(0.3)
        self.witness.is_stopped = False
        self.robot.reset()
        self.requested(self.robot.recover)
        self.robot.axes.stop_and_wait(self._axes, 20.0)
        self.set_modes()

    def end(self) -> None:
        """Mend everything; the robot recovers, and reaches a goal."""
        self.mend()
        place = self.robot.image.position_command[list(self._joints)]
        target = self._middle + np.where(place > self._middle, -0.2, 0.2)
        judges = [self.bench.judges[axis] for axis in self._joints]
        distances = zip(np.abs(target - place).tolist(), judges, strict=True)
        seconds = max([2.0, *(time_of(distance, judge) for distance, judge in distances)])
        request = TrajectoryRequest.from_rows(self.robot.joint_names, [seconds], [target.tolist()])
        goal = ExitStack()
        with goal:
            execution = goal.enter_context(self.robot.follower.follow(request))
            end_s = self.bench.now_s + PATIENCE_S
            while not execution.done and self.bench.now_s < end_s:
                self.bench.run(0.05)
        if execution.outcome is not Outcome.SUCCEEDED:
            text = f"no goal is reached in the end: {execution.outcome} {execution.message}"
            self.bench.judges[0].findings.append(text)
        if self._wheels:
            self._end_driving()

    def _end_driving(self) -> None:
        """Drive a base as it is asked to, and let it come to rest."""
        sent, base = PlanarTwist(0.3, 0.2), self.robot.base
        assert base is not None
        self._drives["cmd_vel"] = Drive(sent, 0.05, self.bench.now_s + 2.0)
        self.bench.run(1.9)
        found = base.twist(self.robot.image)
        if math.hypot(found.linear - sent.linear, found.angular - sent.angular) > MAX_TWIST_ERROR:
            self.bench.judges[-1].findings.append(f"the base drives with {found} in the end")
        self.bench.run(COMING_TO_REST_S)
        if np.abs(self.robot.image.velocity[list(self._wheels)]).max() > REST_RAD_S:
            self.bench.judges[-1].findings.append("the base is not at rest in the end")
