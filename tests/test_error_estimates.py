"""Errors of figures, estimated from solutions in wider cells, against known errors."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from test_grips import SCENE as STRIP_IN_GRIPS

from spacemap_vtk import ModalSolver, TetraCage, connect
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.reactions import reactions_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.error_estimates import ErrorEstimates, estimate_errors
from spacemap_vtk.mechanics.modal.convergence import estimate_error, match_modes
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.units import format_errors, format_with_error

#: Λ = ω a² √(ρh/D) of a square plate clamped at one side, ν = 0.3 (Leissa, NASA SP-160).
LEISSA = (3.4917, 8.5246, 21.429, 27.331, 31.111, 54.443)
#: A square cloth of 300 mm, hung by two corners.
CORNERS: dict[str, Any] = {
    "weave": {"ends": 31, "picks": 31, "warp_spacing": 0.01, "weft_spacing": 0.01}
    | {"warp_diameter": 3e-4, "weft_diameter": 3e-4},
    "modal": {
        "elements": "sheet",
        "modes": 4,
        "tensile_rigidity": "1.5 kN/m",
        "shear_rigidity": "40 N/m",
        "bending_rigidity": "1 uN.m",
        "areal_mass": "150 g/m2",
        "gravity": [0.0, "-1 g", 0.0],
        "fixed": ["sphere(-0.15, 0.15, 0, 10 mm)", "sphere(0.15, 0.15, 0, 10 mm)"],
    },
}


def plate(cells: int, **values: Any) -> ErrorEstimates:
    """Estimate the errors of a square plate of 100 mm with so many cells along a side."""
    box = pv.Box((0.0, 0.1, 0.0, 0.1, 0.0, 3e-4))
    solver = ModalSolver(**{"elements": "sheet", "modes": 12, **values})
    connect(box, TetraCage(divisions=(cells, cells, 1)), solver)
    return estimate_errors(solver)


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_an_error_that_falls_as_a_power_is_bounded_by_the_estimate(order: float):
    for exact, share, ratios in ((1.0, 0.01, (2.0, 2.0)), (7.0, -0.02, (1.6, 2.2))):
        widths = (1.0, ratios[0], ratios[0] * ratios[1])
        fine, coarse, coarsest = (exact * (1 + share * width**order) for width in widths)
        found = estimate_error(fine, coarse, ratios[0], coarsest=coarsest, coarsest_ratio=ratios[1])
        assert found.error == pytest.approx(1.25 * abs(fine - exact))
        assert found.converged
        # Two solutions do not show the order.
        assert estimate_error(fine, coarse, 2.0).error == pytest.approx(abs(coarse - fine))


def test_an_estimate_without_an_order_is_larger():
    # A figure that goes to and fro, and one whose differences grow.
    assert estimate_error(1.0, 1.01, 2.0, coarsest=0.95).error == pytest.approx(0.03)
    assert estimate_error(1.0, 1.04, 2.0, coarsest=1.05).error == pytest.approx(0.04)
    # Where the figure is another one, at least the difference itself.
    assert estimate_error(1.0, 1.2, 2.0, same_state=False) == (pytest.approx(0.2), False)
    assert estimate_error(1.0, 1.001, 2.0, least=0.3) == (0.3, False)
    # The error of a vector is the size of a vector.
    found = estimate_error([1.0, 0.0], [1.0, 0.04], 2.0, coarsest=[1.0, 0.2])
    assert found.error == pytest.approx(1.25 * 0.04 / 3)


def test_modes_of_equal_frequency_are_found_however_they_are_mixed():
    generator = np.random.default_rng(1)
    shapes = np.linalg.qr(generator.normal(size=(30, 4)))[0].T.reshape(4, 10, 3)
    turned = shapes.copy()
    turned[1] = 0.6 * shapes[1] + 0.8 * shapes[2]
    turned[2] = 0.8 * shapes[1] - 0.6 * shapes[2]
    shares, eigenvalues = match_modes(
        turned[[3, 1, 2]], shapes, np.full(10, 2.0), np.array([1.0, 5.0, 5.0, 9.0])
    )
    np.testing.assert_allclose(shares, 1.0)
    np.testing.assert_allclose(eigenvalues, [9.0, 5.0, 5.0])


@pytest.mark.parametrize("cells", [8, 12])
def test_leissas_plate_is_within_the_stated_error(cells):
    found = plate(cells, fixed="-y")
    frequencies = found.modes.frequencies[: len(LEISSA)]
    rigidity, mass = 1e6 * 3e-4**3 / (12 * 0.91), 300.0 * 3e-4
    exact = np.array(LEISSA) / (2 * math.pi * 0.1**2) * math.sqrt(rigidity / mass)
    errors = np.abs(exact / frequencies - 1)
    stated = np.array([each.error for each in found.frequencies[: len(LEISSA)]])
    # Leissa's values are upper bounds, up to 0.6 % too high.
    assert (errors <= stated + 0.006).all()
    assert (stated < 4 * errors + 0.006).all()
    assert [each.converged for each in found.frequencies[:2]] == [True, True]


def test_simply_supported_plate_is_within_the_stated_error():
    """Of 20 modes that a closed form gives, among them many of equal frequency."""
    sides = [
        "+x:z",
        "-x:z",
        "+y:z",
        "-y:z",
        "sphere(0, 0, 0, 1 mm):xy",
        "sphere(0.1, 0, 0, 1 mm):y",
    ]
    found = plate(16, fixed=sides, modes=20, tensile_rigidity=1e6)
    rigidity, mass = 1e6 * 3e-4**3 / (12 * 0.91), 300.0 * 3e-4
    waves = sorted(m**2 + n**2 for m in range(1, 9) for n in range(1, 9))[:20]
    exact = math.pi / (2 * 0.1**2) * math.sqrt(rigidity / mass) * np.array(waves)
    errors = found.modes.frequencies / exact - 1
    stated = np.array([each.error for each in found.frequencies])
    assert (errors <= stated).sum() >= 18
    assert (stated[:8] < 4 * errors[:8]).all()


def test_block_of_tetrahedra_is_within_the_stated_error():
    box = pv.Box((0.0, 3.0, 0.0, 1.0, 0.0, 1.0))

    def cantilever(*divisions: int) -> ModalSolver:
        solver = ModalSolver(fixed="-x", modes=3, poissons_ratio=0.3)
        connect(box, TetraCage(divisions=divisions), solver)
        return solver

    found = estimate_errors(cantilever(9, 3, 3))
    fine = cantilever(18, 6, 6).update().output.GetFieldData().GetArray("frequencies")
    exact = np.array([fine.GetValue(k) for k in range(3)])
    errors = found.modes.frequencies / exact - 1
    stated = np.array([each.error for each in found.frequencies])
    assert (errors < stated).all()
    assert (stated < 4 * errors + 0.02).all()


def twisted_strip(cells: tuple[int, int], angle: int = 90) -> ErrorEstimates:
    """Turn the end of a strip of 200 x 20 mm, and hold its length."""
    solver = ModalSolver(
        elements="sheet",
        modes=1,
        fixed="-x",
        grips=[{"place": "+x", "center": [0.2, 0.0, 1e-4], "turns": [[f"{angle} deg", 0, 0]]}],
        tensile_rigidity=2e3,
        shear_rigidity=1e3,
        poissons_ratio_in_plane=0.0,
        bending_rigidity=2e-5,
        twisting_rigidity=1e-5,
        areal_mass=0.1,
        path_steps=4,
    )
    box = pv.Box((0.0, 0.2, -0.01, 0.01, 0.0, 2e-4))
    connect(box, TetraCage(divisions=(*cells, 1)), solver)
    return estimate_errors(solver)


@pytest.mark.parametrize(
    "cells", [(20, 2), pytest.param((40, 4), marks=pytest.mark.nightly)], ids=str
)
def test_moment_of_a_helicoid_is_within_the_stated_error(cells):
    """Fibres at x are stretched by x² θ²/2, with θ the twist per length: Wagner's effect."""
    found = twisted_strip(cells)
    twist, width = math.pi / 2 / 0.2, 0.02
    pull = 2e3 * twist**2 * width**3 / 24
    moment = 4e-5 * width * twist + 2e3 * twist**3 * width**5 / 160
    forces, moments = zip(
        *(
            (abs(grip.force[0]), abs(grip.moment[0]))
            for grip in (reactions_of(s.output)[-1] for s in (found.solver, *found.wider))
        ),
        strict=True,
    )
    # Ends that are held flat add a few per cent to the moment.
    assert forces[0] == pytest.approx(pull, rel=0.015)
    assert found.compare(*forces).converged
    assert not found.compare(*moments).converged
    assert abs(moments[0] - 1.03 * moment) < found.compare(*moments).error


@pytest.mark.parametrize("angle", [30, 90, 180])
@pytest.mark.parametrize(
    "cells",
    [(20, 2), *(pytest.param((20 * n, 2 * n), marks=pytest.mark.nightly) for n in (2, 4))],
    ids=str,
)
def test_moment_of_a_helicoid_is_as_stated_from_a_finer_one(
    cells: tuple[int, int], angle: int
) -> None:
    """Whose ends are flat, too: 160 x 16 and 80 x 8 cells, extrapolated by their order of 2."""
    finest = {30: 2.932e-6, 90: 2.641e-5, 180: 1.702e-4}[angle]
    found = twisted_strip(cells, angle)
    moments = [reactions_of(s.output)[-1].moment for s in (found.solver, *found.wider)]
    error, _ = found.compare(*moments)
    assert abs(moments[0][0] - finest) < error < 4 * abs(moments[0][0] - finest) + 0.01 * finest


def strip_on_a_table(cells: tuple[int, int]) -> tuple[ErrorEstimates, list[float]]:
    """Let a strip hang over the edge of a table, 40 mm from its end, and return its sag."""
    solver = ModalSolver(
        elements="sheet",
        modes=2,
        bending_length=0.03,
        tensile_rigidity=2e3,
        poissons_ratio_in_plane=0.0,
        areal_mass=0.2,
        gravity=[0.0, 0.0, -9.81],
        fixed="box(0, 40 mm, -1, 1, -1, 1)",
    )
    connect(pv.Box((0.0, 0.1, 0.0, 0.025, 0.0, 3e-4)), TetraCage(divisions=(*cells, 1)), solver)
    found = estimate_errors(solver)
    solved = (found.modes, *found.wider_modes)
    return found, [-float(modes.model.displacement[:, 2].min()) for modes in solved]


def test_support_that_ends_between_vertices_has_its_error_stated():
    """With 16 cells of 6.25 mm it holds 37.5 mm, with 20 cells 40 mm."""
    found, sags = strip_on_a_table((40, 10))
    finest = sags[0]
    assert found.compare(*sags).error < 0.01 * finest
    found, sags = strip_on_a_table((20, 5))
    assert abs(sags[0] - finest) < found.compare(*sags).error < 0.02 * finest
    found, sags = strip_on_a_table((16, 4))
    assert 0.04 * finest < abs(sags[0] - finest) < found.compare(*sags).error


@pytest.mark.parametrize("cells", [6, 12])
def test_cloth_hung_by_two_corners_in_wide_cells_is_not_converged(cells):
    """Its first frequency is 1.07, 0.97, 0.58 and 0.60 Hz with 6, 12, 24 and 40 cells."""
    scene = Scene({**CORNERS, "cage": {"divisions": [cells, cells, 1]}})
    figures = report_modes(scene, True)
    first = figures["modes"][0]
    assert not first["converged"]
    assert abs(first["frequency_hz"] - 0.6007) < first["error"] * first["frequency_hz"]
    # Each support holds one vertex of these cages, where it holds 15 mm of each side of the cloth.
    moment = figures["reactions"][0]
    assert np.linalg.norm(moment["moment"]) < 0.1 * moment["moment_error"]
    assert moment["moment_error"] == pytest.approx(0.0075 * np.linalg.norm(moment["force"]))
    (warning,) = (text for text in figures["warnings"] if "too wide" in text)
    assert "the frequencies of modes 1 to 4 (± " in warning
    assert "the sag (± " in warning
    assert "increase cage.divisions, for example to [" in warning


@pytest.mark.nightly
@pytest.mark.parametrize("cells", [[10, 12, 1], [28, 36, 1]], ids=str)
def test_drape_coefficient_has_an_error_that_covers_finer_cells(cells: list[int]):
    scene = Scene.read("drape")
    scene.set(f"cage.divisions={cells}")
    scene.set("modal.modes=2")
    hung = report_modes(scene, True)["hung"]
    assert abs(hung["drape_coefficient"] - 0.105) < hung["drape_coefficient_error"]
    assert not hung["converged"]
    assert any("the drape coefficient (± " in text for text in scene.warnings)


def test_a_flat_hanging_cloth_needs_no_cells_for_folds():
    """Its cells are three bending lengths wide."""
    modal = {**CORNERS["modal"], "fixed": "+y", "modes": 3}
    scene = Scene({**CORNERS, "modal": modal, "cage": {"divisions": [12, 12, 1]}})
    figures = report_modes(scene, True)
    assert [mode["converged"] for mode in figures["modes"]] == [True] * 3
    assert figures["hung"]["sag_error"] < 0.05 * figures["hung"]["sag"]


def test_cages_without_a_coarser_one_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="only one cell"):
        plate(1)
    cage = connect(pv.Box(), TetraCage(divisions=(2, 2, 2))).update().output
    pv.wrap(cage).save(tmp_path / "cage.vtu")
    solver = ModalSolver(modes=1)
    connect(pv.Box(), TetraCage(method="file", file=tmp_path / "cage.vtu"), solver)
    with pytest.raises(InputError, match="from a file"):
        estimate_errors(solver)
    alone = ModalSolver(modes=1)
    alone.SetInputDataObject(cage)
    with pytest.raises(InputError, match="TetraCage"):
        estimate_errors(alone)


def test_commands_print_errors(capsys: pytest.CaptureFixture[str]):
    def run(*words: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["modes", "gust", "--set", "modal.modes=4", *words])
        assert not ended.value.code
        return capsys.readouterr().out

    # With 24 x 24 cells it is 21.68 Hz.
    assert "21.78 ± 0.40" in " ".join(run().split())
    figures = json.loads(run("--json"))
    assert figures["errors_missing"] is None
    assert 0.0 < figures["modes"][0]["error"] < 0.02
    assert figures["modes"][0]["converged"] is True
    assert "±" not in run("--no-errors")
    figures = json.loads(run("--json", "--no-errors"))
    assert figures["modes"][0]["error"] is None
    assert figures["errors_missing"]


def test_info_prints_the_errors_of_forces_that_modes_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    scene = tmp_path / "strip.toml"
    scene.write_text(STRIP_IN_GRIPS, encoding="utf-8")

    def run(command: str, *words: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main([command, str(scene), "--set", "modal.poissons_ratio_in_plane=0.3", *words])
        assert not ended.value.code
        return " ".join(capsys.readouterr().out.split())

    figures, modes = (json.loads(run(command, "--json")) for command in ("info", "modes"))
    for key in ("reactions", "errors_missing"):
        assert figures[key] == modes[key]
    assert figures["reactions"][0]["force_error"] > 0.0
    assert "N ±" in run("info")
    assert "N ±" not in run("info", "--no-errors")
    figures = json.loads(run("info", "--json", "--no-errors"))
    assert figures["reactions"][0]["force_error"] is None
    assert figures["errors_missing"] == "none were asked for"


def test_errors_are_rounded_up_to_the_digits_of_their_figure():
    assert format_errors(["1.20", "12.34"], [0.031, None]) == ["1.20 ± 0.04", "12.34 ±    –"]
    assert format_errors(["1.20"], [None]) == ["1.20"]
    assert format_with_error(0.30264, 0.0041, "m") == "302.6 ± 4.1 mm"
    assert format_with_error(0.30264, 1e-9, "m") == "302.6 ± 0.1 mm"
    assert format_with_error(0.30264, None, "m") == "302.6 mm"
    assert format_with_error(2.0, 31.0, "N") == "2 ± 31 N"
