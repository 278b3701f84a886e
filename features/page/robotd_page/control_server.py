"""Control side of the page: a WebSocket for clients that know the token."""

from __future__ import annotations

import asyncio
import itertools
import json
import secrets
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from types import MappingProxyType
from typing import Any, Protocol

from aiohttp import WSCloseCode, WSMsgType, web
from pydantic import ValidationError

from robotd.api import RobotdError, get_logger
from robotd.api.features import sent_by
from robotd.api.robots import Robot
from robotd_page import control_commands as commands
from robotd_page.control_drive import DriveBeat, HeldDrive, drive_limits, drive_motions
from robotd_page.control_jog import HeldJoint, JogBeat, jog_velocities
from robotd_page.control_panel import ControlPanel, requests_of
from robotd_page.control_target import HeldMove, MoveTool, Reach, reach
from robotd_page.control_tool import HeldTool, JogTool, Tools, describe_tools
from robotd_page.held_motion import HEARTBEAT_S, TIMEOUT_S, Heartbeat, JogEnd, Release
from robotd_page.page_message import websocket_frames
from robotd_page.seen_state import rejection
from robotd_page.viewers import Viewer, accept

log = get_logger("page")

MAX_CONTROLLERS = 4
MAX_RUNNING = 4  # commands of one controller
PANEL_S = 0.2  # interval at which the state of the panel is compared
MAX_WORKERS = MAX_CONTROLLERS * (MAX_RUNNING + 3)  # two for the holds of each, one for its target
TOKEN_BYTES = 24
TOKEN_TIMEOUT_S = 5.0
PING_S = 5.0  # a controller that does not answer within 1.5 of it is dropped
WRONG_TOKEN_DELAY_S = 1.0


class Token(commands.Message):
    """First message of a client."""

    token: str


class PageControl:
    """Controllers of a robot. Thread of the server, unless a method says otherwise.

    A controller is a WebSocket whose first message has the token; whatever else it sends first
    closes it. Nothing that a GET request carries changes anything.

    Args:
        faults: of a simulation, which the page can inject; None: there are none.
        tools: of the robot, which the page can move.
        panel: of another feature; None: there is none.
        hold_timeout_s: age of the last heartbeat at which a jog slows to rest.

    Attributes:
        token: new with each start; a client that has it can move the robot.
        robot, faults, tools, panel, hold_timeout_s: see the arguments.
        workers: execute commands, which may block.
        requests: validates the messages of controllers.
    """

    def __init__(
        self,
        robot: Robot,
        faults: commands.InjectsFaults | None = None,
        *,
        tools: Tools = MappingProxyType({}),
        panel: ControlPanel | None = None,
        hold_timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self.robot, self.faults, self.tools, self.panel = robot, faults, tools, panel
        self.hold_timeout_s = hold_timeout_s
        self.workers = ThreadPoolExecutor(MAX_WORKERS, "robotd-page-worker")
        self.requests = requests_of((*panel.commands, *panel.holds) if panel else ())
        self._numbers = itertools.count(1)
        self._controllers: set[Controller] = set()
        self._panel_state: dict[str, Any] = {}  # as it was sent
        self._publishing: asyncio.Task[None] | None = None

    def address(self, url: str) -> str:
        """Return the address that unlocks the page at ``url``. Any thread.

        The token is in its fragment, which a browser sends to no server.
        """
        return f"{url}#token={self.token}"

    async def answer(self, request: web.Request) -> web.StreamResponse:
        """Serve one controller until its connection ends."""
        socket, transport = await accept(request, PING_S)
        if transport is None or not await self._has_token(socket):
            return socket
        if len(self._controllers) >= MAX_CONTROLLERS:
            text = f"{MAX_CONTROLLERS} pages control the robot already"
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER, message=text.encode())
            return socket
        name = f"page {next(self._numbers)}"
        viewer = Viewer(
            socket,
            transport,
            websocket_frames(map(json.dumps, self._first(name))),
            self.robot.control_loop.yield_to_control_loop,
        )
        controller = Controller(self, name, viewer)
        self._controllers.add(controller)
        if self.panel and (self._publishing is None or self._publishing.done()):
            self._publishing = asyncio.create_task(self._publish_panel(self.panel))
        log.info("page takes control", name=name, peer=request.remote)
        try:
            await viewer.run(controller.take)
        finally:
            controller.close()
            self._controllers.discard(controller)
            log.info("page leaves control", name=name)
        return socket

    async def close(self) -> None:
        """End all jogs and connections."""
        for controller in self._controllers:
            controller.close()
        await asyncio.gather(
            *(controller.viewer.close() for controller in self._controllers), return_exceptions=True
        )
        if self._publishing:
            self._publishing.cancel()
        self.workers.shutdown(wait=False, cancel_futures=True)

    async def _publish_panel(self, panel: ControlPanel) -> None:
        """Send the parts of the panel's state that have changed, while there are controllers."""
        loop = asyncio.get_running_loop()
        while self._controllers:
            state = await loop.run_in_executor(self.workers, panel.state)
            changed = {
                key: part for key, part in state.items() if part != self._panel_state.get(key)
            }
            if changed:
                self._panel_state = state
                frames = websocket_frames([json.dumps({"type": "panel", "state": changed})])
                for controller in self._controllers:
                    controller.viewer.send(frames)
            await asyncio.sleep(PANEL_S)

    async def _has_token(self, socket: web.WebSocketResponse) -> bool:
        """Return True after the right token; close the connection otherwise."""
        try:
            message = await socket.receive(TOKEN_TIMEOUT_S)
        except TimeoutError:
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"no token")
            return False
        given = _token(message.data) if message.type is WSMsgType.TEXT else ""
        if secrets.compare_digest(given.encode(), self.token.encode()):
            return True
        log.warning("control rejected: wrong token")
        await asyncio.sleep(WRONG_TOKEN_DELAY_S)
        await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"wrong token")
        return False

    def _first(self, name: str) -> Iterator[dict[str, Any]]:
        """Yield the first messages to a controller."""
        yield self._welcome(name)
        if self.panel:
            yield {"type": "panel", "state": self._panel_state}

    def _welcome(self, name: str) -> dict[str, Any]:
        robot = self.robot
        return {
            "type": "welcome",
            "name": name,
            "heartbeat_ms": 1000 * HEARTBEAT_S,
            "jog_velocities": jog_velocities(robot),
            "tools": describe_tools(self.tools),
            "drive": _drive(robot),
            "gripper": robot.gripper is not None,
            "outputs": {name: f"out{at.byte}.{at.bit}" for name, at in robot.io.outputs.items()},
            "output_bytes": robot.io.sizes[1],
            "faults": self.faults.fields if self.faults else {},
            "panel": self.panel.describe() if self.panel else None,
        }


class Held(Protocol):
    """Motion while a button is held: ``HeldMotion`` or ``HeldDrive``."""

    def beat(self, beat: Any, /) -> None: ...
    def release(self, number: int, reason: str, /) -> None: ...
    def close(self) -> None: ...


class Controller:
    """Executes the requests of one client, and answers each. Thread of the server.

    Args:
        control: robot, tools and panel that it commands.
        name: of the client, as owner of joints and sender of commands.
        viewer: that the answers are sent to.

    Attributes:
        viewer: of the client.
    """

    def __init__(self, control: PageControl, name: str, viewer: Viewer) -> None:
        self.viewer = viewer
        self._robot, self._tools, self._name = control.robot, control.tools, name
        self._requests, self._workers = control.requests, control.workers
        self._access = commands.Access(control.robot, control.faults, lambda: self._has_left)
        self._loop = asyncio.get_running_loop()
        self._running, self._has_left = 0, False
        self._newest_hold = 0
        self._held: type[Heartbeat] | None = None  # what it moves; None: it was rejected
        by_client = control.robot, name, control.workers, self._jog_ended, control.hold_timeout_s
        self._holds: dict[type[Heartbeat], Held] = {
            JogBeat: HeldJoint(*by_client),
            JogTool: HeldTool(control.tools, *by_client, self._put_note),
            MoveTool: HeldMove(control.tools, *by_client),
            DriveBeat: HeldDrive(control.robot, name, self._put_end, control.hold_timeout_s),
        }
        if control.panel:
            self._holds |= {beat: hold(*by_client) for beat, hold in control.panel.holds.items()}
        self._is_reaching = False

    def take(self, text: str) -> None:
        """Begin to execute a request."""
        try:
            request = self._requests.validate_json(text)
        except ValidationError as error:
            self._put({"type": "error", "text": _reasons(error)})
            return
        match request:
            case Heartbeat():
                if self._may_hold(request):
                    self._holds[type(request)].beat(request)
            case Release():  # the numbers of holds are common to all
                for held in self._holds.values():
                    held.release(request.hold, request.reason)
            case Reach() if not self._is_reaching:  # a page asks again after the answer
                self._is_reaching = True
                self._workers.submit(self._reach, request)
            case commands.Command():
                self._begin(request)

    def close(self) -> None:
        """End all motion of the client, which has gone."""
        self._has_left = True
        for held in self._holds.values():
            held.close()

    def _may_hold(self, request: Heartbeat) -> bool:
        """Return False for a hold that came too late, or is over; its client gets one message."""
        if request.hold > self._newest_hold:
            self._newest_hold, self._held = request.hold, type(request)
            if reason := rejection(self._robot, request.seen, self._name):
                self._held = None
                log.warning("jog of the page rejected", name=self._name, reason=reason)
                self._put_end(JogEnd(request.hold, is_wanted=False, is_silent=False, reason=reason))
        return request.hold == self._newest_hold and type(request) is self._held

    def _begin(self, command: commands.Command) -> None:
        is_stop = isinstance(command, commands.Stop)
        if is_stop:
            # At once: the control loop brings everything to rest, however busy the workers are.
            with sent_by(self._name):
                self._robot.axes.stop_latch.engage(commands.STOP_REASON)
        is_allowed = command.is_always_allowed(self._robot)
        reason = "" if is_allowed else rejection(self._robot, command.seen, self._name)
        if reason:
            log.warning("command of the page rejected", name=self._name, reason=reason)
            self._answer(command, False, reason)
            return
        if self._running >= MAX_RUNNING:
            busy = f"{MAX_RUNNING} commands are still being executed"
            self._answer(command, is_stop, "motion is being stopped" if is_stop else busy)
            return
        self._running += 1
        self._workers.submit(self._run, command)

    def _run(self, command: commands.Command) -> None:
        """Worker: execute one command."""
        data = None
        with sent_by(self._name):
            try:
                found, is_done = command.run(self._access), True
                text, data = (found, None) if isinstance(found, str) else ("", found)
            except RobotdError as error:
                text, is_done = str(error), False
                if not isinstance(command, commands.Question):
                    log.warning("command of the page rejected", name=self._name, reason=text)
            except Exception as error:
                text, is_done = f"robotd failed: {error}", False
                log.exception("command of the page failed")
        self._call(self._ran, command, is_done, text, data)

    def _ran(self, command: commands.Command, *answer: Any) -> None:
        self._running -= 1
        self._answer(command, *answer)

    def _answer(
        self, command: commands.Command, is_done: bool, text: str, data: Any = None
    ) -> None:
        answer = {"type": "answer", "id": command.id, "ok": is_done, "text": text}
        self._put(answer if data is None else {**answer, "data": data})

    def _reach(self, question: Reach) -> None:
        """Worker: answer with the posture that reaches a target."""
        try:
            found = reach(self._robot, self._tools, question)
        except Exception as error:
            found = {"pose": None, "joints": None, "text": str(error)}
            if not isinstance(error, RobotdError):
                log.exception("the posture of a target failed")
        self._call(self._reached, {"type": "reach", "id": question.id, **found})

    def _reached(self, answer: dict[str, Any]) -> None:
        self._is_reaching = False
        self._put(answer)

    def _jog_ended(self, end: JogEnd) -> None:
        """Worker: say how a jog has ended."""
        self._call(self._put_end, end)

    def _put_end(self, end: JogEnd) -> None:
        self._put(
            {
                "type": "jog",
                "hold": end.hold,
                "ok": end.is_wanted,
                "silent": end.is_silent,
                "text": end.reason,
                "remaining": end.remaining,
                "what": end.what,
            }
        )

    def _put_note(self, hold: int, text: str) -> None:
        self._put({"type": "slow", "hold": hold, "text": text})

    def _call(self, function: Any, *args: Any) -> None:
        """Call in the server's thread; without effect after its end."""
        try:
            self._loop.call_soon_threadsafe(function, *args)
        except RuntimeError:
            log.info("a page had left before its answer", name=self._name)

    def _put(self, message: dict[str, Any]) -> None:
        self.viewer.send(websocket_frames([json.dumps(message)]))


def _drive(robot: Robot) -> dict[str, Any] | None:
    """Return what a page needs to drive the base; None without one."""
    limits = drive_limits(robot)
    if robot.base is None or limits is None:
        return None
    return {**asdict(limits), "motions": [*drive_motions(robot.base, limits)]}


def _token(text: str) -> str:
    try:
        return Token.model_validate_json(text).token
    except ValidationError:
        return ""


def _reasons(error: ValidationError) -> str:
    return "; ".join(
        f"{'.'.join(map(str, detail['loc']))}: {detail['msg']}" for detail in error.errors()[:3]
    )
