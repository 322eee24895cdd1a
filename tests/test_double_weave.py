"""Double weaves: found, and nothing else is taken for one; two cloths that touch nowhere."""

import doctest
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from weaves import changed

from spacemap_vtk.datasets.cloth_data import cloth_of
from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.filters.weave_source import WeaveSource
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.crimp.interchange import Interchange
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.drafts.drawdown import tile_drawdown, to_rows
from spacemap_vtk.textile.geometry.cloth_axes import cloth_axes, sample_axes
from spacemap_vtk.textile.geometry.partition import cloth_bounds
from spacemap_vtk.textile.geometry.weave import build_weave, count_patches, estimate_counts
from spacemap_vtk.textile.geometry.yarn_clearance import find_contact, least_clearance
from spacemap_vtk.textile.weave import double_weave
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import Layers, find_layers
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.threads import Threads

Bools = NDArray[np.bool_]
EVERY_OTHER = [0, 1]
ROUND = Threads(diameter=0.4e-3, spacing=1e-3)


def two_cloths(
    first_above: Bools,
    weave: Bools,
    of_ends: list[int] = EVERY_OTHER,
    of_picks: list[int] = EVERY_OTHER,
) -> Bools:
    """Weave two cloths crossing by crossing, from where the first one is above."""
    found = np.zeros(first_above.shape, dtype=bool)
    for pick, end in np.ndindex(found.shape):
        cloths = of_ends[end % len(of_ends)], of_picks[pick % len(of_picks)]
        if cloths[0] == cloths[1]:
            of_cloth = [
                [k for k in range(n) if turn[k % len(turn)] == cloths[0]]
                for n, turn in ((end + 1, of_ends), (pick + 1, of_picks))
            ]
            found[pick, end] = weave[
                (len(of_cloth[1]) - 1) % len(weave), (len(of_cloth[0]) - 1) % weave.shape[1]
            ]
        else:
            found[pick, end] = first_above[pick, end] == (cloths[0] == 0)
    return found


def blocks(size: int, picks: int = 48, ends: int = 40) -> Bools:
    row, column = np.indices((picks, ends)) // size
    return (row + column) % 2 == 0


def layered(
    drawdown: Bools,
    of_ends: list[int] = EVERY_OTHER,
    of_picks: list[int] = EVERY_OTHER,
    **more: object,
) -> Cloth:
    picks, ends = drawdown.shape
    layers = Layers(drawdown, np.resize(of_ends, ends) == 1, np.resize(of_picks, picks) == 1)
    return changed(Cloth(drawdown=drawdown, warp=ROUND, weft=ROUND, layers=layers), **more)


def stitched() -> Bools:
    """Two plain cloths, ends of the one below over some picks of the one above."""
    found = two_cloths(blocks(100), patterns.plain())
    found[0::16, 1::16] = found[8::16, 9::16] = True
    return found


@pytest.mark.parametrize("of_picks", [[0, 1], [1, 0]])
@pytest.mark.parametrize("size", [8, 12, 100])
@pytest.mark.parametrize("weave", [patterns.plain(), patterns.twill(2, 2)])
def test_two_cloths_are_found(weave: Bools, size: int, of_picks: list[int]) -> None:
    above = blocks(size)
    found = find_layers(two_cloths(above, weave, of_picks=of_picks))
    assert found is not None
    assert found.has_changes == (size < 100, size < 100)
    first = found.same_cloth & ~found.ends
    np.testing.assert_array_equal(found.in_upper_cloth[first], above[first])
    second = found.same_cloth & found.ends
    np.testing.assert_array_equal(found.in_upper_cloth[second], ~above[second])


@pytest.mark.parametrize(
    ("of_ends", "of_picks"),
    [
        ([0, 1], [0, 1, 1, 0]),  # cloth of double width, open at one side
        ([0, 0, 1, 1], [0, 0, 1, 1]),
        ([0, 0, 1], [0, 0, 1]),  # two face threads to one of the back
        ([0, 1], [1, 0, 0]),
    ],
)
def test_other_arrangements_of_threads_are_found(of_ends: list[int], of_picks: list[int]) -> None:
    found = find_layers(two_cloths(blocks(100), patterns.plain(), of_ends, of_picks))
    assert found is not None
    assert found.has_changes == (False, False)
    np.testing.assert_array_equal(found.ends, np.resize(of_ends, 40) == 1)
    np.testing.assert_array_equal(found.picks, np.resize(of_picks, 48) == 1)


def changing(picks: int = 48, ends: int = 40) -> tuple[Bools, Bools]:
    """Every other pick above; in blocks, every other end with it: these alone change places."""
    row, column = np.indices((picks, ends))
    with_upper = (column % 2 == 0) ^ (row // 12 % 2 == 1) ^ (column // 10 % 2 == 1)
    plain = (row // 2 + np.cumsum(with_upper, axis=1)) % 2 == 0
    return np.where(with_upper == (row % 2 == 0), plain, with_upper), with_upper


@pytest.mark.parametrize("number", [0, 1])
def test_threads_of_only_one_family_may_change_cloths(number: int) -> None:
    drawdown, with_upper = changing()
    if number:
        drawdown, with_upper = ~drawdown.T, with_upper.T
    found = find_layers(np.ascontiguousarray(drawdown))
    assert found is not None
    changes, stays = (found.ends, found.picks)[:: -1 if number else 1]
    assert changes is None
    np.testing.assert_array_equal(stays, np.arange(48) % 2 == 1)
    assert found.has_changes == (number == 0, number == 1)
    level = found.same_cloth == found.in_upper_cloth
    edge = np.abs(np.diff(with_upper.astype(int), axis=number)).sum()
    # where a yarn changes is known to a thread or two
    assert np.count_nonzero(level != with_upper) <= 2 * edge
    picks, ends = drawdown.shape
    given = {("weft_layer", "warp_layer")[number]: [1, 2]}
    layers = WeaveSource(pattern=to_rows(drawdown), ends=ends, picks=picks, **given).cloth.layers
    assert layers is not None
    np.testing.assert_array_equal(layers.same_cloth, found.same_cloth)


def test_stitches_do_not_count_as_changes_of_place() -> None:
    found = find_layers(stitched())
    assert found is not None
    assert found.has_changes == (True, True)
    assert (found.in_upper_cloth == ~found.ends)[found.same_cloth].all()


def test_single_cloths_are_not_double_weaves() -> None:
    waffle = np.array(
        [
            [c == "1" for c in row]
            for row in (
                "01000001",
                "10100010",
                "01010101",
                "10101011",
                "01011111",
                "10101011",
                "01010101",
                "10100010",
            )
        ]
    )
    for weave in (
        patterns.plain(),
        patterns.twill(2, 2),
        patterns.twill(3, 1),
        patterns.satin(8, 3),
        patterns.basket(2),
        patterns.rib(2, 2),
        patterns.rib(1, 1),
        waffle,
        np.ones((4, 4), dtype=bool),
    ):
        for turned, ends in ((weave, 3), (weave.T, 33)):
            assert find_layers(tile_drawdown(turned, ends, 40)) is None
    random = np.random.default_rng(1)
    for _ in range(20):
        assert find_layers(random.random((8, 8)) < 0.5) is None


def nearest_of_two_cloths(cloth: Cloth) -> float:
    """Distance between yarns of different cloths, from samples of axes alone."""
    points, yarn = sample_axes(cloth, 24)
    layers, least = cloth.layers, np.inf
    assert layers is not None
    ends = cloth.size[0]
    radii = np.concatenate([0.5 * yarns.diameter for yarns in cloth.yarns])
    # circles whose centres lie on the flat, where there is one
    lines = [points]
    for number, threads in enumerate(cloth.threads):
        of_family = (yarn < cloth.size[0]) == (number == 0)
        flat = np.where(of_family, (threads.aspect - 1.0) * radii[yarn], 0.0)
        for share in (-1.0, -0.5, 0.5, 1.0) if threads.aspect > 1.0 else ():
            lines.append(points + share * flat[:, None] * np.eye(3)[number])
    points, yarn = np.concatenate(lines), np.tile(yarn, len(lines))
    trees = [cKDTree(points[yarn == k]) for k in range(len(radii))]
    for k, tree in enumerate(trees):
        for other in range(k):
            # ends among themselves, picks among themselves, and those of different cloths
            if other >= ends or k < ends or not layers.same_cloth[k - ends, other]:
                found, _ = tree.query(points[yarn == other], distance_upper_bound=2e-3)
                least = min(least, float(found.min()) - radii[k] - radii[other])
    return least


@pytest.mark.parametrize(
    "cloth",
    [
        layered(two_cloths(blocks(6, 12, 14), patterns.plain())),
        layered(two_cloths(blocks(5, 12, 12), patterns.twill(2, 2)), warp_diameter=0.55e-3),
        layered(stitched()[:18, :18]),
        layered(np.random.default_rng(2).random((12, 12)) < 0.5, [0, 0, 1], [0, 1, 1, 0]),
        layered(
            two_cloths(blocks(6, 10, 10), patterns.plain()),
            warp_diameter=np.resize([0.15e-3, 0.1e-3, 0.12e-3], 10),
            weft_diameter=0.1e-3,
            warp_section="racetrack",
            warp_aspect=5.0,
            layer_gap=0.02e-3,
        ),
        layered(two_cloths(blocks(99, 12, 12), patterns.plain()), warp_diameter=1.1e-3),
        changed(
            Cloth(
                drawdown=changing(16, 14)[0],
                warp=ROUND,
                weft=ROUND,
                layers=find_layers(changing()[0]).crop(slice(14), slice(16)),
            ),
            weft_diameter=0.55e-3,
        ),
    ],
)
def test_yarns_of_the_two_cloths_never_touch(cloth: Cloth) -> None:
    thick = cloth.diameter_sum
    assert nearest_of_two_cloths(cloth) > 0.01 * thick
    # in each of them yarns touch, and nothing overlaps
    assert abs(least_clearance(cloth).distance) < 1e-12 * thick
    found = find_contact(cloth)
    end, pick = found.yarns[0], found.yarns[1] - cloth.size[0]
    assert cloth.layers.same_cloth[pick, end]
    low, high = sorted(
        cloth.crossing_profile(n).height[place]
        for n, place in enumerate(((end, pick), (pick, end)))
    )
    assert low < found.place[2] < high


def test_axes_are_smooth_where_cloths_change_places() -> None:
    cloth = layered(two_cloths(blocks(6, 18, 16), patterns.plain()))
    for family in cloth_axes(cloth):
        part = np.arange(len(family.length))
        inner = part[:-1][np.diff(family.owner) == 0]
        ones = np.ones(len(inner))
        before = family.evaluate(inner, inner + family.owner[inner], ones)
        after = family.evaluate(inner + 1, inner + 1 + family.owner[inner], 0 * ones)
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-12)
        assert abs(family.angle).max() <= np.pi / 2
        # each runs through both cloths
        assert np.ptp(family.height) > 2 * cloth.level


@pytest.mark.parametrize("weave", [patterns.plain(), patterns.twill(2, 2)])
def test_each_cloth_has_the_geometry_of_a_single_cloth(weave: Bools) -> None:
    both = layered(two_cloths(blocks(99, 16, 16), weave))
    wide = Threads(diameter=ROUND.diameter, spacing=2e-3)
    alone = Cloth(drawdown=tile_drawdown(weave, 8, 8), warp=wide, weft=wide)
    for family, single in zip(cloth_axes(both), cloth_axes(alone), strict=True):
        for second, level in ((0, both.level), (1, -both.level)):
            mine = np.resize([1 - second, second], 16) == 1
            stations, parts = (np.repeat(mine, family.parts + more) for more in (1, 0))
            np.testing.assert_array_equal(family.parts[mine], single.parts)
            np.testing.assert_allclose(family.height[stations] - level, single.height, atol=1e-15)
            np.testing.assert_allclose(family.angle[stations], single.angle, atol=1e-12)
            # but for how far yarns reach past their last crossing
            inner = np.ones(len(single.length), dtype=bool)
            inner[np.cumsum(single.parts) - 1] = inner[np.cumsum(single.parts) - single.parts] = (
                False
            )
            np.testing.assert_allclose(family.length[parts][inner], single.length[inner])
    crimps = [[family.crimp.crimp for family in cloth.families] for cloth in (both, alone)]
    assert crimps[0] == pytest.approx(crimps[1], rel=1e-12)
    thickness = fabric_figures(alone)["thickness"]
    assert fabric_figures(both)["thickness"] == pytest.approx(
        2 * thickness + 0.1 * both.diameter_sum
    )


def test_counts_and_bounds_match_the_built_patches() -> None:
    cloth = layered(two_cloths(blocks(6, 18, 16), patterns.plain()))
    made, counted = build_weave(cloth), count_patches(cloth)[0]
    assert (len(made.points), len(made.patches)) == counted[:2]
    assert estimate_counts(cloth).points >= counted.points
    bounds = np.stack([made.points.min(axis=0), made.points.max(axis=0)], axis=1).ravel()
    np.testing.assert_allclose(cloth_bounds(cloth), bounds, atol=1e-15)


def test_a_draft_of_a_double_weave_is_drawn_as_two_cloths(tmp_path: Path) -> None:
    file = tmp_path / "double.txt"
    file.write_text("\n".join(to_rows(two_cloths(blocks(12, 24, 24), patterns.plain()))))
    scene = Scene({"weave": {"draft": str(file)}})
    assert any("double weave" in text for text in scene.woven.cloth.warnings)
    weave = scene.source.update().output
    read = cloth_of(weave)
    assert read is not None
    np.testing.assert_array_equal(
        read.crossing_profile(0).height, scene.woven.cloth.crossing_profile(0).height
    )
    single = WeaveSource(draft=file, warp_layer=1, weft_layer=[1, 2])
    assert single.cloth.layers is None
    assert single.cloth.warnings == ()


def test_a_small_piece_is_recognised_like_the_whole() -> None:
    for size in (7, 2, 30):
        cloth = WeaveSource(pattern=["1000", "1110", "0010", "1011"], ends=size, picks=size).cloth
        assert cloth.layers is not None
        assert cloth.layers.has_changes == (False, False)
        assert len(build_weave(cloth).points) > 0
    assert WeaveSource(pattern="twill 2/2").cloth.layers is None


def test_separate_cloths_may_be_as_dense_as_a_single_one(tmp_path: Path) -> None:
    for size, filling in ((12, 0.45), (99, 0.9)):
        file = tmp_path / f"{size}.txt"
        file.write_text("\n".join(to_rows(two_cloths(blocks(size, 24, 24), patterns.plain()))))
        apart = {"warp_spacing": "1 mm", "weft_spacing": "1 mm"}
        cloth = WeaveSource(draft=file, thick_yarns="scale", **apart).cloth
        assert cloth.warp.diameter == pytest.approx(filling * 1e-3)
        cloth.check()


def test_layers_can_be_given(tmp_path: Path) -> None:
    given = WeaveSource(ends=9, picks=8, warp_layer=[1, 2], weft_layer=[2, 1], layer_gap="1 mm")
    cloth = given.cloth
    assert cloth.layers is not None
    assert cloth.layers.ends.tolist() == [False, True] * 4 + [False]
    assert 2 * cloth.level - cloth.sheet_thickness == pytest.approx(1e-3)
    assert nearest_of_two_cloths(cloth) > 0.0
    for wrong, key in (
        ({"warp_layer": [1, 2]}, "weft_layer"),
        ({"warp_layer": [1, 2], "weft_layer": [1, 2], "axis": "spline"}, "axis"),
        ({"warp_layer": [1, 2], "weft_layer": [1, 2], "warp_diameter": "0.3 mm"}, "warp_diameter"),
    ):
        with pytest.raises((InputError, GeometryError)) as refused:
            WeaveSource(ends=9, picks=9, **wrong).cloth.check()
        assert refused.value.key == key
        assert refused.value.cure
    with pytest.raises(InputError, match="double weave"):
        Interchange(cloth)
    with pytest.raises(InputError, match="allowed: warp_layer = 1"):
        CrimpInterchange().yarns(cloth)


def test_examples() -> None:
    assert doctest.testmod(double_weave).failed == 0
