"""Server of the stand-in: commands, targets, feedback, and a port for faults."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from tests.plugins.dobot.arm import JOINTS, Arm
from tests.plugins.dobot.packet import PACKET, TEST_VALUE

COMMAND = re.compile(r"\s*(\w+)\(([^()]*)\)")
PERIOD_S = 0.008
CR3A, CR3A_KG = 113, 3.0
UNKNOWN, WRONG_COUNT, WRONG_TYPE, WRONG_RANGE = -10000, -20000, -50001, -60001
PARAMETER_RANGE = -40001  # of the first one, as V4 has it
NOT_TCP = "Control Mode Is Not Tcp\t"
SHORTEST_S = {"v3": 0.02, "v4": 0.004}
TOOL_TERMINALS = 2  # of a CR, whose flange has one connector
LAST_FRAME = {"v3": 9, "v4": 50}
Answer = tuple[int, str]


class Controller:
    """Speaks the protocol of a generation for one ``Arm``.

    Attributes:
        generation: ``v3`` or ``v4``.
        ports: of commands, motion (V3), feedback and faults.
        in_tcp_mode: commands are obeyed; else only ``RequestControl`` is.
        answers_targets: V3: targets get a reply, as the maker's later clients expect.
        mode: number of a mode that is reported whatever the arm does; 0: the arm's.
        frozen: no feedback is sent, and no connection is closed.
        spoiled: the positions of the feedback are nonsense.
        reads_targets: clear while no target is read; those that come wait.
        period_s: between two packets.
        targets: number of targets that were executed.
        last_frame: index of the last tool and user frame that exists.
    """

    def __init__(self, arm: Arm, generation: str = "v4") -> None:
        self.arm, self.generation = arm, generation
        self.ports = [0, 0, 0, 0]
        self.in_tcp_mode, self.answers_targets, self.mode = True, True, 0
        self.frozen, self.spoiled, self.period_s, self.targets = False, False, PERIOD_S, 0
        self.last_frame = LAST_FRAME[generation]
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
        if self.generation == "v4":
            servers[1].close()  # it has no such port
        sys.stdout.write(" ".join(map(str, self.ports)) + "\n")
        sys.stdout.flush()
        parent = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        feedback = asyncio.create_task(self._feedback())
        await parent
        feedback.cancel()

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Commands, each with a reply; of V4 also the targets."""
        self._writers.append(writer)
        text = ""
        with suppress(ConnectionError):  # of a client that discards its targets
            while part := await reader.read(4096):
                text = self.obey(text + part.decode("ascii", "replace"), writer)
                if self.generation == "v4":
                    await self.reads_targets.wait()
        writer.close()

    async def _move(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Motion port of V3: targets."""
        self._writers.append(writer)
        text = ""
        with suppress(ConnectionError):
            while part := await reader.read(4096):
                answered = writer if self.answers_targets else None
                text = self.obey(text + part.decode("ascii", "replace"), answered, motion=True)
                await self.reads_targets.wait()
        writer.close()

    def obey(self, text: str, writer: asyncio.StreamWriter | None, *, motion: bool = False) -> str:
        """Obey the whole commands of ``text``, and return the rest."""
        while found := COMMAND.match(text):
            text = text[found.end() :]
            answer = self._answer(found[1], found[2], motion=motion)
            if writer is not None:
                writer.write(answer.encode("ascii"))
        return text

    def _answer(self, name: str, values: str, *, motion: bool) -> str:
        key = name.lower()
        if not self.in_tcp_mode and key != "requestcontrol":
            return NOT_TCP
        actions = self._actions(values)
        # V3 takes targets on its motion port and nowhere else, and nothing else there.
        known = key in actions and (self.generation == "v4" or (key == "servoj") is motion)
        try:
            code, value = actions[key]() if known else (UNKNOWN, "")
        except ValueError:
            code, value = WRONG_TYPE, ""
        return f"{code},{{{value}}},{name}({values});"

    def _actions(self, values: str) -> dict[str, Callable[[], Answer]]:
        arm = self.arm
        numbers = [word.strip() for word in values.split(",")] if values.strip() else []
        of_both: dict[str, Callable[[], Answer]] = {
            "poweron": lambda: (arm.power(True), ""),
            "enablerobot": lambda: self._enable(numbers),
            "disablerobot": lambda: (arm.switch(False), ""),
            "clearerror": lambda: (arm.clear(), ""),
            "speedfactor": lambda: (0 if 0 < int(values) <= 100 else WRONG_RANGE, ""),
            "robotmode": lambda: (0, str(self.robot_mode())),
            "geterrorid": lambda: (0, self._errors()),
            "startdrag": lambda: (arm.drag(True), ""),
            "stopdrag": lambda: (arm.drag(False), ""),
            "toolai": lambda: (0, "0.0"),  # noise: the terminals are RS-485 until SetToolMode
            "tooldi": lambda: self._tool_level(arm.tool_inputs, *map(int, numbers)),
            "tool": lambda: self._select("tool", int(values)),
            "user": lambda: self._select("user", int(values)),
            "servoj": lambda: (self._servo(numbers), str(self.targets)),
        }
        own: dict[str, Callable[[], Answer]] = {
            "emergencystop": lambda: (arm.press(True), ""),
            "resetrobot": self._stop,
            "doexecute": lambda: self._output(*map(int, numbers)),
            "tooldoexecute": lambda: self._tool_output(*map(int, numbers)),
        }
        if self.generation == "v4":
            own = {
                "requestcontrol": self._take_control,
                "getcurrentcommandid": lambda: (0, str(self.targets)),
                "emergencystop": lambda: (arm.press(bool(int(values))), ""),
                "stop": self._stop,
                "doinstant": lambda: self._output(*map(int, numbers)),
                "tooldoinstant": lambda: self._tool_output(*map(int, numbers)),
                "gettooldo": lambda: self._tool_level(arm.tool_outputs, *map(int, numbers)),
                "setpayload": lambda: self._payload(numbers),
                "getangle": lambda: (0, ",".join(f"{angle:.4f}" for angle in arm.state()[0])),
            }
        return of_both | own

    def _stop(self) -> Answer:
        self.arm.hold()
        return 0, ""

    def _take_control(self) -> Answer:
        """Change to TCP mode, which the guide allows to an arm that is off."""
        if self.arm.enabled:
            return -1, ""
        self.in_tcp_mode = True
        return 0, ""

    def _enable(self, numbers: list[str]) -> Answer:
        if len(numbers) not in ((0, 1, 4) if self.generation == "v3" else (0, 1, 4, 5)):
            return WRONG_COUNT, ""
        code = self.arm.switch(True)
        if numbers and not code:
            return self._payload(numbers[:4])
        return code, ""

    def _payload(self, numbers: list[str]) -> Answer:
        if len(numbers) not in (1, 4):
            return WRONG_COUNT, ""
        values = [float(number) for number in numbers]
        if not 0.0 <= values[0] <= CR3A_KG:
            return PARAMETER_RANGE, ""
        self.arm.payload = (values[0], *(values[1:] or (0.0, 0.0, 0.0)))
        return 0, ""

    def _errors(self) -> str:
        lists = [[self.arm.alarm] if self.arm.alarm else [], *([] for _ in range(JOINTS))]
        joint, code = self.arm.drive_alarm
        if joint:
            lists[joint] = [code]
        return str(lists)

    def _output(self, terminal: int, level: int) -> Answer:
        if not 1 <= terminal <= 16:
            return WRONG_RANGE, ""
        self.arm.output(terminal - 1, bool(level))
        return 0, ""

    def _tool_output(self, terminal: int, level: int) -> Answer:
        if not 1 <= terminal <= TOOL_TERMINALS:
            return PARAMETER_RANGE, ""
        if not self.arm.rejection:
            self.arm.tool_output(terminal - 1, bool(level))
        return self.arm.rejection, ""

    def _tool_level(self, levels: int, terminal: int) -> Answer:
        if not 1 <= terminal <= TOOL_TERMINALS:
            return PARAMETER_RANGE, ""
        return self.arm.rejection, "" if self.arm.rejection else str(levels >> terminal - 1 & 1)

    def _select(self, kind: str, index: int) -> Answer:
        """Select a frame; of one that does not exist V3 only says that it failed."""
        if not 0 <= index <= self.last_frame:
            return (-1 if self.generation == "v3" else PARAMETER_RANGE), ""
        if not self.arm.rejection:
            self.arm.frames[kind] = index
        return self.arm.rejection, ""

    def _servo(self, words: list[str]) -> int:
        """Execute ``ServoJ``: V4 has its options by name, V3 in their order."""
        if len(words) < JOINTS:
            return WRONG_COUNT
        options = words[JOINTS:]
        if self.generation == "v4":
            if any("=" not in word for word in options):
                return WRONG_TYPE
            named = dict(word.split("=") for word in options)
        else:
            named = dict(zip(("t", "aheadtime", "gain"), options, strict=False))
        time_s = float(named.get("t", "0.1"))
        ahead, gain = float(named.get("aheadtime", "50")), float(named.get("gain", "500"))
        if time_s < SHORTEST_S[self.generation]:
            return WRONG_RANGE
        if not (20 <= ahead <= 100 and 200 <= gain <= 1000):
            return WRONG_RANGE - 1
        code = self.arm.servo(np.array([float(word) for word in words[:JOINTS]]), time_s)
        self.targets += not code
        return code

    def robot_mode(self) -> int:
        """Return the mode that is reported."""
        arm = self.arm
        if self.mode or arm.in_alarm:
            return self.mode or 9
        if not arm.powered:
            return 3
        if not arm.enabled:
            return 4
        return 6 if arm.dragged else 7 if arm.moves else 5

    async def _report(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Feedback port: packets to each client until it leaves."""
        self._readers.append(writer)
        self._writers.append(writer)
        with suppress(ConnectionError):
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
                packet = self.packet()
                for writer in self._readers:
                    writer.write(packet)

    def packet(self) -> bytes:
        """Return the feedback of now."""
        arm, packet = self.arm, np.zeros(1, PACKET)
        packet["q_actual"], packet["qd_actual"] = arm.measure()
        if self.spoiled:
            packet["q_actual"] = 1e300
        packet["length"], packet["test_value"] = PACKET.itemsize, TEST_VALUE
        packet["digital_inputs"], packet["digital_outputs"] = arm.inputs, arm.outputs
        packet["robot_mode"], packet["robot_type"] = self.robot_mode(), CR3A
        packet["enable_status"], packet["error_status"] = arm.enabled, arm.in_alarm
        packet["tool_index"], packet["user_index"] = arm.frames["tool"], arm.frames["user"]
        packet["drag_status"], packet["speed_scaling"] = arm.dragged, 100.0
        packet["load"], packet["load_center"] = arm.payload[0], arm.payload[1:]
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
            "payload": lambda: arm.payload[number],
            "targets": lambda: self.targets,
            "turn": lambda: arm.turn(number, last),
            "trip": lambda: arm.trip(number),
            "trip_drive": lambda: arm.trip(int(last), number),
            "press": lambda: arm.press(bool(number)),
            "power": lambda: arm.power(bool(number)),
            "drag": lambda: arm.drag(bool(number)),
            "mode": lambda: setattr(self, "mode", number),
            "tcp": lambda: setattr(self, "in_tcp_mode", bool(number)),
            "answers": lambda: setattr(self, "answers_targets", bool(number)),
            "block": lambda: arm.block(number, bool(last)),
            "jump": lambda: arm.jump(number, last),
            "input": lambda: arm.input(number, bool(last)),
            "output": lambda: float(arm.outputs >> number & 1),
            "tool_input": lambda: arm.tool_input(number, bool(last)),
            "tool_output": lambda: float(arm.tool_outputs >> number & 1),
            "tool_frame": lambda: arm.frames["tool"],
            "user_frame": lambda: arm.frames["user"],
            "select_tool": lambda: arm.frames.update(tool=number),
            "last_frame": lambda: setattr(self, "last_frame", number),
            "stick": lambda: arm.stick(number, None if last < 0.0 else bool(last)),
            "freeze": lambda: setattr(self, "frozen", bool(number)),
            "spoil": lambda: setattr(self, "spoiled", bool(number)),
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
