"""Parameter files and dumps: what is in force, of every axis, after each change."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from robotd.api import Capability, DescriptorError, NotReady
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.test_connection import _parameters
from robotd_conformance.checks.test_scaling import COUNTS, TURN
from robotd_wmx_parameters import WmxParameters, write_wmx_parameters

LITTLE = 2e-4  # a difference that the file shows
# Some change what a position means, which needs this one too.
pytestmark = pytest.mark.needs(Capability.SCALING)


def dumps(harness: Harness) -> list[str]:
    """Return the parameters in force, by axis."""
    return [harness.drivers.device.dump_parameters(axis) for axis in harness.all]


def assert_changed(before: list[str], after: list[str], axes: list[int], what: str) -> None:
    """Fail unless the dumps of ``axes`` alone differ."""
    changed = [axis for axis, text in enumerate(after) if text != before[axis]]
    assert changed == axes, f"{what}: the dumps of axes {changed} have changed, not of {axes}"


def write(parameters: WmxParameters, path: Path, **values: dict[int, Any]) -> Path:
    """Write ``parameters`` to ``path``, with ``values`` by name and axis."""
    write_wmx_parameters(parameters.with_values(values), path)
    return path


def turned_polarity(harness: Harness, own: WmxParameters) -> dict[int, int]:
    """Return the other polarity of every axis."""
    return {axis: -int(own["AxisPolarity"][axis]) for axis in harness.all}


def new_values(harness: Harness, own: WmxParameters) -> dict[str, dict[int, Any]]:
    """Return new values of every axis, of each part of a file that every device keeps."""
    names = ("InPosWidth", "HomingVelSlow", "QuickStopDec")
    values = {name: {axis: 2.5 + axis for axis in harness.all} for name in names}
    return {**values, "AxisPolarity": turned_polarity(harness, own)}


def require_files(harness: Harness) -> None:
    """Skip the check where there are no parameter files, or none may be loaded."""
    if not harness.can(Capability.PARAMETERS_FILE):
        pytest.skip("the device takes no parameter file")
    harness.require_rescaling()


@pytest.mark.clause("DeviceDriver.dump_parameters/text", "DeviceDriver.dump_parameters/scale")
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts", "AxisDriver.set_polarity/sets")
def test_a_dump_shows_what_is_changed_at_run_time(rescalable: Harness) -> None:
    require_files(rescalable)
    driver = rescalable.drivers.axes
    for axis in rescalable.all:
        driver.set_polarity(axis, 1)
        driver.set_gear_ratio(axis, COUNTS, TURN)
    plain = dumps(rescalable)
    for axis in reversed(rescalable.all):
        driver.set_polarity(axis, -1)
        assert_changed(plain, dumps(rescalable), [axis], f"polarity of axis {axis}")
        driver.set_polarity(axis, 1)
        driver.set_gear_ratio(axis, 3.0 * COUNTS, TURN)
        assert_changed(plain, dumps(rescalable), [axis], f"gear ratio of axis {axis}")
        driver.set_gear_ratio(axis, COUNTS, TURN)
        assert_changed(plain, dumps(rescalable), [], f"both of axis {axis} as before")


@pytest.mark.clause("DeviceDriver.load_parameters/applies", "DeviceDriver.dump_parameters/text")
@pytest.mark.clause("DeviceDriver.load_parameters/kept", "DeviceDriver.dump_parameters/scale")
def test_each_load_is_in_force_also_after_communication_stopped(
    disabled: Harness, tmp_path: Path
) -> None:
    """Two files in turn, that differ in the last axis; then a stop, and a start."""
    require_files(disabled)
    device, last = disabled.drivers.device, disabled.count - 1
    own = _parameters(disabled)
    hard = write(own, tmp_path / "hard.xml", QuickStopDec={last: 21.5})
    soft = write(own, tmp_path / "soft.xml", QuickStopDec={last: 3.25})
    device.load_parameters(hard)
    first = dumps(disabled)
    device.load_parameters(soft)
    second = dumps(disabled)
    assert_changed(first, second, [last], "the second file")
    device.load_parameters(hard)
    assert_changed(first, dumps(disabled), [], "the first file again")
    device.load_parameters(soft)
    disabled.drivers.axes.set_polarity(last, -int(own["AxisPolarity"][last]))
    turned = dumps(disabled)
    assert_changed(second, turned, [last], "polarity of the last axis")
    disabled.drivers.axes.set_polarity(last, int(own["AxisPolarity"][last]))
    assert_changed(second, dumps(disabled), [], "the polarity as before")
    nearly = write(own, tmp_path / "nearly.xml", QuickStopDec={last: 3.25 + LITTLE})
    device.load_parameters(nearly)
    assert_changed(second, dumps(disabled), [last], f"a ramp that is {LITTLE} rad/s² higher")
    device.load_parameters(soft)
    disabled.drivers.axes.set_polarity(last, -int(own["AxisPolarity"][last]))
    for _ in range(2):
        device.stop_communication(10.0)
        device.start_communication(10.0)
        assert_changed(turned, dumps(disabled), [], "communication that was stopped and started")


@pytest.mark.clause("DeviceDriver.load_parameters/kept", "DeviceDriver.close/disconnects")
def test_a_file_is_in_force_until_the_device_is_closed(disabled: Harness, tmp_path: Path) -> None:
    """A device that is opened again has what it had before any file, in each of two rounds."""
    require_files(disabled)
    device, own = disabled.drivers.device, _parameters(disabled)
    ramps = {axis: 21.5 + axis for axis in disabled.all}
    turned = turned_polarity(disabled, own)
    path = write(own, tmp_path / "file.xml", QuickStopDec=ramps, AxisPolarity=turned)
    device.close()
    device.open()
    before = dumps(disabled)
    for _ in range(2):
        device.load_parameters(path)
        assert_changed(before, dumps(disabled), disabled.all, "the file")
        device.close()
        device.open()
        assert_changed(before, dumps(disabled), [], "a device that was closed and opened again")


@pytest.mark.clause("DeviceDriver.load_parameters/applies", "DeviceDriver.load_parameters/live")
@pytest.mark.clause("DeviceDriver.load_parameters/named")
def test_a_load_that_one_axis_forbids_changes_no_other(rescalable: Harness, tmp_path: Path) -> None:
    """Another scale and more of every axis, while the last or first is on; then none."""
    require_files(rescalable)
    device, own = rescalable.drivers.device, _parameters(rescalable)
    turned = write(own, tmp_path / "turned.xml", **new_values(rescalable, own))
    device.load_parameters(write(own, tmp_path / "own.xml"))
    rescalable.periods(5)
    before, position = dumps(rescalable), rescalable.image.position.copy()
    for live in {rescalable.count - 1, 0}:
        rescalable.robot.axes.servo(live, True)
        with pytest.raises(NotReady, match=rf"\b{live}\b"):
            device.load_parameters(turned)
        assert_changed(before, dumps(rescalable), [], f"a file rejected for axis {live}")
        rescalable.periods(5)
        assert rescalable.image.position == pytest.approx(position, abs=SETTLED_RAD)
        assert rescalable.image.servo_on[live]
        rescalable.disable()
    device.load_parameters(turned)
    assert_changed(before, dumps(rescalable), rescalable.all, "the file with all servos off")
    rescalable.periods(5)
    assert rescalable.image.position == pytest.approx(-position, abs=SETTLED_RAD)


@pytest.mark.clause(
    "DeviceDriver.load_parameters/wrong-file", "DeviceDriver.load_parameters/applies"
)
def test_a_wrong_value_of_the_last_axis_changes_no_axis(disabled: Harness, tmp_path: Path) -> None:
    require_files(disabled)
    device, own = disabled.drivers.device, _parameters(disabled)
    values = new_values(disabled, own)
    path = write(own, tmp_path / "wrong.xml", **values)
    text, name = path.read_text(encoding="utf-8"), "QuickStopDec"
    mark = f"<{name}>{values[name][disabled.count - 1]:.6f}<"
    assert mark in text
    path.write_text(text.replace(mark, f"<{name}>fast<"), encoding="utf-8")
    before = dumps(disabled)
    with pytest.raises(DescriptorError):
        device.load_parameters(path)
    assert_changed(before, dumps(disabled), [], "a file with a wrong value")
    path.write_text(text, encoding="utf-8")
    device.load_parameters(path)
    assert_changed(before, dumps(disabled), disabled.all, "the file with the value mended")


@pytest.mark.clause("DeviceDriver.load_parameters/wrong-file")
@pytest.mark.clause("DeviceDriver.load_parameters/applies")
def test_a_file_without_axes_of_the_robot_changes_no_axis(
    disabled: Harness, tmp_path: Path
) -> None:
    """The last axes are missing; what the file says of the others is new."""
    require_files(disabled)
    device, own, path = disabled.drivers.device, _parameters(disabled), tmp_path / "short.xml"
    lacking = disabled.all[-2:] if disabled.count > 2 else disabled.all[-1:]
    text = write(own, path, **new_values(disabled, own)).read_text(encoding="utf-8")
    start, end = text.index(f'<AxisParameters Axis="{lacking[0]}"'), text.index("</Parameters>")
    path.write_text(text[:start] + text[end:], encoding="utf-8")
    before = dumps(disabled)
    with pytest.raises(DescriptorError) as rejected:
        device.load_parameters(path)
    said = str(rejected.value).replace(str(path), "")
    for axis in {lacking[0], lacking[-1]}:
        assert re.search(rf"\b{axis}\b", said), f"axis {axis} is missing, not named in: {said}"
    assert_changed(before, dumps(disabled), [], f"a file without axes {lacking}")


@pytest.mark.clause("DeviceDriver.load_parameters/note")
def test_a_note_says_what_a_file_leaves_out(disabled: Harness, tmp_path: Path) -> None:
    """None for a whole file, then something for one without an element, then none again."""
    require_files(disabled)
    device, path = disabled.drivers.device, tmp_path / "parameters.xml"
    own = _parameters(disabled)
    whole = write(own, path).read_text(encoding="utf-8")
    for left_out in (False, True, False):
        lines = whole.splitlines(keepends=True)
        kept = [line for line in lines if not left_out or "<QuickStopDec>" not in line]
        path.write_text("".join(kept), encoding="utf-8")
        note = device.load_parameters(path)
        assert isinstance(note, str), f"a note is a text, not {note!r}"
        assert bool(note.strip()) is left_out, f"the note is {note!r}"
