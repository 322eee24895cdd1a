"""What a picture takes of memory: the estimate against the peak of real runs."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import SizeError
from spacemap_vtk.filters import barycentric_warp
from spacemap_vtk.scenes import level_of_detail
from spacemap_vtk.scenes.level_of_detail import choose_level
from spacemap_vtk.scenes.memory_estimates import PictureRequest
from spacemap_vtk.scenes.scene import Scene

RUN = """
import json, resource, sys
from vtkmodules.vtkRenderingCore import vtkRenderWindow
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes.scene import Scene

scene, times = Scene(json.loads(sys.argv[1])), json.loads(sys.argv[2])
with open("/proc/self/statm") as stream:
    before = int(stream.read().split()[1]) * resource.getpagesize()
picture = Picture(scene, times, (640, 480))
for time in times:
    picture.draw(time)
# Not getrusage's, which begins with what whoever started this has taken.
with open("/proc/self/status") as stream:
    peak = next(1024 * int(line.split()[1]) for line in stream if line.startswith("VmHWM")) - before
print(json.dumps([picture.level.method.value, picture.level.bytes, peak]))
"""


CLEARANCE = {"color": "clearance"}
#: Cloth that stretches a little; by its weight it would turn too far for a linear motion.
MOVES = {"response": {"gravity": [0.0, -0.1, 0.0]}}


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="measures as Linux does")
@pytest.mark.parametrize(
    ("form", "yarns", "subdivisions", "times", "view"),
    [
        ("whole", 10, "auto", [0.1], {"show": "side by side"}),
        pytest.param("whole", 120, 2, [], {}, marks=pytest.mark.nightly),
        pytest.param("whole", 120, 2, [0.1, 0.2], {}, marks=pytest.mark.nightly),
        pytest.param("whole", 60, 4, [], CLEARANCE, marks=pytest.mark.nightly),
        pytest.param("whole", 60, "auto", [0.1], {"color": "velocity"}, marks=pytest.mark.nightly),
        pytest.param(
            "sheet", 800, "auto", [0.1], {"color": "clearance"}, marks=pytest.mark.nightly
        ),
        pytest.param("sheet", 2000, "auto", [0.1], {}, marks=pytest.mark.nightly),
        pytest.param("sheet", 400, "auto", [], {}, marks=pytest.mark.nightly),
    ],
)
def test_estimate_for_a_picture_is_within_a_factor_of_two(
    form: str, yarns: int, subdivisions: int | str, times: list[float], view: dict[str, str]
) -> None:
    values = {
        "view": view,
        "weave": {"ends": yarns, "picks": yarns},
        "surface": {"subdivisions": subdivisions},
        **(MOVES if times else {}),
    }
    prepare_offscreen()  # the estimate is of OpenGL's share, too
    done = subprocess.run(
        [sys.executable, "-c", RUN, json.dumps(values), json.dumps(times or [0.0])],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    drawn, estimate, peak = json.loads(done.stdout)
    print(f"{values}: estimated {estimate / 1e6:.0f} MB, taken {peak / 1e6:.0f} MB")
    assert drawn == form
    assert peak / 2 < estimate < 2 * peak


EXPORT = """
import gc, json, sys
from pathlib import Path
import spacemap_vtk.memory as memory

def status(name):
    rows = open("/proc/self/status").read().splitlines()
    return next(1024 * int(row.split()[1]) for row in rows if row.startswith(name))

sizes, refuse = [], memory.require_memory

def require_memory(size, *rest, **more):
    sizes.append(status("VmRSS") + size)  # together with what is in use at that time
    refuse(size, *rest, **more)

memory.require_memory = require_memory
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene

def export(yarns):
    what, values, options = json.loads(sys.argv[2])
    scene = Scene({"weave": {"ends": yarns, "picks": yarns}, **values})
    make_data_job(Path(sys.argv[1]), what, **options).run(scene)

export(24)  # what is loaded and compiled is there before
sizes.clear()
gc.collect()
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
export(int(sys.argv[3]))
print(json.dumps([max(sizes) - before, status("VmHWM") - before]))
"""
FINE, COARSE = {"surface": {"subdivisions": 3}}, {"surface": {"subdivisions": 1}}
FRAMES = [0.01 * number for number in range(12)]
FILM = {"times": FRAMES, "subdivisions": 3, "tolerance": 2e-6}


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="measures as Linux does")
@pytest.mark.parametrize(
    ("ending", "yarns", "what", "values", "options"),
    [
        (".vtp", 60, "", FINE, {}),
        *(
            pytest.param(*case, marks=pytest.mark.nightly)
            for case in [
                (".vtu", 100, "", COARSE | MOVES, {"times": [0.1]}),
                (".vtkhdf", 100, "", FINE | MOVES, {"times": [0.1, 0.2]}),
                (".stl", 100, "", FINE, {}),
                (".ply", 60, "painted", COARSE, {}),
                (".obj", 60, "", FINE, {}),
                (".csv", 150, "", {}, {}),
                (".glb", 60, "", MOVES, FILM),
                (".html", 60, "", MOVES, FILM),
                (".usdc", 60, "", MOVES, FILM),
                (".html", 40, "modes", MOVES | {"modal": {"modes": 12}}, {}),
            ]
        ),
    ],
)
def test_estimate_for_an_export_is_within_a_factor_of_two(
    ending: str, yarns: int, what: str, values: Any, options: Any, tmp_path: Path
) -> None:
    order = json.dumps([what, values, options])
    done = subprocess.run(
        [sys.executable, "-c", EXPORT, str(tmp_path / f"a{ending}"), order, str(yarns)],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
        # Without memory that the C library keeps for later.
        env={
            **os.environ,
            **{"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"},
            **{"MALLOC_ARENA_MAX": "1", "SPACEMAP_CACHE": "off"},
        },
    )
    estimate, peak = json.loads(done.stdout)
    words = f"{ending} {yarns} {what} {values} {options}"
    print(f"{words}: estimated {estimate / 1e6:.0f} MB, taken {peak / 1e6:.0f} MB")
    assert peak / 2 < estimate < 2 * peak


def test_too_large_picture_is_refused_before_allocation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Of yarns that are drawn one after another there would be too many facets.
    monkeypatch.setattr(level_of_detail, "MOST_QUADS", 0)
    weave, request = {"ends": 60, "picks": 60}, PictureRequest((640, 480))
    scene = Scene({"weave": weave, "surface": {"subdivisions": 4}, "response": {}})
    size = choose_level(scene, request).bytes
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: int(0.7 * size))
    with pytest.raises(SizeError) as caught:
        Picture(scene, [0.1], (640, 480))
    assert [stage.executions for stage in scene.stages] == [0] * 6
    message = str(caught.value)
    assert message.startswith("surface.subdivisions = 4: a picture of 60 x 60 yarns would need")
    found = re.search(r"Lower surface.subdivisions to (\d), or use .* (\d+) x \2\.$", message)
    assert found is not None
    # What the message says will do does.
    scene.surface.subdivisions = int(found[1])
    choose_level(scene, request)
    scene.surface.subdivisions = 4
    with pytest.raises(SizeError, match="a film of"):
        choose_level(scene, PictureRequest((640, 480), 100))
    scene.source.ends = scene.source.picks = int(found[2])
    choose_level(scene, request)


def test_too_large_sheet_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene({"weave": {"ends": 800, "picks": 800}})
    size = choose_level(scene, PictureRequest((640, 480))).bytes
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: size - 1)
    with pytest.raises(SizeError, match=r"view\.size: a picture of 800 x 800 yarns as a sheet wou"):
        Picture(scene, [0.0], (640, 480))
    assert scene.source.executions == 0


def test_a_sheet_of_10_000_yarns_needs_its_halved_textures() -> None:
    # 1.75 GB were measured for 10,000 x 10,000 yarns at 1280 x 1280.
    scene = Scene({"weave": {"ends": 10_000, "picks": 10_000}})
    size = choose_level(scene, PictureRequest((1280, 1280))).bytes
    assert 0.5 * 1.75e9 < size < 2 * 1.75e9


def test_draft_too_large_for_any_machine_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["weave.ends=200", "weave.picks=200", "surface.subdivisions=64"]
    sets = [word for text in words for word in ("--set", text)]
    with pytest.raises(SystemExit) as done:
        main(["render", "plain_weave", "-o", str(tmp_path / "a.png"), *sets])
    assert done.value.code == 2
    message = capsys.readouterr().err
    assert "surface.subdivisions = 64: a picture of 200 x 200 yarns would need" in message
    assert message.count("\n") == 1


def test_too_many_embedded_points_are_refused_before_allocation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = Scene({"weave": {"ends": 9, "picks": 9}, "response": {}})
    scene.update_stage(scene.response, 0.1)
    points = scene.source.GetOutputDataObject(0).GetNumberOfPoints()
    monkeypatch.setattr("spacemap_vtk.memory.NEVER_REFUSED", 0)
    size = barycentric_warp.estimate_bytes(points)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: size - 1)
    with pytest.raises(SizeError, match=f"to embed {points} points in the cage"):
        scene.update_stage(scene.warp, 0.1)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: size)
    scene.update_stage(scene.warp, 0.1)
