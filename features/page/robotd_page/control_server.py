"""Control side of the page: a WebSocket for clients that know the token."""

from __future__ import annotations

import asyncio
import itertools
import json
import secrets
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from types import MappingProxyType
from typing import Annotated, Any

from aiohttp import WSCloseCode, WSMsgType, web
from pydantic import Field, TypeAdapter, ValidationError

from robotd.api import RobotdError, get_logger
from robotd.api.features import sent_by
from robotd.api.robots import Robot
from robotd_page import control_commands as commands
from robotd_page.control_drive import DriveBeat, HeldDrive, drive_limits, drive_motions
from robotd_page.control_jog import HeldJoint, JogBeat, jog_velocities
from robotd_page.control_target import HeldMove, MoveTool, Reach, reach
from robotd_page.control_tool import HeldTool, JogTool, Tools, describe_tools
from robotd_page.held_motion import HEARTBEAT_S, TIMEOUT_S, Heartbeat, JogEnd, Release
from robotd_page.page_message import websocket_frames
from robotd_page.seen_state import rejection
from robotd_page.viewers import Viewer, accept

log = get_logger("page")

MAX_CONTROLLERS = 4
MAX_RUNNING = 4  # commands of one controller
MAX_WORKERS = MAX_CONTROLLERS * (MAX_RUNNING + 3)  # two for the holds of each, one for its target
TOKEN_BYTES = 24
TOKEN_TIMEOUT_S = 5.0
PING_S = 5.0  # a controller that does not answer within 1.5 of it is dropped
WRONG_TOKEN_DELAY_S = 1.0

Request = Annotated[
    JogBeat
    | JogTool
    | MoveTool
    | Reach
    | DriveBeat
    | Release
    | commands.Stop
    | commands.Reset
    | commands.Recover
    | commands.SwitchServos
    | commands.Grip
    | commands.Speed
    | commands.Pause
    | commands.Output
    | commands.OutputBit
    | commands.OutputByte
    | commands.Inject,
    Field(discriminator="type"),
]
REQUEST: TypeAdapter[Request] = TypeAdapter(Request)


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
        hold_timeout_s: age of the last heartbeat at which a jog slows to rest.

    Attributes:
        token: new with each start; a client that has it can move the robot.
    """

    def __init__(
        self,
        robot: Robot,
        faults: commands.InjectsFaults | None = None,
        *,
        tools: Tools = MappingProxyType({}),
        hold_timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self._robot = robot
        self._faults, self._tools = faults, tools
        self._hold_timeout_s = hold_timeout_s
        self._numbers = itertools.count(1)
        self._controllers: set[Controller] = set()
        self._workers = ThreadPoolExecutor(MAX_WORKERS, "robotd-page-worker")

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
            websocket_frames([json.dumps(self._welcome(name))]),
            self._robot.control_loop.yield_to_control_loop,
        )
        controller = Controller(
            self._robot,
            self._faults,
            self._tools,
            name,
            viewer,
            self._workers,
            self._hold_timeout_s,
        )
        self._controllers.add(controller)
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
        self._workers.shutdown(wait=False, cancel_futures=True)

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

    def _welcome(self, name: str) -> dict[str, Any]:
        robot = self._robot
        return {
            "type": "welcome",
            "name": name,
            "heartbeat_ms": 1000 * HEARTBEAT_S,
            "jog_velocities": jog_velocities(robot),
            "tools": describe_tools(self._tools),
            "drive": _drive(robot),
            "gripper": robot.gripper is not None,
            "outputs": {name: f"out{at.byte}.{at.bit}" for name, at in robot.io.outputs.items()},
            "output_bytes": robot.io.sizes[1],
            "faults": self._faults.fields if self._faults else {},
        }


class Controller:
    """Executes the requests of one client, and answers each. Thread of the server.

    Args:
        faults: of a simulation.
        tools: of the robot.
        name: of the client, as owner of joints and sender of commands.
        viewer: that the answers are sent to.
        workers: execute commands, which may block.
        hold_timeout_s: of ``HeldJoint``.

    Attributes:
        viewer: of the client.
    """

    def __init__(
        self,
        robot: Robot,
        faults: commands.InjectsFaults | None,
        tools: Tools,
        name: str,
        viewer: Viewer,
        workers: ThreadPoolExecutor,
        hold_timeout_s: float,
    ) -> None:
        self.viewer = viewer
        self._robot, self._faults, self._name, self._workers = robot, faults, name, workers
        self._loop = asyncio.get_running_loop()
        self._running = 0
        self._newest_hold = 0
        self._held: type[Heartbeat] | None = None  # what it moves; None: it was rejected
        self._jog = HeldJoint(robot, name, workers, self._jog_ended, hold_timeout_s)
        self._tools = tools
        self._tool = HeldTool(
            tools, robot, name, workers, self._jog_ended, hold_timeout_s, self._put_note
        )
        self._move = HeldMove(tools, robot, name, workers, self._jog_ended, hold_timeout_s)
        self._drive = HeldDrive(robot, name, self._put_end, hold_timeout_s)
        self._is_reaching = False

    def take(self, text: str) -> None:
        """Begin to execute a request."""
        try:
            request = REQUEST.validate_json(text)
        except ValidationError as error:
            self._put({"type": "error", "text": _reasons(error)})
            return
        match request:
            case JogBeat() if self._may_hold(request):
                self._jog.beat(request)
            case JogTool() if self._may_hold(request):
                self._tool.beat(request)
            case MoveTool() if self._may_hold(request):
                self._move.beat(request)
            case DriveBeat() if self._may_hold(request):
                self._drive.beat(request)
            case Release():  # the numbers of holds are common to all
                for held in (self._jog, self._tool, self._move):
                    held.release(request.hold, request.reason)
                self._drive.release(request.hold)
            case Reach() if not self._is_reaching:  # a page asks again after the answer
                self._is_reaching = True
                self._workers.submit(self._reach, request)
            case commands.Command():
                self._begin(request)

    def close(self) -> None:
        """End all motion of the client, which has gone."""
        for held in (self._jog, self._tool, self._move, self._drive):
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
        with sent_by(self._name):
            try:
                text, is_done = command.run(self._robot, self._faults), True
            except RobotdError as error:
                text, is_done = str(error), False
                log.warning("command of the page rejected", name=self._name, reason=text)
            except Exception as error:
                text, is_done = f"robotd failed: {error}", False
                log.exception("command of the page failed")
        self._call(self._ran, command, is_done, text)

    def _ran(self, command: commands.Command, is_done: bool, text: str) -> None:
        self._running -= 1
        self._answer(command, is_done, text)

    def _answer(self, command: commands.Command, is_done: bool, text: str) -> None:
        self._put({"type": "answer", "id": command.id, "ok": is_done, "text": text})

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
