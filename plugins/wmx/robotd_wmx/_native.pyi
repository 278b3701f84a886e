"""The engine's calls, one each. Units are the engine's; failures raise ``CallError``.

Everything that can block lets go of the interpreter. ``Device.state``, the I/O reads and
``StatusReader.read`` answer from memory and keep it.
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

SDK_PATH: str
CYCLIC_BUFFER: bool
"""True where the SDK had CyclicBufferApi.h and its library; else there is no PositionStream."""

MAX_AXES: int
MAX_SPLINE_AXES: int
SPLINE_CHANNELS: int
INPUT_BYTES: int
OUTPUT_BYTES: int
MAX_MASTERS: int

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int64]

class CallError(Exception):
    """``args``: call, error class, code, name in this SDK (may be empty), the SDK's text."""

    args: tuple[str, str, int, str, str]

def error_names() -> list[tuple[str, int, str]]:
    """Class, code and name of every error that this SDK is known to have."""

def library_version() -> tuple[int, int, int, int]: ...

class State(Enum):
    IDLE = 0
    RUNNING = 1
    COMMUNICATING = 2
    SHUTDOWN = 3
    UNKNOWN = 4

class Device:
    """One device of the engine: one channel for commands, meant for one thread."""

    def create(self, path: str, wait_ms: int, /) -> None: ...
    def close(self, keep_engine: bool, /) -> None: ...
    def set_name(self, name: str, /) -> None: ...
    def set_watchdog(self, milliseconds: int, /) -> None: ...
    def state(self) -> State: ...
    def id(self) -> int: ...
    def devices(self) -> list[tuple[int, str]]:
        """Id and name of every device of the engine, other processes' included."""

    def start_communication(self, wait_ms: int, /) -> None: ...
    def stop_communication(self, wait_ms: int, /) -> None: ...
    def stop_engine(self, wait_ms: int, /) -> None: ...
    def import_parameters(self, path: str, /) -> None: ...
    def export_parameters(self, path: str, /) -> None: ...
    def set_servo(self, axis: int, on: bool, /) -> None: ...
    def clear_amp_alarm(self, axis: int, /) -> None: ...
    def clear_axis_alarm(self, axis: int, /) -> None: ...
    def set_command_mode(self, axis: int, mode: int, /) -> None: ...
    def set_polarity(self, axis: int, polarity: int, /) -> None: ...
    def set_gear_ratio(self, axis: int, numerator: float, denominator: float, /) -> None: ...
    def command_to_feedback(self, axis: int, /) -> None: ...
    def set_home_type_current(self, axis: int, /) -> None: ...
    def start_home(self, axis: int, /) -> None: ...
    def start_pos(
        self, axis: int, target: float, velocity: float, acceleration: float, deceleration: float, /
    ) -> None: ...
    def start_jog(
        self, axis: int, velocity: float, acceleration: float, deceleration: float, /
    ) -> None: ...
    def start_vel(
        self, axis: int, velocity: float, acceleration: float, deceleration: float, /
    ) -> None: ...
    def start_vels(self, axes: list[int], velocities: list[float], ramp_ms: float, /) -> None: ...
    def timed_stop_velocity(self, axis: int, milliseconds: float, /) -> None: ...
    def timed_stop_motion(self, axes: list[int], milliseconds: float, /) -> None:
        """Interpolated axes stop together along their path."""

    def stop_motion(self, axes: list[int], /) -> None: ...
    def stop_velocity(self, axes: list[int], /) -> None: ...
    def quick_stop_motion(self, axes: list[int], /) -> None: ...
    def quick_stop_velocity(self, axes: list[int], /) -> None: ...
    def create_spline_buffer(self, channel: int, points: int, /) -> None: ...
    def free_spline_buffer(self, channel: int, /) -> None: ...
    def spline_buffer_points(self, channel: int, /) -> int: ...
    def start_spline(
        self, channel: int, axes: list[int], times_ms: Numbers, points: Numbers, /
    ) -> None:
        """Shapes (n,) and (n, axes), C-contiguous."""

    def read_inputs(self, address: int, length: int, /) -> bytes: ...
    def read_outputs(self, address: int, length: int, /) -> bytes: ...
    def write_outputs(self, address: int, data: bytes, /) -> None: ...
    def write_output_bit(self, address: int, bit: int, value: bool, /) -> None: ...
    def scan_network(self, master: int, /) -> None: ...
    def register_read(self, master: int, slave: int, address: int, length: int, /) -> bytes: ...
    def sdo_upload(self, master: int, slave: int, index: int, sub: int, /) -> tuple[bytes, int]:
        """Return the value, and the abort code of the slave, 0 without one."""

    def sdo_download(
        self, master: int, slave: int, index: int, sub: int, data: bytes, /
    ) -> int: ...
    def reset_reference_clock(self, master: int, /) -> None: ...
    def reset_transmit_statistics(self, master: int, /) -> None: ...
    def start_hot_connect(self, master: int, /) -> None: ...

class StatusReader:
    """Copies the state of the first axes into arrays of shape (n_axes,) that it holds on to."""

    def __init__(
        self,
        device: Device,
        si_per_unit: Numbers,
        torque_scale: Numbers,
        position: Numbers,
        velocity: Numbers,
        torque: Numbers,
        position_command: Numbers,
        velocity_command: Numbers,
        servo_on: Flags,
        amp_alarm: Flags,
        offline: Flags,
        home_done: Flags,
        home_switch: Flags,
        negative_limit: Flags,
        positive_limit: Flags,
        motion_complete: Flags,
        alarm_code: Codes,
        mode: Codes,
        operation: Codes,
        /,
    ) -> None: ...
    def read(self) -> int:
        """The engine's cycle counter; it does not count while nothing is exchanged."""

    @property
    def communicating(self) -> bool:
        """As of the last ``read``, like ``cycle_ms``."""

    @property
    def cycle_ms(self) -> float:
        """Length of a cycle of the engine."""

class Snapshot:
    """All axes at one moment."""

    def __init__(self, device: Device, /) -> None: ...
    @property
    def licence_invalid(self) -> bool: ...
    @property
    def emergency_stop(self) -> bool: ...
    def servo_on(self, axis: int, /) -> bool: ...
    def offline(self, axis: int, /) -> bool: ...
    def alarm_code(self, axis: int, /) -> int: ...
    def amp_alarm(self, axis: int, /) -> bool: ...
    def following_error_alarm(self, axis: int, /) -> bool: ...
    def idle(self, axis: int, /) -> bool: ...
    def interpolating(self, axis: int, /) -> bool: ...
    def mode(self, axis: int, /) -> int: ...
    def mode_feedback(self, axis: int, /) -> int: ...
    def home_done(self, axis: int, /) -> bool: ...
    def motion_complete(self, axis: int, /) -> bool: ...
    def position(self, axis: int, /) -> float: ...
    def position_command(self, axis: int, /) -> float: ...
    def velocity_command(self, axis: int, /) -> float: ...

class Slave:
    """States are numbered as in the ROS service: Init 1, Preop 2, Boot 4, Safeop 8, Op 16.

    On the wire and in the SDK Boot is 3, Safeop 4 and Op 8; the binding maps them by name.
    """

    state: int
    id: int
    al_code: int
    position: int
    address: int
    offline: int
    inaccessible: int
    new: int
    reverse: int
    vendor_id: int
    product_code: int
    revision: int
    serial: int
    alias: int
    input_address: int
    input_size: int
    output_address: int
    output_size: int
    axes: int

class Master:
    """State of an EtherCAT master and its slaves, as the engine has it."""

    def __init__(self, device: Device, master: int, /) -> None: ...
    state: int
    mode: int
    slaves: list[Slave]
    comm_period: int
    total_axes: int
    input_size: int
    output_size: int
    rings: int
    rx_pdo_size: int
    tx_pdo_size: int
    tx_delay: int
    min_tx_delay: int
    max_tx_delay: int
    packet_loss: int
    packet_timeout: int
    over_cycle: int
    cycles: int
    cyclic_frames: int
    min_clock_interval: int
    max_clock_interval: int
    average_clock_interval: int
    min_clock_difference: int
    max_clock_difference: int
    hot_connect: str
    """idle, running, aborted or unknown."""
    hot_connect_failure: str
    """Reason for the abort; empty otherwise."""

class PositionStream:
    """Setpoints as commands of the cyclic buffers.

    ``units`` are user units per SI unit, ``velocity`` and ``acceleration`` limits in user units,
    all of shape (n_axes,). ``put`` takes SI, is for one thread and never blocks; everything else
    may be called by any thread.
    """

    def __init__(
        self,
        device: Device,
        units: list[float],
        velocity: list[float],
        acceleration: list[float],
        period_s: float,
        buffer_s: float,
        priority: int,
        /,
        threaded: bool = True,
    ) -> None:
        """``threaded=False``: ``turn`` is called where time is simulated."""

    def begin(self, axes: list[int], /) -> None: ...
    def turn(self) -> bool:
        """Send the oldest setpoint, and end streams at rest; False without a setpoint."""

    def put(self, position: Numbers, velocity: Numbers, due_ns: int, /) -> None:
        """Shapes (n_axes,); NaN for axes that have no setpoint."""

    def ran_dry(self, due_ns: int, /) -> bool:
        """The buffers ran dry in motion: a setpoint for ``due_ns`` is ignored."""

    def stop(self, axes: list[int], /) -> None: ...
    def quick_stop(self, axes: list[int], /) -> None: ...
    def close(self) -> None: ...
    def active(self, axis: int, /) -> bool: ...
    def stopping(self, axis: int, /) -> bool: ...
    @property
    def fault(self) -> str: ...
    @property
    def rate(self) -> float:
        """Of the sampling against the clock, 0.99 … 1.01: it keeps the buffers filled."""
