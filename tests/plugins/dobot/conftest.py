"""The backend dobot on the stand-in of its controller."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.plugins.serial_servo.kit_parts import install

BACKEND = "dobot_stand_in"


@pytest.fixture(scope="module")
def backend(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Name of the backend, installed for this process and those that it starts."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("installed")
        yield install(folder, patch, BACKEND, "tests.plugins.dobot.stand_in_backend")
