"""Cages that are sheets, and cages that hang before anything moves, as filters have them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray

from spacemap_vtk import (
    BarycentricWarp,
    ModalResponse,
    ModalSolver,
    SpacemapWarning,
    TetraCage,
    cache,
    connect,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.response.energy import balance_energies

FloatArray = NDArray[np.float64]
GRAVITY = 9.80665
#: A curtain of 1 m by 0.1 m, 0.3 mm thick.
LENGTH, WIDTH, THICKNESS, MODULUS, DENSITY = 1.0, 0.1, 3e-4, 40e6, 300.0


class Curtain:
    """A strip that hangs by its upper edge, +y."""

    def __init__(self, cells: int = 5, thickness: float = THICKNESS, **solver: Any) -> None:
        box = pv.Box((0, WIDTH, 0, LENGTH, 0, thickness))
        self.cage = TetraCage(divisions=(1, cells, 1), padding=0.0)
        self.cage.SetInputDataObject(box)
        given = {"youngs_modulus": MODULUS, "poissons_ratio": 0.0, "density": DENSITY, "modes": 30}
        self.solver = ModalSolver(**given | {"gravity": (0, -GRAVITY, 0)} | solver)
        self.response = ModalResponse()
        connect(self.cage, self.solver, self.response)

    def at(self, time: float) -> Any:
        return pv.wrap(self.response.update(time).output)

    @property
    def frequencies(self) -> FloatArray:
        return np.array(pv.wrap(self.solver.update().output).field_data["frequencies"])


@pytest.mark.parametrize(("cells", "first"), [(5, 0.6023), (20, 0.6025)])
def test_hanging_curtain_has_the_frequencies_of_a_chain(cells: int, first: float) -> None:
    """j₀ₙ/(4π) √(g/L) is 0.59939 and 1.37585 Hz; what the strip resists bending adds to both."""
    found = Curtain(cells).frequencies
    assert found[0] == pytest.approx(first, abs=1e-4)
    if cells == 20:
        # The second is a twist, the third the chain's second.
        assert found[2] == pytest.approx(1.394, abs=1e-3)
    # What has no weight swings by its stiffness alone.
    assert Curtain(cells, gravity=(0, 0, 0)).frequencies[0] == pytest.approx(0.0177, rel=0.05)


def test_hanging_cage_stays_at_rest_under_its_own_gravity() -> None:
    """The same gravity is not counted twice: nobody's wish, or given again."""
    curtain = Curtain()
    for gravity in (curtain.response.gravity, (0, -GRAVITY, 0)):
        curtain.response.gravity = gravity
        for time in (0.0, 0.3, 5.0):
            moved = curtain.at(time)
            np.testing.assert_array_equal(moved["displacement"], moved["equilibrium"])
            assert not moved["velocity"].any()
    # It hangs ρ g L²/2E longer.
    longer = DENSITY * GRAVITY * LENGTH**2 / (2 * MODULUS)
    assert -moved["equilibrium"][:, 1].min() == pytest.approx(longer, rel=1e-3)


def test_stress_and_energy_are_those_of_the_deformed_state() -> None:
    """The weight below is carried by each cell; all of it stores (ρg)² A L³/6E."""
    curtain = Curtain(20)
    moved = curtain.at(1.0)
    heights = moved.cell_centers().points[:, 1]
    cell = LENGTH / 20
    middle = (np.floor(heights / cell) + 0.5) * cell
    np.testing.assert_allclose(moved["stress"][:, 1], DENSITY * GRAVITY * middle, rtol=1e-3)
    np.testing.assert_allclose(moved["strain"][:, 1], moved["stress"][:, 1] / MODULUS, rtol=1e-9)
    stored = (DENSITY * GRAVITY) ** 2 * WIDTH * THICKNESS * LENGTH**3 / (6 * MODULUS)
    assert moved.field_data["strain_energy"][0] == pytest.approx(stored, rel=2e-3)
    assert moved.field_data["external_work"][0] == moved.field_data["strain_energy"][0]


def test_hanging_cloth_tilts_like_a_pendulum() -> None:
    """By 5°, it moves by 5° of its length; without its weight in K by 3.8 lengths."""
    curtain, angle = Curtain(10), math.radians(5)
    curtain.response.initial = "equilibrium"
    curtain.response.gravity = (0, -GRAVITY * math.cos(angle), GRAVITY * math.sin(angle))
    assert curtain.at(0.0)["displacement"][:, 2].max() == pytest.approx(math.sin(angle), rel=0.02)
    # Let go where it hung: it swings about that place, up to the double.
    curtain.response.initial, curtain.response.alpha = "rest", 0.0
    swung = [curtain.at(t)["displacement"][:, 2].max() for t in np.linspace(0, 2, 41)]
    assert abs(swung[0]) < 1e-15
    assert 1.8 * math.sin(angle) < max(swung) < 2.4 * math.sin(angle)
    energies = [
        np.array([float(curtain.at(t).field_data[name][0]) for name in ENERGIES]) for t in T
    ]
    for kinetic, strain, lost, work in energies:
        assert kinetic + strain + lost == pytest.approx(work, rel=1e-9)
        assert lost <= 1e-12 * work
    # The weight under which it hangs has a potential, too.
    motion, times = curtain.response.motion, np.linspace(0, 2, 41)
    assert motion is not None
    work = motion.energies(np.zeros(1))[0, 3]
    found = balance_energies(motion.energies(times), motion.potential(times), work)
    np.testing.assert_allclose(found.work, 0.0, atol=1e-9 * found.kinetic.max())
    np.testing.assert_allclose(found.total, found.total[0], atol=1e-9 * found.kinetic.max())
    assert -found.potential.min() > 0.5 * found.kinetic.max()


ENERGIES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
T = (0.1, 0.5, 1.0)


def test_sheet_and_quadratic_tetrahedra_have_the_same_equilibrium() -> None:
    """A strip so thick that both hold, level at first, nearly as long down as it was."""
    level: dict[str, Any] = {"gravity": (0, 0, -GRAVITY), "youngs_modulus": 1e5}
    sheet = Curtain(20, 0.05, elements="sheet", **level)
    solid = Curtain(20, 0.05, elements="tetrahedra", **level)
    solid.cage.order, solid.cage.divisions = 2, (1, 16, 2)
    down = [float(curtain.at(0.0)["equilibrium"][:, 2].min()) for curtain in (sheet, solid)]
    assert down[0] < -0.95 * LENGTH
    assert down[1] == pytest.approx(down[0], rel=5e-3)
    np.testing.assert_allclose(sheet.frequencies[:3], solid.frequencies[:3], rtol=0.02)


def test_dead_loads_act_in_the_equilibrium() -> None:
    """A pull at the lower edge, as a traction and as its forces, stretches by σ/E and stiffens."""
    pull = 2e5
    pulled = Curtain(gravity=(0, 0, 0), dead_loads=[{"traction": (0, -pull, 0), "on": "-y"}])
    rested = pulled.at(1.0)
    assert rested["displacement"][:, 1].min() == pytest.approx(-pull / MODULUS, rel=0.01)
    # A string of such a tension: √(σ/ρ)/4L, its lower edge being free.
    assert pulled.frequencies[0] == pytest.approx(math.sqrt(pull / DENSITY) / 4, rel=0.03)


@pytest.mark.parametrize(
    ("load", "key"),
    [
        ({"gravity": (0, 0, -1)}, "dead_loads[0]"),
        ({"base_displacement": (0, 0, 1)}, "dead_loads[0]"),
        ({"pressure": 1.0, "on": "+z", "time": "ramp", "rise": 1.0}, "dead_loads[0]"),
    ],
)
def test_load_with_a_time_function_is_not_a_dead_load(load: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match="a dead load must be constant") as refused:
        Curtain(dead_loads=[load]).solver.update()
    assert refused.value.key == key


def test_equilibrium_is_cached(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On disk, and in memory while only the modes' number changes."""
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path))
    first = Curtain().at(0.0)["equilibrium"]
    stored: list[str] = []
    monkeypatch.setattr(cache, "store", lambda name, **_: stored.append(name))
    again = Curtain()
    np.testing.assert_array_equal(again.at(0.0)["equilibrium"], first)
    again.solver.modes = 4
    again.solver.update()
    assert not [name for name in stored if name.startswith("rest-")]
    again.solver.gravity = (0, -1.0, 0)
    again.solver.update()
    assert [name for name in stored if name.startswith("rest-")]


def test_fabric_follows_the_equilibrium_and_stages_run_once() -> None:
    curtain = Curtain()
    warp = BarycentricWarp()
    warp.SetInputDataObject(0, pv.Box((0, WIDTH, 0, LENGTH, 0, THICKNESS)))
    warp.SetInputConnection(1, curtain.response.GetOutputPort())
    moved = pv.wrap(warp.update(0.0).output)
    assert moved.bounds[2] == pytest.approx(curtain.at(0.0)["equilibrium"][:, 1].min(), rel=1e-3)
    curtain.response.loads = [{"pressure": 0.01, "on": "+z"}]
    warp.update(0.5)
    assert (curtain.solver.executions, curtain.response.executions) == (1, 2)


def test_auto_is_a_sheet_if_cells_are_four_times_as_wide_as_thick() -> None:
    def sheet(**cage: Any) -> bool:
        curtain = Curtain(gravity=(0, 0, 0))
        curtain.cage.configure(**cage)
        return "membrane_stiffness" in pv.wrap(curtain.solver.update().output).field_data

    curtain = {"divisions": (1, 5, 1)}
    assert sheet(**curtain)
    assert sheet(**curtain, method="carved", margin=0)
    assert not sheet(**curtain, order=2)
    assert not sheet(divisions=(1, 5, 2))


def test_sheet_is_refused_for_other_cages() -> None:
    curtain = Curtain(elements="sheet")
    for change in ({"order": 2}, {"order": 1, "divisions": (2, 5, 2)}):
        curtain.cage.configure(**change)
        with pytest.raises(InputError, match="it is not a lattice of one layer"):
            curtain.solver.update()


def test_compressed_strip_reports_buckling(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Standing on its edge it falls over (Greenhill: ρ g A L³ = 7.8373 E I), again from disk."""
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path))
    thickness = 0.01
    share = 7.8373 * MODULUS * thickness**2 / 12 / (DENSITY * GRAVITY * LENGTH**3)
    for _ in range(2):
        standing = Curtain(20, thickness, fixed="-y", gravity=(0, -2 * GRAVITY * share, 0))
        with pytest.warns(SpacemapWarning, match="buckles at 0.5"):
            standing.solver.update()
    straight = Curtain(20, thickness, fixed="-y", gravity=(0, -0.9 * GRAVITY * share, 0))
    assert abs(straight.at(0.0)["equilibrium"][:, 2]).max() < 1e-6


def test_cage_with_hang_off_falls_under_its_gravity() -> None:
    curtain = Curtain(hang=False)
    assert "equilibrium" not in curtain.at(0.0).point_data
    assert not curtain.at(0.0)["displacement"].any()
    np.testing.assert_array_equal(
        curtain.response.gravity_for(curtain.solver.output), [0, -GRAVITY, 0]
    )
    # Downwards, by half of g t² at first.
    fallen = curtain.at(1e-3)["displacement"]
    assert np.median(fallen[:, 1]) == pytest.approx(-GRAVITY / 2 * 1e-6, rel=0.05)
    assert abs(fallen[:, [0, 2]]).max() < 1e-3 * abs(fallen).max()
    curtain.solver.hang = True
    assert curtain.at(0.0)["equilibrium"][:, 1].min() < 0
    # Once more without: nothing of it is left.
    curtain.solver.hang = False
    assert not curtain.at(0.0)["displacement"].any()


def clamped(side: float, **settings: Any) -> tuple[ModalSolver, ModalResponse]:
    """A square cage 0.3 mm thick, which no weave has, held by a side."""
    box = pv.CubeSource(bounds=(0, side, 0, side, 0, 3e-4))
    cage = TetraCage(divisions=(5, 5, 1), order=2)
    modal = ModalSolver(youngs_modulus="1 MPa", modes=8)
    response = ModalResponse(gravity=(0, 0, -1e-9), **settings)
    connect(box, cage, modal, response)
    return modal, response


def test_thin_clamped_cage_is_held() -> None:
    for side in (0.5, 1.0):
        modal, response = clamped(side, initial="equilibrium")
        response.update(time=0.0)
        tip = -pv.wrap(response.output)["displacement"][:, 2].min()
        # Leissa's first frequency, and a clamped strip's tip, which a plate stays below.
        first = 3.4917 / side**2 * math.sqrt(1e6 * 3e-4**2 / (12 * 0.91 * 300)) / (2 * math.pi)
        field = modal.GetOutputDataObject(0).GetFieldData()
        assert field.GetArray("frequencies").GetValue(0) == pytest.approx(1.028 * first, rel=1e-3)
        beam = 12 * 300 * 1e-9 * side**4 / (8 * 1e6 * 3e-4**2)
        assert 0.85 * beam < tip < beam


def test_modes_lost_in_rounding_are_reported() -> None:
    modal, response = clamped(50.0, initial="equilibrium")
    with pytest.raises(InputError, match=r"response\.initial.*\d of the cage's modes are lost"):
        response.update(time=0.0)
    assert "the frequency of modes 1 to 3 is lost in rounding" in modal.warnings[0]
    response.initial = "rest"
    response.residual_vectors = False
    response.update(time=0.0)
    modal, response = clamped(5.0)
    response.residual_vectors = False
    response.update(time=0.0)
    assert not any("rounding" in text for text in modal.warnings)


def test_given_gravity_may_equal_the_default() -> None:
    """A curtain hangs along -y; its weight along -z swings it as a slightly other weight does."""
    curtain = Curtain(5)
    moved = []
    for down in (-GRAVITY, -GRAVITY * (1 + 1e-6)):
        curtain.response.gravity = (0, 0, down)
        moved.append(curtain.at(0.2)["displacement"][:, 2].min())
    assert moved[0] < -0.01
    assert moved[0] == pytest.approx(moved[1], rel=1e-5)
    # automatic again: it goes on hanging
    curtain.response.gravity = None
    rest = curtain.at(0.2)
    np.testing.assert_array_equal(rest["displacement"], rest["equilibrium"])
    assert curtain.response.values_in_use["gravity"] == (0.0, -GRAVITY, 0.0)
