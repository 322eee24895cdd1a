"""`spacemap modes` and `info` tell what a cage is to mechanics, and a sheet's measures."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from spacemap_vtk.cli.main import main

SHEET = """
[weave]
ends = 10
picks = 10
[cage]
divisions = [4, 4, 1]
[modal]
elements = "sheet"
modes = 2
tensile_rigidity = "10 gf/cm"
shear_rigidity = "0.5 gf/cm.deg"
bending_rigidity = ["0.2 gf.cm2/cm", "0.1 gf.cm2/cm"]
areal_mass = "4 oz/yd2"
"""


def reported(
    command: str, scene: Path | str, capsys: pytest.CaptureFixture[str], *more: str
) -> str:
    with pytest.raises(SystemExit) as end:
        main([command, str(scene), *more])
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", ["modes", "info"])
def test_sheet_figures_have_si_and_textile_units(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "sheet.toml"
    scene.write_text(SHEET)
    figures: dict[str, Any] = json.loads(reported(command, scene, capsys, "--json"))
    assert figures["elements"] == "sheet"
    sheet = figures["sheet"]
    # A gf weighs 9.80665 mN; an ounce is 28.35 g, a yard 0.9144 m.
    assert sheet["tensile_rigidity"] == pytest.approx([9.80665, 9.80665])
    assert sheet["bending_rigidity"] == pytest.approx([1.96133e-5, 9.80665e-6])
    assert figures["poissons_ratios"] == pytest.approx([0.3, 0.3])  # the default of the solid
    assert sheet["areal_mass"] == pytest.approx(0.1356, rel=1e-3)
    # Peirce in centimetres: c³ = B/w, 0.2 gf cm over 13.56 mg/cm².
    assert sheet["bending_length"] == pytest.approx(
        [(b / 13.5623e-3) ** (1 / 3) / 100 for b in (0.2, 0.1)], rel=1e-5
    )
    text = " ".join(reported(command, scene, capsys).split())
    for line in (
        "cage elements sheet tensile rigidity 9.807 N/m (10 gf/cm) shear",
        "(0.5 gf/cm.deg)",
        "bending rigidity, warp 19.61 µN.m (0.2 gf.cm2/cm) bending rigidity, weft 9.807 µN.m",
        "bending length, warp 24.52 mm (2.452 cm)",
        "areal mass 135.6 g/m2 (4 oz/yd2)",
    ):
        assert line in text


def test_poissons_ratio_is_given_for_both_directions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "sheet.toml"
    scene.write_text(SHEET.replace('"10 gf/cm"', '["20 N/m", "10 N/m"]'))
    more = "--set", "modal.poissons_ratio_in_plane=0.4"
    text = " ".join(reported("info", scene, capsys, *more).split())
    assert "Poisson's ratio in plane, warp 0.4 Poisson's ratio in plane, weft 0.2" in text


@pytest.mark.parametrize("command", ["modes", "info"])
def test_tetrahedra_have_no_sheet_figures(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    figures = json.loads(reported(command, "plain_weave", capsys, "--json"))
    assert (figures["elements"], figures["sheet"]) == ("tetrahedra", None)
    assert "cage elements tetrahedra" in " ".join(reported(command, "plain_weave", capsys).split())


def test_still_fabric_has_no_cage_figures(capsys: pytest.CaptureFixture[str]) -> None:
    figures = json.loads(reported("info", "twill_2_2", capsys, "--json"))
    assert "elements" not in figures


def test_modes_report_the_hanging_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # A stiff one hardly: all of what hangs over the disc still casts its shadow.
    scene = tmp_path / "sheet.toml"
    scene.write_text(
        SHEET.replace('["0.2 gf.cm2/cm", "0.1 gf.cm2/cm"]', '"0.1 N.m"')
        + 'gravity = [0.0, 0.0, "-1 g"]\nfixed = "sphere(0, 0, 0, 2 mm)"\n'
    )
    text = reported("modes", scene, capsys)
    assert re.search(r"^drape coefficient +100\.0 % ± 0\.0 % \(Cusick\)", text, re.M)
    hung = json.loads(reported("modes", scene, capsys, "--json"))["hung"]
    assert hung["cloth_area"] == pytest.approx(25e-6)
    assert hung["shadow_area"] == pytest.approx(25e-6, rel=1e-4)
    assert 0.0 < hung["sag"] < 1e-6
    # On two places it is not Cusick's test; without gravity nothing hangs.
    assert "Cusick" not in reported("modes", scene, capsys, "--set", "modal.fixed=-x +x")
    flat = reported("modes", scene, capsys, "--json", "--set", "modal.gravity=[0,0,0]")
    assert json.loads(flat)["hung"] is None
