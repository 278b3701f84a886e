"""Pairs and links that the collision guard does not check, for ``robotd check``."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from robotd.api import RobotdError, RobotDescriptor
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.settings import CollisionSettings, ToolSpaceKeys


def check_collisions(
    robot: RobotDescriptor,
) -> Iterator[tuple[str, Callable[[], Iterable[str]]]]:
    """Yield the check of each joint group, where the robot's file asks for collisions."""
    settings = robot.settings(ToolSpaceKeys).tool_space.collisions
    if settings is None:
        return
    for name in robot.joint_groups:
        of_group = f" of {name}" if len(robot.joint_groups) > 1 else ""
        yield (
            f"collisions{of_group}",
            lambda name=name: _not_checked(robot, name, settings),  # type: ignore[misc]
        )
    if len(robot.joint_groups) > 1:
        yield "collisions of arms with each other", lambda: _not_on_one_base(robot)


def _not_on_one_base(robot: RobotDescriptor) -> Iterable[str]:
    """Return a text for each two joint groups that are not kept apart."""
    bases = {}
    for name in robot.joint_groups:
        with suppress(RobotdError):  # of a group without a tool, which the guard rejects
            bases[name] = Kinematics.of_descriptor(robot, name).chain.base
    for first, second in itertools.combinations(bases, 2):
        if bases[first] != bases[second]:
            yield (
                f"collisions of {first} with {second} are not checked: their bases are"
                f" {bases[first]} and {bases[second]}, and one of them moves"
            )


def _not_checked(robot: RobotDescriptor, group: str, settings: CollisionSettings) -> Iterable[str]:
    """Return a text for each pair of bodies that is not checked.

    Where nothing can be checked the guard itself says so, and the robot does not run.
    """
    try:
        kinematics = Kinematics.of_descriptor(robot, group)
        collisions = Collisions.of(robot, kinematics, settings)
    except RobotdError:
        return
    for first, second in collisions.left_out:
        yield (
            f"collisions of {first} and {second} are not checked: they are too close in nearly"
            " every posture"
        )
    for first, second in settings.not_checked:
        if {first, second} <= {*collisions.bodies.links}:
            yield f"collisions of {first} and {second} are not checked: the file says so"
    for index, joint in enumerate(kinematics.chain.moving):
        if index not in collisions.bodies.carriers:
            yield f"collisions of what {joint} moves are not checked: the urdf has no shape of it"
