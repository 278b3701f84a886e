"""Simulated slaves in a process of their own, and pysoem as their master."""

from __future__ import annotations

from collections.abc import Iterator

import pysoem
import pytest

from robotd_ethercat.bus_namespace import missing_rights, run_in_namespace
from robotd_ethercat.slaves_process import SlavesProcess


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    reason = missing_rights()
    for item in items if reason is not None else []:
        if "tests/plugins/ethercat/bus" in str(item.path):
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="module")
def generic_process() -> Iterator[SlavesProcess]:
    """Three generic slaves."""
    with SlavesProcess(["--generic", "3"]) as slaves:
        yield slaves


@pytest.fixture
def generic_slaves(generic_process: SlavesProcess) -> SlavesProcess:
    """Three generic slaves without faults, just switched on."""
    for slave in range(3):
        generic_process.inject(f"{slave} heal")
        generic_process.inject(f"{slave} off")
        generic_process.inject(f"{slave} on")
    return generic_process


@pytest.fixture
def opened(generic_slaves: SlavesProcess) -> Iterator[pysoem.Master]:
    """Master on the bus of ``generic_slaves``."""
    master = pysoem.Master()
    run_in_namespace(generic_slaves.namespace, lambda: master.open(generic_slaves.interface))
    yield master
    master.close()
