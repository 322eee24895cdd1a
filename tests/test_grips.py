"""Grips that move and turn, and what holds a body, against closed forms."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from test_contact import PLATE as SHEET
from test_contact import THICKNESS as THIN
from test_contact import WIDTH, strip
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.reactions import path_reactions_of, reactions_of
from spacemap_vtk.draw.figure.reaction_plot import reaction_curves
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.transient_response import TransientResponse
from spacemap_vtk.jobs import ReactionsJob
from spacemap_vtk.mechanics.boundary.fittings import make_fittings
from spacemap_vtk.mechanics.boundary.grips import Grip, GripMotion, held_by, make_grip
from spacemap_vtk.mechanics.boundary.reactions import Reaction, find_bearings
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction, harmonic, step, table
from spacemap_vtk.mechanics.contact.obstacles import Cylinder
from spacemap_vtk.mechanics.contact.path import states_on_path
from spacemap_vtk.mechanics.contact.reactions import list_reactions
from spacemap_vtk.mechanics.contact.resting import Resting, find_resting_state, rested_terms
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion
from spacemap_vtk.scenes.figure_list import cloth_figures
from spacemap_vtk.scenes.report import report_fabric, report_modes
from spacemap_vtk.scenes.scene import Scene

FloatArray = NDArray[np.float64]
#: Bending [N m] and stretch [N/m] of a sheet without Poisson's effect; its thickness [m].
BENDING, STRETCH, THICKNESS = 1e-5, 1e3, 1e-4
PLATE = Plate(STRETCH * np.diag([1, 1, 0.5]), BENDING * np.diag([1, 1, 0.5]))


def sheet(length: float, width: float, cells: tuple[int, int]) -> Any:
    """Return vertices and tetrahedra of a flat sheet across z."""
    box = (0, length, 0, width, -THICKNESS / 2, THICKNESS / 2)
    return build_lattice(box, (*cells, 1))


def pull(
    mesh: Any, supports: Sequence[str], grips: list[Grip], gravity: ArrayLike = (0, 0, 0)
) -> list[list[Reaction]]:
    """Return the reactions of supports and grips of a sheet at each place of the grips' path."""
    points, cells = mesh
    bearings = find_bearings(points, supports, grips)
    held = np.any([each.shares.any(axis=2) for each in bearings], axis=0)
    model = Model(points, cells, PLATE, 0.15 / THICKNESS, held)
    load = np.outer(model.nodal_mass, gravity).ravel()
    return [
        list_reactions(
            model, state.displacement, state.holding, bearings, [g.moves[k] for g in grips]
        )
        for k, state in enumerate(states_on_path(model, load, grips=grips))
    ]


def test_grip_turns_and_moves_its_vertices() -> None:
    """A quarter about z carries x to y, whatever the centre; other vertices are free."""
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0.0]])
    turns = [[0, 0, 0], [0, 0, math.pi / 2]]
    grip = make_grip(square, "+x", moves=[[0, 0, 0], [0, 0, 5]], turns=turns, center=(0, 0, 0))
    moved = square + grip.displacement(square, 1.0)
    np.testing.assert_allclose(moved, [[0, 0, 0], [0, 2, 5], [-2, 2, 5], [0, 2, 0]], atol=1e-14)
    half = 0.5**0.5
    at_half = (square + grip.displacement(square, 0.5))[1]
    np.testing.assert_allclose(at_half, [2 * half, 2 * half, 2.5], rtol=1e-14)


def test_strip_that_is_pulled_has_the_force_of_its_green_strain() -> None:
    """F = A b (1 + e)(e + e²/2), with the same force on both ends and no moment."""
    mesh, stretch = sheet(0.1, 0.02, (8, 2)), np.array([0.0, 1e-4, 0.01, 0.05])
    grip = make_grip(mesh[0], "+x", moves=np.outer(0.1 * stretch, (1, 0, 0)))
    for e, (support, pulled) in zip(stretch, pull(mesh, ["-x"], [grip]), strict=True):
        force = STRETCH * 0.02 * (1 + e) * (e + e**2 / 2)
        np.testing.assert_allclose(pulled.force, [force, 0, 0], atol=1e-9)
        np.testing.assert_allclose(support.force, [-force, 0, 0], atol=1e-9)
        np.testing.assert_allclose(pulled.moment, 0, atol=1e-10)


def test_strip_whose_ends_approach_buckles_at_eulers_load() -> None:
    """4π² B b/L² with clamped ends, plus the start of the elastica: 1 + s/(2 L)·… after it."""
    length, width = 0.1, 0.02
    mesh = sheet(length, width, (32, 1))
    grip = make_grip(mesh[0], "+x", moves=np.outer([0, 2e-4, 4e-4], (-1, 0, 0)))
    euler = 4 * math.pi**2 * BENDING * width / length**2
    ((_, first), (_, second)) = pull(mesh, ["-x"], [grip])[1:]
    # Post-buckling: P/P_E = 1 + s/(2L) for shortening s of a clamped strip.
    start = 2 * first.force[0] - second.force[0]
    assert start == pytest.approx(-euler, rel=8e-3)


def test_strip_whose_end_is_turned_bends_to_a_circle() -> None:
    """M = B b κ, while the grip follows the circle so that nothing is stretched."""
    length, width, cells = 0.1, 0.02, 40
    mesh, angles = sheet(length, width, (cells, 1)), np.linspace(0, math.pi, 13)
    # The middles of the cells' ends lie on the circle of which the cells are chords.
    radius = length / cells / 2 / np.sin(np.maximum(angles, 1e-9) / cells / 2)
    x, z = radius * np.sin(angles), radius * (1 - np.cos(angles))
    moves = np.stack([np.where(angles > 0, x - length, 0), 0 * x, z], axis=1)
    turns = np.outer(angles, (0, -1, 0))
    grip = make_grip(mesh[0], "+x", moves=moves, turns=turns)
    for angle, (support, turned) in zip(angles, pull(mesh, ["-x"], [grip]), strict=True):
        moment = BENDING * width * angle / length
        np.testing.assert_allclose(turned.moment, [0, -moment, 0], atol=2e-3 * moment + 1e-15)
        np.testing.assert_allclose(support.moment, [0, moment, 0], atol=2e-3 * moment + 1e-15)


def test_grips_and_supports_carry_the_weight_of_a_hanging_cloth() -> None:
    """The sum of forces is the weight and that of moments its moment, at every place."""
    points, cells = sheet(0.2, 0.2, (6, 6))
    corner = "box({}, 0.16, 0.2, -1, 1)"
    left, right = corner.format("0, 0.04"), corner.format("0.16, 0.2")
    grip = make_grip(points, right, moves=np.outer([0, 0.02, 0.05], (-1, 0, 0)))
    bearings = find_bearings(points, [left], [grip])
    held = held_by([grip], points.shape) | bearings[0].shares.any(axis=2)
    model = Model(points, cells, PLATE, 0.15 / THICKNESS, held)
    weight = np.outer(model.nodal_mass, (0, -9.81, 0))
    for k, state in enumerate(states_on_path(model, weight.ravel(), grips=[grip])):
        found = list_reactions(model, state.displacement, state.holding, bearings, [grip.moves[k]])
        total = np.sum([each.force for each in found], axis=0)
        np.testing.assert_allclose(total, -weight.sum(axis=0), atol=1e-9 * abs(weight.sum()))
        turning = np.cross(points + state.displacement, weight).sum(axis=0)
        turning += np.sum(
            [each.moment + np.cross(each.about, each.force) for each in found], axis=0
        )
        np.testing.assert_allclose(turning, 0, atol=1e-9)


def test_vertices_in_two_places_count_once() -> None:
    """Supports share what holds the body: the sum of their projections is that of all."""
    points, _ = sheet(0.1, 0.1, (2, 2))
    bearings = find_bearings(points, ["-x", "-y:(0, 1, 1)", "-y:xz"])
    total = np.sum([each.shares for each in bearings], axis=0)
    edge = (points[:, 0] == 0) | (points[:, 1] == 0)
    np.testing.assert_allclose(total, edge[:, None, None] * np.eye(3), atol=1e-12)


def test_grip_along_a_direction_or_turning_with_free_components_is_refused() -> None:
    points, _ = sheet(0.1, 0.1, (2, 2))
    with pytest.raises(InputError, match="not along a direction"):
        make_grip(points, "+x:(1, 1, 0)")
    with pytest.raises(InputError, match="cannot turn"):
        make_grip(points, "+x:x", turns=[[0, 0, 0], [0, 0, 1]])


def strip_over_cylinder(cells: int) -> tuple[Model, FloatArray, str, Resting]:
    """Return a strip on half a cylinder, loads, the place of its grip, and its state at rest."""
    model, tail, tension = strip_on_cylinder(cells), 0.03, 10.0
    end = math.pi * 0.025 + tail
    first, last = (abs(model.points[:, 0] - side * end) < 1e-9 for side in (-1, 1))
    forces = np.zeros(model.points.shape)
    forces[first | last, 2] = -tension * WIDTH / first.sum()
    found = find_resting_state(model, forces.ravel())
    held = ~model.free.reshape(-1, 3)
    held[last] = True
    forces[last] = 0.0
    gripped = Model(model.points, model.cells, SHEET, model.density, held, terms=model.terms)
    return gripped, forces, f"box({end - 1e-4}, 1, -1, 1, -1, 1)", found


def strip_on_cylinder(cells: int) -> Model:
    """Return a flat strip above a cylinder with a coefficient of friction of 0.1."""
    radius, length = 0.05, math.pi * 0.05 + 0.06
    body = Cylinder(radius - THIN / 2, axis=(0, 1, 0), center=(0, 0, -radius - 1e-6))
    return strip(-length / 2, length, cells, [body], lambda x: x < -1, 0.1)


def test_grip_that_pulls_a_strip_over_a_cylinder_needs_eulers_force() -> None:
    """T₂/T₁ = e^{μπ} while it pulls, and e^{-μπ} once it has moved back; forces are balanced."""
    model, forces, place, found = strip_over_cylinder(40)
    pulls = 1e-4 * np.array([0, 6, 9, 12, 6, 0, -6])
    grip = make_grip(model.points, place, moves=np.outer(pulls, (0, 0, -1)))
    bearings, ratios = find_bearings(model.points, [], [grip]), []
    states = states_on_path(model, forces.ravel(), start=found, grips=[grip])
    for move, state in zip(grip.moves, states, strict=True):
        terms = rested_terms(model.terms, model.points + state.displacement, state.anchors)
        given = state.displacement, state.holding, bearings, [move], terms
        pulled, cylinder = list_reactions(model, *given)
        ratios.append(pulled.force[2] / forces[:, 2].sum())
        total = pulled.force + cylinder.force + forces.sum(axis=0)
        np.testing.assert_allclose(total[[0, 2]], 0, atol=1e-7 * abs(forces).sum())
    euler = math.exp(0.1 * math.pi)
    assert ratios[0] == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(ratios[2:4], euler, rtol=2e-3)
    np.testing.assert_allclose(ratios[4:], 1 / euler, rtol=2e-3)


def test_grip_that_pulls_slowly_in_time_needs_eulers_force() -> None:
    """In few steps: rounding of samples that hardly move does not stop Newton's method."""
    model, forces, place, found = strip_over_cylinder(24)
    terms = rested_terms(model.terms, model.points + found.displacement, found.anchors)
    held = ~model.free.reshape(-1, 3)
    data = model.points, model.cells, SHEET, model.density, held, False, found.displacement
    cage = CageModes(
        Model(*data, terms=terms), np.empty(0), np.empty((0, model.points.size)), np.empty(0)
    )
    rise = np.linspace(0, 1, 9)
    slow = table((0.02 * rise).tolist(), ((1 - np.cos(np.pi * rise)) / 2).tolist())
    grip = make_grip(model.points, place)
    grip = grip._replace(motion=GripMotion(np.array([0, 0, -1e-3]), np.zeros(3), slow))
    motion = SteppedMotion(
        cage,
        damping=Damping(alpha=200, beta=1e-4),
        settled=True,
        max_step=2e-3,
        tolerance=1e-2,
        grips=[grip],
        bearings=find_bearings(model.points, [], [grip]),
        holding=model.holding_forces(found.displacement, forces.ravel(), terms),
    )

    def limit(_: float) -> None:
        assert len(motion.states) < 300

    motion.step_until(0.03, limit)
    ((pulled, cylinder),) = motion.reactions(np.array([0.03]))
    euler = math.exp(0.1 * math.pi)
    assert pulled[2] / forces[:, 2].sum() == pytest.approx(euler, rel=0.02)
    assert motion.contact_energies(np.array([0.03]))[0, 0] > 0
    _, _, kinetic, strain, damped, work = motion.states[:, :6].T
    balance = kinetic + strain + damped - work
    np.testing.assert_allclose(balance, balance[0], atol=1e-9 * work.max())
    assert abs((pulled + cylinder)[2] + forces[:, 2].sum()) < 0.01 * abs(forces).sum()


def test_rigid_place_beside_a_grip_is_refused_with_a_cure() -> None:
    """Its constraint is that of small rotations; a grip itself is rigid, however far it turns."""
    points, cells = sheet(0.1, 0.02, (4, 1))
    grip = make_grip(points, "+x", turns=[[0, 0, 0], [0, 1.0, 0]])
    held, fittings = make_fittings(points, cells, ["-x"], ["box(0.04, 0.06, -1, 1, -1, 1)"], [], [])
    model = Model(points, cells, PLATE, 1.0, held | grip.held, fittings=fittings)
    with pytest.raises(InputError, match="rigid place cannot") as caught:
        next(iter(states_on_path(model, grips=[grip])))
    assert "hold it with a grip" in str(caught.value.cure)


SCENE = """
[weave]
ends = 4
picks = 12
[cage]
divisions = [2, 12, 1]
[modal]
elements = "sheet"
fixed = "-y"
modes = 2
path_steps = 4
tensile_rigidity = "1 kN/m"
bending_rigidity = "10 uN.m"
areal_mass = "0.15 kg/m2"
poissons_ratio_in_plane = 0
[[modal.grips]]
place = "+y"
path = [[0, "0.1 mm", 0], [0, "0.2 mm", 0]]
"""


def test_modes_and_info_report_reactions_of_a_scene(tmp_path: Path) -> None:
    """Force and moment of each body in SI; the modes are those of the gripped strip."""
    (tmp_path / "strip.toml").write_text(SCENE, encoding="utf-8")
    scene = Scene.read(tmp_path / "strip.toml")
    for found in (report_fabric(scene), report_modes(scene)):
        support, grip = found["reactions"]
        assert (support["kind"], support["name"]) == ("support", "-y")
        assert (grip["kind"], grip["name"]) == ("grip", "+y")
        np.testing.assert_allclose(np.add(support["force"], grip["force"]), 0, atol=1e-9)
    path = path_reactions_of(scene.modal.output)
    assert path is not None
    np.testing.assert_allclose(path.moves[:, 0, 1], np.linspace(0, 2e-4, 9), rtol=1e-12)
    np.testing.assert_allclose(path.forces[-1, 1], grip["force"], rtol=1e-12)
    held = vtk_to_numpy(scene.modal.output.GetPointData().GetArray("reaction"))
    np.testing.assert_allclose(held.sum(axis=0), 0, atol=1e-9)
    (row,) = (each for each in cloth_figures(report_fabric(scene)) if each.key == "reaction_1")
    assert row.label == "reaction of grip +y"
    assert row.value == pytest.approx(np.linalg.norm(grip["force"]))


def test_two_that_hold_the_same_vertex_are_refused(tmp_path: Path) -> None:
    text = SCENE.replace('fixed = "-y"', 'fixed = "-x"')
    (tmp_path / "strip.toml").write_text(text, encoding="utf-8")
    scene = Scene.read(tmp_path / "strip.toml")
    with pytest.raises(InputError, match=r'grip "\+y" and a support hold the same') as caught:
        scene.update_stage(scene.modal)
    assert caught.value.key == "grips[0].place"


def stepped(function: TimeFunction, gravity: float = 0.0) -> tuple[SteppedMotion, Grip]:
    """Return the motion of a strip, one end of which is moved and turned in time."""
    points, cells = sheet(0.1, 0.02, (4, 1))
    motion = GripMotion(np.array([0.002, 0.002, 0.004]), np.array([0.5, 0.3, 0.1]), function)
    grip = make_grip(points, "+x")._replace(motion=motion)
    bearings = find_bearings(points, ["-x"], [grip])
    held = np.any([each.shares.any(axis=2) for each in bearings], axis=0)
    model = Model(points, cells, PLATE, 0.15 / THICKNESS, held)
    cage = CageModes(model, np.empty(0), np.empty((0, points.size)), np.empty(0))
    load = cage.load_vector("gravity", (0, 0, -gravity), step())
    bounds = {"max_step": 2e-3, "tolerance": math.inf}
    held_by_both = {"grips": [grip], "bearings": bearings}
    return SteppedMotion(cage, [load], Damping(beta=1e-3), **bounds, **held_by_both), grip


@pytest.mark.parametrize("function", [table([0, 0.01], [0, 1]), harmonic(10.0)])
def test_work_of_a_grip_is_the_energy_that_the_body_gains(function: TimeFunction) -> None:
    """Exactly, in steps of any length; and forces over time are the change of momentum."""
    motion, grip = stepped(function, 9.81)
    motion.step_until(0.016)
    assert grip.motion is not None
    found = motion.at_time(motion.states[5, 0])[0]
    displacement, _ = grip.motion.displace(motion.points, grip.center, motion.states[5, 0])
    np.testing.assert_allclose(found[grip.held], displacement[grip.held], atol=1e-12)
    times, _, kinetic, strain, lost, work, _, _, gripped = motion.states[:, :9].T
    np.testing.assert_allclose(kinetic + strain + lost, work, atol=1e-10 * abs(work).max())
    # Without loads all of the work is the grip's.
    assert motion.grip_work(times[-1:])[0] == pytest.approx(gripped[-1] * motion.model.modulus)
    alone, _ = stepped(function)
    alone.step_until(0.008)
    np.testing.assert_allclose(alone.states[:, 8], alone.states[:, 5], rtol=1e-12)
    # Momentum, at the times of states, of rates that the mass matrix turns into momenta.
    weight, model = np.array([0, 0, -9.81]) * motion.model.nodal_mass.sum(), motion.model
    whole = model.mass
    spans = np.diff(times)
    begins, ends = np.flatnonzero(spans > 0), np.flatnonzero(spans > 0) + 1
    rates = [motion.at_time(time)[1] for time in (times[begins[3]], times[ends[6]])]
    momenta = [(whole @ rate.ravel()).reshape(-1, 3).sum(axis=0) for rate in rates]
    middles = (times[begins[3:7]] + times[ends[3:7]]) / 2
    forces = motion.reactions(middles)[:, :, :3].sum(axis=1) + weight
    impulse = spans[begins[3:7]] @ forces
    np.testing.assert_allclose(momenta[1] - momenta[0], impulse, atol=1e-6 * abs(impulse).max())


@pytest.mark.parametrize(
    "function",
    [table([0, 0.01], [0, 1]), pytest.param(harmonic(10.0), marks=pytest.mark.nightly)],
)
def test_grip_moves_relative_to_a_moving_base(function: TimeFunction) -> None:
    """As if there were no base and two grips, of which one moves like it and one like both."""
    points, cells = sheet(0.1, 0.02, (4, 1))
    base, own = np.array([0.001, 0.0, 0.003]), np.array([0.002, 0.001, 0.0])
    turn = np.array([0.2, 0.3, 0.0])

    def motion_of(moves: dict[str, tuple[FloatArray, FloatArray]], loads: bool) -> SteppedMotion:
        grips = [
            make_grip(points, place)._replace(motion=GripMotion(*each, function))
            for place, each in moves.items()
        ]
        supports = [place for place in ("-x",) if place not in moves]
        bearings = find_bearings(points, supports, grips)
        held = np.any([each.shares.any(axis=2) for each in bearings], axis=0)
        model = Model(points, cells, PLATE, 0.15 / THICKNESS, held)
        cage = CageModes(model, np.empty(0), np.empty((0, points.size)), np.empty(0))
        shakes = [cage.load_vector("base_displacement", base, function)] if loads else []
        given = {"max_step": 5e-4, "tolerance": 1e-5, "grips": grips, "bearings": bearings}
        return SteppedMotion(cage, shakes, Damping(beta=1e-3), settled=True, **given)

    shaken = motion_of({"+x": (own, turn)}, True)
    alone = motion_of({"-x": (base, 0 * turn), "+x": (base + own, turn)}, False)
    for time in (0.004, 0.012):
        found, expected = shaken.at_time(time)[0], alone.at_time(time)[0]
        np.testing.assert_allclose(found, expected, atol=2e-4 * abs(expected).max())
        np.testing.assert_allclose(
            shaken.reaction_points(time), alone.reaction_points(time), atol=1e-9
        )


def energies_at_rest(scene: Scene) -> float:
    """Return the strain energy of the state in which a scene begins [J]."""
    mover = scene.stage("mover")
    assert isinstance(mover, TransientResponse)
    assert mover.motion is not None
    return float(mover.motion.energies(np.zeros(1))[0, 1])


def test_scene_moves_a_grip_in_time(tmp_path: Path) -> None:
    """After a path at rest; the grip's work is a column, and reactions are those of the step."""
    moves = 'displacement = [0, 0, "5 mm"]\nrotation = [0, "20 deg", 0]\nrise = "10 ms"'
    text = (
        SCENE + moves + "\n[transient]\nmax_step = '2 ms'\ntolerance = 1\nalpha = 5\nenergy = true"
    )
    (tmp_path / "strip.toml").write_text(text, encoding="utf-8")
    scene = Scene.read(tmp_path / "strip.toml")
    scene.update(0.012)
    cage = scene.deformed_cage
    moved = vtk_to_numpy(cage.GetPointData().GetArray("displacement"))
    held = points_of(cage)[:, 1] == points_of(cage)[:, 1].max()
    np.testing.assert_allclose(moved[held].mean(axis=0), [0, 2e-4, 5e-3], atol=1e-9)
    field = cage.GetFieldData()
    energies = {
        name: field.GetArray(name).GetValue(0)
        for name in ("kinetic_energy", "strain_energy", "dissipated_energy", "grip_work")
    }
    work = energies.pop("grip_work")
    first = energies_at_rest(scene)
    assert sum(energies.values()) - first == pytest.approx(work, rel=1e-9)
    support, grip = reactions_of(cage)
    assert (support.kind, grip.kind) == ("support", "grip")
    assert abs(grip.force).max() > 0


def test_reactions_are_tabulated_over_the_stroke(tmp_path: Path) -> None:
    """The abscissa is the stroke of the grip, and the force that of its last state."""
    (tmp_path / "strip.toml").write_text(SCENE, encoding="utf-8")
    scene = Scene.read(tmp_path / "strip.toml")
    ReactionsJob(tmp_path / "forces.csv").run(scene)
    with (tmp_path / "forces.csv").open(encoding="utf-8") as file:
        heading, *rows = csv.reader(line for line in file if not line.startswith("#"))
    assert heading[0] == "stroke [mm]"
    np.testing.assert_allclose([float(row[0]) for row in rows], np.linspace(0, 0.2, 9), atol=1e-9)
    column = heading.index("grip +y force y [N]")
    _, grip = reactions_of(scene.modal.output)
    assert float(rows[-1][column]) == pytest.approx(grip.force[1])
    with pytest.raises(InputError, match="time steps"):
        ReactionsJob(tmp_path / "forces.csv", "time").run(scene)


def test_reactions_of_a_moving_obstacle_are_those_where_it_is(tmp_path: Path) -> None:
    """A plate lifts a cloth by 20 mm and carries its weight all the way; its stroke is plotted."""
    text = """
[weave]
ends = 20
picks = 20
warp_spacing = "5 mm"
weft_spacing = "5 mm"
warp_diameter = "0.25 mm"
weft_diameter = "0.25 mm"
[cage]
divisions = [4, 4, 1]
[modal]
elements = "sheet"
fixed = ""
modes = 2
path_steps = 2
gravity = [0, 0, -10]
tensile_rigidity = "1 kN/m"
bending_rigidity = "10 uN.m"
areal_mass = "0.15 kg/m2"
[[modal.obstacles]]
shape = "plane"
center = [0, 0, "-1 mm"]
friction = 0.2
path = [[0, 0, "20 mm"]]
"""
    (tmp_path / "lift.toml").write_text(text, encoding="utf-8")
    curves = reaction_curves(Scene.read(tmp_path / "lift.toml"))
    assert (curves.heading, curves.names) == ("obstacle stroke [mm]", ["obstacle plane"])
    np.testing.assert_allclose(curves.x, [0, 10, 20], atol=1e-9)
    np.testing.assert_allclose(curves.forces[:, 0, 2], 0.15 * 0.1**2 * 10, rtol=0.1)
    np.testing.assert_allclose(curves.forces[:, 0], curves.forces[[0, 0, 0], 0], atol=1e-7)


def test_stroke_of_a_return_is_a_loop_and_that_of_a_bent_way_its_length(tmp_path: Path) -> None:
    for path, strokes in (
        ('[[0, "0.1 mm", 0], [0, "0.2 mm", 0], [0, 0, 0]]', [0, 0.1, 0.2, 0]),
        ('[[0, "0.2 mm", 0], [0, "0.2 mm", "0.1 mm"]]', [0, 0.2, 0.3]),
    ):
        text = SCENE.replace('[[0, "0.1 mm", 0], [0, "0.2 mm", 0]]', path)
        text = text.replace("path_steps = 4", "path_steps = 1")
        (tmp_path / "strip.toml").write_text(text, encoding="utf-8")
        curves = reaction_curves(Scene.read(tmp_path / "strip.toml"))
        assert curves.heading == "stroke [mm]"
        np.testing.assert_allclose(curves.x, strokes, atol=1e-9)
