"""Cameras that a scene stores, and cameras that go round a scene."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.camera import Viewpoint
from spacemap_vtk.draw.picture import Picture
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.provenance import read_record
from spacemap_vtk.jobs import FilmJob
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.saved_cameras import SavedCamera
from spacemap_vtk.scenes.scene import Scene

WEAVE = {"ends": 4, "picks": 4, "warp_color": "#2850a0", "weft_color": "#f0c820"}
HEM = {"name": "hem", "position": [3e-3, 1e-3, 9e-3], "focal_point": [1e-3, 0, 0], "angle": 15}


def drawn(viewpoint: Viewpoint | None = None, **view: Any) -> NDArray[np.uint8]:
    scene = Scene({"weave": WEAVE, "view": view})
    picture = Picture(scene, [0.0], (120, 90), viewpoint=viewpoint)
    image = picture.draw(0.0).copy()
    picture.close()
    return image


def test_a_saved_camera_shows_what_its_viewpoint_shows() -> None:
    place = Viewpoint((3e-3, 1e-3, 9e-3), (1e-3, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0, 15.0)
    saved = drawn(camera="hem", cameras=[HEM])
    assert np.array_equal(saved, drawn(place))
    assert not np.array_equal(saved, drawn())


@pytest.mark.parametrize("scale", [0.0, 0.02])
def test_a_viewpoint_is_kept_to_six_digits(scale: float) -> None:
    here = Viewpoint((0.1234567, -1.0, 0.3), (0.01, 0.02, 0.03), (0.3, 0.5, 0.8), scale, 31.0)
    again = Viewpoint.from_saved(SavedCamera(name="here", **here.as_saved(axis=2)))
    assert again.position == pytest.approx(here.position, abs=1e-5)
    assert again.focus == pytest.approx(here.focus, abs=1e-5)
    # The camera is rolled, so that its own up direction is kept.
    assert again.up == pytest.approx(here.up, abs=1e-5)
    assert again.parallel_scale == pytest.approx(scale)
    upright = here._replace(up=(0.0, 0.1, 0.9)).turned(0.0, 2)
    ahead = np.subtract(upright.focus, upright.position)
    up = np.array([0.0, 0.0, 1.0]) - ahead * ahead[2] / (ahead @ ahead)
    assert upright._replace(up=tuple(up)).as_saved(axis=2)["up"] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("view", "key"),
    [
        ({"camera": "hems", "cameras": [HEM]}, "camera"),
        ({"cameras": [{**HEM, "name": "front"}]}, "cameras[0].name"),
        ({"cameras": [{**HEM, "name": " "}]}, "cameras[0].name"),
        ({"cameras": [HEM, HEM]}, "cameras[1].name"),
        ({"cameras": [{**HEM, "focal_point": HEM["position"]}]}, "cameras[0].focal_point"),
    ],
)
def test_names_are_of_one_camera_each(view: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError) as caught:
        Scene({"view": view})
    assert (caught.value.section, caught.value.key) == ("view", key)
    if key == "camera":
        assert caught.value.allowed == ", ".join((*CAMERAS, "hem"))
        assert caught.value.cure == 'Did you mean "hem"?'


def test_a_camera_goes_round_anticlockwise_seen_from_above() -> None:
    front = Viewpoint((1.0, 2.0, 8.0), (1.0, 2.0, 3.0), (0.0, 1.0, 0.0))
    assert front.turned(90.0, 1).position == pytest.approx((6.0, 2.0, 3.0))
    lying = Viewpoint((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert lying.turned(90.0, 2).position == pytest.approx((5.0, 0.0, 1.0))
    assert lying.turned(360.0, 2).position == pytest.approx(lying.position)
    about = front.turned(90.0, 1, np.zeros(3))
    assert (*about.position, *about.focus) == pytest.approx((8.0, 2.0, -1.0, 3.0, 2.0, -1.0))


def test_a_film_of_still_cloth_orbits_it(tmp_path: Path) -> None:
    values = {"weave": {**WEAVE, "ends": 5, "picks": 5}, "view": {"camera": "front"}}
    film = {"stop": 4, "frames_per_second": 1}
    job = FilmJob(tmp_path / "%d.png", size=(96, 72), workers=1)
    with pytest.raises(InputError, match="nothing in this scene moves"):
        job.run(Scene({**values, "animation": film}))
    job.run(Scene({**values, "animation": {**film, "orbit": "1 turn"}}))
    frames = [np.asarray(Image.open(tmp_path / f"{k}.png")).astype(int) for k in range(4)]
    across = [(np.ptp(frame, axis=2) > 40).any(axis=0) for frame in frames]
    # Face, edge, back, edge: narrow from the edge, never cut off.
    assert across[1].sum() < 0.5 * across[0].sum()
    assert across[3].sum() < 0.5 * across[2].sum()
    assert not any(columns[[0, -1]].any() for columns in across)
    # With odd numbers, the reverse of a plain weave has the two colours exchanged.
    both = (np.ptp(frames[0], axis=2) > 40) & (np.ptp(frames[2], axis=2) > 40)
    assert np.abs(frames[0] - frames[2])[both].mean() > 20


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return int(ended.value.code or 0)


def test_the_command_line_takes_cameras_lights_and_insets_and_records_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, picture = tmp_path / "cloth.toml", tmp_path / "cloth.png"
    table = "\n".join(f"{key} = {value!r}" for key, value in HEM.items())
    scene.write_text(f"[weave]\nends = 4\npicks = 4\n[[view.cameras]]\n{table}\n")
    words = ["--camera", "hem", "--light", "raking", "--inset", "0.5,0.5,4", "--size", "96x72"]
    assert run("render", str(scene), "-o", str(picture), *words) == 0
    assert run("again", str(picture), "--check") == 0
    record = read_record(picture)
    assert record is not None
    view = tomllib.loads(record.scene)["view"]
    assert (view["camera"], view["light"]) == ("hem", "raking")
    assert (view["insets"][0]["magnification"], view["cameras"][0]["name"]) == (4.0, "hem")
    capsys.readouterr()
    assert run("render", str(scene), "-o", str(picture), "--camera", "hems") == 2
    assert '--camera = "hems": there is no such camera' in capsys.readouterr().err
    assert run("render", str(scene), "-o", str(picture), "--inset", "middle") == 2
    assert "0.4,0.6,8" in capsys.readouterr().err


def test_a_frame_of_an_orbit_is_made_again(tmp_path: Path) -> None:
    scene, frames = tmp_path / "cloth.toml", tmp_path / "%d.png"
    scene.write_text("[weave]\nends = 4\npicks = 4\n")
    words = ["--orbit", "180deg", "--size", "64x48", "--workers", "1", "-q"]
    words += ["--set", "animation.stop=3", "--set", "animation.frames_per_second=1"]
    assert run("animate", str(scene), "-o", str(frames), *words) == 0
    assert run("again", str(tmp_path / "2.png"), "--check", "-q") == 0
