"""Stand-in for the parts of LeRobot 0.6 that ``lerobot_robot_robotd`` imports.

LeRobot itself needs PyTorch. Modelled: ``Robot`` and ``Teleoperator`` with their abstract members,
calibration folder and context; their configurations with the registry of types and the check of
cameras; the making of a device from its configuration by the names of the classes; cameras that
return a grey image; the errors. Not modelled: the command line
(draccus), calibration files, motors, datasets, processors, policies, keyboard events, real cameras.
"""

from __future__ import annotations

import abc
import importlib
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pytest


@dataclass(kw_only=True)
class CameraConfig:
    fps: int | None = None
    width: int | None = None
    height: int | None = None

    @classmethod
    def register_subclass(cls, name: str) -> Callable[[type], type]:
        return lambda config: config


class GreyCamera:
    def __init__(self, config: CameraConfig) -> None:
        self.config, self.is_connected = config, False

    def connect(self) -> None:
        self.is_connected = True

    def read_latest(self) -> np.ndarray:
        assert self.is_connected
        return np.full((self.config.height, self.config.width, 3), 128, np.uint8)

    def disconnect(self) -> None:
        self.is_connected = False


@dataclass(kw_only=True)
class RobotConfig:
    types: ClassVar[dict[str, type[RobotConfig]]] = {}
    id: str | None = None
    calibration_dir: Path | None = None

    def __post_init__(self) -> None:
        for camera in getattr(self, "cameras", {}).values():
            if None in (camera.width, camera.height, camera.fps):
                raise ValueError("width, height and fps are required for a camera")

    @classmethod
    def register_subclass(cls, name: str) -> Callable[[type], type]:
        def register(config: type) -> type:
            cls.types[name] = config
            return config

        return register


class Robot(abc.ABC):
    name: str

    def __init__(self, config: RobotConfig) -> None:
        assert config.calibration_dir is not None, "the real one writes into the home directory"
        self.robot_type, self.id = self.name, config.id
        config.calibration_dir.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.disconnect()

    @property
    @abc.abstractmethod
    def observation_features(self) -> dict[str, Any]: ...
    @property
    @abc.abstractmethod
    def action_features(self) -> dict[str, Any]: ...
    @property
    @abc.abstractmethod
    def is_connected(self) -> bool: ...
    @property
    @abc.abstractmethod
    def is_calibrated(self) -> bool: ...
    @abc.abstractmethod
    def connect(self, calibrate: bool = True) -> None: ...
    @abc.abstractmethod
    def calibrate(self) -> None: ...
    @abc.abstractmethod
    def configure(self) -> None: ...
    @abc.abstractmethod
    def get_observation(self) -> dict[str, Any]: ...
    @abc.abstractmethod
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]: ...
    @abc.abstractmethod
    def disconnect(self) -> None: ...


@dataclass(kw_only=True)
class TeleoperatorConfig:
    types: ClassVar[dict[str, type[TeleoperatorConfig]]] = {}
    id: str | None = None
    calibration_dir: Path | None = None

    @classmethod
    def register_subclass(cls, name: str) -> Callable[[type], type]:
        def register(config: type) -> type:
            cls.types[name] = config
            return config

        return register


class Teleoperator(abc.ABC):
    name: str

    def __init__(self, config: TeleoperatorConfig) -> None:
        assert config.calibration_dir is not None, "the real one writes into the home directory"
        self.id = config.id
        config.calibration_dir.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.disconnect()

    @property
    @abc.abstractmethod
    def action_features(self) -> dict[str, Any]: ...
    @property
    @abc.abstractmethod
    def feedback_features(self) -> dict[str, Any]: ...
    @property
    @abc.abstractmethod
    def is_connected(self) -> bool: ...
    @property
    @abc.abstractmethod
    def is_calibrated(self) -> bool: ...
    @abc.abstractmethod
    def connect(self, calibrate: bool = True) -> None: ...
    @abc.abstractmethod
    def calibrate(self) -> None: ...
    @abc.abstractmethod
    def configure(self) -> None: ...
    @abc.abstractmethod
    def get_action(self) -> dict[str, Any]: ...
    @abc.abstractmethod
    def send_feedback(self, feedback: dict[str, Any]) -> None: ...
    @abc.abstractmethod
    def disconnect(self) -> None: ...


class DeviceNotConnectedError(ConnectionError):
    pass


class DeviceAlreadyConnectedError(ConnectionError):
    pass


def make_robot_from_config(config: RobotConfig | TeleoperatorConfig) -> Any:
    """Find the class of the device as LeRobot does: beside the configuration, without Config."""
    kind = type(config)
    package = importlib.import_module(kind.__module__.rpartition(".")[0])
    return getattr(package, kind.__name__.removesuffix("Config"))(config)


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the modules of the stand-in in place of LeRobot's, for one test."""
    modules = {
        "lerobot": {},
        "lerobot.robots": {"Robot": Robot, "RobotConfig": RobotConfig},
        "lerobot.teleoperators": {
            "Teleoperator": Teleoperator,
            "TeleoperatorConfig": TeleoperatorConfig,
        },
        "lerobot.cameras": {
            "CameraConfig": CameraConfig,
            "make_cameras_from_configs": lambda configs: {
                name: GreyCamera(config) for name, config in configs.items()
            },
        },
        "lerobot.utils": {},
        "lerobot.utils.errors": {
            "DeviceNotConnectedError": DeviceNotConnectedError,
            "DeviceAlreadyConnectedError": DeviceAlreadyConnectedError,
        },
    }
    for name, content in modules.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    for name in [name for name in sys.modules if name.startswith("lerobot_robot_robotd")]:
        monkeypatch.delitem(sys.modules, name)
