"""Sweeps: files of each run, a table, a contact sheet, by whatever carries them out."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.figure.contact_sheet import contact_sheet
from spacemap_vtk.errors import InputError
from spacemap_vtk.jobs.sweep import RunResult, execute_run, execute_sweep, table_rows
from spacemap_vtk.scenes.sweep import Run, Sweep, read_sweep

SCENE = """
[weave]
ends = 2
picks = 2
[cage]
divisions = [1, 1, 1]
[modal]
elements = "tetrahedra"
modes = 3
[response]
[surface]
subdivisions = 1
[view]
size = [64, 48]
"""
#: Yarns of 0.25 mm: at 0.2 mm the warp has no room;
SPACINGS = "weave.warp_spacing=0.5 mm,0.2 mm,0.6 mm"
DIAMETERS = "weave.warp_diameter=0.25mm", "weave.weft_diameter=0.25mm"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process do what others would: each takes a second to start."""

    def here(_function: str, tasks: Sequence[Run], _count: int) -> Iterator[tuple[int, RunResult]]:
        yield from ((number, execute_run(task)) for number, task in enumerate(tasks))

    monkeypatch.setattr("spacemap_vtk.jobs.sweep.run_in_processes", here)


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["sweep", *words])
    return int(end.value.code or 0)


def untimed(sweep: Sweep, found: Mapping[str, RunResult]) -> list[list[str]]:
    headings, rows = table_rows(sweep, found)
    at = headings.index("seconds [s]")
    return [headings, *([*row[:at], *row[at + 1 :]] for row in rows)]


@pytest.mark.usefixtures("no_processes")
def test_sweep_on_the_command_line(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "new" / "cloth"
    words = [str(scene), "-o", str(folder), "--set", SPACINGS, "--workers", "1", "--time", "0,1ms"]
    for each in DIAMETERS:
        words += ["--set", each]
    assert run(*words) == 1
    out, err = capsys.readouterr()
    assert "1 of 3 runs failed" in err
    assert "failed" in out
    names = [f"warp_spacing={spacing}mm" for spacing in ("0.5", "0.2", "0.6")]
    pictures = [f"{names[k]}_t={time}.png" for k in (0, 2) for time in ("0s", "1ms")]
    texts = [f"{name}{ending}" for name in names for ending in (".json", ".toml")]
    there = ["contact_sheet.png", "sweep.json", "table.csv", *pictures, *texts]
    assert sorted(file.name for file in folder.iterdir()) == sorted(there)
    with (folder / "table.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["weave.warp_spacing [mm]"] for row in rows] == ["0.5", "0.2", "0.6"]
    assert rows[0]["message"] == rows[2]["message"] == ""
    assert "warp_spacing" in rows[1]["message"]
    # Peirce's equations of equal yarns: p = (l - Dθ) cos θ + D sin θ, h = D / 2, D = 0.5 mm.
    first = {key: float(value) for key, value in rows[0].items() if key not in ("run", "message")}
    theta, length = math.radians(first["warp theta [deg]"]), first["warp length [mm]"]
    straight = length - 0.5 * theta
    assert straight * math.cos(theta) + 0.5 * math.sin(theta) == pytest.approx(0.5, rel=1e-5)
    assert straight * math.sin(theta) + 0.5 * (1 - math.cos(theta)) == pytest.approx(0.25, rel=1e-5)
    assert first["warp crimp [%]"] == pytest.approx(100 * (length / 0.5 - 1), rel=1e-4)
    # What is there is kept, and one that failed is tried again.
    seen = {name: (folder / name).stat().st_mtime_ns for name in there}
    assert run(*words, "-q") == 1
    changed = {name for name in there if (folder / name).stat().st_mtime_ns != seen[name]}
    own = {"contact_sheet.png", "sweep.json", "table.csv"}
    assert changed == own | {f"{names[1]}.json", f"{names[1]}.toml"}
    # Of someone else's nothing is overwritten.
    other = tmp_path / "other"
    other.mkdir()
    (other / "table.csv").write_text("mine")
    assert run(str(scene), "-o", str(other), "--set", SPACINGS) == 2
    assert "does not belong to this sweep" in capsys.readouterr().err
    assert [file.read_text() for file in other.iterdir()] == ["mine"]


def test_table_is_the_same_in_one_or_several_processes(scene: Path, tmp_path: Path) -> None:
    cluster = pytest.importorskip("distributed", reason="comes with the extra [cluster]")
    sweep = read_sweep(scene, [SPACINGS.replace("0.2 mm,", "")])
    two = execute_sweep(sweep, tmp_path / "two", workers=2)
    one = {each.name: execute_run(each) for each in sweep.runs}
    with cluster.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as local:
        dask = execute_sweep(sweep, tmp_path / "dask", cluster=local.scheduler_address)
    assert not any(each.error for each in one.values())
    assert untimed(sweep, one) == untimed(sweep, two) == untimed(sweep, dask)
    for name, each in one.items():
        for folder in ("two", "dask"):
            assert (tmp_path / folder / f"{name}.png").read_bytes() == each.pictures[0]
    # A run's own scene draws its picture, by itself; but it says of another file that it is its.
    own = tmp_path / "two" / f"{sweep.runs[0].name}.toml"
    made = execute_run(read_sweep(own, []).runs[0]).pictures + one[own.stem].pictures
    first, second = (np.asarray(Image.open(io.BytesIO(picture))) for picture in made)
    np.testing.assert_array_equal(first, second)


@pytest.mark.usefixtures("no_processes")
def test_results_of_a_stopped_sweep_are_kept_and_reused(scene: Path, tmp_path: Path) -> None:
    sweep, folder = read_sweep(scene, [SPACINGS]), tmp_path / "cloth"

    def stop(done: int, of: int) -> None:
        assert of == 3
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        execute_sweep(sweep, folder, stop, workers=1)
    with (folder / "table.csv").open(encoding="utf-8", newline="") as stream:
        assert [row["message"] for row in csv.DictReader(stream)] == ["", "not run", "not run"]
    before = json.loads((folder / "warp_spacing=0.5mm.json").read_text())
    reported: list[int] = []
    found = execute_sweep(sweep, folder, lambda done, of: reported.append(done), workers=1)
    assert reported == [1, 2, 3]
    assert found["warp_spacing=0.5mm"].seconds == before["seconds"]
    with Image.open(folder / "contact_sheet.png") as sheet:
        assert sheet.width > 3 * 64


def test_contact_sheet_has_each_picture_in_its_row_and_column(tmp_path: Path) -> None:
    sweep = read_sweep("plain_weave", ["weave.ends=2,3", "weave.picks=4,5,6"])
    files, colors = {}, {}
    for number, each in enumerate(sweep.runs[:-1]):
        colors[each.name] = (250, 40 * number, 0)
        files[each.name] = [tmp_path / f"{number}.png"]
        Image.new("RGB", (300, 200), colors[each.name]).save(files[each.name][0])
    sheet = contact_sheet(sweep, "A title", files, {})
    places = {}
    for name, color in colors.items():
        rows, columns = np.nonzero((sheet == color).all(axis=2))
        assert len(rows) > 0.9 * 300 * 200
        places[name] = round(rows.mean()), round(columns.mean())
    assert len({row for row, _ in places.values()}) == 2
    assert len({column for _, column in places.values()}) == 3
    # Rows are of ends, columns of picks; the last cell is empty, and says so.
    assert places["ends=2_picks=4"][1] == places["ends=3_picks=4"][1]
    assert places["ends=2_picks=5"][0] == places["ends=2_picks=6"][0] < places["ends=3_picks=5"][0]
    empty = sheet[places["ends=3_picks=5"][0], places["ends=2_picks=6"][1] - 140]
    assert empty.tolist() == [244, 245, 247]


def test_more_processes_than_memory_are_refused(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 2**30)
    monkeypatch.setattr("spacemap_vtk.workers.available_bytes", lambda: 2**30)
    sweep = read_sweep(scene, ["weave.warp_spacing=linspace(0.5 mm, 0.6 mm, 9)"])
    with pytest.raises(InputError, match=r"9 processes would need .* Use 2 or fewer"):
        execute_sweep(sweep, tmp_path / "cloth", workers=9)
    assert not (tmp_path / "cloth").exists()
