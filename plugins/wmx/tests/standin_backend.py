"""The WMX backend with the stand-in as its test bench: backend ``wmx_standin`` of the tests."""

from __future__ import annotations

from dataclasses import replace

from robotd.api import BackendInfo, Capability, FaultInjector, hookimpl
from robotd_wmx import plugin
from robotd_wmx.plugin import robotd_axes, robotd_fieldbus, robotd_io, robotd_open_device
from standin_port import port

__all__ = ["robotd_axes", "robotd_fieldbus", "robotd_io", "robotd_open_device"]


class StandinBench(FaultInjector):
    """The outside world of the stand-in's engine, by its fault port."""

    def position(self, axis: int) -> float:
        line = next(line for line in port("show").splitlines() if line.startswith(f"axis {axis} "))
        words = line.split()
        return float(words[words.index("position") + 1])

    def move_by_hand(self, axis: int, delta: float) -> None:
        port("turn", axis, round(delta * 1e6))

    def trip(self, axis: int, code: int) -> None:
        port("amp_alarm", axis, code)

    def disconnect(self, axis: int) -> None:
        port("slave_lost", axis)

    def reconnect(self, axis: int) -> None:
        port("slave_back", axis)

    def freeze(self, frozen: bool) -> None:
        port("freeze", int(frozen))

    def block(self, axis: int, blocked: bool) -> None:
        port("stuck", axis, int(blocked))

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        port("input_bit" if value else "no_input_bit", byte, bit)

    def output_bit(self, byte: int, bit: int) -> bool:
        return bool(int(port("output", byte)) >> bit & 1)


@hookimpl
def robotd_backend() -> BackendInfo:
    info = plugin.robotd_backend()
    return replace(info, capabilities=info.capabilities | {Capability.SIMULATED})


@hookimpl
def robotd_fault_injector() -> FaultInjector:
    """A bench in order, whatever was broken on the one before."""
    port("mend")
    return StandinBench()
