"""Server of the stand-in: dashboard, motion, feedback, and a port for faults."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from robotd_dobot_tcp.protocol import FEEDBACK, FEEDBACK_PERIOD_S, TEST_VALUE

from dobot_tcp_fake.arm import JOINTS, Arm

COMMAND = re.compile(r"\s*(\w+)\(([^()]*)\)")


class Controller:
    """Speaks the protocol for one ``Arm``.

    Attributes:
        ports: of dashboard, motion, feedback and faults.
        frozen: no feedback is sent, and no connection is closed.
        reads_targets: clear while no target is read; those that come wait.
        period_s: between two packets.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm, self.ports = arm, [0, 0, 0, 0]
        self.frozen, self.period_s = False, FEEDBACK_PERIOD_S
        self.reads_targets = asyncio.Event()
        self.reads_targets.set()
        self._writers: list[asyncio.StreamWriter] = []
        self._readers: list[asyncio.StreamWriter] = []  # of the feedback

    async def serve(self, ports: list[int]) -> None:
        """Listen on ``ports`` (0: any free one), print them, and run until standard input ends."""
        roles = (self._talk, self._move, self._report, self._hurt)
        servers = [
            await asyncio.start_server(role, "127.0.0.1", port)
            for role, port in zip(roles, ports, strict=True)
        ]
        self.ports = [server.sockets[0].getsockname()[1] for server in servers]
        sys.stdout.write(" ".join(map(str, self.ports)) + "\n")
        sys.stdout.flush()
        parent = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        feedback = asyncio.create_task(self._feedback())
        await parent
        feedback.cancel()

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Dashboard: commands, each with a reply."""
        self._writers.append(writer)
        text = ""
        while part := await reader.read(4096):
            text = self._obey(text + part.decode("ascii", "replace"), writer)
        writer.close()

    async def _move(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Motion port: targets, each with a reply."""
        self._writers.append(writer)
        text = ""
        with suppress(ConnectionError):  # of a client that discards its targets
            while part := await reader.read(4096):
                text = self._obey(text + part.decode("ascii", "replace"), writer)
                await self.reads_targets.wait()
        writer.close()

    def _obey(self, text: str, writer: asyncio.StreamWriter) -> str:
        """Obey the whole commands of ``text``, and return the rest."""
        while found := COMMAND.match(text):
            text = text[found.end() :]
            writer.write(self._answer(found[1], found[2]).encode("ascii"))
        return text

    def _answer(self, name: str, values: str) -> str:
        actions: dict[str, Callable[[], tuple[int, str]]] = {
            "enablerobot": lambda: (self.arm.switch(True), ""),
            "disablerobot": lambda: (self.arm.switch(False), ""),
            "clearerror": lambda: (self.arm.clear(), ""),
            "emergencystop": lambda: self._done(self.arm.press(values == "1")),
            "resetrobot": lambda: self._done(self.arm.hold()),
            "speedfactor": lambda: (0 if 0 < int(values) <= 100 else -1, ""),
            "robotmode": lambda: (0, str(self._mode())),
            "geterrorid": lambda: (0, str([[self.arm.alarm][: bool(self.arm.alarm)]] + [[]] * 6)),
            "doexecute": lambda: self._output(*map(int, values.split(","))),
            "servoj": lambda: (self._servo(values), ""),
        }
        action = actions.get(name.lower(), lambda: (-10000, ""))
        try:
            code, value = action()
        except ValueError:
            code, value = -1, ""
        return f"{code},{{{value}}},{name}({values});"

    def _done(self, nothing: None) -> tuple[int, str]:
        return 0, ""

    def _output(self, terminal: int, level: int) -> tuple[int, str]:
        if not 1 <= terminal <= 16:
            return -1, ""
        self.arm.output(terminal - 1, bool(level))
        return 0, ""

    def _servo(self, values: str) -> int:
        angles = values.split(",")[:JOINTS]
        named = dict(field.split("=") for field in values.split(",")[JOINTS:])
        return self.arm.servo(np.array([float(angle) for angle in angles]), float(named["t"]))

    def _mode(self) -> int:
        if self.arm.alarm:
            return 9
        return (7 if self.arm.state()[1].any() else 5) if self.arm.enabled else 4

    async def _report(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Feedback port: packets to each client until it leaves."""
        self._readers.append(writer)
        self._writers.append(writer)
        await reader.read()
        self._readers.remove(writer)
        writer.close()

    async def _feedback(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            due_s = max(due_s + self.period_s, loop.time())
            await asyncio.sleep(due_s - loop.time())
            if not self.frozen:
                packet = self._packet()
                for writer in self._readers:
                    writer.write(packet)

    def _packet(self) -> bytes:
        packet = np.zeros(1, FEEDBACK)
        packet["position"], packet["velocity"] = self.arm.measure()
        packet["size"], packet["test_value"] = FEEDBACK.itemsize, TEST_VALUE
        packet["inputs"], packet["outputs"] = self.arm.inputs, self.arm.outputs
        packet["enabled"], packet["error"] = self.arm.enabled, bool(self.arm.alarm)
        return packet.tobytes()

    async def _hurt(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Port for faults: one line each, ``trip 17``; answered by a line with a number."""
        while line := await reader.readline():
            name, *values = line.decode("ascii").split()
            answer = self._fault(name, [float(value) for value in values])
            writer.write(f"{0.0 if answer is None else float(answer)}\n".encode("ascii"))
        writer.close()

    def _fault(self, name: str, values: list[float]) -> float | None:
        """Cause one fault; the first value is a joint, a bit, or the only value."""
        arm, number, last = self.arm, int(values[0]) if values else 0, values[-1] if values else 0.0
        faults: dict[str, Callable[[], float | None]] = {
            "position": lambda: float(arm.state()[0][number]),
            "turn": lambda: arm.turn(number, last),
            "trip": lambda: arm.trip(number),
            "press": lambda: arm.press(bool(number)),
            "block": lambda: arm.block(number, bool(last)),
            "jump": lambda: arm.jump(number, last),
            "input": lambda: arm.input(number, bool(last)),
            "output": lambda: float(arm.outputs >> number & 1),
            "stick": lambda: arm.stick(number, None if last < 0.0 else bool(last)),
            "freeze": lambda: setattr(self, "frozen", bool(number)),
            "busy": (self.reads_targets.clear if number else self.reads_targets.set),
            "period": lambda: setattr(self, "period_s", last),
            "cut": self._cut,
        }
        return faults[name]()

    def _cut(self) -> None:
        """Cut all connections of the client, as a pulled cable does after its time-out."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()
