"""Names of meshes in a URDF that is written to another place."""

from __future__ import annotations

from pathlib import Path

from robotd.api.models import mesh_files
from robotd_shared.mesh_files import moved_mesh_names


def test_meshes_that_are_lost_in_another_place_get_urls(tmp_path: Path) -> None:
    (tmp_path / "arm_meshes").mkdir()
    for name in ("a.stl", "arm_meshes/b.stl"):
        (tmp_path / name).write_bytes(b"solid")
    names = ("a.stl", "package://arm_meshes/b.stl", "gone.stl")
    meshes = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in names
    )
    path = tmp_path / "arm.urdf"
    files = mesh_files(f'<robot><link name="base">{meshes}</link></robot>', path)
    assert moved_mesh_names(files, tmp_path / "other.urdf") == {}
    assert moved_mesh_names(files, None) == {
        names[0]: (tmp_path / "a.stl").as_uri(),
        names[1]: (tmp_path / "arm_meshes" / "b.stl").as_uri(),
    }
