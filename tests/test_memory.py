"""How much memory is left, a container's limit among it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import SizeError
from spacemap_vtk.memory import available_bytes, available_in_cgroups, require_memory
from spacemap_vtk.scenes import presets
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.stage_memory import estimate_stages

GIB = 2**30


def tree(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def group(folder: str, most: str, used: int, of_files: int = 0) -> dict[str, str]:
    """The files of a group of version 2, as the kernel writes them."""
    return {
        f"{folder}/memory.max": f"{most}\n",
        f"{folder}/memory.current": f"{used}\n",
        f"{folder}/memory.stat": f"anon 5\ninactive_file {of_files - 7}\nactive_file 7\nfile 999\n",
    }


def test_tightest_control_group_limits_a_process(tmp_path: Path) -> None:
    processes = tmp_path / "cgroup"
    processes.write_text("0::/a/b\n")
    # What the kernel can take back from files is no use of memory.
    tree(tmp_path, group("a/b", "max", 10))
    tree(tmp_path, group("a", str(4 * GIB), 3 * GIB, of_files=GIB))
    assert available_in_cgroups(processes, tmp_path) == 2 * GIB
    tree(tmp_path, group("a/b", str(GIB), 2 * GIB))
    assert available_in_cgroups(processes, tmp_path) == 0
    assert available_in_cgroups(tmp_path / "no such file", tmp_path) is None


def test_container_that_sees_its_control_group_as_root(tmp_path: Path) -> None:
    processes = tmp_path / "cgroup"
    processes.write_text("0::/system/container/abc\n")
    assert available_in_cgroups(processes, tmp_path) is None
    tree(tmp_path, group(".", str(4 * GIB), GIB))
    assert available_in_cgroups(processes, tmp_path) == 3 * GIB


def test_control_groups_of_version_1(tmp_path: Path) -> None:
    processes = tmp_path / "cgroup"
    processes.write_text("9:cpu:/other\n4:memory:/job\n0::/\n")
    tree(
        tmp_path / "memory" / "job",
        {
            "memory.limit_in_bytes": f"{3 * GIB}\n",
            "memory.usage_in_bytes": f"{2 * GIB}\n",
            "memory.stat": f"total_rss 5\ntotal_inactive_file {GIB}\ntotal_active_file 0\n",
        },
    )
    assert available_in_cgroups(processes, tmp_path) == 2 * GIB


def test_free_memory_equals_that_of_psutil() -> None:
    machine = psutil.virtual_memory()
    found = available_bytes()
    assert found is not None
    # others take and give back meanwhile; in a container it may be less
    assert 0 < found < machine.available + machine.total // 4
    if available_in_cgroups() is None or available_in_cgroups() > machine.total:
        assert found > machine.available - machine.total // 4


def test_cure_can_depend_on_the_free_memory() -> None:
    free = available_bytes()
    assert free is not None
    require_memory(free // 2, "half of it")
    with pytest.raises(SizeError, match=r"all of it would need .* GiB .* now free\. Take [1-9]"):
        require_memory(4 * free, "all of it", cure=lambda left: f"Take {left}")


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        ((), ""),
        (("Unable to\nallocate 7 GiB",), ": Unable to allocate 7 GiB"),
    ],
)
def test_memory_error_is_reported_in_one_line(
    words: tuple[str, ...],
    stated: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def check(_: Scene) -> None:
        raise MemoryError(*words)

    monkeypatch.setattr(Scene, "check", check)
    with pytest.raises(SystemExit) as done:
        main(["validate", "plain_weave"])
    assert done.value.code == 1
    assert capsys.readouterr().err == f"spacemap: out of memory{stated}\n"


@pytest.fixture
def tight_group() -> Iterator[Path]:
    """A real group of 400 MB, for a process to go into."""
    file = Path("/proc/self/cgroup")
    lines = file.read_text().splitlines() if file.exists() else []
    for line in lines:
        _, controllers, name = line.split(":", 2)
        limit = {"": "memory.max", "memory": "memory.limit_in_bytes"}.get(controllers)
        above = Path("/sys/fs/cgroup") / controllers / name.lstrip("/")
        # Elsewhere a new folder is just a folder.
        if limit is None or not (above / "cgroup.procs").exists():
            continue
        group = above / f"spacemap-{os.getpid()}"
        try:
            group.mkdir()
        except OSError:
            continue
        try:
            if (group / limit).exists():
                (group / limit).write_text("400000000")
                yield group
                return
        finally:
            group.rmdir()
    pytest.skip("no control group can be made here")


@pytest.mark.nightly
def test_picture_too_large_for_its_container_is_refused(tight_group: Path, tmp_path: Path) -> None:
    if psutil.virtual_memory().available < GIB:
        pytest.skip("the machine itself has less")
    picture = tmp_path / "cloth.png"
    command = f"{sys.executable} -c 'from spacemap_vtk.cli.main import main; main()'"
    done = subprocess.run(
        [
            "sh",
            "-c",
            f"echo $$ > {tight_group}/cgroup.procs; exec {command} render plain_weave -q "
            f"-o {picture} --size 64x48 --set weave.ends=60 --set weave.picks=60",
        ],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 2, done.stderr
    assert re.search("a picture of 60 x 60 yarns.* would need about", done.stderr)
    assert "up to the 0." in done.stderr  # GiB now free
    assert not picture.exists()


CHILD = """
import gc, json, sys
from spacemap_vtk.scenes import presets
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.stage_memory import estimate_stages

def status(name):
    rows = open("/proc/self/status").read().splitlines()
    return next(1024 * int(row.split()[1]) for row in rows if row.startswith(name))

role, module, values = json.loads(sys.argv[1])
time, stated = 0.1, []

def ready(values):
    # A scene that has run up to the stage.
    scene = Scene(values)
    before = scene.stages[: scene.stages.index(scene.stage(role))]
    for stage in before:
        scene.update_stage(stage, time)
    return scene, scene.stage(role)

# What is loaded and compiled is there before.
few = {key: dict(part) for key, part in values.items()}
few["weave"].update(ends=80, picks=80)
if "divisions" in few.get("cage", {}):
    few["cage"]["divisions"] = [12, 12, 1]
scene, stage = ready(few)
scene.update_stage(stage, time)
scene, stage = ready(values)
found = sys.modules[f"spacemap_vtk.filters.{module}"]
found.require_memory = lambda size, *_, **__: stated.append(size)
gc.collect()
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
scene.update_stage(stage, time)
print(json.dumps([max(stated), status("VmHWM") - before]))
"""
CLOTH = {"weave": {"ends": 150, "picks": 150}}
MOVED = CLOTH | {"cage": {}, "modal": {"elements": "tetrahedra", "modes": 3}, "response": {}}


def modes(divisions: list[int], elements: str, order: int = 1, **modal: Any) -> dict[str, Any]:
    return {
        "weave": {"ends": 20, "picks": 20},
        "cage": {"divisions": divisions, "order": order},
        "modal": {"elements": elements, "youngs_modulus": 1e6, **modal},
        "response": {},
    }


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="measures as Linux does")
@pytest.mark.parametrize(
    ("role", "module", "values"),
    [
        ("source", "weave_source", CLOTH),
        ("source", "weave_source", {"weave": CLOTH["weave"] | {"axis": "spline"}}),
        ("cage", "tetra_cage", MOVED | {"cage": {"divisions": [30, 30, 30], "order": 2}}),
        ("solver", "modal_solver", modes([40, 40, 4], "tetrahedra")),
        ("solver", "modal_solver", modes([10, 10, 4], "tetrahedra", 2, modes=60)),
        ("solver", "modal_solver", modes([60, 60, 1], "sheet")),
        ("solver", "modal_solver", modes([40, 40, 2], "tetrahedra", modes=300)),
        ("solver", "modal_solver", modes([40, 40, 1], "sheet", gravity=[0, 0, -0.1])),
        ("solver", "modal_solver", modes([8, 8, 3], "tetrahedra", 2, gravity=[0, 0, -0.1])),
        ("warp", "barycentric_warp", MOVED),
        ("warp", "barycentric_warp", MOVED | {"warp": {"smooth": True}}),
        ("crimp", "crimp_interchange", MOVED | {"yarns": {}}),
        ("surface", "patch_tessellator", CLOTH | {"surface": {"subdivisions": 4}}),
    ],
    ids=str,
)
def test_estimate_for_a_stage_is_within_a_factor_of_two(
    role: str, module: str, values: dict[str, Any]
) -> None:
    # Without memory that the C library keeps for later, which would be counted as taken before.
    kept = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    done = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps([role, module, values])],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
        env={
            **os.environ,
            **kept,
            **{"SPACEMAP_CACHE": "off", "SPACEMAP_COMPILED": "always", "MALLOC_ARENA_MAX": "1"},
        },
    )
    estimate, peak = json.loads(done.stdout)
    print(f"{role} {values}: estimated {estimate / 1e6:.0f} MB, taken {peak / 1e6:.0f} MB")
    assert peak / 2 < estimate < 2 * peak


def test_a_scene_that_does_not_fit_is_refused_before_any_stage_works(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = presets.apply("plain_weave", "drape", size=(0.2, 0.2))
    needed = estimate_stages(scene.stages)
    assert needed is not None
    # 400 x 400 crossings at 80 kB each, as the nightly test measures smaller cloths.
    assert needed(4) == pytest.approx(400**2 * 80e3, rel=0.2)
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 4 * GIB)
    with pytest.raises(SizeError, match=r"a scene with 400 x 400 yarns .* 13.1 GiB") as caught:
        scene.update(0.0)
    assert all(stage.executions == 0 for stage in scene.stages)
    message = str(caught.value)
    assert "weave.ends = 400: " in message
    found = re.search(r"use fewer ends and picks, about (\d+) x \1\.", message, re.IGNORECASE)
    assert found is not None
    # What the message proposes fits.
    scene.source.ends = scene.source.picks = int(found[1])
    assert estimate_stages(scene.stages)(4) <= 4 * GIB


WHOLE = """
import gc, json, sys
from spacemap_vtk.scenes.presets import apply
from spacemap_vtk.scenes import presets
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.stage_memory import estimate_stages
from spacemap_vtk.scenes.stage_memory import estimate_stages

def status(name):
    rows = open("/proc/self/status").read().splitlines()
    return next(1024 * int(row.split()[1]) for row in rows if row.startswith(name))

def ready(size):
    scene = apply(name, preset, size=size) if preset else Scene.read(name)
    for text in sets:
        scene.set(text)
    return scene

name, preset, size, sets = json.loads(sys.argv[1])
ready(0.015).update(0.0)  # what is loaded and compiled is there before
scene = ready(size)
gc.collect()
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
scene.update(0.0)
needed = estimate_stages(scene.stages)(scene.surface.sides)
print(json.dumps([needed, status("VmHWM") - before]))
"""


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="measures as Linux does")
@pytest.mark.parametrize(
    ("name", "preset", "size", "sets"),
    [
        ("plain_weave", "drape", 0.05, []),
        ("plain_weave", "swing", 0.05, []),
        ("plain_weave", "hang", 0.05, ["weave.precision=single", "surface.subdivisions=2"]),
        ("plain_weave", "", 0.0, ["weave.ends=100", "weave.picks=100"]),
        ("plain_weave", "", 0.0, ["weave.ends=80", "weave.picks=80", "warp.smooth=true"]),
        ("twill_2_2", "", 0.0, ["weave.ends=120", "weave.picks=120"]),
        ("leno", "hang", 0.05, []),
        ("stockinette", "drape", 0.12, []),
    ],
    ids=str,
)
def test_estimate_for_a_scene_is_within_a_factor_of_one_and_a_half(
    name: str, preset: str, size: float, sets: list[str]
) -> None:
    kept = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    done = subprocess.run(
        [sys.executable, "-c", WHOLE, json.dumps([name, preset, size, sets])],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
        env={**os.environ, **kept, "SPACEMAP_COMPILED": "always", "MALLOC_ARENA_MAX": "1"},
    )
    estimate, peak = json.loads(done.stdout)
    print(f"{name} {preset} {sets}: estimated {estimate / 1e6:.0f} MB, taken {peak / 1e6:.0f} MB")
    assert peak / 1.5 < estimate < 1.5 * peak
