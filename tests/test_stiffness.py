"""From yarns to cloth: stiffness against closed forms, rods and published moduli."""

from __future__ import annotations

import numpy as np
import pytest

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.plates import data_sheet, strip_stiffness
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.drafts import patterns
from spacemap_vtk.textile.geometry.cloth_axes import sample_axes
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

#: Cotton of 30 tex: EA [N] and B [N m²].
EA, B = 90.0, 2e-9


def woven(pattern="plain", *, d=(0.25e-3, 0.25e-3), p=(0.5e-3, 0.5e-3), size=24, flat=1, **more):
    repeat = patterns.build_pattern(pattern)
    drawdown = np.tile(repeat, [-(-size // n) for n in repeat.shape])[:size, :size]
    section = {"section": "racetrack", "aspect": flat} if flat > 1 else {}
    warp, weft = (Threads(diameter=d, spacing=p, **section) for d, p in zip(d, p, strict=True))
    return Cloth(drawdown=drawdown, warp=warp, weft=weft, **more)


def cotton(tension=(EA, EA), bending=(B, B), contact=np.inf):
    return YarnMechanics(tension, contact, bending)


def by_hand(cloth, yarns):
    """Return the (2, 2) stiffness of plain cloth per width [N/m], warp first.

    Of springs: both lengths, both angles, the contact. dl = cosθ dp + sinθ dh + (θ - sinθ) dD and
    s dθ = -sinθ dp + cosθ dh + (1 - cosθ) dD are the differentials of Peirce's equations.
    """
    spacing = cloth.weft.spacing, cloth.warp.spacing
    stiffness = np.zeros((4, 4))
    for k, family in enumerate(cloth.families):
        theta, s, length, _ = family.crimp
        sin, cos = np.sin(theta), np.cos(theta)
        dh, dd = np.array([[0, 0, 1, 0], [0, 0, -1, 1]][k]), np.array([0, 0, 0, 1])
        dp = spacing[k] * np.eye(4)[k]
        stretch = cos * dp + sin * dh + (theta - sin) * dd
        turn = (-sin * dp + cos * dh + (1 - cos) * dd) / s
        stiffness += yarns.tension[k] / length * np.outer(stretch, stretch)
        stiffness += hinge(cloth, yarns, k) * np.outer(turn, turn)
    stiffness[3, 3] += min(yarns.contact, 1e9) / cloth.diameter_sum
    outer, mixed, inner = stiffness[:2, :2], stiffness[:2, 2:], stiffness[2:, 2:]
    return (outer - mixed @ np.linalg.solve(inner, mixed.T)) / np.prod(spacing)


def hinge(cloth, yarns, k):
    """Return moment over angle [N m] of a sawtooth with Peirce's straight part."""
    _, s, length, _ = cloth.families[k].crimp
    return 12 * yarns.bending[k] * s**2 / length**3


@pytest.mark.parametrize("contact", [np.inf, 9.0, 0.1])
@pytest.mark.parametrize("crimp_height", [None, 0.2e-3])
def test_stretch_is_that_of_springs_in_peirces_geometry(contact, crimp_height):
    cloth = woven(d=(0.2e-3, 0.3e-3), p=(0.55e-3, 0.6e-3), crimp_height=crimp_height)
    yarns = cotton((90.0, 60.0), (2e-9, 4e-9), contact)
    found = cloth_stiffness(cloth, yarns).membrane[:2, :2][::-1, ::-1]
    np.testing.assert_allclose(found, by_hand(cloth, yarns), rtol=1e-6)


@pytest.mark.parametrize(("p1", "expected"), [(0.5e-3, 1.0), (0.75e-3, 0.33760)])
def test_yarns_that_hardly_stretch_exchange_crimp(p1, expected):
    """Initial Poisson's ratio p2 tan θ2 / (p1 tan θ1); a strip resists by bending alone."""
    cloth, yarns = woven(p=(p1, 0.5e-3)), cotton((1e9, 1e9))
    plate = cloth_stiffness(cloth, yarns)
    assert data_sheet(plate, 0.1).poissons_ratio_in_plane == pytest.approx(expected, abs=6e-6)
    # dp2 turns the warp by dp2/(s1 sin θ1), and the weft by dp2 cot θ1/(s2 cos θ2)
    (t1, s1, *_), (t2, s2, *_) = (family.crimp for family in cloth.families)
    turns = 1 / (s1 * np.sin(t1)), 1 / (s2 * np.cos(t2) * np.tan(t1))
    warp = sum(hinge(cloth, yarns, k) * turn**2 for k, turn in enumerate(turns))
    assert strip_stiffness(plate.membrane)[0] == pytest.approx(warp * 0.5e-3 / p1, rel=1e-5)


@pytest.mark.parametrize("pattern", ["plain", "twill 2/2", "satin 5/2"])
def test_biaxial_tension_is_resisted_by_the_yarns_tension(pattern):
    """Balanced cloth, hard contact: both yarns strain alike, and heights stay."""
    cloth, p = woven(pattern, size=40), 0.5e-3
    theta, _, length, _ = cloth.families[0].crimp
    floats = {"plain": 0.0, "twill 2/2": 1.0, "satin 5/2": 1.5}[pattern]  # to a change of side
    yarn = length + floats * p
    strain = (np.cos(theta) + floats) * p / yarn
    expected = EA / p * strain * (np.cos(theta) + floats) / (1 + floats)
    membrane = cloth_stiffness(cloth, cotton(bending=(1e-15, 1e-15))).membrane
    assert membrane[:2, :2].sum(axis=1) == pytest.approx(expected, rel=1e-6)
    # and one way, sides free, not at all: exchange is a mechanism
    assert max(strip_stiffness(membrane)) < 1e-5 * expected


@pytest.mark.parametrize("p", [(0.5e-3, 0.55e-3), (0.6e-3, 0.9e-3), (2e-3, 2e-3)])
def test_a_strip_begins_to_stretch_with_leaf_and_kandils_modulus(p):
    """12 B1 p2/(p1 l1³ sin²θ1) (1 + B2 l1³ cos²θ1/(B1 l2³ cos²θ2)), J. Text. Inst. 71 (1980) 1."""
    cloth = woven(p=p, d=(0.2e-3, 0.3e-3))
    found = strip_stiffness(cloth_stiffness(cloth, cotton((1e9, 1e9), (B, 3 * B))).membrane)
    bending, spacing = [B, 3 * B], [*p]
    for k in (0, 1):
        (t1, _, l1, _), (t2, _, l2, _) = (cloth.families[n].crimp for n in (k, 1 - k))
        ratio = bending[1 - k] * l1**3 * np.cos(t1) ** 2 / (bending[k] * l2**3 * np.cos(t2) ** 2)
        own = 12 * bending[k] * spacing[1 - k] / (spacing[k] * l1**3 * np.sin(t1) ** 2)
        assert found[k] == pytest.approx(own * (1 + ratio), rel=1e-4)


@pytest.mark.parametrize(
    ("ratio", "softer"), [(0.95, 0.725), (1.0, 0.78), (1.2, 0.893), (2.0, 0.985), (5.0, 1.0)]
)
def test_a_rod_of_peirces_shape_stretches_nearly_so(ratio, softer):
    """By Castigliano: pulled by F and pressed by V a rod bends by F z - V x from mid-gap.

    Two such, one pulled, the other not, that press each other: F/dp = 1/(a - b²/(2 c)).
    """
    p = 0.5e-3 * ratio
    cloth = woven(p=(p, p), exact=True)
    points, owner = sample_axes(cloth, 128)
    line, crossed = points[owner == 12], cloth.yarns[1].position[11:13]
    line = line[abs(line[:, 1] - crossed.mean()) <= 0.5 * p * (1 + 1e-9)]
    middle = 0.5 * (line[1:] + line[:-1]) - 0.5 * (line[0] + line[-1])
    step, (_, x, z) = np.linalg.norm(np.diff(line, axis=0), axis=1), middle.T
    a, b, c = (float((step * product).sum()) / B for product in (z * z, x * z, x * x))
    found = strip_stiffness(cloth_stiffness(cloth, cotton((1e9, 1e9))).membrane)[0]
    assert found * (a - b * b / (2 * c)) == pytest.approx(softer, abs=0.006)


@pytest.mark.parametrize("flat", [1, 1.4])
@pytest.mark.parametrize("pattern", ["plain", "twill 2/2", "satin 5/2"])
def test_cloth_bends_as_its_yarns_do_along_their_axes(pattern, flat):
    cloth = woven(pattern, d=(0.2e-3, 0.3e-3), p=(0.5e-3, 0.6e-3), exact=True, flat=flat)
    plate = cloth_stiffness(cloth, cotton(bending=(B, 3 * B)))
    points, owner = sample_axes(cloth, 64)
    for family, (stiffness, rigidity) in enumerate(
        zip(strip_stiffness(plate.bending), (B, 3 * B), strict=True)
    ):
        total, along = 0.0, 1 - family
        first, last = cloth.yarns[along].position[[0, 20]]  # whole repeats
        for yarn in range(20):
            line = points[owner == 24 * family + yarn]
            inside = (line[:, along] >= first - 1e-12) & (line[:, along] <= last + 1e-12)
            line = line[inside]
            length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
            total += rigidity * np.ptp(line[:, along]) / length
        width = 20 * cloth.threads[family].spacing
        assert stiffness == pytest.approx(total / width, rel=2e-4)
    assert plate.bending[0, 1] == 0.0


def test_a_square_cloth_bends_equally_in_all_directions():
    bending = cloth_stiffness(woven(), cotton()).bending
    for angle in np.linspace(0, np.pi, 7):
        c, s = np.cos(angle), np.sin(angle)
        curved = np.array([c * c, s * s, 2 * c * s])
        assert curved @ bending @ curved == pytest.approx(bending[0, 0], rel=1e-12)


def contact_lean(cloth, bending, changes=1.0, modulus=1e7):
    """Return by how much the twist of contacts leans a cloth under 1 N/m, by Hertz and Johnson.

    `changes` is the share of gaps in which a yarn changes side. Whatever the modulus is: Johnson,
    Contact Mechanics (1985): a³ = 3 N R/(4 E*), and a moment of 16/3 G a³ turns a half space by 1.
    """
    press = [
        2 * changes * 12 * rigidity * share * cloth.diameter_sum / float(family.crimp.length) ** 3
        for rigidity, share, family in zip(bending, cloth.shares, cloth.families, strict=True)
    ]
    radius, ratio = cloth.diameter_sum / 4, 0.0
    size = 3 * np.mean(press) * radius * 2 * (1 - ratio**2) / (4 * modulus)
    shear = modulus / (2 * (1 + ratio))
    both = 0.5 * 16 / 3 * shear * size
    return cloth.warp.spacing * cloth.weft.spacing / both


@pytest.mark.parametrize(
    ("pattern", "repeats"),
    [("plain", 2), ("twill 2/2", 4), ("twill 3/1", 4), ("satin 5/2", 5), ("satin 8/3", 8)],
)
def test_stiffness_does_not_depend_on_the_size_of_the_cloth(pattern, repeats):
    """One repeat, twelve, and a part of one behind six: the cloth is the same."""
    yarns = cotton(contact=9.0)
    one, *others = (
        cloth_stiffness(woven(pattern, size=size), yarns)
        for size in (repeats, 12 * repeats, 6 * repeats + 1)
    )
    for other in others:
        np.testing.assert_allclose(other.membrane[2, 2], one.membrane[2, 2], rtol=1e-12)
        np.testing.assert_allclose(other.bending, one.bending, rtol=1e-12)


def test_the_fewer_changes_of_side_the_less_a_cloth_resists_shear():
    """At the same sett, whether crossings are hard or flatten."""
    for contact in (np.inf, 9.0):
        for spacing in (0.5e-3, 0.6e-3, 1e-3):
            found = [
                data_sheet(
                    cloth_stiffness(woven(name, size=n, p=(spacing,) * 2), cotton(contact=contact)),
                    0.1,
                ).shear_rigidity
                for name, n in (("plain", 2), ("twill 2/2", 4), ("satin 5/2", 5), ("satin 8/3", 8))
            ]
            assert found == sorted(found, reverse=True)
            assert found[1] < 0.8 * found[0]


def test_shear_bends_rods_between_crossings():
    """By Castigliano: a rod whose ends keep their directions leans by V/(B P) ∫ r² ds."""
    cloth = woven(d=(0.2e-3, 0.3e-3), p=(0.5e-3, 0.6e-3), exact=True)
    found = data_sheet(cloth_stiffness(cloth, cotton(bending=(B, 3 * B))), 0.1).shear_rigidity
    points, owner = sample_axes(cloth, 256)
    soft = 0.0
    for family, rigidity in enumerate((B, 3 * B)):
        along, crossed = 1 - family, cloth.yarns[1 - family].position
        line = points[owner == 24 * family + 12]
        line = line[(line[:, along] >= crossed[11]) & (line[:, along] <= crossed[12])]
        middle = 0.5 * (line[1:] + line[:-1]) - 0.5 * (line[0] + line[-1])
        step = np.linalg.norm(np.diff(line, axis=0), axis=1)
        lean = (step * (middle**2).sum(axis=1)).sum() / (rigidity * np.ptp(crossed[11:13]))
        soft += lean * cloth.threads[family].spacing
    # the yarn is taken for as long as it is, and straight
    beams = 1 / (1 / found - contact_lean(cloth, (B, 3 * B)))
    assert beams == pytest.approx(1 / soft, rel=0.06)
    assert beams < 1 / soft


def test_a_float_acts_as_one_beam():
    cloth = woven("satin 5/2", size=50)
    length = float(cloth.families[0].crimp.length)
    cubes = 2 * length**3 + (3 * 0.5e-3) ** 3
    one = 12 * B * 5 * 0.5e-3 / cubes / 0.5e-3
    found = data_sheet(cloth_stiffness(cloth, cotton()), 0.1).shear_rigidity
    lean = 2 / one + contact_lean(cloth, (B, B), changes=2 / 5)
    assert found == pytest.approx(1 / lean, rel=1e-9)
    plain = data_sheet(cloth_stiffness(woven(), cotton()), 0.1).shear_rigidity
    beams = 1 / (1 / plain - contact_lean(woven(), (B, B)))
    assert one / 2 < 0.3 * beams
    assert found < 0.35 * plain


def test_yarns_without_finite_stiffness_are_refused():
    for yarns, key in (
        (YarnMechanics(contact=np.inf, bending=(B, B)), "tension"),
        (cotton(bending=(B, 0.0)), "bending"),
        (cotton(contact=0.0), "contact"),
    ):
        with pytest.raises(InputError, match=f"{key}.*more than 0 and finite"):
            cloth_stiffness(woven(), yarns)
    cloth_stiffness(woven(), cotton(contact=0.0)._replace(flattest=1.0))
    wide = woven()
    lone = Cloth(drawdown=wide.drawdown[:1], warp=wide.warp, weft=wide.weft)
    with pytest.raises(InputError, match="24 x 1 yarns"):
        cloth_stiffness(lone, cotton())
