"""Scene of an arm: what it keeps away from, changed while the robot runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

from robotd.api import FloatArray, InvalidArgument, get_logger
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.rotations import inverse_pose

log = get_logger("tool")

MAX_OBJECTS = 16  # beside those of the robot's file: each takes time in every control period

Use = Callable[[Sequence[SceneObject], str], str]
"""Applies the objects, of which the named one has changed; returns what that has caused."""


class Scene:
    """Bodies around the arm of one joint group, and those that its tool carries.

    Any worker thread. Those of the robot's file stay as they are; the others are forgotten when
    the robot ends.

    Args:
        of_file: objects of the robot's file.
        reserved: names that no object may have, as those of links.
        use: see ``Use``; called with the objects beside those of the file, one call at a time.
        rest: context in which the arm does not begin to move; it yields the pose (4, 4) of the link
            of the tool in the base, and raises NotReady while the arm moves.

    Attributes:
        listeners: called after each change, one at a time.
        rest: see above.
    """

    def __init__(
        self,
        of_file: Iterable[SceneObject],
        reserved: Iterable[str],
        use: Use,
        rest: Callable[[], AbstractContextManager[FloatArray]],
    ) -> None:
        self._of_file, self._reserved = tuple(of_file), frozenset(reserved)
        self._use, self.rest = use, rest
        self._added: dict[str, SceneObject] = {}
        self._lock = threading.Lock()
        self.listeners: list[Callable[[], None]] = []

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """All objects, those of the robot's file first. Any thread."""
        return (*self._of_file, *self._added.values())

    def add(self, item: SceneObject) -> str:
        """Add an object, or replace the one of its name; return what that has caused.

        Raises InvalidArgument: its shape, size or pose cannot be, its name is taken, or there are
        ``MAX_OBJECTS``.
        """
        item = replace(item, in_file=False)
        with self._lock:
            how = "replaced" if item.name in self._added else "added"
            return self._change(self._with(self._added, item), item.name, how)

    def with_planned(self, objects: Iterable[SceneObject]) -> dict[str, SceneObject]:
        """Return the objects beside those of the file, with ``objects`` of MoveIt's planning scene.

        They replace its earlier ones. Raises InvalidArgument: see ``add``.
        """
        changed = {name: one for name, one in self._added.items() if not one.in_planning_scene}
        for item in objects:
            if item.name in changed:
                raise InvalidArgument(f"{item.name} is the name of another object of the scene")
            changed = self._with(changed, item)
        return changed

    def exchange_planned(self, objects: Sequence[SceneObject]) -> None:
        """Exchange all objects of MoveIt's planning scene; errors: see ``with_planned``."""
        with self._lock:
            how = f"MoveIt's planning scene has {len(objects)}"
            self._change(self.with_planned(objects), "", how)

    def _with(self, added: dict[str, SceneObject], item: SceneObject) -> dict[str, SceneObject]:
        """Return objects with one more. Raises InvalidArgument: see ``add``."""
        item = item.checked()
        self._require_changeable(added, item.name)
        if item.name in self._reserved:
            raise InvalidArgument(f"{item.name!r} is the name of a link or a tool")
        if item.name not in added and len(added) >= MAX_OBJECTS:
            raise InvalidArgument(f"{item.name}: the scene has {MAX_OBJECTS} objects already")
        return {**added, item.name: item}

    def remove(self, name: str = "") -> str:
        """Remove an object, "" for all that are not of the file. Raises InvalidArgument: none."""
        with self._lock:
            if not name:
                return self._change({}, "", f"{len(self._added)} objects removed")
            self._added_one(name)
            rest = {other: item for other, item in self._added.items() if other != name}
            return self._change(rest, name, "removed")

    def move(self, name: str, pose: FloatArray) -> str:
        """Move an object to another ``pose`` (4, 4), in the frame that its pose is in.

        Raises InvalidArgument: there is none, or ``pose`` is none.
        """
        with self._lock:
            moved = replace(self._added_one(name), pose=pose).checked()
            return self._change({**self._added, name: moved}, name, "moved")

    def attach(self, name: str) -> str:
        """Let the tool carry an object from where it is.

        Raises InvalidArgument: there is none, it is a plane or attached; NotReady: the arm moves.
        """
        return self._carry(name, attached=True)

    def detach(self, name: str) -> str:
        """Leave an object that the tool carries where it is. Errors: see ``attach``."""
        return self._carry(name, attached=False)

    def _carry(self, name: str, *, attached: bool) -> str:
        with self._lock:
            item = self._added_one(name)
            if item.attached == attached:
                state = "attached already" if attached else "not attached"
                raise InvalidArgument(f"{name} is {state}")
            with self.rest() as tool:
                pose = (inverse_pose(tool) if attached else tool) @ item.pose
                carried = replace(item, pose=pose, attached=attached).checked()
                how = "attached" if attached else "detached"
                return self._change({**self._added, name: carried}, name, how)

    def _added_one(self, name: str) -> SceneObject:
        """Return an object that may be changed. Raises InvalidArgument."""
        self._require_changeable(self._added, name)
        if name not in self._added:
            known = ", ".join(self._added) or "none"
            raise InvalidArgument(f"no object {name!r} in the scene (available: {known})")
        return self._added[name]

    def _require_changeable(self, added: dict[str, SceneObject], name: str) -> None:
        if any(item.name == name for item in self._of_file):
            raise InvalidArgument(f"{name} belongs to the robot's file: change it there")
        if name in added and added[name].in_planning_scene:
            raise InvalidArgument(f"{name} belongs to MoveIt's planning scene: change it there")

    def _change(self, added: dict[str, SceneObject], name: str, how: str) -> str:
        consequences = self._use(tuple(added.values()), name)
        self._added = added
        log.info("scene changed", object=name, change=how, consequences=consequences)
        for listener in self.listeners:
            listener()
        text = f"{name} {how}" if name else how
        return f"{text}; {consequences}" if consequences else text
