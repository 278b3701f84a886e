"""Terminal of ``robotd commission``: questions by lines, motion by held keys."""

from __future__ import annotations

import math
import select
import sys
import termios
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import click

from robotd.api import OperationError, RobotdError
from robotd.api.commands import Interrupt, parse_number
from robotd_commissioning.commissioned_axis import CommissionedAxis
from robotd_commissioning.findings import in_words
from robotd_ros.commands.jog_keys import JogKeys, KeyInput

TICK_S = 0.02
DISPLAY_PERIOD_S = 0.2
BRAKE_TEST_POWERED_S = 1.0  # of the brake test, before the servo goes off
SETTLE_S = 2.0
KEY_RELEASE_S = 0.3  # without a repetition of the key; terminals repeat one every 30 to 90 ms
HELP = "←/→ hold to move   +/- speed   Enter: done"
HOMING_HELP = "hold → to home; its release stops   Enter: give up"
_ENTER = (b"\n", b"\r")
_ANSWERS = {"y": True, "yes": True, "n": False, "no": False, "": False}


class Left(Exception):
    """The terminal was lost, or a signal ended the command. Nothing moves any more."""


class CommissionTerminal:
    """Operator at a terminal. Main thread.

    Motion needs a held direction key, repeated by the terminal: after its release, a signal or the
    loss of the terminal the axis slows to rest and its servo goes off.
    """

    def __init__(self, axis: CommissionedAxis) -> None:
        self._axis = axis

    def say(self, text: str) -> None:
        """Print a paragraph."""
        click.echo(text)

    def proceed(self, question: str) -> None:
        """Show the position until Enter. Raises Left."""
        self._hold(JogKeys(1, 0.0), f"{question}; then press Enter", _stay, lambda: False)

    def agrees(self, question: str) -> bool:
        """Ask until y or n is typed; Enter alone is n. Raises click.Abort."""
        _forget_typed()
        while (answer := _line(f"{question} [y/N]: ").lower()) not in _ANSWERS:
            click.echo(f"{answer!r} is not y or n")
        return _ANSWERS[answer]

    def accepts(self, difference: str) -> bool:
        """Show the difference and ask if it is to be written."""
        for line in difference.splitlines():
            colour = {"+": "green", "-": "red"}.get(line[:1])
            click.echo(click.style(line, fg=colour))
        return self.agrees("Write this?")

    def number(self, question: str) -> float:
        """Ask until a finite number is typed. Raises click.Abort."""
        _forget_typed()
        while True:
            text = _line(f"{question}: ")
            with suppress(ValueError):
                if math.isfinite(value := parse_number(text)):
                    return value
            click.echo(f"{text!r} is not a finite number")

    def jog(self, speed: float, distance: float = math.inf) -> float:
        """Move while an arrow key is held; return the lag in s. Raises Left, OperationError."""
        keys = JogKeys(1, speed)
        with self._axis.powered(), self._axis.held_motion() as motion:

            def tick(velocity: float) -> None:
                if math.isfinite(distance):  # slow, whatever + has chosen, so that it ends there
                    velocity = max(-speed, min(speed, velocity))
                ends = abs(motion.travel) >= distance and velocity * motion.travel > 0.0
                motion.move(0.0 if ends else velocity)

            self._hold(keys, HELP, tick, lambda: False)
            return motion.lag_s

    def home(self) -> None:
        """Home while a direction key is held. Raises Left, OperationError."""
        with self._axis.powered():
            homing = _Homing(self._axis)
            try:
                self._hold(JogKeys(1, 1.0), HOMING_HELP, homing.hold, lambda: homing.ended)
            finally:
                homing.end()
            homing.check()

    def settle(self) -> float:
        """Return how far the axis moves after its servo went off, rad or m."""
        with self._axis.powered():
            time.sleep(BRAKE_TEST_POWERED_S)
            start = self._axis.position()
        farthest, until_s = 0.0, time.monotonic() + SETTLE_S
        while time.monotonic() < until_s:
            time.sleep(TICK_S)
            farthest = max(farthest, self._axis.position() - start, key=abs)
        return farthest

    def _hold(
        self,
        keys: JogKeys,
        text: str,
        tick: Callable[[float], None],
        is_done: Callable[[], bool],
    ) -> None:
        """Call ``tick`` with the velocity of the held key until Enter. Raises Left."""
        click.echo(text)
        shown_s = 0.0
        with Interrupt() as interrupt, KeyInput(sys.stdin.fileno()) as key_input:
            while not (is_done() or interrupt.happened or key_input.lost):
                time.sleep(TICK_S)
                typed, now_s = key_input.read(), time.monotonic()
                if any(enter in typed for enter in _ENTER) or keys.ended:
                    break
                keys.feed(typed, now_s)
                tick(keys.velocity(now_s))
                if now_s - shown_s >= DISPLAY_PERIOD_S:
                    shown_s = now_s
                    self._show(key_input)
            if is_done():
                _await_release(key_input)
            left = interrupt.happened or key_input.lost
        with suppress(OSError):
            click.echo("")
        if left:
            raise Left

    def _show(self, key_input: KeyInput) -> None:
        try:
            position = in_words(self._axis.position(), self._axis.unit)
            click.echo(f"\r{position:>12}  ", nl=False)
        except OSError:
            key_input.lost = True


def _await_release(key_input: KeyInput) -> None:
    """Wait until no key repeats: a held key must not answer the next question."""
    with suppress(OSError):
        click.echo("\rdone, release the key")
    quiet_s = last_s = time.monotonic()
    while quiet_s - last_s < KEY_RELEASE_S and not key_input.lost:
        time.sleep(TICK_S)
        quiet_s = time.monotonic()
        if key_input.read():
            last_s = quiet_s


def _line(prompt: str) -> str:
    """Show ``prompt`` and return the line that is typed then. Raises click.Abort at its end.

    ``input`` misses a Ctrl-C that comes just before it reads, and waits for a line.
    """
    click.echo(prompt, nl=False)
    while not select.select([sys.stdin], [], [], TICK_S)[0]:
        pass
    try:
        line = sys.stdin.readline()
    except UnicodeDecodeError:
        line = "\N{REPLACEMENT CHARACTER}"
    except OSError:  # the terminal is lost
        line = ""
    if not line:
        raise click.Abort
    return line.strip()


def _forget_typed() -> None:
    """Drop repetitions of a held key, which are not an answer."""
    with suppress(termios.error):
        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


def _stay(velocity: float) -> None:
    """Move nothing, whatever key is held."""


class _Homing:
    """Homing in a thread of its own, stopped when the key is released.

    Attributes:
        ended: the drive has finished or rejected it.
    """

    def __init__(self, axis: CommissionedAxis) -> None:
        self.ended = False
        self._axis = axis
        self._thread: threading.Thread | None = None
        self._failure: RobotdError | None = None
        self._released = False

    def hold(self, velocity: float) -> None:
        """Start while the key is held; stop once it is released."""
        if velocity and self._thread is None:
            self._thread = threading.Thread(target=self._run, name="commission-homing", daemon=True)
            self._thread.start()
        elif not velocity and self._thread is not None and not self.ended:
            self._released = True
            self._axis.stop()

    def end(self) -> None:
        """Stop until it has ended: a stop before the drive begins has no effect."""
        while self._thread is not None and not self.ended:
            self._released = True
            self._axis.stop()
            self._thread.join(TICK_S)

    def check(self) -> None:
        """Raise OperationError unless the axis was homed."""
        if self._released and self._failure is not None:
            raise OperationError("the key was released before the axis was homed")
        if self._failure is not None:
            raise self._failure
        if self._thread is None:
            raise OperationError("the axis was not homed")

    def _run(self) -> None:
        try:
            self._axis.home()
        except RobotdError as error:
            self._failure = error
        finally:
            self.ended = True
