"""Pages for publications: drawings agree with the cloth, and pictures share a camera."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.actors.color_values import round_ticks
from spacemap_vtk.draw.annotate.view_scale import round_length


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as done:
        main([str(each) for each in arguments])
    return int(done.value.code or 0)


def texts(file: Path) -> list[str]:
    return [
        "".join(each.itertext())
        for each in ElementTree.parse(file).iter()
        if each.tag[-4:] == "text"
    ]


def test_a_section_has_peirces_dimensions(tmp_path: Path) -> None:
    values = "warp_diameter=0.25mm weft_diameter=0.3mm warp_spacing=0.55mm weft_spacing=0.6mm"
    settings = [f"--set=weave.{each}" for each in (*values.split(), "warp_crimp_height=0.2mm")]
    file = tmp_path / "section.svg"
    assert run("figure", "plain_weave", "-o", file, "--panels", "section", *settings, "-q") == 0
    written = texts(file)
    for words in (
        *("d₁ = 0.25 mm", "d₂ = 0.3 mm", "D = d₁ + d₂ = 0.55 mm", "p₁ = 0.55 mm", "p₂ = 0.6 mm"),
        *("h₁ = 0.2 mm", "h₂ = 0.35 mm", "θ₁ = 22.10°", "θ₂ = 50.03°"),
        *("l₁ = 0.6364 mm", "l₂ = 0.6803 mm"),
    ):
        assert words in written
    assert any("crimp c₁ = 6.064 %" in each for each in written)
    assert any("crimp c₂ = 23.69 %" in each for each in written)


def test_the_squares_of_a_draft_follow_its_matrix(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    size = ("--set=weave.ends=11", "--set=weave.picks=9")
    assert run("info", "satin_5_2", "--json", *size) == 0
    rows = json.loads(capsys.readouterr().out)["drawdown"]
    file = tmp_path / "draft.svg"
    assert run("figure", "satin_5_2", "-o", file, "--panels", "draft", *size, "-q") == 0
    shape = next(each for each in ElementTree.parse(file).iter() if each.get("id") == "drawdown")
    path = shape[0].get("d")
    assert path is not None
    numbers = [
        [float(number) for number in re.findall(r"-?[\d.]+", square)] for square in path.split("z")
    ]
    corners = np.array([square[:8] for square in numbers if square]).reshape(-1, 4, 2)
    low, side = corners.min(axis=1), np.ptp(corners, axis=1)
    cell = side.mean()
    np.testing.assert_allclose(side, cell, rtol=1e-4)
    # An SVG counts from above: the first pick is the lowest.
    column = np.rint((low[:, 0] - low[:, 0].min()) / cell).astype(int)
    row = np.rint((low[:, 1].max() - low[:, 1]) / cell).astype(int)
    found = np.zeros((9, 11), bool)
    found[row, column] = True
    assert ["".join(str(int(mark)) for mark in each) for each in found] == rows


def test_pictures_share_camera_and_scale_and_are_transparent(tmp_path: Path) -> None:
    file = tmp_path / "swing.png"
    more = ("--times=0,20ms", "--dpi=75", "--transparent", "--set=view.show=fabric")
    assert run("figure", "plain_weave", "-o", file, *more, "-q") == 0
    assert run("again", file, "--check", "-q") == 0
    with Image.open(file) as picture:
        cover = np.asarray(picture)[..., 3] > 128
    assert not cover[:, :4].any()
    assert not cover[:, -4:].any()
    gap, edge = (round(length * 75 / 25.4) for length in (4.0, 1.5))
    wide = (cover.shape[1] - 2 * edge - gap) // 2
    panels = [cover[:, edge + k * (wide + gap) :][:, :wide] for k in range(2)]
    # The upper edge is held: it is where it was, and the lower one is not.
    upper, lower = slice(round(0.14 * wide), round(0.24 * wide)), slice(round(0.8 * wide), wide)
    assert panels[0][upper].any()
    assert (panels[0][upper] != panels[1][upper]).mean() < 0.04
    assert (panels[0][lower] != panels[1][lower]).mean() > 0.2


@pytest.mark.nightly
def test_pictures_of_an_incomplete_row_have_the_same_size(tmp_path: Path) -> None:
    file = tmp_path / "swing.svg"
    more = ("--times=0,10ms,20ms", "--columns=2", "--dpi=30", "--set=view.show=fabric")
    assert run("figure", "plain_weave", "-o", file, *more, "-q") == 0
    images = [each for each in ElementTree.parse(file).iter() if each.tag[-5:] == "image"]
    sizes = [(each.get("width"), each.get("height")) for each in images]
    assert sizes[:3] == [sizes[0]] * 3  # the next is the scale of colours


def test_round_numbers_and_lengths() -> None:
    assert round_length(0.0341) == pytest.approx(0.02)
    assert round_length(0.05) == pytest.approx(0.05)
    assert round_ticks(-3.1, 4.2) == [-2.0, 0.0, 2.0, 4.0]
    assert round_ticks(0.0, 0.8) == [0.0, 0.2, 0.4, 0.6, 0.8]


def test_invalid_figure_options_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, words in (
        (("plain_weave", "--panels=drawdowns"), "pictures ("),
        (("plain_weave", "--width=18"), "40mm to 1200mm"),
        (("plain_weave", "--panels=section", "--end=8"), "1 to 7"),
        (("plain_weave", "--columns=0"), "at least 1"),
        (("twill_2_2", "--cage"), "no moving cage"),
        (("lever_in_tetwild_cage", "--panels=section"), "this scene is not woven"),
    ):
        assert run("figure", *arguments, "-q", "-o", tmp_path / "a.svg") == 2
        assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
