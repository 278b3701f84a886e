"""URDF for MuJoCo: mends, or logs, what its importer loses or refuses.

The importer drops visual geometry and fuses links with fixed joints by default. It
knows no ``package://``, reads no COLLADA, and refuses moving links without mass.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
from lxml import etree

from robotd.api import (
    DescriptorError,
    UrdfRobot,
    find_mesh,
    get_logger,
    read_urdf,
    read_urdf_text,
)

MESH_SUFFIXES = (".stl", ".obj")
LIGHT_KG, LIGHT_KG_M2 = 1e-3, 1e-6  # of a moving link that has no mass in the file

log = get_logger("mujoco")


def import_urdf(path: Path) -> mujoco.MjSpec:
    """Return the robot of a URDF file.

    Raises DescriptorError: the file is wrong, or MuJoCo does not take it.
    """
    robot = read_urdf(path)  # reports every error with its line
    root = etree.fromstring(read_urdf_text(path).encode())
    notes = [*_hold_joints(root, robot), *_resolve_meshes(root, path), *_add_masses(root)]
    if any(joint.find("safety_controller") is not None for joint in root.iterfind("joint")):
        notes.append("safety controllers are not simulated")
    for note in notes:
        log.warning("URDF import", note=note)
    etree.SubElement(
        etree.SubElement(root, "mujoco"),
        "compiler",
        discardvisual="false",
        fusestatic="false",
        strippath="false",
        balanceinertia="true",
    )
    try:
        return mujoco.MjSpec.from_string(etree.tostring(root).decode())
    except ValueError as error:
        raise DescriptorError(f"MuJoCo does not read it: {error}", path=path) from error


def _hold_joints(root: Any, robot: UrdfRobot) -> list[str]:
    """Fix what no axis moves, as all of robotd reads it. Return which."""
    held = [
        joint
        for joint in root.iterfind("joint")
        if joint.get("type") != "fixed" and not robot.joint[joint.get("name")].moves
    ]
    for joint in held:
        joint.set("type", "fixed")
    names = ", ".join(str(joint.get("name")) for joint in held)
    return [f"joints that no axis moves are fixed: {names}"] if held else []


def _resolve_meshes(root: Any, path: Path) -> list[str]:
    """Name each mesh by its file, or leave it out; return what is lost."""
    notes = []
    for kind in ("visual", "collision"):
        for element in root.iterfind(f".//{kind}"):
            mesh = element.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = find_mesh(name, path)
            if file is not None and file.suffix.lower() in MESH_SUFFIXES:
                mesh.set("filename", str(file.resolve()))
                continue
            why = "is not found" if file is None else "is neither STL nor OBJ"
            link = element.getparent().get("name")
            notes.append(f"mesh {name} {why}: {link} is without this {kind} geometry")
            element.getparent().remove(element)
    return notes


def _add_masses(root: Any) -> list[str]:
    """Give moving links without mass a small one. Return which."""
    moving = {
        joint.find("child").get("link")
        for joint in root.iterfind("joint")
        if joint.get("type") != "fixed"
    }
    light = [
        link
        for link in root.iterfind("link")
        if link.get("name") in moving and link.find("inertial") is None
    ]
    for link in light:
        inertial = etree.SubElement(link, "inertial")
        etree.SubElement(inertial, "mass", value=str(LIGHT_KG))
        moments = dict.fromkeys(("ixx", "iyy", "izz"), str(LIGHT_KG_M2))
        products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        etree.SubElement(inertial, "inertia", moments | products)
    names = ", ".join(str(link.get("name")) for link in light)
    return [f"links without mass weigh {LIGHT_KG * 1000:g} g: {names}"] if light else []
