"""What rests on obstacles in the scenes of contact, against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import pyvista as pv
from hung_scenes import middle

from spacemap_vtk.datasets.modal_model import contact_of
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


CHECKS: dict[str, Callable[[Scene], None]] = {
    "arm": a_napkin_over_an_arm,
    "curtain_on_rod": a_curtain_on_a_rod,
    "overhang": a_strip_over_an_edge,
    "tablecloth": a_tablecloth,
}
