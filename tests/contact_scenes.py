"""What rests on obstacles in the scenes of contact, against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import pyvista as pv
from hung_scenes import middle
from scipy.integrate import solve_ivp
from scipy.optimize import root

from spacemap_vtk.datasets.modal_model import contact_of, sheet_of
from spacemap_vtk.filters.textile_sheet import content_of, sheet_of_textile
from spacemap_vtk.mechanics.contact.obstacles import frame_along
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import GRAVITY


def weight(scene: Scene) -> float:
    """Return the weight of a cloth [N] from its areal mass and size."""
    flat, _ = middle(scene)
    width, height, _ = np.ptp(flat, axis=0)
    return float(scene.modal.areal_mass * width * height * GRAVITY)


def half_thickness(scene: Scene) -> float:
    cloth = scene.woven.cloth
    return float(cloth.level + cloth.sheet_thickness / 2)


def a_tablecloth(scene: Scene) -> None:
    _, rested = middle(scene)
    table, *rest = contact_of(scene.modal.output)
    assert table.force == pytest.approx([0, 0, -weight(scene)], abs=2e-3 * weight(scene))
    assert all(each.points == 0 for each in rest)
    # It lies on the table, half of its thickness above it, and its corners hang deepest.
    top = scene.modal.obstacles[0].center[2] + half_thickness(scene)
    on_table = np.hypot(*rested[:, :2].T) < 0.8 * scene.modal.obstacles[0].radius
    assert rested[on_table, 2].min() == pytest.approx(top, abs=2e-4)
    side = round(len(rested) ** 0.5)
    corners = rested.reshape(side, side, 3)[[0, 0, -1, -1], [0, -1, 0, -1], 2]
    # By the diagonal beyond the table; its bend over the rim takes some of it, and shear adds some.
    beyond = math.hypot(0.15, 0.15) - scene.modal.obstacles[0].radius
    assert top - corners == pytest.approx(beyond, rel=0.03)
    # The table is round and the cloth square: no corner hangs lower than another.
    assert np.ptp(corners) < 1e-6


def a_curtain_on_a_rod(scene: Scene) -> None:
    flat, hung = middle(scene)
    rod = scene.modal.obstacles[0]
    # Inextensible and limp, it lies on half a turn round the rod and hangs from there.
    turn = math.pi * (rod.radius + half_thickness(scene))
    hem = rod.center[2] - (np.ptp(flat[:, 1]) - turn) / 2
    ends = abs(abs(flat[:, 1]) - np.ptp(flat[:, 1]) / 2) < 1e-9
    assert hung[ends, 2] == pytest.approx(hem, rel=0.01)
    (contact,) = contact_of(scene.modal.output)
    assert abs(contact.force[:2]).max() < 0.01 * weight(scene)


def a_strip_over_an_edge(scene: Scene) -> None:
    # The elastica on a table, found with scipy's solve_bvp: unit of length (D/q)^(1/3).
    unit = (scene.modal.bending_rigidity / (scene.modal.areal_mass * GRAVITY)) ** (1 / 3)
    assert unit == pytest.approx(20e-3, rel=1e-3)
    _, rested = middle(scene)
    assert -rested[:, 2].min() / unit == pytest.approx(0.231752, rel=0.03)
    assert rested[:, 2].max() / unit == pytest.approx(0.016476, rel=0.04)


def a_napkin_over_an_arm(scene: Scene) -> None:
    """VTK's distance to the triangles tells how near the cloth comes."""
    _, rested = middle(scene)
    arm = scene.modal.obstacles[0]
    local = (rested - np.array(arm.center)) @ frame_along(arm.axis).T
    mesh = pv.read(arm.file).compute_normals(auto_orient_normals=True)
    near = pv.PolyData(local).compute_implicit_distance(mesh)
    depth = half_thickness(scene) - near["implicit_distance"].min()
    (contact,) = contact_of(scene.modal.output)
    assert contact.points > 50
    # Vertices are no samples: between these the surface of the arm is rounded.
    assert depth < contact.penetration + 1e-3
    assert rested[:, 2].min() < -0.08  # it hangs on both sides


def a_strip_over_a_drum(scene: Scene) -> None:
    """Euler's rope: the angle is that of tangents from the load and from the hinge."""
    scene.update_stage(scene.modal)
    (contact,) = contact_of(scene.modal.output)
    drum, load = scene.modal.obstacles[0], -sum(each.force[2] for each in scene.modal.dead_loads)
    pull = math.hypot(contact.force[0], contact.force[2] + load)
    flat, _ = middle(scene)
    x, z = flat[:, 0].max() - drum.center[0], -drum.center[2] - drum.path[-1][2]
    away = math.acos((drum.radius + half_thickness(scene)) / math.hypot(x, z))
    angle = math.pi - math.atan2(z, x) - away
    assert math.degrees(angle) == pytest.approx(115, abs=1)
    assert pull / load == pytest.approx(math.exp(drum.friction * angle), rel=5e-3)


def heavy_loop(gap: float) -> tuple[float, float, float]:
    """Return height, largest curvature and slope of a folded elastica, in its natural lengths."""

    # Of unit rigidity and weight. It lies on the ground up to its lift-off, and on a layer at the
    # height of the gap from its landing on: at both its moment is zero.
    def solve(reaction: float, length: float, thrust: float, **options: float) -> np.ndarray:
        def slopes(along: float, state: np.ndarray) -> list[float]:
            cos, sin = math.cos(state[0]), math.sin(state[0])
            return [state[1], (reaction - along) * cos + thrust * sin, cos, sin]

        found = solve_ivp(slopes, (0, length), np.zeros(4), rtol=1e-9, atol=1e-12, **options)
        return np.asarray(found.y)

    def misses(guess: np.ndarray) -> np.ndarray:
        return solve(*guess)[[0, 1, 3], -1] - [math.pi, 0.0, gap]

    found = root(misses, [3.745, 4.683, 0.0]).x
    slope, bent, _, height = solve(*found, max_step=1e-3)
    return height.max(), bent.max(), slope.max()


def a_strip_on_itself(scene: Scene) -> None:
    # The elastica without thickness, as in the scene's text, checks the solution here.
    assert heavy_loop(0.0) == pytest.approx((0.90660, 2.53374, math.radians(212.39)), rel=1e-5)
    flat, folded = middle(scene)
    unit = (scene.modal.bending_rigidity / (scene.modal.areal_mass * GRAVITY)) ** (1 / 3)
    edge = flat[:, 1] == flat[:, 1].min()
    line = folded[edge][np.argsort(flat[edge, 0])] / unit
    # Layers keep a bit more than the thickness, as nothing presses them together.
    gap = line[-1, 2] - line[0, 2]
    assert 1.0 < gap * unit / (2 * half_thickness(scene)) < 1.5
    sides = np.diff(line, axis=0)
    slope = np.unwrap(np.arctan2(sides[:, 2], sides[:, 0]))
    bent = np.diff(slope) / np.linalg.norm(sides[1:], axis=1)
    height = line[:, 2].max() - line[0, 2]
    assert (height, bent.max(), slope.max()) == pytest.approx(heavy_loop(gap), rel=2e-3)


def a_cloth_that_falls(scene: Scene) -> None:
    stage = scene.stage("mover")
    stage.update(scene.view.time)
    motion, ball = stage.motion, scene.modal.obstacles[0]
    free = motion.at_time(0.05)[0][:, 2]  # the ball is 30 mm below, which takes 78 ms
    assert free == pytest.approx(-GRAVITY * 0.05**2 / 2, rel=1e-6)
    _, _, kinetic, strain, dissipated, work = motion.states[:, :6].T
    assert kinetic + strain + dissipated - work == pytest.approx(0.0, abs=1e-8 * work.max())
    assert strain.max() > 1e-3 * work.max()  # it has hit the ball
    for time in np.linspace(0.08, scene.view.time, 6):
        middles = (motion.points + motion.at_time(time)[0]).reshape(2, -1, 3).mean(axis=0)
        away = np.linalg.norm(middles - np.array(ball.center), axis=1)
        # The springs of coarse cells are soft.
        assert away.min() > 0.95 * ball.radius


def a_knit_that_curls(scene: Scene) -> None:
    flat, rested = middle(scene)
    mass = sheet_of(scene.modal.output).areal_mass
    weight = mass * float(np.prod(np.ptp(flat, axis=0)[:2])) * GRAVITY
    (table,) = contact_of(scene.modal.output)
    assert table.force[2] == pytest.approx(-weight, rel=2e-3)
    # The moment at a free edge is zero: there the knit has its natural curvature, to the back
    # (down) across the sides, and to the face across the ends.
    natural = sheet_of_textile(content_of(scene.modal.output)).plate.curvature
    assert natural[0] < 0.0 < natural[1]
    for axis in (0, 1):
        across = np.unique(flat[:, 1 - axis].round(9))
        line = abs(flat[:, 1 - axis] - across[len(across) // 2]) < 1e-7
        steps = np.diff(rested[line][np.argsort(flat[line, axis])], axis=0)
        angle = np.unwrap(np.arctan2(steps[:, 2], steps[:, axis]))
        length = np.linalg.norm(steps, axis=1)
        curvature = np.diff(angle) / (length[1:] + length[:-1]) * 2
        # the first ones are a cell from the edge
        assert 2 * curvature[0] - curvature[1] == pytest.approx(natural[axis], rel=0.1)
        assert abs(curvature[len(curvature) // 2]) < 0.05 * abs(natural[axis])


CHECKS: dict[str, Callable[[Scene], None]] = {
    "arm": a_napkin_over_an_arm,
    "capstan": a_strip_over_a_drum,
    "curl": a_knit_that_curls,
    "curtain_on_rod": a_curtain_on_a_rod,
    "drop": a_cloth_that_falls,
    "fold": a_strip_on_itself,
    "overhang": a_strip_over_an_edge,
    "tablecloth": a_tablecloth,
}
