"""Digital I/O with every address checked."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping

from robotd.descriptor import IoAddress, RobotDescriptor
from robotd.device.connection import Connection
from robotd.device.drivers import IoDriver
from robotd.errors import DescriptorError, InvalidArgument, Unsupported, unknown_name
from robotd.events import EventLog, logged_command


class Io:
    """The I/O image of the device; any thread may call, nothing blocks.

    Args:
        driver: the backend's driver; None answers every call with ``Unsupported``.
        events: where commands are recorded; None: in a log of its own.

    Attributes:
        inputs, outputs: addresses of the named bits.
    """

    def __init__(
        self,
        driver: IoDriver | None,
        connection: Connection,
        backend: str,
        events: EventLog | None = None,
        inputs: Mapping[str, IoAddress] | None = None,
        outputs: Mapping[str, IoAddress] | None = None,
    ) -> None:
        self.inputs, self.outputs = dict(inputs or {}), dict(outputs or {})
        self.events = events or EventLog(time.monotonic_ns)
        self._maybe_driver = driver
        self._connection = connection
        self.backend = backend

    @property
    def sizes(self) -> tuple[int, int]:
        """Bytes of inputs and of outputs; 0 without digital I/O."""
        driver = self._maybe_driver
        return (driver.input_bytes, driver.output_bytes) if driver else (0, 0)

    @property
    def live(self) -> tuple[memoryview, memoryview] | None:
        """Images that are updated in place; None where the backend has none."""
        return self._maybe_driver.live if self._maybe_driver else None

    def input(self, name: str) -> bool:
        """Return a named input. Raises InvalidArgument for an unknown name."""
        return self.input_bit(*_address("input", name, self.inputs))

    def output(self, name: str) -> bool:
        """Return a named output as commanded. Raises InvalidArgument for an unknown name."""
        return self.output_bit(*_address("output", name, self.outputs))

    def set_output(self, name: str, value: bool) -> None:
        """Set a named output. Raises InvalidArgument for an unknown name."""
        self.set_output_bit(*_address("output", name, self.outputs), value)

    def input_bit(self, byte: int, bit: int) -> bool:
        _check_bit(bit)
        return bool(self.input_bytes(byte, 1)[0] >> bit & 1)

    def output_bit(self, byte: int, bit: int) -> bool:
        _check_bit(bit)
        return bool(self.output_bytes(byte, 1)[0] >> bit & 1)

    def input_bytes(self, byte: int, length: int) -> bytes:
        return self._driver("input", byte, length).read_inputs(byte, length)

    def output_bytes(self, byte: int, length: int) -> bytes:
        return self._driver("output", byte, length).read_outputs(byte, length)

    @logged_command
    def set_output_bit(self, byte: int, bit: int, value: bool) -> None:
        _check_bit(bit)
        self._driver("output", byte, 1).write_output_bit(byte, bit, value)

    @logged_command
    def set_output_bytes(self, byte: int, data: bytes) -> None:
        self._driver("output", byte, len(data)).write_outputs(byte, data)

    def output_watcher(self, byte: int, bit: int) -> Callable[[], bool]:
        """Return a reader of one output bit, without checks, for the control loop."""
        driver, mask = self._watched("output", byte, bit)
        return lambda: bool(driver.read_outputs(byte, 1)[0] & mask)

    def input_watcher(self, byte: int, bit: int) -> Callable[[], bool]:
        """Return a reader of one input bit, without checks; its value counts while ready."""
        driver, mask = self._watched("input", byte, bit)
        return lambda: bool(driver.read_inputs(byte, 1)[0] & mask)

    def _driver(self, image: str, byte: int, length: int) -> IoDriver:
        """Return the driver when the device is ready and has these bytes."""
        driver = self._existing("digital I/O")
        self._connection.require_ready()
        _check_range(image, byte, length, driver)
        return driver

    def _watched(self, image: str, byte: int, bit: int) -> tuple[IoDriver, int]:
        """Return the driver, and the mask of a bit that exists."""
        driver = self._existing(f"digital {image}s")
        _check_bit(bit)
        _check_range(image, byte, 1, driver)
        return driver, 1 << bit

    def _existing(self, feature: str) -> IoDriver:
        if self._maybe_driver is None:
            raise Unsupported(feature, self.backend)
        return self._maybe_driver


def check_names(descriptor: RobotDescriptor, io: Io) -> None:
    """Raise DescriptorError for every named bit that the device does not have."""
    if problems := [*_missing(descriptor, io)]:
        raise DescriptorError.join(problems)


def _missing(descriptor: RobotDescriptor, io: Io) -> Iterator[DescriptorError]:
    for key, names, size in zip(
        ("inputs", "outputs"), (io.inputs, io.outputs), io.sizes, strict=True
    ):
        for name, address in names.items():
            if address.byte >= size:
                last = f"the last byte is {size - 1}" if size else f"the device has no {key}"
                what = f"{address} is outside the image of {key}: {last}"
                yield descriptor.problem(f"{key}.{name}", what)


def _address(kind: str, name: str, known: Mapping[str, IoAddress]) -> IoAddress:
    if name not in known:
        raise InvalidArgument(unknown_name(kind, name, known))
    return known[name]


def _check_bit(bit: int) -> None:
    if not 0 <= bit <= 7:
        raise InvalidArgument(f"bit {bit} is outside 0..7")


def _check_range(image: str, byte: int, length: int, driver: IoDriver) -> None:
    size = driver.input_bytes if image == "input" else driver.output_bytes
    if length < 1:
        raise InvalidArgument(f"length {length} is less than 1")
    if byte < 0 or byte + length > size:
        last = byte + length - 1
        raise InvalidArgument(f"{image} bytes {byte}..{last} are outside 0..{size - 1}")
