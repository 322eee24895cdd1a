"""Moving surfaces for other programs, played back with three.js and checked by a validator."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import array_of, points_of, shallow_copy
from spacemap_vtk.draw import morph_surface
from spacemap_vtk.draw.frame import apply_mode_shape
from spacemap_vtk.draw.morph_surface import make_mode_surface, make_moving_surface
from spacemap_vtk.errors import SizeError
from spacemap_vtk.io.registry import writer
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.cross_section import cut_cloth

ROOT = Path(__file__).parent.parent
#: Where .ci/run installs gltf-validator and three.
MODULES = ROOT / ".venv-node" / "node_modules"
SMALL = ("weave.ends=3", "weave.picks=4", "surface.subdivisions=2", "modal.youngs_modulus=500")


def change_scene(name: str, *assignments: str) -> Scene:
    scene = Scene.read(name)
    for assignment in assignments:
        scene.set(assignment)
    return scene


def play_motion(file: Path, seconds: Sequence[float] = (), clip: int = 0) -> dict[str, Any]:
    if not MODULES.is_dir() or shutil.which("node") is None:
        pytest.skip("needs node, and gltf-validator and three in .venv-node")
    script = ROOT / "tests" / "play_gltf.mjs"
    words = ["node", script, MODULES, file, str(clip), *map(str, seconds)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=300)
    found: dict[str, Any] = json.loads(done.stdout)
    assert found["issues"]["messages"] == []  # no hint, even
    return found


def largest_distance(found: Any, surface: vtkPolyData) -> float:
    """How far vertices and the points of a surface are from each other, both ways."""
    there, here = np.array(found), points_of(surface)
    ways = cKDTree(here).query(there)[0], cKDTree(there).query(here)[0]
    return max(float(distances.max()) for distances in ways)


@pytest.mark.parametrize(
    ("more", "short"),
    [
        ((), False),
        (("warp.smooth=true", "view.camera=lying"), False),
        (("yarns.inextensible=true",), False),
        (("view.camera=lying",), True),
    ],
)
def test_the_motion_is_within_the_tolerance_at_every_frame(
    more: tuple[str, ...], short: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if short:  # as of a surface with many points
        monkeypatch.setattr(morph_surface, "_MANY_POINTS", 2)
    scene, file = change_scene("plain_weave", *SMALL, *more), tmp_path / "a.glb"
    times, tolerance = np.linspace(0.0, 0.06, 13).tolist(), 2e-7
    made = make_moving_surface(scene, times, tolerance, lambda done, of: None, sides=2)
    assert 2 <= len(made.targets) < 12
    assert (made.quantised is not None) == short
    assert made.metadata["largest_error"] <= tolerance
    writer(file).write(file, made)
    step, places = 1.0 / scene.animation.speed, (0, 3, 8, 12)
    playback = play_motion(file, [times[k] * step for k in places])
    for number, found in zip(places, playback["played"], strict=True):
        scene.update(times[number])
        there = np.array(found)
        if "view.camera=lying" in more:  # y is up in a glTF
            there = there[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
        assert largest_distance(there, scene.polygons) <= 1.01 * tolerance
    assert np.ptp(np.array(playback["played"]), axis=0).max() > 1000 * tolerance
    if short:  # half of what it takes otherwise
        writer(file).write(tmp_path / "long.glb", replace(made, quantised=None))
        sizes = [each.stat().st_size for each in (file, tmp_path / "long.glb")]
        saved = 12 * len(made.points) * len(made.targets)
        assert sizes[1] - sizes[0] == pytest.approx(saved, rel=0.05)
    assert playback["materials"] == [["warp #2d6a8e", "2d6a8e"], ["weft #e8c78f", "e8c78f"]]


def test_targets_of_a_large_surface_are_limited_with_a_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(level_of_detail, "FILE_POINTS", 1000)
    monkeypatch.setattr(morph_surface, "_MANY_POINTS", 200)
    monkeypatch.setattr(morph_surface, "_LARGE_FILE", 1)
    monkeypatch.setattr(morph_surface, "_YARN_TOLERANCE", 4e-6)
    scene, warnings = change_scene("plain_weave", *SMALL), list[str]()
    made = make_moving_surface(
        scene, np.linspace(0.0, 0.06, 13).tolist(), None, lambda *_: None, warn=warnings.append
    )
    assert "subdivided by 1, not by 2" in warnings[0]
    assert re.fullmatch(
        r"8 of 1\d targets are written, because the file would be too large; .*", warnings[1]
    )
    assert re.match(
        r"8 targets of \d+ points need up to 0 MB; for a smaller file use fewer --sub", warnings[2]
    )
    assert len(made.targets) == 8
    # The reported error is an upper bound of the actual one.
    assert 0.0 < made.metadata["largest_error"] <= made.tolerance < 1e-6
    scene = change_scene("plain_weave", *SMALL)
    fine = make_moving_surface(scene, [0.0, 0.01], 1e-6, lambda *_: None, sides=3)
    assert len(fine.triangles) > 8 * len(made.triangles)  # of 9, without caps


def test_yarns_as_curves_have_the_area_of_their_sections() -> None:
    warp, weft = {"section": "racetrack", "aspect": 1.8}, {"section": "elliptic", "aspect": 1.4}
    flat = {f"warp_{key}": value for key, value in warp.items()}
    flat |= {f"weft_{key}": value for key, value in weft.items()}
    scene = Scene({"weave": {"ends": 3, "picks": 4, "warp_spacing": "0.7 mm", **flat}})
    curves = make_moving_surface(scene, [0.0], None, lambda *_: None).curves
    assert curves is not None
    areas = []
    for family in (1, 0):  # a cut along a pick goes across the ends
        x, z = np.moveaxis(cut_cloth(scene.woven.cloth, family).sections, 2, 0)
        areas += list(0.5 * np.abs((x * np.roll(z, -1, 1) - np.roll(x, -1, 1) * z).sum(axis=1)))
    np.testing.assert_allclose(np.pi / 4 * curves.widths**2, areas, rtol=2e-3)


def test_each_mode_moves_by_its_own_shape(tmp_path: Path) -> None:
    scene, file = change_scene("plain_weave", *SMALL, "modal.modes=3"), tmp_path / "a.glb"
    writer(file).write(file, make_mode_surface(scene, lambda done, of: None))
    playback = play_motion(file, [0.0, 0.3], clip=2)  # a swing takes 1.2 s
    solver = scene.stage("solver")
    assert solver is not None
    cage = shallow_copy(solver.output)
    frequencies = array_of(cage.GetFieldData(), "frequencies", "")
    assert playback["names"] == [f"mode {k} {f:.4g} Hz" for k, f in enumerate(frequencies, 1)]
    for found, share in zip(playback["played"], (0.0, 0.1), strict=True):
        apply_mode_shape(scene, cage, 2, share * float(np.ptp(points_of(cage), axis=0).max()))
        assert largest_distance(found, scene.surface(scene.warp(scene.source.output, cage))) < 1e-9


def test_a_still_scene_has_no_animation(tmp_path: Path) -> None:
    weave = {"ends": 3, "picks": 3}
    scene = Scene({"weave": weave, "cage": {"divisions": [2, 2, 1]}, "modal": {}, "response": {}})
    made = make_moving_surface(scene, [0.0, 0.02], None, lambda *_: None)
    assert (len(made.targets), len(made.clips)) == (0, 1)
    file = tmp_path / "a.glb"
    writer(file).write(file, made)
    data = file.read_bytes()
    content = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert "animations" not in content


def test_sizes_are_reported_and_invalid_options_refused(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "a.glb"
    words = ["export", "plain_weave"] + [word for each in SMALL for word in ("--set", each)]
    with pytest.raises(SystemExit, match="0"):
        main(
            [
                *words,
                "-o",
                str(file),
                "--fps",
                "25",
                "--from",
                "0.01",
                "--to",
                "0.04",
                "--tolerance",
                "1um",
            ]
        )
    match = re.fullmatch(
        r".*a\.glb: \d targets, 7 frames, largest error [\d.]+ nm, [\d.]+ MB\n",
        capsys.readouterr().out,
    )
    assert match is not None
    for more, message in (
        (["--tolerance", "1e-20"], "the tolerance is too small"),
        (["--tolerance", "0mm"], "must be a length"),
        (["--modes", "--tolerance", "1mm"], "modes are written without a tolerance"),
        (["--times", "0.1,0.05"], "times must increase"),
        (["--times", "0,0.05", "--fps", "3"], "--times: cannot be combined with --fps"),
        (["--to", "1", "--what", "surface"], "--to: a .vtp file stores one time"),
    ):
        output = file.with_suffix(".vtp") if "surface" in more else file
        with pytest.raises(SystemExit, match="2"):
            main([*words, "-o", str(output), *more])
        assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]


def test_a_large_still_cloth_has_fewer_subdivisions(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene({"weave": {"ends": 6, "picks": 6}})
    usual = len(make_moving_surface(scene, [0.0], None, lambda *_: None).points)
    monkeypatch.setattr(level_of_detail, "FILE_POINTS", usual / 3)
    warnings: list[str] = []
    few = make_moving_surface(scene, [0.0], None, lambda *_: None, warn=warnings.append)
    assert len(few.points) < usual / 2
    assert "patches are subdivided by 2, not by 4" in warnings[0]
    # as many as are asked for, and of a .ply as the scene says
    for sides in (4, None):
        scene = Scene({"weave": {"ends": 6, "picks": 6}})
        assert (
            len(make_moving_surface(scene, [0.0], None, lambda *_: None, sides=sides).points)
            == usual
        )


@pytest.mark.parametrize("limit", ["memory", "file"])
def test_a_too_large_cloth_is_refused_early(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, most = Scene({"weave": {"ends": 120, "picks": 120}}), 2**32
    if limit == "memory":
        monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 500_000_000)
    else:
        most = 2**27
    with pytest.raises(SizeError, match=r"million points.*memory|too much for one file"):
        make_moving_surface(scene, [0.0], None, lambda *_: None, max_bytes=most, sides=4)
    assert scene.source.executions == 0
