"""Mutants: The process around the backend."""

from __future__ import annotations

import gc
import locale
import logging
import os
import signal
import subprocess
import sys
import threading

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    NotReady,
)
from robotd_sim import SimAxes, SimDevice, Simulation


class LeakedThread(Mutant):
    breaks = ("DeviceDriver.open/connects", "leaks")
    found_by = "test_leaks.py::test_no_thread_is_left"
    says = "forgotten"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            ended = threading.Event()
            threading.Thread(target=ended.wait, args=(20.0,), name="forgotten", daemon=True).start()


class LeakedHandle(Mutant):
    breaks = ("DeviceDriver.open/connects", "leaks")
    found_by = "test_leaks.py::test_no_handle_is_left"
    says = "/dev/null"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.open(os.devnull, os.O_RDONLY)


class TakesSignals(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGUSR1, signal.SIG_IGN)

    class Axes(SimAxes):
        def __init__(self, simulation: object) -> None:
            super().__init__(simulation)  # type: ignore[arg-type]
            os.umask(0o027)


class ChangesTheFolder(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.chdir("/")


class ChangesTheLocale(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            locale.setlocale(locale.LC_ALL, "C.UTF-8")
            locale.setlocale(locale.LC_NUMERIC, "POSIX")


class Prints(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.write(1, b"vendor library 4.2 ready\n")


class ChangesTheEnvironment(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.environ["OMP_NUM_THREADS"] = "1"


class ProcessLeft(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "leaks")
    found_by = "test_leaks.py::test_no_process_is_left"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            subprocess.Popen(["sleep", "20"])


class ForkEndsTheCommunication(Mutant):
    breaks = ("backend/fork", "side effect")
    found_by = "test_process.py::test_a_forked_process_does_not_disturb_the_device"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            os.register_at_fork(after_in_parent=self._forked)

        def _forked(self) -> None:
            with self.simulation.world.lock:
                self.simulation.silence()


class ThreadFromTheStart(Mutant):
    """The thread that opens the device is started when the device is made."""

    breaks = ("backend/fork", "side effect")
    found_by = "test_process.py::test_a_device_can_be_opened_after_a_fork"

    class Device(SimDevice):
        def __init__(self, simulation: Simulation) -> None:
            super().__init__(simulation)
            self.wanted, self.opened = threading.Event(), threading.Event()
            threading.Thread(target=self._serve, daemon=True).start()

        def _serve(self) -> None:
            self.wanted.wait()
            self.opened.set()

        def open(self, path: str = "", name: str = "") -> None:
            self.wanted.set()
            if not self.opened.wait(1.0):
                raise NotReady("the connection thread does not answer")
            super().open(path, name)


class HandlesForPrograms(Mutant):
    breaks = ("backend/process", "leaks")
    found_by = "test_process.py::test_programs_inherit_no_handle"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            self.handle = os.open("/dev/zero", os.O_RDONLY)
            os.set_inheritable(self.handle, True)

        def close(self) -> None:
            super().close()
            if "handle" in self.__dict__:
                os.close(self.__dict__.pop("handle"))


class SwitchesThreadsSeldom(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            sys.setswitchinterval(0.5)


class StopsTheGarbageCollector(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            gc.disable()


class RaisesOnNan(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = ""  # NumPy keeps these settings for each thread: a guard thread changes its own

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            np.seterr(all="raise")


class ConfiguresTheLog(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            logging.getLogger().setLevel(logging.CRITICAL)


class TakesTheExceptionHook(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            sys.excepthook = lambda *_: None
