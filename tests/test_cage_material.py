"""What a cage is made of: a fabric's own measures, as parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from spacemap_vtk import (
    CrimpInterchange,
    ModalResponse,
    ModalSolver,
    ObjectSource,
    TetraCage,
    WeaveSource,
    connect,
)
from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.mechanics.elements.plates import (
    data_sheet,
    homogeneous_plate,
    keep_normals_upright,
)
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.weave.figures import fabric_figures

H = 3e-4
#: EA [N], hard contact, and B [N m²] of a cotton of 30 tex.
COTTON = YarnMechanics((90.0, 90.0), np.inf, (2e-9, 2e-9))
LEVER = Path(__file__).parents[1] / "scenes" / "objects" / "lever.stl"


def stiffness_parts(plate):
    plate = keep_normals_upright(plate, 1.0)  # of both alike where normals stay upright
    return plate.membrane, plate.bending, plate.shear, np.array(plate.thickness)


def assert_alike(plate, other):
    for found, expected in zip(stiffness_parts(plate), stiffness_parts(other), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * expected.max())


def test_sheet_without_measurements_is_a_homogeneous_plate():
    made = ModalSolver(youngs_modulus="2 MPa", poissons_ratio=0.2, density=500.0)
    for normal in range(3):
        plate, mass = made.sheet_stiffness(H, normal)
        assert_alike(plate, homogeneous_plate(isotropic(2e6, 0.2), H, normal))
        assert mass == pytest.approx(500 * H)


def test_data_sheet_accepts_customary_units():
    made = ModalSolver(
        tensile_rigidity="2 kN/m, 1 kN/m",
        shear_rigidity="1 gf/cm.deg",
        poissons_ratio_in_plane=0.4,
        bending_rigidity=["0.1 gf.cm²/cm", "5 µN·m"],
        twisting_rigidity="2e-6",
        areal_mass="6 oz/yd²",
    )
    assert made.tensile_rigidity == (2000.0, 1000.0)
    plate, mass = made.sheet_stiffness(H)
    strip = 1 / np.diag(np.linalg.inv(plate.membrane))
    assert strip.tolist() == pytest.approx([1000.0, 2000.0, 0.980665 * 180 / np.pi])
    bent = 1 / np.diag(np.linalg.inv(plate.bending))
    assert bent.tolist() == pytest.approx([5e-6, 9.80665e-6, 2e-6])
    assert mass == pytest.approx(6 * 0.0339057, rel=1e-5)


def test_one_value_applies_to_warp_and_weft():
    made = ModalSolver(tensile_rigidity="1500 N/m", bending_rigidity=1e-5)
    assert made.bending_rigidity == 1e-5
    plate, _ = made.sheet_stiffness(H)
    one = np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.35]]) / 0.91
    np.testing.assert_allclose(plate.membrane, 1500 * one, rtol=1e-12)
    np.testing.assert_allclose(plate.bending, 1e-5 * one, rtol=1e-12)
    with pytest.raises(InputError, match=r"bending_rigidity.*there must be 1 or 2 values, not 3"):
        ModalSolver(bending_rigidity=[1e-5, 2e-5, 3e-5])
    with pytest.raises(InputError, match=r"value 2.*out of range"):
        ModalSolver(bending_rigidity=[1e-5, 0.0])


def test_bending_length_is_peirces():
    """CSIRO's FAST: rigidity in µN·m = 9.81e-6 times g/m² times the cube of c in mm."""
    made = ModalSolver(bending_length=["20 mm", "15 mm"], areal_mass="200 g/m2", poissons_ratio=0.0)
    plate, _ = made.sheet_stiffness(H)
    fast = [9.81e-6 * 200 * c**3 * 1e-6 for c in (15, 20)]
    assert np.diag(plate.bending)[:2].tolist() == pytest.approx(fast, rel=4e-4)
    # the weight is the weave's own where nobody gives another
    heavier, mass = made.sheet_stiffness(H, woven=0.3)
    assert mass == 0.2
    made.areal_mass = None
    heavier, mass = made.sheet_stiffness(H, woven=0.3)
    assert mass == 0.3
    np.testing.assert_allclose(heavier.bending, 1.5 * plate.bending, rtol=1e-12)
    with pytest.raises(InputError, match=r"bending_length.*bending_rigidity is given, too"):
        ModalSolver(bending_length="2 cm", bending_rigidity="5 uN.m").check()


def test_mass_is_taken_from_the_most_specific_source():
    woven = 0.21
    assert ModalSolver().sheet_stiffness(H, woven=woven)[1] == woven
    assert ModalSolver().sheet_stiffness(H)[1] == pytest.approx(300 * H)
    assert ModalSolver(density=400).sheet_stiffness(H, woven=woven)[1] == pytest.approx(400 * H)
    assert ModalSolver(material="denim").sheet_stiffness(H, woven=woven)[1] == pytest.approx(0.324)
    assert ModalSolver(material="denim", areal_mass=0.3).sheet_stiffness(H, woven=woven)[1] == 0.3
    with pytest.raises(InputError, match=r"areal_mass.*density is given, too"):
        ModalSolver(density=400, areal_mass=0.1).check()


@pytest.mark.parametrize("name", FABRICS)
def test_measured_fabric_keeps_its_stretch_and_bending(name):
    """However thick the cage is, and without a warning of it."""
    for thickness in (1e-5, 1e-2):
        plate, mass = ModalSolver(material=name).sheet_stiffness(thickness)
        assert_alike(plate, FABRICS[name].sheet)
        assert mass == pytest.approx(FABRICS[name].areal_mass)
    made = ModalSolver(material=name, bending_rigidity="20 uN.m, 10 uN.m")
    plate, _ = made.sheet_stiffness(H)
    np.testing.assert_allclose(plate.membrane, FABRICS[name].sheet.membrane, rtol=1e-12)
    root = 0.5 * np.sqrt(2) * 1e-5
    np.testing.assert_allclose(plate.bending, np.diag([1e-5, 2e-5, root]), rtol=1e-12)
    # its shear was measured, an isotropic sheet's was not
    made = ModalSolver(material=name, tensile_rigidity="1 kN/m")
    plate, _ = made.sheet_stiffness(H)
    assert plate.membrane[2, 2] == pytest.approx(FABRICS[name].sheet.membrane[2, 2])


def test_sheet_constants_are_refused_for_tetrahedra():
    for key in (
        "tensile_rigidity",
        "shear_rigidity",
        "poissons_ratio_in_plane",
        "bending_rigidity",
        "bending_length",
        "twisting_rigidity",
        "areal_mass",
    ):
        made = ModalSolver(elements="tetrahedra", **{key: 0.1})
        with pytest.raises(InputError, match=f'{key}.*has no effect: elements is "tetrahedra"'):
            made.check()
    made = ModalSolver(elements="sheet", material="denim", thickness="1 mm")
    with pytest.raises(InputError, match=r'thickness.*has no effect: elements is "sheet"'):
        made.check()


def test_reported_constant_does_not_depend_on_the_order_of_setting():
    given = {"youngs_moduli": [2, 1, 2], "poissons_ratios": [0.6, 0.3, 0.6]}
    for names in (given, reversed(given)):
        made = ModalSolver()
        for name in names:
            setattr(made, name, given[name])
        with pytest.raises(InputError, match=r"youngs_moduli = .*has no effect"):
            made.check()


def test_indefinite_sheet_is_refused_before_anything_runs():
    with pytest.raises(InputError, match=r"poissons_ratio_in_plane = .*between -1 and 1"):
        ModalSolver(tensile_rigidity=1e3, poissons_ratio_in_plane=1.2).check()


@pytest.mark.parametrize("method", ["lattice", "carved"])
def test_cage_has_the_mass_of_its_weave(method):
    weave, cage = WeaveSource(warp_count="40 tex", weft_count="30 tex"), TetraCage(method=method)
    cage.SetInputConnection(weave.GetOutputPort())
    mass = vtk_to_numpy(cage.update().output.GetFieldData().GetArray("areal_mass"))
    # 20 yarns in a centimetre each way, and their crimp
    crimp = [fabric_figures(weave.cloth)[family]["mean_crimp"] for family in ("warp", "weft")]
    expected = 2000 * (40e-6 * (1 + crimp[0]) + 30e-6 * (1 + crimp[1]))
    assert mass.tolist() == pytest.approx([expected], rel=1e-6)


def strip(solver, along="y"):
    """Return a solver of a strip of cloth of 4 x 60 yarns, and its length in m."""
    size = {"x": (60, 4), "y": (4, 60)}[along]
    weave = WeaveSource(ends=size[0], picks=size[1])
    divisions = (30, 2, 1) if along == "x" else (2, 30, 1)
    connect(weave, TetraCage(divisions=divisions), solver)
    bounds = solver.update().output.GetBounds()
    return bounds[1] - bounds[0] if along == "x" else bounds[3] - bounds[2]


@pytest.mark.parametrize(("along", "rigidity"), [("y", 9e-6), ("x", 4e-6)])
def test_strip_vibrates_like_a_cantilever_of_its_rigidity(along, rigidity):
    """Euler: f = 1.8751² sqrt(B/m) / (2π L²), along the warp (y) and along the weft (x)."""
    made = ModalSolver(elements="sheet", bending_rigidity=[9e-6, 4e-6], fixed=f"+{along}", modes=1)
    length = strip(made, along)
    field = made.output.GetFieldData()
    mass = field.GetArray("areal_mass").GetValue(0)  # the weave's own
    euler = 1.875104**2 / (2 * np.pi * length**2) * np.sqrt(rigidity / mass)
    assert field.GetArray("frequencies").GetValue(0) == pytest.approx(euler, rel=0.01)
    assert made.warnings == ()


def test_strip_of_denim_bends_like_denim_without_a_warning():
    made = ModalSolver(elements="sheet", material="denim", modes=1)
    length = strip(made)
    denim = FABRICS["denim"]
    euler = 1.875104**2 / (2 * np.pi * length**2) * np.sqrt(denim.bending[2] / denim.areal_mass)
    found = made.output.GetFieldData().GetArray("frequencies").GetValue(0)
    assert found == pytest.approx(euler, rel=0.01)
    assert made.warnings == ()


def test_sheet_has_the_mass_of_its_weave():
    made = ModalSolver(elements="sheet", modes=1)
    weave = WeaveSource()
    connect(weave, TetraCage(padding=0.1), made)
    data = made.update().output
    x0, x1, y0, y1, *_ = data.GetBounds()
    mass = vtk_to_numpy(data.GetPointData().GetArray("nodal_mass")).sum() / (x1 - x0) / (y1 - y0)
    assert mass == pytest.approx(fabric_figures(weave.cloth)["areal_mass"])
    # tetrahedra weigh what they weighed
    made.elements = "tetrahedra"
    data = made.update().output
    assert data.GetFieldData().GetArray("density").GetValue(0) == 300.0


def test_constants_for_other_elements_are_reported():
    made = ModalSolver(bending_rigidity="5 uN.m", modes=1)
    connect(WeaveSource(), TetraCage(divisions=(3, 3, 3)), made)
    text = 'modal.bending_rigidity has no effect: the cage is not a sheet; elements = "sheet"'
    assert any(text in given for given in made.update().warnings)
    made = ModalSolver(material="denim", thickness="1 mm", modes=1)
    connect(WeaveSource(ends=20, picks=20), TetraCage(divisions=(2, 2, 1)), made)
    text = 'modal.thickness has no effect: the cage is a sheet; elements = "tetrahedra"'
    assert any(text in given for given in made.update().warnings)


def test_sheet_has_the_stiffness_of_its_yarns():
    made = ModalSolver(elements="sheet", material="yarns", modes=1)
    made.yarns = COTTON
    weave = WeaveSource()
    connect(weave, TetraCage(), made)
    made.update()
    plate = cloth_stiffness(weave.cloth, COTTON)
    found = made.sheet_figures(made.output)
    expected = data_sheet(plate, fabric_figures(weave.cloth)["areal_mass"])
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, rel=1e-9)
    field = made.output.GetFieldData()
    np.testing.assert_allclose(
        vtk_to_numpy(field.GetArray("membrane_stiffness")).reshape(3, 3), plate.membrane, atol=1e-6
    )
    # what was measured goes before it
    made.bending_rigidity = "20 uN.m"
    assert made.sheet_figures(made.output).bending_rigidity == pytest.approx((2e-5, 2e-5))
    assert made.sheet_figures(made.output).tensile_rigidity == found.tensile_rigidity


def test_yarns_run_the_solver_again_only_if_used():
    made = ModalSolver(elements="sheet", modes=1)
    made.yarns = COTTON
    connect(WeaveSource(), TetraCage(), made)
    made.update()
    made.yarns = COTTON._replace(bending=(3e-9, 3e-9))
    assert made.update().executions == 1
    made.material = "yarns"
    assert made.update().executions == 2
    made.yarns = COTTON._replace(bending=(3e-9, 3e-9))
    assert made.update().executions == 2
    made.yarns = COTTON
    assert made.update().executions == 3
    # and where they are those of a stage, that follow it
    made.yarns = crimp = CrimpInterchange(inextensible=False, tension=90.0, bending=2e-9)
    crimp.flattest = 1.0
    assert made.update().executions == 4
    crimp.bending = "3 mN.mm2"
    assert made.update().executions == 5
    crimp.Modified()
    made.yarns = crimp
    assert made.yarns.bending == 3e-9
    assert made.update().executions == 5
    made.material = "isotropic"
    made.update()
    crimp.bending = 2e-9
    assert made.update().executions == 6


def test_missing_data_of_yarns_is_reported():
    made = ModalSolver(material="yarns")
    with pytest.raises(InputError, match=r"the stiffness of the yarns is not given.*spacemap info"):
        made.check()
    for given, lacking in (
        ({}, "tension"),
        ({"inextensible": False}, "tension"),
        ({"inextensible": False, "modulus": "300 cN/tex"}, "bending"),
        ({"inextensible": False, "tension": 90.0, "bending": 2e-9}, "contact"),
    ):
        made.yarns = CrimpInterchange(**given)
        with pytest.raises(InputError, match=rf"material.*\[yarns\] {lacking}"):
            made.check()
    made.yarns = COTTON
    made.check()
    connect(WeaveSource(), cage := TetraCage(divisions=(2, 2, 2)), made)
    with pytest.raises(InputError, match="needs a cage that is a sheet"):
        made.update()
    cage.divisions, made.elements = (2, 2, 1), "sheet"
    made.yarns = YarnMechanics()
    with pytest.raises(InputError, match=r"material.*\[yarns\] tension.*infinitely stiff"):
        made.update()
    made.yarns = COTTON
    connect(ObjectSource(file=LEVER), cage, made)
    with pytest.raises(InputError, match="needs a weave in the cage"):
        made.update()


@pytest.mark.parametrize(("along", "across"), [("y", "x"), ("x", "y")])
@pytest.mark.parametrize("pull", ["5 Pa of its own weight", "20 N/m"])
def test_stiffness_of_yarns_carries_the_load_of_their_cloth(along, across, pull):
    """Held at its sides: the tension of the yarns, EA ε cosθ over p, is the load per width."""
    tension = {"y": 90.0, "x": 60.0}[along]
    weave, cage, response = WeaveSource(ends=16, picks=16), TetraCage(), ModalResponse()
    crimp = CrimpInterchange(
        inextensible=False, tension=(90.0, 60.0), bending="2 mN.mm2", contact="900 N"
    )
    solver = ModalSolver(elements="sheet", material="yarns", modes=1)
    solver.fixed = f"+{along}:{along}z", f"-{across}:{across}", f"+{across}:{across}"
    solver.yarns = crimp
    connect(weave, cage, solver, response)
    connect((weave, response), crimp)
    down = np.array([along == "x", along == "y", 0.0])
    if pull == "20 N/m":
        thick = np.ptp(cage.update().output.GetBounds()[4:])
        solver.dead_loads = [{"traction": -20.0 / thick * down, "on": f"-{along}"}]
        load = 20.0
    else:
        mass = fabric_figures(weave.cloth)["areal_mass"]
        solver.gravity = -5.0 / mass * down
        load = 0.5 * 5.0 * 16 * 0.5e-3  # half way up
    cells = crimp.update(time=0.0).output.GetCellData()
    strain, family = (vtk_to_numpy(cells.GetArray(n)) for n in ("yarn_strain", "family"))
    number = "yx".index(along)
    angle = weave.cloth.families[number].crimp.theta
    found = tension * np.median(strain[family == number]) * np.cos(angle) / 0.5e-3
    assert found == pytest.approx(load, rel=0.01)
    assert solver.warnings == crimp.warnings == ()
