"""Finished commissioning steps, kept in a file beside the robot's, to be resumed."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from robotd.api import DescriptorError
from robotd.api.models import is_file, read_limited

MAX_BYTES = 1_000_000


class _Content(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    joints: dict[str, dict[str, str]] = {}  # joint → step → finding


class CommissionRecord:
    """Findings by joint and step. One thread.

    Args:
        robot: the robot's file; the record is ``<name>.commission.json`` beside it.

    Raises:
        DescriptorError: the file is there and is no record.
    """

    def __init__(self, robot: Path) -> None:
        self.path = robot.with_name(f"{robot.stem}.commission.json")
        self._content = _Content()
        if is_file(self.path):
            try:
                data = read_limited(self.path, MAX_BYTES)
                self._content = _Content.model_validate_json(data)
            except ValidationError as error:
                what = f"is no record of a commissioning: {error.errors()[0]['msg']}; delete it"
                raise DescriptorError(what, path=self.path) from None

    def finding(self, joint: str, step: str) -> str | None:
        """Return the finding of a finished step; None of an open one."""
        return self._content.joints.get(joint, {}).get(step)

    def note(self, joint: str, step: str, text: str) -> None:
        """Keep a finding, in the file too. Raises DescriptorError: it cannot be written."""
        self._content.joints.setdefault(joint, {})[step] = text
        self._save()

    def forget(self, joint: str) -> None:
        """Open all steps of a joint again."""
        if self._content.joints.pop(joint, None) is not None:
            self._save()

    def _save(self) -> None:
        copy = self.path.with_name(f".{self.path.name}.new")
        try:
            copy.write_text(json.dumps(self._content.model_dump(), indent=2) + "\n", "utf-8")
            copy.replace(self.path)
        except OSError as error:
            raise DescriptorError(f"cannot be written: {error.strerror}", path=self.path) from None
