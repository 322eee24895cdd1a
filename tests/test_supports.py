"""Supports: the language, what they catch, and the modes that they leave."""

from __future__ import annotations

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import ModalSolver, TetraCage, WeaveSource
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.places import parse_places
from spacemap_vtk.mechanics.boundary.supports import (
    free_motions,
    held_components,
    held_directions,
    loose_sides,
    rigid_bodies,
    rigid_motions,
)

POINTS = build_lattice((0, 1, 0, 2, 0, 3), (2, 2, 2))[0]


def held_by(*supports, masks=None):
    return held_components(POINTS, supports, masks)


def all_components(where):
    return np.repeat(where[:, None], 3, axis=1)


def test_sides_hold_their_vertices():
    for axis, name in enumerate("xyz"):
        for sign, wall in (("-", 0.0), ("+", axis + 1.0)):
            np.testing.assert_array_equal(
                held_by(sign + name), all_components(POINTS[:, axis] == wall)
            )


def test_several_supports_hold_their_components():
    expected = np.zeros((27, 3), bool)
    expected[POINTS[:, 1] == 2] = True
    expected[np.ix_(POINTS[:, 0] == 0, [1, 2])] = True
    np.testing.assert_array_equal(held_by("+y", "-x:yz"), expected)
    np.testing.assert_array_equal(held_by("+y -x:yz"), expected)
    np.testing.assert_array_equal(held_by("-x:z,+y;-x:y"), expected)


def test_box_sphere_and_mask_hold_their_vertices():
    inside = ((POINTS >= [0, 0, 1.5]) & (POINTS <= [0.5, 1, 3])).all(axis=1)
    np.testing.assert_array_equal(
        held_by("box(-inf, 500 mm, 0, 1 m, 150cm, inf)"), all_components(inside)
    )
    near = np.linalg.norm(POINTS - [1, 2, 3], axis=1) <= 1.0
    np.testing.assert_array_equal(held_by("sphere(1, 2, 3, 1)"), all_components(near))
    mask = np.arange(27) % 5
    np.testing.assert_array_equal(
        held_by("mask(glue)", masks={"glue": mask}.get), all_components(mask != 0)
    )
    three = np.arange(81).reshape(27, 3) % 2
    np.testing.assert_array_equal(
        held_by("mask(two words):xz", masks={"two words": three}.get),
        (three != 0) & [True, False, True],
    )
    assert not held_by().any()


def test_scaled_cage_has_the_same_supports():
    for scale in (1e-6, 1e3):
        scaled = held_components(POINTS * scale, ["+y", f"sphere(0, 0, 0, {scale})"])
        np.testing.assert_array_equal(scaled, held_by("+y", "sphere(0, 0, 0, 1)"))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("top", '"top" is not a support'),
        ("+y:w", '"\\+y:w" is not a support'),
        ("+y-x", "not a support"),
        ("box(0, 1)", "has 2 values"),
        ("box(0, 1, 0, 1, 1, 0)", "is empty"),
        ("box(0, 1, 0, 1, 0, 1 kg)", 'unknown unit "kg"'),
        ("sphere(0, 0, 0, -1)", "radius of at least 0"),
        ("sphere(0, 0, nan, 1)", "empty"),
        ("mask()", "must name a point array"),
    ],
)
def test_invalid_supports_are_refused(text, what):
    with pytest.raises(InputError, match=what):
        parse_places(text)
    with pytest.raises(InputError, match=r"(?s)fixed.*sphere\(x, y, z, radius\)"):
        ModalSolver(fixed=text)


def test_support_without_vertices_is_refused():
    with pytest.raises(
        InputError, match=r'"sphere\(9, 9, 9, 1\)" contains no vertex.*\(1, 2, 3\) m'
    ):
        held_by("+y", "sphere(9, 9, 9, 1)")
    with pytest.raises(InputError, match="contains no vertex"):
        held_by("mask(none)", masks=lambda name: np.zeros(27))


def test_fully_held_cage_is_refused():
    with pytest.raises(InputError, match="all vertices"):
        held_by("box(-inf, inf, -inf, inf, -inf, inf)")
    assert held_by("box(-inf, inf, -inf, inf, -inf, inf):xy")[:, :2].all()


def test_the_parameter_is_canonical():
    solver = ModalSolver()
    assert solver.fixed == ("+y",)
    solver.fixed = "sphere(0,0,0, 0.3 mm):zx, +y -x"
    assert solver.fixed == ("-x", "+y", "sphere(0, 0, 0, 0.0003):xz")
    changed = solver.GetMTime()
    solver.fixed = ["+y", "-x", "sphere(0, 0, 0, 0.0003):xz", "+y"]
    assert solver.GetMTime() == changed
    solver.fixed = ""
    assert solver.fixed == ()


def solve_cage(**settings):
    cage = TetraCage(divisions=(3, 3, 1))
    weave = WeaveSource(ends=3, picks=3)
    cage.SetInputConnection(weave.GetOutputPort())
    solver = ModalSolver(modes=12, **settings)
    solver.SetInputConnection(cage.GetOutputPort())
    solver.update()
    data = solver.GetOutputDataObject(0)
    arrays = [
        data.GetPointData().GetArray(i) for i in range(data.GetPointData().GetNumberOfArrays())
    ]
    points = {array.GetName(): vtk_to_numpy(array).copy() for array in arrays}
    return vtk_to_numpy(data.GetFieldData().GetArray("eigenvalues")).copy(), points


def test_smooth_table_leaves_three_rigid_modes():
    eigenvalues, arrays = solve_cage(fixed="-z:z")
    assert (eigenvalues == 0).sum() == 3
    assert eigenvalues[3] > 0
    bottom = arrays["fixed"] != 0
    np.testing.assert_array_equal(arrays["fixed_components"][bottom], [[0, 0, 1]] * bottom.sum())
    for k in range(12):
        assert not arrays[f"mode_{k:03d}"][bottom, 2].any()
    assert abs(arrays["mode_005"][bottom, :2]).max() > 0


def test_nothing_fixed_gives_six_rigid_modes():
    eigenvalues, arrays = solve_cage(fixed="")
    assert (eigenvalues == 0).sum() == 6
    assert not arrays["fixed"].any()


def test_mask_is_read_from_the_cage():
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(3, 3, 1))
    cage.SetInputConnection(weave.GetOutputPort())
    cage.update()
    grid = vtkUnstructuredGrid()
    grid.DeepCopy(cage.GetOutputDataObject(0))
    glued = numpy_to_vtk((np.arange(grid.GetNumberOfPoints()) < 6).astype(np.uint8), deep=True)
    glued.SetName("glued")
    grid.GetPointData().AddArray(glued)
    solver = ModalSolver(modes=4, fixed="mask(glued)")
    solver.SetInputDataObject(0, grid)
    solver.update()
    fixed = solver.GetOutputDataObject(0).GetPointData().GetArray("fixed")
    np.testing.assert_array_equal(np.flatnonzero(vtk_to_numpy(fixed)), range(6))
    solver.fixed = "mask(glue)"
    with pytest.raises(InputError, match=r'mask\(glue\).*"glued"'):
        solver.update()


# --- directions and rigid bodies ------------------------------------------------------------------


def projection_of_constraints(points, held, normals, bodies):
    """What constraints leave, as a projection: I - C⁺C of the dense constraints C u = 0."""
    size = points.size
    rows = [np.eye(size)[held.ravel()]]
    for vertex in range(len(points)):
        block = np.zeros((3, size))
        block[:, 3 * vertex : 3 * vertex + 3] = normals[vertex]
        rows.append(block)
    for number in range(1, bodies.max() + 1):
        mine = (3 * np.flatnonzero(bodies == number)[:, None] + np.arange(3)).ravel()
        where = points[bodies == number]
        # Lengths between all vertices stay, and u is what a skew matrix and a shift make.
        skew = np.zeros((len(mine), 6))
        skew[:, :3] = np.tile(np.eye(3), (len(where), 1))
        for axis in range(3):
            skew[:, 3 + axis] = np.cross(np.eye(3)[axis], where).ravel()
        block = np.zeros((len(mine), size))
        block[:, mine] = np.eye(len(mine)) - skew @ np.linalg.pinv(skew)
        rows.append(block)
    constraints = np.concatenate(rows)
    return np.eye(size) - np.linalg.pinv(constraints, rcond=1e-9) @ constraints


@pytest.mark.parametrize(
    ("fixed", "rigid"),
    [
        (["+y:x", "-x:(0, 1, 1)"], []),
        (["-x:(0, 1, 1)", "-y:(1, 2, 0)", "-z:(3, 0, -1)"], []),  # edges and a corner of several
        (["+y:x"], ["-x"]),
        (["-x:y", "sphere(0, 0, 0, 0.1)"], ["-x", "+x"]),  # a hinge's body, and a free one
        (["-z:(1, 1, 0)"], ["box(0, 0, 0, 0, 0, 3)", "sphere(1, 2, 3, 0.1)"]),  # line and point
        (["-x"], ["-x"]),  # held as a whole: nothing is left of it
    ],
)
def test_free_motions_satisfy_all_constraints(fixed, rigid):
    where = held_components(POINTS, fixed)
    normals, bodies = held_directions(POINTS, fixed), rigid_bodies(POINTS, rigid)
    made = free_motions(POINTS, where, normals, bodies).toarray()
    np.testing.assert_allclose(made.T @ made, np.eye(made.shape[1]), atol=1e-13)
    dense = projection_of_constraints(
        POINTS,
        where,
        np.zeros((27, 3, 3)) if normals is None else normals,
        np.zeros(27, int) if bodies is None else bodies,
    )
    np.testing.assert_allclose(made @ made.T, dense, atol=1e-9)


def test_plain_supports_leave_unit_vectors():
    where = held_by("+y", "-x:yz")
    made = free_motions(POINTS, where)
    np.testing.assert_array_equal(made.indices, np.flatnonzero(~where.ravel()))
    assert (made.data == 1).all()


def test_rigid_bodies_cannot_share_vertices():
    assert rigid_bodies(POINTS, []) is None
    bodies = rigid_bodies(POINTS, ["-x +x"])
    np.testing.assert_array_equal(bodies, 1 * (POINTS[:, 0] == 0) + 2 * (POINTS[:, 0] == 1))
    with pytest.raises(InputError, match=r'"-x" and "\+y" share a vertex.*one box or mask'):
        rigid_bodies(POINTS, ["-x", "+y"])
    with pytest.raises(InputError, match='a rigid place cannot name components: "-x:y"'):
        rigid_bodies(POINTS, ["-x:y"])


def test_side_that_lets_the_cage_turn_is_reported():
    weave, cage = WeaveSource(ends=3, picks=3), TetraCage(divisions=(2, 2, 1))
    cage.SetInputConnection(weave.GetOutputPort())
    grid = vtkUnstructuredGrid()
    grid.DeepCopy(cage.update().output)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    around_z, around_y = np.radians([30.0, 20.0])
    turn = np.array(
        [
            [np.cos(around_z), -np.sin(around_z), 0],
            [np.sin(around_z), np.cos(around_z), 0],
            [0, 0, 1],
        ]
    )
    tilt = np.array(
        [
            [np.cos(around_y), 0, np.sin(around_y)],
            [0, 1, 0],
            [-np.sin(around_y), 0, np.cos(around_y)],
        ]
    )
    # Its ends along x: a face, an edge, a corner; so many rigid motions are left.
    for places, rigid in ((points, 0), (points @ turn.T, 1), (points @ turn.T @ tilt.T, 3)):
        turned = vtkUnstructuredGrid()
        turned.DeepCopy(grid)
        turned.GetPoints().SetData(numpy_to_vtk(places, deep=True))
        solver = ModalSolver(modes=5, fixed="-x", elements="tetrahedra")
        solver.SetInputDataObject(0, turned)
        values = vtk_to_numpy(solver.update().output.GetFieldData().GetArray("eigenvalues"))
        assert (values < 1e-6 * values[-1]).sum() == rigid
        warned = [text for text in solver.warnings if 'side "-x"' in text]
        assert len(warned) == (rigid > 0)
        # Two sides that are held do it together.
        solver.configure(fixed="-x +x +y", modes=1)
        assert not [text for text in solver.update().warnings if "side" in text]
        # What slides is meant to.
        assert loose_sides(places, ["-x:x"]) == loose_sides(places, []) == []


def test_half_thicknesses_without_positions_only_turn() -> None:
    thick = np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 2e-3], [1e-3, 0.0, 0.0]])
    motions = rigid_motions(thick, np.zeros(3, dtype=bool))
    assert not motions[:, :3].any()
    turned = np.cross(np.eye(3), thick[0]).T / 2e-3  # rotations are divided by the largest length
    np.testing.assert_allclose(motions[:3, 3:], turned)
