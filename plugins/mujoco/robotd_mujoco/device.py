"""Drivers of the simulated device: life cycle, axes, I/O, fingers and the world."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotd.api import (
    ConnectionState,
    DeviceContext,
    DeviceDriver,
    FloatArray,
    InvalidArgument,
    IoDriver,
    NotReady,
    OperationError,
    PassiveJoints,
    ProcessImage,
    ProfiledAxes,
    World,
    WorldCamera,
    WorldObject,
    WrenchDriver,
)
from robotd_mujoco.options import MujocoOptions
from robotd_mujoco.physics import IMAGE_BYTES, Physics

LIBRARIES = ("egl", "osmesa")  # the first that works
ADVICE = "install one: apt install libegl1 libgl1-mesa-dri, or libosmesa6"


class Renderer:
    """Renders cameras of one simulation. One thread, which the first picture decides.

    Shadows are off: they cost ten times the picture.
    """

    def __init__(self, physics: Physics) -> None:
        self._physics, self._model = physics, physics.model
        self._cameras = {camera.name: camera for camera in physics.robot_model.cameras}
        self._data = mujoco.MjData(self._model)
        self._context: Any = None  # of OpenGL
        self._drawing: Any = None  # of MuJoCo

    def image(self, name: str) -> NDArray[np.uint8]:
        """Return the present picture, uint8 of shape (height, width, 3).

        Raises InvalidArgument for an unknown camera, OperationError without OpenGL.
        """
        if name not in self._cameras:
            known = ", ".join(self._cameras) or "none"
            raise InvalidArgument(f"camera {name!r} is unknown (available: {known})")
        if self._context is None:
            self._open()
        with self._physics.lock:
            self._data.qpos[:] = self._physics.data.qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return self._draw(self._cameras[name])

    def _open(self) -> None:
        width = max(camera.width for camera in self._cameras.values())
        height = max(camera.height for camera in self._cameras.values())
        self._context = _context(width, height)
        self._context.make_current()
        self._drawing = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawing)
        self._scene = mujoco.MjvScene(self._model, maxgeom=2000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._option, self._view = mujoco.MjvOption(), mujoco.MjvCamera()
        self._option.geomgroup[0] = True

    def _draw(self, camera: WorldCamera) -> NDArray[np.uint8]:
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = self._model.camera(camera.name).id
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            self._option,
            mujoco.MjvPerturb(),
            self._view,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        picture = np.empty((camera.height, camera.width, 3), np.uint8)
        place = mujoco.MjrRect(0, 0, camera.width, camera.height)
        mujoco.mjr_render(place, self._scene, self._drawing)
        mujoco.mjr_readPixels(picture, None, place, self._drawing)
        return picture[::-1].copy()  # OpenGL begins at the bottom


def _context(width: int, height: int) -> Any:
    """Return a context of OpenGL. Raises OperationError with what is missing."""
    reasons = []
    for library in LIBRARIES:
        try:
            return import_module(f"mujoco.{library}").GLContext(width, height)
        except (ImportError, AttributeError, RuntimeError, OSError) as error:
            reasons.append(f"{library.upper()}: {str(error) or type(error).__name__}")
    raise OperationError(f"no OpenGL for pictures ({'; '.join(reasons)}); {ADVICE}")


class MujocoDevice(DeviceDriver):
    """The connection to the simulated robot. Any worker thread may call.

    Attributes:
        physics: behind all drivers of this device.
    """

    def __init__(self, physics: Physics) -> None:
        self.physics = physics

    def open(self, path: str = "", name: str = "") -> None:
        """Open the only robot, whatever the path or name."""
        with self.physics.lock:
            self.physics.is_open, self.physics.lost_because = True, ""

    def close(self) -> None:
        with self.physics.lock:
            self.physics.advance()
            self.physics.silence()
            self.physics.is_open = self.physics.frozen = False
            self.physics.lost_because = ""

    def start_communication(self, timeout_s: float) -> None:
        with self.physics.lock:
            if not self.physics.is_open:
                raise NotReady("communication cannot start: no device is open")
            self.physics.advance()
            self.physics.talking, self.physics.frozen = True, False
            self.physics.lost_because = ""

    def stop_communication(self, timeout_s: float) -> None:
        with self.physics.lock:
            self.physics.advance()
            self.physics.silence()

    def state(self) -> ConnectionState:
        if self.physics.talking:
            return ConnectionState.COMMUNICATING
        return ConnectionState.RUNNING if self.physics.is_open else ConnectionState.IDLE

    def fault(self) -> str:
        return "the simulated link is silent" if self.physics.frozen else self.physics.lost_because

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


class MujocoWrenches(WrenchDriver):
    """Sensors at the wrists; they measure the weight of link and tool, too."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        self._values: FloatArray = np.full((len(physics.robot_model.wrists), 6), np.nan)
        self._taken_ns = 0  # the last values before the link was frozen stay

    @property
    def links(self) -> Sequence[str]:
        return self._physics.robot_model.wrists

    def read(self, wrenches: FloatArray) -> int:
        physics = self._physics
        with physics.lock:
            if not physics.talking:
                self._values[:], self._taken_ns = np.nan, 0
            elif not physics.frozen:
                self._values[:], self._taken_ns = physics.wrenches(), physics.now_ns
            wrenches[:] = self._values
            return self._taken_ns


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
            velocities, torques = physics.velocities(), physics.torques()
            torque, velocity = self._noise
            if torque:
                torques += torque * self._random.standard_normal(physics.axes)
            if velocity:
                velocities += velocity * self._random.standard_normal(physics.axes)
            np.copyto(image.velocity, velocities, where=online)
            np.copyto(image.torque, torques, where=online)

    def send_targets(self, positions: FloatArray) -> None:
        with self._physics.lock:
            if self._physics.talking:
                self._physics.follow(positions)

    def let_go(self, axes: Sequence[int], timeout_s: float) -> None:
        with self._physics.lock:
            self._physics.advance()
            for axis in axes:
                if not self._physics.servo_on[axis]:
                    raise NotReady("the servo is off", axis=axis)
            for axis in axes:
                self._physics.guide(axis)

    def catch(self, axes: Sequence[int]) -> None:
        with self._physics.lock:
            self._physics.advance()
            for axis in axes:
                self._physics.catch(axis)

    def is_let_go(self, axis: int) -> bool:
        return bool(self._physics.let_go[axis])

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
