"""Area means of a cloth whose yarns are too thin to be seen: exact, in linear light."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import median_filter
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.arrays import points_of, to_points
from spacemap_vtk.draw.actors.sheet_actor import add_directions, make_sheet, simplify_sheet
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes import level_of_detail, library
from spacemap_vtk.scenes.scene import Scene

BLACK, WHITE = "#000000", "#ffffff"
Image = NDArray[np.float64]


def light_of(codes: Image) -> Image:
    """Return the linear light of sRGB values, as IEC 61966-2-1 defines it."""
    share = codes / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def codes_of(light: Image) -> Image:
    """Return the sRGB values of linear light."""
    low = light <= 0.0031308
    return 255 * np.where(low, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)


def draw(
    size: tuple[int, int], view: dict[str, Any], sides: int | None = None, **weave: Any
) -> tuple[Image, Picture]:
    prepare_offscreen()  # sheets need OpenGL
    values = {"weave": weave, "view": {"camera": "face", "shadows": False, **view}}
    scene = Scene(values if sides is None else {**values, "surface": {"subdivisions": sides}})
    made = Picture(scene, [0.0], size)
    image = made.draw(0.0)[::-1].astype(np.float64)  # the first row below, as picks are counted
    made.close()
    return image, made


#: A repeat of 15 ends and 6 picks.
WEAVE: dict[str, Any] = {
    **{f"{family}_section": "lenticular" for family in ("warp", "weft")},
    **{f"{family}_diameter": 1.4e-4 for family in ("warp", "weft")},
    **{f"{family}_aspect": 3.2 for family in ("warp", "weft")},
    **{f"{family}_spacing": 5e-4 for family in ("warp", "weft")},
    "pattern": "twill 2/1",
    "warp_color": [BLACK, WHITE, "#d02020", "#f0e040", "#103080"],
    "weft_color": ["#f0f0f0", "#208030"],
}


def tent_means(image: Image, block: int) -> Image:
    """Return the means of an image under tents over two blocks, without those at its edges."""
    weights = 1.0 - np.abs(np.arange(2 * block) + 0.5 - block) / block
    weights /= weights.sum()
    for _ in range(2):
        windows = np.lib.stride_tricks.sliding_window_view(image, 2 * block, axis=0)
        image = (windows[block // 2 :: block] @ weights).swapaxes(0, 1)
    return image


@pytest.mark.parametrize(
    ("pixels", "most"), [(0.7, 3.0), pytest.param(2.5, 4.0, marks=pytest.mark.nightly)]
)
def test_a_pixel_shows_the_mean_of_its_yarns(
    pixels: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    weave = {**WEAVE, "ends": 30, "picks": 24}
    size, fine = (round(30 * pixels), round(24 * pixels)), 2 * round(7 / pixels)
    view = {"irregularity": 0.0, "shadows": True}
    large, seen = draw((fine * size[0], fine * size[1]), view, **weave)
    assert seen.sheet is None
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    found, seen = draw(size, view, **weave)
    assert seen.sheet is not None
    assert seen.pieces is None
    wanted = codes_of(tent_means(light_of(large), fine))
    apart = (found[1 : 1 + len(wanted), 1 : 1 + wanted.shape[1]] - wanted)[2:-2, 2:-2]
    assert np.abs(apart.mean(axis=(0, 1))).max() < most
    assert np.abs(apart).mean() < 2.0 * most


#: Drafts in which other yarns are visible than in the drawdown; and a satin.
DRAFTS = {
    "pattern weft": {"draft": "drafts/monks_belt.wif"},
    "double weave": {"draft": "double_weave.wif"},
    "satin": {"draft": "drafts/satin_5.wif", "warp_color": "#102050", "weft_color": "#f0d080"},
    "overshot": {"draft": "drafts/overshot.wif"},
    "summer and winter": {"draft": "drafts/summer_and_winter.wif"},
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("pattern weft", marks=pytest.mark.nightly),
        pytest.param("double weave", marks=pytest.mark.nightly),
        pytest.param("satin", marks=pytest.mark.nightly),
        pytest.param("overshot", marks=pytest.mark.nightly),
        pytest.param("summer and winter", marks=pytest.mark.nightly),
    ],
)
def test_far_cloth_has_the_mean_colour_of_near_cloth(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    weave = {**DRAFTS[name], "ends": 28, "picks": 28}
    weave["draft"] = str(library.folder() / weave["draft"])
    near, seen = draw((336, 336), {"irregularity": 0.0, "shadows": True}, 5, **weave)
    assert seen.sheet is None
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    far, seen = draw((28, 28), {"irregularity": 0.0, "shadows": True}, **weave)
    assert seen.sheet is not None
    means = [
        codes_of(light_of(image[edge:-edge, edge:-edge]).mean(axis=(0, 1)))
        for image, edge in ((near, 72), (far, 6))
    ]
    np.testing.assert_allclose(means[1], means[0], atol=3.0)


def test_far_cloth_of_one_colour_has_no_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    # Yarns hidden under long floats have highlights and holes that nothing of near cloth shows.
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    weave = {"draft": str(library.folder() / DRAFTS["overshot"]["draft"]), "ends": 48, "picks": 48}
    colors = {"warp_color": "#1a2a5a", "weft_color": "#1a2a5a"}
    image, seen = draw((139, 139), {"camera": "three-quarter", "shadows": True}, **weave, **colors)
    assert seen.sheet is not None
    assert seen.pieces is None
    inner = image[35:-35, 35:-35]
    assert np.abs(inner - median_filter(inner, (3, 3, 1))).max() < 30.0


@pytest.mark.nightly
@pytest.mark.parametrize("pixels", [0.45, 0.55])
def test_fine_stripes_leave_no_moire(pixels: float, monkeypatch: pytest.MonkeyPatch) -> None:
    # Stripes of 2 to 2.2 pixels, in a picture that is rotated against them.
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    weave = {**WEAVE, "warp_color": [BLACK, WHITE], "weft_color": [BLACK, WHITE]}
    angle, half = 0.35, 0.25 * 200 * 5e-4
    place = Viewpoint((0, 0, 1), (0, 0, 0), (np.sin(angle), np.cos(angle), 0), half)
    scene = Scene({"weave": {**weave, "ends": 200, "picks": 200, "pattern": "twill 2/2"}})
    picture = Picture(scene, [0.0], (round(100 * pixels),) * 2, ["fabric"], place)
    image = picture.draw(0.0).astype(np.float64).mean(axis=2)
    picture.close()
    window = np.hanning(len(image))[:, None] * np.hanning(len(image))
    waves = np.abs(np.fft.fft2((image - image.mean()) * window)) / window.sum()
    frequency = np.abs(np.fft.fftfreq(len(image)))
    low = np.hypot(*np.meshgrid(frequency, frequency)) < 0.25
    assert waves[low].max() < 1.5


@pytest.mark.parametrize(
    "camera", [pytest.param("face", marks=pytest.mark.nightly), "three-quarter"]
)
def test_half_black_and_half_white_is_188_of_255(
    camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert codes_of(np.array(0.5)) == pytest.approx(187.5, abs=0.1)
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    means = []
    for odd, even in ((WHITE, WHITE), (BLACK, BLACK), (BLACK, WHITE)):
        colors = {"warp_color": [odd, even], "weft_color": [odd, even]}
        view = {"camera": camera}
        image, seen = draw((60, 60), view, ends=101, picks=99, pattern="plain", **colors)
        assert seen.sheet is not None
        means.append(light_of(image[20:-20, 20:-20]).mean(axis=(0, 1)))
    white, black, both = means
    np.testing.assert_allclose(codes_of(both), codes_of(0.5 * (white + black)), atol=2.5)


@pytest.mark.nightly
def test_a_cloth_of_few_thin_yarns_has_exact_means() -> None:
    # Yarn by yarn it would take no time, but has edges that are averaged as sRGB values.
    _, seen = draw((60, 60), {}, ends=31, picks=31)
    assert seen.sheet is not None
    assert seen.pieces is None
    _, seen = draw((70, 70), {}, ends=31, picks=31)
    assert seen.sheet is None


@pytest.mark.nightly
def test_crossings_beyond_the_texture_size_keep_their_mean_colours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def mean() -> Image:
        image, seen = draw((64, 64), {}, ends=151, picks=153, **WEAVE)
        assert seen.pieces is None
        quarters = light_of(image[4:-4, 4:-4]).reshape(2, 28, 2, 28, 3).mean(axis=(1, 3))
        return codes_of(quarters)

    exact = mean()
    monkeypatch.setattr(level_of_detail, "LONGEST_ROW", 64)
    np.testing.assert_allclose(mean(), exact, atol=2.0)


@pytest.mark.parametrize(("waves", "cells"), [(0.0, 24), (2.0, 48), (20.0, 240)])
def test_a_simplified_sheet_is_within_its_tolerance(waves: float, cells: int) -> None:
    unequal = [5e-4] * 60 + [7e-4] * 60  # the cells of a sheet follow the yarns
    weave = {"ends": 240, "picks": 240, "warp_spacing": unequal}
    cloth = Scene({"weave": weave}).woven.cloth  # type: ignore[union-attr]
    sheet = make_sheet(cloth, (240, 240))
    points = points_of(sheet).astype(np.float64)
    width = float(np.ptp(points[:, 0]))
    points[:, 2] = 0.02 * width * np.sin(2 * np.pi * waves * points[:, 0] / width)
    sheet.SetPoints(to_points(points))
    add_directions(sheet, (240, 240))
    few = simplify_sheet(sheet, (240, 240), 1e-4)
    assert few.GetNumberOfCells() == cells**2
    assert few.GetBounds() == pytest.approx(sheet.GetBounds(), abs=1e-4)
    texels = vtk_to_numpy(few.GetPointData().GetTCoords()).reshape(cells + 1, cells + 1, 2)
    lines = texels[0, :, 0], texels[:, 0, 1]
    values = points_of(few).reshape(cells + 1, cells + 1, 3).transpose(1, 0, 2)
    there = vtk_to_numpy(sheet.GetPointData().GetTCoords())
    apart = RegularGridInterpolator(lines, values)(there) - points_of(sheet)
    assert np.abs(apart).max() <= 1.01e-4
