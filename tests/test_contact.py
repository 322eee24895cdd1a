"""Cloth on obstacles, against closed forms and elasticas (units of length l = (D/q)^(1/3))."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, contact_stiffness
from spacemap_vtk.mechanics.contact.obstacles import (
    Cylinder,
    Obstacle,
    Plane,
    RoundedBox,
    Sphere,
)
from spacemap_vtk.mechanics.contact.opening import resting_contacts
from spacemap_vtk.mechanics.contact.resting import (
    Resting,
    find_resting_state,
    report_contact,
    rested_terms,
)
from spacemap_vtk.mechanics.contact.samples import sample_faces, sample_sheet
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium.energy_terms import EnergyTerm, assemble_tangent
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.scenes.figure_list import cloth_figures
from spacemap_vtk.scenes.report import report_fabric, report_modes
from spacemap_vtk.scenes.scene import Scene

FloatArray = NDArray[np.float64]
#: Bending [N m], stretch [N/m], gravity [m/s²], weight per area [N/m²], and the unit of length [m].
BENDING, STRETCH, GRAVITY = 1e-5, 1500.0, 9.80665
WEIGHT = 0.15 * GRAVITY
LENGTH = (BENDING / WEIGHT) ** (1 / 3)
WIDTH, THICKNESS = 0.01, 1e-5
PLATE = Plate(STRETCH * np.diag([1, 1, 0.5]), BENDING * np.diag([1, 1, 0.5]))


def sheet(
    box: tuple[float, ...],
    cells: tuple[int, int],
    bodies: list[Obstacle],
    mu: float = 0.0,
    thick: float = THICKNESS,
) -> Any:
    """Return vertices, tetrahedra and terms of a sheet."""
    points, tetrahedra = build_lattice((*box, -thick / 2, thick / 2), (*cells, 1))
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    samples = sample_sheet(points, surface)
    stiffness = contact_stiffness(PLATE, (box[1] - box[0]) / cells[0])
    terms = [
        ObstacleTerm(body, samples, stiffness, thick / 2, mu, surface=surface) for body in bodies
    ]
    return points, tetrahedra, terms


def strip(
    start: float, length: float, cells: int, bodies: list[Obstacle], held: Any, mu: float = 0.0
) -> Model:
    """Return a strip along x that stays in the x-z plane; `held` gives held components by x."""
    points, tetrahedra, terms = sheet((start, start + length, 0, WIDTH), (cells, 1), bodies, mu)
    fixed = np.zeros(points.shape, dtype=bool)
    fixed[:, 1] = True
    fixed |= held(points[:, :1])
    density = 0.15 / THICKNESS
    return Model(points, tetrahedra, PLATE, density, fixed, terms=terms)


def rest(
    model: Model,
    gravity: Any = (0, 0, -GRAVITY),
    more: Any = 0.0,
    start: Resting | None = None,
) -> tuple[Model, Resting]:
    """Return the model in its resting state."""
    weight = np.outer(model.nodal_mass, gravity) + more
    found = find_resting_state(model, weight.ravel(), start=start)
    terms = rested_terms(model.terms, model.points + found.displacement, found.anchors)
    held = ~model.free.reshape(-1, 3)
    data = model.points, model.cells, PLATE, model.density, held, False, found.displacement
    return Model(*data, terms=terms), found


def middle(model: Model) -> FloatArray:
    """Return the middle line of a strip, (n, 3), along x."""
    surface = model.pencil.surface
    assert surface is not None
    assert model.displacement is not None
    flat, moved = (
        surface.to_nodes(places)[: len(surface.pairs)]
        for places in (model.points, model.points + model.displacement)
    )
    line = flat[:, 1] < 1e-9
    return moved[line][np.argsort(flat[line, 0])]


@pytest.mark.parametrize("kind", ["sheet", "solid", "quadratic"])
def test_forces_and_tangent_are_derivatives_of_the_energy(kind: str) -> None:
    """With friction that sticks and slides; on the sheet's vertices, and on faces of solids."""
    from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints

    points, cells = build_lattice((0, 1, 0, 1, 0, 0.1), (3, 3, 1))
    body = Sphere(1.0, (0.4, 0.5, -0.97))
    if kind == "quadratic":
        points, cells = add_midpoints(points, cells)
    surface = find_mid_surface(points, cells) if kind == "sheet" else None
    samples = sample_faces(points, cells) if surface is None else sample_sheet(points, surface)
    term = ObstacleTerm(body, samples, 3.0, 0.05, 0.4, surface=surface)
    random = np.random.default_rng(0)
    anchors = samples.positions(points if surface is None else surface.to_nodes(points))
    term = term.at_rest(points, anchors + 0.03 * random.normal(size=anchors.shape))
    place, way = points + 0.003 * random.normal(size=points.shape), random.normal(size=points.shape)
    step = 1e-7
    slope = (term.energy(place + step * way) - term.energy(place - step * way)) / (2 * step)
    assert slope == pytest.approx(float(np.vdot(term.forces(place), way)), rel=1e-5)
    change = (term.forces(place + step * way) - term.forces(place - step * way)) / (2 * step)
    expected = (assemble_tangent([term], place) @ way.ravel()).reshape(change.shape)
    np.testing.assert_allclose(change, expected, atol=1e-4 * abs(expected).max())


@pytest.mark.parametrize(
    ("overhang", "lift_off", "reaction", "tip", "uplift"),
    [
        (0.5, 0.706931, 1.030333, 0.015166, 0.001097),
        (1.0, 1.393360, 2.060750, 0.231752, 0.016476),
        (1.5, 1.903675, 3.078035, 0.871192, 0.055625),
    ],
)
def test_strip_lifts_off_behind_the_edge_of_a_table(
    overhang: float, lift_off: float, reaction: float, tip: float, uplift: float
) -> None:
    length, cells = 6 * LENGTH, 160
    edge, start = length / cells, -(length - overhang * LENGTH)
    table = RoundedBox((2 * length, 1, 0.1), edge, (-length + edge, 0, -0.05 - THICKNESS / 2))
    model, _ = rest(strip(start, length, cells, [table], lambda x: x < start + 1e-9))
    line = middle(model) / LENGTH
    assert -line[-1, 2] == pytest.approx(tip, rel=0.03)
    assert line[:, 2].max() == pytest.approx(uplift, rel=0.04)
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    state = term.evaluate(model.points + model.displacement)  # type: ignore[operator]
    where = term.samples.positions(model.points)[state.elements][..., 0] / LENGTH
    near = where > -0.3
    force = np.linalg.norm(state.sample_forces[near].sum(axis=0)) / (WIDTH * WEIGHT * LENGTH)
    assert force == pytest.approx(reaction, rel=0.03)
    behind = where[~near & (state.depth > 0)]
    assert -behind.max() == pytest.approx(lift_off, rel=0.015)


@pytest.mark.parametrize(
    ("height", "free", "force"), [(0.1, 1.247009, 0.62512), (0.5, 1.902088, 0.97943)]
)
def test_strip_lifted_by_an_end_and_its_lowest_mode(
    height: float, free: float, force: float
) -> None:
    """The lifted part vibrates as a beam that is clamped where it touches the ground."""
    length = 2.5 * LENGTH
    # The middle is hinged at its height, the ends are above the ground and fall.
    rested, _ = rest(lifted_strip(height * LENGTH, length, 80))
    (contact,) = report_contact(rested)
    carried = WIDTH * WEIGHT * length + contact.force[2]
    assert carried / (WIDTH * WEIGHT * LENGTH) == pytest.approx(force, rel=0.02)
    found = rested.modes(1)
    rate = math.sqrt(found.eigenvalues[0] * rested.modulus / rested.density)
    beam = (3.9266 / (free * LENGTH)) ** 2 * math.sqrt(BENDING / 0.15)
    # The closed form is that of a straight beam, and holds for the lower height.
    assert height > 0.1 or rate == pytest.approx(beam, rel=0.03)


def lifted_strip(height: float, length: float, cells: int) -> Model:
    """Return a strip whose middle is hinged above the ground; its ends lie on the ground."""
    ground = Plane((0, 0, -height - THICKNESS / 2))
    model = strip(-length, length, cells, [ground], lambda x: abs(x) < 1e-9)
    points, fixed = model.points, ~model.free.reshape(-1, 3)
    middle = abs(points[:, 0]) < 1e-9
    fixed[middle] = [True, True, True]
    fixed[middle & (points[:, 2] < 0)] = [False, True, False]
    return Model(points, model.cells, PLATE, model.density, fixed, terms=model.terms)


def touch_down(model: Model) -> float:
    """Return the distance from the middle of a lifted strip at which it touches the ground."""
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    state = term.evaluate(model.points + model.displacement)  # type: ignore[operator]
    along = abs(term.samples.positions(model.points)[state.elements][..., 0])
    return float(along[state.depth > 0].min())


@pytest.mark.parametrize("cells", [56, 80])
def test_contact_opens_where_a_load_moves_its_line_by_about_a_cell(cells: int) -> None:
    """A load on the lifted parts; the state without linearisation is found anew."""
    length = 2.5 * LENGTH
    model = lifted_strip(0.1 * LENGTH, length, cells)
    rested, _ = rest(model)
    load = np.zeros_like(model.points)
    near = abs(abs(model.points[:, 0]) - 0.5 * LENGTH) < length / cells
    load[near, 2] = WIDTH * WEIGHT * LENGTH / near.sum()
    moved = rested.statics(load.reshape(-1, 1))[0].reshape(1, -1, 3)
    (contact,) = resting_contacts(rested)
    opening = contact.find_openings(moved)
    for multiple, side in ((opening.forwards[0], 1.0), (-opening.backwards[0], -1.0)):
        line = touch_down(rest(model, more=multiple * load)[0]) - touch_down(rested)
        assert 0.3 < side * line / (2 * length / cells) < 2.5


def test_cloth_on_a_plane_opens_when_a_load_lifts_its_weight() -> None:
    points, cells, terms = sheet((0, 0.1, 0, 0.1), (6, 6), [Plane((0, 0, -1e-3))], 0.3)
    free = np.zeros(points.shape, dtype=bool)
    model, _ = rest(Model(points, cells, PLATE, 0.15 / THICKNESS, free, terms=terms))
    load = np.outer(model.nodal_mass, (0, 0, GRAVITY / 2)).reshape(-1, 1)
    moved = model.statics(load)[0].reshape(1, -1, 3)
    (contact,) = resting_contacts(model)
    opening = contact.find_openings(moved)
    assert opening.forwards == pytest.approx([2.0], rel=1e-6)
    assert np.isinf(opening.backwards).all()


def bend(model: Model, place: Any, angle: Any) -> Resting:
    """Return the state of a strip that is laid on a curve in x and z without stretch."""
    points, (x, z) = model.points, place
    normal = points[:, 2] * np.stack([-np.sin(angle), np.cos(angle)])
    moved = np.stack([x + normal[0], points[:, 1], z + normal[1]], axis=1)
    return Resting(moved - points, np.empty((0, 3)))


@pytest.mark.parametrize("cells", [40, 80])
def test_loop_between_two_plates_pushes_them_apart(cells: int) -> None:
    """An elastica without weight; one half of it, from the clamped apex to one of the plates."""
    gap = 0.02
    plate = Plane((gap / 2 + THICKNESS / 2, 0, 0), (-1, 0, 0))
    model = strip(0, 1.4 * gap, cells, [plate], lambda x: x < 1e-9)
    along, radius = model.points[:, 0], gap / 2
    angle = np.minimum(along / radius, math.pi / 2)
    straight = np.maximum(along - radius * math.pi / 2, 0.0)
    place = radius * np.sin(angle), radius * (1 - np.cos(angle)) + straight
    model, _ = rest(model, (0, 0, 0), start=bend(model, place, angle))
    (contact,) = report_contact(model)
    assert contact.force[0] / WIDTH * gap**2 / BENDING == pytest.approx(2.871080, rel=1e-3)


@pytest.mark.parametrize(
    ("shortening", "half", "thrust", "height"),
    [(0.2, 1.93605, 5.40632, 0.52044), (1.0, 2.48110, 3.32036, 1.24441)],
)
def test_ruck_in_a_strip_whose_ends_are_brought_together(
    shortening: float, half: float, thrust: float, height: float
) -> None:
    """One half of it: its crest stays level, and the far end is held."""
    length, cells = (half + 1.2) * LENGTH, 80
    ground = Plane((0, 0, -THICKNESS / 2))
    model = strip(0, length, cells, [ground], lambda x: x > length - 1e-9)
    points, held = model.points, ~model.free.reshape(-1, 3)
    along, lifted = points[:, 0], half * LENGTH
    held[along < 1e-9, 0] = True
    model = Model(points, model.cells, PLATE, model.density, held, terms=model.terms)
    phase = math.pi * np.minimum(along / lifted, 1.0)
    rise = height / 2 * LENGTH * (1 + np.cos(phase))
    slope = -height / 2 * math.pi / half * np.sin(phase)
    place = along - shortening / 2 * LENGTH * phase / math.pi, rise
    model, _ = rest(model, start=bend(model, place, np.arctan(slope)))
    assert middle(model)[:, 2].max() / LENGTH == pytest.approx(height, rel=3e-3)
    pushed = model.forces.reshape(-1, 3)[along < 1e-9].sum(axis=0)
    assert pushed[0] / (WIDTH * WEIGHT * LENGTH) == pytest.approx(thrust, rel=5e-3)
    (term,) = model.terms
    assert isinstance(term, ObstacleTerm)
    state = term.evaluate(points + model.displacement)  # type: ignore[operator]
    where = term.samples.positions(points)[state.elements][..., 0] / LENGTH
    assert where[state.depth > 0].min() == pytest.approx(half, rel=0.01)


def test_tablecloth_rests_with_its_weight_on_the_table() -> None:
    """It falls on it first; found by way of cells twice as wide."""
    disc = Cylinder(0.09, 0.02, 0.005, (0, 0, -0.05))
    points, cells, terms = sheet((-0.15, 0.15, -0.15, 0.15), (18, 18), [disc], 0.3, 3e-4)
    free = np.zeros(points.shape, dtype=bool)
    model, found = rest(Model(points, cells, PLATE, 0.15 / 3e-4, free, terms=terms))
    (contact,) = report_contact(model)
    weight = WEIGHT * 0.09
    np.testing.assert_allclose(contact.force, [0, 0, -weight], atol=1e-6 * weight)
    assert 0 < contact.sliding < contact.points
    corners = (model.points + found.displacement)[
        (abs(model.points[:, :2]) > 0.15 - 1e-9).all(axis=1)
    ]
    assert corners[:, 2].max() < -0.04 - 0.04
    assert model.modes(1).eigenvalues[0] > 0


def rest_on_slope(degrees: float) -> Model:
    """Return a cloth at rest on a slope, with μ = 0.3."""
    points, cells, terms = sheet((0, 0.1, 0, 0.1), (4, 4), [Plane((0, 0, -1e-3))], 0.3)
    free = np.zeros(points.shape, dtype=bool)
    angle = math.radians(degrees)
    down = GRAVITY * np.array([math.sin(angle), 0, -math.cos(angle)])
    return rest(Model(points, cells, PLATE, 0.15 / THICKNESS, free, terms=terms), down)[0]


def test_cloth_keeps_the_gap_of_its_obstacle() -> None:
    heights = []
    for gap in (0.0, 2e-3):
        plane = {"shape": "plane", "center": [0, 0, -5e-3], "friction": 0.3, "gap": gap}
        modal = {"elements": "sheet", "fixed": "", "gravity": [0, 0, -GRAVITY], "modes": 1}
        threads = {"ends": 40, "picks": 40, "warp_spacing": "1 mm", "weft_spacing": "1 mm"}
        scene = Scene(
            {
                "weave": threads,
                "cage": {"divisions": [4, 4, 1]},
                "modal": {**modal, "obstacles": [plane]},
            }
        )
        scene.update_stage(scene.modal)
        rested = vtk_to_numpy(scene.modal.output.GetPointData().GetArray("equilibrium"))
        heights.append(rested[:, 2])
    assert heights[1] - heights[0] == pytest.approx(2e-3, abs=1e-8)


def test_cloth_on_a_slope_sticks_below_the_angle_of_friction() -> None:
    """This angle is arctan 0.3 = 16.7°."""
    for degrees in (16.0, 16.65):
        (contact,) = report_contact(rest_on_slope(degrees))
        angle = math.radians(degrees)
        carried = WEIGHT * 0.01 * np.array([math.sin(angle), 0, -math.cos(angle)])
        np.testing.assert_allclose(contact.force, carried, atol=1e-6 * WEIGHT * 0.01)
        assert contact.sliding == 0
    with pytest.raises(SolverError, match="no equilibrium with friction"):
        rest_on_slope(17.5)


def test_cloth_that_slides_everywhere_turns_against_friction() -> None:
    """Friction pulls all of its points away from the middle, and keeps its direction.

    The torque per angle is μ w ∫ r dA, with the mean distance 0.3825978 of a square's points from
    its middle, and the moment of inertia m a²/6; nothing resists a translation.
    """
    side, mu = 0.1, 0.3
    points, cells, terms = sheet((0, side, 0, side), (6, 6), [Plane((0, 0, -1e-6))], mu)
    model = Model(
        points, cells, PLATE, 0.15 / THICKNESS, np.zeros(points.shape, dtype=bool), terms=terms
    )
    surface = model.pencil.surface
    assert surface is not None
    where = terms[0]._given.positions(surface.to_nodes(points)).reshape(-1, 3)
    middle = np.array([side / 2, side / 2, 0])
    moved = np.zeros(points.shape)
    moved[:, 2] = -3e-5  # deeper than at rest, so that anchors stay far enough away
    model, _ = rest(model, start=Resting(moved, where + 0.1 * (where - middle)))
    (contact,) = report_contact(model)
    assert contact.sliding == contact.points == 16 * 36
    found = model.modes(3).eigenvalues * model.modulus / model.density
    np.testing.assert_array_equal(found[:2], 0.0)
    assert found[2] == pytest.approx(6 * 0.3825978 * mu * GRAVITY / side, rel=0.01)


def test_cloth_on_a_plane_without_friction_has_three_rigid_motions() -> None:
    points, cells, terms = sheet((0, 0.1, 0, 0.1), (4, 4), [Plane((0, 0, -1e-3))])
    free = np.zeros(points.shape, dtype=bool)
    model, _ = rest(Model(points, cells, PLATE, 0.15 / THICKNESS, free, terms=terms))
    found = model.modes(4).eigenvalues
    assert (found[:3] == 0.0).all()
    assert found[3] > 0.0


@pytest.mark.parametrize(("mu", "pulls"), [(0.1, 3), (0.3, 5)])
def test_strip_pulled_over_a_cylinder_multiplies_its_tension(mu: float, pulls: int) -> None:
    """T₂/T₁ = e^{μπ} once all of it slides (Euler); bending adds less than a tenth of a percent."""
    radius, tail, tension = 0.05, 0.03, 10.0
    length = math.pi * radius + 2 * tail
    body = Cylinder(radius - THICKNESS / 2, axis=(0, 1, 0), center=(0, 0, -radius - 1e-6))
    model = strip(-length / 2, length, 80, [body], lambda x: x < -1, mu)
    points = model.points
    first, last = (abs(points[:, 0] - side * length / 2) < 1e-9 for side in (-1, 1))
    forces = np.zeros(points.shape)
    forces[first | last, 2] = -tension * WIDTH / first.sum()
    found = find_resting_state(model, forces.ravel())
    # From now on the last end is held and pulled down step by step.
    held = ~model.free.reshape(-1, 3)
    held[last] = True
    forces[last] = 0.0
    model = Model(points, model.cells, PLATE, model.density, held, terms=model.terms)
    for _ in range(pulls):
        moved = found.displacement.copy()
        moved[last, 2] -= 3e-4
        found = find_resting_state(model, forces.ravel(), start=Resting(moved, found.anchors))
    terms = rested_terms(model.terms, points + found.displacement, found.anchors)
    state = Model(
        points, model.cells, PLATE, model.density, held, False, found.displacement, terms=terms
    )
    (contact,) = report_contact(state)
    assert contact.sliding == contact.points
    ratio = -contact.force[2] / (tension * WIDTH) - 1
    assert ratio == pytest.approx(math.exp(mu * math.pi), rel=1e-3)


def test_cloth_beside_its_obstacle_is_refused() -> None:
    points, cells, terms = sheet((-0.1, 0.1, -0.1, 0.1), (4, 4), [Sphere(0.05, (1, 0, -0.2))])
    model = Model(points, cells, PLATE, 1.0, np.zeros(points.shape, dtype=bool), terms=terms)
    with pytest.raises(InputError, match="falls past its obstacles"):
        rest(model)


def test_cloth_that_slides_off_a_ball_is_refused_with_a_cure() -> None:
    ball = Sphere(0.05, (0.03, 0, -0.06))
    points, cells, terms = sheet((-0.1, 0.1, -0.1, 0.1), (6, 6), [ball])
    free = np.zeros(points.shape, dtype=bool)
    model = Model(points, cells, PLATE, 0.15 / THICKNESS, free, terms=terms)
    with pytest.raises(SolverError, match="without friction it slides off") as error:
        rest(model)
    assert "friction" in str(error.value.cure)


def test_terms_of_different_contact_have_different_digests() -> None:
    points, _, (term,) = sheet((0, 1, 0, 1), (4, 4), [Plane()], 0.3)
    others: list[EnergyTerm] = [
        term,
        term.replace(obstacle=Plane((0, 0, 1e-3))),
        term.replace(obstacle=Sphere(1.0)),
        term.replace(stiffness=1.0),
        term.replace(offset=1e-3),
        term.replace(coefficient=0.0),
        term.at_rest(points, np.zeros((term.samples.areas.size, 3))),
    ]
    assert len({each.digest for each in others}) == len(others)


SCENE = """
[weave]
ends = 20
picks = 20
warp_spacing = "10 mm"
weft_spacing = "10 mm"
warp_diameter = "0.25 mm"
[cage]
divisions = [8, 8, 1]
[modal]
fixed = ""
elements = "sheet"
modes = 4
gravity = [0, 0, -9.81]
bending_rigidity = "10 uN.m"
tensile_rigidity = "1500 N/m"
areal_mass = "0.15 kg/m2"
[[modal.obstacles]]
shape = "disc"
radius = "60 mm"
center = [0, 0, "-20 mm"]
friction = 0.3
"""


def test_info_and_modes_report_what_a_cloth_does_to_its_table(tmp_path: Path) -> None:
    (tmp_path / "table.toml").write_text(SCENE, encoding="utf-8")
    scene = Scene.read(tmp_path / "table.toml")
    for found in (report_fabric(scene), report_modes(scene)):
        (contact,) = found["contact"]
        assert contact["force"] == pytest.approx(9.81 * 0.15 * 0.2**2, rel=1e-6)
    (row,) = (each for each in cloth_figures(report_fabric(scene)) if each.key == "contact_0")
    assert f"{contact['points']} points" in row.text


def test_response_warns_if_it_would_lift_the_cloth_off_its_table(tmp_path: Path) -> None:
    """The whole cloth rests on the table; a pull of less, and of more than its weight."""
    text = (
        SCENE.replace("60 mm", "200 mm")
        + """
[response]
damping_ratio = 0.5
[[response.loads]]
pressure = "{} Pa"
on = "-z"
time = "step"
"""
    )
    for pull, lifts in ((1.3, False), (1.6, True)):  # it weighs 0.15 · 9.81 = 1.47 Pa
        (tmp_path / "table.toml").write_text(text.format(pull), encoding="utf-8")
        scene = Scene.read(tmp_path / "table.toml")
        scene.update(10.0)
        assert any("lifts off obstacle 0" in text for text in scene.warnings) == lifts


def test_dropped_cloth_falls_from_the_state_in_the_file(tmp_path: Path) -> None:
    """A table without an edge is the same everywhere: what was moved along it stays moved."""
    text = SCENE.replace('"disc"\nradius = "60 mm"', '"plane"')
    (tmp_path / "table.toml").write_text(text, encoding="utf-8")
    resting = [Scene.read(tmp_path / "table.toml") for _ in range(2)]
    # The state has other cells than the cage.
    points, cells = build_lattice((-0.2, 0.2, -0.2, 0.2, -0.01, 0.01), (3, 2, 1))
    move = np.array([3e-3, -2e-3, 0.1])
    state = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points)
    state["displacement"] = np.tile(move, (len(points), 1))
    state.save(tmp_path / "state.vtu")
    resting[1].assign("modal", "start", str(tmp_path / "state.vtu"))
    places = []
    for scene in resting:
        scene.update_stage(scene.modal)
        places.append(vtk_to_numpy(scene.modal.output.GetPointData().GetArray("equilibrium")))
    assert np.abs(places[1] - places[0] - [*move[:2], 0.0]).max() < 1e-6
