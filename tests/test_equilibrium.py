"""Bodies that hang: elasticas, catenaries and columns, of sheets and of tetrahedra."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipk

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.elements.shell import find_mid_surface, sheet_strains
from spacemap_vtk.mechanics.elements.strains import Strains, tetrahedron_strains
from spacemap_vtk.mechanics.elements.tetrahedra import add_midpoints
from spacemap_vtk.mechanics.equilibrium.energy_terms import DeadLoad, assemble_tangent
from spacemap_vtk.mechanics.equilibrium.newton import Equilibrium, find_equilibrium

FloatArray = NDArray[np.float64]

#: Bending [N m], stretch [N/m], weight [N/m²] and bending length [m] of a light cloth.
BENDING, STRETCH, WEIGHT = 1e-5, 1500.0, 0.15 * 9.81
LENGTH = (BENDING / WEIGHT) ** (1 / 3)


def find_hanging_state(
    terms: list[Strains],
    basis: sp.csr_matrix,
    start: FloatArray,
    load: FloatArray,
    **options: Any,
) -> Equilibrium:
    """Return the equilibrium under forces that keep their directions."""
    return find_equilibrium(terms, basis, start, [DeadLoad(load, start)], **options)


class Sheet(NamedTuple):
    """A flat sheet in z = 0, mid-points first."""

    strains: list[Strains]
    start: FloatArray
    middle: FloatArray
    weights: FloatArray
    """Area that each mid-point carries [m²]."""

    def equilibrium(self, held: NDArray[np.bool_], pull: Any, **options: Any) -> Equilibrium:
        """Return the equilibrium under a force per area, mid-points and directors held."""
        load = np.zeros_like(self.start)
        load[: len(self.middle)] = self.weights[:, None] * np.asarray(pull)
        return find_hanging_state(
            self.strains, free(~np.tile(held, 2)), self.start, load, **options
        )


def sheet(
    size: tuple[float, float],
    cells: tuple[int, int],
    bending: float = BENDING,
    stretch: float = STRETCH,
    poisson: float = 0.0,
) -> Sheet:
    """Return a sheet as thick as a homogeneous one that stretches and bends so."""
    thickness = float(np.sqrt(12 * bending / stretch))
    points, tetrahedra = build_lattice(
        (0, size[0], 0, size[1], -thickness / 2, thickness / 2), (*cells, 1)
    )
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    plane = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    plate = Plate(stretch * plane, bending * plane, 5 / 12 * stretch * np.eye(2), stretch)
    start = surface.to_nodes(points)
    count = len(surface.pairs)
    area = size[0] * size[1] / (cells[0] * cells[1])
    weights = np.bincount(surface.quads.ravel(), minlength=count) * area / 4
    return Sheet(sheet_strains(points, surface, plate), start, start[:count], weights)


def free(rows: NDArray[np.bool_]) -> sp.csr_matrix:
    """Return the basis in which some nodal vectors are free."""
    return sp.identity(3 * len(rows), format="csc")[:, np.flatnonzero(np.repeat(rows, 3))].tocsr()


def strip(lengths: float, cells: int, **material: float) -> tuple[Sheet, NDArray[np.bool_]]:
    """Return a strip along x, so many bending lengths long, and its end at x = 0."""
    made = sheet((lengths * LENGTH, 0.2 * LENGTH), (cells, 1), **material)
    return made, made.middle[:, 0] < 1e-12


def tip_position(made: Sheet, found: Equilibrium) -> FloatArray:
    """Return where the far end of a strip is, in lengths of it."""
    length = made.middle[:, 0].max()
    end = made.middle[:, 0] > length - 1e-12
    return found.positions[: len(end)][end].mean(axis=0) / length


@pytest.mark.parametrize(("cells", "degrees"), [(5, 42.37), (10, 41.72), (20, 41.56), (40, 41.52)])
def test_peirces_cantilever_has_an_angle_of_41_5_degrees(cells: int, degrees: float) -> None:
    """Peirce 1930: at twice the bending length its chord hangs by 41.5° (elastica: 2.00035 c)."""
    made, held = strip(2.00035, cells)
    found = made.equilibrium(held, (0, 0, -WEIGHT))
    x, _, z = tip_position(made, found)
    assert np.degrees(np.arctan2(-z, x)) == pytest.approx(degrees, abs=0.01)
    assert found.residual < 1e-7
    assert found.critical is None


@pytest.mark.parametrize("thickness", [1e-6, 1e-4, 1e-2, 0.1])
def test_cantilever_shape_does_not_depend_on_thickness(thickness: float) -> None:
    """Its bending length is kept: the sheet is as light as it is thin."""
    bending = BENDING * (thickness / 1e-4) ** 3
    stretch = 12 * bending / thickness**2
    length = 2.00035 * LENGTH * max(1.0, thickness / 1e-4)
    made = sheet((length, 0.1 * length), (10, 1), bending, stretch)
    found = made.equilibrium(made.middle[:, 0] < 1e-12, (0, 0, -8.00420 * bending / length**3))
    x, _, z = tip_position(made, found)
    assert np.degrees(np.arctan2(-z, x)) == pytest.approx(41.72, abs=0.02)


def test_long_strip_hangs_like_the_elastica() -> None:
    """Of 7.3211 c; in forty cells it is 0.3 % off, and that falls with their square."""
    ends = []
    for cells in (20, 40):
        made, held = strip(7.3211, cells)
        x, _, z = tip_position(made, made.equilibrium(held, (0, 0, -WEIGHT)))
        ends.append([x, -z])
    coarse, fine = np.array(ends)
    np.testing.assert_allclose(fine, (0.074836, 0.969545), atol=3e-3)
    np.testing.assert_allclose(fine + (fine - coarse) / 3, (0.074836, 0.969545), atol=3e-4)


def test_hanging_strip_stretches_under_its_weight() -> None:
    """A strip hung by its upper edge: W L²/2 A; the same where a hinge lets it fall from level."""
    made, held = strip(20, 20)
    length = made.middle[:, 0].max()
    stretched = WEIGHT * length / 2 / STRETCH
    down = made.equilibrium(held, (WEIGHT, 0, 0))
    assert tip_position(made, down) == pytest.approx(
        [1 + stretched, 0.005, 0], abs=0.01 * stretched
    )
    load = np.zeros_like(made.start)
    load[: len(held), 2] = -WEIGHT * made.weights
    hinge = free(~np.concatenate([held, held & False]))
    fallen = find_hanging_state(made.strains, hinge, made.start, load)
    assert tip_position(made, fallen) == pytest.approx(
        [0, 0.005, -1 - stretched], abs=0.01 * stretched
    )


def test_a_sheet_between_two_lines_is_a_catenary() -> None:
    """Its ends a fifth nearer to each other, nearly without bending or stretch."""
    made = sheet((0.3, 0.02), (48, 1), bending=1e-9, stretch=1e4)
    x = made.middle[:, 0]
    ends = (x < 1e-12) | (x > 0.3 - 1e-12)
    start = made.start.copy()
    start[: len(x), 0] *= 0.8
    load = np.zeros_like(start)
    load[: len(x), 2] = -WEIGHT * made.weights
    rows = np.concatenate([~ends, np.ones(len(x), dtype=bool)])
    found = find_hanging_state(made.strains, free(rows), start, load)
    # z = a cosh(x/a), 2 a sinh(0.12/a) = 0.3.
    a = brentq(lambda a: 2 * a * np.sinh(0.12 / a) - 0.3, 0.01, 1.0)
    sag = a * (np.cosh(0.12 / a) - 1)
    middle = found.positions[: len(x)][abs(x - 0.15) < 1e-9]
    assert middle[:, 2] == pytest.approx(-sag, rel=2e-3)
    assert middle[:, 0] == pytest.approx(0.12, abs=1e-6)


def column(share: float, **options: Any) -> tuple[Sheet, Equilibrium]:
    """Press a strip along its length with a share of Euler's load, its one end clamped."""
    made = sheet((0.1, 0.01), (20, 1))
    x = made.middle[:, 0]
    load = np.zeros_like(made.start)
    end = np.flatnonzero(x > 0.1 - 1e-12)
    load[end, 0] = -share * np.pi**2 * BENDING * 0.01 / (4 * 0.1**2) / len(end)
    basis = free(~np.tile(x < 1e-12, 2))
    return made, find_hanging_state(made.strains, basis, made.start, load, **options)


def test_a_strip_pressed_along_its_length_buckles_at_eulers_load() -> None:
    """π² B/(4 L²) per width, reported as a share of the load; past it the elastica's large bow."""
    made, found = column(0.98)
    assert found.critical is None
    assert abs(found.positions[:, 1:] - made.start[:, 1:]).max() < 1e-9
    for share in (1.02, 1.1, 5.0):
        made, found = column(share)
        assert found.critical == pytest.approx(1 / share, rel=2e-3)
    # Where its end is turned by θ, P = (4/π²) K(sin² θ/2)² of Euler's load.
    for share in (1.1, 5.0):
        made, found = column(share)
        directors = found.positions[len(made.middle) :][made.middle[:, 0] > 0.1 - 1e-12]
        turned = np.arccos(directors[:, 2] / np.linalg.norm(directors, axis=1))
        expected = brentq(
            lambda t, p=share: (2 / np.pi * ellipk(np.sin(t / 2) ** 2)) ** 2 - p, 0.1, 3
        )
        assert turned == pytest.approx(expected, rel=5e-3)


def test_strip_on_its_edge_falls_over() -> None:
    """A column buckles under its own weight from w L³ = 7.8373 B on (Greenhill 1881)."""
    made, held = strip(1.9, 20)
    assert made.equilibrium(held, (-WEIGHT, 0, 0)).critical is None
    made, held = strip(20, 40)
    falls = made.equilibrium(held, (-WEIGHT, 0, 0))
    assert falls.critical == pytest.approx(7.8373 / 20**3, rel=2e-3)
    assert tip_position(made, falls)[0] < -0.9


@pytest.mark.parametrize("load", [1.0, 2.0, 5.0, 10.0])
def test_a_cantilever_of_quadratic_tetrahedra_is_the_elastica(load: float) -> None:
    """P L²/(E I): Bisshopp and Drucker, Quart. Appl. Math. 3 (1945) 272."""
    table = {1: (0.3017, 0.0564), 2: (0.4935, 0.1606), 5: (0.7138, 0.3876), 10: (0.8106, 0.5550)}
    points, cells = add_midpoints(*build_lattice((0, 1, 0, 0.05, -0.01, 0.01), (24, 1, 1)))
    x = points[:, 0]
    end = x > 1 - 1e-12
    force = np.zeros_like(points)
    force[end, 2] = -load * 1e6 * 0.05 * 0.02**3 / 12 / end.sum()
    strains = [tetrahedron_strains(points, cells, isotropic(1e6, 0.0))]
    found = find_hanging_state(strains, free(x > 1e-12), points, force)
    moved = (found.positions - points)[end].mean(axis=0)
    assert (-moved[2], -moved[0]) == pytest.approx(table[int(load)], abs=1.5e-3)


def test_very_flat_tetrahedra_reach_equilibrium() -> None:
    """Rounding leaves 6 % of the load unbalanced, and yet the stretch is that of ρ g L²/2 E."""
    points, cells = add_midpoints(*build_lattice((0, 0.1, 0, 1, 0, 3e-4), (2, 20, 1)))
    edges = points[cells[:, 1:4]] - points[cells[:, :1]]
    weights = np.repeat(300 * 9.81 * abs(np.linalg.det(edges)) / 36, 6)
    load = np.zeros_like(points)
    load[:, 1] = -np.bincount(cells[:, 4:].ravel(), weights, len(points))
    strains = [tetrahedron_strains(points, cells, isotropic(40e6, 0.0))]
    found = find_hanging_state(strains, free(points[:, 1] < 1 - 1e-12), points, load)
    assert found.residual > 1e-3
    low = (found.positions - points)[points[:, 1] < 1e-12, 1]
    assert low == pytest.approx(-300 * 9.81 / (2 * 40e6), rel=1e-3)


def test_state_with_inverted_elements_is_refused() -> None:
    """A column of tetrahedra bears E A/√27 at most, as its stress is E λ (λ² - 1)/2."""
    points, cells = build_lattice((0, 1, 0, 1, 0, 1), (1, 1, 2))
    top, height = points[:, 2] > 1 - 1e-12, points[:, 2]
    strains = [tetrahedron_strains(points, cells, isotropic(1e6, 0.0))]
    rows = np.flatnonzero(height > 1e-12)
    basis = sp.identity(points.size, format="csc")[:, 3 * rows + 2].tocsr()
    load = np.zeros_like(points)
    faces = cells[top[cells].sum(axis=1) == 3]  # two triangles
    load[:, 2] = -1e6 * np.bincount(faces[top[faces]], minlength=len(points)) / 6
    squeezed = find_hanging_state(strains, basis, points, 0.18 * load).positions[top, 2]
    assert squeezed == pytest.approx(brentq(lambda x: x * (x * x - 1) / 2 + 0.18, 0.6, 0.99))
    with pytest.raises(SolverError, match="the search reached") as refused:
        find_hanging_state(strains, basis, points, 0.25 * load)
    share = float(str(refused.value).split("% of the load")[0].split()[-1]) / 100
    assert 27**-0.5 / 0.25 - 2 / 64 < share <= 27**-0.5 / 0.25


def draped_cloth(cells: int) -> tuple[Sheet, NDArray[np.bool_]]:
    """Return a square of 300 mm, held on a disc of 180 mm."""
    made = sheet((0.3, 0.3), (cells, cells), poisson=0.3)
    return made, np.hypot(*(made.middle[:, :2] - 0.15).T) <= 0.09 + 1e-9


def test_draped_cloth_has_stable_folds() -> None:
    """However symmetric at first; in some twenty steps, where less energy alone took 82."""
    made, held = draped_cloth(24)
    reported: list[float] = []
    found = made.equilibrium(held, (0, 0, -WEIGHT), progress=reported.append)
    assert found.residual < 1e-7
    assert found.steps < 40
    assert reported == sorted(reported)
    assert reported[-1] == 1.0
    basis = free(~np.tile(held, 2))
    stiffness = (basis.T @ assemble_tangent(made.strains, found.positions) @ basis).tocsc()
    # No negative pivot without exchanges: positive definite, by Sylvester.
    factors = sp.linalg.splu(stiffness, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    assert (factors.U.diagonal() > 0).all()
    assert found.positions[: len(held), 2].min() == pytest.approx(-0.11, abs=0.01)
    lengths = np.linalg.norm(found.positions[len(held) :], axis=1)
    np.testing.assert_allclose(lengths, made.start[len(held) :, 2], rtol=1e-3)


def test_equilibrium_does_not_depend_on_load_steps() -> None:
    """Half of the weight first, or the whole at once; and with none it is flat again."""
    made, held = strip(5, 20)
    load = np.zeros_like(made.start)
    load[: len(held), 2] = -WEIGHT * made.weights
    basis = free(~np.tile(held, 2))
    once = find_hanging_state(made.strains, basis, made.start, load).positions
    half = find_hanging_state(made.strains, basis, made.start, 0.5 * load).positions
    after = find_hanging_state(made.strains, basis, half, load).positions
    size = made.middle[:, 0].max()
    np.testing.assert_allclose(after, once, atol=1e-7 * size)
    flat = find_hanging_state(made.strains, basis, once, 0.0 * load).positions
    np.testing.assert_allclose(flat, made.start, atol=1e-7 * size)


def test_supports_can_slide_along_any_line() -> None:
    """On a line at 30° as on an axis in a frame turned by 30°."""
    made = sheet((0.1, 0.02), (12, 2))
    x = made.middle[:, 0]
    count, end = len(x), x > 0.1 - 1e-12
    angle = np.pi / 6
    turn = np.array(
        [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    )
    rows = ~np.tile(x < 1e-12, 2)
    rows[:count] &= ~end
    load = np.zeros_like(made.start)
    load[:count] = made.weights[:, None] * [0.4, 0, -20 * WEIGHT]
    along = np.zeros((6 * count, int(end.sum())))
    along[3 * np.flatnonzero(end), np.arange(end.sum())] = 1.0
    basis = sp.hstack([free(rows), sp.csr_matrix(along)]).tocsr()
    straight = find_hanging_state(made.strains, basis, made.start, load)
    turned = sp.kron(sp.identity(2 * count), turn).tocsr() @ basis
    start, strains = made.start @ turn.T, made.strains
    found = find_hanging_state(strains, turned.tocsr(), start, load @ turn.T)
    np.testing.assert_allclose(found.positions, straight.positions @ turn.T, atol=1e-9)
    assert abs(straight.positions - made.start).max() > 0.01


def test_unsupported_body_is_refused() -> None:
    """Free, and where only one part of two is held; a free body without a net force may rest."""
    made, held = strip(2, 6)
    with pytest.raises(InputError, match="the cage, or a part of it, is not held"):
        made.equilibrium(held & False, (0, 0, -WEIGHT))
    two = [
        Strains(
            np.concatenate([kind.nodes, kind.nodes + len(made.start)]),
            kind.forms,  # of all elements
            *(np.concatenate([a, a]) for a in (kind.reference, kind.stiffness)),
        )
        for kind in made.strains
    ]
    rows = np.concatenate([~np.tile(held, 2), np.ones(len(made.start), dtype=bool)])
    load = np.zeros((len(rows), 3))
    load[-len(made.start) : -len(held), 2] = -1e-3 * made.weights
    with pytest.raises(InputError, match="Fix a side"):
        find_hanging_state(two, free(rows), np.concatenate([made.start, made.start]), load)
    ends = made.middle[:, 0] > made.middle[:, 0].max() - 1e-12
    resting = made.equilibrium(held & False, np.outer(1.0 * ends - held, (WEIGHT, 0, 0)))
    assert resting.residual < 1e-7


def test_too_few_steps_report_the_share_of_the_load() -> None:
    """And what to do."""
    made, held = draped_cloth(8)
    with pytest.raises(
        SolverError, match=r"in 5 steps: the search reached 0\.0% of the load\. Lower the load"
    ):
        made.equilibrium(held, (0, 0, -WEIGHT), steps=5)
    with pytest.raises(
        SolverError,
        match=r"reached 0\.0% of the load, and the cage buckles at 20\.0% of it",
    ):
        column(5.0, steps=12)


def test_search_can_be_cancelled() -> None:
    """At any step: what progress raises comes out."""
    made, held = draped_cloth(8)
    count = 0

    def stop(_: float) -> None:
        nonlocal count
        count += 1
        if count == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made.equilibrium(held, (0, 0, -WEIGHT), progress=stop)
    assert count == 4
