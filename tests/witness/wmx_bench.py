"""Robot of joints on the stand-in for the WMX engine, in simulated time.

The judge gets what each servo was commanded in each cycle of the engine, from its own record. The
engine runs in this process, as far as simulated time has come (``plugins/wmx/tests/standin``). The
threads that send positions and velocities are replaced by calls at the same simulated times.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from tests.witness.bench import OVERCURRENT, Bench
from tests.witness.judge import Command, Judge

from robotd.clock import NANOSECONDS
from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.plugin.manager import Backend, PluginOrigin
from robotd.robot import Robot

ROOT = Path(__file__).parents[2]
PARAMETERS = ROOT / "robots" / "cr3a" / "wmx_parameters.xml"
CYCLE_NS = 1_000_000
CYCLE_S = CYCLE_NS / NANOSECONDS
BUFFER_S = 0.02
EXECUTING, WAITING = 2, 3  # queue of a ``Row``
MOVING_RAD_S = 0.3  # of a stream whose buffer runs dry
MIN_BUSY = 2  # calls that are rejected
DROPPED_S = 0.5  # a cable that is cut longer ends the communication
STOP_AGAIN_S = 1.2  # until the next try of a rejected stop, and its ramp
EXCUSED_S = 0.3  # after a fault, in which buffers may run dry
ROUNDING = 1e-7  # rad


class Row(ctypes.Structure):
    """What an axis was commanded in a cycle; as in ``standin/src/stepped.cpp``."""

    _fields_ = [
        ("command", ctypes.c_double),
        ("velocity", ctypes.c_double),
        ("zero", ctypes.c_double),
        ("age", ctypes.c_double),
        ("servo_on", ctypes.c_int32),
        ("queue", ctypes.c_int32),
    ]


class NothingToDo(Exception):
    """What a thread waits for does not come now."""


class SentAtOnce:
    """The thread that sends velocities, as calls: ``turn`` runs it until it waits.

    ``wake`` is called when it has got something to send.
    """

    def __init__(self, now_s: Callable[[], float], wake: Callable[[], None]) -> None:
        self._wake = wake
        self._now_s, self._set, self._since_s = now_s, False, now_s()
        self._run: Callable[[], None] = lambda: None
        self.threading = SimpleNamespace(
            **vars(threading) | {"Thread": self._begin, "Event": lambda: self}
        )

    def _begin(self, target: Callable[[], None], **_: Any) -> Any:
        self._run = target
        return SimpleNamespace(start=lambda: None)

    def turn(self) -> None:
        with suppress(NothingToDo):
            self._run()

    def end(self) -> None:
        """End the thread, as the end of its process does."""
        self._run = lambda: None

    def set(self) -> None:
        self._set, self._since_s = True, self._now_s()
        self._wake()

    def clear(self) -> None:
        self._set = False

    def wait(self, timeout: float | None) -> bool:
        if self._set:
            return True
        if timeout is None or self._now_s() < self._since_s + timeout:
            raise NothingToDo
        self._since_s = self._now_s()
        return False


def imported(name: str, folder: Path) -> Any:
    """Import from a folder, where other tests do not find it: to them it is not installed."""
    sys.path.insert(0, str(folder))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(folder))


@cache
def standin() -> ctypes.CDLL:
    """Build the stand-in and the backend, unless they are built; return the engine's library."""
    os.environ.setdefault("WMX_STANDIN_SHM", f"wmx-witness-{os.getpid()}")
    build = imported("standin_build", ROOT / "plugins" / "wmx" / "tests")
    imported("robotd_wmx.plugin", build.build_all())
    return ctypes.CDLL(str(build.SDK / "lib" / "libimdll.so"))


class WmxBench(Bench):
    """A robot that is not yet started; ``close`` when it is not needed any more."""

    def __init__(
        self, axes: int = 2, rate_hz: float = 100.0, *, base: bool = False, **options: Any
    ) -> None:
        self.prepare(axes, rate_hz, base=base)
        axes = len(self.judges)
        self._engine = standin()
        self._plugin = importlib.import_module("robotd_wmx.plugin")
        period_s = 1.0 / rate_hz
        for judge in self.judges:
            judge.period_s, judge.rounding = CYCLE_S, ROUNDING
            # Twice the commands that are held ahead, those of a burst, and of the next setpoint.
            judge.max_age_periods = (2 * BUFFER_S + 3 * period_s) / CYCLE_S + 2
        self._options = {"stream_buffer_s": BUFFER_S, **options}
        self._rate_hz, self._period_s = rate_hz, period_s
        self._rows = (Row * axes)()
        self._before: list[Row | None] = [None] * axes
        self._ends: list[tuple[float, Callable[[], None]]] = []  # of faults
        self._senders: list[Any] = []
        self._send_s = self._late_s = 0.0  # no turn of the sender before; then so far apart
        self._excused_s = 0.0
        self._left_alone: set[int] = set()  # axes that moved when robotd was killed
        self._velocities = SentAtOnce(lambda: self.now_s, self._send_velocities)
        self._sends_velocities = False
        self._ran_ns = self.clock.now_ns()
        self._hook = ctypes.CFUNCTYPE(None, ctypes.c_double)(self._pass_time)
        self._engine.standin_step_time(ctypes.c_int64(self._ran_ns), self._hook)
        self.port("reset")
        self._patches = ExitStack()
        native = importlib.import_module("robotd_wmx._native")
        made = native.PositionStream

        def make_sender(*arguments: Any) -> Any:
            sender = made(*arguments, threaded=False)
            self._senders.append(sender)
            return sender

        self._patches.enter_context(patch.object(native, "PositionStream", make_sender))
        self._patches.enter_context(
            patch("robotd_wmx.velocity_stream.threading", self._velocities.threading)
        )
        self.clock.advanced = self.settle
        self.robot = self.make_robot()

    def make_robot(self) -> Robot:
        descriptor = RobotDescriptor.model_validate({
            **self.describe(self._rate_hz), "backend": "wmx", "backends": {"wmx": self._options},
            "parameters_file": str(PARAMETERS),
        })  # fmt: skip
        backend = Backend(PluginOrigin("wmx", "robotd_wmx", "wmx", "0.1.0"), self._plugin)
        backend.capabilities |= {Capability.SIMULATED}  # here: the engine uses this clock
        return self.take(Robot(descriptor, backend, self.clock))

    def close(self) -> None:
        self._patches.close()
        self._senders.clear()
        self.port("reset")

    def unplug(self) -> None:
        rows = enumerate(self._before)
        self._left_alone = {axis for axis, row in rows if row is not None and row.velocity}
        self._engine.standin_kill()
        self._senders.clear()
        self._velocities.end()

    def port(self, command: str, *arguments: int) -> None:
        """Run a command of the stand-in's fault port."""
        words = [b"", command.encode(), *(str(argument).encode() for argument in arguments)]
        count = len(words)
        failed = self._engine.standin_port(count, (ctypes.c_char_p * count)(*words))
        assert not failed, words

    def _pass_time(self, milliseconds: float) -> None:
        """Let time pass while a call of the SDK waits."""
        if self._sends_velocities:  # the thread waits, and nothing else does
            self._run_engine(self._ran_ns + round(milliseconds * 1e6))
        else:
            self.run(milliseconds / 1000)

    def settle(self) -> None:
        """Let the engine live up to the present."""
        self._send()
        self._run_engine(self.clock.now_ns())
        for end in [end for end in self._ends if end[0] <= self.now_s]:
            self._ends.remove(end)
            end[1]()

    def _run_engine(self, until_ns: int) -> None:
        while self._ran_ns < until_ns:
            self._ran_ns = min(until_ns, self._ran_ns + CYCLE_NS)
            ran = self._engine.standin_run(
                ctypes.c_int64(self._ran_ns), self._rows, len(self.judges)
            )
            if ran:
                time_s = self._ran_ns / NANOSECONDS
                for axis, judge in enumerate(self.judges):
                    self._judge(judge, axis, time_s)
            self._send()

    def stall(self, seconds: float) -> None:
        self._send_s = max(self._send_s, self.now_s + seconds)  # the whole process is suspended
        self._excuse(seconds)
        self._engine.standin_starve(1)
        super().stall(seconds)
        self._engine.standin_starve(0)

    def _send(self) -> None:
        now_s = self._ran_ns / NANOSECONDS
        if now_s < self._send_s:
            return
        if self._late_s:
            self._send_s = now_s + self._late_s
        for sender in self._senders:
            while sender.turn():
                pass
        self._turn_velocities()

    def _send_velocities(self) -> None:
        if self._ran_ns / NANOSECONDS >= self._send_s:
            self._turn_velocities()

    def _turn_velocities(self) -> None:
        if not self._sends_velocities:
            self._sends_velocities = True
            try:
                self._velocities.turn()
            finally:
                self._sends_velocities = False

    def _judge(self, judge: Judge, axis: int, time_s: float) -> None:
        row = Row.from_buffer_copy(self._rows[axis])
        before, self._before[axis] = self._before[axis], row
        judge.power(time_s, bool(row.servo_on))
        if axis >= self.joints:
            self._judge_wheel(judge, before, row, time_s)
        elif not row.servo_on or before is None or not before.servo_on or before.zero != row.zero:
            judge.own_ramp()
        elif row.queue == EXECUTING:
            slows = abs(row.velocity) < abs(before.velocity) - ROUNDING / CYCLE_S
            # The ramp of a stop is sent at once.
            sent_s = None if slows else time_s - row.age * CYCLE_S
            judge.execute(Command(time_s, row.command, sent_s=sent_s, place=before.command))
        else:
            self._judge_end(judge, before, row, time_s)
            if row.queue != WAITING:
                judge.own_ramp()
                speed = (row.command - before.command) / CYCLE_S
                judge.profile(time_s, speed)
                if not speed:
                    self._left_alone.discard(axis)
                if axis not in self._left_alone:  # else nobody watches its limits
                    judge.bounds(time_s, row.command, before.command)

    def _judge_wheel(self, judge: Judge, before: Row | None, row: Row, time_s: float) -> None:
        """Judge a velocity that the engine commands; it goes on by itself until the next one.

        It commands none to a slave that is offline, and lower ones in any step where calls were
        rejected or late.
        """
        slows = before is not None and abs(row.velocity) < abs(before.velocity)
        excused = slows and time_s <= self._excused_s
        if not row.servo_on or before is None or not before.servo_on or excused:
            judge.own_ramp()
        else:
            judge.execute(Command(time_s, row.velocity, "velocity", place=before.velocity))

    def _judge_end(self, judge: Judge, before: Row, row: Row, time_s: float) -> None:
        """Judge a buffer that has no command any more: the axis rests at once."""
        moved = before.queue == EXECUTING and abs(before.velocity) > MOVING_RAD_S
        excused = time_s <= self._excused_s or judge.may_brake(time_s)
        if moved and row.velocity == 0.0 and not excused:
            judge.findings.append(
                f"{time_s:.3f} s: {judge.name} has no command at {before.velocity:+.2f} rad/s"
            )

    def _excuse(self, seconds: float) -> None:
        self._excused_s = max(self._excused_s, self.now_s + seconds + EXCUSED_S)

    # Faults

    def _until(self, seconds: float, begin: Sequence[Any], end: Sequence[Any]) -> None:
        self._excuse(seconds)
        self.port(*begin)
        self._ends.append((self.now_s + seconds, lambda: self.port(*end)))

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        """Let the engine stand still; or slaves be offline, no status be read, nothing be sent."""
        if how == "commands":  # the sending thread gets no processor
            self._excuse(seconds)
            self._send_s = self.now_s + seconds
        elif how == "answers":
            self._until(seconds, ("status_lost", 1), ("status_lost", 0))
        elif axes:
            for axis in axes:
                self._until(seconds, ("slave_lost", axis), ("slave_back", axis))
        else:
            self._until(seconds, ("freeze", 1), ("freeze", 0))
            for judge in self.judges[self.joints :]:
                judge.rest_s += seconds  # a ramp waits, too

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        """Let the sending thread run late."""
        self._excuse(seconds)
        self._late_s = delay_s
        self._ends.append((self.now_s + seconds, self._be_punctual))

    def _be_punctual(self) -> None:
        self._late_s = 0.0

    def block(self, seconds: float) -> None:
        """Let the engine reject all calls, also stops.

        Stops are repeated after a second at most; after three in vain the engine's quick stop.
        """
        self._until(seconds, ("busy", -1), ("busy", 0))
        self._excuse(seconds + STOP_AGAIN_S)
        for judge in self.judges[self.joints :]:
            judge.rest_s = max(judge.rest_s, self.now_s + seconds + STOP_AGAIN_S)

    def cut_cable(self, seconds: float) -> None:
        if seconds > DROPPED_S:
            self._excuse(seconds)
            self.port("drop_communication")
            return
        for axis in range(len(self.judges)):
            self._until(seconds, ("slave_lost", axis), ("slave_back", axis))

    def reset(self, axis: int) -> None:
        """Let a servo switch itself off."""
        self._excuse(0.0)
        self.port("servo_off", axis)

    def trip(self, axis: int) -> None:
        self._excuse(0.0)
        self.port("amp_alarm", axis, OVERCURRENT)

    def refuse(self, axis: int) -> None:
        self._excuse(0.0)
        self.port("busy", MIN_BUSY)

    def heal(self) -> None:
        for _, end in self._ends:
            end()
        self._ends.clear()
        self._send_s = 0.0
