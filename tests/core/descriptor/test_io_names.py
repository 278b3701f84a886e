"""Named inputs and outputs of a descriptor."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.core.descriptor.test_load import rejection, write
from tests.core.device.harness import Harness
from tests.fakes import FakeIo

from robotd.descriptor import load_robot_descriptor
from robotd.device.io import Io, check_names
from robotd.errors import DescriptorError

ROBOT = "schema: 1\nname: arm\naxes: 1\n"
WORD = "must begin with a letter and hold only letters, digits and _"
RANGE = "must be byte.bit, 0.0 to 7999.7, such as 0.3"


def test_a_name_stands_for_byte_and_bit(tmp_path: Path) -> None:
    path = write(tmp_path, "arm", f"{ROBOT}inputs: {{a: 0.3, b: 10.0, c: '7999.7'}}\n")
    descriptor = load_robot_descriptor(path)
    assert descriptor.inputs == {"a": (0, 3), "b": (10, 0), "c": (7999, 7)}
    assert str(descriptor.inputs["b"]) == "10.0"
    assert descriptor.outputs == {}


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("a: 0.8", f"inputs.a: {RANGE} (value 0.8)"),
        ("a: 3", f"inputs.a: {RANGE} (value 3)"),
        ("a: 8000.0", f"inputs.a: {RANGE} (value 8000.0)"),
        ("a: {byte: 0}", f"inputs.a: {RANGE} (value {{'byte': 0}})"),
        ("part-present: 0.3", f"inputs.part-present: {WORD} (value 'part-present')"),
    ],
)
def test_a_wrong_name_or_address_is_reported_with_its_line(
    tmp_path: Path, line: str, problem: str
) -> None:
    assert rejection(tmp_path, f"{ROBOT}inputs:\n  {line}\n") == [f"5: {problem}"]


def test_a_bit_has_one_name(tmp_path: Path) -> None:
    text = f"{ROBOT}inputs: {{a: 0.3}}\noutputs:\n  a: 0.3\n  b: 1.0\n  c: 0.3\n"
    assert rejection(tmp_path, text) == ["8: outputs.c: used before, by outputs.a (value '0.3')"]


def test_an_output_of_the_gripper_has_no_second_name(tmp_path: Path) -> None:
    gripper = "gripper: {output_byte: 0, output_bit: 1, joints: [f], open_m: 0.0, closed_m: 0.1}"
    text = f"{ROBOT}{gripper}\noutputs: {{valve: 0.1}}\ninputs: {{valve: 0.1}}\n"
    assert rejection(tmp_path, text) == [
        "5: outputs.valve: is the output of the gripper (value '0.1')"
    ]


def test_a_bit_that_the_device_does_not_have_is_reported_with_its_line(tmp_path: Path) -> None:
    text = f"{ROBOT}inputs:\n  a: 7.3\n  c: 8.0\noutputs:\n  b: 0.1\n"
    descriptor = load_robot_descriptor(path := write(tmp_path, "arm", text))
    connection, names = Harness().connection, (descriptor.inputs, descriptor.outputs)
    with pytest.raises(DescriptorError) as caught:
        check_names(descriptor, Io(FakeIo(8, 0), connection, "fake", None, *names))
    assert str(caught.value) == (
        f"{path}:6: inputs.c: 8.0 is outside the image of inputs: the last byte is 7\n"
        f"{path}:8: outputs.b: 0.1 is outside the image of outputs: the device has no outputs"
    )
    check_names(descriptor, Io(FakeIo(9, 1), connection, "fake", None, *names))
