"""Changes of one axis in a robot's file; comments and layout stay."""

from __future__ import annotations

import difflib
import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from robotd.api import AxisKeys, DescriptorError
from robotd.api.models import JointSettings, RobotDescriptor
from robotd_commissioning.findings import Change, Place

MAX_LINE = 10_000  # flow mappings stay on their line


class DescriptorEdit:
    """Text of a robot's file with changes of one axis. Writes nothing before ``save``.

    Args:
        robot: loaded from a file.
        joint: whose axis it is.
        backend: name of the section.

    Raises DescriptorError: the robot has no file, or the axis is described in one that it extends.
    """

    def __init__(
        self, robot: RobotDescriptor, joint: JointSettings, backend: str, keys: AxisKeys
    ) -> None:
        if robot.path is None:
            raise DescriptorError(f"{robot.name} has no file to write to")
        self.path = robot.path
        self._variant, self._backend, self._keys, self._joint = robot.variant, backend, keys, joint
        self.before = self.path.read_text(encoding="utf-8")
        self._tree = _yaml().load(self.before)
        self._joint_item = self._find(["joints"], "name", joint.name)
        self._drive_item = self._find(["backends", backend, keys.items], "axis", joint.axis)

    def changed(self, changes: Sequence[Change]) -> str:
        """Return the text with ``changes``."""
        for change in changes:
            item = self._joint_item if change.place is Place.JOINT else self._drive_item
            if change.key == self._keys.window_object:
                _set_startup(item, change.key, change.value)
            else:
                item[change.key] = _flow(change.value)
        text = io.StringIO()
        _yaml().dump(self._tree, text)
        return text.getvalue()

    def difference(self, text: str) -> str:
        """Return the unified diff from the file to ``text``."""
        lines = difflib.unified_diff(
            self.before.splitlines(keepends=True),
            text.splitlines(keepends=True),
            str(self.path),
            f"{self.path} (new)",
            n=1,
        )
        return "".join(lines)

    def save(self, text: str, check: Callable[[Path], object]) -> None:
        """Replace the file by ``text`` at once, after ``check`` of a copy beside it.

        Raises what ``check`` raises, and DescriptorError where the folder cannot be written; the
        file is unchanged then.
        """
        copy = self.path.with_name(f".{self.path.stem}.new.yaml")
        try:
            copy.write_text(text, encoding="utf-8")
            copy.chmod(self.path.stat().st_mode)
            check(copy)
            copy.replace(self.path)
        except OSError as error:
            raise DescriptorError(f"cannot be written: {error.strerror}", path=self.path) from None
        finally:
            copy.unlink(missing_ok=True)

    def _find(self, keys: list[str], name: str, value: Any) -> Any:
        """Return the item of a list in this file whose ``name`` is ``value``."""
        for prefix in [["variants", self._variant], []] if self._variant else [[]]:
            node = self._tree
            for key in (*prefix, *keys):
                node = node.get(key) if isinstance(node, Mapping) else None
            for item in node or ():
                if item.get(name) == value:
                    return item
        where = ".".join(keys)
        what = (
            f"has no item with {name}: {value} in this file, but in one that it extends: copy the"
            " list into this file, which keeps what this machine needs"
        )
        raise DescriptorError(what, path=self.path, key=where)


def _set_startup(item: Any, name: str, value: int) -> None:
    """Set the start-up object ``name`` to ``value``."""
    startup = item.get("startup")
    if startup is None:
        startup = item["startup"] = CommentedSeq()
        startup.fa.set_flow_style()
    for write in startup:
        if str(write.get("object")).lower() == name.lower():
            write["value"] = value
            return
    startup.append(_flow({"object": name, "value": value}))


def _flow(value: Any) -> Any:
    """Return ``value`` for YAML; a mapping on one line."""
    if not isinstance(value, Mapping):
        return value
    mapping = CommentedMap(value)
    mapping.fa.set_flow_style()
    return mapping


def _yaml() -> YAML:
    yaml = YAML()
    yaml.width, yaml.preserve_quotes = MAX_LINE, True
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.representer.add_representer(
        type(None), lambda dumper, _: dumper.represent_scalar("tag:yaml.org,2002:null", "null")
    )
    return yaml
