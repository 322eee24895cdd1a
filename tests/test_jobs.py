"""Jobs: refused early, run completely or not at all, and cancelled by their caller."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.cli.main import main
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import read_record, record_comments
from spacemap_vtk.io.registry import DATA
from spacemap_vtk.jobs import (
    JOBS,
    Context,
    DataJob,
    FigureJob,
    FilmJob,
    Job,
    ModesJob,
    MovingJob,
    PictureJob,
    StoryboardJob,
    Times,
    job_from_json,
    make_data_job,
    make_job,
    register,
    worker,
)
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 2, "picks": 2},
    "cage": {},
    "modal": {"modes": 3},
    "response": {},
    "surface": {"subdivisions": 1},
    "view": {"size": [64, 48]},
    "animation": {"stop": 0.2},
}


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("picture", "a.gif", ".png"),
        ("shapes", "a.vtu", ".jpg"),
        ("film", "a.jpg", "numbered frames"),
        ("film", "a.png", "%04d"),
        ("film", "a%sb.png", "%04d"),
        ("picture", "a%04d.png", "one file"),
        ("cage", "a.stl", "surface"),
        ("", "a.png", ".vtu"),
        ("film", "no/a.gif", "does not exist"),
        ("moving", "a.vtu", "cannot contain this kind of data"),
        ("a meal", "a.vtu", "allowed: .*picture"),
    ],
)
def test_a_job_with_an_impossible_output_is_refused_at_once(
    tmp_path: Path, kind: str, name: str, message: str
) -> None:
    file = tmp_path / name
    with pytest.raises(InputError, match=message):
        make_job(kind, file) if kind else make_data_job(file)


def test_invalid_values_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="samples"):
        PictureJob(tmp_path / "a.png", samples=65_537)
    with pytest.raises(InputError, match="workers"):
        FilmJob(tmp_path / "a.gif", workers=0)
    with pytest.raises(InputError, match='motions = "fly"'):
        StoryboardJob(tmp_path / "a.png", motions=["fly"])
    with pytest.raises(InputError, match="tolerance = 0"):
        MovingJob(tmp_path / "a.glb", tolerance=0.0)
    with pytest.raises(InputError, match="subdivisions = 0"):
        ModesJob(tmp_path / "a.glb", subdivisions=0)
    with pytest.raises(TypeError, match="subdivisions"):
        make_job("picture", tmp_path / "a.png", subdivisions=2)


def test_every_kind_of_data_has_a_class() -> None:
    assert JOBS.keys() >= DATA.keys()


def test_the_default_kind_of_data_follows_from_the_ending(tmp_path: Path) -> None:
    assert make_data_job(tmp_path / "a.vtu").kind == "patches"
    assert make_data_job(tmp_path / "a.WIF").kind == "draft"
    assert make_data_job(tmp_path / "a.vtu", "cage").kind == "cage"


@pytest.mark.parametrize(
    ("kind", "name", "steps"),
    [
        ("picture", "a.png", 100),
        ("film", "a.gif", 5),
        pytest.param("film", "a%d.png", 5, marks=pytest.mark.nightly),
        ("surface", "a.stl", 2),
    ],
)
def test_a_job_reports_progress_and_can_be_cancelled(
    tmp_path: Path, kind: str, name: str, steps: int
) -> None:
    job = make_job(kind, tmp_path / name)
    reported: list[tuple[int, int]] = []

    def end(done: int, _of: int) -> None:
        if done:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        job.run(Scene(VALUES), end)
    assert list(tmp_path.iterdir()) == []
    job.run(Scene(VALUES), lambda done, of: reported.append((done, of)))
    every = [(done, steps) for done in range(steps + 1)]
    assert reported == (every if kind != "picture" else [every[0], every[-1]])  # a share in %
    assert len(list(tmp_path.iterdir())) == (steps if job.is_numbered else 1)


def test_a_gif_has_half_the_size_by_default(tmp_path: Path) -> None:
    for size, drawn in ((None, (32, 24)), ((40, 30), (40, 30))):
        job = FilmJob(tmp_path / "a.gif", size=size)
        job.run(Scene(VALUES))
        with Image.open(job.output) as film:
            assert film.size == drawn


def test_the_record_states_the_times_of_the_output(tmp_path: Path) -> None:
    scene = Scene(VALUES)
    frames = pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16])
    for job in (FilmJob(tmp_path / "a.gif"), MovingJob(tmp_path / "a.glb")):
        times = job.decide_times(scene)
        assert times.values == frames
        assert times.span == (0.0, 0.2)
    assert DataJob(tmp_path / "a.stl", "surface").decide_times(scene) == ([0.0], (0.0,))
    chosen = DataJob(tmp_path / "a.pvd", "surface", [0.0, 0.1, 0.3]).decide_times(scene)
    assert chosen == ([0.0, 0.1, 0.3], (0.0, 0.3))
    still = Scene({"weave": {"ends": 2, "picks": 2}})
    with pytest.raises(InputError, match="nothing in this scene moves"):
        FilmJob(tmp_path / "a.gif").run(still)
    with pytest.raises(InputError, match="a storyboard needs a scene that moves"):
        StoryboardJob(tmp_path / "a.png").run(still)


@pytest.mark.parametrize(
    ("name", "record"),
    [
        ("a.png", {"what": "picture", "times": [0.1], "size": [64, 48], "samples": 9}),
        ("a.gif", {"what": "film", "panels": ["cage"], "wireframe": True}),
        ("a.png", {"what": "storyboard", "times": [0.0, 0.1], "motions": ["response"]}),
        ("a.pvtp", {"what": "surface", "times": [0.1], "pieces": 4}),
        ("a.usdc", {"what": "moving", "tolerance": 1e-5, "subdivisions": 2, "curves": "7"}),
        ("a.glb", {"what": "modes", "subdivisions": 2}),
        ("a.pdf", {"what": "plot", "point": [0.0, 0.1, 0.2], "quantity": "velocity"}),
        ("a.csv", {"what": "biaxial"}),
        ("a.csv", {"what": "reactions", "over": "stroke"}),
        (
            "a.pdf",
            {"what": "figure", "panels": ["draft"], "page": {"end": 0, "width": 88.0, "dpi": 96}},
        ),
        ("a.pdf", {"what": "print", "settings": {"floats": "10mm", "mono": True}}),
        ("a.svg", {"what": "print", "settings": {"pages": "3"}}),
    ],
)
def test_a_job_survives_conversion_to_json_and_back(
    tmp_path: Path, name: str, record: dict[str, Any]
) -> None:
    if name == "a.usdc":
        pytest.importorskip("pxr")
    job = job_from_json(record, tmp_path / name)
    assert json.loads(json.dumps(job.as_json())) == record
    assert job_from_json(job.as_json(), tmp_path / name) == job


def test_records_of_earlier_versions_are_read(tmp_path: Path) -> None:
    """The window recorded size and time of whatever it wrote; a place had no angle."""
    size = {"size": [1280, 960]}
    data = job_from_json({"what": "surface", "times": [0.1], **size}, tmp_path / "a.stl")
    assert data == DataJob(tmp_path / "a.stl", "surface", [0.1])
    film = job_from_json({"what": "film", "times": [0.1], **size}, tmp_path / "a.gif")
    assert film == FilmJob(tmp_path / "a.gif", (1280, 960))
    modes = job_from_json({"what": "modes", "times": [0.1], **size}, tmp_path / "a.glb")
    assert modes == ModesJob(tmp_path / "a.glb")
    biaxial = {"what": "biaxial", "quantity": "velocity"}
    assert job_from_json(biaxial, tmp_path / "a.csv").kind == "biaxial"
    place = [[0, 0, 1], [0, 0, 0], [0, 1, 0], 0.0]
    seen = job_from_json({"what": "picture", "place": place}, tmp_path / "a.png")
    assert isinstance(seen, PictureJob)
    assert seen.place is not None
    assert seen.place.position == (0.0, 0.0, 1.0)
    assert isinstance(job_from_json({"what": "figure"}, tmp_path / "a.pdf"), FigureJob)


def test_a_worker_process_runs_a_job_and_returns_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    job = PictureJob(tmp_path / "a.png", 0.0, (32, 24))
    monkeypatch.setattr("sys.stdin", io.StringIO(worker.make_request(job, VALUES, tmp_path)))
    worker.main()
    messages = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert messages == [{"done": 0, "of": 100}, {"done": 100, "of": 100}, {"result": ""}]
    with Image.open(job.output) as picture:
        assert picture.size == (32, 24)
    values = {"weave": {"ends": -1}}
    monkeypatch.setattr("sys.stdin", io.StringIO(worker.make_request(job, values, tmp_path)))
    with pytest.raises(SystemExit):
        worker.main()
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    error = worker.error_from_json(last["error"])
    assert (error.section, error.key, error.value) == ("weave", "ends", -1)


@pytest.fixture
def poem() -> Iterator[None]:
    """Register a kind of job that is none of the program's."""

    @register()
    @dataclass
    class PoemJob(Job):
        """The counts of a cloth in verse, into an .obj file as comments."""

        output: Path
        lines: int = 1

        kind = "poem"

        def decide_times(self, scene: Scene) -> Times:
            return Times([0.0, 1.0], (0.0, 1.0))

        def write(self, context: Context) -> str:
            verse = f"# {context.scene.source.ends} ends, times {context.times}\n" * self.lines
            with self.open_output(context.atomic) as file:
                write_parts(file, [(verse + "\n".join(record_comments("#")) + "\n").encode()])
            context.report_loss("a poem has no picks")
            return f"{self.lines} lines"

    yield
    del JOBS["poem"]


@pytest.mark.usefixtures("poem")
def test_a_new_kind_of_job_needs_one_class(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It runs, is recorded, made again by the command line, and run in another process."""
    job, losses = make_job("poem", tmp_path / "a.obj", lines=2), []
    scene = Scene(VALUES, tmp_path / "scene.toml")
    assert job.run(scene, report_loss=losses.append) == "2 lines"
    assert losses == ["a poem has no picks"]
    assert job.output.read_text().startswith("# 2 ends, times [0.0, 1.0]\n" * 2)
    record = read_record(job.output)
    assert record is not None
    assert (record.order, record.times) == ({"what": "poem", "lines": 2}, (0.0, 1.0))
    with pytest.raises(SystemExit) as ended:
        main(["again", str(job.output), "--check"])
    assert ended.value.code == 0
    before = job.output.read_bytes()
    capsys.readouterr()
    monkeypatch.setattr("sys.stdin", io.StringIO(worker.make_request(job, VALUES, tmp_path)))
    worker.main()
    assert '{"result": "2 lines"}' in capsys.readouterr().out
    assert job.output.read_bytes().splitlines()[:2] == before.splitlines()[:2]


def test_a_sheet_that_stays_in_equilibrium_is_exported_once_and_not_filmed(tmp_path: Path) -> None:
    hung = {"elements": "sheet", "gravity": (0, 0, -9.81)}
    still = Scene({"weave": {}, "cage": {}, "modal": hung, "response": {}})
    assert not still.is_animated
    assert len(DataJob(tmp_path / "cloth.pvd", "surface").decide_times(still).values) == 1
    with pytest.raises(InputError, match=r"nothing in this scene moves.*add loads"):
        FilmJob(tmp_path / "cloth.gif").decide_times(still)
    for moved in ({"gravity": (0, 0, 0)}, {"initial_velocity": (0, 0, 1)}):
        scene = Scene({"weave": {}, "cage": {}, "modal": hung, "response": moved})
        assert scene.is_animated
        assert len(DataJob(tmp_path / "cloth.pvd", "surface").decide_times(scene).values) > 1
