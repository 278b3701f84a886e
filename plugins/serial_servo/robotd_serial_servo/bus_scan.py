"""Scan of a serial bus: which servos answer, what they are, what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from robotd.api import ConnectError, InvalidArgument, MonotonicClock
from robotd_serial_servo.device import SLOW_REPLY_S, OpenBus, open_port
from robotd_serial_servo.serial_port import PortLost
from robotd_serial_servo.servo_bus import BusError, ServoBus, ServoIdentity

REPLY_TIMEOUT_S = 0.012
BAUDRATE = 1_000_000
LAST_ID = 252
MIDDLE = 2048


@dataclass(frozen=True)
class FoundServo:
    """One servo that answered.

    Attributes:
        remark: what is wrong with it; "": nothing.
    """

    identity: ServoIdentity
    position: int
    voltage_v: float
    temperature_c: float
    error: int
    remark: str = ""

    @property
    def name(self) -> str:
        """Name of the model, or its number."""
        return self.identity.model_name or f"model {self.identity.model}"

    def __str__(self) -> str:
        found = self.identity
        remark = f"; {self.remark}" if self.remark else ""
        return (
            f"servo {found.number:3}: {self.name}, firmware {found.firmware}, position"
            f" {self.position}, {self.voltage_v:.1f} V, {self.temperature_c:.0f} °C{remark}"
        )


@contextmanager
def opened(
    open_bus: OpenBus, port: str, baudrate: int, reply_timeout_s: float | None = None
) -> Iterator[ServoBus]:
    """Yield a bus on a port of its own. Raises ConnectError, also where it is lost meanwhile."""
    bus = open_bus(open_port(port, baudrate), MonotonicClock(), reply_timeout_s or REPLY_TIMEOUT_S)
    try:
        yield bus
    except PortLost as error:
        raise ConnectError("the port was lost", {port: str(error)}) from error
    finally:
        bus.close()


def scan_servos(bus: ServoBus, ids: Sequence[int] = ()) -> list[FoundServo]:
    """Ask ``ids``, all without any, and read those that answer. Nothing is written."""
    return [_ask(bus, servo) for servo in ids or range(LAST_ID + 1) if bus.ping(servo)]


def scan_sections(
    backend: str, servos: Sequence[FoundServo], port: str, baudrate: int
) -> dict[str, Any]:
    """Return a scan in the form that ``robotd new-robot --bus`` reads."""
    rate = {} if baudrate == BAUDRATE else {"baudrate": baudrate}
    return {
        "backend": backend,
        "scale": "zero_tick",
        "options": {"port": port} | rate,
        "axes": [
            {
                "servo": servo.identity.number,
                **({"model": servo.identity.model_name} if servo.identity.model_name else {}),
                "zero_tick": MIDDLE,
                **({"remark": servo.remark} if servo.remark else {}),
            }
            for servo in servos
        ],
        "servos": [
            {
                "servo": servo.identity.number,
                "model": servo.identity.model,
                "name": servo.name,
                "firmware": servo.identity.firmware,
                "position": servo.position,
                "voltage_v": servo.voltage_v,
                "temperature_c": servo.temperature_c,
                "error": servo.error,
                "reply_delay_s": servo.identity.reply_delay_s,
            }
            for servo in servos
        ],
    }


def scan_options(options: Mapping[str, str]) -> tuple[str, int]:
    """Return port and bit rate of a scan. Raises InvalidArgument."""
    port = options.get("port") or options.get("address", "")
    if not port:
        raise InvalidArgument("name the port, for example port=/dev/ttyACM0")
    try:
        return port, int(options.get("baudrate", str(BAUDRATE)))
    except ValueError as error:
        raise InvalidArgument(f"baudrate: {error}") from error


def _ask(bus: ServoBus, servo: int) -> FoundServo:
    try:
        identity, state = bus.identify(servo), bus.read([servo])[servo]
    except (BusError, KeyError) as error:
        nobody = ServoIdentity(servo, 0, "", "?", 0, (0, 0), 0.0)
        remark = str(error) if isinstance(error, BusError) else "answers to a ping alone"
        return FoundServo(nobody, 0, 0.0, 0.0, 0, remark)
    remarks = [identity.trouble] if identity.trouble else []
    if state.error:
        remarks.append(f"reports fault 0x{state.error:02X} (robotd explain)")
    if identity.reply_delay_s > SLOW_REPLY_S:
        remarks.append(f"replies {1e6 * identity.reply_delay_s:.0f} µs late: a slower bus")
    return FoundServo(
        identity,
        state.position,
        state.voltage_v,
        state.temperature_c,
        state.error,
        ", ".join(remarks),
    )
