"""Ended by signals at moments at random; ``make kill`` does it a hundred times."""

from __future__ import annotations

import random
import signal
import time
from collections.abc import Iterator

import pytest
from tests.ros.robot_process import BACKEND, Client
from tools.endurance.lives import Lives, Phase

from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

LIVES = [
    (Phase.STARTING, signal.SIGINT),
    (Phase.STARTING, signal.SIGTERM),
    (Phase.STARTING, signal.SIGKILL),
    (Phase.MOVING, signal.SIGKILL),
    (Phase.STOPPING, signal.SIGKILL),
    (Phase.STOPPING, signal.SIGTERM),
]


@pytest.fixture
def client() -> Iterator[Client]:
    with own_domain() as domain:
        client = Client(domain)
        yield client
        client.close()


def test_whatever_the_end_the_next_one_starts(client: Client) -> None:
    seed = time.time_ns() % 10**6
    chance, lives = random.Random(seed), Lives(client, backend=BACKEND)
    for phase, number in [*LIVES, (Phase.IDLE, signal.SIGTERM)]:
        life = lives.live(phase, number, chance)
        assert not life.problem, f"seed {seed}: {life}"
