"""Run the independent drive in a thread or process; change its knobs and read what it measured."""

from __future__ import annotations

import argparse
import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, Self

import can
from tests.plugins.independent.cia402_node import ServoDrive
from tests.plugins.independent.knobs import Knobs

ROOT = Path(__file__).parents[3]
POLL_S = 1e-3

Request = tuple[dict[str, Any], Callable[[dict[str, Any]], None]]


def serve(bus: can.BusABC, node: ServoDrive, requests: queue.Queue[Request]) -> None:
    """Let a drive live on a bus until a request says ``{"do": "end"}``."""
    began = time.monotonic()
    twin: ServoDrive | None = None
    while True:
        message = bus.recv(POLL_S)
        now = time.monotonic() - began
        if node.knobs.duplicate_delay_s and twin is None:
            twin = duplicate(node)
        for drive in (node, twin) if twin else (node,):
            if message is not None and not (message.is_error_frame or drive.knobs.deaf):
                drive.receive(message, now)
            drive.tick(now)
        with suppress(queue.Empty):
            request, reply = requests.get_nowait()
            if "power_on" in request:
                node, twin = (
                    ServoDrive(node.node_id, node.to_bus, knobs_of(request["power_on"])),
                    None,
                )
                node.now = now
                node.restart()
            reply(answer(node, request))
            if request.get("do") == "end":
                return


def duplicate(node: ServoDrive) -> ServoDrive:
    """Return another drive with the same node id, which answers late."""
    late = replace(node.knobs, sdo_delay_s=node.knobs.duplicate_delay_s, power_on_position=-5)
    twin = ServoDrive(node.node_id, node.to_bus, late)
    twin.now = node.now
    twin.restart()
    return twin


def knobs_of(values: dict[str, Any]) -> Knobs:
    knobs = Knobs()
    for name, value in values.items():
        turn_knob(knobs, name, value)
    return knobs


def turn_knob(knobs: Knobs, name: str, value: Any) -> None:
    if name not in {item.name for item in fields(knobs)}:
        raise AttributeError(f"the drive has no knob {name}")
    setattr(knobs, name, tuple(value) if isinstance(value, list) else value)


def answer(node: ServoDrive, request: dict[str, Any]) -> dict[str, Any]:
    """Change knobs (``set``), execute an action (``do``) and return the measurements."""
    for name, value in request.get("set", {}).items():
        turn_knob(node.knobs, name, value)
    actions: dict[str, Callable[[], None]] = {
        "restart": node.restart,
        "stop": node.stop,
        "pre_operational": node.drop_to_pre_operational,
        "clear": node.clear,
        "fault": lambda: node.fault(request["code"]),
        "emergency": lambda: node.emergency(request["code"], 0x20),
        "end": lambda: None,
    }
    if "do" in request:
        actions[request["do"]]()
    return node.measurements()


class RunningNode:
    """Drive that runs elsewhere; each call executes between two of its frames."""

    def ask(self, **request: Any) -> dict[str, Any]:
        raise NotImplementedError

    def set(self, **knobs: Any) -> None:
        self.ask(set=knobs)

    def do(self, action: str, **values: Any) -> None:
        self.ask(do=action, **values)

    def __getitem__(self, name: str) -> Any:
        return self.ask()[name]

    def wait(self, holds: Callable[[dict[str, Any]], bool], timeout_s: float = 60.0) -> None:
        """Wait until the measurements fulfil a condition; raises TimeoutError with them."""
        deadline = time.monotonic() + timeout_s
        while not holds(measured := self.ask()):
            if time.monotonic() > deadline:
                raise TimeoutError(f"after {timeout_s} s: {measured}")
            time.sleep(0.01)

    def power_on(self, knobs: Knobs) -> None:
        """Replace the drive by another one with the same node id."""
        self.ask(power_on=asdict(knobs))
        self.wait_for_boot()

    def wait_for_boot(self) -> None:
        self.wait(lambda measured: "boots" in measured["counts"])

    def close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class ThreadedNode(RunningNode):
    """Drive in a thread, on a bus of this process."""

    def __init__(self, bus: can.BusABC, node_id: int, knobs: Knobs | None = None) -> None:
        self._bus = bus
        self._requests: queue.Queue[Request] = queue.Queue()
        self.drive = ServoDrive(node_id, bus.send, knobs)
        self._thread = threading.Thread(target=serve, args=(bus, self.drive, self._requests))
        self._thread.start()
        self.wait_for_boot()

    def ask(self, **request: Any) -> dict[str, Any]:
        replies: queue.Queue[dict[str, Any]] = queue.Queue()
        self._requests.put((request, replies.put))
        return replies.get(timeout=10)

    def close(self) -> None:
        self.do("end")
        self._thread.join(10)
        self._bus.shutdown()


class NodeProcess(RunningNode):
    """Drive in a process of its own, on a bus between processes."""

    def __init__(self, channel: str, node_id: int, knobs: Knobs | None = None, **bus: Any) -> None:
        command = [sys.executable, "-m", "tests.plugins.independent.cia402_node"]
        command += ["--channel", channel, "--node", str(node_id)]
        for name, value in bus.items():
            command += [f"--{name}", str(value)]
        for name, value in asdict(knobs or Knobs()).items():
            command += ["--knob", f"{name}={json.dumps(value)}"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
        self.wait_for_boot()

    def ask(self, **request: Any) -> dict[str, Any]:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        measured: dict[str, Any] = json.loads(self._process.stdout.readline())
        return measured

    def close(self) -> None:
        with suppress(BrokenPipeError, json.JSONDecodeError):
            self.do("end")
        self._process.wait(10)
        for stream in (self._process.stdin, self._process.stdout):
            if stream:
                stream.close()


def main() -> None:
    """Run a drive as a process; it ends with its standard input."""
    parser = argparse.ArgumentParser(description="Independent CiA 402 drive for tests.")
    parser.add_argument("--interface", default="udp_multicast")
    parser.add_argument("--channel", required=True)
    parser.add_argument("--port", type=int)
    parser.add_argument("--node", type=int, default=5)
    parser.add_argument("--knob", action="append", default=[], metavar="NAME=JSON")
    parser.add_argument("--eds", action="store_true", help="print the EDS and exit")
    options = parser.parse_args()
    pairs = (knob.split("=", 1) for knob in options.knob)
    knobs = knobs_of({name: json.loads(value) for name, value in pairs})
    if options.eds:
        sys.stdout.write(ServoDrive(options.node, lambda _: None, knobs).eds(options.node))
        return
    settings: dict[str, Any] = {"port": options.port} if options.port else {}
    if options.interface == "udp_multicast":
        settings["hop_limit"] = 0
    requests: queue.Queue[Request] = queue.Queue()
    threading.Thread(target=read_requests, args=(requests,), daemon=True).start()
    with can.Bus(interface=options.interface, channel=options.channel, **settings) as bus:
        serve(bus, ServoDrive(options.node, bus.send, knobs), requests)


def read_requests(requests: queue.Queue[Request]) -> None:
    def reply(answer: dict[str, Any]) -> None:
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()

    for line in sys.stdin:
        requests.put((json.loads(line), reply))
    requests.put(({"do": "end"}, lambda _: None))
