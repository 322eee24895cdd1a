"""The exported web page in a browser: what it draws, plays and prints."""

from __future__ import annotations

import base64
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Page, browser
from PIL import Image
from test_morph_surface import SMALL, change_scene, largest_distance
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.moving_surface import to_linear_light
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.morph_surface import make_mode_surface, make_moving_surface
from spacemap_vtk.errors import SizeError
from spacemap_vtk.io.formats.html import _page_content
from spacemap_vtk.io.registry import writer
from spacemap_vtk.jobs import make_data_job
from spacemap_vtk.scenes.scene import Scene

TIMES = np.linspace(0.0, 0.06, 13).tolist()
TOLERANCE = 2e-6
TITLE = "Two < <!-- </script> {{content}} é"
OPEN = "window.spacemap && document.querySelector('#message').hidden"
TIME = "spacemap.time"


def write_page(file: Path, *more: str, times: list[float] = TIMES) -> tuple[Any, Any]:
    scene = change_scene("plain_weave", *SMALL, *more)
    scene.title = TITLE
    made = make_moving_surface(
        scene, times, TOLERANCE, lambda done, of: None, numbers=True, shaded=True
    )
    writer(file).write(file, made)
    return scene, made


def read_canvas(page: Page) -> np.ndarray:
    """Return the drawn picture; the screen may show an older frame."""
    found = page.evaluate("spacemap.picture()").partition(",")[2]
    with Image.open(io.BytesIO(base64.b64decode(found))) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def page_points(page: Page, time: float) -> np.ndarray:
    found = page.evaluate(f"Array.from(spacemap.points({time}))")
    return np.array(found).reshape(-1, 3)


def test_the_page_turns_plays_and_scrubs_the_scene(tmp_path: Path) -> None:
    file, colored, modes = (tmp_path / f"{name}.html" for name in ("own", "stress", "modes"))
    scene, _ = write_page(file)
    dark = ("view.background=#101418", "view.background_top=#202428")
    write_page(colored, "view.color=stress", *dark, times=TIMES[:3])
    shapes = make_mode_surface(
        change_scene("plain_weave", *SMALL, "modal.modes=2"), lambda done, of: None, shaded=True
    )
    writer(modes).write(modes, shapes)
    text = file.read_text("utf-8")
    assert text.count("</script>") == text.count("<script")
    described = text.partition('id="scene">')[2].partition("</script>")[0]
    assert json.loads(described)["title"] == TITLE
    with browser(480, 360) as page:
        page.show_as(480, 360, scale=0.5)
        page.open(file.as_uri())
        page.wait_until(OPEN)
        assert page.evaluate("document.title") == TITLE
        assert page.evaluate("document.querySelector('#figures').textContent").startswith("7 yarns")
        for time in (TIMES[0], TIMES[5], TIMES[12]):
            scene.update(time)
            assert largest_distance(page_points(page, time), scene.polygons) <= TOLERANCE
        assert np.ptp([page_points(page, time) for time in TIMES], axis=0).max() > 100 * TOLERANCE
        # warp in blue, weft in sand, nothing else in the middle of a light page
        first = read_canvas(page)
        red, _, blue = first.transpose(2, 0, 1)
        assert (blue > red + 40).sum() > 400
        assert (red > blue + 40).sum() > 400

        # and it is on the screen, under the words
        page.wait_until("spacemap.settled")
        for _ in range(50):
            off = abs(page.screenshot()[50:100] - first[50:100]).max()
            if off <= 3:
                break
        assert off <= 3

        page.click("#play")
        page.wait_until(f"{TIME} > 0.005")
        page.press(" ")
        stopped = page.evaluate(TIME)
        assert abs(read_canvas(page) - first).max() > 100
        assert page.evaluate(TIME) == stopped
        page.click("#slider")
        assert page.evaluate(TIME) == pytest.approx(0.03, abs=0.004)
        assert page.evaluate("document.querySelector('#time').textContent").endswith(" ms")
        page.press("End")
        assert page.evaluate(TIME) == 0.06
        page.press("Home")
        assert abs(read_canvas(page) - first).max() <= 3
        for hand in (
            lambda: page.drag((200, 150), (260, 170)),
            lambda: page.drag((200, 150), (260, 170), modifiers=8),
            lambda: page.wheel(240, 180, -300),
            lambda: page.press("4"),
        ):
            hand()
            assert abs(read_canvas(page) - first).max() > 100
            page.click("#canvas", count=2)
            assert abs(read_canvas(page) - first).max() <= 3

        page.show_as(480, 360, scale=0.5, dark=True)
        page.wait_until("document.documentElement.dataset.theme === 'dark'")
        assert read_canvas(page)[:, :20].max() < 80
        page.show_as(480, 360, scale=0.5)
        page.open(colored.as_uri())
        page.wait_until(OPEN)
        assert read_canvas(page)[:, :20].max() < 80  # the scene's own background
        scale = page.evaluate("document.querySelector('#scale').innerText").split("\n")
        assert scale[:3] == ["Stress", "von Mises", "[Pa]"]
        page.open(modes.as_uri())
        page.wait_until(OPEN)
        names = page.evaluate("[...document.querySelectorAll('#clip option')].map(o => o.text)")
        assert names == [clip.name for clip in shapes.clips]
        period = page.evaluate("spacemap.end - spacemap.start")
        assert period == pytest.approx(1.0 / shapes.metadata["modes"][0]["frequency_hz"])
        lost = "const lose = spacemap.drawing.gl.getExtension('WEBGL_lose_context')"
        before = read_canvas(page)
        page.evaluate(
            f"(() => {{ {lost}; lose.loseContext(); setTimeout(() => lose.restoreContext()) }})()"
        )
        page.wait_until("!spacemap.drawing.gl.isContextLost() && spacemap.settled")
        assert abs(read_canvas(page) - before).max() <= 3
        page.complaints = [each for each in page.complaints if "CONTEXT_LOST" not in each]
        nothing = "HTMLCanvasElement.prototype.getContext = () => null"
        page.send("Page.addScriptToEvaluateOnNewDocument", source=nothing)
        page.open(modes.as_uri())
        page.wait_until("document.querySelector('#message').innerText.includes('WebGL 2')")
        assert page.complaints == []
        assert {address for address in page.addresses if not address.startswith("about:")} == {
            each.as_uri() for each in (file, colored, modes)
        }


@pytest.mark.nightly
def test_far_cloth_has_the_mean_colour_of_its_yarns_and_no_moire(tmp_path: Path) -> None:
    colors = {"warp_color": "#101010", "weft_color": "#f0f0f0"}
    weave = {"pattern": "plain", "ends": 24, "picks": 24, **colors}
    scene, file = Scene({"weave": weave, "view": {"camera": "face"}}), tmp_path / "cloth.html"
    make_data_job(file, "moving", subdivisions=2).run(scene)
    large, found = write_large_cloth(tmp_path), []
    with browser(160, 160) as page:
        page.open(file.as_uri())
        page.wait_until(OPEN)
        page.evaluate("Object.assign(spacemap.camera.free, { right: 0, up: 0 }), 0")
        for pixels, half in ((8.0, 32), (1.3, 12)):  # from yarn to yarn; half a side of the middle
            spacing = "spacemap.content.far.spacing / spacemap.camera.pixel(160)"
            page.evaluate(f"spacemap.camera.distance *= {spacing} / {pixels}; 0")
            middle = slice(80 - half, 80 + half)
            found.append(read_canvas(page)[middle, middle].astype(np.uint8))
        page.open(large.as_uri())
        page.wait_until(OPEN)
        figures = page.evaluate("document.querySelector('#figures').textContent")
        assert figures.startswith("800 yarns")
        assert (read_canvas(page) < 180).sum() > 400  # its sheet is drawn
        assert page.complaints == []
    near, far = (to_linear_light(image).mean(axis=(0, 1)) for image in found)
    assert far == pytest.approx(near, abs=0.01)
    # Moiré is a slow change of brightness; yarns drawn one by one would change it by 4.
    assert found[1].mean(axis=2).reshape(4, 6, 4, 6).mean(axis=(1, 3)).std() < 1.0


def write_large_cloth(folder: Path) -> Path:
    """Write a page of a cloth that is too large to be written yarn by yarn."""
    scene = Scene({"weave": {"pattern": "plain", "ends": 400, "picks": 400}})
    file, messages = folder / "large.html", list[str]()
    made = make_moving_surface(
        scene, [0.0], None, lambda done, of: None, shaded=True, warn=messages.append
    )
    writer(file).write(file, made)
    assert re.match("the cloth is written as a sheet.*--subdivisions 1", messages[0])
    assert scene.surface.executions == 0  # no yarn was made
    assert file.stat().st_size < 1e6
    return file


def test_colours_show_the_values_of_each_time(tmp_path: Path) -> None:
    scene, made = write_page(tmp_path / "a.html", "view.color=stress")
    numbers = made.numbers
    assert 1 <= len(numbers.changes) < 13
    assert numbers.title == "Stress\nvon Mises\n[Pa]"
    for number, time in enumerate(TIMES):
        scene.update(time)
        found = numbers.values + numbers.weights[number] @ numbers.changes
        there = made.points + np.tensordot(made.clips[0].weights[number], made.targets, 1)
        right = color_values(scene.polygons, "stress")
        nearest = nearest_points(there, scene.polygons)
        step = numbers.span[1] / 512
        assert abs(found - right[nearest]).max() <= 1.01 * step


def nearest_points(points: np.ndarray, surface: vtkPolyData) -> np.ndarray:
    from scipy.spatial import cKDTree

    found: np.ndarray = cKDTree(points_of(surface)).query(points)[1]
    return found


def test_a_page_s_figures_and_camera_leave_out_a_plane_below_the_cloth() -> None:
    plane = "modal.obstacles=[{shape = 'plane', center = [0, 0, '-9 mm']}, {shape = 'sphere', "
    plane += "radius = '1 mm', center = [0, 0, '-6 mm']}]"
    pages = [
        _page_content(make_moving_surface(scene, [0.0], TOLERANCE, lambda *_: None, shaded=True))[0]
        for scene in (change_scene("plain_weave", *SMALL, *more) for more in ([], [plane]))
    ]
    assert pages[0]["figures"] == pages[1]["figures"]
    assert not any("shape" in figure for figure in pages[0]["figures"])
    assert (pages[0]["plane_points"], pages[1]["plane_points"]) == (0, 3 * 3)


def test_a_page_too_large_for_browsers_is_refused(tmp_path: Path) -> None:
    scene = change_scene("plain_weave", *SMALL)
    for most, what in ((50_000, r"\d+ points"), (100_000, r"\d+ targets of \d+ points")):
        with pytest.raises(
            SizeError, match=rf"^{what} need .* too much for one file.*subdivisions"
        ):
            make_moving_surface(scene, TIMES, TOLERANCE, lambda done, of: None, max_bytes=most)
