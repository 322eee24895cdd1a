"""Permeability of square and hexagonal arrays of cylinders, against series that meet the walls."""

from __future__ import annotations

import json

import numpy as np
import pytest

from spacemap_vtk.cli.main import main
from spacemap_vtk.unit_cell.stokes import permeability


def cylinders(count: int, share: float, lines: int = 16) -> np.ndarray:
    """Return voxels (count, count, 2) of a square array of cylinders along x."""
    place = (np.arange(count * lines) + 0.5) / (count * lines) - 0.5
    inside = place[:, None] ** 2 + place**2 < share / np.pi
    solid = inside.reshape(count, lines, count, lines).mean(axis=(1, 3))
    return np.repeat(solid[:, :, None], 2, axis=2)


def permeability_across(share: float, terms: int = 16) -> float:
    """Compute the permeability of a square array across cylinders; the pitch is 1.

    Goursat's functions: u - i v = conj(z) φ' + χ' - conj(φ), pressure 4 Re φ', vorticity
    -4 Im φ', with a force on the cylinder of φ = log z.
    """
    radius, half = np.sqrt(share / np.pi), np.linspace(0.0, 0.5, 200)
    circle = radius * np.exp(1j * np.linspace(0.0, np.pi / 2, 200))
    outlet, top = 0.5 + 1j * half, half + 0.5j
    top = top[top.real > 0]

    def functions(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return velocities u - i v and φ' of the force and of all other terms."""
        velocity = [-2 * np.log(abs(z)) + z.conj() / z]
        slope = [1 / z]
        for k in range(-2 * terms, 2 * terms + 1, 2):
            size = radius if k < 0 else 0.75
            if k:
                turn = k * (z / size) ** (k - 1) / size
                velocity.append(z.conj() * turn - ((z / size) ** k).conj())
                slope.append(turn)
            velocity.append((z / size) ** k)
            slope.append(0 * z)
        return np.stack(velocity, axis=1), np.stack(slope, axis=1)

    at_wall, _ = functions(circle)
    at_outlet, pressure = functions(outlet)
    at_top, vorticity = functions(top)
    rows = [at_wall.real, at_wall.imag, at_outlet.imag, pressure.real]
    rows += [at_top.imag, vorticity.imag]
    table = np.concatenate(rows)
    # The pressure at the outlet is one more unknown.
    level = np.concatenate([np.full(len(row), float(row is rows[3])) for row in rows])
    table = np.column_stack([table, -level])
    found = np.linalg.lstsq(table[:, 1:], -table[:, 0], rcond=1e-14)[0]
    weights = np.concatenate([[1.0], found])
    assert abs(table @ weights).max() < 2e-4 * abs(weights[-1])
    place, width = np.polynomial.legendre.leggauss(40)
    flow, _ = functions(0.5 + 0.25j * (place + 1))
    mean = float(width @ (flow @ weights[:-1]).real) / 2
    return mean / (-8 * weights[-1])


def permeability_along(share: float, terms: int = 12) -> float:
    """Compute the permeability of a square array along cylinders; the pitch is 1."""
    radius = np.sqrt(share / np.pi)
    orders = 4 * np.arange(1, terms + 1)

    def slope(z: np.ndarray) -> np.ndarray:
        """Return the derivatives by x of all terms."""
        z = z[:, None]
        known = -z.real / 2 + (1 / z).real / (2 * np.pi)
        others = orders * (z ** (orders - 1) + radius ** (2 * orders) * z ** (-orders - 1.0))
        return np.column_stack([known, others.real * 2.0**orders])

    table = slope(0.5 + 1j * np.linspace(0.0, 0.5, 200))
    weights = np.linalg.lstsq(table[:, 1:], -table[:, 0], rcond=None)[0] * 2.0**orders
    place, width = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for angle, part in zip((place + 1) * np.pi / 8, width * np.pi / 8, strict=True):
        end = 0.5 / np.cos(angle)
        r = radius + (place + 1) / 2 * (end - radius)
        w = (radius**2 - r**2) / 4 + np.log(r / radius) / (2 * np.pi)
        powers = r[:, None] ** orders - radius ** (2 * orders) * r[:, None] ** (-orders * 1.0)
        w += powers @ (weights * np.cos(orders * angle))
        total += part * float(width @ (w * r)) / 2 * (end - radius)
    return 8 * total


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4, 0.5, 0.6])
def test_square_arrays_have_the_permeability_of_series_that_meet_the_walls(share: float) -> None:
    found = permeability(cylinders(64, share), np.full(3, 1 / 64))
    along, across = permeability_along(share), permeability_across(share)
    np.testing.assert_allclose(np.diag(found), [along, across, across], rtol=8e-3)
    np.testing.assert_allclose(found - np.diag(np.diag(found)), 0.0, atol=1e-3 * across)


def test_the_series_have_the_values_that_others_quote() -> None:
    # Force over viscosity and velocity, as Basilisk's test cylinders.c quotes them from Table 1 of
    # A. S. Sangani and A. Acrivos, Int. J. Multiphase Flow 8 (1982) 193; a formula that is quoted
    # from J. E. Drummond and M. I. Tahir, Int. J. Multiphase Flow 10 (1984) 515. The two papers
    # were not read.
    for share, force in ((0.05, 15.56), (0.1, 24.83), (0.2, 51.53), (0.4, 217.89), (0.5, 532.55)):
        assert 1 / permeability_across(share) == pytest.approx(force, rel=2e-4)
    share = 0.1
    series = -np.log(share) - 1.476336 + 2 * share - share**2 / 2 - 0.0509 * share**4
    assert permeability_along(share) == pytest.approx(series / (4 * np.pi), rel=1e-6)


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_hexagonal_arrays_have_the_permeability_of_the_series(share: float) -> None:
    # Formulas quoted from Drummond and Tahir, see above, without the terms of the fourth power,
    # which are below 0.1 % here.
    rows, columns, lines = 112, 64, 8
    y = (np.arange(rows * lines) + 0.5) / (rows * lines) * 3**0.5
    z = (np.arange(columns * lines) + 0.5) / (columns * lines)
    axes = [(0, 0), (0, 1), (3**0.5, 0), (3**0.5, 1), (3**0.5 / 2, 0.5)]
    distances = np.minimum.reduce(
        [np.abs(y - a)[:, None] ** 2 + np.abs(z - b) ** 2 for a, b in axes]
    )
    square = share * 3**0.5 / (2 * np.pi)  # of the radius: two cylinders in the cell
    solid = (distances < square).reshape(rows, lines, columns, lines).mean(axis=(1, 3))
    spacing = np.array([1 / 32, 1 / columns, 3**0.5 / rows])
    found = np.diag(permeability(np.repeat(solid[:, :, None], 2, axis=2), spacing))
    series = -np.log(share) + 2 * share - share**2 / 2
    assert found[0] == pytest.approx(square / (4 * share) * (series - 1.498), rel=5e-3)
    np.testing.assert_allclose(found[1:], square / (8 * share) * (series - 1.490), rtol=1e-2)


def test_the_flow_between_plates_is_that_of_poiseuille() -> None:
    errors = []
    for count in (16, 32):
        edges = np.clip(0.55 * count - np.arange(count), 0.0, 1.0)
        solid = np.ascontiguousarray(np.broadcast_to(1 - edges[:, None, None], (count, 2, 2)))
        found = permeability(solid, np.full(3, 2e-3 / count))
        exact = 0.55**3 / 12 * 4e-6
        errors.append(abs(found[0, 0] / exact - 1))
        assert found[0, 0] == pytest.approx(found[1, 1], rel=1e-6)
        # Nothing flows through plates.
        assert found[2, 2] < 2e-3 * exact
    assert errors[1] < 0.02
    assert errors[1] < 0.4 * errors[0]


def test_the_permeability_of_a_weave_is_printed_with_its_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["permeability", "plain_weave", "--voxels", "16", "-q"]
    with pytest.raises(SystemExit) as end:
        main([*words, "--json"])
    assert end.value.code == 0
    found = json.loads(capsys.readouterr().out)
    tensor = np.array(found["permeability"])
    # Warp and weft are alike; a cell of twice the size is four times as permeable.
    assert tensor[0, 0] == pytest.approx(tensor[1, 1], rel=1e-3)
    assert 0 < found["error"][2][2] < 0.5 * tensor[2, 2]
    sizes = [
        f"weave.{family}_{what}" for family in ("warp", "weft") for what in ("diameter", "spacing")
    ]
    scale = [
        word
        for name in sizes
        for word in ("--set", f"{name}={'0.5mm' if 'dia' in name else '1mm'}")
    ]
    with pytest.raises(SystemExit):
        main([*words, "--json", *scale])
    large = np.array(json.loads(capsys.readouterr().out)["permeability"])
    np.testing.assert_allclose(np.diag(large), 4 * np.diag(tensor), rtol=1e-6)
    with pytest.raises(SystemExit) as end:
        main([*words, "--set", "unit_cell.shear=10 deg"])
    assert end.value.code == 2
    assert "right angles" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(words[:-1])
    printed = capsys.readouterr()
    assert "m²" in printed.out
    # Gaps of few voxels are reported.
    assert "rough" in printed.err
    with pytest.raises(SystemExit) as end:
        main([*words[:2], "--voxels", "12"])
    assert end.value.code == 2
    assert "at least 16" in capsys.readouterr().err
