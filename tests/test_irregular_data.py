"""Exported data have the irregular yarns of pictures if asked for, and regular ones otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene

WEAVE: dict[str, Any] = {"ends": 5, "picks": 4, "warp_color": "#c06040", "weft_color": "#4060c0"}
VIEW = {"irregularity": 1.0, "irregularity_seed": 7}
VALUES = {"weave": WEAVE, "view": VIEW, "surface": {"subdivisions": 3}}
SPACING = 5e-4


def drawn(values: dict[str, Any], time: float = 0.0) -> Any:
    """Return the surface that the renderer draws."""
    picture = Picture(Scene(values), [time], (64, 64), ["fabric"])
    picture.draw(time)
    surface = picture.panels[-1].scene_view.surface.GetMapper().GetInput()
    picture.close()
    return surface


def export(file: Path, values: dict[str, Any], **fields: Any) -> Any:
    make_data_job(file, irregular=True, **fields).run(Scene(values))
    return pv.read(file)


@pytest.mark.parametrize("ending", [".vtp", ".obj", ".stl", ".ply", ".glb"])
def test_files_have_the_yarns_of_the_picture(ending: str, tmp_path: Path) -> None:
    seen = drawn(VALUES)
    kind = {"kind": "surface"} if ending == ".vtp" else {}
    found = export(tmp_path / f"cloth{ending}", VALUES, **kind)
    found = found.combine() if isinstance(found, pv.MultiBlock) else found
    places = points_of(seen)
    apart = cKDTree(np.asarray(found.points, float)).query(places)[0]
    assert apart.max() < 1e-4 * SPACING
    regular = Scene({**VALUES, "view": {"irregularity": 0.0}})
    regular.update(0.0)
    moved = np.linalg.norm(places - points_of(regular.polygons), axis=1)
    assert moved.max() > 5e-3 * SPACING  # the test can tell them apart


def test_patches_are_those_of_the_drawn_surface(tmp_path: Path) -> None:
    found = export(tmp_path / "cloth.vtu", VALUES, kind="patches")
    again = Scene({"object": {"file": str(tmp_path / "cloth.vtu")}, "surface": VALUES["surface"]})
    again.update(0.0)
    np.testing.assert_allclose(
        points_of(again.polygons), points_of(drawn(VALUES)), atol=1e-5 * SPACING
    )
    assert len(np.unique(found.cell_data["color"], axis=0)) > 4


def test_colours_contain_the_brightness_of_the_picture(tmp_path: Path) -> None:
    seen = drawn(VALUES)
    bright = vtk_to_numpy(seen.GetPointData().GetArray(LOOK))[:, 1]
    corners = vtk_to_numpy(seen.GetPolys().GetConnectivityArray()).reshape(-1, 4)
    wanted = (
        vtk_to_numpy(seen.GetCellData().GetArray("color")) * bright[corners].mean(axis=1)[:, None]
    )
    found = export(tmp_path / "cloth.vtp", VALUES, kind="surface")
    assert LOOK not in found.point_data
    assert np.abs(found.cell_data["color"] - wanted).max() < 1.0
    assert np.ptp(bright) > 0.03


def test_data_are_regular_by_default_also_after_a_picture(tmp_path: Path) -> None:
    scene = Scene(VALUES)
    Picture(scene, [0.0], (64, 64), ["fabric"]).close()
    files = [tmp_path / name for name in ("after.vtp", "before.vtp")]
    make_data_job(files[0], "surface").run(scene)
    make_data_job(files[1], "surface").run(Scene({**VALUES, "view": {"irregularity": 0.0}}))
    after, before = (pv.read(file) for file in files)
    np.testing.assert_array_equal(after.points, before.points)
    assert LOOK not in after.point_data


def test_moving_yarns_are_those_of_the_picture(tmp_path: Path) -> None:
    values = {**VALUES, "response": {"gravity": [0.0, 0.0, 5.0]}, "cage": {"divisions": [2, 2, 1]}}
    found = export(tmp_path / "cloth.vtp", values, kind="surface", times=[0.02])
    seen = points_of(drawn(values, 0.02))
    assert cKDTree(np.asarray(found.points, float)).query(seen)[0].max() < 1e-4 * SPACING


@pytest.mark.parametrize(
    ("values", "name", "reason"),
    [
        ({**VALUES, "view": {"irregularity": 0.0}}, "cloth.vtp", "drawn regular"),
        ({**VALUES, "view": {**VIEW, "color": "clearance"}}, "cloth.vtp", "colour scale"),
        (VALUES, "cloth.wif", "contain no yarns"),
        ({"object": {"file": "tube.ply"}}, "cloth.vtp", "only woven yarns"),
    ],
)
def test_data_that_cannot_be_irregular_are_refused(
    values: dict[str, Any], name: str, reason: str, tmp_path: Path
) -> None:
    job = make_data_job(tmp_path / name, irregular=True)
    with pytest.raises(InputError, match=reason):
        job.run(Scene(values))
    assert not list(tmp_path.iterdir())


def test_a_film_of_irregular_yarns_is_within_its_tolerance(tmp_path: Path) -> None:
    values = {
        "weave": {**WEAVE, "ends": 3, "picks": 3},
        "view": VIEW,
        "surface": {"subdivisions": 1},
        "response": {"gravity": [0.0, 0.0, 5.0]},
        "cage": {"divisions": [2, 2, 1]},
    }
    job = make_data_job(tmp_path / "cloth.glb", irregular=True, times=[0.0, 0.01, 0.02])
    job.run(Scene(values))  # raises an error if the targets differ from the surface
    found = pv.read(job.output).combine().points
    start = points_of(drawn(values))
    assert cKDTree(np.asarray(found, float)).query(start)[0].max() < 1e-4 * SPACING
