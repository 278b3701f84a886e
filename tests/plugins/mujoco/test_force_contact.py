"""A program presses the tool on the table, up to a force; MuJoCo's own data judge it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
from tests.plugins.mujoco.cell import LEFT_ABOVE, Cell, cell

from robotd import DescriptorError, OperationError, Unsupported
from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.events import EventKind
from robotd_teach.program_code import Program
from robotd_teach.program_run import NoContact
from robotd_teach.programs import Programs
from robotd_tool_space.geometry.rotations import pose_of
from robotd_tool_space.tool_groups import ToolGroups

ABOVE = (0.0, *LEFT_ABOVE[1:])  # no cube is below
LINK = "link6"
LIMIT_N = 10.0
PERIODS = 3  # of the control loop, until it is noticed
MAX_STOP_M = 1e-3


class Truth:
    """Force of the surroundings on link, fingers and what they hold, and height of the link."""

    def __init__(self, arm: Cell) -> None:
        self._physics = arm.physics
        model = self._physics.model
        self._link = model.body(LINK).id
        self._hand = {self._link}
        for body in range(model.nbody):  # parents come first
            if model.body_parentid[body] in self._hand:
                self._hand.add(body)
        self.samples: list[tuple[float, float]] = []  # N and m, of each control period
        rate_hz = arm.robot.descriptor.cycle.rate_hz
        arm.robot.control_loop.every(rate_hz, "truth", self._sample)

    def force(self) -> FloatArray:
        """Return the force (3,) in the scene, N."""
        model, data = self._physics.model, self._physics.data
        total, wrench = np.zeros(3), np.zeros(6)
        for number, contact in enumerate(data.contact):
            first, second = (int(model.geom_bodyid[geom]) in self._hand for geom in contact.geom)
            if first != second:
                mujoco.mj_contactForce(model, data, number, wrench)
                force = contact.frame.reshape(3, 3).T @ wrench[:3]  # of the first on the second
                total += force if second else -force
        return total

    def rotation(self) -> FloatArray:
        """Return that of the link in the scene (3, 3)."""
        return self._physics.data.xmat[self._link].reshape(3, 3)

    def height(self) -> float:
        """Return that of the link, m."""
        return float(self._physics.data.xpos[self._link][2])

    def _sample(self, image: ProcessImage) -> None:
        self.samples.append((float(np.linalg.norm(self.force())), self.height()))


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cell]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with cell() as arm:
        arm.go(ABOVE, 3.0)
        arm.grip(closed=True)
        yield arm


def line(until: str, z: float = -0.2, speed: float = 0.1) -> Program:
    move = f"{{by: {{z: {z}}}, speed: {speed}, until: {{{until}}}}}"
    return Program.parse(f"steps:\n  - line: {move}\n")


@pytest.mark.parametrize("speed", [0.05, 0.2])
def test_the_tool_stops_on_the_table_at_a_force(arm: Cell, speed: float) -> None:
    truth, programs = Truth(arm), arm.robot.feature(Programs)
    empty = arm.physics.wrenches()[0]
    programs.run(line(f"force_n: {LIMIT_N}", speed=speed))
    forces, heights = np.array(truth.samples).T
    assert forces[0] == 0.0
    touched = int(np.argmax(forces > LIMIT_N))
    found = programs.contact
    assert forces[touched] > LIMIT_N
    assert found is not None
    assert (found.step, found.contact.link, found.contact.unit) == (1, LINK, "N")
    assert found.contact.change > LIMIT_N
    # What is reported begins where the force was noticed: soon after it was there.
    assert heights[touched] - heights[touched:].min() < MAX_STOP_M
    late_m = PERIODS * float(np.abs(np.diff(heights)).max())
    assert found.stop.value == pytest.approx(heights[touched] - truth.height(), abs=late_m)
    arm.robot.step(500)
    assert np.abs(arm.physics.velocities()).max() < 1e-3
    change = truth.rotation() @ (arm.physics.wrenches()[0] - empty)[:3]
    assert change == pytest.approx(truth.force(), abs=0.3)
    assert truth.force()[2] > 1.0


def test_the_contact_is_data_in_the_recording(arm: Cell) -> None:
    arm.robot.feature(Programs).run(line("force_n: 10.0, torque_nm: 4.0"))
    events, _ = arm.robot.events.since(0)
    states = [event for event in events if event.kind is EventKind.STATE]
    (contact,) = [event.data["contact"] for event in states if "contact" in event.data]
    assert (contact["at"], contact["stop_unit"]) == (LINK, "m")
    assert 0.0 <= contact["stop"] < MAX_STOP_M


def test_a_way_without_a_contact_has_an_outcome_of_its_own(arm: Cell) -> None:
    programs = arm.robot.feature(Programs)
    with pytest.raises(NoContact, match="no contact: the force at link6 has changed by"):
        programs.run(line("force_n: 10", z=0.05))
    assert programs.contact is None


def test_a_wrench_beyond_its_limit_is_rejected_before_anything_moves(arm: Cell) -> None:
    programs, before = arm.robot.feature(Programs), arm.physics.data.qpos.copy()
    reason = r"in contact before the motion: the force at link6 is 6\.\d+ N, limit 5 N"
    with pytest.raises(OperationError, match=reason) as raised:  # the weight of link and fingers
        programs.run(line("force_n: 5, bias: false"))
    assert not isinstance(raised.value, NoContact)
    assert arm.physics.data.qpos == pytest.approx(before, abs=1e-6)


AXES = {  # along which the surface of the table presses on the tool, which points down
    "axis: z": "z of the base",
    "axis: +z, frame: base": r"\+z of the base",
    "axis: -z, frame: tool": "-z of the tool",
}


@pytest.mark.parametrize("axis", AXES)
def test_the_tool_stops_at_a_force_along_one_axis(arm: Cell, axis: str) -> None:
    arm.go((0.7, *ABOVE[1:]), 3.0)  # the axes of base, tool and link differ
    truth, programs = Truth(arm), arm.robot.feature(Programs)
    programs.run(line(f"force_n: {LIMIT_N}, {axis}"))
    assert programs.contact is not None
    assert programs.contact.contact.change > LIMIT_N
    assert max(force for force, _ in truth.samples) > LIMIT_N
    events, _ = arm.robot.events.since(0)
    assert any(
        re.search(f"the force at link6 along {AXES[axis]} has changed by", event.text)
        for event in events
    )


def test_an_axis_is_one_of_the_work_frame(arm: Cell) -> None:
    """Its y axis is down."""
    programs, weight = arm.robot.feature(Programs), "force_n: 4, bias: false"
    arm.robot.feature(ToolGroups).of().set_work_frame(pose_of([0.0] * 3, [-np.pi / 2, 0.0, 0.0]))
    with pytest.raises(OperationError, match=r"\+y of work frame custom_frame is 6\.\d+ N, "):
        programs.run(line(f"{weight}, axis: +y"))
    for other in ("-y", "x", "z"):
        with pytest.raises(NoContact):
            programs.run(line(f"{weight}, axis: {other}", z=0.002))


def test_an_axis_of_the_base_does_not_turn_with_the_tool(arm: Cell) -> None:
    arm.go((0.7, *ABOVE[1:3], ABOVE[3] + 0.4, ABOVE[4] - 0.7, 0.9), 3.0)
    rotation = Truth(arm).rotation()
    assert np.abs(rotation @ rotation - np.eye(3)).max() > 0.3, "it differs from its inverse"
    programs, limit = arm.robot.feature(Programs), "force_n: 5.8, bias: false"
    with pytest.raises(OperationError, match=r"along -z of the base is 6\.\d+ N"):
        programs.run(line(f"{limit}, axis: -z"))
    for other in ("+z", "x", "y"):
        with pytest.raises(NoContact):
            programs.run(line(f"{limit}, axis: {other}", z=0.01))


@pytest.mark.parametrize(
    ("weight", "others"),
    [
        ("axis: -z", ("axis: +z", "axis: x", "axis: y")),
        ("axis: +z, frame: tool", ("axis: -z, frame: tool", "axis: x, frame: tool")),
    ],
)
def test_the_weight_is_along_one_axis_and_sign(
    arm: Cell, weight: str, others: tuple[str, ...]
) -> None:
    programs, limit = arm.robot.feature(Programs), "force_n: 4, bias: false"
    with pytest.raises(OperationError, match=r"in contact before the motion: .* is 6\.\d+ N"):
        programs.run(line(f"{limit}, {weight}"))
    for other in others:
        with pytest.raises(NoContact):
            programs.run(line(f"{limit}, {other}", z=0.01))


@pytest.mark.parametrize(
    ("until", "reason"),
    [
        ("force_n: 0", r"until\.force_n.*must be greater than 0"),
        ("bias: true", r"until.*needs torque, or force_n and torque_nm or one of them"),
        ("torque: 5, force_n: 3", r"until.*needs torque, or force_n and torque_nm or one of them"),
        ("torque: 5, bias: false", r"until\.bias.*belongs to `force_n` and `torque_nm`"),
        ("torque: 5, axis: z", r"until\.axis.*belongs to `force_n` and `torque_nm`"),
        ("force_n: 5, frame: tool", r"until\.frame.*belongs to `axis`"),
        ("force_n: 5, axis: up", r"until\.axis.*'x', 'y', 'z'"),
    ],
)
def test_mistakes_are_named(until: str, reason: str) -> None:
    with pytest.raises(DescriptorError, match=reason):
        line(until)


def test_each_arm_has_its_sensor() -> None:
    with cell(robot="dual_cr3a", start=False) as arms:
        wrenches = arms.robot.wrenches
        links = [wrenches.of(group).link for group in arms.robot.groups]
        assert sorted(links) == sorted(wrenches)
        assert len(set(links)) == 2
        wrench = wrenches[links[0]].read()
        assert np.isnan(wrench.force).all()
        assert wrenches[links[0]].problem(wrench) == f"the wrench at {links[0]} is not known"
        with pytest.raises(OperationError, match="joint group"):
            wrenches.of("none")
    with cell(robot="baymax", start=False) as base, pytest.raises(Unsupported):
        base.robot.wrenches.of("joints")
