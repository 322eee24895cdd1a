"""The copied command line, script and table of figures agree with the window."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from window import require_display, settled, wait_until

require_display()

from PySide6.QtGui import QGuiApplication  # noqa: E402

from spacemap_vtk.scenes import report  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402

# Otherwise each process would solve the modes again.
pytestmark = pytest.mark.usefixtures("kept_modes")


def copied_text(window: Any, action: str) -> str:
    window.menus.actions[action].trigger()
    return QGuiApplication.clipboard().text()


#: Runs commands one after another in one process, because each takes as long as a start.
_RUN = """
import json, sys
from spacemap_vtk.cli.main import main
for words in json.loads(sys.argv[1]):
    try:
        main(words)
    except SystemExit as ended:
        assert ended.code == 0, words
"""


def change_a_lot(window: Any) -> None:
    document = window.document
    document.set("weave", "ends", 5)
    document.set("weave", "pattern", ["110", "011", "101"])
    document.set("response", "gravity", [0.0, "-1 g", 0.0])
    # A key of the file is reset to its default.
    document.set("response", "initial", None)
    loads = [{"pressure": "0.5 Pa", "on": "+z", "time": "table", "times": [0, 1], "values": [1, 1]}]
    document.set("response", "loads", loads)
    document.set("surface", "subdivisions", 3)  # whatever the tests' copy of the scene says
    document.set("view", "color", "velocity")
    document.set("view", "size", [200, 100])


@pytest.mark.parametrize("start", ["gust", pytest.param(None, marks=pytest.mark.nightly)])
def test_copied_command_draws_the_same_picture(
    open_scene: Any, tmp_path: Path, start: str | None
) -> None:
    window = open_scene("gust")
    if start is None:
        window.document.new()
    change_a_lot(window)
    wait_until(lambda: settled(window))
    line = copied_text(window, "Copy as command line")
    window.document.save(tmp_path / "same.toml")
    arguments = shlex.split(line, comments=True)
    assert arguments[:2] == ["spacemap", "render"]
    same = [
        "render",
        "same.toml",
        "-o",
        "same.png",
        "--time",
        arguments[arguments.index("--time") + 1],
    ]
    commands = json.dumps([[*arguments[1:], "-q"], [*same, "-q"]])
    done = subprocess.run(
        [sys.executable, "-c", _RUN, commands],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    one, other = (np.asarray(Image.open(tmp_path / f"{n}.png")) for n in ("picture", "same"))
    assert one.shape == (100, 200, 3)
    assert np.abs(one.astype(int) - other).max() == 0


@pytest.mark.nightly
def test_copied_script_computes_the_points_of_the_window(open_scene: Any, tmp_path: Path) -> None:
    window = open_scene("gust")
    change_a_lot(window)
    wait_until(lambda: settled(window))
    script = tmp_path / "script.py"
    script.write_text(
        copied_text(window, "Copy as Python script") + "print(*surface.GetBounds(), sep=',')\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    bounds = [float(number) for number in done.stdout.splitlines()[-1].split(",")]
    np.testing.assert_allclose(bounds, window.view.frame.surface.GetBounds(), rtol=1e-12)


def test_copied_command_sets_automatic_values(open_scene: Any) -> None:
    window = open_scene()
    window.document.set("weave", "warp_diameter", None)
    line = copied_text(window, "Copy as command line")
    assert 'weave.warp_diameter="auto"' in line
    arguments = shlex.split(line)
    again = Scene.read(arguments[2])
    for number, word in enumerate(arguments):
        if word == "--set":
            again.set(arguments[number + 1])
    assert again.source.settings == window.document.scene.source.settings


def test_copied_command_names_the_draft_file(open_scene: Any, twill: Path) -> None:
    draft = twill.with_suffix(".wif")
    window = open_scene(str(draft), wait=False)
    window.document.set("weave", "thick_yarns", "scale")
    line = copied_text(window, "Copy as command line")
    assert str(draft.resolve()) in line
    assert 'weave.thick_yarns="scale"' in line


@pytest.mark.nightly
def test_figures_equal_those_of_the_command_line_and_follow_the_cloth(open_scene: Any) -> None:
    window = open_scene()
    window.tabs.setCurrentWidget(window.figures)

    def rows() -> dict[str, list[str]]:
        window.figures.copy_button.click()
        lines = QGuiApplication.clipboard().text().splitlines()
        return {name: cells for name, *cells in (line.split("\t") for line in lines)}

    wait_until(lambda: rows().get("least clearance [mm]", [""])[0])  # it comes last
    picture = window.figures.sections.picture
    wait_until(lambda: not picture.pixmap().isNull())
    image = picture.pixmap().toImage()
    width, height = image.width(), image.height()
    colors = {image.pixelColor(x, y).name() for x in range(width) for y in range(20, height, 8)}
    paper, share = np.full(3, 255), 0.38  # part of a yarn's colour, so that lines are visible on it
    for yarns in window.document.scene.woven.cloth.threads:
        tint = (share * yarns.colors[0] + (1 - share) * paper).round().astype(int)
        assert "#{:02x}{:02x}{:02x}".format(*tint) in colors
    found, shown = report.report_fabric(Scene.read("plain_weave")), rows()
    assert float(shown["areal mass [g/m2]"][0]) == pytest.approx(1e3 * found["areal_mass"], 1e-5)
    crimp = [100 * found[family]["crimp"] for family in ("warp", "weft")]
    assert [float(c) for c in shown["crimp c [%]"]] == pytest.approx(crimp, 1e-5)
    assert abs(float(shown["least clearance [mm]"][0])) < 1e-9
    window.document.set("weave", "ends", 5)
    wait_until(lambda: rows()["yarns"][0] == "5")
    # If the cloth cannot be woven, the last good cloth and its figures stay.
    window.document.set("weave", "warp_sett", "90 /cm")
    wait_until(lambda: not window.errors.isHidden())
    for tab in (window.modes, window.figures):
        window.tabs.setCurrentWidget(tab)
    wait_until(lambda: not window.figures._rest_timer.isActive())
    assert rows()["yarns"][0] == "5"
    assert rows()["spacing p [mm]"] == shown["spacing p [mm]"]
