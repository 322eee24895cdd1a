"""Each test of the laboratory against a closed form of its own law, and its definition."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from math import atan, cos, inf, pi, radians, sin, sqrt, tan
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from scipy.integrate import solve_bvp

from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.figure.measurement_film import draw_cloth
from spacemap_vtk.errors import InputError
from spacemap_vtk.laboratory import (
    bending,
    bias,
    biaxial,
    cantilever,
    drape,
    records,
    shear,
    tensile,
)
from spacemap_vtk.laboratory.catalogue import TESTS, find_test
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.mechanics.elements.membrane_law import LinearLaw
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.textile.crimp.cloth_law import cloth_law
from spacemap_vtk.textile.crimp.contact_law import ContactLaw, VanWykContact
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads
from spacemap_vtk.units import parse_quantity

#: Crossings that pressure flattens.
SOFT = (
    *("--set", "yarns.flattest=0.5", "--set", "yarns.contact=5 mN"),
    *("--set", "yarns.bending=2 mN.mm2"),
)
#: A linear sheet: 1 along the weft, 2 along the warp.
PLATE = Plate(
    np.array([[4000.0, 600.0, 0.0], [600.0, 6000.0, 0.0], [0.0, 0.0, 30.0]]),
    np.diag([5e-6, 8e-6, 2e-6]),
)
FABRIC = Fabric(PLATE, 0.4e-3, 0.15)


def test_units_of_the_instruments() -> None:
    assert records.GF_PER_CM_DEGREE.size == pytest.approx(56.19, abs=5e-3)
    assert records.GF_CM2_PER_CM.size == pytest.approx(98.07e-6, abs=5e-9)
    assert 500 * records.GF_PER_CM.size == pytest.approx(490.3, abs=0.05)
    for unit, of, name in (
        (records.GF_PER_CM, "N/m", "gf/cm"),
        (records.GF_PER_CM_DEGREE, "N/m", "gf/cm/deg"),
        (records.GF_CM2_PER_CM, "N.m", "gf.cm2/cm"),
    ):
        assert unit.size == pytest.approx(parse_quantity(f"1 {name}", of), rel=1e-15)


def test_bending_of_a_constant_rigidity_is_a_line() -> None:
    found = find_test("bending").measure(FABRIC)
    for direction, rigidity in (("warp", 8e-6), ("weft", 5e-6)):
        assert found.reading("B", direction).value == pytest.approx(rigidity, rel=1e-12)
    assert found.curves[0].y[-1] == pytest.approx(8e-6 * 250.0)
    assert found.reading("2HB", "warp").text == "not modelled"


def test_bending_slope_leaves_a_constant_couple_of_friction_out() -> None:
    curvature = np.linspace(-250.0, 250.0, 501)
    moment = 1e-5 * curvature + 1e-3 * np.sign(curvature)
    assert bending.mean_slope(curvature, moment) == pytest.approx(1e-5, rel=1e-12)


def test_bent_specimen_is_an_arc() -> None:
    """Its lines keep their length, and its ends differ by the angle κ L."""
    states = find_test("bending").measure(FABRIC).states
    assert states is not None
    moved = states.points + states.displacements[15]  # the largest curvature
    middle = (moved[: len(moved) // 2] + moved[len(moved) // 2 :]) / 2
    line = middle.reshape(25, 5, 3)[:, 0]
    assert np.linalg.norm(line[-1] - line[0]) == pytest.approx(2 * sin(1.25) / 250.0, rel=1e-9)


def test_strip_slopes_by_41_degrees_at_twice_its_bending_length() -> None:
    """The number is that of an elastica solved as a boundary value problem."""
    strip = cantilever.find_strip(cantilever.CHORD)
    assert strip.length == pytest.approx(2.00035, abs=1e-5)
    arc = np.linspace(0.0, strip.length, 41)
    solved = solve_bvp(
        lambda s, y: np.stack([y[1], -(strip.length - s) * np.cos(y[0])]),
        lambda start, end: np.array([start[0], end[1]]),
        arc,
        np.stack([0.5 * arc, np.full_like(arc, 0.5)]),
        tol=1e-9,
    )
    slope = solved.sol(np.linspace(0.0, strip.length, 2001))[0]
    step = strip.length / 2000
    run, fall = (((f[1:] + f[:-1]) / 2).sum() * step for f in (np.cos(slope), np.sin(slope)))
    assert np.arctan2(fall, run) == pytest.approx(cantilever.CHORD, abs=1e-6)
    assert strip.places[-1] == pytest.approx([run, fall], abs=1e-6)


def test_peirces_formula_is_right_within_two_percent() -> None:
    """It is an approximation of the elastica."""
    for degrees, error in ((10.0, 0.012), (41.5, 0.021)):
        strip = cantilever.find_strip(radians(degrees))
        peirce = cantilever.peirce_length(strip.length, radians(degrees))
        assert peirce == pytest.approx(1.0, abs=error)


def test_cantilever_reads_the_rigidity() -> None:
    """168 g/m² with a bending length of 15 mm: 5.56 µN·m (Ly and others, 1991)."""
    fabric = Fabric(Plate(PLATE.membrane, np.diag([5.56e-6, 5.56e-6, 1e-6])), 4e-4, 0.168)
    found = find_test("cantilever").measure(fabric)
    assert found.reading("c", "warp").value == pytest.approx(15e-3, rel=1e-3)
    assert found.reading("B", "overall").value == pytest.approx(5.56e-6, rel=1e-3)
    with pytest.raises(InputError, match="weight bends it"):
        find_test("cantilever").measure(Fabric(PLATE, 4e-4))


def test_biaxial_pull_of_a_linear_sheet() -> None:
    """F = λ (A e) with e = (λ² - 1)/2, at 500 gf/cm."""
    found = find_test("biaxial").measure(FABRIC)
    for direction, stiffness in (("warp, held", 6000.0), ("weft, held", 4000.0)):
        extension = found.reading("EMT", direction).value
        assert extension is not None
        stretch = 1 + extension
        assert stiffness * stretch * (stretch**2 - 1) / 2 == pytest.approx(biaxial.LARGEST)
        work = stiffness * (stretch**2 - 1) ** 2 / 8
        assert found.reading("WT", direction).value == pytest.approx(work, rel=1e-4)
    both = found.reading("EMT", "warp, 1:1").value
    assert both is not None
    assert 6600.0 * (1 + both) * (both + both**2 / 2) == pytest.approx(biaxial.LARGEST)


def test_shear_force_follows_from_the_energy_and_the_pretension() -> None:
    """With the shear stiffness alone: F = G λ sin φ + W tan φ."""
    stiff = Plate(np.diag([1e9, 1e9, 30.0]), PLATE.bending)
    angles = np.radians([-8.0, 1.0, 5.0])
    force = shear.shear_forces(Fabric(stiff, 4e-4), angles)
    expected = 30.0 * np.sin(angles) + shear.PRETENSION * np.tan(angles)
    assert force == pytest.approx(expected, rel=1e-6)
    assert shear.PRETENSION * tan(radians(1.0)) / records.GF_PER_CM.size == pytest.approx(
        0.175, abs=5e-4
    )


def test_shear_force_is_the_derivative_of_the_energy() -> None:
    """Of strain and weight together, by the place of the upper clamp."""
    angle, weight = radians(6.0), shear.PRETENSION

    def energy(u: float, v: float) -> float:
        strain = np.array([0.0, (u * u + v * v - 1) / 2, u])
        return float(strain @ PLATE.membrane @ strain) / 2 - weight * v

    force = float(shear.shear_forces(FABRIC, np.array([angle]))[0])
    # Newton's steps for v at the given angle
    stretch = 1.0
    for _ in range(20):
        e22 = (stretch**2 - 1) / 2
        stretch -= (6000.0 * e22 * stretch * cos(angle) - weight) / 6000.0
    u, v, step = stretch * sin(angle), stretch * cos(angle), 1e-7
    assert (energy(u, v + step) - energy(u, v - step)) / (2 * step) == pytest.approx(0.0, abs=1e-4)
    assert (energy(u + step, v) - energy(u - step, v)) / (2 * step) == pytest.approx(
        force, rel=1e-5
    )


def test_shear_figure_contains_the_pretension() -> None:
    found = find_test("shear").measure(FABRIC)
    rigidity = found.reading("G", "warp").value
    assert rigidity == pytest.approx(30.0 + shear.PRETENSION, rel=2e-3)
    assert found.reading("2HG5", "weft").text == "not modelled"


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(test.name, marks=[pytest.mark.nightly] * (test.name == "drape"))
        for test in TESTS
    ],
)
def test_every_test_states_what_it_prints(name: str) -> None:
    test = find_test(name)
    if name == "compression":
        with pytest.raises(InputError, match="whose yarns are known"):
            test.measure(FABRIC)
        return
    found = test.measure(FABRIC)
    printed = set(test.prints.split(", ")) - {"B_rigid"}  # which only cloth from yarns has
    assert {reading.symbol for reading in found.readings} == printed
    for reading in found.readings:
        if reading.value is not None and reading.symbol != "nodes":
            assert reading.exact != (reading.error is not None)
    assert found.states is None or np.isfinite(found.states.displacements).all()


def test_figures_on_cells_have_errors_and_others_are_exact() -> None:
    def readings(width: float) -> list[records.Reading]:
        values = 5.0 + 0.1 * width**2, 7.0, None
        return [
            records.Reading(symbol, "", "warp", value, records.PURE)
            for symbol, value in zip(("EMT", "Fs", "RT"), values, strict=True)
        ]

    (first, second, third), notes = records.add_errors(*(readings(width) for width in (1, 2, 4)))
    assert first.error == pytest.approx(1.25 * 0.1)
    assert (first.text, second.text) == ("5.10 ± 0.13", "7 (exact)")
    assert (second.error, third.error, third.exact) == (None, None, False)
    assert (first.as_json()["exact"], second.as_json()["exact"]) == (False, True)
    assert notes == []
    (first, *_), notes = records.add_errors(readings(1), readings(2))
    assert first.error == pytest.approx(3 * 0.1)
    assert notes == ["the cells are too wide for EMT warp (± above 5 %)"]


def test_command_prints_the_figures(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["measure", "yarn_to_cloth", "--test", "cantilever", "--json"])
    assert ended.value.code == 0
    tests = json.loads(capsys.readouterr().out)["tests"]
    assert list(tests) == ["cantilever"]
    (figure,) = (
        figure
        for figure in tests["cantilever"]["figures"]
        if (figure["symbol"], figure["direction"]) == ("c", "warp")
    )
    assert figure["value"] == pytest.approx(14.2, abs=0.1)  # as the scene says
    assert figure["unit"] == "mm"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["plain_weave", "--test", "shear"], "yarns.modulus"),
        (["yarn_to_cloth", "--test", "bendin"], 'Did you mean "bending"?'),
        (["yarn_to_cloth", "--test", "shear", "-o", "a.xyz"], ".csv"),
    ],
)
def test_command_refuses(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["measure", *words])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


def test_command_writes_the_curve(tmp_path: Path) -> None:
    file = tmp_path / "shear.csv"
    with pytest.raises(SystemExit) as ended:
        main(["measure", "yarn_to_cloth", "--test", "shear", "-o", str(file), "-q"])
    assert ended.value.code == 0
    heading, *rows = file.read_text().splitlines()
    assert heading.split(",")[1:3] == ["shear angle [°]", "shear force per width [gf/cm]"]
    values = np.array([row.split(",")[1:] for row in rows], float)
    assert values[:, 2] == pytest.approx(values[:, 0] * pi / 180, abs=1e-9)
    assert values[:, 3] == pytest.approx(values[:, 1] * 0.980665, rel=1e-6)
    assert inf > abs(values).max() > 0


def test_stiff_ring_sags_as_a_plate() -> None:
    """A ring held at its inner edge: D (w_rr + w_r/r) twice = q, a sum of four terms in r."""
    rigidity = 0.1  # so stiff that the sag does not stretch it
    plate = Plate(np.diag([1e4, 1e4, 5e3]), np.diag([rigidity, rigidity, rigidity / 2]))
    sunk = []
    for around, outwards in ((32, 4), (64, 8)):
        ring = drape.build_ring(4e-4, around, outwards)
        moved = drape.hang(Fabric(plate, 4e-4, 0.1), ring, None, lambda share: None).moved
        sunk.append(-float(ring.grid(moved)[:, -1, :, 2].mean()))
    a, b, load = drape.DISC, drape.CLOTH, 0.1 * 9.80665
    rows = np.array(
        [  # w and its slope are 0 at a; moment and shear force are 0 at b, with a ratio of 0
            [1.0, np.log(a), a * a, a * a * np.log(a)],
            [0.0, 1 / a, 2 * a, a * (2 * np.log(a) + 1)],
            [0.0, -1 / b**2, 2.0, 2 * np.log(b) + 3],
            [0.0, 0.0, 0.0, 4 / b],
        ]
    )
    given = np.array([a**4, 4 * a**3, 12 * b * b, 32 * b]) * load / (64 * rigidity)
    terms = np.array([1.0, np.log(b), b * b, b * b * np.log(b)])
    deflection = load * b**4 / (64 * rigidity) - np.linalg.solve(rows, given) @ terms
    assert sunk[0] == pytest.approx(deflection, rel=0.03)
    # The error falls with the square of the cells.
    assert (4 * sunk[1] - sunk[0]) / 3 == pytest.approx(deflection, rel=2e-3)


def test_stiff_cloth_has_a_drape_coefficient_of_one() -> None:
    fabric = Fabric(Plate(PLATE.membrane, 1e5 * PLATE.bending), 4e-4, 0.15)
    rings = [drape.build_ring(4e-4, 32, 4)]
    # Also from waves, which straighten.
    for (state,) in drape.find_drapes(fabric, rings, lambda share: None):
        assert state.coefficient == pytest.approx(1.0, abs=1e-4)
        assert state.nodes == 0


def test_folds_below_the_discs_cast_no_shadow_of_their_own() -> None:
    ring = drape.build_ring(4e-4, 32, 4)
    radius = np.linalg.norm(ring.points[:, :2], axis=1)
    moved = np.zeros_like(ring.points)
    assert drape.find_coefficient(ring, moved) == pytest.approx(1.0, abs=1e-4)
    # Reflected in a cylinder at the edge of the discs, the ring lies below them.
    moved[:, :2] = ring.points[:, :2] * (2 * drape.DISC / radius - 2)[:, None]
    assert drape.find_coefficient(ring, moved) == pytest.approx(0.0, abs=1e-4)


def test_a_law_that_is_linear_drapes_as_the_linear_membrane() -> None:
    stretch = np.diag([1500.0, 1500.0, 30.0])
    ring = drape.build_ring(4e-4, 24, 3)
    states = []
    for law in (None, LinearLaw(stretch)):
        fabric = Fabric(Plate(stretch, 2e-5 * np.diag([1, 1, 0.5]), law=law), 4e-4, 0.15)
        states.append(drape.hang(fabric, ring, None, lambda share: None))
        again = drape.hang(fabric, ring, states[-1].moved, lambda share: None)
        assert again.moved == pytest.approx(states[-1].moved, abs=1e-8)
    assert states[1].moved == pytest.approx(states[0].moved, abs=1e-8)
    assert states[1].energy == pytest.approx(states[0].energy, rel=1e-8)


def test_energy_of_a_drape_is_the_work_of_its_weight() -> None:
    """As the weight grows by a share s, dE/ds is the potential of the whole weight."""
    stretch = np.diag([1500.0, 1500.0, 30.0])
    fabric = Fabric(Plate(stretch, 2e-5 * np.diag([1, 1, 0.5])), 4e-4, 0.15)
    ring, energies, guess = drape.build_ring(4e-4, 24, 3), [], None
    for share in (0.99, 1.0, 1.01):
        state = drape.hang(fabric, ring, guess, lambda _: None, share)
        energies.append(state.energy)
        guess = state.moved
        if share == 1.0:
            middle = ring.grid(state.moved).mean(axis=0)[..., 2]
    # Vertices of a row have the same share of the mass, up to the order of the quadrature.
    rows = middle.mean(axis=1)
    radii = np.linspace(drape.DISC, drape.CLOTH, 4)
    places = np.linspace(drape.DISC, drape.CLOTH, 301)
    inner = 2 * pi * places * np.interp(places, radii, rows)
    area = float(((inner[1:] + inner[:-1]) / 2 * np.diff(places)).sum())
    slope = (energies[2] - energies[0]) / 0.02
    assert slope == pytest.approx(0.15 * 9.80665 * area, rel=0.02)


@pytest.mark.nightly
def test_softer_cloth_drapes_more_and_in_more_folds() -> None:
    coefficients, nodes = [], []
    for rigidity in (4e-5, 4e-6):
        plate = Plate(np.diag([1500.0, 1500.0, 30.0]), rigidity * np.diag([1, 1, 0.5]))
        found = find_test("drape").measure(Fabric(plate, 4e-4, 0.15))
        coefficients.append(found.reading("DC").value)
        nodes.append(found.reading("nodes").value)
    assert coefficients[0] > coefficients[1] + 0.2
    assert nodes[0] < nodes[1]


def test_nodes_are_maxima_of_the_edge() -> None:
    angle = np.linspace(0.0, 2 * pi, 96, endpoint=False)
    for count in (4, 6, 7):
        assert drape.count_nodes(0.13 + 0.01 * np.cos(count * angle)) == count
    assert drape.count_nodes(np.full(96, 0.15)) == 0


THREADS = Threads(diameter=0.167e-3, spacing=0.4e-3)
CLOTH = Cloth(drawdown=[[1, 0], [0, 1]], warp=THREADS, weft=THREADS)


def cotton(friction: float | None = None, law: ContactLaw | None = None) -> Fabric:
    """Return a plain cotton of 20 tex with crossings that flatten."""
    yarns = YarnMechanics((60.0, 60.0), 9.0, (1e-9, 1e-9), law=law or ContactLaw())
    plate = cloth_stiffness(CLOTH, yarns)
    return Fabric(plate, 0.3e-3, 0.1, "its yarns", CLOTH, yarns, friction)


def test_friction_of_crossings_gives_its_couple_as_hysteresis() -> None:
    """2HG5 = 2 M_f/(p1 p2), where crossings have slipped; the loop is closed."""
    fabric = cotton(friction=0.05)
    friction = shear.crossing_friction(fabric, 1)
    found = find_test("shear").measure(fabric)
    assert found.reading("2HG5", "warp").value == pytest.approx(2 * friction.limit, rel=1e-9)
    curve = found.curves[0]
    assert curve.x[0] == curve.x[-1] < 0.0
    assert curve.y[0] == pytest.approx(curve.y[-1])
    # Before it slips, the loop is that of a spring and a slider: its area is the work of friction.
    slip = friction.limit / friction.stiffness
    area = -float(np.sum(np.diff(curve.x) * (curve.y[1:] + curve.y[:-1]) / 2))
    work = 4 * friction.limit * (radians(shear.LARGEST) - slip)
    assert abs(area) == pytest.approx(work, rel=1e-2)  # corners lie between two points


def test_hysteresis_of_shear_follows_from_peirces_angle() -> None:
    """M_f = ⅔ μ V a and 2HG = 2 M_f/p², with a² = D₀² V/(16 k_D), for limp yarns.

    V = 2 T (2θ - sin θ) presses the arcs of the yarns, T cos θ = W p; their resultant is 2 T sin θ.
    """
    yarns, friction, diameter, spacing = (1e-13, 1e-13), 0.2, 0.167e-3, 0.4e-3
    mechanics = YarnMechanics((60.0, 60.0), 9.0, yarns)
    plate = replace(cloth_stiffness(CLOTH, mechanics), law=cloth_law(CLOTH, mechanics))
    fabric = Fabric(plate, 0.3e-3, 0.1, "its yarns", CLOTH, mechanics, friction)
    # Peirce's angle of two equal families: of the straight part s between arcs.
    straight = sqrt(spacing**2 - 3 * diameter**2)
    angle = 2 * atan(diameter / (spacing + straight))
    tension = 10.0 * records.GF_PER_CM.size * spacing / cos(angle)
    pressed = 2 * tension * (2 * angle - sin(angle))
    assert pressed == pytest.approx(1.08 * 2 * tension * sin(angle), rel=0.01)
    radius = 2 * diameter * sqrt(pressed / (2 * 9.0) / 8)  # Hertz's, of crossed cylinders
    couple = 2 / 3 * friction * pressed * radius
    found = find_test("shear").measure(fabric)
    for symbol in ("2HG", "2HG5"):
        value = found.reading(symbol, "warp").value
        assert value == pytest.approx(2 * couple / spacing**2, rel=0.01)
    untold = find_test("shear").measure(replace(fabric, friction=None))
    assert untold.reading("2HG", "warp").text == "not modelled"
    assert "yarns.friction" in untold.reading("2HG", "warp").note


@pytest.mark.nightly
def test_tension_of_the_whole_specimen_converges() -> None:
    """EMT 2.98 % and LT 0.502; a quarter in 96 × 48 cells has 2.980 % and 0.5024."""
    fabric = cotton()
    fabric = replace(fabric, plate=replace(fabric.plate, law=cloth_law(CLOTH, fabric.yarns)))
    found = []
    for cells in ((12, 6), (24, 12), (48, 24)):
        extension, force, _ = tensile.pull_strip(fabric, 1, cells=cells)
        curve = tensile.end_at_largest(extension, force)
        readings = {each.symbol: each.value for each in tensile.tensile_readings("warp", *curve)}
        found.append([readings["EMT"], readings["LT"]])
    coarse, middle, fine = np.array(found)
    # Errors fall with a power of the width between 1.5 and 2, as the corners of clamps are sharp.
    ratio = (middle - coarse) / (fine - middle)
    assert ((ratio > 2.5) & (ratio < 4.0)).all()
    limit = fine + (fine - middle) / (ratio - 1)
    np.testing.assert_allclose(limit, [2.981e-2, 0.5018], rtol=2e-3)


@pytest.mark.parametrize("law", [ContactLaw(), VanWykContact()])
def test_compression_follows_the_law_of_contact(law: ContactLaw) -> None:
    fabric = cotton(law=law)
    found = find_test("compression").measure(fabric)
    cell, rest = 0.4e-3**2, 2 * 0.167e-3
    for symbol, pressure in (("T0", 0.5), ("Tm", 50.0)):
        force = pressure * records.GF_PER_CM2.size * cell
        if isinstance(law, VanWykContact):  # c (x^-3 - 1) = F with c = 2 k
            share = (1 + force / 18.0) ** (-1 / 3)
        else:  # 2 k (1 - x) = F
            share = 1 - force / 18.0
        expected = 0.3e-3 - rest * (1 - share)
        assert found.reading(symbol).value == pytest.approx(expected, rel=1e-9)
    assert found.reading("LC").value == pytest.approx(1.01 * 0.99 / 0.99, rel=0.02)
    assert found.reading("RC").text == "not modelled"


@pytest.mark.nightly
@pytest.mark.parametrize("name", [test.name for test in TESTS])
def test_film_shows_the_specimen_and_the_curve(name: str, tmp_path: Path) -> None:
    file = tmp_path / "film.gif"
    words = ["measure", "yarn_to_cloth", "--test", name, "--size", "320x180", "-q", "-o", str(file)]
    words += SOFT if name == "compression" else ()
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0
    with PIL.Image.open(file) as film:
        frames = [np.asarray(film.convert("RGB"), float) for _ in _seek(film)]
    assert len(frames) == 80
    change = np.abs(frames[len(frames) // 3] - frames[0]).max(axis=2)
    assert (change[:, :186] > 30).any()  # the specimen moves
    assert (change[:, 186:] > 30).any()  # so does the point on the curve


def test_drawn_bias_strip_has_the_area_of_the_specimen() -> None:
    states = bias.pull_bias(FABRIC, np.array([0.0]), cells=4).states
    assert states.surface is not None
    a, b, c = states.surface.points[states.surface.triangles].swapaxes(0, 1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(bias.WIDTH * bias.LENGTH, rel=1e-9)
    # The film shows it upright.
    corner = np.argmax(states.points @ [1.0, 1.0, 0.0])
    moved = states.points[corner] + states.displacements[0, corner]
    assert moved[1] == pytest.approx(states.points[corner, :2].sum() / 2**0.5, rel=1e-9)


def test_pressed_part_of_the_film_is_as_thick_as_the_cloth() -> None:
    found = find_test("compression").measure(cotton())
    states = found.states
    assert states is not None
    height = (states.points + states.displacements)[:, :, 2]
    assert height.min(axis=1) == pytest.approx(0.0, abs=1e-12)  # it lies on a plate
    assert height.max(axis=1) == pytest.approx(states.marks[:, 0], rel=1e-12)
    assert states.marks[[0, 20, 40], 1] == pytest.approx(np.array([0.5, 50, 0.5]) * 98.0665)


def test_specimen_is_drawn_in_the_colours_of_its_yarns() -> None:
    red, blue = np.array([[200, 0, 0]], np.uint8), np.array([[0, 0, 200]], np.uint8)
    cloth = Cloth(
        drawdown=[[1, 0], [0, 1]],
        warp=Threads(diameter=1e-3, spacing=2e-3, colors=red),
        weft=Threads(diameter=1e-3, spacing=2e-3, colors=blue),
    )
    picture = draw_cloth(cloth, np.zeros(2), np.array([8e-3, 8e-3]))
    size = picture.shape[1]
    crossings = picture[:size][::-1][size // 8 :: size // 4, size // 8 :: size // 4]
    above = crossings[..., 0] > crossings[..., 2]
    assert above.tolist() == [[True, False, True, False], [False, True, False, True]] * 2
    assert crossings.max(axis=-1) == pytest.approx(200, abs=1)


def _seek(film: PIL.Image.Image) -> Iterator[None]:
    for number in range(getattr(film, "n_frames", 1)):
        film.seek(number)
        yield


def test_fast_reads_its_extensions_off_the_curve() -> None:
    """A sheet whose width does not matter, pulled: F = T λ (λ² - 1)/2 at 5, 20 and 100 gf/cm."""
    plate = Plate(np.diag([4000.0, 6000.0, 30.0]), PLATE.bending)
    extension, force, _ = tensile.pull_strip(Fabric(plate, 4e-4), 1, tensile.FAST_SIZE, (2, 4))
    readings = tensile.fast_readings("warp", extension, force)
    for reading, load in zip(readings, (5, 20, 100), strict=True):
        assert reading.value is not None
        stretch = 1 + reading.value
        expected = load * records.GF_PER_CM.size
        assert 6000.0 * stretch * (stretch**2 - 1) / 2 == pytest.approx(expected, rel=0.02)
