"""Import cycles: no module imports itself through others, in the core or in a backend."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

import grimp
import pytest

PACKAGES = (
    "robotd",
    "robotd_canopen",
    "robotd_cia402",
    "robotd_servo_model",
    "robotd_sim",
    "robotd_wmx_commands",
    "robotd_wmx_parameters",
)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_import_cycle(package: str) -> None:
    graph = grimp.build_graph(package)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))
