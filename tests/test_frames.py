"""Films: several processes and continued films give the same frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk import cache, workers
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io.formats.pictures import write_png
from spacemap_vtk.jobs import FilmJob, frames
from spacemap_vtk.jobs.frames import FilmSettings, FrameFolder
from spacemap_vtk.scenes.scene import Scene

VALUES: dict[str, Any] = {
    "weave": {"ends": 2, "picks": 2},
    "modal": {"youngs_modulus": "1 kPa", "modes": 4},
    "response": {"gravity": [0.0, -6.0, 6.0]},
    "surface": {"subdivisions": 1},
    "view": {"size": [64, 48]},
    "animation": {"stop": 0.2},
}
COUNT = 5


def make_film(output: Path, stop: int | None = None, **more: Any) -> list[int]:
    """Make a film, or stop it after some frames; return the reported numbers of finished frames."""
    progress: list[int] = []

    def record_progress(done: int, of: int) -> None:
        assert of == COUNT
        progress.append(done)
        if done == stop:
            raise KeyboardInterrupt

    again, workers = more.pop("again", False), more.pop("workers", None)
    job = FilmJob(output, again=again, workers=workers)
    job.run(Scene({**VALUES, **more}), record_progress)
    return progress


@pytest.fixture
def drawn_times(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the times that are drawn from now on."""
    times: list[float] = []
    draw = Picture.draw

    def noted(picture: Picture, time: float) -> np.ndarray:
        times.append(time)
        return draw(picture, time)

    monkeypatch.setattr(Picture, "draw", noted)
    return times


def folder_contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", [pytest.param("a%d.png", marks=pytest.mark.nightly), "a.gif"])
def test_a_stopped_film_continues_from_its_frames(
    name: str, tmp_path: Path, drawn_times: list[float]
) -> None:
    (whole := tmp_path / "whole").mkdir()
    (parts := tmp_path / "parts").mkdir()
    assert make_film(whole / name) == [0, 1, 2, 3, 4, 5]
    drawn_times.clear()
    with pytest.raises(KeyboardInterrupt):
        make_film(parts / name, 3)
    assert [path.name for path in parts.iterdir()] == [f"{name}.frames"]
    # One of the three is torn, as by a machine that has lost its power.
    torn = FrameFolder(parts / name).path(1)
    torn.write_bytes(torn.read_bytes()[:-30])
    assert make_film(parts / name) == [2, 3, 4, 5]
    np.testing.assert_allclose(drawn_times, [0.0, 0.04, 0.08, 0.04, 0.12, 0.16], atol=1e-12)
    assert folder_contents(parts) == folder_contents(whole)


@pytest.mark.nightly
def test_frames_of_another_film_are_never_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "a.gif"
    for changed in ({"weave": {"ends": 3, "picks": 2}}, {"view": {"size": [64, 40]}}):
        with pytest.raises(KeyboardInterrupt):
            make_film(output, 3)
        assert make_film(output, **changed)[0] == 0
    with pytest.raises(KeyboardInterrupt):
        make_film(output, 3)
    # A mistake does not cost the frames that are there.
    with monkeypatch.context() as little:
        little.setattr("spacemap_vtk.memory.available_bytes", lambda: 400_000_000)
        with pytest.raises(SizeError, match="--workers = 5: 2 processes would need"):
            make_film(output, workers=5)
    assert make_film(output)[0] == 3
    with pytest.raises(KeyboardInterrupt):
        make_film(output, 3)
    assert make_film(output, again=True)[0] == 0
    assert list(tmp_path.iterdir()) == [output]


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.gif.frames").mkdir()
    (tmp_path / "a.gif.frames" / "precious").touch()
    with pytest.raises(InputError, match="has other files"):
        make_film(tmp_path / "a.gif")
    assert {path.name for path in tmp_path.rglob("*")} == {"a.gif.frames", "precious"}


def test_a_film_of_another_process_is_refused(tmp_path: Path) -> None:
    output = tmp_path / "a.gif"
    found: list[str] = []

    def record_progress(done: int, of: int) -> None:
        if done == 3:
            for more in ({}, {"weave": {"ends": 3, "picks": 2}}):
                with pytest.raises(
                    InputError, match=r"a\.gif is being made by another.*Wait"
                ) as no:
                    make_film(output, **more)
                found.append(str(no.value))

    FilmJob(output).run(Scene(VALUES), record_progress)
    assert len(found) == 2
    assert list(tmp_path.iterdir()) == [output]
    with Image.open(output) as image:
        assert image.n_frames == COUNT


def test_several_processes_make_the_same_film(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # They share what is solved though nothing is to be kept.
    monkeypatch.setenv(cache.VARIABLE, "off")
    make_film(tmp_path / "a.gif")
    assert make_film(tmp_path / "b.gif", workers=2) == [0, 1, 2, 3, 4, 5]
    found = folder_contents(tmp_path)
    assert found.keys() == {"a.gif", "b.gif"}
    assert found["a.gif"] == found["b.gif"]


def test_the_number_of_processes_follows_work_and_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = Scene(VALUES)

    def count(width: int, missing: int, requested: int | None, free: float) -> int:
        monkeypatch.setattr(workers, "available_bytes", lambda: int(free))
        settings = FilmSettings.from_scene(scene, scene.animation.frame_times(), (width, width))
        return frames._worker_count(scene, settings, missing, requested)

    monkeypatch.setattr(workers, "core_count", lambda: 4)
    assert count(1000, 1000, None, 1e12) == 4
    assert count(1000, 50, None, 1e12) == 2
    assert count(64, 1000, None, 1e12) == 1
    assert 1 < count(1000, 1000, None, 2e9) < 4
    assert count(1000, 1000, None, 1e8) == 1
    assert count(64, 3, 8, 1e12) == 3
    # Many yarns are drawn some after others, and keep all cores busy.
    scene = Scene({"weave": {"ends": 400, "picks": 400}, "surface": {"subdivisions": "auto"}})
    assert [count(1000, 1000, requested, 2e9) for requested in (None, 2)] == [1, 2]


def test_another_program_reads_the_same_pixels(tmp_path: Path) -> None:
    image = np.random.default_rng(3).integers(0, 256, (37, 23, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", image)
    with Image.open(tmp_path / "a.png") as found:
        assert found.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(found), image)
