"""The life of the engine: open, communicate, parameters, close."""

from __future__ import annotations

import tempfile
from pathlib import Path

from robotd_wmx_parameters import (
    WmxParameters,
    axis_text,
    read_wmx_parameters,
    require_same_scaling,
    write_wmx_parameters,
)

from robotd.api import (
    NANOSECONDS,
    ConnectError,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    OperationError,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd_wmx._native import CallError, Master, Snapshot
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import name_of, text_of, translate, translated

log = get_logger("wmx")

LINK_RETRY_NS = 300_000_000  # between two requests while the network link comes up
CLOSING_S = 1.0  # for the engine to close the devices of a killed process, beyond `watchdog_s`
LICENCE = "the licence is invalid or has expired"


class WmxDevice(DeviceDriver):
    """Opens, starts and stops the engine. Any worker thread may call."""

    def __init__(self, connection: WmxConnection) -> None:
        self.connection = connection
        self._attached = False  # whether we take part in the communication

    def open(self, path: str = "", name: str = "") -> None:
        if self._engine_lives():
            return
        self.connection.open(path, name or self.connection.robot.name)
        try:
            self._end_predecessor()
            self.connection.prepare()
        except RobotdError as error:
            self.close()
            raise ConnectError(
                "the WMX engine cannot be prepared",
                {f"{self.connection.robot.name} → wmx": str(error)},
            ) from error

    def close(self) -> None:
        """Stop the engine, then close the devices, unless other programs use the engine."""
        connection, self._attached = self.connection, False
        if not connection.is_open:
            return
        connection.prepare_close()
        if self._engine_lives():
            if others := connection.others():
                log.info("the engine goes on for other programs", devices=others)
            elif not connection.options.shared:
                self._stop_engine()
        connection.close()

    def start_communication(self, timeout_s: float) -> None:
        """Ask again while the network link is not ready; a shared engine is waited for."""
        if self._attached and self.connection.state() is ConnectionState.COMMUNICATING:
            return
        if self.connection.options.shared:
            self._await_communication(timeout_s)
        else:
            self._require_scale()
            self._request_communication(timeout_s)
        self._attached = True

    def stop_communication(self, timeout_s: float) -> None:
        """A shared engine keeps communicating; we no longer take part."""
        self._attached = False
        if self.connection.options.shared or not self._engine_lives():
            return
        if others := self.connection.others():
            log.warning("communication ends for other programs too", devices=others)
        try:
            self.connection.command.stop_communication(max(1, round(timeout_s * 1000)))
        except CallError as error:
            if self._engine_lives():
                raise translate(error, "communication") from error

    def state(self) -> ConnectionState:
        state = self.connection.state()
        detached = self.connection.options.shared and not self._attached
        if state is ConnectionState.COMMUNICATING and detached:
            return ConnectionState.RUNNING
        return state

    def fault(self) -> str:
        """Reason for the end of communication, as far as the engine reports it."""
        if reason := self.connection.lost_because():
            return reason
        if not self._attached or self.connection.state() is ConnectionState.COMMUNICATING:
            return ""
        if self._licence_invalid():
            return LICENCE
        return "communication was stopped by another program, or by the engine itself"

    def scan_network(self) -> str:
        """Scan every master; slaves that do not answer are named by their id."""
        device, lines = self.connection.diagnostics, []
        for master in range(self.connection.options.masters):
            with translated(f"scanning master {master}"):
                if not self.connection.options.shared:
                    device.scan_network(master)
                slaves = Master(device, master).slaves
            drives = sum(slave.axes > 0 for slave in slaves)
            silent = [str(slave.id) for slave in slaves if slave.offline]
            missing = f"; no answer from {', '.join(silent)}" if silent else ""
            lines.append(
                f"master {master}: {drives} drives, {len(slaves) - drives} others{missing}"
            )
        return "; ".join(lines)

    @property
    def parameters_before_communication(self) -> bool:
        """The engine takes parameters as soon as it runs, and starts with its defaults."""
        return True

    def load_parameters(self, path: Path) -> str:
        """Check the file, complete its missing elements, and import it.

        The engine would take a missing element for 0. A shared engine has parameters of its own:
        they stay.
        """
        if self.connection.options.shared:
            return "not loaded: the parameters of a shared engine are left alone"
        axes = self.connection.robot.axes
        parameters = read_wmx_parameters(path, axes)
        self._require_same_scaling(parameters)
        with tempfile.TemporaryDirectory(prefix="robotd-wmx-") as folder:
            complete = Path(folder) / "parameters.xml"
            write_wmx_parameters(parameters, complete)
            with translated(f"parameter file {path}"):
                self.connection.command.import_parameters(str(complete))
        return parameters.missing_summary(axes)

    def dump_parameters(self, axis: int) -> str:
        return axis_text(self._parameters_in_force(), axis)

    def _parameters_in_force(self) -> WmxParameters:
        with tempfile.TemporaryDirectory(prefix="robotd-wmx-") as folder:
            exported = Path(folder) / "parameters.xml"
            with translated("parameters of the engine"):
                self.connection.command.export_parameters(str(exported))
            return read_wmx_parameters(exported)

    def _require_same_scaling(self, parameters: WmxParameters) -> None:
        status = Snapshot(self.connection.status)
        enabled = [axis for axis in range(self.connection.robot.axes) if status.servo_on(axis)]
        if enabled:
            require_same_scaling(self._parameters_in_force().columns, parameters.columns, enabled)

    def _require_scale(self) -> None:
        """Raise NotReady while a joint or wheel has the engine's default scale."""
        scale, units = self._parameters_in_force().columns, self.connection.scaling.units
        ratio = zip(scale["AxisGearRatioNumerator"], scale["AxisGearRatioDenominator"], strict=True)
        default = [axis for axis, pair in enumerate(ratio) if pair == (1.0, 1.0)]
        moved = self.connection.scaling.moved_axes
        if unscaled := [axis for axis in moved if axis in default and units[axis] == 1.0]:
            raise NotReady(
                f"axes {unscaled} have the engine's default gear ratio 1/1, by which 1 rad is one"
                " encoder count: name the robot's parameters_file, or backends.wmx.units_per_si"
            )

    def _end_predecessor(self) -> None:
        """Let the engine end what a killed robotd of this robot has left: motion, and servos on.

        It would end with that process' devices, ``watchdog_s`` later, had ours not been opened.
        """
        connection, options = self.connection, self.connection.options
        if options.shared or not connection.predecessors():
            return
        timeout_s = options.watchdog_s + CLOSING_S
        log.warning("a robotd of this robot still has devices: they are waited for", s=timeout_s)
        if not wait_until(lambda: not connection.predecessors(), timeout_s, connection.clock):
            log.warning("they are still open: another robotd of this robot runs on this engine")
        elif not connection.others():
            log.warning("it was killed: communication is stopped, and with it the servos")
            self.stop_communication(options.engine_timeout_s)

    def _engine_lives(self) -> bool:
        return self.connection.state() in (ConnectionState.RUNNING, ConnectionState.COMMUNICATING)

    def _request_communication(self, timeout_s: float) -> None:
        clock = self.connection.clock
        end_ns = clock.now_ns() + round(timeout_s * NANOSECONDS)
        while True:
            wait_ms = max(1, (end_ns - clock.now_ns()) // 1_000_000)
            try:
                self.connection.command.start_communication(wait_ms)
            except CallError as error:
                again = name_of(error) == "StartCommunicationError"
                if not again or clock.now_ns() + LINK_RETRY_NS >= end_ns:
                    raise self._not_communicating(error) from error
                log.warning("link not ready, trying again", reason=text_of(*error.args[1:3]))
                clock.sleep_until_ns(clock.now_ns() + LINK_RETRY_NS)
            else:
                return

    def _await_communication(self, timeout_s: float) -> None:
        def communicating() -> bool:
            return self.connection.state() is ConnectionState.COMMUNICATING

        if not wait_until(communicating, timeout_s, self.connection.clock):
            raise DeviceTimeout(f"the shared engine does not communicate after {timeout_s:g} s")

    def _not_communicating(self, error: CallError) -> Exception:
        if self._licence_invalid():
            rejected = NotReady(f"communication: {LICENCE}")
            rejected.code = error.args[2]
            return rejected
        return translate(error, "communication", OperationError)

    def _licence_invalid(self) -> bool:
        try:
            return Snapshot(self.connection.status).licence_invalid
        except (CallError, NotReady):
            return False

    def _stop_engine(self) -> None:
        try:
            wait_ms = round(self.connection.options.engine_timeout_s * 1000)
            command = self.connection.command
            self.connection.give_up()
            command.stop_engine(wait_ms)
        except CallError as error:
            log.warning("the engine did not stop in time", reason=text_of(*error.args[1:3]))
