"""Area means of a cloth whose yarns are too thin to be seen: exact, in linear light."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spacemap_vtk.draw.actors import sheet_actor
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene

#: Share of a picture of a face that is left free at each edge.
MARGIN = 0.01
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


def draw(size: tuple[int, int], view: dict[str, Any], **weave: Any) -> tuple[Image, Picture]:
    prepare_offscreen()  # sheets need OpenGL
    scene = Scene({"weave": weave, "view": {"camera": "face", "shadows": False, **view}})
    made = Picture(scene, [0.0], size)
    image = made.draw(0.0)[::-1].astype(np.float64)  # the first row below, as picks are counted
    made.close()
    return image, made


def overlaps(pixels: int, yarns: int, scale: float) -> tuple[Image, slice]:
    """Return the share of each pixel that each yarn covers, and which pixels the cloth fills."""
    edges = (np.arange(pixels + 1) - pixels / 2) / scale + yarns / 2
    low, high = edges[:-1, None], edges[1:, None]
    yarn = np.arange(yarns)
    shares = np.clip(np.minimum(high, yarn + 1) - np.maximum(low, yarn), 0, None) * scale
    (inside,) = np.nonzero((edges[:-1] >= 0) & (edges[1:] <= yarns))
    return shares[inside], slice(inside[0], inside[-1] + 1)


#: A repeat of 15 ends and 6 picks, of flat yarns that leave little open.
WEAVE: dict[str, Any] = {
    **{f"{family}_section": "racetrack" for family in ("warp", "weft")},
    **{f"{family}_diameter": 5.8e-5 for family in ("warp", "weft")},
    **{f"{family}_aspect": 7.75 for family in ("warp", "weft")},
    "pattern": "twill 2/1",
    "warp_color": [BLACK, WHITE, "#d02020", "#f0e040", "#103080"],
    "weft_color": ["#f0f0f0", "#208030"],
}


@pytest.fixture
def crossings(monkeypatch: pytest.MonkeyPatch) -> Image:
    """The light of each crossing of a repeat, as a sheet shows it with ten pixels for each."""
    with monkeypatch.context() as patch:
        patch.setattr(level_of_detail, "SMALLEST_YARN", np.inf)
        image, seen = draw((300, 300), {}, ends=30, picks=30, **WEAVE)
    assert seen.pieces is None
    middle = (300 * (MARGIN + (1 - 2 * MARGIN) * (np.arange(30) + 0.5) / 30)).astype(int)
    return light_of(image[np.ix_(middle, middle)])[:6, :15]


@pytest.mark.parametrize(
    ("ends", "picks", "pixels"),
    [
        *((75, 67, 120), (523, 521, 12)),
        pytest.param(211, 209, 120, marks=pytest.mark.nightly),
        pytest.param(141, 133, 120, marks=pytest.mark.nightly),
        pytest.param(405, 409, 30, marks=pytest.mark.nightly),
    ],
)
def test_a_pixel_shows_the_exact_mean_of_its_area(
    ends: int, picks: int, pixels: int, crossings: Image
) -> None:
    size = pixels, round(pixels * picks / ends)
    found, seen = draw(size, {}, ends=ends, picks=picks, **WEAVE)
    assert seen.sheet is not None
    assert seen.pieces is None
    scale = (1 - 2 * MARGIN) * min(size[0] / ends, size[1] / picks)
    across, columns = overlaps(size[0], ends, scale)
    up, lines = overlaps(size[1], picks, scale)
    whole = crossings[np.ix_(np.arange(picks) % 6, np.arange(ends) % 15)]
    light = np.einsum("yp,pec,xe->yxc", up, whole, across, optimize=True)
    apart = found[lines, columns] - codes_of(light)
    assert np.abs(apart).max() < 4.0
    assert np.abs(apart.mean(axis=(0, 1))).max() < 1.5


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


def test_a_cloth_of_few_thin_yarns_has_exact_means() -> None:
    # Yarn by yarn it would take no time, but has edges that are averaged as sRGB values.
    _, seen = draw((60, 60), {}, ends=31, picks=31)
    assert seen.sheet is not None
    assert seen.pieces is None
    _, seen = draw((70, 70), {}, ends=31, picks=31)
    assert seen.sheet is None


@pytest.mark.parametrize(("pixels", "open_"), [(2.5, False), (4.5, True)])
def test_yarns_a_few_pixels_wide_look_like_modelled_yarns(
    pixels: float, open_: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    weave = {**WEAVE, "ends": 35, "picks": 32, "pattern": "satin 5/2"}
    if open_:  # round yarns, half of the cloth holes
        weave |= {f"{family}_section": "circular" for family in ("warp", "weft")}
        weave |= {f"{family}_aspect": 1.0 for family in ("warp", "weft")}
        weave |= {f"{family}_diameter": 1.5e-4 for family in ("warp", "weft")}
    side, fine = round(pixels * 35), 6
    large, seen = draw((fine * side, fine * side), {}, **weave)
    assert seen.pieces is not None
    exact = light_of(large).reshape(side, fine, side, fine, 3).mean(axis=(1, 3))
    monkeypatch.setattr(level_of_detail, "SHADER_PATCHES", 0)
    found, seen = draw((side, side), {}, **weave)
    assert seen.pieces is None
    inner = slice(round(4 * pixels), -round(4 * pixels))
    light, wanted = light_of(found)[inner, inner], exact[inner, inner]
    np.testing.assert_allclose(light.mean(axis=(0, 1)), wanted.mean(axis=(0, 1)), atol=0.03)
    assert np.abs(codes_of(light) - codes_of(wanted)).mean() < 12.0
    assert np.corrcoef(light.ravel(), wanted.ravel())[0, 1] > 0.95


def test_thin_yarns_of_a_large_draft_are_not_modelled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Few yarns, drawn as so many that a sheet takes their place.
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    monkeypatch.setattr(level_of_detail, "SHADER_PATCHES", 0)
    _, seen = draw((162, 162), {}, ends=60, picks=60, **WEAVE)
    assert seen.pieces is None
    assert seen.scene.surface.executions == 0


def test_yarns_of_unequal_diameters_are_modelled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_of_detail, "MANY_PATCHES", 0)
    monkeypatch.setattr(level_of_detail, "SHADER_PATCHES", 0)
    cloth = {"ends": 31, "picks": 31, "pattern": "plain"}
    for diameter, made in ((0.2e-3, False), ([0.2e-3, 0.3e-3], True)):
        _, seen = draw((100, 100), {}, **cloth, warp_diameter=diameter)
        assert (seen.pieces is not None) is made


def test_crossings_beyond_the_texture_size_keep_their_mean_colours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def mean() -> Image:
        image, seen = draw((64, 64), {}, ends=151, picks=153, **WEAVE)
        assert seen.pieces is None
        quarters = light_of(image[4:-4, 4:-4]).reshape(2, 28, 2, 28, 3).mean(axis=(1, 3))
        return codes_of(quarters)

    exact = mean()
    monkeypatch.setattr(sheet_actor, "LONGEST_ROW", 64)
    np.testing.assert_allclose(mean(), exact, atol=2.0)
