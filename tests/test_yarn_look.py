"""What makes yarns look like yarns: contact shadows, twist, irregularity, form in any colour."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import spearmanr
from test_cli import run
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkStaticCellLocator
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from spacemap_vtk import PatchTessellator
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.detail.underlay import CLOSED, open_share
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.filters.patch_tessellator import LOOK
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.irregularity import Irregularity, smooth_noise

#: A closed twill of lenticular yarns.
TWILL: dict[str, Any] = {
    "pattern": "twill 2/2",
    "ends": 8,
    "picks": 8,
    **{f"{family}_diameter": 0.128e-3 for family in ("warp", "weft")},
    **{f"{family}_spacing": 0.46e-3 for family in ("warp", "weft")},
    **{f"{family}_section": "lenticular" for family in ("warp", "weft")},
    **{f"{family}_aspect": 3.2 for family in ("warp", "weft")},
}
FACE = {"camera": "face", "zoom": 1.6}
GREEN = {"background": "#00ff00", "background_top": "#00ff00"}


def picture(
    weave: dict[str, Any], side: int = 240, place: Viewpoint | None = None, **view: Any
) -> NDArray[np.int64]:
    scene = Scene({"weave": weave, "view": view})
    drawn = Picture(scene, [0.0], (side, side), viewpoint=place)
    image = drawn.draw(0.0).astype(np.int64)
    drawn.close()
    return image


def surface(weave: dict[str, Any], sides: int, look: Irregularity | None) -> vtkPolyData:
    scene, stage = Scene({"weave": weave}), PatchTessellator()
    scene.source.update()
    stage.SetInputDataObject(scene.source.output)
    stage.set_detail(sides, look=look)
    return stage.update().output


def visible_sky(made: vtkPolyData, which: NDArray[Any], rays: int = 48) -> NDArray[np.float64]:
    """Of some points, the part of the hemisphere that rays reach, weighted by the cosine."""
    locator = vtkStaticCellLocator()
    locator.SetDataSet(made)
    locator.BuildLocator()
    rng = np.random.default_rng(1)
    points, normals = points_of(made), vtk_to_numpy(made.GetPointData().GetNormals())
    hits, cells, seen = vtkPoints(), vtkIdList(), []
    for number in which:
        # Directions on a sphere, shifted by the normal, have the density of the cosine.
        ways = rng.normal(size=(rays, 3))
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True) + normals[number]
        start = points[number] + 1e-6 * normals[number]
        blocked = 0
        for way in ways:
            hits.Reset()
            locator.IntersectWithLine(start, start + 2e-3 * way, 1e-9, hits, cells)
            blocked += hits.GetNumberOfPoints() > 0
        seen.append(1.0 - blocked / rays)
    return np.array(seen)


def test_exposure_is_that_of_rays_in_any_cloth() -> None:
    for weave in (TWILL, {"ends": 6, "picks": 6}):
        made = surface(weave, 4, Irregularity(0.0))
        points, exposure = points_of(made), vtk_to_numpy(made.GetPointData().GetArray(LOOK))[:, 0]
        inside = np.abs(points[:, :2]).max(axis=1) < 0.35 * np.ptp(points[:, 0])
        facing = vtk_to_numpy(made.GetPointData().GetNormals())[:, 2] > 0.3
        which = np.random.default_rng(0).choice(np.flatnonzero(inside & facing), 150, replace=False)
        sky, shown = visible_sky(made, which), np.minimum(exposure[which], 1.0)
        assert spearmanr(sky, shown).statistic > 0.75
        assert shown[sky > 0.95].mean() > 0.9
        assert shown[sky < 0.15].mean() < 0.4


def test_exposure_is_the_same_for_a_moved_cloth() -> None:
    scene = Scene(
        {
            "weave": {"ends": 4, "picks": 4},
            "cage": {"divisions": [2, 2, 1]},
            "modal": {"modes": 4},
            "response": {"gravity": [0.0, 0.0, -9.8]},
        }
    )
    scene.surface.set_detail(3, look=Irregularity(0.0))
    exposures = []
    for time in (0.0, 0.03):
        scene.update(time)
        exposures.append(vtk_to_numpy(scene.polygons.GetPointData().GetArray(LOOK))[:, 0])
    assert np.ptp(points_of(scene.polygons)[:, 2]) > 3e-4
    np.testing.assert_allclose(*exposures, atol=1e-3)


def test_irregular_yarns_vary_smoothly_and_within_their_bounds() -> None:
    looks = [surface(TWILL, 2, Irregularity(*each)) for each in ((0.0,), (1.0,), (1.0,), (1.0, 5))]
    plain, rough, again, other = (points_of(made).astype(float) for made in looks)
    np.testing.assert_array_equal(rough, again)
    assert np.abs(rough - other).max() > 1e-6
    # Sideways by 0.012 spacings and 8 % of half the width; heights and contacts stay.
    moved = np.abs(rough - plain).max(axis=0)
    assert 1e-5 < moved[:2].max() < (0.012 + 0.08 * 0.5) * 0.46e-3
    assert moved[2] < 1e-9
    bright = vtk_to_numpy(looks[1].GetPointData().GetArray(LOOK))[:, 1]
    assert 0.93 <= bright.min() < 0.98
    assert 1.02 < bright.max() <= 1.07
    place = np.linspace(-50.0, 50.0, 20_001)
    one, next_ = (smooth_noise(0, 0, np.full(len(place), yarn), place) for yarn in (3, 4))
    assert np.abs(np.diff(one)).max() < 0.02
    assert abs(np.corrcoef(one, next_)[0, 1]) < 0.3
    assert np.abs(one).max() <= 1.0


def test_irregularity_is_in_no_file_and_no_figure(tmp_path: Path) -> None:
    written = []
    for amount in (0, 2):
        file = tmp_path / f"{amount}.vtp"
        words = ["--set", f"view.irregularity={amount}", "--set", "weave.ends=3"]
        assert run("export", "twill_2_2", "-o", str(file), *words) == 0
        assert (
            run(
                "render",
                "twill_2_2",
                "-o",
                str(file.with_suffix(".png")),
                "--size",
                "80x60",
                *words,
            )
            == 0
        )
        written.append(file)
    one, other = (read_points(file) for file in written)
    np.testing.assert_array_equal(one, other)
    regular = Scene({"weave": TWILL, "view": {"color": "clearance", "irregularity": 1.0}})
    assert regular.view.yarn_look.amount == 0.0
    assert Scene({"weave": TWILL, "view": {"style": "paper"}}).view.yarn_look.amount == 0.0


def read_points(file: Path) -> NDArray[Any]:
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(file))
    reader.Update()
    return points_of(reader.GetOutput())


@pytest.mark.parametrize("family", ["warp", "weft"])
@pytest.mark.parametrize(("twist", "face"), [("Z", 1.0), ("Z", -1.0), ("S", 1.0)])
def test_fibres_lean_like_the_letter_of_the_twist(family: str, twist: str, face: float) -> None:
    """An upright yarn of Z twist has fibres like the middle stroke of Z, from either side."""
    other = "weft" if family == "warp" else "warp"
    weave = {
        "ends": 1,
        "picks": 1,
        "overhang": "2 mm",
        "warp_crimp_height": 1e-6 if family == "warp" else 0.25e-3,
        f"{family}_diameter": 0.25e-3,
        f"{other}_diameter": 2e-6,
        f"{family}_twist": f"{twist} 600",
        f"{family}_color": "#909090",
    }
    middle = (0.0, 0.0005, 0.0) if family == "warp" else (0.0005, 0.0, 0.0)
    place = Viewpoint((middle[0], middle[1], face * 0.001), middle, (0.0, 1.0, 0.0), 0.00008)
    grey = picture(weave, 200, place, irregularity=0.0).mean(axis=2)
    if family == "weft":
        grey = np.rot90(grey)  # upright
    up, right = np.gradient(grey[::-1, 60:140])
    lean = np.mean(up * right) / np.mean(up**2 + right**2)
    assert abs(lean) > 0.1
    assert (lean < 0.0) == (twist == "Z")  # brightness changes across a stroke from low left


@pytest.mark.parametrize(
    ("color", "contrast"), [("#ffffff", 6.0), ("#101010", 3.0), ("#1a2fe0", 3.0)]
)
def test_white_black_and_saturated_yarns_keep_form_and_hue(color: str, contrast: float) -> None:
    image = picture({**TWILL, "warp_color": color, "weft_color": color}, 320, **FACE)[
        60:260, 60:260
    ]
    assert ((image >= 255).any(axis=2) | (image == 0).all(axis=2)).mean() < 0.005
    luminance = image @ np.array([0.2126, 0.7152, 0.0722])
    # Each block is a part of a crown, of a third of a yarn's width.
    blocks = luminance.reshape(20, 10, 20, 10).std(axis=(1, 3))
    assert np.median(blocks) > contrast
    if color == "#1a2fe0":
        wanted, seen = (
            colorsys.rgb_to_hsv(*each)[0]
            for each in ((26 / 255, 47 / 255, 224 / 255), image.mean(axis=(0, 1)) / 255)
        )
        assert abs(wanted - seen) < 5 / 360


def test_holes_of_closed_cloth_are_dark_and_nets_are_transparent() -> None:
    def background_share(weave: dict[str, Any], **view: Any) -> float:
        image = picture(weave, 240, **{**FACE, **GREEN, **view})[60:180, 60:180]
        return float(((image[..., 1] > 250) & (image[..., 0] < 5)).mean())

    net = {"ends": 8, "picks": 8}
    narrow = {**TWILL, "warp_aspect": 2.9, "weft_aspect": 2.9}
    shares = [open_share(Scene({"weave": each}).woven.cloth) for each in (narrow, net)]
    assert shares[0] < CLOSED < shares[1]
    assert background_share(narrow, shadows=False) > 0.005
    assert background_share(narrow) == 0.0
    assert background_share(net) > 0.15


def test_dark_layer_moves_with_the_cloth_and_stays_inside() -> None:
    scene = Scene(
        {
            "weave": TWILL,
            "cage": {"divisions": [4, 4, 1]},
            "modal": {"elements": "sheet"},
            "response": {"gravity": [0.0, -3.0, 9.0]},
            "view": {**GREEN, "camera": "front", "zoom": 1.4},
        }
    )
    drawn = Picture(scene, [0.03], (240, 240))
    image = drawn.draw(0.03).astype(int)
    frame = drawn.panels[0].scene_view._frame
    drawn.close()
    assert ((image[70:170, 70:170, 1] > 250) & (image[70:170, 70:170, 0] < 5)).mean() < 0.001
    low, high = (np.array(frame.surface.GetBounds()).reshape(3, 2)[:, k] for k in (0, 1))
    inner = np.array(frame.underlay.surface.GetBounds()).reshape(3, 2)
    assert (inner[:, 0] > low).all()
    assert (inner[:, 1] < high).all()
    assert np.ptp(inner[2]) > 5e-5
