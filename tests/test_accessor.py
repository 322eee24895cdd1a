"""``mesh.spacemap`` in pyvista."""

from __future__ import annotations

import configparser
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

import spacemap_vtk.accessor
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.errors import InputError, UnknownNameError


def box() -> pv.ImageData:
    return pv.ImageData(dimensions=(3, 3, 3), origin=(-1, -1, -1))


@pytest.mark.parametrize("make", [pv.Sphere, lambda: pv.ImageData(dimensions=(2, 2, 2))])
def test_deform_accepts_an_array_a_name_or_a_function(make: object) -> None:
    mesh, cage = make(), box()  # type: ignore[operator]
    before = np.array(mesh.points)
    cage["u"] = 0.5 * cage.points
    made = vtkTrivialProducer()
    made.SetOutput(cage.cast_to_unstructured_grid())
    for moved in (
        mesh.spacemap.deform(cage, cage["u"]),
        mesh.spacemap.deform(cage, lambda points: 0.5 * points),
        mesh.spacemap.deform(made, "u"),
        mesh.spacemap.deform(pv.MultiBlock([cage]), "u"),
        mesh.spacemap.deform(cage, "u", smooth=True, outside="error"),
    ):
        np.testing.assert_allclose(moved.points, 1.5 * before, atol=1e-6)
        assert "displacement" in moved.point_data
    np.testing.assert_array_equal(mesh.points, before)


def test_blocks_move_with_one_cage_and_keep_their_names() -> None:
    blocks = pv.MultiBlock({"ball": pv.Sphere(), "gap": None, "image": box()})
    moved = blocks.spacemap.deform(box(), lambda points: [1.0, 0.0, 0.0] + 0.0 * points)
    assert moved.keys() == ["ball", "gap", "image"]
    np.testing.assert_allclose(
        moved["ball"].points, blocks["ball"].points + np.eye(3)[0], atol=1e-6
    )
    np.testing.assert_allclose(moved["image"].points[0], [0, -1, -1], atol=1e-6)


def test_deform_refuses_wrong_input_with_a_message() -> None:
    cage = box()
    for guess in (lambda points: points, "cage.vtu", np.zeros((3, 3))):
        with pytest.raises(InputError, match=r"must be a mesh, not .* Write deform\(cage, disp"):
            pv.Sphere().spacemap.deform(guess)
    with pytest.raises(InputError, match=r"shape \(3, 3\); allowed: \(27, 3\)"):
        pv.Sphere().spacemap.deform(cage, np.zeros((3, 3)))
    for made, why in (
        (np.nan * cage.points, "27 of the cage's 27 displacements are not finite numbers"),
        (["a"], r"displacement: must be an array of numbers: .*'a'.*; allowed: \(27, 3\)"),
        (lambda points: [1.0, points], r"must be an array of numbers"),
    ):
        with pytest.raises(InputError, match=why):
            pv.Sphere().spacemap.deform(cage, made)
    with pytest.raises(InputError, match="a Table has no points"):
        pv.Table(np.zeros((2, 2))).spacemap.deform(cage, cage.points)
    with pytest.raises(InputError, match=r'needs an array "displacement"; the input has none'):
        pv.Sphere().spacemap.deform(cage)
    with pytest.raises(InputError, match="is not a volume mesh"):
        pv.Sphere().spacemap.deform(pv.Sphere(), np.zeros((842, 3)))


def test_modal_updates_in_a_plotter() -> None:
    swing = pv.Sphere().spacemap.modal(
        divisions=(2, 2, 2), fixed="-z", gravity=(0, 0, -100.0), modes=5
    )
    prepare_offscreen()
    plotter = pv.Plotter(off_screen=True, window_size=(80, 60))
    actor = plotter.add_mesh(swing)
    first = np.array(actor.GetBounds())
    swing.update(time=0.02)
    plotter.render()
    assert np.abs(np.array(actor.GetBounds()) - first).max() > 1e-4
    plotter.close()
    assert [stage.executions for stage in swing.upstream() if hasattr(stage, "executions")] == [
        *(2, 2, 1, 1)
    ]


def test_modal_refuses_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match=r'fixd: .*"fixed"'):
        pv.Sphere().spacemap.modal(fixd="-z")


def test_entry_point_names_the_module() -> None:
    config = configparser.ConfigParser()
    config.read(Path(__file__).parents[1] / "setup.cfg")
    points = config["options.entry_points"]["pyvista.accessors"]
    assert points.strip() == f"spacemap = {spacemap_vtk.accessor.__name__}"
    (found,) = [r for r in pv.registered_accessors() if r.name == "spacemap"]
    assert found.accessor is spacemap_vtk.accessor.SpacemapAccessor
