"""Life cycle of a bus with servos: open and examine, exchange, switch off, close."""

from __future__ import annotations

from collections.abc import Callable

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    RobotdError,
    RobotDescriptor,
    get_logger,
    wait_until,
)
from robotd_serial_servo.calibration import TICKS_PER_TURN
from robotd_serial_servo.exchange import Exchange
from robotd_serial_servo.options import PlannedServo, ServoPlan
from robotd_serial_servo.serial_port import PortLost, SerialPort, latency_timer_s
from robotd_serial_servo.servo_bus import BusError, ServoBus, ServoIdentity

OpenBus = Callable[[SerialPort, Clock, float], ServoBus]
CLOSE_S = 1.0  # for the servos to go off
SLOW_LATENCY_S = 0.002
SLOW_REPLY_S = 0.0001
BELOW_CONTROL_LOOP = 1  # in priority
log = get_logger("serial_servo")


def open_port(path: str | None, baudrate: int) -> SerialPort:
    """Open a port. Raises ConnectError, with what to do."""
    if not path:
        raise ConnectError("no port is named: --set backends.NAME.port=/dev/ttyACM0")
    try:
        return SerialPort(path, baudrate)
    except PermissionError as error:
        advice = "join the group of the device (sudo usermod -aG dialout $USER) and log in again"
        raise ConnectError("the port cannot be opened", {path: f"{error}; {advice}"}) from error
    except OSError as error:
        advice = "'robotd doctor' lists the ports; only one program may have it open"
        raise ConnectError("the port cannot be opened", {path: f"{error}; {advice}"}) from error


class ServoDevice(DeviceDriver):
    """A bus with servos, for one robot.

    Attributes:
        plan: servos of the axes, in their order.
        identities: of the servos, as found by ``open``.
        exchange: None while the device is not open.
        communicating: values and targets count.
    """

    def __init__(
        self, robot: RobotDescriptor, plan: ServoPlan, clock: Clock, open_bus: OpenBus
    ) -> None:
        self.plan, self.clock = plan, clock
        self.identities: list[ServoIdentity] = []
        self.exchange: Exchange | None = None
        self.communicating = False
        self._open_bus = open_bus
        self._priority = max(0, robot.cycle.realtime_priority - BELOW_CONTROL_LOOP)

    @property
    def connected(self) -> Exchange:
        """The exchange. Raises NotReady while there is none."""
        if self.exchange is None or self.exchange.failure:
            raise NotReady(self.fault() or "the bus is not open")
        return self.exchange

    def open(self, path: str = "", name: str = "") -> None:
        if self.state() is not ConnectionState.IDLE:
            return
        self._disconnect()  # what is left of a lost port
        options = self.plan.options
        port = open_port(path or options.port, options.baudrate)
        latency_s = latency_timer_s(port.path)
        if latency_s is not None and latency_s > SLOW_LATENCY_S:
            log.warning(
                "the adapter holds replies back", port=port.path, latency_ms=1000 * latency_s
            )
        bus = self._open_bus(port, self.clock, options.reply_timeout_s)
        try:
            self.identities = self._examine(bus)
        except PortLost as error:
            bus.close()
            raise ConnectError("the port was lost", {port.path: str(error)}) from error
        except BaseException:
            bus.close()
            raise
        self.exchange = Exchange(
            bus,
            self.plan.servos,
            self.clock,
            options.exchange_period_s,
            options.lost_after_s,
            self._priority,
        )
        self.exchange.start()

    def close(self) -> None:
        self.stop_communication(CLOSE_S)
        self._disconnect()

    def start_communication(self, timeout_s: float) -> None:
        exchange, began_ns = self.connected, self.clock.now_ns()

        def known() -> bool:
            feedback = self.connected.feedback
            return bool(feedback.time_ns > began_ns and not feedback.offline.any())

        if not wait_until(known, timeout_s, self.clock):
            silent = [record.servo for record in exchange.records if record.missed]
            raise DeviceTimeout(f"servo {', '.join(map(str, silent))} does not answer")
        exchange.let_go.clear()  # all were switched off when communication ended
        self.communicating = True

    def stop_communication(self, timeout_s: float) -> None:
        if not self.communicating:
            return
        self.communicating = False
        exchange = self.exchange
        if exchange is None or exchange.failure:
            return
        jobs = {axis: exchange.switch_off(axis) for axis in range(len(exchange.records))}
        for axis, job in jobs.items():
            try:
                exchange.wait(job, timeout_s)
            except RobotdError as error:
                name = self.plan.servos[axis].name
                log.warning("the servo may be on", joint=name, reason=str(error))

    def state(self) -> ConnectionState:
        if self.exchange is None or self.exchange.failure:
            return ConnectionState.IDLE
        if not self.communicating:
            return ConnectionState.RUNNING
        silent = self.exchange.feedback.offline.all()
        return ConnectionState.UNKNOWN if silent else ConnectionState.COMMUNICATING

    def fault(self) -> str:
        if self.exchange is None:
            return ""
        if self.exchange.failure:
            return f"port lost ({self.exchange.failure})"
        feedback = self.exchange.feedback
        if not feedback.time_ns or not feedback.offline.all():
            return ""
        age_s = (self.clock.now_ns() - feedback.time_ns) / NANOSECONDS
        return f"no servo has answered for {age_s:.1f} s: check the supply and the cable"

    def scan_network(self) -> str:
        if self.exchange is None:
            return "the bus is not open"
        models = {one.number: one.model_name or str(one.model) for one in self.identities}
        answer, silent = list[str](), list[str]()
        for record in self.exchange.records:
            name = f"{record.servo} {models.get(record.servo, '')}".strip()
            (silent if record.offline else answer).append(name)
        lost = f"; no answer: {', '.join(silent)}" if silent else ""
        return f"servos {', '.join(answer) or 'none'}{lost}"

    def _examine(self, bus: ServoBus) -> list[ServoIdentity]:
        """Ask every servo what it is, and switch it off. Raises ConnectError with all that fail."""
        failures, found = dict[str, str](), list[ServoIdentity]()
        for plan in self.plan.servos:
            try:
                bus.ping(plan.servo)
                identity = bus.identify(plan.servo)
                bus.set_torque(plan.servo, on=False)
            except BusError as error:
                failures[plan.name] = str(error)
                continue
            found.append(identity)
            if reason := _mismatch(plan, identity):
                failures[plan.name] = f"servo {plan.servo} {reason}"
        late = [str(one.number) for one in found if one.reply_delay_s > SLOW_REPLY_S]
        if late:
            log.warning("servos reply late: lower their return delay", servos=", ".join(late))
        if failures:
            raise ConnectError("the servos are not as the robot's file says", failures)
        return found

    def _disconnect(self) -> None:
        self.communicating = False
        if self.exchange is not None:
            self.exchange.close()
            self.exchange = None


def _mismatch(plan: PlannedServo, found: ServoIdentity) -> str:
    """Return why a servo is not the one that was planned; "": it is."""
    name = found.model_name or str(found.model)
    if plan.model is not None and plan.model != name:
        return f"is a {name}, not a {plan.model}"
    if found.trouble:
        return found.trouble
    file = plan.calibration
    if file is None:
        return ""
    advice = "'robotd calibrate --store' writes the calibration into the servos"
    if file.homing_offset != found.offset:
        return f"has the offset {found.offset}, the calibration {file.homing_offset}; {advice}"
    low, high = found.range_ticks
    if low > max(0, file.range_min) or high < min(TICKS_PER_TURN - 1, file.range_max):
        stated = f"{file.range_min} to {file.range_max}"
        return f"accepts {low} to {high}, the calibration has {stated}; {advice}"
    return ""
