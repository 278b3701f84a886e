"""Judge of the motion of a base: limits, stops, sources of commands, and odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from tests.contract.sequences import Witness
from tests.core.control.harness import Harness

from robotd.api import FloatArray
from robotd.control.groups.descriptor_limits import twist_limits
from robotd.control.groups.mobile_base import MobileBase
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import InvalidArgument, RobotdError
from robotd.motion.planar import ZERO_TWIST, PlanarTwist, along_arc

MARGIN = 1.05
JOINT_MARGIN = 3.1  # of accelerations: a path between its points, and the way back after a stall
STANDING_RAD_S = 0.02
SILENCE_S = 0.49  # a period less than what arms a source
LATENCY_S = 0.1
PAUSE_PERIODS = 3.5  # between two values: the arc between them is not known
TURNED_RAD = 0.15  # in a period: turned by hand
ODOMETRY = 1e-3  # m and rad


@dataclass
class Source:
    """Client as the witness knows it; times in s of those in which commands could arrive."""

    heard_s: float = -math.inf
    is_armed: bool = True


class BaseWitness(Witness):
    """Judges a base, and the joints that it carries.

    Driven wheels are judged by their commanded speeds, over gaps, too: they keep the speed.
    """

    def __init__(self, harness: Harness) -> None:
        robot = harness.robot
        drive, limits = robot.descriptor.drive, robot.axes.limits
        assert drive is not None
        assert robot.base is not None
        self.base: MobileBase = robot.base
        self._wheels, self._steering = list(drive.axes), bool(drive.steering)
        self._rolls = np.isin(range(len(limits)), drive.axes)
        self._rolls[list(drive.steering_axes)] = False
        velocity = np.array([limit.velocity for limit in limits])
        acceleration = np.array([limit.acceleration for limit in limits])
        super().__init__(
            harness,
            velocity * np.where(self._rolls, MARGIN, 1.1),
            acceleration * np.where(self._rolls, MARGIN, JOINT_MARGIN),
        )
        self._limits = twist_limits(drive)
        ramps_s = [part.velocity / part.deceleration for part in self._limits.parts]
        turns_s = [
            (wheel.upper_rad - wheel.lower_rad) / wheel.velocity_rad_s
            + wheel.velocity_rad_s / wheel.acceleration_rad_s2
            for wheel in drive.steering
        ]
        self._rest_s = max(ramps_s) + sum(turns_s) + self._limits.smoothing() + LATENCY_S
        self.sources: dict[str, Source] = {}
        self.longest_stall_s = 0.0
        self._now_s = self._listened_s = 0.0
        self._interrupted_s = self._valid_s = 0.0  # the latter: until then a command holds
        self._may_move = self._rested = False  # the latter: since the interruption
        self._stopped_s = 0.0  # when the first of the interruptions came
        self._moved_s = 0.0
        self._twist: PlanarTwist | None = None
        self._turns: FloatArray | None = None  # true ones; None: odometry is not judged
        self._fresh_ns = 0
        rate_hz = robot.descriptor.cycle.rate_hz
        robot.control_loop.every(rate_hz, "lost", self._look_first, first=True)

    def interrupt(self) -> None:
        """Motion is interrupted: clients have to begin anew."""
        now_s = self._harness.now_s
        if self._may_move:
            self._stopped_s, self._rested = now_s, False
        self._interrupted_s, self._may_move = now_s, False
        for source in self.sources.values():
            source.is_armed = False

    def hear(self, name: str, twist: PlanarTwist, sent_s: float, timeout_s: float) -> None:
        """Send a command of the client ``name``. Raises the errors of ``MobileBase.command``."""
        source = self.sources.setdefault(name, Source())
        error: RobotdError | None = None
        try:
            ahead, turning, left = twist
            sent_ns = round(sent_s * 1e9)
            self.base.command(ahead, turning, left, timeout_s, sent_ns=sent_ns, source=name)
        except RobotdError as raised:
            error = raised
            raise
        finally:
            if not isinstance(error, InvalidArgument):
                moves = twist != ZERO_TWIST
                silent = self._listened_s - source.heard_s > SILENCE_S
                source.heard_s = self._listened_s
                source.is_armed = source.is_armed or silent or not moves
                if moves and error is None:
                    self._may_move = self._may_move or source.is_armed
                    self._valid_s = sent_s + timeout_s

    def forget_pose(self) -> None:
        """The odometry is set anew."""
        self._turns = None

    def _measure(self, elapsed_s: float) -> FloatArray | None:
        speeds = np.array(self._simulation.servo.command_velocity, float)
        mean = super()._measure(elapsed_s)
        return np.where(self._rolls, speeds, speeds if mean is None else mean)

    def _look_first(self, image: ProcessImage) -> None:
        if not self._simulation.communicating:
            self.interrupt()
            self._turns = None

    def look(self, image: ProcessImage | None = None) -> None:
        super().look(image)
        if image is None:
            return
        self._now_s = self._harness.now_s
        self._listened_s += self._period_s
        if self._rejects_motion():
            self.interrupt()
        self._judge_odometry(image)
        speeds = np.array(self._simulation.servo.command_velocity)[self._wheels]
        judged = self.excused[self._wheels] == 0
        streams = np.array(self._simulation.states.operation)[self._wheels] == int(Operation.STREAM)
        moves = np.abs(speeds) > STANDING_RAD_S
        if (streams & judged & moves).any():
            self._judge_cause(speeds)
        if moves.any():
            self._moved_s = self._now_s
        elif self._now_s > self._stopped_s + self._limits.smoothing() + LATENCY_S:
            self._rested = self._now_s > self._moved_s + LATENCY_S
        self._judge_twist(speeds, all_judged=bool((streams & judged).all()))

    def _rejects_motion(self) -> bool:
        robot, states = self._harness.robot, self._simulation.states
        modes = zip(self._wheels, self.base._modes, strict=True)
        unable = states.amp_alarm | ~states.servo_on | ~states.connected
        return bool(
            unable[self._wheels].any()
            or robot.axes.stop_latch.rejection
            or not robot.connection.ready
            or any(int(states.mode[axis]) != int(mode) for axis, mode in modes)
        )

    def _judge_cause(self, speeds: FloatArray) -> None:
        late = self._now_s > self._interrupted_s + self._rest_s
        if not self._may_move and (late or self._rested):
            self.seen.append(f"nobody began anew, and the wheels move with {speeds} rad/s")
        if self._now_s > self._valid_s + self._rest_s + self.longest_stall_s:
            self.seen.append(f"nobody commands, and the wheels move with {speeds} rad/s")

    def _judge_twist(self, speeds: FloatArray, *, all_judged: bool) -> None:
        before, self._twist = self._twist, None
        if self._steering or not all_judged:
            return
        twist = self._twist = self.base.wheels.twist(*speeds.tolist())
        for place, part in enumerate(self._limits.parts):
            if abs(twist[place]) > MARGIN * part.velocity:
                self.seen.append(f"the twist is {twist}")
            step = MARGIN * max(part.acceleration, part.deceleration) * self._period_s
            if before is not None and abs(twist[place] - before[place]) > step + 1e-6:
                self.seen.append(f"the twist goes from {before} to {twist}")

    def _judge_odometry(self, image: ProcessImage) -> None:
        """Integrate the true turns of the wheels; the device reports them in this period."""
        turns = np.array(self._simulation.servo.position, float)[self._wheels]
        before, since_ns = self._turns, self._fresh_ns
        self._turns, self._fresh_ns = None, image.fresh_ns
        simulation = self._simulation
        if (
            not self._harness.robot.connection.ready
            or not simulation.states.connected[self._wheels].all()
            or image.fresh_ns != simulation.world.now_ns
        ):
            return
        self._turns, found = turns, self.base.pose
        paused = image.fresh_ns - since_ns > PAUSE_PERIODS * self._period_s * 1e9
        if before is None or paused or np.abs(turns - before).max() > TURNED_RAD:
            self._pose = found
            return
        steps = (turns - before).tolist()
        for place in self.base.wheels.steered:
            steps[place] = float(turns[place] + before[place]) / 2
        pose = self._pose = along_arc(self._pose, self.base.wheels.twist(*steps))
        turned = abs(math.remainder(found.heading - pose.heading, math.tau))
        if math.hypot(found.x - pose.x, found.y - pose.y) > ODOMETRY or turned > ODOMETRY:
            self.seen.append(f"odometry is {found}, the base is at {pose}")
