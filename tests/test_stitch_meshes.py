"""Yarns of stitch meshes, against coordinates that are found by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile_file import make_file_yarns
from spacemap_vtk.filters.textile_source import TextileSource
from spacemap_vtk.io.yarns.stitch_faces import barycentric_coordinates, read_smobj

#: A square of side 2 with a yarn from its left to its right side, and one from below to above.
LIBRARY = """
face cross
    edge (-1.0,-1.0) -l1   # below
    edge ( 1.0,-1.0) +y1
    edge ( 1.0, 1.0) +l1
    edge (-1.0, 1.0) -y1
    yarn [3:0.75,0.1] (-0.5,0.5,0.3) (0.5,-0.5,0.3) [1:0.25,0.1]
    yarn [0:0.5,0] (0,0,-0.4) [2:0.5,0]
derive across -l1 -y1 +l1 +y1 by mirror-x from cross -l1 +y1 +l1 -y1
derive under -l1 +y1 +l1 -y1 by mirror-z from cross -l1 +y1 +l1 -y1
"""
#: Two squares of side 4 beside each other in the plane of x and z, joined at z from 0 to 4.
MESH = """
L cross -l1 +y1 +l1 -y1
v 0 0 0
v 4 0 0
v 4 0 4
v 0 0 4
v 8 0 0
v 8 0 4
f 1 2 3 4
T 1
f 2 5 6 3
T 1
e 1/2 2/-4
"""


def write(folder: Path, mesh: str = MESH, library: str = LIBRARY) -> Path:
    (folder / "faces.sf").write_text(library)
    (folder / "a.smobj").write_text(mesh)
    return folder / "a.smobj"


def middles(points: list[tuple[float, float, float]]) -> np.ndarray:
    return (np.array(points[1:]) + np.array(points[:-1])) / 2


def test_yarns_run_through_joined_faces_in_the_scale_of_the_mesh(tmp_path):
    found = read_smobj(write(tmp_path))
    assert [curve.diameter for curve in found.curves] == pytest.approx([0.4] * 3)
    # x and z are twice those of the library, from a corner; the normal is (0, -1, 0)
    face = [(0, -0.2, 1), (1, -0.6, 3), (3, -0.6, 1), (4, -0.2, 1)]
    second = [(x + 4, y, z) for x, y, z in face[1:]]
    nodes = found.curves[0].nodes
    np.testing.assert_allclose(nodes[[0, -1]], [face[0], second[-1]], atol=1e-12)
    # the yarn passes the middles of the pieces between its points
    np.testing.assert_allclose(nodes[1::2], middles([*face, *second]), atol=1e-12)
    for curve, x in zip(found.curves[1:], (2, 6), strict=True):
        expected = middles([(x, 0, 0), (x, 0.8, 2), (x, 0, 4)])
        np.testing.assert_allclose(curve.nodes[1::2], expected, atol=1e-12)
    assert found.unit is None


def test_derived_faces_are_mirrored(tmp_path):
    given, across, under = (
        read_smobj(write(tmp_path, MESH.replace("cross -l1 +y1 +l1 -y1", name))).curves[0].nodes
        for name in ("cross -l1 +y1 +l1 -y1", "across -l1 -y1 +l1 +y1", "under -l1 +y1 +l1 -y1")
    )
    np.testing.assert_allclose(under, given * [1, -1, 1], atol=1e-12)
    own = across if across[0, 0] < across[-1, 0] else across[::-1]
    np.testing.assert_allclose(own, (given * [-1, 1, 1] + [8, 0, 0])[::-1], atol=1e-12)


def test_a_joint_may_turn_a_face(tmp_path):
    # the second face is entered from its right side, upside down: places along edges are the same
    turned = MESH.replace("f 2 5 6 3", "f 6 3 2 5").replace("e 1/2 2/-4", "e 1/2 2/-2")
    found = read_smobj(write(tmp_path, turned))
    assert len(found.curves) == 4  # at another height above the edge: the yarn ends there
    straight = LIBRARY.replace("3:0.75,0.1", "3:0.5,0.1").replace("1:0.25,0.1", "1:0.5,0.1")
    assert len(read_smobj(write(tmp_path, turned, straight)).curves) == 3


@pytest.mark.parametrize("count", [3, 4, 5, 7])
def test_coordinates_in_a_polygon_give_back_its_points(count):
    random = np.random.default_rng(count)
    angles = np.sort(2 * np.pi * (np.arange(count) + 0.7 * random.random(count)) / count)
    corners = np.column_stack([2 * np.cos(angles), np.sin(angles)])
    inside = random.dirichlet(np.ones(count), 20)
    shares = barycentric_coordinates(corners, inside @ corners)
    np.testing.assert_allclose(shares @ corners, inside @ corners, atol=1e-12)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert (shares > 0).all()


def test_a_stitch_mesh_is_a_textile(tmp_path):
    source = TextileSource(kind="file", file=write(tmp_path), unit="1 mm")
    assert source.update().output.GetNumberOfCells() > 0
    np.testing.assert_allclose(source.yarn_diameters, 4e-4)


def test_faces_without_yarns_are_reported(tmp_path):
    mesh = MESH.replace("v 0 0 0", "L drop -l1 x +l0 x\nv 0 0 0").replace("T 1\ne", "T 2\ne")
    (note,) = read_smobj(write(tmp_path, mesh)).notes
    assert "1 of 2 faces" in note
    assert "drop -l1 x +l0 x" in note


def test_stitch_meshes_that_are_not_whole_are_refused(tmp_path):
    file = write(tmp_path)
    (tmp_path / "b.sf").write_text(LIBRARY)
    with pytest.raises(InputError, match=r"faces\.sf.*Set textile\.library"):
        read_smobj(file)
    assert len(read_smobj(file, tmp_path / "b.sf").curves) == 3
    (tmp_path / "b.sf").unlink()
    for mesh, library, why in (
        (MESH.replace("T 1\ne", "e"), LIBRARY, "each face needs"),
        (MESH.replace("f 1 2", "f 9 2"), LIBRARY, "each face needs"),
        (MESH.replace("e 1/2", "e 1"), LIBRARY, 'line 13, "e 1 2/-4"'),
        (MESH.replace("f 1 2 3 4", "f 1 2 3"), LIBRARY, "face 1 has 3 edges"),
        (MESH, LIBRARY.replace("face cross", "face knit").partition("derive")[0], "no face"),
        (MESH, LIBRARY.replace("mirror-x", "mirror-y"), "by mirror-x"),
        (MESH, LIBRARY.replace("[3:", "[4:"), "has 4 edges"),
        (MESH, LIBRARY.replace("yarn", "wool"), "not a line of a library"),
    ):
        with pytest.raises(InputError, match=why):
            read_smobj(write(tmp_path, mesh, library))
    (tmp_path / "a.csv").write_text("yarn,x,y,z\n0,1,2,3\n0,2,2,3\n")
    with pytest.raises(InputError, match="only a stitch mesh"):
        make_file_yarns(tmp_path / "a.csv", library=tmp_path / "faces.sf")
