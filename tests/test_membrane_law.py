"""Nonlinear laws of a membrane: from yarns and from curves, alone and in a sheet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    BarycentricWarp,
    CrimpInterchange,
    ModalSolver,
    TetraCage,
    TransientResponse,
    WeaveSource,
    connect,
)
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.datasets.arrays import add_array, points_of
from spacemap_vtk.datasets.modal_model import model_of
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.time_functions import step
from spacemap_vtk.mechanics.contact.resting import find_resting_state
from spacemap_vtk.mechanics.elements.curve_law import CurveLaw
from spacemap_vtk.mechanics.elements.membrane_law import LinearLaw
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import SteppedMotion
from spacemap_vtk.textile.crimp.cloth_law import YarnLaw, cloth_law
from spacemap_vtk.textile.crimp.contact_law import ContactLaw, MeasuredContact, VanWykContact
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import bending_bounds, cloth_stiffness
from spacemap_vtk.textile.drafts.patterns import build_pattern
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.geometry.yarn_clearance import measure_clearance
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

DRAFTS = Path(__file__).parents[1] / "scenes" / "drafts"
#: Force of Kawabata's tensile test, 500 gf/cm, in N/m.
FULL = 490.3
#: Plain cotton of 20 tex: EA, k_D [N], B [N m²].
COTTON = YarnMechanics((60.0, 60.0), 9.0, (1e-9, 1e-9))


def woven(pattern: str = "plain", d: float = 0.167, p: Any = (0.4, 0.4), tiles: int = 1) -> Cloth:
    """A cloth of round yarns of diameter d and spacings p, in mm."""
    warp, weft = (Threads(diameter=d * 1e-3, spacing=each * 1e-3) for each in p)
    return Cloth(drawdown=np.tile(build_pattern(pattern), (tiles, tiles)), warp=warp, weft=weft)


@pytest.fixture(scope="module")
def law() -> YarnLaw:
    return cloth_law(woven(), COTTON)


CURVES = CurveLaw(
    [[1, 0], [1.01, 20], [1.05, 400]], [[0.98, -3], [1, 0], [1.1, 90]], [[0, 0], [0.3, 2], [0.6, 9]]
)


def forces(law: Any, warp: Any, weft: Any) -> Any:
    """Forces per undeformed width along warp and weft at given stretches."""
    squares = np.broadcast_arrays(np.square(weft), np.square(warp), 1.0)
    stress = law.stress(0.5 * (np.stack(squares, axis=-1) - 1.0))
    return stress[..., 1] * warp, stress[..., 0] * weft


def free_weft(law: Any, warp: Any, low: float = 0.8) -> Any:
    """Stretch of the weft at which it carries no force."""
    under, over = np.full_like(warp, low), np.full_like(warp, 1.1)
    for _ in range(40):
        middle = 0.5 * (under + over)
        pulls = forces(law, warp, middle)[1] > 0.0
        under, over = np.where(pulls, under, middle), np.where(pulls, middle, over)
    return over


def extension_and_linearity(force: Any) -> tuple[float, float]:
    """EMT in percent, and LT, of a test with a force at each stretch."""
    last = brentq(lambda stretch: force(stretch) - FULL, 1.0 + 1e-9, 1.1, rtol=1e-5)
    stretches = np.linspace(1.0 + 1e-9, last, 201)
    work = np.trapezoid(force(stretches), stretches)
    return 100 * (last - 1), 2 * work / (FULL * (last - 1))


@pytest.mark.parametrize("name", ["yarns", "curves", "linear"])
def test_stress_and_tangent_are_derivatives(name: str, law: YarnLaw) -> None:
    linear = LinearLaw([[900.0, 200, 10], [200, 700, 0], [10, 0, 50]])
    some = {"yarns": law, "curves": CURVES, "linear": linear}[name]
    # Also sheared beyond the angle at which yarns touch, jammed, and with strains of no shape.
    strain = np.random.default_rng(0).uniform([-0.6, -0.6, -0.7], [0.3, 0.3, 0.7], (400, 3))
    found = some.evaluate(strain)
    for k, move in enumerate(1e-6 * np.eye(3)):
        up, down = some.evaluate(strain + move), some.evaluate(strain - move)
        slope, turn = (up.energy - down.energy) / 2e-6, (up.stress - down.stress) / 2e-6
        size = abs(found.stress).max(axis=1) + 1.0
        np.testing.assert_allclose(slope / size, found.stress[:, k] / size, atol=1e-5)
        # A few of the pairs lie on both sides of a knot or of the start of a jam.
        off = abs(turn - found.tangent[:, k]).max(axis=1) / abs(found.tangent).max(axis=(1, 2))
        assert np.sort(off)[-20] < 1e-4
    assert not some.stress(np.zeros(3)).any()


def test_twenty_thousand_points_take_some_milliseconds_without_loops(law: YarnLaw) -> None:
    strain = np.random.default_rng(0).uniform(-0.05, 0.05, (20_000, 3))
    whole = law.evaluate(strain)
    parts = law.evaluate(strain.reshape(100, 200, 3))
    assert parts.tangent.shape == (100, 200, 3, 3)
    np.testing.assert_array_equal(parts.stress.reshape(-1, 3), whole.stress)


def test_the_table_has_the_forces_of_the_crossings(law: YarnLaw) -> None:
    crossings = Interchange(woven(), COTTON)
    places = [[1.00001, 1.0, 1.01, 1.05, 1.04, 0.97, 1.2], [1.0, 1.001, 0.99, 0.95, 1.0, 1.03, 1.2]]
    exact = crossings.resultants(places).force
    found = np.transpose([forces(law, *each) for each in np.transpose(places)])
    np.testing.assert_allclose(found, exact, rtol=2e-3, atol=0.05)


def test_the_table_of_a_satin_is_wrong_by_a_few_percent_where_yarns_are_straight() -> None:
    """The line of taut yarns has a corner there; most places have a tenth of that error."""
    cloth = woven("satin 8/3")
    places = 1.0 + np.random.default_rng(0).uniform(-0.05, 0.08, (2, 1000))
    exact = Interchange(cloth, COTTON).resultants(places).force
    size = abs(exact).max(axis=0)
    off = abs(np.array(forces(cloth_law(cloth, COTTON), *places)) - exact).max(axis=0) / size
    off = off[size > 50.0]
    assert off.max() < 0.035
    assert np.quantile(off, 0.95) < 0.005


def drafted(name: str) -> Cloth:
    """A cloth of equal yarns after a draft."""
    source = WeaveSource(draft=DRAFTS / f"{name}.wif")
    source.update()
    return source.cloth


@pytest.mark.parametrize("name", ["dobby_crepe", "monks_belt", "overshot", "summer_and_winter"])
def test_twelve_kinds_of_crossings_have_the_forces_of_all(name: str) -> None:
    """Up to forty kinds of floats differ less in their forces."""
    crossings = Interchange(drafted(name), COTTON)
    few = crossings.with_fewer_kinds(12)
    places = 1.0 + 0.05 * np.random.default_rng(0).uniform(-0.5, 1.2, (2, 100))
    exact, found = crossings.resultants(places).force, few.resultants(places).force
    np.testing.assert_allclose(found, exact, atol=1e-3 * abs(exact).max())
    assert few.kinds_error < 1e-3


def test_error_of_few_kinds_is_that_of_their_forces() -> None:
    """Yarns of random diameters: what the law says it neglects is what it neglects."""
    sizes = 0.167e-3 * np.random.default_rng(3).uniform(0.7, 1.3, (2, 12))
    warp, weft = (Threads(diameter=each.tolist(), spacing=0.4e-3) for each in sizes)
    cloth = Cloth(drawdown=np.tile(build_pattern("plain"), (6, 6)), warp=warp, weft=weft)
    crossings = Interchange(cloth, COTTON)
    assert crossings.kind_count == 144
    errors = []
    for most in (1, 12):
        few = crossings.with_fewer_kinds(most)
        places = 1.0 + 0.05 * np.random.default_rng(0).uniform(0.0, 1.0, (2, 200))
        exact, found = crossings.resultants(places).force, few.resultants(places).force
        worst = (abs(found - exact) / abs(exact).max(axis=0)).max()
        errors.append(few.kinds_error)
        assert 0.2 < few.kinds_error / worst < 5.0
    assert errors[1] < 0.3 * errors[0]
    assert cloth_law(cloth, COTTON).kinds_error == pytest.approx(errors[1])


@pytest.mark.parametrize(
    ("bending", "strip"),
    [
        (1e-9, (6.75, 0.488)),
        pytest.param(2e-9, (5.92, 0.629), marks=pytest.mark.nightly),
    ],
)
def test_kawabatas_figures_are_those_of_an_independent_program(
    bending: float, strip: tuple[float, float]
) -> None:
    law = cloth_law(woven(), COTTON._replace(bending=(bending, bending)))
    held = extension_and_linearity(lambda stretch: forces(law, stretch, 1.0)[0])
    assert held == pytest.approx((1.35 if bending < 2e-9 else 1.33, 0.97), rel=0.01)
    free = extension_and_linearity(lambda stretch: forces(law, stretch, free_weft(law, stretch))[0])
    assert free == pytest.approx(strip, rel=0.01)


def test_a_strip_exchanges_crimp_as_yarns_that_do_not_stretch() -> None:
    # Peirce's geometry: a triangle of 3, 4 and 5.
    stiff = YarnMechanics((1e3, 1e3), 0.0, (1e-12, 1e-12), 1.0)
    law = cloth_law(woven(d=0.25, p=(0.5, 0.5)), stiff)
    for warp, weft in ((1.01521, 0.98298), (1.02896, 0.9636), (1.04146, 0.94072)):
        assert free_weft(law, warp) == pytest.approx(weft, abs=3e-5)
    # At 0.9101 the weft jams.
    loose, jammed = (abs(forces(law, 1.03, weft)[1]) for weft in (0.93, 0.87))
    assert jammed > 1e3 * loose


def test_a_straight_warp_pulls_by_its_own_stiffness() -> None:
    cloth = replace(woven(d=0.25, p=(0.75, 0.5)), crimp_height=0.25e-3)
    law = cloth_law(cloth, YarnMechanics((90.0, 90.0), np.inf, (1e-12, 1e-12)))
    # All of its crimp of 14.35 % is gone, and its yarns are 0.75 mm apart.
    stretch, length = 1.17, 1.1435
    expected = 90.0 / 0.75e-3 * (stretch / length - 1.0)
    assert forces(law, stretch, free_weft(law, stretch, 0.6))[0] == pytest.approx(
        expected, rel=0.01
    )
    assert forces(law, 1.13, free_weft(law, 1.13, 0.7))[0] < 0.01 * expected


def test_slack_yarns_hardly_push_and_jams_do(law: YarnLaw) -> None:
    pull, push, jam = forces(law, 1.02, 1.02)[0], forces(law, 0.98, 0.98)[0], forces(law, 0.7, 0.7)
    assert -1e-3 * pull < push < 0.0
    assert max(jam) < -0.2 * pull


def test_yarns_of_a_family_lock_before_they_overlap(law: YarnLaw) -> None:
    # The load that shears the cloth by 75 degrees if shear is linear.
    stiffness = cloth_stiffness(woven(), COTTON).membrane[2, 2]
    load = stiffness * np.radians(75)

    def angle(law: YarnLaw) -> float:
        def over(gamma: float) -> float:
            sine = np.array([np.sin(gamma)])
            return float(law.respond(np.ones(1), np.ones(1), sine).first[2, 0] * np.cos(gamma))

        return float(np.degrees(brentq(lambda gamma: over(gamma) - load, 0.1, 1.5)))

    assert angle(law) == pytest.approx(65.3, abs=0.2)
    wide = Threads(diameter=0.167e-3, spacing=0.4e-3, aspect=1.5, section="racetrack")
    cloth = Cloth(drawdown=np.eye(2, dtype=bool), warp=wide, weft=wide)
    assert angle(cloth_law(cloth, COTTON)) == pytest.approx(51.3, abs=0.4)
    clear, overlap = (drawn_clearance(each) / 0.167e-3 for each in (angle(law), 75.0))
    assert overlap < -0.3 < -0.01 < clear


def drawn_clearance(shear: float) -> float:
    """Least clearance of drawn yarns of one family in a cage sheared by an angle in degrees."""
    mm = {"warp_diameter": 0.167e-3, "weft_diameter": 0.167e-3}
    source = WeaveSource(
        pattern="plain", ends=6, picks=6, warp_spacing=0.4e-3, weft_spacing=0.4e-3, **mm
    )
    cage = connect(source, TetraCage(divisions=(2, 2, 1), padding=0.1)).update().output
    grid = cage.NewInstance()
    grid.ShallowCopy(cage)
    gamma = np.radians(shear)
    gradient = np.array([[1, np.sin(gamma), 0], [0, np.cos(gamma), 0], [0, 0, 1]])
    points = points_of(grid)
    add_array(grid.GetPointData(), "displacement", points @ gradient.T - points)
    crimp = CrimpInterchange()
    connect((source, grid), crimp)
    patches = connect((crimp, grid), BarycentricWarp()).update().output
    moved = points_of(patches).copy()
    # Warp and weft are moved apart: where they cross at other angles, they are not clear.
    family = vtk_to_numpy(patches.GetCellData().GetArray("family"))
    corners = vtk_to_numpy(patches.GetCells().GetConnectivityArray()).reshape(len(family), -1)
    moved[np.unique(corners[family == 1]), 2] += 1.0
    return measure_clearance(build_weave(source.cloth), moved).distance


def test_shear_is_that_of_the_repeat_and_twill_is_softer() -> None:
    softness = [
        cloth_stiffness(woven(pattern), COTTON).membrane[2, 2] for pattern in ("plain", "twill 2/2")
    ]
    assert softness[1] < softness[0]
    cloths = [woven("satin 5/2", tiles=tiles) for tiles in (1, 3)]
    few, many = (cloth_stiffness(cloth, COTTON).membrane[2, 2] for cloth in cloths)
    assert few == pytest.approx(many)
    places = [[1.004, 0.98, 1.03], [1.003, 1.02, 0.9]]
    np.testing.assert_allclose(*(Interchange(each, COTTON).energy(places) for each in cloths))


def test_pretension_adds_its_weight_to_shear(law: YarnLaw) -> None:
    # A clamp pulls the warp with W and moves aside by tan γ of the length: the cloth resists with
    # G γ/cos γ + W tan γ if its warp does not stretch.
    shear, pull = cloth_stiffness(woven(), COTTON).membrane[2, 2], 9.807

    def energy(sideways: float, warp: float) -> float:
        gradient = np.array([[1.0, sideways], [0.0, warp]])
        green = 0.5 * (gradient.T @ gradient - np.eye(2))
        strain = np.array([green[0, 0], green[1, 1], 2 * green[0, 1]])
        return float(law.evaluate(strain).energy) - pull * warp

    gamma = np.radians(1.0)
    # The stretch under W is found at the angle, as the clamp is free along the warp.
    move = 1e-4

    def least(sideways: float) -> float:
        places = np.linspace(0.9995, 1.002, 20_001)
        gradient = np.stack([np.full_like(places, sideways), places])
        strain = np.stack(
            [0 * places, 0.5 * ((gradient**2).sum(axis=0) - 1), np.full_like(places, sideways)], -1
        )
        return float((law.evaluate(strain).energy - pull * places).min())

    force = (least(np.tan(gamma) + move) - least(np.tan(gamma) - move)) / (2 * move)
    assert energy(0.0, 1.0) == pytest.approx(-pull)
    assert force == pytest.approx(shear * gamma / np.cos(gamma) + pull * np.tan(gamma), rel=0.01)


@pytest.mark.parametrize(
    ("contact", "factor"), [(VanWykContact(), 3.0), (MeasuredContact([[0.1, 3], [0.3, 20]]), None)]
)
def test_contact_follows_its_law(contact: ContactLaw, factor: float | None) -> None:
    x = np.linspace(0.6, 1.0, 9)
    value, slope, bend = contact.evaluate(x)
    up, down = contact.evaluate(x + 1e-6), contact.evaluate(x - 1e-6)
    np.testing.assert_allclose((up[0] - down[0])[:-1] / 2e-6, slope[:-1], atol=1e-6)
    np.testing.assert_allclose((up[1] - down[1])[:-1] / 2e-6, bend[:-1], rtol=1e-3)
    assert value[-1] == slope[-1] == 0.0
    if factor is not None:
        assert bend[-1] == factor
    # A cloth that is pulled both ways is pressed by the force of its law, and more than by a
    # linear contact of the same stiffness at first.
    yarns = YarnMechanics((60.0, 60.0), 3.0, (1e-9, 1e-9), 0.5, contact)
    cloth, pulled = woven(), np.full((2, 2, 2), 1.04)
    state = Interchange(cloth, yarns).solve(pulled)
    loss = 1.0 - state.distance[0, 0] / cloth.diameter_sum
    expected = -6.0 * contact.evaluate(np.array([1.0 - loss]))[1][0]
    assert state.contact[0, 0] == pytest.approx(expected)
    linear = yarns._replace(contact=3.0 * bend[-1], law=ContactLaw())
    assert state.distance[0, 0] > Interchange(cloth, linear).solve(pulled).distance[0, 0]


def test_bending_lies_between_free_and_rigid_arcs() -> None:
    cloth = woven(d=0.25, p=(0.5, 0.5))
    free, rigid = bending_bounds(cloth, COTTON)
    # Peirce's triangle: length 0.571751 mm, half of the spacing straight.
    assert free == pytest.approx((1e-9 / 0.5e-3 * 0.5 / 0.571751,) * 2)
    assert rigid == pytest.approx((1e-9 / 0.5e-3 * 0.5 / 0.25,) * 2)
    stiff = cloth_stiffness(cloth, COTTON._replace(rigid_arcs=True))
    assert np.diag(stiff.bending)[:2] == pytest.approx(rigid)


def test_curves_are_met_and_slack_cloth_is_soft() -> None:
    assert forces(CURVES, 1.05, 1.1) == pytest.approx((400, 90))
    assert forces(CURVES, 1.01, 0.98) == pytest.approx((20, -3))
    assert 0.0 > forces(CURVES, 0.99, 1.0)[0] > -0.05
    sine = np.array([np.sin(-0.3)])
    assert CURVES.respond(np.ones(1), np.ones(1), sine).first[2] * np.cos(0.3) == pytest.approx(-2)


@pytest.mark.parametrize(
    ("warp", "message"),
    [
        ([[1, 0], [1.1, 5], [1.2, 4]], "falls from point 2 to point 3"),
        ([[0, 0], [0.1, 5]], "Add 1 to strains"),
        ([[0.9, 0], [1.1, 5]], "Subtract the pretension"),
        ([[1, 0], [1, 5]], "point 2"),
    ],
)
def test_impossible_curves_are_refused(warp: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        CurveLaw(warp, [[1, 0], [1.1, 5]], [[0, 0], [1, 5]])
    assert caught.value.key == "warp_curve"


def hung(plate: Plate, cells: int = 4) -> tuple[Model, Any]:
    """A square of 20 cm that hangs from its top edge, and the displacement of its equilibrium."""
    points, tetrahedra = build_lattice((0, 0.2, 0, 0.2, 0, 3e-4), (cells, cells, 1))
    held = np.repeat(points[:, 1:2] > 0.2 - 1e-9, 3, axis=1)
    model = Model(points, tetrahedra, plate, 400.0, held)
    load = (model.nodal_mass[:, None] * [0.0, 0.0, -9.81]).ravel()
    return model, find_resting_state(model, load).displacement


def test_a_sheet_with_a_linear_law_is_a_linear_sheet(law: YarnLaw) -> None:
    plate = cloth_stiffness(woven(), COTTON)
    (_, linear), (_, same) = (
        hung(each) for each in (plate, replace(plate, law=LinearLaw(plate.membrane)))
    )
    np.testing.assert_allclose(same, linear, atol=1e-9)
    # Of yarns it weighs as much, and the warp carries the weight at each height.
    model, moved = hung(replace(plate, law=law))
    assert moved[:, 2].min() == pytest.approx(linear[:, 2].min(), rel=1e-3)
    assert model.digest != hung(plate)[0].digest
    again = Model(
        model.points, model.cells, model.plate, 400.0, ~model.free.reshape(-1, 3), False, moved
    )
    # In equilibrium the forces of the elements are the weight.
    weight = model.nodal_mass[:, None] * [0.0, 0.0, 9.81]
    free = model.free.reshape(-1, 3)
    left = again.forces.reshape(-1, 3) + weight
    assert abs(left[free]).max() < 1e-6 * abs(weight).max()
    assert again.modes(2).eigenvalues[0] > 0


def test_a_steps_energy_is_kept_with_a_law(law: YarnLaw) -> None:
    plate = replace(cloth_stiffness(woven(), COTTON), law=law)
    points, cells = build_lattice((0, 0.1, 0, 0.2, 0, 3e-4), (1, 3, 1))
    held = np.repeat(points[:, 1:2] > 0.2 - 1e-9, 3, axis=1)
    model = Model(points, cells, plate, 400.0, held)
    cage = CageModes(model, np.empty(0), np.empty((0, points.size)), np.empty(0))
    load = cage.load_vector("gravity", (0, 0, -9.81), step())
    motion = SteppedMotion(cage, [load], Damping(beta=1e-3))
    motion.step_until(0.02)
    _, _, kinetic, strain, dissipated, work = motion.states[:, :6].T
    assert dissipated[-1] > 0
    assert abs(kinetic + strain + dissipated - work).max() < 1e-11 * kinetic.max()


@pytest.mark.parametrize("law", ["curves", "yarns"])
def test_a_solvers_law_is_that_of_the_stages_after_it(law: str, tmp_path: Path) -> None:
    (tmp_path / "warp.csv").write_text("stretch;force\n1;0\n1,01;50\n1,05;900\n")
    (tmp_path / "shear.txt").write_text("0 0\n8 5\n30 40\n")
    source = WeaveSource(pattern="plain", ends=8, picks=8, warp_spacing=4e-4, weft_spacing=4e-4)
    solver = ModalSolver(elements="sheet", fixed="+y", gravity=(0, 0, -9.81), modes=2)
    if law == "curves":
        solver.configure(warp_curve=tmp_path / "warp.csv", shear_curve=tmp_path / "shear.txt")
        solver.configure(bending_rigidity=1e-6, areal_mass=0.1)
    else:
        solver.configure(material="yarns", areal_mass=0.1)
        solver.yarns = COTTON
    transient = TransientResponse(loads=[{"gravity": (0, 0, -9.81)}], beta=1e-3)
    connect(source, TetraCage(divisions=(3, 3, 1)), solver, transient)
    transient.update(time=0.001)
    first, again = solver._model, model_of(solver.output)
    assert first is not None
    laws = [model.plate.law for model in (first, again) if model.plate is not None]
    assert [each.kind for each in laws if each is not None] == [law, law]
    assert again.digest == first.digest
    solver.law = "linear"
    solver.configure(warp_curve=None, shear_curve=None)
    solver.update()
    linear = model_of(solver.output)
    assert linear.plate is not None
    assert linear.plate.law is None
    assert linear.digest != first.digest


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"law": "yarns"}, "law"),
        ({"law": "curves"}, "warp_curve"),
        ({"law": "linear", "warp_curve": "a.csv"}, "warp_curve"),
        ({"warp_curve": "a.csv", "tensile_rigidity": 1e3}, "tensile_rigidity"),
        ({"weft_curve": "a.csv"}, "warp_curve"),
    ],
)
def test_contradictory_laws_are_refused(values: dict[str, Any], key: str) -> None:
    solver = ModalSolver(elements="sheet", **values)
    with pytest.raises(InputError) as caught:
        solver.check()
    assert caught.value.key == key
