"""The backend dobot and a stand-in of the controller that it starts, for the conformance kit."""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import robotd_dobot
from robotd.api import (
    BackendInfo,
    Capability,
    Clock,
    ConnectError,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    hookimpl,
)
from robotd_dobot import DobotDevice, DobotOptions, robotd_axes, robotd_io, robotd_payload

# Hooks of dobot: these are the drivers to be tested.
__all__ = ["robotd_axes", "robotd_io", "robotd_payload"]

ROOT = Path(__file__).parents[3]
END_S = 2.0
TOOL_BYTE = 2


class StandInOptions(DobotOptions):
    """As ``backends.dobot``; the ports are chosen when the stand-in is started."""

    address: str = "127.0.0.1"
    generation: str = "v4"
    max_target_age_s: float = 0.5  # it shares the processor with everything


class StandInDevice(DobotDevice):
    """Starts the stand-in when it is opened, and ends it when it is closed."""

    def __init__(self, options: StandInOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        self.generation = options.generation
        self.process: subprocess.Popen[str] | None = None
        self.fault_port = 0

    def open(self, path: str = "", name: str = "") -> None:
        if self.process is None or self.process.poll() is not None:
            self._start()
        super().open(path, name)

    def close(self) -> None:
        super().close()
        self._end()

    def _end(self) -> None:
        process, self.process = self.process, None
        if process is not None:
            try:
                process.communicate(timeout=END_S)  # the end of its input ends it
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()

    def _start(self) -> None:
        self._end()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.plugins.dobot.serve", self.generation, *["0"] * 4],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for robotd, which stops the arm first
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        line = self.process.stdout.readline() if self.process.stdout else ""
        if not line:
            raise ConnectError("the stand-in ended", {"dobot_stand_in": "no ports"})
        command, motion, feedback, self.fault_port = map(int, line.split())
        self.options = self.options.model_copy(
            update={"command_port": command, "motion_port": motion, "feedback_port": feedback}
        )


class StandInFaults(FaultInjector):
    """Faults by a port of the stand-in.

    Attributes:
        device: with the stand-in's process.
    """

    def __init__(self, device: StandInDevice) -> None:
        self.device = device

    def send(self, name: str, *values: float) -> float:
        """Send one fault and return the number that is answered."""
        with socket.create_connection(("127.0.0.1", self.device.fault_port), END_S) as link:
            link.sendall(" ".join([name, *map(str, map(float, values))]).encode("ascii") + b"\n")
            return float(link.makefile().readline())

    def position(self, axis: int) -> float:
        return math.radians(self.send("position", axis))

    def move_by_hand(self, axis: int, delta: float) -> None:
        self.send("turn", axis, math.degrees(delta))

    def trip(self, axis: int, code: int) -> None:
        self.send("trip", code)

    def freeze(self, frozen: bool) -> None:
        self.send("freeze", frozen)

    def block(self, axis: int, blocked: bool) -> None:
        self.send("block", axis, blocked)

    def jump_encoder(self, axis: int, delta: float) -> None:
        self.send("jump", axis, math.degrees(delta))

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        if byte == TOOL_BYTE:
            self.send("tool_input", bit, value)
        else:
            self.send("input", 8 * byte + bit, value)

    def output_bit(self, byte: int, bit: int) -> bool:
        if byte == TOOL_BYTE:
            return bool(self.send("tool_output", bit))
        return bool(self.send("output", 8 * byte + bit))

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        self.send("stick", 8 * byte + bit, -1.0 if value is None else value)

    def drop_communication(self) -> None:
        self.send("cut")

    def stop_engine(self) -> None:
        if self.device.process is not None:
            with suppress(ProcessLookupError):
                self.device.process.kill()
            self.device.process.wait(END_S)


@hookimpl
def robotd_backend() -> BackendInfo:
    info: BackendInfo = robotd_dobot.robotd_backend()
    return replace(
        info,
        summary="dobot on a stand-in of its controller, for tests",
        capabilities=info.capabilities | {Capability.SIMULATED},
        options=StandInOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[StandInOptions]) -> DeviceDriver:
    return StandInDevice(context.options, context.clock)


@hookimpl
def robotd_fault_injector(device: StandInDevice) -> FaultInjector:
    return StandInFaults(device)
