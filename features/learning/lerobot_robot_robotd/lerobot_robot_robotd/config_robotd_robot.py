"""Configuration of a robotd robot, as LeRobot's command line fills it."""

# No "from __future__ import annotations": draccus needs the types at run time.
from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig


@RobotConfig.register_subclass("robotd")
@dataclass(kw_only=True)
class RobotdRobotConfig(RobotConfig):
    """Options of ``--robot.type=robotd``.

    Attributes:
        descriptor: name of a robot, or path of its ``robot.yaml``.
        backend: None takes the descriptor's own.
        variant: None takes the descriptor's default variant.
        mode: of the stream: ``smooth`` for policies at 10 to 50 Hz, ``target`` for single targets.
        timeout_s: age of the last action at which the joints slow to rest; None: the descriptor's.
        max_relative_target: greatest distance of a target from the measured position, rad or m: of
            every joint, or by the name of the joint; None, or a joint without one: the robot's own
            limits alone.
        velocities: observe the velocities of the joints too.
        cameras: by name, with ``width``, ``height`` and ``fps``; of the type ``robotd_world`` those
            of a simulated world.
    """

    descriptor: str = "cr3a"
    backend: str | None = None
    variant: str | None = None
    mode: str = "smooth"
    timeout_s: float | None = 0.5
    max_relative_target: float | dict[str, float] | None = None
    velocities: bool = False
    cameras: dict[str, CameraConfig] = field(default_factory=dict)
