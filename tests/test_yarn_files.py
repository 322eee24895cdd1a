"""Yarns from files: formats, splines through points, overlaps, and yarns that come to rest.

All files are made here: by the program's writers, or by hand from the formats' descriptions.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk.datasets.moving_surface import YarnCurves
from spacemap_vtk.errors import GeometryError, InputError, SizeError, SpacemapWarning
from spacemap_vtk.filters.textile_file import make_file_yarns
from spacemap_vtk.io import registry
from spacemap_vtk.io.yarns import file_bytes
from spacemap_vtk.jobs.data import compute_data
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.rods.curves import (
    Curve,
    CurveSet,
    fit_yarns,
    relax_curves,
    repeat_yarns,
)
from spacemap_vtk.textile.rods.knit import relax_knit
from spacemap_vtk.textile.rods.overlap import find_largest_overlap
from spacemap_vtk.textile.rods.yarns import Yarn, basis_functions
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING

#: Points of a stitch of TexGen's weft knit, in mm, for its window's default values: wale height and
#: course width 1, loop height 1.2, yarn thickness 0.2.
WALE, COURSE, LOOP, THICK = 1.0, 1.0, 1.2, 0.2
KNIT = np.array(
    [
        [0.0, 0.0, THICK / 2],
        [(COURSE + 2 * THICK) / 4, (LOOP - WALE) / 2, 0.0],
        [COURSE / 4, LOOP / 2, -THICK / 2],
        [(COURSE - 2 * THICK) / 4, (LOOP + WALE) / 2, 0.0],
        [COURSE / 2, LOOP, THICK / 2],
        [(3 * COURSE + 2 * THICK) / 4, (LOOP + WALE) / 2, 0.0],
        [3 * COURSE / 4, LOOP / 2, -THICK / 2],
        [(3 * COURSE - 2 * THICK) / 4, (LOOP - WALE) / 2, 0.0],
        [COURSE, 0.0, THICK / 2],
    ]
)


def knit_tg3(points=KNIT, **changes: str) -> str:
    """Return a weft knit as TexGen writes it."""
    nodes = "\n".join(
        f'<MasterNode index="{k}" Position="{x:.9g}, {y:.9g}, {z:.9g}" Tangent="0, 0, 0" '
        'Up="0, 0, 1" Angle="0" />'
        for k, (x, y, z) in enumerate(points)
    )
    text = f"""<?xml version="1.0" ?>
<TexGenModel version="3.13.0">
  <Textile name="WeftKnit(W:1,C:1)" type="CTextileWeftKnit" NeedsBuilding="0">
    <Yarn index="0" NumSlaveNodes="40" NumSectionPoints="20" NeedsBuilding="7">
      <Interpolation Periodic="1" ForceInPlaneTangent="0" type="CInterpolationCubic" />
      <YarnSection type="CYarnSectionConstant">
        <Section type="CSectionEllipse" Width="{THICK}" Height="{THICK}" />
      </YarnSection>
      <Repeat value="{COURSE}, 0, 0" />
      <Repeat value="0, {WALE}, 0" />
      {nodes}
    </Yarn>
  </Textile>
</TexGenModel>
"""
    for old, new in changes.items():
        text = text.replace(old, new)
    return text


@pytest.fixture
def knit_file(tmp_path: Path) -> Path:
    """Write a weft knit."""
    file = tmp_path / "knit.tg3"
    file.write_text(knit_tg3())
    return file


def helices(turns: int = 2, points: int = 24) -> np.ndarray:
    """Return the points of two strands that wind about x, 1 mm apart, 4 mm a turn."""
    angle = 2 * np.pi * np.arange(turns * points + 1) / points
    return np.array(
        [
            np.stack(
                [4e-3 * angle / (2 * np.pi), 5e-4 * np.cos(angle + p), 5e-4 * np.sin(angle + p)],
                axis=1,
            )
            for p in (0.0, np.pi)
        ]
    )


def curves_of(lines, widths) -> YarnCurves:
    """Return straight Bézier pieces between points, as exports receive curves."""
    points = []
    for line in lines:
        share = np.arange(3)[:, None] / 3
        inner = line[:-1, None] + share * (line[1:] - line[:-1])[:, None]
        points += [inner.reshape(-1, 3), line[-1:]]
    counts = np.array([3 * len(line) - 2 for line in lines])
    colors = np.full((len(lines), 3), 100, np.uint8)
    return YarnCurves(np.concatenate(points)[None], counts, np.asarray(widths), colors)


@pytest.mark.parametrize(("ending", "error"), [(".bcc", 6e-8), (".tg3", 1e-11), (".csv", 1e-8)])
def test_written_curves_are_read_again(tmp_path, ending, error):
    lines = [*helices(), helices()[0, 5:9]]
    loop = np.vstack([lines[0][:24], lines[0][:1]])
    file = tmp_path / f"a{ending}"
    widths = np.full(4, 4e-4)
    registry.writer(file, "yarns").write(file, curves_of([*lines, loop], widths))
    found = registry.reader(file, "yarns").read(file)
    found = found.scaled(found.unit)
    assert [each.periods for each in found.curves] == [None, None, None, (0, 0)]
    for curve, line in zip(found.curves, [*lines, loop[:-1]], strict=True):
        assert curve.nodes == pytest.approx(line, rel=0, abs=error * 8e-3)
        assert curve.diameter == pytest.approx(4e-4, rel=1e-6)


def test_a_collection_follows_its_description(tmp_path):
    """Bytes made by hand: a loop of 3 points with y up, and the record of a longer form."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 1]], "<f4")
    head = struct.pack("<3sB2sBBQQ40s", b"BCC", 0x44, b"C0", 3, 1, 1, 3, b"by hand")
    file = tmp_path / "a.bcc"
    file.write_bytes(head + struct.pack("<i", -3) + points.tobytes() + bytes(30))
    found = registry.reader(file, "yarns").read(file)
    assert found.unit is None
    assert found.curves[0].periods == (0, 0)
    assert found.curves[0].nodes.tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 2]]


def test_yarns_of_stitch_meshes_follow_their_description(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0]], "<f4")

    def chunk(name: bytes, data: bytes) -> bytes:
        return name + struct.pack("<I", len(data)) + data

    yarn = struct.pack("<IIf4B", 0, 4, 0.25, 10, 20, 30, 255)
    file = tmp_path / "a.yarns"
    file.write_bytes(
        chunk(b"f3..", points.tobytes())
        + chunk(b"src.", bytes(16))
        + chunk(b"yarn", yarn)
        + chunk(b"strs", b"1")
    )
    (curve,) = registry.reader(file, "yarns").read(file).curves
    assert (curve.diameter, curve.color) == (0.5, (10, 20, 30))
    # the middles of its pieces are on it, and between two of them the quadratic spline's middle
    expected = [[0, 0], [0.5, 0], [0.875, 0.125], [1, 0.5], [1.125, 0.875], [1.5, 1], [2, 1]]
    assert curve.nodes[:, :2].tolist() == expected


def test_lines_of_vtk_have_their_diameters_and_colours(tmp_path):
    file = tmp_path / "a.vtp"
    data = pv.MultipleLines(helices()[0] * 1e3)
    data.cell_data["diameter"] = [0.4]
    data.cell_data["color"] = np.array([[1, 2, 3]], np.uint8)
    data.save(file)
    made = make_file_yarns(file)
    assert made.colors == [(1, 2, 3)]
    assert made.yarns[0].diameter == pytest.approx(4e-4)
    assert np.ptp(made.yarns[0].points[1:-1, 0]) == pytest.approx(8e-3, rel=1e-6)


def test_splines_of_points_are_the_helix_they_are_on(tmp_path):
    """Tables with 24 and 12 points a turn: the splines are the exact helix to their order."""
    errors = []
    for points in (24, 12):
        file = tmp_path / "a.csv"
        rows = [
            f"{k},{x:.12g},{y:.12g},{z:.12g},0.5"
            for k, line in enumerate(helices(points=points) * 1e3)
            for x, y, z in line
        ]
        file.write_text("\n".join(["yarn,x [mm],y [mm],z [mm],diameter [mm]", *rows]))
        made = make_file_yarns(file)
        line = made.yarns[0].points
        n, _, _ = basis_functions(np.linspace(0, 1, 9))
        place = line[np.arange(len(line) - 3)[:, None] + np.arange(4)].swapaxes(1, 2) @ n.T
        place = place.swapaxes(1, 2).reshape(-1, 3)
        inside = place[(place[:, 0] > 2e-3) & (place[:, 0] < 6e-3)]
        angle = 2 * np.pi * inside[:, 0] / 4e-3
        gap = np.hypot(inside[:, 1] - 5e-4 * np.cos(angle), inside[:, 2] - 5e-4 * np.sin(angle))
        errors.append(gap.max() / 5e-4)
        # two strands of 0.5 mm, 1 mm apart across: no overlap, and the nearest are 1 mm or less
        assert made.overlap == 0.0
    assert errors[0] < 1e-3
    assert errors[1] / errors[0] > 6


def test_splines_pass_through_unevenly_spaced_points():
    random = np.random.default_rng(1)
    x = np.cumsum(random.uniform(0.05, 1.0, 30))
    nodes = np.stack([x, np.sin(x), np.cos(2 * x)], axis=1)
    fit = fit_yarns(CurveSet([Curve(nodes, None, 0.5)], np.zeros((2, 3))))
    line = fit.yarns[0].points
    n, _, _ = basis_functions(np.linspace(0, 1, 101))
    place = line[np.arange(len(line) - 3)[:, None] + np.arange(4)].swapaxes(1, 2) @ n.T
    away = cKDTree(place.swapaxes(1, 2).reshape(-1, 3)).query(nodes)[0]
    assert away.max() < 1.2 * max(fit.deviation, 1e-3)
    assert 0.0 < fit.deviation < 0.01 * 0.5


def test_texgens_knit_is_its_spline_and_overlaps(knit_file):
    """TexGen's periodic spline, computed by SciPy, and its nearest points by brute force."""
    made = make_file_yarns(knit_file)
    at = np.linspace(0, 8, 4001)
    drift = at[:, None] * [COURSE / 8, 0, 0]
    flat = KNIT - np.arange(9)[:, None] * [COURSE / 8, 0, 0]
    place = CubicSpline(np.arange(9), flat, bc_type="periodic")(at) + drift
    line = np.vstack([made.yarns[0].points, made.yarns[0].points[:3] + made.cell[0]])
    count = len(made.yarns[0].points)
    n, _, _ = basis_functions(at * count / 8 % 1)
    span = np.minimum((at * count / 8).astype(int), count)
    line = np.vstack([line, line[3:4] + made.cell[0]])
    ours = np.einsum("sk,skc->sc", n, line[span[:, None] + np.arange(4)])
    assert ours * 1e3 == pytest.approx(place, abs=1e-9)
    nearest = min(
        cKDTree(place).query(place + np.array([k * COURSE, WALE, 0]))[0].min() for k in (-1, 0, 1)
    )
    assert made.overlap == pytest.approx(1 - nearest / THICK, abs=1e-4)
    assert any("overlap by up to 0.419" in note for note in made.notes)


def test_texgens_knit_is_free_of_overlaps_when_relaxed(tmp_path):
    """A loop height for which axes come as near as 0.641 diameters; at rest it is a stockinette."""
    points = KNIT.copy()
    points[[3, 4, 5], 1] += 0.5 * 0.1239 * np.array([1, 2, 1])
    points[[1, 2, 6, 7], 1] += 0.5 * 0.1239
    file = tmp_path / "knit.tg3"
    file.write_text(knit_tg3(points))
    assert make_file_yarns(file).overlap == pytest.approx(1 - 0.641, abs=1e-3)
    made = make_file_yarns(file, relax=True)
    assert 0.0 < made.overlap < 0.005
    assert made.notes == []
    length = yarn_length(made.yarns[0], made.cell) / (THICK * 1e-3)
    knit = relax_knit(("k",), length)
    size = np.diag(made.cell[:, :2]) / (THICK * 1e-3)
    assert size == pytest.approx(np.diag(knit.cell[:, :2]), rel=0.01)


def yarn_length(yarn: Yarn, cell: np.ndarray) -> float:
    """Measure a yarn that repeats itself along x, by short chords."""
    line = np.vstack([yarn.points, yarn.points[:3] + cell[0]])
    n, _, _ = basis_functions(np.arange(20) / 20)
    corners = line[np.arange(len(line) - 3)[:, None] + np.arange(4)]
    place = np.einsum("gk,skc->sgc", n, corners).reshape(-1, 3)
    place = np.vstack([place, place[:1] + cell[0]])
    return float(np.linalg.norm(np.diff(place, axis=0), axis=1).sum())


def test_chain_links_come_to_rest_and_ends_are_held(tmp_path):
    """Two linked loops become round; a straight yarn with ends stays where it is."""
    angle = 2 * np.pi * np.arange(16) / 16
    ring = np.stack([4 * np.cos(angle), 3 * np.sin(angle), 0 * angle], axis=1)
    other = ring[:, [0, 2, 1]] + [5.0, 0, 0]
    bar = np.array([[20.0, y, 0] for y in range(6)])
    curves = [Curve(ring, (0, 0), 1.0), Curve(other, (0, 0), 1.0), Curve(bar, None, 1.0)]
    found, _ = relax_curves(CurveSet(curves, np.zeros((2, 3))))
    assert find_largest_overlap(found.yarns, found.cell) is None
    bent = found.yarns[0].points
    radius = np.linalg.norm(bent - bent.mean(axis=0), axis=1)
    assert np.ptp(radius) < 1e-3
    assert found.yarns[2].points[1:-1, 1].tolist() == pytest.approx(np.linspace(0, 5, 9))


def test_repeats_join_yarns_that_repeat_themselves():
    square = np.array([[0.0, 0, 0], [0.3, 0.3, 0], [0.6, 0.1, 0], [0.9, 0.2, 0]])
    cell = np.array([[1.0, 0, 0], [0.2, 2.0, 0]])
    yarns = [Yarn(square, (1, 0)), Yarn(square, (0, 0)), Yarn(square, None), Yarn(square, (1, 1))]
    lines = repeat_yarns(yarns, cell, (3, 2))
    assert [sum(n == k for n, _ in lines) for k in range(4)] == [2, 6, 6, 4]
    assert sorted(len(line) for n, line in lines if n == 0) == [15, 15]
    assert sorted(len(line) for n, line in lines if n == 3) == [7, 7, 11, 11]


def refused(path: Path, content: bytes | str, match: str, error=InputError, **more) -> None:
    """Check that a file is refused with one message that names it or the key."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(error, match=match):
        make_file_yarns(path, **more)


def test_files_that_are_no_yarns_are_refused(tmp_path, monkeypatch):
    head = struct.pack("<3sB2sBBQQ40s", b"BCC", 0x44, b"C0", 3, 2, 1, 2, b"")
    points = struct.pack("<i6f", 2, 0, 0, 0, 1, 0, 0)
    bcc, tg3 = tmp_path / "a.bcc", tmp_path / "a.tg3"
    refused(bcc, b"PK\3\4" + bytes(99), "not a binary curve collection")
    refused(bcc, head[:40], "truncated")
    refused(bcc, head + points[:-4], "truncated")
    refused(bcc, head.replace(b"C0", b"B0") + points, "kind of curves.*allowed: C0")
    refused(
        bcc, head + struct.pack("<i6f", 2, 0, 0, 0, np.nan, 0, 0), "coordinate of yarn 0 is nan"
    )
    refused(bcc, head + struct.pack("<i3f", 1, 0, 0, 0), "its curves have 1 points.*says 2")
    refused(bcc, head + points, r"no diameter of yarn 0.*Set textile\.diameter", GeometryError)
    refused(bcc, head[:8] + bytes(56), "no yarns")
    refused(tmp_path / "a.smobj", "L knit\n", "not a whole stitch mesh")
    refused(tmp_path / "a.yarns", b"f3..\1\0\0\0", "truncated")
    refused(tmp_path / "a.xyz", "1", "no format of yarns has this ending")
    refused(tmp_path / "a.csv", "x,y,z\n1,2,3\n", "no column yarn")
    refused(tmp_path / "a.csv", "yarn,x,y,z\n0,1,2,3\n0,1,2,three\n", "row 3 of the table")
    refused(tg3, knit_tg3()[:-40], "not whole XML")
    refused(tg3, "<a/>", "not a textile of TexGen")
    refused(tg3, '<!DOCTYPE a [<!ENTITY b "c">]><a/>', "entities")
    refused(
        tg3, knit_tg3().replace("0.3, 0.2", "0.3; 0.2").replace(', 0" T', ', o" T'), "3 numbers"
    )
    refused(
        tg3,
        '<TexGenModel><Textile type="CTextileWeave2D" NumXYarns="2" /></TexGenModel>',
        "a pattern, but no yarns.*save it with its yarns",
    )
    monkeypatch.setattr(file_bytes, "MAX_BYTES", 100)
    refused(tg3, knit_tg3(), "too large for yarns", SizeError)
    with pytest.raises(InputError, match="no such file"):
        make_file_yarns(tmp_path / "none.bcc")


def test_a_file_is_a_textile_with_its_figures(knit_file):
    scene = Scene(
        {"textile": {"kind": "file", "file": str(knit_file), "repeats": [2, 3], "color": "#102030"}}
    )
    with pytest.warns(SpacemapWarning, match="overlap by up to 0.419 of their diameter"):
        scene.update()
    colors = vtk_to_numpy(scene.patches.GetCellData().GetArray("color"))
    assert np.unique(colors, axis=0).tolist() == [[16, 32, 48]]
    figures = {each.key: each.value for each in scene.textile.figures}
    assert (figures["cell_x"], figures["cell_y"]) == pytest.approx((1e-3, 1e-3))
    # 2 x 3 loops in 3 yarns, with half the loops above the last course
    assert scene.textile.yarn_diameters == pytest.approx(np.full(3, 2e-4))
    low, high = np.reshape(scene.patches.GetBounds(), (3, 2)).T
    assert high - low == pytest.approx([2e-3, 3.4e-3, 4e-4], abs=5e-5)
    density = COTTON * PACKING
    mass = density * np.pi / 4 * 4e-8 * figures["yarn_length"] / 1e-6
    assert figures["areal_mass"] == pytest.approx(mass)


def test_centre_lines_of_a_knit_are_exported_and_read_again(tmp_path):
    scene = Scene({"textile": {"wales": 2, "courses": 2}})
    scene.update()
    curves = compute_data(scene, "yarns", 0.0)
    assert curves.widths == pytest.approx(np.full(2, 5e-4), rel=1e-3)
    file = tmp_path / "a.bcc"
    registry.writer(file, "yarns").write(file, curves)
    found = make_file_yarns(file)
    bounds = np.reshape(scene.patches.GetBounds(), (3, 2)).T
    nodes = np.concatenate([yarn.points[1:-1] for yarn in found.yarns])
    assert nodes.min(axis=0) == pytest.approx(bounds[0] + 2.5e-4, abs=5e-5)
    assert nodes.max(axis=0) == pytest.approx(bounds[1] - 2.5e-4, abs=5e-5)
    assert found.overlap < 0.02
