"""Large rotations of linear motions: circles and helices that a bent strip would be."""

from __future__ import annotations

import math
import re
import warnings
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from spacemap_vtk import (
    ModalResponse,
    ModalSolver,
    MotionReader,
    RotationStrain,
    SpacemapWarning,
    TetraCage,
    connect,
)
from spacemap_vtk.applicability import TRUSTED_ROTATION
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary.fittings import Fittings
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.response.rotation_coordinates import RotationCoordinates

FloatArray = NDArray[np.float64]


def strip(cells: int, thickness: float, sheet: bool) -> tuple[FloatArray, RotationCoordinates]:
    """Return the vertices of a strip of one metre by 0.1 m held at x = 0, and its rebuilder."""
    points, tetrahedra = build_lattice((0, 1, 0, 0.1, -thickness / 2, thickness / 2), (cells, 1, 1))
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    surface = find_mid_surface(points, tetrahedra) if sheet else None
    return points, RotationCoordinates(points, tetrahedra, held, surface)


def tip_from_circle(cells: int, thickness: float, sheet: bool, degrees: float) -> float:
    """Return how far the tip of a strip is from where its circle ends."""
    points, rebuilt = strip(cells, thickness, sheet)
    bend = math.radians(degrees)
    x, z = points[:, 0], points[:, 2]
    linear = np.stack([-bend * x * z, 0 * x, bend * x**2 / 2], axis=1)
    tip = (points + rebuilt.displacement(linear))[x == 1].mean(axis=0)
    return math.dist(tip[[0, 2]], (math.sin(bend) / bend, (1 - math.cos(bend)) / bend))


@pytest.mark.parametrize(
    ("cells", "quarter", "half"),
    [(5, 0.0047, 0.0133), (10, 0.0012, 0.0033), (20, 0.0003, 0.00083), (40, 8e-5, 0.00021)],
)
@pytest.mark.parametrize("thickness", [3e-4, 3e-6])
def test_bent_sheet_becomes_a_circle(
    cells: int, quarter: float, half: float, thickness: float
) -> None:
    """Thin cages lose nothing: the figures are those of any thickness."""
    assert tip_from_circle(cells, thickness, True, 90) < quarter
    assert tip_from_circle(cells, thickness, True, 180) < half


@pytest.mark.parametrize(
    ("cells", "bends"),
    [
        (10, {30: 0.0003, 90: 0.0021, 180: 0.0061}),
        (20, {90: 0.0005}),
        (40, {90: 0.0002}),
    ],
)
def test_bent_strip_of_tetrahedra_becomes_a_circle(cells: int, bends: dict[int, float]) -> None:
    """Linear, the tip is 0.046, 0.40 and 1.39 lengths away."""
    for degrees, most in bends.items():
        assert tip_from_circle(cells, 0.05, False, degrees) < most


@pytest.mark.parametrize("sheet", [False, True])
def test_quarter_twist_is_a_helix_within_three_thousandths(sheet: bool) -> None:
    """It does not converge to it: shear with rotation is no exact case."""
    points, rebuilt = strip(10, 3e-4 if sheet else 0.05, sheet)
    turn = math.pi / 2
    x, y, z = points.T
    y = y - 0.05
    moved = points + rebuilt.displacement(np.stack([0 * x, -turn * x * z, turn * x * y], axis=1))
    c, s = np.cos(turn * x), np.sin(turn * x)
    helix = np.stack([x, 0.05 + y * c - z * s, y * s + z * c], axis=1)
    assert np.linalg.norm(moved - helix, axis=1).max() < 0.0031


@pytest.mark.parametrize("kind", ["linear", "quadratic", "sheet"])
def test_rigid_motions_are_exact_and_rates_are_derivatives(kind: str) -> None:
    points, cells = build_lattice((0, 1, 0, 0.5, -0.02, 0.03), (6, 3, 1))
    if kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    surface = find_mid_surface(points, cells) if kind == "sheet" else None
    middle = points.mean(axis=0)
    free = RotationCoordinates(points, cells, np.zeros(points.shape, dtype=bool), surface)
    axis, push = np.array([0.4, -1.3, 2.1]), np.array([1.0, 2.0, 3.0])
    turn = Rotation.from_rotvec(axis).as_matrix()
    moved = points + free.displacement(np.cross(axis, points - middle) + push)
    np.testing.assert_allclose(moved, (points - middle) @ turn.T + middle + push, atol=1e-10)

    random = np.random.default_rng(0)
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    held[7] = [False, True, False]
    clamped = RotationCoordinates(points, cells, held, surface)
    linear, rate, second = 0.1 * random.normal(size=(3, *points.shape))
    rate, step = 10 * rate, 1e-5
    at = [linear + t * rate + t**2 / 2 * second for t in (-step, step)]
    change = (clamped.displacement(at[1]) - clamped.displacement(at[0])) / (2 * step)
    np.testing.assert_allclose(clamped.velocity(linear, rate), change, atol=1e-5)
    ends = [clamped.velocity(x, rate + t * second) for x, t in zip(at, (-step, step), strict=True)]
    found = clamped.acceleration(linear, rate, second)
    np.testing.assert_allclose(
        found, (ends[1] - ends[0]) / (2 * step), atol=1e-4 * abs(found).max()
    )
    # Held vertices are where the linear motion has them.
    np.testing.assert_allclose(clamped.displacement(linear)[held], linear[held], atol=1e-15)
    # What is small is as it was.
    small = 1e-6 * linear
    np.testing.assert_allclose(clamped.displacement(small), small, atol=1e-5 * abs(small).max())


def test_inclined_supports_hold() -> None:
    """Of a model with an inclined slider, its own basis keeps vertices in their plane."""
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.02), (6, 6, 1))
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    normals = np.zeros((len(points), 3, 3))
    slope = np.array([0.0, 0.6, 0.8])
    normals[points[:, 0] == 1] = np.outer(slope, slope)
    plate = homogeneous_plate(isotropic(1e6, 0.3), 0.02)
    model = Model(points, cells, plate, 300.0, held, fittings=Fittings(normals=normals))
    rebuilt = RotationCoordinates(points, cells, model.pencil.basis, model.pencil.surface)
    linear = model.modes(4).shapes[0]
    linear = 0.3 * linear / abs(linear).max()
    moved = rebuilt.displacement(linear)
    assert abs(moved[points[:, 0] == 1] @ slope).max() < 1e-12
    assert abs(moved - linear).max() > 1e-3


class Swing:
    """A strip of tetrahedra that falls from level; the stages after one another."""

    def __init__(self, **modal: Any) -> None:
        cage = TetraCage(divisions=(1, 10, 1), padding=0.0)
        cage.SetInputDataObject(pv.Box((0, 0.1, 0, 1, 0, 0.05)))
        solver = ModalSolver(**{"youngs_modulus": 3e4, "elements": "tetrahedra"} | modal)
        self.response, self.rotation = ModalResponse(alpha=1.0), RotationStrain()
        connect(cage, solver, self.response, self.rotation)

    def at(self, time: float) -> Any:
        return pv.wrap(self.rotation.update(time).output)


def length(mesh: Any, field: str) -> float:
    """Return the length of a line of vertices along the strip."""
    line = (mesh.points[:, 0] == 0) & (mesh.points[:, 2] == 0)
    moved = (mesh.points + mesh[field])[line]
    return float(
        np.linalg.norm(np.diff(moved[np.argsort(mesh.points[line, 1])], axis=0), axis=1).sum()
    )


def test_too_large_rotation_warns_once_for_many_frames() -> None:
    """The angle differs from frame to frame, the limit does not."""
    swing = Swing()
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", SpacemapWarning)
        for frame in range(5):
            swing.rotation.update(0.35 + 0.02 * frame)
    assert sum("valid up to 35°" in str(w.message) for w in found) == 1


@pytest.mark.filterwarnings("ignore::spacemap_vtk.SpacemapWarning")
def test_fall_by_more_than_45_degrees_keeps_lengths() -> None:
    swing = Swing()
    moved = swing.at(0.4)
    assert length(moved, "linear_displacement") > 1.3
    assert length(moved, "displacement") == pytest.approx(1.0, abs=2e-3)
    assert not moved["displacement"][moved["fixed"] != 0].any()
    early, late = (swing.at(0.4 + t)["displacement"].copy() for t in (-1e-6, 1e-6))
    np.testing.assert_allclose(moved["velocity"], (late - early) / 2e-6, atol=1e-6)
    motion = swing.rotation.motion
    assert motion is not None
    np.testing.assert_allclose(motion.at_time(0.4)[0], moved["displacement"], atol=1e-12)
    weights = np.eye(len(moved.points))[-1]
    history = motion.history(weights, np.array([0.2, 0.4]))
    np.testing.assert_allclose(history[:2, 1], [moved["displacement"][-1], moved["velocity"][-1]])
    # A time is all that runs anew.
    assert swing.rotation.upstream()
    assert swing.response.executions == swing.rotation.executions


def elastica(load: float, spread: bool) -> FloatArray:
    """Return the axis of a clamped strip under αB/L² at its end, or spread along it, (2, 21)."""

    def bent(s: FloatArray, state: FloatArray) -> FloatArray:
        push = load * (1 - s) if spread else load + 0 * s
        return np.stack([state[1], -push * np.cos(state[0]), np.cos(state[0]), np.sin(state[0])])

    def ends(first: FloatArray, last: FloatArray) -> FloatArray:
        return np.array([first[0], last[1], first[2], first[3]])

    s = np.linspace(0, 1, 101)
    start = np.stack([0 * s, load * (1 - s), s, 0 * s])
    found = solve_bvp(bent, ends, s, start, tol=1e-6)
    assert found.success
    return np.asarray(found.sol(np.linspace(0, 1, 21))[2:], dtype=np.float64)


def rebuilt_error(load: float, spread: bool) -> tuple[float, float]:
    """Return how far a strip's rebuilt axis is from the elastica, and by how much it turns."""
    points, rebuilt = strip(20, 3e-4, True)
    x, z = points[:, 0], points[:, 2]
    if spread:
        bend, slope = load / 24 * (6 * x**2 - 4 * x**3 + x**4), load / 6 * (3 * x - 3 * x**2 + x**3)
    else:
        bend, slope = load / 6 * (3 * x**2 - x**3), load / 2 * (2 * x - x**2)
    linear = np.stack([-slope * z, 0 * x, bend], axis=1)
    line = (points[:, 1] == 0) & (z > 0)
    axis = (points + rebuilt.displacement(linear))[line][np.argsort(x[line])][:, [0, 2]]
    error = np.linalg.norm(axis - abs(elastica(load, spread)).T, axis=1).max()
    return float(error), rebuilt.largest_rotation(linear)


@pytest.mark.parametrize(("spread", "per_load"), [(False, 1 / 2), (True, 1 / 6)])
def test_rebuilt_strip_is_within_5_percent_up_to_the_trusted_angle(
    spread: bool, per_load: float
) -> None:
    """Of the elastica, whichever the load; the angle is that of the linear motion."""
    error, angle = rebuilt_error(TRUSTED_ROTATION / per_load, spread)
    assert angle == pytest.approx(TRUSTED_ROTATION, rel=0.01)
    assert 0.03 < error < 0.05
    assert rebuilt_error(1.15 * TRUSTED_ROTATION / per_load, spread)[0] > 0.05


def test_rotation_beyond_the_trusted_angle_is_reported() -> None:
    swing = Swing(elements="sheet", youngs_modulus=1e8)
    beyond = r"turns by up to 40°.*valid up to 35°.*\[transient\].*hang"
    swing.response.gravity = (0, 0, -9.80665)
    swing.rotation.update(100.0)
    turned = (
        np.radians(1.0)
        / swing.rotation.largest_rotation_and_strain(
            swing.response.output, swing.at(100.0)["linear_displacement"]
        )[0]
    )
    for degrees, stage, expected in (
        (30, swing.rotation, None),
        (30, swing.response, r"turns by up to 30°.*valid up to 20°.*RotationStrain"),
        (40, swing.rotation, beyond),
        (40, swing.response, r"turns by up to 40°.*\[transient\]"),
    ):
        swing.response.gravity = (0, 0, -9.80665 * degrees * turned)
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always", SpacemapWarning)
            stage.update(100.0 if stage is swing.rotation else 101.0)
        texts = [str(w.message) for w in found if "turns by" in str(w.message)]
        assert bool(texts) == bool(expected)
        assert expected is None or re.search(expected, texts[0])


def test_rigid_rotation_of_a_free_cage_is_trusted() -> None:
    points, cells = build_lattice((0, 1, 0, 0.1, -0.05, 0.05), (5, 1, 1))
    linear = 1.5 * np.cross([0, 0, 1.0], points)
    free, held = (
        RotationCoordinates(
            points, cells, np.repeat(points[:, :1] < x, 3, axis=1)
        ).largest_rotation(linear)
        for x in (-1, 0.01)
    )
    assert free == pytest.approx(0.0, abs=1e-12)
    assert held == pytest.approx(1.5)


def test_only_the_unrebuilt_motion_warns_of_rotation() -> None:
    swing = Swing()
    with pytest.warns(SpacemapWarning) as caught:
        swing.rotation.update(0.4)
    assert not [w for w in caught if "but a linear motion" in str(w.message)]
    with pytest.warns(SpacemapWarning, match="turns by .*a linear motion is valid up to 20°"):
        swing.response.update(0.41)


@pytest.mark.filterwarnings("ignore::spacemap_vtk.SpacemapWarning")
def test_hanging_sheet_turns_about_its_equilibrium() -> None:
    swing = Swing(elements="sheet", gravity=(0, 0, -9.80665), youngs_modulus=1e6)
    swing.response.gravity = (0, 0, 9.80665)
    moved = swing.at(0.0)
    np.testing.assert_allclose(moved["displacement"], moved["equilibrium"], atol=1e-13)
    moved = swing.at(0.3)
    assert length(moved, "displacement") == pytest.approx(length(moved, "equilibrium"), rel=0.03)
    assert length(moved, "linear_displacement") > 1.05 * length(moved, "equilibrium")


def test_motion_from_a_file_is_rebuilt(tmp_path: Any) -> None:
    """Of another solver's linear result no more is known than what its user says."""
    points, cells = build_lattice((0, 1, 0, 0.1, -0.025, 0.025), (10, 1, 1))
    mesh = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points)
    x, z = points[:, 0], points[:, 2]
    for number, bend in enumerate((0.0, math.pi / 2)):
        mesh["displacement"] = np.stack([-bend * x * z, 0 * x, bend * x**2 / 2], axis=1)
        mesh.save(tmp_path / f"step_{number}.vtu")
    reader, rotation = MotionReader(file=tmp_path / "step_*.vtu"), RotationStrain(fixed="-x")
    connect(reader, rotation)
    moved = pv.wrap(rotation.update(1.0).output)
    tip = (moved.points + moved["displacement"])[x == 1].mean(axis=0)
    assert math.dist(tip[[0, 2]], (2 / math.pi, 2 / math.pi)) < 0.0021
    assert not moved["displacement"][x == 0].any()
