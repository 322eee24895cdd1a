"""Yarns that keep their length in a space that stretches: lengths, distances and sections."""

from __future__ import annotations

import doctest
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    CrimpInterchange,
    PatchTessellator,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.datasets.arrays import add_array, array_of, points_of
from spacemap_vtk.datasets.cloth_data import FOOT, OFFSET, add_cloth
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.embedding import plane_slopes
from spacemap_vtk.embedding.plane_slopes import PlaneSlopes
from spacemap_vtk.errors import InputError, SpacemapWarning
from spacemap_vtk.textile.crimp import crimp_geometry as module
from spacemap_vtk.textile.crimp.crimp_geometry import CrimpGeometry
from spacemap_vtk.textile.crimp.interchange import Interchange
from spacemap_vtk.textile.drafts.drawdown import repeat_size
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.geometry.yarn_clearance import measure_clearance

DRAFT = Path(__file__).parents[1] / "scenes" / "32-shaft_twill.wif"
WEAVES: dict[str, dict[str, Any]] = {
    "plain": {"pattern": "plain"},
    "twill": {"pattern": "twill 2/2"},
    "basket": {"pattern": "basket 2"},
    "satin": {"pattern": "satin 8/3"},
    "unequal": {"warp_diameter": "0.2 mm", "weft_diameter": "0.3 mm", "warp_spacing": "0.6 mm"},
    "racetrack": {
        "pattern": "twill 2/1",
        "warp_section": "racetrack",
        "warp_aspect": 1.3,
        "warp_spacing": "0.6 mm",
    },
    "lens": {
        "pattern": "twill 2/1",
        "warp_section": "lenticular",
        "warp_diameter": "0.14 mm",
        "warp_aspect": 2.2,
        "weft_section": "lenticular",
        "weft_diameter": "0.15 mm",
        "weft_aspect": 2.0,
    },
    "draft": {"draft": DRAFT, "thick_yarns": "scale"},
}
#: Pulled and pressed, turned and sheared.
SHEARED = np.array([[1.01, 0.15, 0.0], [-0.12, 1.02, 0.1], [0.05, -0.2, 0.8]])


def woven(name: str, **more: Any) -> WeaveSource:
    """A weave of a repeat and a yarn."""
    source = WeaveSource(**WEAVES[name])
    ends, picks = repeat_size(source.source.drawdown)
    source.configure(ends=ends + 1, picks=picks + 1, **more)
    return source


def pipeline(
    source: WeaveSource,
    gradient: Any,
    cage_of: dict[str, Any] | None = None,
    smooth: bool = False,
    **values: Any,
) -> tuple[CrimpInterchange, BarycentricWarp]:
    """Yarns and warp behind a weave, in a cage that moves by a gradient or a function."""
    made = TetraCage(**{"divisions": (4, 3, 1), "padding": 0.1, **(cage_of or {})})
    cage = connect(source, made).update().output
    grid = cage.NewInstance()
    grid.ShallowCopy(cage)
    points = points_of(grid)
    moved = gradient(points) if callable(gradient) else points @ np.asarray(gradient).T
    add_array(grid.GetPointData(), "displacement", moved - points)
    crimp = CrimpInterchange(**values)
    connect((source, grid), crimp)
    return crimp, connect((crimp, grid), BarycentricWarp(smooth=smooth))


def cells(stage: CrimpInterchange, name: str) -> np.ndarray:
    """What a cell array of the last update holds."""
    return vtk_to_numpy(stage.output.GetCellData().GetArray(name))


def repeat_lengths(
    yarns: CrimpGeometry, number: int, height: np.ndarray, stretch: np.ndarray
) -> Any:
    """Lengths of the exact axes of warp or weft from the first crossing to the last."""
    path = yarns.axes(number, height, stretch)
    crossed = yarns.cloth.yarns[1 - number]
    station = np.arange(len(path.length)) + path.owner
    middle = 0.5 * (path.along[station] + path.along[station + 1])
    # without the flats at both ends: of each, half would belong to the repeat
    far = 0.5 * crossed.flat[0] / stretch[number].max()
    inside = (middle > crossed.position[0] + far) & (middle < crossed.position[-1] - far)
    return np.bincount(path.owner[inside], path.length[inside]) + crossed.flat[0]


@pytest.mark.parametrize("stretch", [(1.01, 1.005), (1.02, 0.99), (0.99, 1.02), (1.02, 0.96)])
@pytest.mark.parametrize("name", WEAVES)
def test_yarns_keep_their_length(name: str, stretch: tuple[float, float]) -> None:
    cloth = woven(name).cloth
    yarns, shape = CrimpGeometry(cloth), (2, *cloth.drawdown.shape)
    still, asked = np.ones(shape), np.broadcast_to(np.reshape(stretch, (2, 1, 1)), shape)
    rest, state = Interchange(cloth).solve(still).height, Interchange(cloth).solve(asked)
    taut = ~state.slack & (state.strain == 0.0)
    assert taut.any()
    for number in range(2):
        kept = taut[0].all(axis=0) if number == 0 else taut[1].all(axis=1)
        before = repeat_lengths(yarns, number, rest, still)
        after = repeat_lengths(yarns, number, state.height, asked)
        within = 1e-9 if name == "draft" else 1e-12
        assert np.allclose(after[kept], before[kept], rtol=within, atol=0.0)


@pytest.mark.parametrize("name", WEAVES)
def test_axes_are_as_far_apart_as_the_crossings_say(name: str) -> None:
    source = woven(name)
    crimp, warp = pipeline(source, SHEARED)
    points, cloth = points_of(warp.update().output), source.cloth
    # rings over crossings, whose middles lie on the axes
    foot = array_of(crimp.output.GetPointData(), FOOT, "")
    made = build_weave(cloth)
    found: list[dict[tuple[float, float], np.ndarray]] = [{}, {}]
    for tubes, at in zip(made.tubes, found, strict=True):
        count = (3 * int(tubes.parts.sum()) + len(tubes.parts)) * tubes.ring
        here = slice(tubes.first, tubes.first + count)
        middles = tubes.ring_centres(points)
        for place, middle in zip(foot[here][:: tubes.ring], middles, strict=True):
            at[tuple(np.round(place[:2] * 1e9))] = middle
    stretch = np.linalg.norm(SHEARED[:, [1, 0]], axis=0)
    state = Interchange(cloth).solve(
        np.broadcast_to(stretch[:, None, None], (2, *cloth.drawdown.shape))
    )
    ends, picks = (yarns.position for yarns in cloth.yarns)
    checked = 0
    for i, y in enumerate(picks):
        for j, x in enumerate(ends):
            key = tuple(np.round(np.array([x, y]) * 1e9))
            if key in found[0] and key in found[1]:
                apart = np.linalg.norm(found[0][key] - found[1][key])
                assert apart == pytest.approx(0.5 * state.distance[i, j], rel=1e-9)
                checked += 1
    assert checked == cloth.drawdown.size or name == "racetrack"


@pytest.mark.parametrize(
    ("name", "pull"),
    [
        *(("plain", (0.97, 1.008)), ("unequal", (0.97, 1.008)), ("racetrack", (1.02, 1.01))),
        *(
            pytest.param(name, pull, marks=pytest.mark.nightly)
            for pull in ((0.97, 1.008), (1.02, 1.01))
            for name in ("twill", "satin", "plain" if pull[0] > 1 else "racetrack")
        ),
    ],
)
def test_yarns_touch_and_never_overlap(name: str, pull: tuple[float, float]) -> None:
    source = woven(name, exact=True)
    crimp, warp = pipeline(source, np.diag([*pull, 1.2]))
    points = points_of(warp.update().output)
    weights = vtk_to_numpy(warp.output.GetPointData().GetRationalWeights())
    made = replace(build_weave(source.cloth), weights=weights)
    apart = measure_clearance(made, points).distance
    # Pressed yarns are thinner at their crossings, between these as thick as ever.
    assert abs(apart) < 1e-6 * source.cloth.diameter_sum
    assert (cells(crimp, "yarn_strain") == 0.0).all()


def test_sections_turn_and_are_not_squeezed() -> None:
    def rolled(points: np.ndarray) -> np.ndarray:
        # round a cylinder of 3 mm, pulled along it
        angle, radius = points[:, 0] / 3e-3, 3e-3 - points[:, 2]
        return np.column_stack(
            [radius * np.sin(angle), 1.02 * points[:, 1], 3e-3 - radius * np.cos(angle)]
        )

    source = woven("twill", caps=False)
    for motion in (rolled, np.diag([0.97, 1.03, 2.0])):
        _, warp = pipeline(source, motion, flattest=1.0)
        points, made = points_of(warp.update().output), build_weave(source.cloth)
        for tubes in made.tubes:
            rings = 3 * int(tubes.parts.sum()) + len(tubes.parts)
            here = slice(tubes.first, tubes.first + rings * tubes.ring)
            for stations in (0, -1):
                at = np.cumsum(3 * tubes.parts + 1) - (1 if stations else 3 * tubes.parts + 1)
                was, now = (
                    (ring - ring.mean(axis=1, keepdims=True))[at]
                    for ring in (
                        p[here].reshape(rings, tubes.ring, 3) for p in (made.points, points)
                    )
                )
                assert np.allclose(now @ now.swapaxes(1, 2), was @ was.swapaxes(1, 2), rtol=1e-9)


def test_nothing_changes_at_rest() -> None:
    source = woven("satin", exact=True)
    crimp, warp = pipeline(source, np.eye(3))
    rest = points_of(source.update().output)
    assert abs(points_of(warp.update().output) - rest).max() < 1e-15
    before = source.output.GetPointData().GetRationalWeights()
    after = warp.output.GetPointData().GetRationalWeights()
    assert np.allclose(vtk_to_numpy(after), vtk_to_numpy(before), atol=1e-12)
    assert not crimp.warnings
    assert cells(crimp, "crimp") == pytest.approx(source.cloth.families[0].crimp.crimp, rel=0.8)


def test_a_new_shape_runs_each_stage_once_and_locates_nothing_anew() -> None:
    source = woven("plain")
    crimp, warp = pipeline(source, np.diag([1.01, 0.99, 1.0]))
    surface = connect(warp, PatchTessellator(subdivisions=1)).update()
    kept = crimp._kept, warp._embedding
    grid = crimp.GetInputDataObject(1, 0)
    field = 2.0 * array_of(grid.GetPointData(), "displacement", "")
    add_array(grid.GetPointData(), "displacement", field)
    grid.Modified()
    surface.update()
    assert [stage.executions for stage in (source, crimp, warp, surface)] == [1, 2, 2, 2]
    assert (crimp._kept, warp._embedding) == kept
    assert not any(surface.output.GetPointData().HasArray(name) for name in (FOOT, OFFSET))
    assert surface.output.GetCellData().HasArray("yarn_strain")
    moved = points_of(source.output) + array_of(warp.output.GetPointData(), "displacement", "")
    assert np.allclose(moved, points_of(warp.output), rtol=0.0, atol=1e-16)


@pytest.mark.parametrize(
    ("cage_of", "smooth"),
    [
        ({"divisions": (3, 3, 2)}, False),
        ({"order": 2}, False),
        ({"order": 2}, True),
        ({}, True),
        ({"method": "carved"}, False),
    ],
)
def test_any_cage_and_either_warp_carry_feet(cage_of: dict[str, Any], smooth: bool) -> None:
    source = woven("twill")
    sheet, other = (
        points_of(pipeline(source, SHEARED, *how)[1].update().output)
        for how in ((None, False), (cage_of, smooth))
    )
    assert abs(other - sheet).max() < 1e-9 * np.ptp(sheet)


def test_single_precision_gives_the_same_result() -> None:
    double = points_of(pipeline(woven("twill"), SHEARED)[1].update().output)
    crimp, warp = pipeline(woven("twill", precision="single"), SHEARED)
    single = points_of(warp.update().output)
    kept = [array_of(crimp.output.GetPointData(), name, "") for name in (FOOT, OFFSET)]
    assert {array.dtype for array in (single, *kept)} == {np.dtype(np.float32)}
    assert abs(single - double).max() < 1e-6 * np.ptp(double)


@pytest.mark.parametrize("name", ["twill", "racetrack"])
def test_pieces_make_up_the_whole(name: str) -> None:
    source = woven(name)
    crimp, warp = pipeline(source, SHEARED)
    whole = points_of(warp.update().output).copy()
    strain = cells(crimp, "crimp").copy()
    points, values = [], []
    for number in range(3):
        warp.update(piece=Piece(number, 3, 0))
        points.append(points_of(warp.output).copy())
        values.append(cells(crimp, "crimp").copy())
    # but for the last digit: what vectors of the processor round, the rest of an array may not
    parts = np.concatenate(points)
    assert parts.shape == whole.shape
    parts, whole = (rows[np.lexsort(np.rint(rows / 1e-12).T)] for rows in (parts, whole))
    np.testing.assert_allclose(parts, whole, rtol=0, atol=1e-18)
    assert sorted(np.concatenate(values)) == sorted(strain)
    data = crimp.output.GetCellData()
    names = [data.GetArrayName(place) for place in range(data.GetNumberOfArrays())]
    assert names[-4:] == ["crimp", "yarn_strain", "contact_force", "jammed"]  # in each process


def test_jams_slack_and_strain_are_reported() -> None:
    source = WeaveSource(ends=6, picks=5)
    jam, _ = pipeline(source, np.diag([0.8, 1.06, 1.0]))
    with pytest.warns(
        SpacemapWarning, match="30 of 30 crossings are jammed.*compresses the weft to 0.8"
    ):
        jam.update()
    assert cells(jam, "jammed").max() == 1
    # Peirce: p 0.485, h 0.25, D 0.5 mm: l 0.559923 mm, and the yarn has 0.571751
    slack, _ = pipeline(source, np.diag([0.97, 0.97, 1.0]))
    with pytest.warns(SpacemapWarning, match="yarns are slack at 30 of 30 crossings: .* 2.11 %"):
        slack.update()
    crimp, warp = pipeline(source, np.diag([1.3, 1.3, 1.0]))
    with pytest.warns(SpacemapWarning, match="no crimp left.*strained by up to"):
        warp.update()
    assert np.isfinite(points_of(warp.output)).all()
    assert cells(crimp, "yarn_strain").max() > 0.05


def test_elastic_yarns_share_the_stretch_as_published() -> None:
    # VERIFICATION: d 0.25, p 0.5 mm, EA 1 N, hard contact, (1.05, 0.95): 0.70 and 0.45 %
    source = WeaveSource(ends=5, picks=5, warp_diameter="0.25 mm", weft_diameter="0.25 mm")
    crimp, _ = pipeline(
        source, np.diag([0.95, 1.05, 1.0]), inextensible=False, tension="1 N", flattest=1.0
    )
    crimp.update()
    family = cells(crimp, "family") if crimp.output.GetCellData().HasArray("family") else None
    assert family is not None
    strain = cells(crimp, "yarn_strain")
    assert strain[family == 0] == pytest.approx(0.0070, abs=5e-5)
    assert strain[family == 1] == pytest.approx(0.0045, abs=5e-5)
    assert cells(crimp, "yarn_tension") == pytest.approx(strain)


def test_a_modulus_is_for_the_count_of_each_yarn() -> None:
    source = WeaveSource(ends=2, picks=2, warp_count=["20 tex", "30 tex"], weft_count="40 tex")
    stage = CrimpInterchange(inextensible=False, modulus=["500 cN/tex", "200 cN/tex"])
    tension = np.asarray(stage.yarns(source.cloth).tension)
    assert tension[0].tolist() == [pytest.approx([100.0, 150.0])] * 2
    assert tension[1] == pytest.approx(80.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"inextensible": False}, "need a tension or a modulus"),
        ({"inextensible": False, "tension": 1.0, "modulus": 1.0}, "tension and modulus cannot"),
    ],
)
def test_impossible_yarns_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        pipeline(woven("plain"), np.eye(3), **values)[0].update()
    with pytest.raises(InputError, match=message):
        CrimpInterchange(**values).check()


def test_input_that_is_not_a_weave_is_refused() -> None:
    source = woven("plain")
    crimp, _ = pipeline(source, np.eye(3))
    bare = source.update().output.NewInstance()
    bare.CopyStructure(source.output)
    crimp.SetInputDataObject(0, bare)
    with pytest.raises(InputError, match="are not a weave"):
        crimp.update()
    add_cloth(bare, replace(source.cloth, density=None))
    points_of(bare)[:] += 1e-3
    bare.Modified()
    with pytest.raises(InputError, match="points on port 0 have been moved"):
        crimp.update()
    points_of(bare)[:] -= 1e-3
    crimp.configure(inextensible=False, modulus="500 cN/tex")
    with pytest.raises(InputError, match="needs the yarn count"):
        crimp.update()
    with pytest.raises(InputError, match='axis = "arcs"'):
        pipeline(woven("plain", axis="spline"), np.eye(3))[0].update()


def test_a_bent_sheet_stretches_as_its_mid_surface() -> None:
    cage = TetraCage(divisions=(12, 4, 1))
    connect(WeaveSource(ends=24, picks=8), cage).update()
    grid = cage.output
    rest = points_of(grid)
    connectivity = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    places = np.zeros((50, 3))
    places[:, 0] = np.linspace(-0.8, 0.8, 50) * rest[:, 0].max()
    radius = 4e-3
    angle, reach = rest[:, 0] / radius, radius - rest[:, 2]
    moved = np.column_stack([reach * np.sin(angle), rest[:, 1], radius - reach * np.cos(angle)])
    x, y = PlaneSlopes(places, rest, connectivity).compute(moved - rest)
    # chords of the arc
    assert np.linalg.norm(x, axis=1) == pytest.approx(
        np.sinc(0.5 * 2 * rest[:, 0].max() / 12 / radius / np.pi), rel=1e-3
    )
    assert y == pytest.approx(np.broadcast_to([0.0, 1.0, 0.0], y.shape), abs=1e-12)


def test_examples() -> None:
    for checked in (module, plane_slopes):
        assert doctest.testmod(checked).failed == 0
