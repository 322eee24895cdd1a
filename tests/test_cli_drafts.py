"""Figures and drafts on the command line: info, export, and cloths too large or too dense."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_cli import SMALL, refused, run

from spacemap_vtk import WeaveSource
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.wif import read_wif
from spacemap_vtk.io.registry import writer_endings
from spacemap_vtk.scenes.scene import Scene


def test_info_prints_mass_feasible_intervals_and_clearance(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # by hand: 30 tex and 20 per cm in both families, no crimp: 2 x 30 g/km x 2000 /m = 120 g/m2
    yarns = ["weave.warp_count=30 tex", "weave.weft_count=30 tex", "weave.weft_crimp=0"]
    arguments = [word for assignment in yarns for word in ("--set", assignment)]
    assert run("info", "plain_weave", "--json", *arguments) == 2
    assert "warp_diameter and warp_count" in capsys.readouterr().err
    round_ = ["--set", "weave.warp_section=circular", "--set", "weave.weft_section=circular"]
    assert run("info", "twill_2_2", "--json", "--set", "weave.weft_crimp=0", *round_) == 0
    figures = json.loads(capsys.readouterr().out)
    warp, weft = figures["warp"], figures["weft"]
    assert weft["crimp"] == pytest.approx(0.0, abs=1e-12)
    assert warp["tex"] == pytest.approx(30.0)
    mass = 0.1 * 30 * (24 * (1 + warp["mean_crimp"]) + 22)
    assert 1e3 * figures["areal_mass"] == pytest.approx(mass)
    # the fibres' share of the volume is their mass over their density and the thickness
    assert figures["fibre_volume_fraction"] == pytest.approx(
        figures["areal_mass"] / 1520 / figures["thickness"]
    )
    assert figures["feasible"]["warp_crimp"][0] == 0.0
    assert figures["feasible"]["warp_spacing"][1] is None
    assert "warp_diameter" in figures["feasible"]
    assert figures["memory_bytes"] > 1e5
    # one cubic misses a quarter circle by 2.7e-4, and adds what its arcs along the yarn are off
    assert 2.7e-4 < figures["radial_error"] < 4e-4
    assert figures["warnings"] == []


def test_info_at_a_time_prints_the_deformed_clearance(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "plain_weave", "--json", "--time", "0 s", "-q") == 0
    figures = json.loads(capsys.readouterr().out)
    diameter = figures["warp"]["diameter"]
    # at rest patches touch, but for what a cubic misses of an arc
    assert abs(figures["deformed_clearance"]["distance"]) < 1e-3 * diameter
    assert run("info", "plain_weave", "--time", "0.02", "-q") == 0
    assert "... deformed" in capsys.readouterr().out
    assert run("info", "basket_2", "--time", "0.02") == 2
    assert "does not move" in capsys.readouterr().err


def test_a_draft_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "twill.wif"
    # A file stores widths only, which are the diameters of round yarns.
    round_ = ["--set", "weave.warp_section=circular", "--set", "weave.weft_section=circular"]
    assert run("export", "twill_2_2", "-o", str(file), "-q", *round_) == 0
    assert run("info", str(file), "--json") == 0
    again = json.loads(capsys.readouterr().out)
    assert run("info", "twill_2_2", "--json", *round_) == 0
    first = json.loads(capsys.readouterr().out)
    assert again["drawdown"] == first["drawdown"]
    for family in ("warp", "weft"):
        for name in ("diameter", "spacing", "theta_deg", "crimp"):
            assert again[family][name] == pytest.approx(first[family][name], rel=1e-12)


def test_export_prints_the_warnings_of_a_draft(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, again = tmp_path / "odd.wif", tmp_path / "again.wif"
    assert run("export", "twill_2_2", "-o", str(file), "-q") == 0
    file.write_text(file.read_text().replace("Units=Centimeters", "Units=mm"))  # not the standard's
    assert run("info", str(file), "--json") == 0
    reported = json.loads(capsys.readouterr().out)["warnings"]
    assert any("Units=mm is not in the standard" in warning for warning in reported)
    assert run("export", str(file), "-o", str(again)) == 0
    printed = capsys.readouterr().err.splitlines()
    assert printed == [f"spacemap: note: {warning}" for warning in reported]
    assert run("export", str(file), "-o", str(again), "-q") == 0
    assert capsys.readouterr().err == ""


_LOOM = """[WIF]
Version=1.1
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[COLOR PALETTE]
Range=0,255
[COLOR TABLE]
1=255,0,0
2=0,0,255
[WARP]
Threads=6
Color=1
Units=centimeters
Spacing={spacing}
Thickness={thickness}
[WEFT]
Threads=4
Color=2
Units=centimeters
Spacing=0.1
Thickness={weft}
[THREADING]
1=1
2=2
3=1
4=2
5=1
6=1
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
3=1
4=2
{more}"""
#: By default, yarns of any draft are drawn so that they fit.
ROUND = ["--set", "weave.thick_yarns=flatten"]
#: Drafts whose yarns do not fit, with the printed message.
_NO_ROOM = {
    # a slip of units: 90 cm thick, half a millimetre apart
    "all too thick": ("0.05", "90", "0.05", "", "warp yarns overlap: they are 900 mm thick"),
    "two too near": (
        "0.01",
        "0.1",
        "0.05",
        "[WARP THICKNESS]\n1=0.5\n2=0.05\n3=1\n4=50\n5=1\n6=0.01\n",
        "neighbouring warp yarns 1 and 2 overlap",
    ),
    # no spacing: yarns side by side
    "jammed": (
        "0",
        "5",
        "0",
        "[WARP THICKNESS]\n1=1\n2=0.01\n3=0.001\n4=0.001\n5=5\n6=0.5\n"
        "[WEFT SPACING]\n1=0.01\n2=0.001\n3=1\n4=1\n",
        "jammed at every warp_crimp_height",
    ),
}


@pytest.mark.parametrize("kind", _NO_ROOM)
def test_a_draft_whose_yarns_do_not_fit_is_still_a_draft(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    spacing, thickness, weft, more, why = _NO_ROOM[kind]
    file, copy = tmp_path / "draft.wif", tmp_path / "copy.wif"
    file.write_text(_LOOM.format(spacing=spacing, thickness=thickness, weft=weft, more=more))
    assert why in refused(
        capsys, "render", str(file), "-o", str(tmp_path / "a.png"), *SMALL, *ROUND
    )

    assert run("export", str(file), "-o", str(copy)) == 0
    first, again = read_wif(file), read_wif(copy)
    printed = [f"spacemap: note: {text}" for text in first.warnings]
    assert capsys.readouterr().err.splitlines() == printed
    assert again.loom == first.loom
    np.testing.assert_array_equal(again.drawdown, first.drawdown)
    assert np.shape(again.warp.thickness) == np.shape(first.warp.thickness)
    assert again.warp.thickness == pytest.approx(first.warp.thickness, rel=1e-12)

    assert run("info", str(file), "--json", "-q", *ROUND) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["ends"], figures["picks"]) == (6, 4)
    assert figures["drawdown"] == ["101011", "010100", "101011", "010100"]
    assert figures["threading"] == [[1], [2], [1], [2], [1], [1]]
    assert (figures["shafts"], figures["treadles"]) == (2, 2)
    assert any("its yarns do not fit" in text and why in text for text in figures["warnings"])
    for family, color, longest in (("warp", "#ff0000", 1), ("weft", "#0000ff", 2)):
        for name in ("theta_deg", "length", "crimp", "height"):
            assert figures[family][name] is None
        assert figures[family]["colors"] == [color]
        assert figures[family]["longest_float"] == longest
    assert run("info", str(file), *ROUND) == 0
    printed = capsys.readouterr()
    assert "–" in printed.out
    assert why in printed.err

    assert run("validate", str(file)) == 0
    assert "valid" in capsys.readouterr().out
    # A scene that uses the draft is refused.
    scene = tmp_path / "scene.toml"
    scene.write_text('[weave]\ndraft = "draft.wif"\nthick_yarns = "flatten"\n')
    assert why in refused(capsys, "validate", str(scene), "-q")
    changed = [*ROUND, "--set", "weave.weft_color=#102030"]
    assert why in refused(capsys, "validate", str(file), "-q", *changed)


@pytest.mark.nightly
def test_a_draft_too_large_for_memory_is_drawn_and_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, copy = tmp_path / "large.wif", tmp_path / "copy.wif"
    words = ["--set", "weave.ends=240", "--set", "weave.picks=240"]
    assert run("export", "basket_2", "-o", str(file), "-q", *words) == 0
    monkeypatch.setattr("spacemap_vtk.memory.available_bytes", lambda: 230_000_000)
    assert run("render", str(file), "-o", str(tmp_path / "a.png"), "--size", "200x150") == 0
    assert "a yarn is" not in capsys.readouterr().err
    message = refused(capsys, "export", str(file), "-o", str(tmp_path / "a.vtp"), "-q")
    assert "weave.ends = 240: a weave of 240 x 240 yarns would need about 0." in message
    assert run("validate", str(file)) == 0
    assert "too large for a file of its surface" in capsys.readouterr().err
    assert run("export", str(file), "-o", str(copy)) == 0
    np.testing.assert_array_equal(read_wif(copy).drawdown, read_wif(file).drawdown)
    capsys.readouterr()
    assert run("info", str(file), "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["ends"] == 240
    assert figures["warp"]["theta_deg"] > 0
    assert figures["least_clearance"]["distance"] == 0.0
    assert "too large for a file of its surface" in " ".join(figures["warnings"])


def test_info_counts_patches_without_building_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    built = WeaveSource(pattern="twill 3/1", ends=24, picks=18, warp_section="racetrack")
    built.update()
    grid = built.GetOutputDataObject(0)
    monkeypatch.setattr(WeaveSource, "run", None)
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[weave]\npattern = "twill 3/1"\nends = 24\npicks = 18\nwarp_section = "racetrack"\n'
    )
    assert run("info", str(scene), "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["patches"] == grid.GetNumberOfCells()
    assert figures["control_points"] == grid.GetNumberOfPoints()
    assert figures["memory_bytes"] == pytest.approx(1024 * grid.GetActualMemorySize(), rel=0.01)
    error = grid.GetFieldData().GetArray("radial_error").GetValue(0)
    assert figures["radial_error"] == pytest.approx(error)


SMALL_DRAFT = """
[WIF]
Version=1.1
[CONTENTS]
Warp=yes
Weft=yes
Threading=yes
Tieup=yes
Treadling=yes
[WEAVING]
Rising Shed=yes
Shafts=2
Treadles=2
[WARP]
Threads={ends}
Units=centimeters
{warp}
[WEFT]
Threads=6
Units=centimeters
{weft}
[THREADING]
1=1
2=2
3=1
4=2
5=1
6=2
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
3=1
4=2
5=1
6=2
"""


@pytest.mark.parametrize(
    "threads",
    [
        "",
        "Spacing=0.1\nThickness=0.1",
        *(
            pytest.param(each, marks=pytest.mark.nightly)
            for each in ("Spacing=0.1", "Thickness=0.1", "Comment=x")
        ),
    ],
)
def test_a_picture_of_a_feasible_draft_has_no_warning(
    threads: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    prepare_offscreen()  # without OpenGL there is a line about that
    file = tmp_path / "sound.wif"
    file.write_text(SMALL_DRAFT.format(ends=6, warp=threads, weft=threads))
    assert run("render", str(file), "-o", str(tmp_path / "a.png"), "--size", "60x60") == 0
    assert capsys.readouterr().err == ""
    assert run("info", str(file)) == 0
    assert "lenticular" in (printed := capsys.readouterr().out)
    assert "mm (assumed)" in printed
    assert run("info", str(file), "--set", "weave.thick_yarns=scale") == 0
    if "Thickness" in threads:
        assert "too thick to interlace" in capsys.readouterr().err


def test_a_picture_of_a_draft_prints_at_most_one_of_its_warnings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    prepare_offscreen()
    file, picture = tmp_path / "doubtful.wif", str(tmp_path / "a.png")
    # Two ends in no heddle, a spacing that is no number, a thickness as large as the spacing.
    file.write_text(
        SMALL_DRAFT.format(ends=8, warp="Spacing=wide\nThickness=0.1", weft="Thickness=0.1")
    )
    scaled = ["--set", "weave.thick_yarns=scale"]
    assert run("render", str(file), "-o", picture, "--size", "60x60", *scaled) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert 'Spacing "wide" in [WARP] is not a number' in line
    assert line.endswith(f" (and 1 more: spacemap info {file})")
    assert run("info", str(file), *scaled) == 0
    reported = " ".join(capsys.readouterr().err.split())
    for part in ("is not a number", "--set weave.trim=true", "too thick to interlace"):
        assert part in reported
    # The cure works.
    assert (
        run(
            "render", str(file), "-o", picture, "--size", "60x60",
            "--set", "weave.trim=true", "--set", "weave.warp_spacing=1mm", *scaled,
        )
        == 0
    )  # fmt: skip
    (line,) = capsys.readouterr().err.splitlines()
    assert "weave.trim" not in line


@pytest.mark.parametrize("ending", [".wpo", ".vtu"])
def test_convert_lists_the_endings_of_drafts_only(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.wif"
    file.write_text(SMALL_DRAFT.format(ends=6, warp="", weft=""))
    message = refused(capsys, "convert", str(file), str(tmp_path / f"a{ending}"))
    allowed = message.partition("allowed: ")[2].partition('"spacemap export"')[0]
    for ending in writer_endings("draft"):
        assert ending in allowed
    for ending in writer_endings().keys() - writer_endings("draft").keys():
        assert f"{ending} " not in f"{allowed} "
    assert ".vtu" not in allowed


def test_an_error_in_frames_per_second_names_the_option() -> None:
    scene = Scene({"animation": {"fps": 12}})
    assert scene.animation.frames_per_second == 12
    scene.set("animation.fps=30")
    assert scene.animation.frames_per_second == 30
    with pytest.raises(InputError, match="frames_per_second"):
        scene.set("animation.fpss=30")
