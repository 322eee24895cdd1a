"""The page that compares with measured cloth has the figures that the code gives."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.textile.weave.yarn_library import parse_yarn

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "explanation" / "measured_cloth.md").read_text("utf-8")

_spec = importlib.util.spec_from_file_location("measured_cloth", DOCS / "measured_cloth.py")
assert _spec is not None
assert _spec.loader is not None
measured_cloth = sys.modules["measured_cloth"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(measured_cloth)


def test_tables_of_the_page_are_those_of_the_script() -> None:
    for rows in (measured_cloth.table_of_fabrics(), measured_cloth.table_of_predictions()):
        assert "\n".join(rows) + "\n" in PAGE
    assert all(row in PAGE for row in measured_cloth.table_of_pressing())
    assert sum(row[2] for row in measured_cloth.CLASSES) == 618
    assert "tablecloth 9.6, denim 26.7, trousers 52.4 N/m" in PAGE
    shears = [FABRICS[name].sheet.membrane[2, 2] for name in ("tablecloth", "denim", "trousers")]
    assert shears == pytest.approx([9.6, 26.7, 52.4], abs=0.05)


def test_cotton_cloths_are_three_times_softer_than_fabrics_of_their_mass() -> None:
    """The sentence of the page, and that the model's trend with mass is nearly the measured one."""
    cotton = [p for p in measured_cloth.predictions() if "cotton" in p.name]
    ratios = [p.measured / p.free for p in cotton]
    assert [min(ratios), max(ratios)] == pytest.approx([3.0, 3.7], abs=0.06)
    stuck = [p.rigid / p.free for p in cotton]
    assert [min(stuck), max(stuck)] == pytest.approx([1.3, 1.7], abs=0.05)
    logarithms = np.log([[p.mass, p.free] for p in cotton]).T
    assert np.polyfit(*logarithms, 1)[0] == pytest.approx(measured_cloth.EXPONENT, abs=0.25)
    shears = [p.shear for p in cotton if "tex" in p.name]
    assert [min(shears), max(shears)] == pytest.approx([20, 35], abs=0.5)


def test_free_fibres_bend_as_round_beams() -> None:
    """Of 100 single fibres, each E π d⁴/64, from their count and density."""
    modulus, fineness = measured_cloth.FIBRES["cotton"]
    yarn = parse_yarn("17 tex cotton")
    density = yarn.material.density
    diameter = np.sqrt(4 * fineness / (np.pi * density))
    single = modulus * density * np.pi * diameter**4 / 64
    found = measured_cloth.free_fibre_rigidity(yarn)
    assert found == pytest.approx(yarn.linear_density / fineness * single)


def test_classes_lie_about_the_line() -> None:
    for low, high, _, least, middle, most in measured_cloth.CLASSES:
        line = measured_cloth.AT_150 * (np.sqrt(low * high) / 0.15) ** measured_cloth.EXPONENT
        assert least < line < most
        assert 0.5 < middle / line < 2
