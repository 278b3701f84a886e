"""Pictures of the cameras, rendered in the thread of the caller, without a screen."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotd.api import InvalidArgument, OperationError, WorldCamera
from robotd_mujoco.physics import Physics

LIBRARIES = ("egl", "osmesa")  # the first that works
ADVICE = "install one: apt install libegl1 libgl1-mesa-dri, or libosmesa6"


class Renderer:
    """Renders cameras of one simulation. One thread, which the first picture decides.

    Shadows are off: they cost ten times the picture.
    """

    def __init__(self, physics: Physics) -> None:
        self._physics, self._model = physics, physics.model
        self._cameras = {each.name: each for each in physics.robot_model.cameras}
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
        width = max(each.width for each in self._cameras.values())
        height = max(each.height for each in self._cameras.values())
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
