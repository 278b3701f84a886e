"""Streaming for long: random modes, rates, targets, jitter, drop-outs and takeovers.

``python -m tools.endurance.streams --minutes 60``: a simulated CR3A in real time. Every setpoint
that the device gets is judged against the limits; the exit status is 1 when one exceeds them. A
device that holds in a stall of the control loop stops without a ramp: the second after a gap is
counted separately, with the largest excess of each kind.
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from dataclasses import dataclass

import click
import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.clock.simulated import SteppedClock
from robotd.control.groups.joint_stream import JointStream
from robotd.errors import NotReady, RobotdError
from robotd.log import configure_logging
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot

DROP_OUT, SILENCE_S = 0.02, 0.6  # share of the targets that a pause follows, and its longest
SLACK = 1.001
GAP_PERIODS = 1.5  # between two setpoints
AFTER_GAP_S = 1.0


@dataclass(frozen=True)
class Excess:
    """Setpoint beyond a limit, in rad and s.

    Attributes:
        ratio: of value and limit; of a position: 1 plus the distance beyond it in rad.
        gap_s: duration of the last gap between two setpoints.
        after_s: time since its end.
    """

    ratio: float
    joint: str
    value: float
    limit: float
    gap_s: float
    after_s: float

    def __str__(self) -> str:
        """Value against limit, and the gap before."""
        gap = f"{self.after_s * 1e3:.0f} ms after a gap of {self.gap_s * 1e3:.0f} ms"
        return f"{self.joint}: {self.value:.4f}, limit {self.limit:.4f}, {gap}"


class Judge:
    """Compares each setpoint with the limits and with the one before."""

    def __init__(self, robot: Robot, counts: Counter[str]) -> None:
        self.counts, self.streaming = counts, False
        self.worst: dict[str, Excess] = {}
        self.clock = robot.clock
        self.limits = robot.follower.limits
        self.period_s = robot.control_loop.period_ns / NANOSECONDS
        self._axes = list(robot.joint_axes)
        self._gap_s = self._gap_length_s = 0.0
        self._last: tuple[float, FloatArray, FloatArray] | None = None
        driver = robot.control_loop._mixer._driver
        self._stream = driver.stream
        driver.stream = self.judge  # type: ignore[method-assign]

    def pass_time(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def judge(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self._stream(position, velocity, due_ns)
        now = (due_ns / NANOSECONDS, position[self._axes].copy(), velocity[self._axes].copy())
        self.counts["setpoints"] += 1
        limits, last, self._last = self.limits, self._last, now
        if last is None or now[0] - last[0] > GAP_PERIODS * self.period_s:
            self.counts["gaps"] += 1
            self._gap_s = now[0]
            self._gap_length_s = now[0] - last[0] if last else 0.0
            return
        nearer = np.where(now[1] > limits.upper, limits.upper, limits.lower)
        outside = np.maximum(limits.lower - now[1], now[1] - limits.upper)
        self._note("position", now[1], nearer, 1.0 + outside, 1.0 + 1e-6)
        speed = np.abs(now[2])
        self._note("velocity", speed, limits.velocity, speed / limits.velocity, SLACK)
        rate = np.abs(now[2] - last[2]) / (now[0] - last[0])
        # A goal may exceed the acceleration by its margin between its points, a stream may not.
        allowed = SLACK if self.streaming else 2.2
        self._note("acceleration", rate, limits.acceleration, rate / limits.acceleration, allowed)

    def _note(
        self, what: str, value: FloatArray, limit: FloatArray, ratio: FloatArray, allowed: float
    ) -> None:
        """Count a setpoint with a joint whose ``ratio`` is higher than allowed; keep the worst."""
        joint = int(np.argmax(ratio))
        if self._last is None or ratio[joint] <= allowed:
            return
        after_s = self._last[0] - self._gap_s
        name = f"{'after a gap: ' if after_s < AFTER_GAP_S else ''}beyond {what}"
        self.counts[name] += 1
        if name not in self.worst or ratio[joint] > self.worst[name].ratio:
            values = float(ratio[joint]), self.limits.names[joint], float(value[joint])
            times = self._gap_length_s, after_s
            self.worst[name] = Excess(*values, float(limit[joint]), *times)


def stream_for(stream: JointStream, seconds: float, chance: random.Random, judge: Judge) -> None:
    """Send random targets, some of them beyond the limits, with jitter and drop-outs."""
    rate_hz = chance.choice((10.0, 30.0, 100.0, 500.0))
    target = np.array([chance.uniform(-1.0, 1.0) for _ in stream.joints])
    clock = judge.clock
    until_ns = clock.now_ns() + round(seconds * NANOSECONDS)
    while clock.now_ns() < until_ns and stream.open:
        if chance.random() < 0.05:
            target = np.array([chance.uniform(-4.0, 4.0) for _ in stream.joints])
        target += [chance.uniform(-0.05, 0.05) for _ in stream.joints]
        try:
            if chance.random() < 0.1:
                stream.send_velocity([chance.uniform(-4.0, 4.0) for _ in stream.joints])
            else:
                stream.send(target.tolist())
        except NotReady:  # it has ended in the meantime, for example after a long stall
            return
        judge.counts["commands"] += 1
        judge.pass_time(chance.uniform(0.5, 1.5) / rate_hz)
        if chance.random() < DROP_OUT:
            judge.counts["drop-outs"] += 1
            judge.pass_time(chance.uniform(0.0, SILENCE_S))


def one_round(robot: Robot, chance: random.Random, judge: Judge) -> None:
    """Stream for some seconds, then send a goal, and take over from it by another stream."""
    counts = judge.counts
    with robot.stream(mode=chance.choice(("target", "smooth")), takeover=True) as stream:
        judge.streaming = True
        stream_for(stream, chance.uniform(1.0, 8.0), chance, judge)
        counts["timeouts"] += stream.statistics.timeouts
        counts["clipped"] += stream.statistics.clipped
        if not stream.open:
            counts[f"ended: {stream.message.partition(': ')[2][:60]}"] += 1
    judge.streaming = False
    counts["streams"] += 1
    goal = TrajectoryRequest.from_rows(robot.joint_names, [3.0], [[0.0] * 6])
    with robot.follower.follow(goal) as execution:
        judge.pass_time(chance.uniform(0.2, 4.0))
        counts["goals ended"] += execution.done
        with robot.stream(takeover=True) as stream:  # often in motion
            counts["takeovers"] += 1
            stream_for(stream, 0.5, chance, judge)


@click.command()
@click.option("--minutes", default=60.0, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--stepped", is_flag=True, help="In simulated time, without stalls.")
def main(minutes: float, seed: int, stepped: bool) -> None:
    """Stream for MINUTES; print the counts, and fail where a limit was exceeded."""
    configure_logging("error")
    chance, counts = random.Random(seed), Counter[str]()
    clock = SteppedClock() if stepped else MonotonicClock()
    with open_robot("cr3a", "sim", clock=clock) as robot:
        judge = Judge(robot, counts)
        until_ns = clock.now_ns() + round(60.0 * minutes * NANOSECONDS)
        while clock.now_ns() < until_ns:
            try:
                one_round(robot, chance, judge)
            except RobotdError as error:  # rejected: the stall of a busy computer, for example
                counts[f"rejected: {str(error)[:60]}"] += 1
                judge.pass_time(0.5)
        beyond = sum(count for name, count in counts.items() if name.startswith("beyond"))
        speed = float(np.abs(robot.image.velocity).max())
    for name, count in sorted(counts.items()):
        click.echo(f"{name:36}{count:10}")
    for name, excess in sorted(judge.worst.items()):
        click.echo(f"farthest {name}: {excess}")
    click.echo(f"at the end: {speed:.4f} rad/s")
    sys.exit(1 if beyond or speed > 0.01 else 0)


if __name__ == "__main__":
    main()
