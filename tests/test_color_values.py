"""Arrays of the cage are interpolated on the fabric and shown as colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLookupTable

from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.actors.surface_actor import (
    RAMP,
    SurfaceActor,
    color_bar_share,
    color_bar_title,
    fit_color_bar,
    make_color_bar,
    natural_span,
    rgb,
)
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene

SMALL: dict[str, Any] = {
    "weave": {"ends": 4, "picks": 4},
    "cage": {"divisions": [3, 3, 1]},
    "modal": {"youngs_modulus": "1 kPa"},
    "response": {"gravity": [0.0, -3.0, 3.0]},
    "surface": {"subdivisions": 3},
}


def scene_with(**more: Any) -> Scene:
    return Scene({**SMALL, **more})


def test_velocity_is_the_slope_of_the_displacement() -> None:
    scene = scene_with(view={"color": "velocity"})
    places, step, time = [], 1e-6, 0.02
    for at in (time - step, time + step, time):
        scene.update(at)
        places.append(points_of(scene.patches).astype(np.float64))
    slope = (places[1] - places[0]) / (2 * step)
    carried = vtk_to_numpy(scene.patches.GetPointData().GetArray("velocity"))
    assert np.abs(slope).max() > 1e-3
    np.testing.assert_allclose(carried, slope, atol=2e-4 * np.abs(slope).max())
    shown = color_values(scene.polygons, "velocity")
    assert shown is not None
    assert abs(shown.max() / np.linalg.norm(slope, axis=1).max() - 1) < 0.1


@pytest.mark.parametrize("smooth", [False, True])
def test_a_uniform_strain_is_interpolated_exactly(smooth: bool) -> None:
    """A cage stretched by a motion from a file is stretched alike everywhere."""
    scene = scene_with(warp={"smooth": smooth, "carried": "strain"})
    scene.update(0.0)
    cage = scene.deformed_cage.NewInstance()
    cage.DeepCopy(scene.deformed_cage)
    tensors = vtk_to_numpy(cage.GetCellData().GetArray("strain"))
    tensors[:] = np.array([0.02, -0.01, 0.005, 0.003, -0.002, 0.001])
    from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

    from spacemap_vtk import BarycentricWarp

    producer, warp = vtkTrivialProducer(), BarycentricWarp(smooth=smooth, carried="strain")
    producer.SetOutput(cage)
    warp.SetInputConnection(0, scene.source.GetOutputPort())
    warp.SetInputConnection(1, producer.GetOutputPort())
    warp.update()
    carried = vtk_to_numpy(warp.GetOutputDataObject(0).GetPointData().GetArray("strain"))
    np.testing.assert_allclose(carried, np.broadcast_to(tensors[0], carried.shape), rtol=1e-5)


def test_a_missing_array_is_refused_with_a_list_of_arrays() -> None:
    scene = scene_with(warp={"carried": "warmth"})
    with pytest.raises(InputError, match=r"warp\.carried") as refused:
        scene.update(0.0)
    assert "velocity" in str(refused.value)
    assert "von_mises" in str(refused.value)
    assert "mode_" not in str(refused.value)


@pytest.mark.parametrize(
    ("values", "color"),
    [
        ({"weave": {"ends": 3, "picks": 3}}, "velocity"),
        ({"weave": {"ends": 3, "picks": 3}}, "displacement"),
        ({**SMALL, "response": {"stress": False}}, "stress"),
        ({"object": {"file": "scenes/objects/lever.stl"}}, "yarn"),
        ({"object": {"file": "scenes/objects/lever.stl"}}, "clearance"),
    ],
)
def test_an_unavailable_colouring_is_refused_with_alternatives(
    values: dict[str, Any], color: str
) -> None:
    root = Path(__file__).resolve().parents[1] / "scene.toml"
    scene = Scene({**values, "view": {"color": color}}, root)
    assert color not in scene.colorings
    with pytest.raises(InputError, match=r"view\.color") as refused:
        scene.update(0.0)
    assert refused.value.allowed == ", ".join(scene.colorings)


def test_another_colouring_runs_only_the_last_stages() -> None:
    scene = scene_with()
    scene.update(0.01)
    before = {stage.section: stage.executions for stage in scene.stages}
    for color in ("family", "yarn", "displacement", "clearance", "own"):
        scene.set(f"view.color={color}")
        scene.update(0.01)
    assert {stage.section: stage.executions for stage in scene.stages} == before
    scene.set("view.color=stress")
    scene.update(0.01)
    changed = {s.section for s in scene.stages if s.executions != before[s.section]}
    assert changed == {"warp", "surface"}


@pytest.mark.parametrize(
    "color",
    [
        "family",
        "clearance",
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ("velocity", "stress")),
    ],
)
def test_each_colouring_is_drawn_by_the_command_line(tmp_path: Path, color: str) -> None:
    pictures = []
    for name in ("own", color):
        file = tmp_path / f"{name}.png"
        words = f"render plain_weave -o {file} --time 0.02 --size 400x240 --color {name} -q"
        with pytest.raises(SystemExit) as ended:
            main([*words.split(), "--set", "view.show=fabric"])
        assert ended.value.code == 0
        pictures.append(np.asarray(Image.open(file)).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 60
    # A scale stands at the right where colours stand for numbers, and nowhere else.
    strips = [np.ptp(picture[:, -110:], axis=2).max() for picture in pictures]
    assert strips[0] < 40
    assert (strips[1] > 60) == (color != "family")


def test_an_unknown_colouring_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["render", "plain_weave", "-o", "x.png", "--color", "stres"])
    assert ended.value.code == 2
    message = capsys.readouterr().err
    assert "--color" in message
    assert all(name in message for name in COLORINGS)


@pytest.mark.parametrize(
    "size",
    [
        (380, 500),
        *(
            pytest.param(size, marks=pytest.mark.nightly)
            for size in [(770, 790), (800, 800), (640, 480), (1920, 1080)]
        ),
    ],
)
@pytest.mark.parametrize(
    ("color", "unit", "span"),
    [
        ("displacement", "mm", (0.0, 0.585)),
        ("strain", "%", (0.0, 6.29)),
        ("stress", "kPa", (0.0, 1.234e-5)),
        ("clearance", "mm", (-0.00754, 0.328)),
    ],
)
def test_a_colour_scale_has_all_its_labels(
    size: tuple[int, int], color: str, unit: str, span: tuple[float, float]
) -> None:
    bar, table = make_color_bar(), vtkLookupTable()
    table.SetTableRange(*span)
    bar.SetLookupTable(table)
    bar.SetTitle(color_bar_title(color, unit))
    bar.SetVisibility(True)
    fit_color_bar(bar, size, (0, 0, 0))
    prepare_offscreen()
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    plotter.set_background("black")
    plotter.renderer.AddViewProp(bar)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    columns = np.flatnonzero((pixels > 60).any(axis=(0, 2)))
    # Nothing is cut off by the edge, and nothing lies over the cloth.
    assert columns[-1] < size[0] - 1
    assert columns[0] >= size[0] * (1.0 - color_bar_share(size)) - 1


def test_a_number_has_the_colour_of_its_scale_everywhere(tmp_path: Path) -> None:
    """A plate close behind another one: where yarns have a contact shadow, numbers have none."""
    prepare_offscreen()
    near = pv.Plane(
        center=(0.0, 0.0, 0.2), i_size=0.8, j_size=0.8, i_resolution=20, j_resolution=20
    )
    far = pv.Plane(i_size=2.0, j_size=2.0, i_resolution=50, j_resolution=50)
    (near + far).extract_surface(algorithm="dataset_surface").save(tmp_path / "plates.ply")
    values = {
        "object": {"file": str(tmp_path / "plates.ply")},
        "cage": {"divisions": [2, 2, 1], "padding": 0.1},
        "modal": {"youngs_modulus": "1 GPa", "fixed": "-y"},
        "response": {"gravity": [0.0, 0.0, -1.0]},
        "view": {"camera": "front", "size": [500, 400], "color": "displacement"},
    }
    offs = {}
    for color in ("displacement", "own"):
        scene = Scene({**values, "view": {**values["view"], "color": color}})
        picture = Picture(scene, [0.001])
        image = picture.draw(0.001) / 255
        renderer = picture.panels[0].window.renderer
        surface = scene.polygons
        points = points_of(surface)
        numbers = np.linalg.norm(
            vtk_to_numpy(surface.GetPointData().GetArray("displacement")), axis=1
        )
        # The far plate beside the near one, and the near one itself.
        aside = np.abs(points[:, :2]).max(axis=1)
        flat = np.where(points[:, 2] > 0.1, aside < 0.35, (aside > 0.45) & (aside < 0.9))
        block, shown = picture.panels[0].window.size[1] // len(image), []
        for point in points[flat]:
            renderer.SetWorldPoint(*point, 1.0)
            renderer.WorldToDisplay()
            x, y, _ = renderer.GetDisplayPoint()
            shown.append(image[len(image) - 1 - int(y / block), int(x / block)])
        picture.close()
        stops = np.array([rgb(stop) for stop in RAMP])
        at = numbers[flat] / natural_span(numbers)[1] * (len(RAMP) - 1)
        scale = np.stack([np.interp(at, range(len(RAMP)), stops[:, c]) for c in range(3)], axis=1)
        if color == "own":
            scale = np.broadcast_to(np.array(scene.view.object_color) / 255, scale.shape)
        offs[color] = np.abs(np.array(shown) - scale).max()
    # What faces us has the scale's very colour, to the steps of its table and of eight bits.
    assert offs["displacement"] < 0.02
    assert offs["own"] > 0.1


def test_a_hanging_cloth_shows_its_equilibrium_and_stress() -> None:
    modal = {"elements": "sheet", "gravity": [0, -9.80665, 0], "modes": 3, "areal_mass": 0.2}
    scene = Scene({**SMALL, "cage": {"divisions": [2, 12, 1]}, "modal": modal, "response": {}})
    found = {}
    for color in ("displacement", "equilibrium", "stress", "principal_stress", "strain"):
        scene.set(f"view.color={color}")
        scene.update(0.0)
        values = color_values(scene.polygons, color)
        assert values is not None
        found[color] = values
    # At rest it is where it hangs, and the scale of the displacement begins there.
    np.testing.assert_allclose(found["displacement"], found["equilibrium"], rtol=1e-5, atol=1e-15)
    hung = vtk_to_numpy(scene.modal.output.GetPointData().GetArray("equilibrium"))
    assert found["displacement"].max() == pytest.approx(abs(hung).max(), rel=0.05)
    # The top bears the weight of all below it; that of a cell is the mean over its height.
    _, _, low, high, bottom, top = scene.modal.output.GetBounds()
    weight = 0.2 * 9.80665 * (high - low) / (top - bottom)
    for stress in ("stress", "principal_stress"):
        assert found[stress].max() == pytest.approx(weight, rel=0.15)
    # Free at its sides it is stretched by that over Young's modulus.
    assert found["strain"].max() == pytest.approx(weight / 1e6, rel=0.15)
    assert found["stress"].min() >= 0.0  # beyond the cage, too
    assert "equilibrium" in scene.colorings
    scene.set("view.color=own")
    scene.set("modal.hang=false")
    scene.update(0.0)
    assert "equilibrium" not in scene.colorings
    assert not vtk_to_numpy(scene.deformed_cage.GetPointData().GetArray("displacement")).any()


@pytest.mark.parametrize(
    ("largest", "end"), [(0.0312, 0.04), (7.3e-4, 8e-4), (1.0, 1.0), (1.2, 2.0), (96.0, 100.0)]
)
def test_a_scale_ends_at_a_round_number(largest: float, end: float) -> None:
    assert natural_span(np.array([0.0, largest])) == (0.0, pytest.approx(end, rel=1e-9))


def test_crimp_results_are_shown_on_patches() -> None:
    scene = Scene({"weave": {"ends": 4, "picks": 4}, "response": {}, "yarns": {}})
    plain = set(Scene({"weave": {}, "response": {}}).colorings)
    added = {"crimp", "yarn_strain", "contact_force", "jammed"}
    assert set(scene.colorings) - plain == added
    scene.update(time=0.0)
    crimp = color_values(scene.polygons, "crimp")
    assert crimp is not None
    assert crimp == pytest.approx(scene.woven.cloth.families[0].crimp.crimp, rel=1e-4)
    actor = SurfaceActor()
    actor.show(scene.polygons, "jammed")
    assert not actor.color_bar.GetVisibility()
    assert actor.GetMapper().GetArrayName() == "jammed"
