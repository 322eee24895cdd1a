"""Numbers without a unit, and the units that handweavers and textile laboratories write."""

from __future__ import annotations

import math
from typing import Any

import pytest

from spacemap_vtk.app.fields.parameter_info import add_shown_unit
from spacemap_vtk.app.web.parameter_rows import ParameterRows
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.load import Load
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.scenes.assignments import parse_value_list
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import make_record, scene_values
from spacemap_vtk.textile.weave.yarn import parse_yarn_count

INCH = 0.0254


@pytest.mark.parametrize(
    ("assignment", "parts"),
    [
        ("weave.warp_sett=24", ["24 /m", '"24 /cm" or "24 epi"', '"24 /m"']),
        ("weave.weft_sett=20", ["20 /m", '"20 /cm" or "20 ppi"']),
        ("weave.warp_diameter=0.3", ["300 mm", "1 µm to 20 mm", '"0.3 mm"']),
        ("weave.weft_diameter=[0.0003, 0.3]", ["weft_diameter = 0.3", '"0.3 mm"']),
        ("weave.warp_spacing='0.5, 0.6'", ["500 mm", '"0.5 mm"']),
        ("weave.warp_count=20", ['"20 tex" or "20 Ne" or "20 Nm"']),
        ("weave.warp_crimp_height=0.2", ["200 mm", '"0.2 mm"']),
        ("weave.overhang=2", ["2 m", '"2 mm"']),
        ("weave.layer_gap=0.1", ["100 mm", '"0.1 mm"']),
        ("modal.bending_length=2", ["2 m", '"2 cm"']),
        ("modal.thickness=0.3", ["300 mm", '"0.3 mm"']),
        ("weave.warp_spacing=linspace(0.4, 0.6, 3)", ["400 mm", '"0.4 mm"']),
    ],
)
def test_implausible_number_without_a_unit_is_refused(assignment: str, parts: list[str]) -> None:
    scene = Scene({})
    key = assignment.partition("=")[0]
    with pytest.raises(InputError) as refused:
        scene.assign(*key.split("."), *parse_value_list(assignment, scene.parts).values)
    text = str(refused.value)
    assert text.startswith(key)
    assert "without a unit" in text
    for part in parts:
        assert part in text


def test_scene_file_and_set_refuse_the_same_numbers() -> None:
    with pytest.raises(InputError, match=r"weave\.warp_sett = 24: without a unit"):
        Scene({"weave": {"warp_sett": 24}})
    with pytest.raises(InputError, match=r"weave\.warp_sett = 24: without a unit"):
        Scene({}).set("weave.warp_sett=24")


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("warp_diameter", 0.00025, 0.00025),
        ("warp_diameter", "0.3 m", 0.3),  # with its unit it is what it says
        ("warp_sett", 2000, 2000.0),
        ("warp_sett", "24 /m", 24.0),
        ("warp_sett", "24 epi", 24 / INCH),
        ("weft_sett", "20ppi", 20 / INCH),
        ("warp_count", 3e-5, 3e-5),
    ],
)
def test_plausible_si_numbers_and_units_are_accepted(key: str, value: Any, expected: float) -> None:
    scene = Scene({"weave": {key: value}})
    assert getattr(scene.source, key) == pytest.approx(expected, rel=1e-14)


def test_count_with_plies_is_a_cotton_count() -> None:
    # 840 yards of Ne 1 weigh a pound
    hank = 0.45359237 / (840 * 0.9144)
    assert parse_yarn_count("20/2") == pytest.approx(hank / 10, rel=1e-12)
    assert parse_yarn_count("20/2") == parse_yarn_count("Ne 20/2")
    assert parse_yarn_count("8/2") == parse_yarn_count("Ne 4")
    assert Scene({"weave": {"warp_count": "8/2"}}).source.warp_count == parse_yarn_count("8/2")
    with pytest.raises(InputError, match='"Nm 28/2" or "Ne 28/2"'):
        parse_yarn_count("2/28")
    assert "cotton" in Scene({}).source.parameter("warp_count").allowed


def test_record_writes_implausible_values_with_their_unit() -> None:
    odd = 0.1 + 0.2  # seventeen digits
    written = {"warp_diameter": [f"{odd} m", "0.4 m"], "warp_spacing": f"{3 * odd} m"}
    scene = Scene({"weave": written})
    again = Scene(scene_values(scene))
    assert again.source.warp_diameter == scene.source.warp_diameter == (odd, 0.4)
    assert again.source.warp_spacing == scene.source.warp_spacing
    assert "0.4 m" in make_record(scene, {}, ()).scene.replace("400 mm", "0.4 m")


def test_sweep_writes_large_diameters_with_their_unit() -> None:
    scene = Scene({})
    values = parse_value_list("weave.warp_diameter=linspace(200 mm, 400 mm, 3)", scene.parts).values
    for value, expected in zip(values, (0.2, 0.3, 0.4), strict=True):
        scene.assign("weave", "warp_diameter", value)
        assert scene.source.warp_diameter == expected


def test_shear_stiffness_of_kawabata_is_per_degree() -> None:
    for text in ("1 gf/(cm.deg)", "1 gf/(cm·degree)", "1 gf/cm.deg", "1 gf/cm/deg", "1 gf/(cm*°)"):
        solver = ModalSolver(shear_rigidity=text)
        assert solver.shear_rigidity == pytest.approx(56.19, abs=0.005)
    with pytest.raises(InputError, match=r"per degree.*0\.8 gf/\(cm\.deg\).*0\.784532 N/m") as no:
        ModalSolver(shear_rigidity="0.8 gf/cm")
    assert "gf/cm," not in str(no.value.allowed)
    assert ModalSolver(tensile_rigidity="1 gf/cm").tensile_rigidity == 0.980665


def test_phase_without_a_unit_is_in_degrees() -> None:
    load = {"pressure": 1.0, "on": "+z", "time": "harmonic", "frequency": 1.0}
    for phase in (90, "90 deg", f"{math.pi / 2} rad"):
        made = Load(**load, phase=phase)
        assert made.function.value(1e-12) == pytest.approx(1.0)
    assert "in degrees unless it has a unit" in Load.parameter("phase").describe()
    loads = Scene({}).response.parameter("loads")
    assert "phase (in degrees unless it has a unit)" in loads.describe()


@pytest.mark.parametrize(
    ("typed", "shown", "unit", "expected"),
    [
        ("0.3", "0.25 mm", "m", "0.3 mm"),
        ("0.3 m", "0.25 mm", "m", "0.3 m"),
        ("2, 3", "0.25 mm, 400 um", "m", "2 mm, 3 um"),
        ("1,2,3", "0.25 mm, 400 um", "m", "1 mm, 2 um, 3 um"),
        ("20", "20 /cm", "1/m", "20 /cm"),
        ("500", "600 Z", "1/m", "500"),
        ("0.3", "from the spacing", "m", "0.3"),
        ("0.3", "", "m", "0.3"),
        ("auto", "0.25 mm", "m", "auto"),
        ("0.4", "0.3", "", "0.4"),
    ],
)
def test_typed_number_has_the_unit_of_its_field(
    typed: str, shown: str, unit: str, expected: str
) -> None:
    assert add_shown_unit(typed, shown, unit) == expected


def test_typed_number_in_a_browser_has_the_unit_of_its_row() -> None:
    values = {"weave": {"warp_diameter": "0.25 mm", "warp_spacing": "0.6 mm"}}
    scene, rows = Scene(values), ParameterRows()
    rows.make_sections(scene, values)
    assert rows.parse_text("weave.warp_diameter", "0.3") == "0.3 mm"
    assert rows.parse_text("weave.warp_diameter", "0.3 um") == "0.3 um"
    # automatic: the value in force stands in the row
    assert rows.parse_text("weave.weft_spacing", "1") == "1 mm"
    assert rows.parse_text("weave.ends", "9") == 9
    assert rows.parse_text("weave.warp_crimp", "0.1") == 0.1
