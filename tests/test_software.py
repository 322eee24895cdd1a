"""Pictures drawn without OpenGL, against those that OpenGL draws of the same scenes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from test_cli import run
from test_obstacle_surfaces import TABLE

from spacemap_vtk.draw.actors.surface_actor import color_bar_share
from spacemap_vtk.draw.figure.sheets import mode_sheet
from spacemap_vtk.draw.graphics import OPENGL_VARIABLE, prepare_offscreen
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.scenes.scene import Scene

pytest.importorskip("numba")

SIZE = (320, 240)
#: A cloth that swings, small and soon solved.
SWING: dict[str, Any] = {
    "weave": {"ends": 4, "picks": 4},
    "cage": {"divisions": [2, 2, 1]},
    "modal": {"modes": 6},
    "response": {"loads": [{"gravity": [0.0, 0.0, -9.81]}]},
}
#: What each view differs in from the usual one, and by how much pictures of it may differ in the
#: mean, in levels of 255: thin lines and letters are smoothed by OpenGL in its own way.
VIEWS: dict[str, tuple[dict[str, Any], float]] = {
    "fibres and soft shadows": ({"show": "fabric"}, 0.15),
    "near": ({"show": "fabric", "zoom": 4.0}, 0.2),
    "the face, flat": ({"show": "fabric", "camera": "face"}, 0.15),
    "outlines": ({"show": "fabric", "style": "paper"}, 0.3),
    "tinted": ({"show": "fabric", "style": "blueprint"}, 0.5),
    "numbers": ({"show": "fabric", "color": "displacement"}, 1.0),
    "families": ({"show": "fabric", "color": "family"}, 0.15),
    "cut open": ({"show": "fabric", "clip_normal": (1.0, 0.0, 0.0)}, 0.1),
    "a cage": ({"show": "cage"}, 1.0),
    "a cage over its fabric": ({"show": "both"}, 1.5),
    "ghost and ground": ({"show": "fabric", "ghost": True, "ground": True}, 0.3),
    "loads": ({"show": "fabric", "loads": True}, 0.5),
    "written over": (
        {"show": "fabric", "scale_bar": True, "triad": True, "time_stamp": True},
        0.8,
    ),
}


def picture(scene: Scene, time: float = 0.02) -> np.ndarray:
    drawn = Picture(scene, [time], SIZE)
    image = drawn.draw(time)
    drawn.close()
    return image.astype(int)


#: Views whose parts others show too.
SIMILAR = {"a cage", "numbers", "near", "families", "tinted"}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.nightly] * (name in SIMILAR)) for name in VIEWS],
)
def test_software_pictures_agree_with_opengl(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    prepare_offscreen()
    view, most = VIEWS[name]
    scene = Scene({**SWING, "view": view})
    expected = picture(scene)
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    made = picture(scene)
    if "color" in view:  # a scale at the right has letters and strip in much the same places
        share = round((1.0 - color_bar_share(SIZE)) * SIZE[0])
        assert np.abs(made - expected)[:, share:].mean() < 20.0
        made, expected = made[:, :share], expected[:, :share]
    # That it draws the cloth at all: half of a difference would be that of an empty picture.
    bare = np.abs(expected - np.median(expected, axis=(0, 1))).mean()
    assert np.abs(made - expected).mean() < min(most, 0.5 * bare)


@pytest.mark.nightly
def test_obstacles_look_as_with_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    prepare_offscreen()
    scene = Scene(TABLE)
    expected = picture(scene, 0.0)
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    # The few facets of the yarns are cut into other triangles.
    assert np.abs(picture(scene, 0.0) - expected).mean() < 1.5


def test_a_textured_object_agrees_with_opengl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare_offscreen()
    x, y = np.meshgrid(np.arange(64), np.arange(64))
    Image.fromarray(np.stack([4 * x, 4 * y, 255 - 4 * x], axis=2).astype(np.uint8)).save(
        tmp_path / "a.png"
    )
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    values = {"file": str(tmp_path / "a.obj"), "texture": str(tmp_path / "a.png")}
    scene = Scene({"object": values})
    expected = picture(scene)
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    assert np.abs(picture(scene) - expected).mean() < 0.5


@pytest.mark.nightly
def test_mode_shapes_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    prepare_offscreen()
    scene = Scene({**SWING, "modal": {"modes": 1}})
    expected = mode_sheet(scene, lambda *_: None).astype(int)
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    assert np.abs(mode_sheet(scene, lambda *_: None) - expected).mean() < 0.8


def test_a_machine_without_opengl_draws_with_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from spacemap_vtk.draw import offscreen

    def crash() -> None:
        raise AssertionError("VTK's window would end this process")

    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    monkeypatch.setattr(offscreen, "vtkRenderWindow", crash)
    file = tmp_path / "a.png"
    assert run("render", "twill_2_2", "-o", str(file), "--size", "320x240") == 0
    errors = capsys.readouterr().err.splitlines()
    lines = [line for line in errors if "apt-get install libegl1 libgl1" in line]
    assert len(lines) == 1
    assert "OpenGL libraries were not found" in lines[0]
    pixels = np.asarray(Image.open(file).convert("RGB")).astype(int)
    # Blue ends, and picks of a warm white on a cool ground.
    blue, pale = pixels[..., 2] - pixels[..., 0] > 40, pixels[..., 0] - pixels[..., 2] > 5
    assert blue.mean() > 0.1
    assert pale.mean() > 0.1


def test_thin_yarns_are_drawn_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With OpenGL it is a sheet, which is not drawn without."""
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    file, words = tmp_path / "a.png", ["--set", "weave.ends=60", "--set", "weave.picks=60"]
    face = ["--set", "view.camera=face", "--size", "80x80"]
    assert run("render", "twill_2_2", "-o", str(file), *words, *face) == 0
    assert np.ptp(np.asarray(Image.open(file).convert("RGB")).astype(int), axis=(0, 1)).min() > 40


def test_a_sheet_needs_opengl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    prepare_offscreen()
    monkeypatch.setattr("spacemap_vtk.scenes.level_of_detail.MANY_PATCHES", 1)
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    file = tmp_path / "a.png"
    words = ["--set", "weave.ends=60", "--set", "weave.picks=60", "--size", "80x60"]
    assert run("render", "twill_2_2", "-o", str(file), *words) == 1
    errors = capsys.readouterr().err
    assert "cloths of very many yarns need OpenGL" in errors
    assert "apt-get install libegl1 libgl1" in errors
    assert not file.exists()


def test_a_film_is_drawn_frame_by_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(OPENGL_VARIABLE, "never")
    file, words = tmp_path / "a.gif", ["--set", "animation.stop=0.02", "--workers", "1"]
    small = ["--size", "80x60", "--set", "weave.ends=3", "--set", "weave.picks=3"]
    assert run("animate", "plain_weave", "-o", str(file), *small, *words) == 0
    with Image.open(file) as film:
        assert film.n_frames > 1
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert np.ptp(frames[0], axis=(0, 1)).min() > 40
    assert np.abs(frames[0] - frames[-1]).mean() > 0.1


@pytest.mark.parametrize("kept", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_compiled_loops_are_not_stored_in_the_package(kept: bool, tmp_path: Path) -> None:
    """What pip did not install would outlive it, and hide an editable install of the same."""
    code = (
        "from spacemap_vtk.draw.software import raster_loops as r; print(r.fill.stats.cache_path)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "SPACEMAP_CACHE": str(tmp_path) if kept else "off"},
        capture_output=True,
        text=True,
        check=True,
    )
    place = done.stdout.strip()
    assert place.startswith(str(tmp_path / "compiled")) if kept else place == "None"
