"""A pressure that follows its surface: its work, its tangent, and a strip that it bends far."""

from __future__ import annotations

import numpy as np
import pytest
from calculix import mesh
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, solve_ivp, trapezoid

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.boundary import time_functions
from spacemap_vtk.mechanics.boundary.follower import FollowerPressure
from spacemap_vtk.mechanics.boundary.loads import find_side_faces, traction_forces
from spacemap_vtk.mechanics.boundary.places import SIDES
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.strains import shape_gradients
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_tangent
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion

FloatArray = NDArray[np.float64]


def cage_of(model: Model) -> CageModes:
    """Return a cage without modes."""
    return CageModes(model, np.empty(0), np.empty((0, model.points.size)), np.empty(0))


def box(kind: str) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return a small box of tetrahedra."""
    bounds = (0.0, 0.02, 0.0, 0.06, 0.0, 0.01)
    return mesh((1, 3, 1), 2, bounds) if kind == "quadratic" else build_lattice(bounds, (1, 3, 1))


@pytest.mark.parametrize("kind", ["linear", "quadratic", "sheet"])
def test_undeformed_follower_equals_a_fixed_pressure(kind: str) -> None:
    points, cells = box(kind)
    for side in SIDES:
        where = find_side_faces(points, cells, side, kind == "sheet")
        dead = traction_forces(len(points), where, -where.normal)
        held = FollowerPressure(where.faces).forces(points)
        np.testing.assert_allclose(-held, dead, atol=1e-15)


@pytest.mark.parametrize("kind", ["linear", "quadratic", "sheet"])
def test_tangent_is_the_derivative_of_the_forces(kind: str) -> None:
    points, cells = box(kind)
    faces = find_side_faces(points, cells, "+z", kind == "sheet").faces
    pressure = FollowerPressure(faces)
    place, way = np.random.default_rng(0).normal(size=(2, *points.shape)) / 100
    place, step = points + place, 1e-4 * way
    change = (pressure.forces(place + step) - pressure.forces(place - step)) / 2e-4
    found = assemble_tangent([pressure], place) @ way.ravel()
    np.testing.assert_allclose(found, change.ravel(), atol=1e-8 * abs(change).max())


@pytest.mark.parametrize("kind", ["linear", "quadratic"])
def test_energy_of_a_closed_surface_is_its_volume(kind: str) -> None:
    points, cells = box(kind)
    faces = np.concatenate([find_side_faces(points, cells, side).faces for side in SIDES])
    pressure, way = FollowerPressure(faces), np.random.default_rng(0).normal(size=points.shape)
    assert pressure.energy(points) == pytest.approx(0.02 * 0.06 * 0.01)
    change = (pressure.energy(points + 1e-5 * way) - pressure.energy(points - 1e-5 * way)) / 2e-5
    assert float(np.vdot(pressure.forces(points), way)) == pytest.approx(change, rel=1e-6)


@pytest.mark.parametrize("kind", ["linear", pytest.param("quadratic", marks=pytest.mark.nightly)])
def test_work_of_a_constant_pressure_is_the_change_of_volume(kind: str) -> None:
    """A body that flies, turns and swells: p ΔV, whatever the step."""
    points, cells = box(kind)
    model = Model(points, cells, isotropic(2e4, 0.3), 300.0, np.zeros(points.shape, dtype=bool))
    cage, pressure = cage_of(model), 2000.0
    loads = [cage.load_vector("pressure", pressure, time_functions.step(), s, True) for s in SIDES]
    thrown = np.random.default_rng(0).normal(size=points.shape) / 10 + points @ np.eye(3)[[1, 2, 0]]
    motion = SteppedMotion(cage, loads, velocity=thrown, tolerance=np.inf, max_step=2e-3)
    # Exact for the determinant of a quadratic map: Keast, Comp. Meth. Appl. Mech. Eng. 55 (1986).
    inner = np.full((4, 4), 1 / 6) + np.eye(4) / 3
    corners = np.vstack([np.full(4, 0.25), inner])
    weights = np.array([-0.8, 0.45, 0.45, 0.45, 0.45])
    gradients = shape_gradients(points, cells[:, :4])[0][:, 0]
    sizes = shape_gradients(points, cells[:, :4])[1][:, 0]

    def volume(place: FloatArray) -> float:
        slopes = np.broadcast_to(gradients[:, None], (len(cells), 5, 4, 3))
        if kind == "quadratic":
            ends = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]).T
            own = (4 * corners - 1)[None, :, :, None] * slopes
            first, second = (corners[None, :, end, None] for end in ends)
            mid = 4 * (first * slopes[:, :, ends[1]] + second * slopes[:, :, ends[0]])
            slopes = np.concatenate([own, mid], axis=2)
        grown = np.linalg.det(np.einsum("tqni,tnj->tqij", slopes, place[cells]))
        return float((grown @ weights) @ sizes)

    motion.step_until(0.02)
    start, first = motion.states[0, 5] * model.modulus, volume(points)
    assert first == pytest.approx(0.02 * 0.06 * 0.01)
    changes = []
    for time in motion.states[::4, 0]:
        changes.append(volume(points + motion.at_time(time)[0]) / first - 1)
        kinetic, strain, _, work = motion.energies(np.array([time]))[0]
        assert work - start == pytest.approx(-pressure * first * changes[-1], abs=1e-9 * kinetic)
        assert kinetic + strain == pytest.approx(work, rel=1e-9)
    assert max(np.abs(changes)) > 0.05


@pytest.mark.parametrize("flat", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_strip_under_follower_pressure_bends_like_the_elastica(flat: bool) -> None:
    """From the free end κ'' + κ³/2 = p/B: what pulls along the strip is -B κ²/2 there.

    A strip that begins in that shape stays there, one that begins flat comes to rest there.
    """
    length, rigidity, pressure, thickness = 0.1, 1e-5, 0.1, 1e-4

    def bent(_: float, state: FloatArray) -> list[float]:
        curvature, slope, _ = state
        return [slope, pressure / rigidity - curvature**3 / 2, curvature]

    along = np.linspace(0.0, length, 4001)
    found = solve_ivp(bent, (0.0, length), [0.0, 0.0, 0.0], rtol=1e-10, t_eval=along)
    angle = found.y[2, -1] - found.y[2]
    tip = trapezoid(np.cos(angle), along), trapezoid(np.sin(angle), along)
    assert 1.5 < angle[0] < 1.6

    box, divisions = (0, length, 0, 0.01, -thickness / 2, thickness / 2), (48 if flat else 32, 1, 1)
    points, cells = build_lattice(box, divisions)
    plane = np.diag([1.0, 1.0, 0.5])
    plate = Plate(1e3 * plane, rigidity * plane, 500 * np.eye(2), 1e3)
    held = np.repeat(points[:, :1] < 1e-9, 3, axis=1)
    cage = cage_of(Model(points, cells, plate, 1000.0, held))
    rises = time_functions.table([0, 0.1], [0, 1]) if flat else time_functions.step()
    load = cage.load_vector("pressure", pressure, rises, "-z", True)
    begins = None
    if not flat:
        turned = found.y[2, -1] - np.interp(length - points[:, 0], along, found.y[2])
        x, z = (
            np.interp(points[:, 0], along, cumulative_trapezoid(way(angle)[::-1], along, initial=0))
            for way in (np.cos, np.sin)
        )
        up = points[:, 2:] * np.transpose([-np.sin(turned), 0 * turned, np.cos(turned)])
        begins = np.transpose([x, points[:, 1], z]) + up - points
    # Where it comes to rest does not depend on the steps.
    motion = SteppedMotion(cage, [load], Damping(8.0, 2e-3), tolerance=1.0, displacement=begins)
    moved, rate, _ = motion.at_time(3.0 if flat else 0.4)
    assert abs(rate).max() < 1e-2 * length
    end = (points + moved)[points[:, 0] > length - 1e-9].mean(axis=0)
    np.testing.assert_allclose(end[[0, 2]], tip, atol=1e-3 * length)
