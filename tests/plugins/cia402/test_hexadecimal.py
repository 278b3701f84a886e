"""Numbers in hexadecimal, where the reference of both fieldbuses promises them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import DescriptorError
from robotd.plugin.manager import load_backend

HEAD = """\
schema: 1
name: hexadecimal
axes: 1
backends:
"""
CANOPEN = """\
  canopen:
    bus: {interface: virtual}
    master_node: 0x7E
    axes:
      - axis: 0
        node: 0x0B
        counts_per_rad: 1000.0
        identity: {vendor_id: 0x29C, product_code: 0xFFFFFFFF, revision: 0X10001, serial: 0xab}
        startup: [{object: 0x6085, value: 0x3E8}, {object: "0x607C", value: -0x10}]
        tpdos: [{number: 1, cob_id: 0x18B, objects: [0x6041, 0x6061, 0x6064]}]
"""
ETHERCAT = """\
  ethercat:
    interface: eth7
    axes:
      - axis: 0
        slave: 0
        alias: 0x3E9
        counts_per_rad: 1000.0
        identity: {vendor_id: 0x29C, product_code: 0xFFFFFFFF}
        startup: [{object: 0x6085, value: 0x3E8}]
        rx_pdos: [{index: 0x1600, objects: [0x6040, 0x6060, 0x607A, 0x60FF]}]
"""


def options(folder: Path, backend: str, section: str, *overrides: str) -> Any:
    path = folder / "robot.yaml"
    path.write_text(HEAD + section, encoding="utf-8")
    robot = load_robot_descriptor(
        path, overrides=[parse_override(override) for override in overrides]
    )
    return load_backend(backend).context(robot).options.options


def test_canopen(tmp_path: Path) -> None:
    section = options(tmp_path, "canopen", CANOPEN)
    (axis,) = section.axes
    identity = axis.identity
    assert (section.master_node, axis.node, axis.tpdos[0].cob_id) == (126, 11, 0x18B)
    assert (identity.vendor_id, identity.product_code) == (0x29C, 0xFFFF_FFFF)
    assert (identity.revision, identity.serial) == (0x10001, 0xAB)
    assert [write.value for write in axis.startup] == [1000, -16]


def test_ethercat(tmp_path: Path) -> None:
    (axis,) = options(tmp_path, "ethercat", ETHERCAT).axes
    assert (axis.alias, axis.identity.vendor_id) == (1001, 0x29C)
    assert (axis.startup[0].value, axis.rx_pdos[0].index) == (1000, 0x1600)


def test_on_the_command_line(tmp_path: Path) -> None:
    key = "backends.canopen.axes.0"
    set_ = [f"{key}.node=0x0C", f"{key}.identity.vendor_id=0x1", f"{key}.tpdos.0.cob_id=0x18c"]
    (axis,) = options(tmp_path, "canopen", CANOPEN, *set_).axes
    assert (axis.node, axis.identity.vendor_id, axis.tpdos[0].cob_id) == (12, 1, 0x18C)


@pytest.mark.parametrize("number", ["0x", "0xG", "0x1_0", "0x123456789", "29C"])
def test_what_is_no_number_is_an_error(tmp_path: Path, number: str) -> None:
    with pytest.raises(DescriptorError, match=r"axes\.0\.identity\.vendor_id"):
        options(tmp_path, "canopen", CANOPEN.replace("0x29C", number))


@pytest.mark.parametrize("node", ["0x00", "0x80"])
def test_limits_hold(tmp_path: Path, node: str) -> None:
    with pytest.raises(DescriptorError, match=r"axes\.0\.node"):
        options(tmp_path, "canopen", CANOPEN.replace("0x0B", node))
