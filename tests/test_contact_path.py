"""Equilibria that depend on the path: from given states, and behind obstacles that move slowly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from test_contact import GRAVITY, PLATE, SCENE, THICKNESS, sheet
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.modal_model import contact_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.contact.obstacles import Plane
from spacemap_vtk.mechanics.contact.path import divide_path, follow_path
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.scenes.figure_list import cloth_figures
from spacemap_vtk.scenes.report import report_fabric
from spacemap_vtk.scenes.scene import Scene


def scene_of(folder: Path, *changes: tuple[str, str]) -> Scene:
    """Return the scene of a cloth on a disc, with some of its text replaced."""
    text = SCENE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "table.toml").write_text(text, encoding="utf-8")
    return Scene.read(folder / "table.toml")


def rested(scene: Scene) -> np.ndarray:
    scene.update_stage(scene.modal)
    return vtk_to_numpy(scene.modal.output.GetPointData().GetArray("equilibrium"))


def test_cloth_follows_the_ground_that_carries_it() -> None:
    """Also uphill and down: friction holds it, and each point stays where it first touched."""
    points, cells, terms = sheet((0, 0.1, 0, 0.1), (4, 4), [Plane((0, 0, -1e-3))], 0.3)
    free = np.zeros(points.shape, dtype=bool)
    model = Model(points, cells, PLATE, 0.15 / THICKNESS, free, terms=terms)
    weight = np.outer(model.nodal_mass, (0, 0, -GRAVITY)).ravel()
    fall = follow_path(model, weight, divide_path([()], 1)).displacement
    path = divide_path([[(0.05, 0, 0), (0.05, 0.02, 0.03)]], 1)
    # Obstacles end at their own places, so that the first state is as far on the other side.
    found = follow_path(model, weight, path)
    begun = follow_path(model, weight, path[:1])
    np.testing.assert_allclose(begun.displacement[:, 2], fall[:, 2] - 0.03, atol=1e-8)
    moved = found.displacement - begun.displacement
    np.testing.assert_allclose(moved, np.broadcast_to([0.05, 0.02, 0.03], moved.shape), atol=1e-7)


def test_state_in_a_file_is_where_the_search_begins(tmp_path: Path) -> None:
    """A cloth at rest stays there, with its friction; on other cells it finds its weight again."""
    scene = scene_of(tmp_path)
    before = rested(scene)
    pv.wrap(scene.modal.output).save(tmp_path / "state.vtu")
    start = ("modes = 4", 'modes = 4\nstart = "state.vtu"')
    again = scene_of(tmp_path, start)
    np.testing.assert_allclose(rested(again), before, atol=1e-9)
    finer = scene_of(tmp_path, start, ("[8, 8, 1]", "[12, 12, 1]"))
    rested(finer)
    (contact,) = contact_of(finer.modal.output)
    assert contact.force[2] == pytest.approx(-9.81 * 0.15 * 0.2**2, rel=1e-6)
    (row,) = (each for each in cloth_figures(report_fabric(finer)) if each.key == "path")
    assert row.text == "from state.vtu"


def test_file_without_a_state_of_the_cage_is_refused(tmp_path: Path) -> None:
    start = ("modes = 4", 'modes = 4\nstart = "state.vtu"')
    corners = 0.05 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    small = pv.UnstructuredGrid({pv.CellType.TETRA: np.array([[0, 1, 2, 3]])}, corners)
    small.save(tmp_path / "state.vtu")
    with pytest.raises(InputError, match="has no displacement") as error:
        rested(scene_of(tmp_path, start))
    assert "modal.start" in str(error.value)
    small["displacement"] = np.zeros((4, 3))
    small.save(tmp_path / "state.vtu")
    with pytest.raises(InputError, match="does not fill the same space"):
        rested(scene_of(tmp_path, start))


def test_table_that_slides_under_a_held_cloth_pulls_it_with_all_of_its_friction(
    tmp_path: Path,
) -> None:
    scene = scene_of(
        tmp_path,
        ('fixed = ""', 'fixed = "-x"\npath_steps = 4'),
        ("60 mm", "300 mm"),
        ("-20 mm", "-0.25 mm"),
        ("friction = 0.3", 'friction = 0.3\npath = [["2 mm", 0, 0]]'),
    )
    rested(scene)
    (contact,) = contact_of(scene.modal.output)
    # The support carries a small part of the weight.
    assert contact.sliding == contact.points
    assert math.hypot(*contact.force[:2]) == pytest.approx(-0.3 * contact.force[2], rel=1e-6)
    assert contact.force[0] < 0.0
    (row,) = (each for each in cloth_figures(report_fabric(scene)) if each.key == "path")
    assert row.text == "from the undeformed cage, with obstacle 0 moved through 5 states"


def test_step_that_could_jump_past_the_cage_is_refused(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, ("friction = 0.3", 'path = [[0, 0, "35 mm"]]'))
    with pytest.raises(InputError, match="could jump past the cage") as error:
        rested(scene)
    # The disc is 6 mm thick.
    assert error.value.allowed == "at least 12"
