"""Limits of models: each has a source that is true, is measured by a stage, and warns beyond it."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from test_equilibrium import BENDING, WEIGHT, sheet, strip, tip_position

from spacemap_vtk.applicability import LIMITS, Finding, Limit, LimitWarning, add_warning
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.deformation import (
    find_tightest_fold,
    largest_stretch,
    shear_angles,
)
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.scenes.pipeline import section_classes
from spacemap_vtk.scenes.report import report_fabric
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

ROOT = Path(__file__).parents[1]

SHEET = """
[weave]
pattern = "plain"
ends = 12
picks = 12
warp_spacing = "8 mm"
weft_spacing = "8 mm"
warp_diameter = "{diameter} mm"
weft_diameter = "{diameter} mm"
[cage]
divisions = [6, 6, 1]
[modal]
elements = "sheet"
tensile_rigidity = "{stretch} N/m"
shear_rigidity = "{shear} N/m"
poissons_ratio_in_plane = 0.0
bending_rigidity = "{bending} uN.m"
areal_mass = "150 g/m2"
gravity = {gravity}
fixed = "{fixed}"
modes = 3
[response]
"""


def findings(tmp_path: Path, more: str = "", **values: object) -> dict[str, Finding]:
    """Return what a scene with a sheet finds, by the names of the limits."""
    usual = {
        "diameter": 1,
        "stretch": 2000,
        "shear": 40,
        "bending": 8,
        "gravity": '[0.0, "-1 g", 0.0]',
        "fixed": "+y",
    }
    file = tmp_path / "scene.toml"
    file.write_text(SHEET.format(**usual | values) + more, encoding="utf-8")
    scene = Scene.read(file)
    scene.update(0.0)
    found = {each.key: each for stage in scene.stages for each in stage.findings}
    texts = [text for text in scene.warnings if isinstance(text, LimitWarning)]
    assert {text.key for text in texts} == {k for k, each in found.items() if not each.is_valid}
    return found


@pytest.mark.parametrize("key", LIMITS)
def test_each_limit_is_complete_and_is_measured(key: str) -> None:
    limit = LIMITS[key]
    assert limit.stage in section_classes()
    assert "{}" in limit.found or not limit.quantity
    for name in re.findall(r"`(tests/\w+\.py)`", limit.basis):
        assert (ROOT / name).is_file()
    calls = "\n".join(f.read_text("utf-8") for f in (ROOT / "spacemap_vtk/filters").glob("*.py"))
    assert re.search(rf'check_limit\(\s*"{key}"', calls)


def test_a_warning_names_value_limit_consequence_and_cure() -> None:
    text = LIMITS["rotation"].warning(math.radians(30))
    assert text == (
        "the cage turns by up to 30°, but a linear motion is valid up to 20°: it stretches parts "
        "that turn; add a section [rotation] (RotationStrain), or lower the load"
    )


def test_of_several_warnings_about_a_limit_the_worst_stays() -> None:
    known: dict[str, str] = {}
    for value in (0.5, 0.9, 0.7):
        text = LimitWarning(LIMITS["rotation"].warning(value), "rotation", value)
        add_warning(known, pickle.loads(pickle.dumps(text)))  # from another process
    add_warning(known, "another")
    assert list(known.values()) == [LIMITS["rotation"].warning(0.9), "another"]


@pytest.mark.parametrize(
    ("length", "cells", "wrong"),
    [(4, 8, 0.02), pytest.param(7.3211, 20, 0.0055, marks=pytest.mark.nightly)],
)
def test_folds_within_the_limit_are_right_within_two_percent(
    length: float, cells: int, wrong: float
) -> None:
    """A hanging strip of some bending lengths: the error of its end, and the turn in a cell."""
    ends, turns = [], []
    for number in (cells, 2 * cells):
        made, held = strip(length, number)
        found = made.equilibrium(held, (0, 0, -WEIGHT))
        ends.append(tip_position(made, found))
        order = np.argsort(made.middle[:, 0], kind="stable")[::2]
        normals = found.positions[len(made.middle) :][order]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        turns.append(np.arccos((normals[1:] * normals[:-1]).sum(axis=1)).max())
    exact = ends[1] + (ends[1] - ends[0]) / 3  # errors fall with the square of the cells
    assert turns[0] == pytest.approx(LIMITS["fold"].most, rel=0.06)
    assert np.linalg.norm(ends[0] - exact) == pytest.approx(wrong, rel=0.25)


def test_normals_lean_aside_in_cells_that_are_long_beside_a_fold() -> None:
    """Bent to a radius of 20 mm in cells 120 mm wide: aside, normals save most of the energy."""
    radius, length, width = 0.02, 0.03, 0.12
    made = sheet((length, width), (3, 1))
    count = len(made.middle)
    angle, half = made.middle[:, 0] / radius, made.start[count:, 2:]
    around = np.stack([np.sin(angle), 0 * angle, 1 - np.cos(angle)], axis=1)
    # Chords are as long as the cells, so that nothing is stretched.
    middle = radius * 0.25 / math.sin(0.25) * around + made.middle * [0, 1, 0]
    upright = half * np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    side = np.where(made.middle[:, 1] > width / 2, 1.0, -1.0)
    aside = half * side[:, None] * [0, 1, 0]
    bent, leaning = (
        sum(each.energy(np.concatenate([middle, normals])) for each in made.strains)
        for normals in (upright, aside)
    )
    exact = BENDING * length * width / (2 * radius**2)
    assert bent == pytest.approx(exact, rel=0.05)
    assert leaning < 0.2 * bent
    # Reversed from one line of vertices to the next, they cost nothing in cells of any width.
    turned = sum(
        each.energy(np.concatenate([middle, side[:, None] * upright])) for each in made.strains
    )
    assert turned == pytest.approx(bent / 3, rel=0.01)
    points, cells = build_lattice((0, length, 0, width, -half[0, 0], half[0, 0]), (3, 1, 1))
    surface = find_mid_surface(points, cells)
    assert surface is not None
    for normals, lean in ((upright, 0.25), (aside, math.pi / 2)):
        moved = surface.to_vertices(np.concatenate([middle, normals]))
        fold = find_tightest_fold(points, moved, surface)
        assert fold.lean == pytest.approx(lean)
        assert fold.turn == pytest.approx(0.5 if lean < 1 else math.pi)


def test_linear_laws_differ_by_15_percent_at_the_limit() -> None:
    """Nominal force of a bar for a modulus of 1: linear in nominal, Green's, logarithmic strain."""

    def green(stretch: float) -> float:
        return stretch * (stretch**2 - 1) / 2

    most = LIMITS["strain"].most
    assert green(1 + most) / most == pytest.approx(1.155)
    assert math.log(1 + most) / (1 + most) / most == pytest.approx(0.866, abs=1e-3)
    softest = brentq(lambda x: green(x + 1e-6) - green(x - 1e-6), 0.3, 0.9)
    assert 1 - softest == pytest.approx(0.42, abs=0.003)


@pytest.mark.parametrize(("share", "low"), [(0.1, 0.11), (1 / 3, 0.38)])
def test_linear_cloth_pulls_too_little(share: float, low: float) -> None:
    """A free strip of the plain cloth of 20 tex: the energy of its yarns, and its tangent."""
    threads = Threads(diameter=0.167e-3, spacing=0.4e-3)
    cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    yarns = Interchange(cloth, YarnMechanics((60.0, 60.0), 9.0, (1e-9, 1e-9)))

    def forces(strain: float, across: float) -> np.ndarray:
        stretch = np.ones((2, *yarns.shape))
        stretch[0] += strain
        stretch[1] += across
        return yarns.forces(stretch).force.sum(axis=(1, 2))

    tangent = yarns.forces(np.ones((2, *yarns.shape))).tangent.sum(axis=(2, 3))
    crimp = float(yarns.solve(np.ones((2, *yarns.shape))).crimp.mean())
    strain = share * crimp
    across = brentq(lambda x: forces(strain, x)[1], -3 * strain, 0)
    linear = strain * (tangent[0, 0] - tangent[0, 1] ** 2 / tangent[1, 1])
    assert 1 - linear / forces(strain, across)[0] == pytest.approx(low, abs=0.03)


def test_order_of_rotation_and_strain_matters_by_their_product() -> None:
    generator = np.random.default_rng(3)
    for _ in range(20):
        skew, sym = generator.normal(size=(2, 3, 3))
        skew, sym = 0.2 * (skew - skew.T), 0.02 * (sym + sym.T)
        apart = np.linalg.norm(expm(skew) @ (np.eye(3) + sym) - expm(skew + sym), 2)
        angle, strain = np.linalg.norm(skew, 2), np.linalg.norm(sym, 2)
        assert apart < angle * strain + strain**2


def test_strains_of_a_known_deformation() -> None:
    shear, stretch = math.radians(20), 1.2
    first, other = stretch * np.array([1, 0]), np.array([math.sin(shear), math.cos(shear)])
    strain = np.array(
        [[(first @ first - 1) / 2, (other @ other - 1) / 2, 0, 0, 0, first @ other]], dtype=float
    )
    assert shear_angles(strain) == pytest.approx(shear)
    singular = np.linalg.svd(np.column_stack([first, other]), compute_uv=False)
    assert largest_stretch(strain, True) == pytest.approx(abs(singular - 1).max())
    assert largest_stretch(strain, False) == pytest.approx(abs(singular - 1).max())


def test_a_stiff_sheet_is_within_all_limits(tmp_path: Path) -> None:
    assert all(each.is_valid for each in findings(tmp_path).values())


@pytest.mark.parametrize(
    ("keys", "values"),
    [
        (("strain", "embedded"), {"stretch": 1}),
        (
            ("fold", "thick_fold"),
            {"gravity": '[0.0, 0.0, "-1 g"]', "bending": 0.02, "diameter": 4.5},
        ),
        (
            ("locked",),
            {"fixed": "-x", "shear": 0.1, "diameter": 4.5},
        ),
    ],
)
def test_a_sheet_beyond_a_limit_is_reported(
    keys: tuple[str, ...], values: dict[str, object], tmp_path: Path
) -> None:
    """Nothing of this was reported once."""
    found = findings(tmp_path, **values)
    assert not any(found[key].is_valid for key in keys)


@pytest.mark.nightly
def test_a_thin_rod_under_wide_cells_is_reported(tmp_path: Path) -> None:
    rod = """
[[modal.obstacles]]
shape = "cylinder"
radius = "{} mm"
height = "200 mm"
axis = [1.0, 0.0, 0.0]
center = [0.0, 0.0, "-{} mm"]
"""
    for radius, valid in ((20, True), (6, False)):
        turned = {"gravity": '[0.0, 0.0, "-1 g"]', "bending": 20, "fixed": "+y"}
        found = findings(tmp_path, rod.format(radius, radius + 2), **turned)
        assert found["obstacle"].value == pytest.approx(16 / radius, rel=0.1)
        assert found["obstacle"].is_valid == valid


def test_info_lists_limits_and_values(tmp_path: Path) -> None:
    found = findings(tmp_path, gravity='[0.0, 0.0, "-1 g"]', bending=50)
    rows = {
        row["limit"]: row
        for row in report_fabric(Scene.read(tmp_path / "scene.toml"))["applicability"]
    }
    assert rows["fold"]["valid"] is True
    assert rows["fold"]["value"] == pytest.approx(found["fold"].value)
    assert 0.1 < rows["fold"]["value"] < rows["fold"]["most"] == pytest.approx(math.radians(60))
    assert set(Limit._fields) - {"found"} < set(rows["fold"])
