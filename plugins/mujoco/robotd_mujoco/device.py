"""Drivers of the simulated device: life cycle, axes, I/O, fingers and the world."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd.api import (
    ConnectionState,
    DeviceContext,
    DeviceDriver,
    FloatArray,
    IoDriver,
    NotReady,
    PassiveJoints,
    ProcessImage,
    ProfiledAxes,
    World,
    WorldCamera,
    WorldObject,
)
from robotd_mujoco.options import MujocoOptions
from robotd_mujoco.physics import IMAGE_BYTES, Physics
from robotd_mujoco.renderer import Renderer


class MujocoDevice(DeviceDriver):
    """The connection to the simulated robot. Any worker thread may call.

    Attributes:
        physics: behind all drivers of this device.
    """

    def __init__(self, physics: Physics) -> None:
        self.physics = physics

    def open(self, path: str = "", name: str = "") -> None:
        """There is one robot, whatever its path or name."""
        with self.physics.lock:
            self.physics.is_open = True

    def close(self) -> None:
        with self.physics.lock:
            self.physics.silence()
            self.physics.is_open = self.physics.frozen = False

    def start_communication(self, timeout_s: float) -> None:
        with self.physics.lock:
            if not self.physics.is_open:
                raise NotReady("communication cannot start: no device is open")
            self.physics.advance()
            self.physics.talking, self.physics.frozen = True, False

    def stop_communication(self, timeout_s: float) -> None:
        with self.physics.lock:
            self.physics.advance()
            self.physics.silence()

    def state(self) -> ConnectionState:
        if self.physics.talking:
            return ConnectionState.COMMUNICATING
        return ConnectionState.RUNNING if self.physics.is_open else ConnectionState.IDLE

    def fault(self) -> str:
        return "the simulated link is silent" if self.physics.frozen else ""

    def scan_network(self) -> str:
        with self.physics.lock:
            return f"{int(self.physics.connected.sum())} simulated drives"


class MujocoIo(IoDriver):
    """Inputs and outputs in memory. Any thread may call."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics

    @property
    def input_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def output_bytes(self) -> int:
        return IMAGE_BYTES

    @property
    def live(self) -> tuple[memoryview, memoryview]:
        return memoryview(self._physics.inputs), memoryview(self._physics.outputs)

    def read_inputs(self, byte: int, length: int) -> bytes:
        return bytes(self._physics.inputs[byte : byte + length])

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes(self._physics.outputs[byte : byte + length])

    def write_outputs(self, byte: int, data: bytes) -> None:
        with self._physics.lock:
            self._require_open()
            self._physics.advance()
            self._physics.write_outputs(byte, data)

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        with self._physics.lock:
            self._require_open()
            self._physics.advance()
            others = self._physics.outputs[byte] & ~(1 << bit)
            self._physics.write_outputs(byte, bytes([others | int(value) << bit]))

    def _require_open(self) -> None:
        if not self._physics.is_open:
            raise NotReady("outputs cannot be written: no device is open")


class MujocoFingers(PassiveJoints):
    """Measured positions of the fingers."""

    def __init__(self, physics: Physics, names: Sequence[str]) -> None:
        self._physics, self._names = physics, names

    @property
    def names(self) -> Sequence[str]:
        return self._names

    def read(self, positions: FloatArray) -> None:
        with self._physics.lock:
            positions[:] = self._physics.fingers()


class MujocoWorld(World):
    """Objects of the scene."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        self._model = physics.robot_model
        self._renderer = Renderer(physics)
        # OpenGL belongs to one thread, and any thread may ask for a picture.
        self._thread = ThreadPoolExecutor(1, "robotd-pictures")

    @property
    def frame(self) -> str:
        return self._model.root

    @property
    def objects(self) -> Sequence[WorldObject]:
        return self._model.objects

    def poses(self) -> FloatArray:
        with self._physics.lock:
            return self._physics.object_poses()

    def reset(self) -> None:
        with self._physics.lock:
            self._physics.advance()
            self._physics.reset_objects()

    def place(self, name: str, pose: FloatArray) -> None:
        with self._physics.lock:
            self._physics.advance()
            self._physics.place_object(name, pose)

    @property
    def cameras(self) -> Sequence[WorldCamera]:
        return self._model.cameras

    def image(self, camera: str) -> NDArray[Any]:
        return self._thread.submit(self._renderer.image, camera).result()


class MujocoAxes(ProfiledAxes):
    """All axes of one robot."""

    def __init__(self, physics: Physics, context: DeviceContext[MujocoOptions]) -> None:
        super().__init__(physics.axes, 1.0 / context.robot.cycle.rate_hz, context.clock)
        self._physics = physics
        options = context.options
        self._noise = options.torque_noise_nm, options.velocity_noise_rad_s
        self._random = np.random.default_rng(options.seed)

    def read_feedback(self, image: ProcessImage) -> None:
        physics = self._physics
        with physics.lock:
            physics.advance()
            if physics.frozen:
                return
            image.servo_on[:] = physics.servo_on
            image.alarm_code[:] = physics.alarm_code
            image.amp_alarm[:] = physics.alarm_code != 0
            image.offline[:] = ~physics.connected if physics.talking else True
            image.reason[:] = physics.reason
            image.home_done[:] = True  # absolute encoders
            if not physics.talking:
                return
            image.fresh_ns = physics.now_ns
            online = physics.connected
            np.copyto(image.position, physics.positions() + physics.encoder_offset, where=online)
            np.copyto(image.velocity, physics.velocities(), where=online)
            np.copyto(image.torque, physics.torques(), where=online)
        torque, velocity = self._noise
        if torque:
            image.torque += torque * self._random.standard_normal(physics.axes)
        if velocity:
            image.velocity += velocity * self._random.standard_normal(physics.axes)

    def send_targets(self, positions: FloatArray) -> None:
        with self._physics.lock:
            if self._physics.talking:
                self._physics.follow(positions)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        with self._physics.lock:
            self._physics.advance()
            if on:
                self._physics.enable(axis)
            else:
                self._physics.disable(axis)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        with self._physics.lock:
            if not self._physics.talking:
                raise NotReady("the drive does not answer", axis=axis)
            self._physics.clear(axis)
