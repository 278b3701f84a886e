"""The four small contracts that a backend fills.

Units are SI at this boundary: rad or m, rad/s, rad/s², N·m, seconds. Counts, gear ratios and
polarity stay inside the backend. Axis numbers run from 0 to n_axes - 1 and arrays have the
shape (n_axes,). The core checks every argument before it calls a driver, so a driver may rely
on: axis in range, finite numbers, positive velocities and accelerations where a move needs
them, lists without duplicates.

Threads: ``AxisDriver.read`` and ``AxisDriver.stream`` are called by the cycle thread alone;
they must not block, allocate or raise in normal running. Everything else may be called by any
worker thread at any time, may block for at most its ``timeout_s``, and must not disturb the
cycle. A driver raises ``OperationError``, ``Unsupported`` or ``DeviceTimeout``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState
from robotd.errors import Unsupported
from robotd.motion.profile import Profile


class DeviceDriver(ABC):
    """The connection to an engine or a bus. Must: all but ``fault`` and the last two."""

    @abstractmethod
    def open(self, path: str = "", name: str = "") -> None:
        """Connect; Idle → Running. Raises ConnectError naming every child that fails.

        Args:
            path: device, bus or SDK to open instead of the configured one; empty: configured.
            name: what this client shall be called by the device; empty: the robot's name.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect from any state; → Idle. Calling it twice is not an error."""

    @abstractmethod
    def start_communication(self, timeout_s: float) -> None:
        """Begin the cyclic exchange; Running → Communicating. Nothing moves."""

    @abstractmethod
    def stop_communication(self, timeout_s: float) -> None:
        """End the cyclic exchange; → Running. Axes are stopped and servos go off.

        Also called to undo a ``start_communication`` that failed or timed out: what it has asked
        for must not happen later.
        """

    @abstractmethod
    def state(self) -> ConnectionState:
        """The state as the device has it now. Never blocks."""

    def fault(self) -> str:
        """Why the device does not communicate, or gives no fresh values; "" if nothing is wrong.

        Never blocks.
        """
        return ""

    @abstractmethod
    def scan_network(self) -> str:
        """Look for devices on the fieldbus; a one-line summary for people."""

    def load_parameters(self, path: Path) -> str:
        """Apply a parameter file, all of it or (on an error) nothing of it.

        Returns a note for the user, such as what the file leaves out; "" for none.

        Raises:
            DescriptorError: the file is wrong, or lacks axes of the robot; all are named.
            NotReady: it would change what a position means (polarity, gear ratio, encoder,
                command mode) of an axis whose servo is on; axis and parameter are named. The
                core switches no servo on meanwhile.
        """
        raise Unsupported("parameter files", type(self).__name__)

    def dump_parameters(self, axis: int) -> str:
        """The parameters of one axis in force, as text for people."""
        raise Unsupported("parameter files", type(self).__name__)


class AxisDriver(ABC):
    """The axes of one device."""

    @property
    def goes_on(self) -> bool:
        """What an axis does while the cycle stands still and ``stream`` is not called.

        True: it goes on with the velocity of the last setpoint. False: it stands there.
        """
        return True

    @abstractmethod
    def read(self, image: ProcessImage) -> None:
        """Cycle thread: fill every array of ``image`` and its ``fresh_ns``."""

    @abstractmethod
    def stream(self, position: FloatArray, velocity: FloatArray) -> None:
        """Cycle thread: one setpoint per axis, to be reached one period later.

        An axis in position mode passes through its position at its velocity; one in velocity
        mode changes evenly to its velocity, and its position is ignored. Only axes between
        ``begin_stream`` and ``end_stream`` obey; the others' entries are ignored. What is
        ignored may be NaN. After a pause the setpoints begin where ``goes_on`` leads.
        """

    @abstractmethod
    def begin_stream(self, axes: Sequence[int]) -> None:
        """Let ``axes`` follow ``stream`` from where their command stands now, without a jump.

        Each is in ``Operation.STREAM`` until ``end_stream``, or until something stops it.
        """

    @abstractmethod
    def end_stream(self, axes: Sequence[int]) -> None:
        """Hold the last setpoint (velocity mode: slow to rest); the axes take moves again."""

    def follow(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        """Start a trajectory that the device interpolates (capability TRAJECTORIES_ON_DEVICE).

        Returns when the device has taken all points and started. The axes, idle before, are in
        ``Operation.STREAM`` until they have arrived (then ``motion_complete``) or something
        stops them; ``stop`` slows them down together, along the path, as fast as their limits
        allow, however gentle the trajectory is. Worker threads only.

        Args:
            axes: m axes, in position mode.
            times_s: (k,) increasing, from 0.
            positions: (k, m); the first is where the command stands.

        Raises:
            OperationError: the device does not take it, with the reason; nothing moved.
        """
        raise Unsupported("trajectories on the device", type(self).__name__)

    def stop_trajectory(self, axes: Sequence[int], duration_s: float) -> None:
        """Start to stop what ``follow`` started, all its axes together along the path.

        Returns at once. Axes at rest: no effect. The default is ``stop``. Worker threads only.

        Args:
            axes: those of ``follow``.
            duration_s: time in which the path's rate falls to 0; the joints' own limits allow it.
        """
        self.stop(axes)

    @abstractmethod
    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        """Enable or disable the drive and wait until it says so.

        Before enabling the command is set to the measured position (no jump).
        """

    @abstractmethod
    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        """Clear the drive's alarm and wait until it is gone. Without an alarm: no effect."""

    @abstractmethod
    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        """Change the command mode of an idle axis; nothing moves."""

    @abstractmethod
    def set_polarity(self, axis: int, polarity: int) -> None:
        """1 or -1, for an axis with its servo off; the measured position changes sign."""

    @abstractmethod
    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Encoder counts = units · numerator / denominator, for an axis with its servo off."""

    @abstractmethod
    def home(self, axis: int, timeout_s: float) -> None:
        """Make the present position the home position (zero) without moving; wait for it."""

    @abstractmethod
    def move(self, axis: int, target: float, profile: Profile) -> None:
        """Start a move to an absolute target (rad or m); returns when it is accepted.

        A running move or velocity command is overridden without a jump.
        """

    @abstractmethod
    def jog(self, axis: int, profile: Profile) -> None:
        """Start or change a velocity command (signed ``profile.velocity``).

        Velocity 0 slows to rest, after which the axis is idle.
        """

    @abstractmethod
    def stop(self, axes: Sequence[int]) -> None:
        """Start a controlled stop with each axis' own deceleration. Idle axes: no effect.

        Returns at once: the cycle calls it, too, when a velocity command nears a position limit.
        """

    @abstractmethod
    def quick_stop(self, axes: Sequence[int]) -> None:
        """Start the fastest controlled stop. Idle axes: no effect."""


class IoDriver(ABC):
    """The digital I/O image. Reads answer from the last cycle and never block."""

    @property
    @abstractmethod
    def input_bytes(self) -> int:
        """Size of the input image."""

    @property
    @abstractmethod
    def output_bytes(self) -> int:
        """Size of the output image."""

    @abstractmethod
    def read_inputs(self, byte: int, length: int) -> bytes:
        """``length`` bytes of the input image from address ``byte``. Any thread."""

    @abstractmethod
    def read_outputs(self, byte: int, length: int) -> bytes:
        """``length`` bytes of the output image from address ``byte``. Any thread."""

    @abstractmethod
    def write_outputs(self, byte: int, data: bytes) -> None:
        """Write whole bytes of the output image. Any thread."""

    @abstractmethod
    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        """Write one output bit and leave its neighbours alone, atomically. Any thread."""


@dataclass(frozen=True)
class SlaveInfo:
    """One device on the fieldbus.

    ``state``: None 0, Init 1, Preop 2, Boot 4, Safeop 8, Op 16. ``fault`` says in words what is
    wrong with it; "" if nothing is, or the numbers say it.
    """

    id: int
    state: int
    al_code: int = 0
    position: int = 0
    address: int = 0
    offline: bool = False
    inaccessible: bool = False
    new: bool = False
    reverse: bool = False
    vendor_id: int = 0
    product_code: int = 0
    revision: int = 0
    serial: int = 0
    alias: int = 0
    input_address: int = 0
    input_size: int = 0
    output_address: int = 0
    output_size: int = 0
    axes: int = 0
    fault: str = ""


@dataclass(frozen=True)
class NetworkState:
    """A fieldbus and its devices; sizes in bytes, ``comm_period_us`` and delays as counted.

    ``note`` is a sentence for the reader about what the backend cannot fill. ``details`` are
    for ``/diagnostics``: what else is known of this fieldbus, by name, with its unit in the name.
    """

    state: int
    mode: int = 0
    comm_period_us: int = 0
    total_axes: int = 0
    input_size: int = 0
    output_size: int = 0
    rings: int = 1
    rx_pdo_size: int = 0
    tx_pdo_size: int = 0
    tx_delay: int = 0
    min_tx_delay: int = 0
    max_tx_delay: int = 0
    packet_loss: int = 0
    packet_timeout: int = 0
    over_cycle: int = 0
    slaves: tuple[SlaveInfo, ...] = field(default=())
    note: str = ""
    details: Mapping[str, str] = field(default_factory=dict)


class FieldbusDriver(ABC):
    """Diagnostics of the fieldbus; all of it from worker threads."""

    @property
    @abstractmethod
    def masters(self) -> int:
        """Number of masters, ids 0 … masters - 1."""

    @abstractmethod
    def network_state(self, master: int) -> NetworkState:
        """A snapshot; answers in any engine state."""

    def read_register(self, master: int, slave: int, address: int, length: int) -> bytes:
        """Raw register memory of a slave (capability REGISTER_READ)."""
        raise Unsupported("register_read", type(self).__name__)

    def reset_statistics(self, master: int) -> None:
        """Zero the counters of ``network_state`` (capability STATISTICS)."""
        raise Unsupported("reset_statistics", type(self).__name__)

    def start_hot_connect(self, master: int) -> None:
        """Let newly attached slaves join (capability HOT_CONNECT)."""
        raise Unsupported("start_hotconnect", type(self).__name__)
