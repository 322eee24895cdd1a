"""Specimens between clamps, against closed forms of their own laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from test_laboratory import cotton

from spacemap_vtk.laboratory import bias, frame, tensile
from spacemap_vtk.laboratory.biaxial import tensile_readings
from spacemap_vtk.laboratory.catalogue import find_test
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.textile.crimp.cloth_law import cloth_law

#: Stretch along weft and warp, and across [N/m]; shear [N/m].
WEFT, WARP, ACROSS, SHEAR = 2000.0, 1500.0, 600.0, 500.0
MEMBRANE = np.array([[WEFT, ACROSS, 0.0], [ACROSS, WARP, 0.0], [0.0, 0.0, SHEAR]])
FABRIC = Fabric(Plate(MEMBRANE, np.diag([1e-5, 1e-5, 5e-6])), 4e-4, 0.15)


@pytest.mark.parametrize(
    ("size", "cells", "modulus"),
    [
        # Clamps hold the width of a wide specimen; a long one becomes narrower.
        ((1.0, 0.02), (40, 2), WARP),
        ((0.005, 0.2), (2, 40), WARP - ACROSS**2 / WEFT),
    ],
)
def test_wide_and_long_specimens_have_the_moduli_of_held_and_free_widths(
    size: tuple[float, float], cells: tuple[int, int], modulus: float
) -> None:
    """Green's strain e + e²/2 gives the force per width E (1 + e)(e + e²/2)."""
    extension, force, _ = tensile.pull_strip(FABRIC, 1, size, cells)
    e = extension[5]
    assert force[5] == pytest.approx(modulus * (1 + e) * (e + e**2 / 2), rel=6e-3)


def test_free_sides_let_cloth_extend_twice_as_far_as_a_held_width() -> None:
    """A trial with the same yarns: 2.8 %, LT 0.48, where a held width has 1.35 % and 0.97."""
    fabric = cotton()
    assert fabric.cloth is not None
    assert fabric.yarns is not None
    law = cloth_law(fabric.cloth, fabric.yarns)
    fabric = replace(fabric, plate=replace(fabric.plate, law=law))
    found = tensile.end_at_largest(*tensile.pull_strip(fabric, 1, cells=(8, 4))[:2])
    stretch, linearity, *_ = tensile_readings("warp", *found)
    assert stretch.value == pytest.approx(0.028, rel=0.08)
    assert linearity.value == pytest.approx(0.48, rel=0.15)


def test_frame_measures_the_shear_stress_of_the_law() -> None:
    """Without stretch F_s/L is the second Piola-Kirchhoff shear stress at 2 e_12 = sin γ."""
    angles = np.radians([0.0, 10.0, 20.0, 30.0, 45.0])
    force, states = frame.shear_in_frame(FABRIC, angles)
    np.testing.assert_allclose(force, SHEAR * np.sin(angles), rtol=1e-9, atol=1e-12)
    last = (states.points + states.displacements[-1])[:, :2]
    diagonal = np.ptp(last @ [1, 1]) / 2**0.5
    assert diagonal == pytest.approx(2 * frame.SIDE * math.cos(math.pi / 8), rel=1e-12)


@pytest.mark.nightly
def test_states_of_the_whole_specimen_are_symmetric() -> None:
    found = find_test("tensile").measure(FABRIC)
    states = found.states
    assert states is not None
    last = states.points + states.displacements[-1]
    np.testing.assert_allclose(last[:, :2].mean(axis=0), 0, atol=1e-12)
    stretch = np.ptp(last[:, 1]) / tensile.LENGTH - 1
    assert stretch == pytest.approx(states.marks[-1, 0], rel=1e-9)
    # Warp and weft: the stiffer one extends less.
    assert found.reading("EMT", "weft").value < found.reading("EMT", "warp").value


def test_bias_strip_of_stiff_yarns_shears_as_the_kinematic_formula_says() -> None:
    """Within 1 % in the middle; its first force is that of three zones, whatever the cells."""
    stiff = Plate(np.diag([1e6, 1e6, SHEAR / 10]), FABRIC.plate.bending)
    extension = np.array([0.0, 0.005, 0.05, 0.1])
    kinematic = bias.kinematic_angle(extension)
    assert np.degrees(kinematic[3]) == pytest.approx(26.1, abs=0.05)
    move, free = 0.005 * bias.LENGTH, bias.LENGTH - bias.WIDTH
    first = 4 * SHEAR / 10 * move * (bias.LENGTH - 1.25 * bias.WIDTH) / free**2
    for cells in (6, 10):
        found = bias.pull_bias(replace(FABRIC, plate=stiff), extension, cells=cells)
        np.testing.assert_allclose(found.angle[1:], kinematic[1:], rtol=0.01)
        assert found.force[1] == pytest.approx(first, rel=0.02)


@pytest.mark.nightly
def test_finer_cells_are_within_the_stated_errors() -> None:
    """Of tension in cells half as wide, and of bias extension."""
    fabric = cotton()
    assert fabric.cloth is not None
    assert fabric.yarns is not None
    law = cloth_law(fabric.cloth, fabric.yarns)
    fabric = replace(fabric, plate=replace(fabric.plate, law=law))
    found = find_test("tensile").measure(fabric)
    fine = tensile.pull_strip(fabric, 1, cells=(48, 24))[:2]
    fast = tensile.pull_strip(fabric, 1, tensile.FAST_SIZE, (16, 32))[:2]
    finer = tensile_readings("warp", *tensile.end_at_largest(*fine))
    finer += tensile.fast_readings("warp", *fast)
    extension = np.linspace(0.0, bias.LARGEST, 29)
    sheared = bias.pull_bias(fabric, extension, cells=20)
    measured = find_test("bias").measure(fabric)
    pairs = [(found.reading(each.symbol, "warp"), each.value) for each in finer]
    pairs.append((measured.reading("γ", "bias"), float(np.interp(0.1, extension, sheared.angle))))
    for reading, value in pairs:
        if value is not None:
            assert reading.value is not None
            assert reading.error is not None
            assert abs(reading.value - value) < reading.error < 0.1 * reading.value
