"""Two terms of the energy added in this file: a soft half-space, and a barrier that is logarithmic.

What hangs, vibrates and moves obeys them, and the cache of modes tells them apart.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from vtkmodules.vtkFiltersSources import vtkCubeSource

from spacemap_vtk import ModalSolver, TetraCage, TransientResponse
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import array_of
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.loads import find_side_faces, traction_forces
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium import energy_terms
from spacemap_vtk.mechanics.equilibrium.energy_terms import (
    EnergyTerm,
    VertexTerm,
    assemble_tangent,
    digest_of,
    energy_term,
)

FloatArray = NDArray[np.float64]

#: Gravity [m/s²]; sides [m], Young's modulus [Pa] and density [kg/m³] of a block.
GRAVITY, SIDE, YOUNG, DENSITY = 10.0, 0.1, 1e6, 1000.0
WEIGHT = DENSITY * SIDE**3 * GRAVITY
AREA = SIDE**2


class HalfSpace(EnergyTerm):
    """What lies below a height pushes up: ½ k a min(0, z - height)² of each vertex of area a."""

    def __init__(
        self, nodes: NDArray[np.int64], areas: FloatArray, height: float, stiffness: float
    ) -> None:
        self.nodes, self._areas = nodes[:, None], areas
        self._height, self._stiffness = height, stiffness

    @property
    def digest(self) -> str:
        return digest_of("half-space", self.nodes, self._areas, self._height, self._stiffness)

    def _above(self, positions: FloatArray) -> FloatArray:
        return positions[self.nodes[:, 0], 2] - self._height

    def energy(self, positions: FloatArray) -> float:
        depth = np.minimum(0.0, self._above(positions))
        return float(0.5 * self._stiffness * self._areas @ depth**2)

    def forces(self, positions: FloatArray) -> FloatArray:
        result = np.zeros_like(positions)
        depth = np.minimum(0.0, self._above(positions))
        result[self.nodes[:, 0], 2] = self._stiffness * self._areas * depth
        return result

    def tangent(self, positions: FloatArray) -> FloatArray:
        result = np.zeros((len(self.nodes), 3, 3))
        result[:, 2, 2] = self._stiffness * self._areas * (self._above(positions) < 0.0)
        return result

    def largest_step(self, positions: FloatArray, move: FloatArray) -> float:
        """No vertex comes from above to more than a millimetre below."""
        above, down = self._above(positions), -move[self.nodes[:, 0], 2]
        falling = (above > 0.0) & (down > 0.0)
        return float(((above + 1e-3)[falling] / down[falling]).min(initial=np.inf))


class Barrier(HalfSpace):
    """A height that no vertex passes: -k a log(z - height)."""

    @property
    def digest(self) -> str:
        return digest_of("barrier", super().digest)

    def energy(self, positions: FloatArray) -> float:
        return -float(self._stiffness * self._areas @ np.log(self._above(positions)))

    def forces(self, positions: FloatArray) -> FloatArray:
        result = np.zeros_like(positions)
        result[self.nodes[:, 0], 2] = -self._stiffness * self._areas / self._above(positions)
        return result

    def tangent(self, positions: FloatArray) -> FloatArray:
        result = np.zeros((len(self.nodes), 3, 3))
        result[:, 2, 2] = self._stiffness * self._areas / self._above(positions) ** 2
        return result

    def largest_step(self, positions: FloatArray, move: FloatArray) -> float:
        """Nine tenths of the way to the barrier at most."""
        above, down = self._above(positions), -move[self.nodes[:, 0], 2]
        falling = down > 0.0
        return float((0.9 * above[falling] / down[falling]).min(initial=np.inf))

    def admits(self, start: FloatArray, positions: FloatArray) -> bool:
        return bool((self._above(positions) > 0.0).all())


def _of_underside(
    made: type[HalfSpace],
    points: FloatArray,
    cells: NDArray[np.int64],
    height: float,
    stiffness: float,
) -> HalfSpace:
    areas = traction_forces(len(points), find_side_faces(points, cells, "-z"), [0.0, 0.0, 1.0])[
        :, 2
    ]
    nodes = np.flatnonzero(areas)
    return made(nodes, areas[nodes], height, stiffness)


@energy_term("half-space")
def half_space(points: Any, cells: Any, *, height: float, stiffness: float) -> HalfSpace:
    return _of_underside(HalfSpace, points, cells, height, stiffness)


@energy_term("barrier")
def barrier(points: Any, cells: Any, *, height: float, stiffness: float) -> HalfSpace:
    return _of_underside(Barrier, points, cells, height, stiffness)


def solver(
    *,
    divisions: tuple[int, int, int] = (1, 1, 2),
    thickness: float = SIDE,
    kind: str = "half-space",
    height: float = 1e-4,
    stiffness: float = 1e5,
    **values: Any,
) -> ModalSolver:
    """Return the solver of a block that stands at z = 0, and slides up and down its walls."""
    box = vtkCubeSource()
    box.SetBounds(0, SIDE, 0, SIDE, 0, thickness)
    cage = TetraCage(divisions=divisions, padding=0.0)
    cage.SetInputConnection(box.GetOutputPort())
    given: dict[str, Any] = {
        "youngs_modulus": YOUNG,
        "poissons_ratio": 0.0,
        "density": DENSITY,
        "fixed": ["-x:x", "+x:x", "-y:y", "+y:y"],
        "terms": [{"kind": kind, "height": height, "stiffness": stiffness}],
        "elements": "tetrahedra",
    }
    found = ModalSolver(**{**given, **values})
    found.SetInputConnection(cage.GetOutputPort())
    return found


def underside(stage: Any) -> FloatArray:
    """Return the heights of the lower vertices, in equilibrium."""
    points = np.array(stage.output.GetPoints().GetData())
    moved = array_of(stage.output.GetPointData(), "equilibrium", "the test")
    return np.asarray((points + moved)[points[:, 2] < 1e-12, 2])


def test_code_of_the_page_on_adding_an_energy_works(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(energy_terms, "_MAKERS", dict(energy_terms._MAKERS))
    page = Path(__file__).parents[1] / "docs" / "contributing" / "add_an_energy.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    names: dict[str, Any] = {}
    exec("\n".join(blocks), names)
    names.clear()


@pytest.mark.parametrize("maker", [half_space, barrier])
@pytest.mark.parametrize("sheet", [False, True])
def test_forces_and_tangent_are_derivatives_of_the_energy(maker: Any, sheet: bool) -> None:
    """Of the term, and of the same on the mid-points and half thicknesses of a sheet."""
    points, cells = build_lattice((0, 1, 0, 1, 0, 0.1), (3, 3, 1))
    term: EnergyTerm = maker(points, cells, height=-0.5, stiffness=3.0)
    if maker is half_space:
        term = maker(points, cells, height=0.02, stiffness=3.0)
    if sheet:
        surface = find_mid_surface(points, cells)
        assert surface is not None
        term, points = VertexTerm(term, surface, 0.5), surface.to_nodes(points)
    random = np.random.default_rng(0)
    place, way = points + 0.01 * random.normal(size=points.shape), random.normal(size=points.shape)
    step = 1e-6
    slope = (term.energy(place + step * way) - term.energy(place - step * way)) / (2 * step)
    assert slope == pytest.approx(float(np.vdot(term.forces(place), way)), rel=1e-6)
    change = (term.forces(place + step * way) - term.forces(place - step * way)) / (2 * step)
    expected = (assemble_tangent([term], place) @ way.ravel()).reshape(change.shape)
    np.testing.assert_allclose(change, expected, atol=1e-6 * abs(expected).max())


@pytest.mark.parametrize("height", [1e-4, -5e-3])
def test_body_sinks_into_a_soft_half_space_by_its_weight(height: float) -> None:
    """Touching it at first or not; W = k A d, as a rod presses its base evenly."""
    stage = solver(gravity=(0, 0, -GRAVITY), height=height)
    stage.update()
    depth = height - underside(stage)
    assert depth == pytest.approx(WEIGHT / (1e5 * AREA), rel=1e-2)
    (term,) = model_of(stage.output).terms
    points = np.array(stage.output.GetPoints().GetData())
    moved = array_of(stage.output.GetPointData(), "equilibrium", "the test")
    assert term.forces(points + moved)[:, 2].sum() == pytest.approx(-WEIGHT, rel=1e-7)


def test_sheet_rests_on_a_soft_half_space() -> None:
    """Whose unknowns are mid-points and half thicknesses."""
    thickness = 1e-3
    stage = solver(
        divisions=(4, 4, 1),
        thickness=thickness,
        elements="sheet",
        gravity=(0, 0, -GRAVITY),
        stiffness=1e4,
    )
    stage.update()
    depth = 1e-4 - underside(stage)
    assert depth == pytest.approx(DENSITY * thickness * GRAVITY / 1e4, rel=1e-2)


def test_barrier_is_never_passed() -> None:
    """W = k A/gap; steps are as long as the term admits."""
    stage = solver(gravity=(0, 0, -GRAVITY), kind="barrier", height=-0.05, stiffness=1.0)
    stage.update()
    assert underside(stage) + 0.05 == pytest.approx(1.0 * AREA / WEIGHT, rel=1e-2)


def test_column_on_a_half_space_vibrates_as_on_a_spring() -> None:
    """β L tan β L = k L/E, ω = β √(E/ρ); where it does not touch, the lowest mode is rigid."""
    stiffness = YOUNG / SIDE
    stage = solver(divisions=(1, 1, 16), stiffness=stiffness, gravity=(0, 0, -1e-3), height=0.0)
    stage.modes = 2
    stage.terms = [{"kind": "half-space", "height": 1e-9, "stiffness": stiffness}]
    stage.update()
    found = array_of(stage.output.GetFieldData(), "frequencies", "the test")
    beta = brentq(lambda x: x * np.tan(x) - 1.0, 0.1, 1.5) / SIDE
    assert found[0] == pytest.approx(beta * np.sqrt(YOUNG / DENSITY) / (2 * np.pi), rel=2e-3)
    stage.terms, stage.gravity = [], (0, 0, 0)
    stage.update()
    assert array_of(stage.output.GetFieldData(), "frequencies", "the test")[0] < 1e-3 * found[0]


def test_bouncing_block_conserves_energy() -> None:
    """Dropped by h it sinks to d with k A d²/2 = W (h + d), and comes back to where it was."""
    drop, stiffness = 5e-3, 2e5
    stage = solver(divisions=(1, 1, 1), height=-drop, stiffness=stiffness, youngs_modulus=2e7)
    moving = TransientResponse(alpha=0.0, gravity=(0, 0, -GRAVITY), max_step="0.5 ms")
    moving.SetInputConnection(stage.GetOutputPort())
    moving.update(time=0.2)
    motion = moving.motion
    assert motion is not None
    times = np.linspace(0.0, 0.2, 801)
    energy = motion.energies(times)
    kinetic, held, lost, work = energy.T
    drift = abs(kinetic + held + lost - work).max() / kinetic.max()
    assert drift < 1e-9
    weights = np.full(8, 1 / 8)
    height = motion.history(weights, times)[0, :, 2]
    spring = stiffness * AREA
    lowest = (WEIGHT + np.sqrt(WEIGHT**2 + 2 * spring * WEIGHT * drop)) / spring
    assert -height.min() == pytest.approx(drop + lowest, rel=1e-2)
    after = height[times > times[height.argmin()]]
    assert after.max() == pytest.approx(0.0, abs=0.05 * drop)
    fall = times < 0.9 * np.sqrt(2 * drop / GRAVITY)
    np.testing.assert_allclose(height[fall], -GRAVITY * times[fall] ** 2 / 2, atol=1e-9)


@pytest.mark.nightly
def test_body_falling_onto_a_barrier_turns_before_it() -> None:
    """The block floats on k A log(gap), about the gap k A/W, and keeps its energy."""
    stage = solver(
        divisions=(1, 1, 1),
        kind="barrier",
        height=-5e-3,
        stiffness=2.0,
        youngs_modulus=2e7,
        hang=False,
    )
    moving = TransientResponse(alpha=0.0, gravity=(0, 0, -GRAVITY), max_step="1 ms")
    moving.SetInputConnection(stage.GetOutputPort())
    moving.update(time=0.07)
    motion = moving.motion
    assert motion is not None
    times = np.linspace(0.0, 0.07, 281)
    kinetic, held, lost, work = motion.energies(times).T
    total = kinetic + held + lost - work
    assert abs(total - total[0]).max() < 1e-8 * kinetic.max()
    gap = 5e-3 + motion.history(np.full(8, 1 / 8), times)[0, :, 2]
    # W gap - k A log(gap) is there again what it was at the start.
    nearest = brentq(lambda x: WEIGHT * (x - 5e-3) - 2.0 * AREA * np.log(x / 5e-3), 1e-5, 1.9e-3)
    assert gap.min() == pytest.approx(nearest, rel=2e-2)


def test_different_terms_have_different_cache_entries() -> None:
    """Two heights, two stiffnesses, two kinds: each a model, modes and a file of its own."""
    ways: list[dict[str, Any]] = [
        {"height": 1e-4},
        {"height": 2e-4},
        {"stiffness": 2e5},
        {"kind": "barrier", "height": -1e-4},
        {"terms": []},
    ]
    models = []
    for way in ways:
        stage = solver(**way)
        stage.update()
        models.append(model_of(stage.output))
    assert len({model.digest for model in models}) == len(ways)
    again = solver(height=2e-4)
    again.update()
    assert model_of(again.output).digest == models[1].digest


def test_only_changed_terms_run_the_solver_again() -> None:
    stage = solver()
    stage.update()
    stage.terms = [{"kind": "half-space", "height": 1e-4, "stiffness": 1e5}]
    stage.update()
    assert stage.executions == 1
    stage.terms = []
    stage.update()
    assert stage.executions == 2


@pytest.mark.parametrize(
    ("recipe", "text"),
    [
        ({"kind": "magnet"}, "half-space"),
        ({"kind": "half-space", "height": 0.0}, "stiffness"),
        ({"kind": "half-space", "height": 0.0, "stiffness": 1.0, "colour": 2}, "colour"),
    ],
)
def test_invalid_recipe_is_refused(recipe: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        ModalSolver(terms=[recipe])
