"""Mutants: connection and parameters that go wrong only while another call runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import ConnectionState, NotReady
from robotd_sim import SimDevice, Simulation

THEME = "test_device_under_load.py::"
CONNECTING = f"{THEME}test_connecting_works_while_others_call"
RESUMED = f"{THEME}test_a_lost_link_is_resumed_while_others_call"
UNDONE = f"{THEME}test_a_start_is_undone_while_others_call"
IN_FORCE = f"{THEME}test_parameters_are_in_force_while_others_call"
LIVE = f"{THEME}test_a_live_axis_keeps_its_scale_while_others_call"
SCAN_S = 0.02


@contextmanager
def scanning(simulation: Simulation) -> Iterator[None]:
    """Note that a scan runs."""
    simulation.__dict__["scans"] = simulation.__dict__.get("scans", 0) + 1
    try:
        yield
    finally:
        simulation.__dict__["scans"] -= 1


class Scanned(SimDevice):
    """A device whose scans take a while."""

    @property
    def busy(self) -> bool:
        """True while another thread scans."""
        return bool(self.simulation.__dict__.get("scans"))

    def scan_network(self) -> str:
        with scanning(self.simulation):
            time.sleep(SCAN_S)
            return super().scan_network()


class OpensNothingDuringAScan(Mutant):
    breaks = ("DeviceDriver.open/connects", "ignored")
    found_by = CONNECTING
    says = "IDLE"

    class Device(Scanned):
        def open(self, path: str = "", name: str = "") -> None:
            if not self.busy:
                super().open(path, name)


class StartsLaterDuringAScan(Mutant):
    breaks = ("DeviceDriver.start_communication/starts", "late")
    found_by = CONNECTING
    says = "RUNNING after start_communication"

    class Device(Scanned):
        def start_communication(self, timeout_s: float) -> None:
            if not self.busy:
                super().start_communication(timeout_s)
                return
            world = self.simulation.world
            with world.lock:
                world.at(world.tick + 50, self.simulation.request_communication)


class StartEnablesDuringAScan(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "side effect")
    found_by = CONNECTING
    says = "are on"

    class Device(Scanned):
        def start_communication(self, timeout_s: float) -> None:
            busy = self.busy
            super().start_communication(timeout_s)
            if busy:
                with self.simulation.world.lock:
                    self.simulation.power.request(self.simulation.axes - 1, on=True)


class StopIgnoredDuringAScan(Mutant):
    breaks = ("DeviceDriver.stop_communication/ends", "ignored")
    found_by = CONNECTING
    says = "COMMUNICATING after stop_communication"
    only = "stop_communication"

    class Device(Scanned):
        def stop_communication(self, timeout_s: float) -> None:
            if not self.busy:
                super().stop_communication(timeout_s)


class StopLeavesServosOnDuringAScan(Mutant):
    breaks = ("DeviceDriver.stop_communication/axes-stop", "ignored")
    found_by = CONNECTING
    says = "are on|at rest"
    only = "stop_communication"

    class Device(Scanned):
        def stop_communication(self, timeout_s: float) -> None:
            if not self.busy:
                super().stop_communication(timeout_s)
                return
            with self.simulation.world.lock:
                self.simulation.world.advance()
                if self.simulation.communicating:
                    self.simulation.engine = ConnectionState.RUNNING


class CloseLeavesServosOnDuringAScan(Mutant):
    breaks = ("DeviceDriver.close/axes-stop", "ignored")
    found_by = CONNECTING
    says = "are on|at rest"
    only = "close"

    class Device(Scanned):
        def close(self) -> None:
            if not self.busy:
                super().close()
                return
            with self.simulation.world.lock:
                self.simulation.world.advance()
                self.simulation.engine = ConnectionState.IDLE


class CannotResumeDuringAScan(Mutant):
    breaks = ("DeviceDriver.start_communication/resumes", "ignored")
    found_by = RESUMED
    says = "RUNNING after a lost link"

    class Device(Scanned):
        def start_communication(self, timeout_s: float) -> None:
            if not (self.busy and self.simulation.lost_because):
                super().start_communication(timeout_s)


class UndoesNothingDuringAScan(Mutant):
    breaks = ("DeviceDriver.stop_communication/undoes", "late")
    found_by = UNDONE
    says = "COMMUNICATING after a start that was undone"

    class Device(Scanned):
        def stop_communication(self, timeout_s: float) -> None:
            if not self.busy or self.simulation.communicating:
                super().stop_communication(timeout_s)


class LoadsNothingDuringAScan(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "ignored")
    found_by = IN_FORCE
    says = "the file: the dumps"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            before, busy = self.simulation.parameters, self.busy
            note = super().load_parameters(path)
            if busy:
                with self.simulation.world.lock:
                    self.simulation.apply(before)
            return note


class ScanRestoresTheParameters(Mutant):
    """Those before a load that has come during the scan."""

    breaks = ("DeviceDriver.load_parameters/kept", "ignored")
    found_by = IN_FORCE
    says = "s later"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            before, busy = self.simulation.parameters, self.busy
            note = super().load_parameters(path)
            if busy:
                with self.simulation.world.lock:
                    world = self.simulation.world
                    world.at(world.tick + 60, lambda: self.simulation.apply(before))
            return note


class NoNoteDuringAScan(Mutant):
    breaks = ("DeviceDriver.load_parameters/note", "wrong value")
    found_by = IN_FORCE
    says = "no note"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            busy = self.busy
            note = super().load_parameters(path)
            return "" if busy else note


class OldScaleInDumpsDuringAScan(Mutant):
    breaks = ("DeviceDriver.dump_parameters/scale", "stale")
    found_by = IN_FORCE
    says = "polarity of the last axis"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            note = super().load_parameters(path)
            self.__dict__["loaded"] = [
                super(Scanned, self).dump_parameters(axis) for axis in range(self.simulation.axes)
            ]
            return note

        def dump_parameters(self, axis: int) -> str:
            loaded = self.__dict__.get("loaded")
            return str(loaded[axis]) if loaded and self.busy else super().dump_parameters(axis)


class RescalesLiveAxesDuringAScan(Mutant):
    breaks = ("DeviceDriver.load_parameters/live", "ignored")
    found_by = LIVE
    says = "DID NOT RAISE"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except NotReady:
                if self.busy:
                    return ""
                raise


class NamesNoAxisDuringAScan(Mutant):
    breaks = ("DeviceDriver.load_parameters/named", "wrong value")
    found_by = LIVE
    says = "does not match|did not match"

    class Device(Scanned):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except NotReady as error:
                raise (NotReady("a servo is on") if self.busy else error) from error
