"""The backend of a whole-arm controller on the stand-in of its controller, in simulated time."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
from tests.plugins.dobot.arm import Arm
from tests.plugins.dobot.controller import Controller
from tests.witness.bench import CR3A_BENT, OVERCURRENT, TRAJECTORY, Bench
from tests.witness.judge import Command
from tests.witness.tcp_line import TcpLine

import robotd_dobot
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.device.capabilities import Capability
from robotd.plugin.manager import Backend, PluginOrigin
from robotd.robot import Robot

JOINTS = 6
ADDRESS = "127.0.0.1"
TARGET_AGE_PERIODS = 5  # `max_target_age_s` of the backend, at the rate of the bench
QUICK_STOP_RAD_S2, QUICK_STOP_S = 20.0, 0.3  # of the driver
EPSILON_S = 1e-9


class DobotBench(Bench):
    """A robot that is not yet started; ``close`` when it is not needed any more.

    The judge is at the arm of the controller: each target that it executes.

    Args:
        max_target_age_s: option of the backend; None: that of the backend, in periods.
    """

    bent_joints = CR3A_BENT

    def __init__(self, rate_hz: float = 100.0, max_target_age_s: float | None = None) -> None:
        self.prepare(JOINTS, rate_hz, base=False)
        self.arm = Arm(lambda: self.now_s)
        self.controller = Controller(self.arm)
        self.line = TcpLine(lambda: self.now_s, self._obey)
        self._servo = self.arm.servo
        self.arm.servo = self._execute  # type: ignore[method-assign]
        self._report_s = 0.0
        keys = {
            "cycle.rate_hz": rate_hz,
            "backends.dobot.address": ADDRESS,
            "backends.dobot.target_period_s": 1.0 / rate_hz,
            "backends.dobot.max_target_age_s": max_target_age_s or TARGET_AGE_PERIODS / rate_hz,
            "engine.open_tries": 1,
            "trajectory.acceleration_margin": TRAJECTORY["acceleration_margin"],
        }
        overrides = [parse_override(f"{key}={value}") for key, value in keys.items()]
        self._descriptor = load_robot_descriptor("cr3a", overrides=overrides)
        for judge, joint in zip(self.judges, self._descriptor.joints, strict=True):
            judge.velocity, judge.acceleration = joint.velocity, joint.acceleration
            judge.lower, judge.upper = joint.lower, joint.upper
            judge.max_age_periods = TARGET_AGE_PERIODS + 1
        self._patches = ExitStack()
        sockets = SimpleNamespace(**vars(socket) | {"create_connection": self.line.connect})
        self._patches.enter_context(patch("robotd_dobot.link.socket", sockets))
        self.clock.advanced = self.settle
        self.robot = self.make_robot()

    def make_robot(self) -> Robot:
        origin = PluginOrigin("dobot", "robotd_dobot", "dobot", "1.0")
        backend = Backend(origin, robotd_dobot)
        backend.capabilities |= {Capability.SIMULATED}  # here: the controller uses this clock
        return Robot(self._descriptor, backend, self.clock)

    def close(self) -> None:
        self._patches.close()
        self.line.abort()

    def unplug(self) -> None:
        self.line.abort()
        for judge in self.judges:
            judge.own_ramp()  # the arm stops at its last target

    def _obey(self, text: str) -> str:
        replies: list[bytes] = []
        writer: Any = SimpleNamespace(write=replies.append)
        self.controller.obey(text, writer)
        self._power()
        return b"".join(replies).decode()

    def _execute(self, target: np.ndarray[Any, Any], time_s: float) -> int:
        before = np.radians(self.arm.state()[0])
        code = self._servo(target, time_s)
        for judge, angle, place in zip(self.judges, np.radians(target), before, strict=True):
            if code:
                judge.own_ramp()
            else:
                sent_s = self.line.sent_s
                judge.execute(Command(self.now_s, float(angle), sent_s=sent_s, place=float(place)))
        return code

    def _power(self) -> None:
        for judge in self.judges:
            judge.power(self.now_s, self.arm.enabled)

    def settle(self) -> None:
        """Let the controller live up to the present, and its feedback arrive."""
        self.line.advance()
        if self.now_s >= self._report_s - EPSILON_S:
            self._report_s = self.now_s + self.controller.period_s
            self.line.report(self.controller.packet())
        self._power()

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        """Cut the cable; or let the controller send no feedback, or read no targets."""
        until_s = self.now_s + seconds
        if how == "answers":
            self.line.mute_s = until_s
            # Values that are too old end in a quick stop of the driver.
            self.allow_ramp(QUICK_STOP_RAD_S2, seconds + QUICK_STOP_S)
        elif how == "commands":
            self.line.busy_s = until_s
        else:
            self.cut_cable(seconds)

    def block(self, seconds: float) -> None:
        self.line.busy_s = self.now_s + seconds

    def cut_cable(self, seconds: float) -> None:
        self.line.cut_s, self.is_cut = self.now_s + seconds, True

    def reset(self, axis: int) -> None:
        """End the connections, as the controller does when it is restarted."""
        self.line.abort()
        self.is_cut = True

    def trip(self, axis: int) -> None:
        self.arm.trip(OVERCURRENT)
        self._power()

    def heal(self) -> None:
        line = self.line
        line.cut_s = line.busy_s = line.mute_s = 0.0
        self.is_cut = False
        line.advance()
