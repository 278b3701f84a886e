"""Page of a calibration by hand: its state, its buttons, and the steps that they control.

The thread of the bus runs ``calibrate_on_page``; requests of the page read the state that it has
published, and leave the button that was pressed.
"""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Iterable, Mapping
from hmac import compare_digest
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import RobotdError
from robotd_serial_servo.hand_calibration import (
    POLL_S,
    Ranges,
    new_offsets,
    release_all,
    save,
    store_middle,
)
from robotd_serial_servo.servo_bus import TICKS_PER_TURN

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIEnvironment

    from robotd.api.commands import Interrupt
    from robotd_serial_servo.servo_bus import ServoBus

TOKEN_BYTES = 24
SHOWN_TIMEOUT_S = 3.0  # for an open page to show the end
HTML = Path(__file__).parent / "calibration_page.html"
STEPS: dict[str, tuple[str, tuple[str, ...]]] = {  # text and buttons of each
    "support": ("Support the arm: its servos go off, and it falls.", ("off", "abort")),
    "releasing": ("The servos go off.", ()),
    "middle": ("Move every joint to the middle of its range.", ("middle", "abort")),
    "storing": ("Keep the arm still: its middle is being stored.", ()),
    "ranges": ("Move each joint from one end to the other.", ("done", "abort")),
    "saving": ("The calibration is being stored.", ()),
}
HEADERS = (
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),  # the address has the token
    ("X-Content-Type-Options", "nosniff"),
    ("Cache-Control", "no-store"),
)


class Aborted(RobotdError):
    """A calibration was ended by its button or by Ctrl-C."""


class CalibrationPage:
    """State and buttons of the page. Thread of the bus, except ``answer``.

    Args:
        interrupt: ends the waiting for a button.
        names: shown at the top, such as robot and file.
    """

    def __init__(self, names: Mapping[str, str], interrupt: Interrupt) -> None:
        self._token = secrets.token_urlsafe(TOKEN_BYTES)
        self._names, self._interrupt = names, interrupt
        self._lock = threading.Lock()
        self._state, self._buttons, self._pressed = b"{}", frozenset[str](), ""
        self._asked_s = float("-inf")
        self._end_shown = threading.Event()

    def address(self, port: int) -> str:
        """Return the address that alone leads to the page."""
        return f"http://127.0.0.1:{port}/{self._token}/"

    def show(self, step: str) -> None:
        """Show a step without buttons that are waited for."""
        self._publish(step, *STEPS[step])

    def wait(self, step: str, ranges: Ranges | None = None) -> None:
        """Show a step, with live positions, until its first button is pressed.

        Raises Aborted: the button abort, or a stop signal. Raises RobotdError: see ``Ranges``.
        """
        text, buttons = STEPS[step]
        too_early = False
        self._pressed = ""
        while True:
            if ranges:
                ranges.follow()
            still = ranges.not_moved() if ranges and step == "ranges" else []
            notice = f"Not moved yet: {', '.join(still)}." if still and too_early else ""
            self._publish(step, text, buttons, notice, ranges)
            time.sleep(POLL_S)
            with self._lock:
                pressed, self._pressed = self._pressed, ""
            if pressed == "abort" or self._interrupt.happened:
                raise Aborted("aborted, no file is written")
            if pressed and not still:
                return
            too_early = too_early or bool(pressed)

    def end(self, step: str, text: str) -> None:
        """Show the end, ``done`` or ``failed``; return when a page that is open has shown it."""
        self._publish(step, text, ())
        if time.monotonic() - self._asked_s < SHOWN_TIMEOUT_S:
            self._end_shown.wait(SHOWN_TIMEOUT_S)

    def answer(self, environ: WSGIEnvironment, start_response: StartResponse) -> Iterable[bytes]:
        """Answer a request. Threads of requests."""
        token, slash, name = environ["PATH_INFO"][1:].partition("/")
        if not compare_digest(token.encode(), self._token.encode()):
            return _reply(start_response, "403 Forbidden", b"open the address on the terminal\n")
        method = environ["REQUEST_METHOD"]
        if method == "POST":
            if self._press(name):
                return _reply(start_response, "204 No Content", b"")
            return _reply(start_response, "409 Conflict", b"not a button of the present step\n")
        if method == "GET" and slash and name == "":
            return _reply_page(start_response)
        if method == "GET" and name == "state":
            self._asked_s = time.monotonic()
            return _reply(start_response, "200 OK", self._state, "application/json")
        return _reply(start_response, "404 Not Found", b"no such page\n")

    def _press(self, button: str) -> bool:
        """Note a button, or that the page has shown the end."""
        if button == "shown":
            self._end_shown.set()
            return True
        with self._lock:
            if button not in self._buttons:
                return False
            self._pressed = self._pressed or button
        return True

    def _publish(
        self,
        step: str,
        text: str,
        buttons: Iterable[str],
        notice: str = "",
        ranges: Ranges | None = None,
    ) -> None:
        state = {
            "names": self._names,
            "step": step,
            "text": text,
            "buttons": list(buttons),
            "notice": notice,
            "joints": _joints(ranges) if ranges else [],
            "not_moved": ranges.not_moved() if ranges else [],
        }
        with self._lock:
            self._state = json.dumps(state).encode()
            self._buttons = frozenset(buttons)


def calibrate_on_page(
    bus: ServoBus,
    joints: Mapping[str, int],
    path: Path,
    page: CalibrationPage,
    *,
    written: str,
    ask: bool,
) -> None:
    """Calibrate by the buttons of ``page``, which shows the error that ends it, too.

    Args:
        written: text at the end.
        ask: before the servos go off.

    Raises RobotdError, OSError: it has ended without a file.
    """
    offsets = dict[str, int]()
    try:
        if ask:
            page.wait("support")
        page.show("releasing")
        release_all(bus, joints)
        page.wait("middle", Ranges(bus, joints))
        page.show("storing")
        store_middle(bus, joints, offsets)
        ranges = Ranges(bus, joints)
        page.wait("ranges", ranges)
        page.show("saving")
        save(bus, joints, offsets, ranges, path)
    except (RobotdError, OSError) as error:
        advice = new_offsets([*offsets]) if offsets else ""
        page.end("failed", f"Calibration ended: {error}\n{advice}".strip())
        if advice:
            click.echo(advice, err=True)
        raise
    page.end("done", written)


def _joints(ranges: Ranges) -> list[dict[str, str | float | None]]:
    """Return the rows of the page: ticks, and degrees of the range so far."""
    return [
        {
            "name": joint,
            "now": ranges.now.get(joint),
            "lowest": low,
            "highest": high,
            "degrees": 360.0 * (high - low) / TICKS_PER_TURN,
        }
        for joint, (low, high) in ranges.found.items()
    ]


def _reply_page(start_response: StartResponse) -> list[bytes]:
    """Answer the page, whose own script and style alone are in force."""
    nonce = secrets.token_urlsafe(TOKEN_BYTES)
    policy = (
        f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}';"
        " connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none';"
        " frame-ancestors 'none'"
    )
    body = HTML.read_text(encoding="utf-8").replace("NONCE", nonce).encode()
    return _reply(start_response, "200 OK", body, "text/html", ("Content-Security-Policy", policy))


def _reply(
    start_response: StartResponse,
    status: str,
    body: bytes,
    content_type: str = "text/plain",
    *headers: tuple[str, str],
) -> list[bytes]:
    own = ("Content-Type", f"{content_type}; charset=utf-8"), ("Content-Length", str(len(body)))
    start_response(status, [*own, *HEADERS, *headers])
    return [body]
