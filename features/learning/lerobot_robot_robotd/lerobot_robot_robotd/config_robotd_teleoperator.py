"""Configuration of a robotd leader arm, as LeRobot's command line fills it."""

# No "from __future__ import annotations": draccus needs the types at run time.
from dataclasses import dataclass

from lerobot.teleoperators import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("robotd")
@dataclass(kw_only=True)
class RobotdTeleoperatorConfig(TeleoperatorConfig):
    """Options of ``--teleop.type=robotd``.

    Attributes:
        descriptor: name of a robot that is moved by hand, or path of its ``robot.yaml``.
        backend: None takes the descriptor's own.
        variant: None takes the descriptor's default variant.
    """

    descriptor: str = "so101_leader"
    backend: str | None = None
    variant: str | None = None
