"""Figures of a large cloth from a few of its yarns and crossings."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from spacemap_vtk.textile.geometry import partition, yarn_clearance
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection, cloth_axes
from spacemap_vtk.textile.geometry.partition import crop_cloth, representative_parts
from spacemap_vtk.textile.geometry.weave import build_weave, count_patches
from spacemap_vtk.textile.geometry.yarn_clearance import least_clearance
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.threads import Threads

THREADS = Threads(diameter=0.25e-3, spacing=0.5e-3)


def shafts(ends, picks, seed, shaft_count=6):
    """A drawdown as a loom makes it: few different ends, and few different picks."""
    rng = np.random.default_rng(seed)
    threading, treadling = rng.integers(shaft_count, size=ends), rng.integers(5, size=picks)
    return (rng.random((5, shaft_count)) < 0.5)[treadling][:, threading]


@pytest.mark.parametrize("axis", ["arcs", "spline"])
@pytest.mark.parametrize("varied", [False, True])
def test_equal_yarns_are_measured_once(axis, varied):
    rng = np.random.default_rng(1)
    warp = replace(THREADS, diameter=rng.choice([0.2e-3, 0.25e-3], 40)) if varied else THREADS
    cloth = Cloth(drawdown=shafts(40, 30, 2), warp=warp, weft=THREADS, axis=axis)
    first, which = cloth.yarn_groups[0]
    assert len(first) <= 12 < 40
    for yarn, course in enumerate(which):
        np.testing.assert_array_equal(cloth.is_over(0)[yarn], cloth.is_over(0)[first[course]])
        assert cloth.yarns[0].diameter[yarn] == cloth.yarns[0].diameter[first[course]]
    made, (counts, error) = build_weave(cloth), count_patches(cloth)
    assert (counts.points, counts.patches) == (len(made.points), len(made.patches))
    assert error == pytest.approx(made.radial_error, rel=1e-12)
    figures = fabric_figures(cloth)
    for name, path in zip(("warp", "weft"), cloth_axes(cloth), strict=True):
        assert figures[name]["yarn_length"] == pytest.approx(path.length.sum(), rel=1e-12)


@pytest.mark.parametrize("flat", [False, True])
def test_a_cropped_cloth_keeps_its_position(flat):
    rng = np.random.default_rng(4)
    shape = {"section": "racetrack", "aspect": 1.4} if flat else {}
    warp = Threads(diameter=rng.choice([0.15e-3, 0.2e-3], 30), spacing=0.5e-3, **shape)
    weft = Threads(diameter=0.2e-3, spacing=rng.choice([0.5e-3, 0.6e-3], 39), **shape)
    cloth = Cloth(drawdown=shafts(30, 40, 5), warp=warp, weft=weft)
    part = YarnSelection(slice(7, 19), slice(20, 36))
    for number, (whole, some) in enumerate(
        zip(cloth_axes(cloth, part), cloth_axes(crop_cloth(cloth, part)), strict=True)
    ):
        np.testing.assert_allclose(some.lateral, whole.lateral, rtol=1e-12)
        # From one of its crossings to the next, wherever both are inside.
        inside = cloth.yarns[1 - number].position[part[1 - number]][[0, -1]] + [1e-9, -1e-9]
        stations = [
            np.column_stack([path.along, path.height])[
                (path.along > inside[0]) & (path.along < inside[1])
            ]
            for path in (some, whole)
        ]
        assert len(stations[0]) > 200
        np.testing.assert_allclose(*stations, atol=1e-15)


def test_representative_parts_contain_each_local_weave(monkeypatch):
    # In smaller crops more crossings lie at a border, where some of their neighbours are missing.
    monkeypatch.setattr(partition, "_PER_WEAVE", 2.0)
    cloth = Cloth(drawdown=shafts(300, 200, 3), warp=THREADS, weft=THREADS)
    parts, weaves = representative_parts(cloth, 30_000)
    around = np.pad(cloth.drawdown.astype(np.uint8), 1, constant_values=2)  # 2: past the edge
    found = {
        around[i : i + 3, j : j + 3].tobytes(): weaves[i, j]
        for i, j in np.ndindex(cloth.drawdown.shape)
    }
    assert sorted(found.values()) == list(range(weaves.max() + 1))
    reported = np.concatenate([weaves[picks, ends].ravel() for ends, picks in parts])
    assert set(reported) == set(found.values())
    assert len(representative_parts(cloth, 300)[0]) == 1 < len(parts)
    plain = Cloth(drawdown=np.indices((200, 300)).sum(axis=0) % 2, warp=THREADS, weft=THREADS)
    # Two within and two at each edge, one at each corner.
    assert representative_parts(plain, 3000)[1].max() + 1 == 2 + 4 * 2 + 4
    # An end that is thicker is another one, and so are those beside it: each has two crossings
    # within, and one at each edge.
    thick = np.where(np.arange(300) == 150, 0.25e-3, 0.2e-3)
    varied = replace(plain, warp=replace(THREADS, diameter=thick))
    assert representative_parts(varied, 3000)[1].max() + 1 == 14 + 3 * (2 + 2)


@pytest.mark.parametrize(
    "section", ["circular", pytest.param("racetrack", marks=pytest.mark.nightly)]
)
def test_refinement_never_drops_the_nearest_place(monkeypatch, section):
    rng = np.random.default_rng(5)
    warp, weft = (
        Threads(
            diameter=rng.uniform(0.2e-3, 0.3e-3, size),
            spacing=0.9e-3,
            section=section,
            aspect=1.0 if section == "circular" else 1.4,
        )
        for size in (12, 10)
    )
    # by splines yarns overlap, each pair otherwise
    cloth = Cloth(drawdown=rng.random((10, 12)) < 0.5, warp=warp, weft=weft, axis="spline")
    found = least_clearance(cloth)
    monkeypatch.setattr(yarn_clearance, "_FEW", 10**9)
    everywhere = least_clearance(cloth)
    assert found.distance < -1e-6
    assert found.distance == pytest.approx(everywhere.distance, abs=1e-15)
    assert found.yarns == everywhere.yarns


@pytest.mark.nightly
def test_figures_of_a_metre_of_cloth_need_little_memory(tmp_path):
    """4 million crossings: 200 MB; 27 GB if it were built."""
    file = tmp_path / "metre.toml"
    file.write_text("[weave]\nends = 2000\npicks = 2000\n")
    # The kernel's own figure counts what the tests take, from before the child was another program.
    code = (
        "import atexit, sys; from spacemap_vtk.cli.main import main; "
        "atexit.register(lambda: print(open('/proc/self/status').read(), file=sys.stderr)); "
        "main(sys.argv[1:])"
    )
    command = [sys.executable, "-c", code, "info", str(file), "--json", "-q"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    reported, peak = done.stdout, done.stderr.split("VmHWM:")[1].split()[0]
    assert '"least_clearance": {' in reported
    assert int(peak) < 500_000  # kB
