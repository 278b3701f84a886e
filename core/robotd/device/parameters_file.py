"""Parameter file of a device: when it is applied, and what is rejected."""

from __future__ import annotations

import threading
from pathlib import Path

from robotd.descriptor.files import is_file
from robotd.device.drivers import DeviceDriver
from robotd.errors import DescriptorError, OperationError, Unsupported
from robotd.log import get_logger

log = get_logger("connection")


class ParametersFile:
    """Loads parameters into a device. One thread at a time.

    Args:
        driver: the backend's device.
        path: applied once after each opening; None leaves the device's own parameters.
        backend: name used in error texts.
        has: the backend has parameter files.

    Attributes:
        path: as above.
        scaling_lock: held while the scale of axes may change.
    """

    def __init__(self, driver: DeviceDriver, path: Path | None, backend: str, *, has: bool) -> None:
        self.path = path
        self.scaling_lock = threading.Lock()
        self._driver = driver
        self._backend = backend
        self._has = has
        self._applied = False

    def require(self, path: Path | None = None) -> None:
        """Raise Unsupported without parameter files, OperationError when ``path`` is none."""
        if not self._has:
            raise Unsupported("parameter files", self._backend)
        if path is not None and not is_file(path):
            raise OperationError(f"parameter file {path} does not exist, or is no file")

    def check(self) -> None:
        """Raise DescriptorError when the file of the descriptor does not exist."""
        if self.path is not None and self._has and not is_file(self.path):
            raise DescriptorError("parameter file does not exist", path=self.path)

    def forget(self) -> None:
        """Note that the device was opened anew: the file has to be applied again."""
        self._applied = False

    @property
    def due(self) -> bool:
        """The file has to be applied before axes are commanded."""
        return self.path is not None and self._has and not self._applied

    def apply(self) -> None:
        """Load the descriptor's file, which is ``due``."""
        if self.path is not None:
            self.load(self.path)
            self._applied = True

    def load(self, path: Path) -> str:
        """Load a file, all of it or nothing; return the driver's note, may be ""."""
        with self.scaling_lock:
            note = self._driver.load_parameters(path) or ""  # None of a driver that has none
        if note:
            log.warning("parameters loaded", file=str(path), note=note)
        else:
            log.info("parameters loaded", file=str(path))
        return note
