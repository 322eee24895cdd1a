"""The language of places: what it reads, writes and refuses."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.fittings import MASS_UNITS, SPRING_UNITS
from spacemap_vtk.mechanics.boundary.places import directions, find_vertices, parse_places

POINTS = build_lattice((0, 1, 0, 2, 0, 3), (2, 2, 2))[0]


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("-x:(0, 1, 1)", "-x:(0, 1, 1)"),
        ("-x: ( 0,1e-1 ,-1 )", "-x:(0, 0.1, -1)"),
        ("+y:(0, -2, 0)", "+y:y"),  # along an axis it is a component
        ("sphere(0, 0, 0, 1 mm):(1,0,0),-z", "sphere(0, 0, 0, 0.001):x -z"),
        ("mask(my array):(1, 2, 3)", "mask(my array):(1, 2, 3)"),
    ],
)
def test_directions_and_components_are_parsed(text, canonical):
    found = parse_places(text)
    assert " ".join(map(str, found)) == canonical
    assert parse_places(canonical) == found


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("-z 1e5 N/m3", "-z 100000 N/m3"),
        ("-z:z 0.1 N/mm³; +x 5 kN/m", "-z:z 100000000 N/m3 +x 5000 N/m"),
        ("sphere(0, 0, 0, 1 mm):(0, 1, 1) 20N/m", "sphere(0, 0, 0, 0.001):(0, 1, 1) 20 N/m"),
        ("-x .5 N/m,+x 5. N/cm", "-x 0.5 N/m +x 500 N/m"),
    ],
)
def test_springs_are_parsed_with_their_stiffness(text, canonical):
    found = parse_places(text, SPRING_UNITS, what="spring")
    assert " ".join(map(str, found)) == canonical
    assert parse_places(canonical, SPRING_UNITS) == found


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("-x:(1, 1)", r"\(1, 1\) is not a direction; allowed: \(x, y, z\)"),
        ("-x:(0, 0, 0)", "not a direction"),
        ("-x:(1, inf, 0)", "not a direction"),
        ("-x:(a, b, c)", "not a direction"),
        ("-x:()", "not a direction"),
        ("-x:(1, 1, 0", '"-x:.1, 1, 0" is not a support'),
        ("-x 5 N/m", '"5 N/m" is not a support'),
    ],
)
def test_invalid_directions_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_places(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("-x", '"-x" has no value; allowed: a number above 0 with one of the units N/m,.* N/m3'),
        ("-x 5", '"-x" has an invalid value: 5'),
        ("-x 5 kg", "invalid value: 5 kg"),
        ("-x -5 N/m", "invalid value: -5 N/m"),
        ("-x 0 N/m", "invalid value: 0 N/m"),
        ("-x 1e999 N/m", "has an invalid value"),
        ("-x 1.2.3 N/m", "has an invalid value"),
        ("5 N/m", '"5 N/m" is not a spring'),
    ],
)
def test_invalid_stiffness_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_places(text, SPRING_UNITS, what="spring")


def test_mass_cannot_name_components():
    for text in ("5 g", "1.5 kg", "0.3 mg", "120 mg"):
        (found,) = parse_places(f"-x {text}", MASS_UNITS, what="mass", whole=True)
        assert str(found) == f"-x {text}"
        assert parse_places(str(found), MASS_UNITS, what="mass", whole=True) == [found]
    with pytest.raises(InputError, match='a mass cannot name components: "-x:y"'):
        parse_places("-x:y 5 g", MASS_UNITS, what="mass", whole=True)


def test_directions_are_projections_at_the_vertices():
    (inclined, plain) = parse_places("-x:(0, 3, 4) +y:xz")
    left = find_vertices(POINTS, inclined)
    np.testing.assert_array_equal(left, POINTS[:, 0] == 0)
    found = directions(POINTS, inclined)
    assert not found[~left].any()
    normal = np.array([0, 0.6, 0.8])
    np.testing.assert_allclose(found[left], np.broadcast_to(np.outer(normal, normal), (9, 3, 3)))
    top = directions(POINTS, plain)
    np.testing.assert_array_equal(top[POINTS[:, 1] == 2], [np.diag([1, 0, 1])] * 9)
    parted = np.zeros((27, 3))
    parted[4, 1:] = 1
    mask = parse_places("mask(glue):xy")[0]
    assert directions(POINTS, mask, {"glue": parted}.get)[4].tolist() == np.diag([0, 1, 0]).tolist()
    with pytest.raises(InputError, match=r'"glue" has three components.*cannot name a direction'):
        directions(POINTS, parse_places("mask(glue):(1, 1, 0)")[0], {"glue": parted}.get)
