"""Tubes along any centre line: a quarter of a torus, in any plane and with any frame."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from weaves import surface

from spacemap_vtk.textile.geometry.section import build_section
from spacemap_vtk.textile.geometry.sweep import CentreLines, SweptTubes, sweep
from spacemap_vtk.textile.patches.bezier import arc_handle, rational_handles

RADII = np.array([0.1, 0.25])
AROUND = 1.0


def make_tori(
    parts: int, turn: float, tilt: np.ndarray, exact: bool
) -> tuple[CentreLines, np.ndarray]:
    """Quarters of circles about one axis, a thin tube and a thick one, their frames turned."""
    angle = 0.5 * pi / parts
    handle, weight = rational_handles(angle) if exact else (arc_handle(angle), 1.0)
    at = np.tile(angle * np.arange(parts + 1), 2)
    zero = np.zeros_like(at)
    outwards = np.stack([np.cos(at), np.sin(at), zero]).T @ tilt
    tangent = np.stack([-np.sin(at), np.cos(at), zero]).T @ tilt
    axis = np.array([0.0, 0.0, 1.0]) @ tilt
    normal = np.cos(turn) * outwards + np.sin(turn) * axis
    lateral = np.cross(normal, tangent)
    place = AROUND * outwards + np.repeat([[0.0], [5.0]], parts + 1, axis=0) * axis
    # the line turns inwards
    bend = np.full((2, 2 * parts), -1.0 / AROUND)
    x, t, n, b = (tuple(vectors.T.copy()) for vectors in (place, tangent, normal, lateral))
    lines = CentreLines(
        np.array([7, 3]),
        RADII,
        np.array([parts, parts]),
        place=x,
        tangent=t,
        normal=n,
        lateral=b,
        curvature=np.cos(turn) * bend,
        sideways=float(lateral[0] @ outwards[0]) * bend,
        reach=np.full((2, 2 * parts), handle * AROUND),
        weight=np.full(2 * parts, weight),
    )
    return lines, axis


def volumes(made: SweptTubes, nodes: int = 16) -> np.ndarray:
    """Volume inside each line's tube, by the divergence theorem."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    points, du, dv = surface(made, (x + 1) / 2)  # type: ignore[arg-type]
    flux = np.einsum("puvc,puvc,u,v->p", points, np.cross(du, dv), w / 2, w / 2)
    return np.bincount(made.line, weights=flux / 3)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 4),
    st.floats(-pi, pi),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)),
)
def test_a_tube_along_a_circle_is_a_torus(
    parts: int, turn: float, about: tuple[float, float, float]
) -> None:
    skew = np.cross(np.eye(3), about)
    tilt = np.linalg.solve(np.eye(3) + skew, np.eye(3) - skew)  # Cayley's rotation
    lines, axis = make_tori(parts, turn, tilt, exact=True)
    made = sweep([(lines, build_section("circular", 1.0, True))], True, True)
    points, du, dv = surface(made, np.linspace(0, 1, 7), slice(0, made.tube_patches))  # type: ignore[arg-type]
    thick = made.line[: made.tube_patches] == 3
    height = points @ axis - 5.0 * thick[:, None, None]
    flat = points - (points @ axis)[..., None] * axis
    from_axis = np.linalg.norm(flat, axis=-1)
    away = np.hypot(from_axis - AROUND, height) - np.where(thick, *RADII[::-1])[:, None, None]
    np.testing.assert_allclose(away, 0.0, atol=1e-13)
    outwards = np.cross(du, dv)
    centre = AROUND * flat / from_axis[..., None] + (5.0 * thick)[:, None, None, None] * axis
    assert (np.einsum("puvc,puvc->puv", outwards, points - centre) > 0.0).all()


@pytest.mark.parametrize(("kind", "aspect"), [("circular", 1.0), ("elliptic", 1.5)])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_tubes_are_closed_and_have_the_exact_volume(kind: str, aspect: float, turn: float) -> None:
    """By Pappus: the section times the way of its middle, however it is turned."""
    lines, _ = make_tori(3, turn, np.eye(3), exact=True)
    made = sweep([(lines, build_section(kind, aspect, True))], True, True)
    expected = 0.5 * pi * AROUND * pi * aspect * RADII**2
    np.testing.assert_allclose(volumes(made)[[7, 3]], expected, rtol=1e-12)
    lines, _ = make_tori(3, turn, np.eye(3), exact=False)
    made = sweep([(lines, build_section(kind, aspect, False))], True, False)
    np.testing.assert_allclose(volumes(made)[[7, 3]], expected, rtol=1e-3)


def test_bundles_are_numbered_in_sequence() -> None:
    lines, _ = make_tori(2, 0.0, np.eye(3), exact=False)
    one = sweep([(lines, build_section("circular", 1.0, False))], False, False)
    other = sweep([(lines, build_section("racetrack", 1.5, False))], False, False)
    both = sweep(
        [
            (lines, build_section("circular", 1.0, False)),
            (lines, build_section("racetrack", 1.5, False)),
        ],
        False,
        False,
    )
    np.testing.assert_array_equal(both.points, np.concatenate([one.points, other.points]))
    np.testing.assert_array_equal(
        both.patches, np.concatenate([one.patches, other.patches + len(one.points)])
    )
    assert np.bincount(both.bundle).tolist() == [len(one.patches), len(other.patches)]
    assert [tubes.first for tubes in both.tubes] == [0, len(one.points)]
