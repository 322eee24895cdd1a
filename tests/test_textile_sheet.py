"""Textiles of relaxed yarns as sheets, against closed forms, another model, and energies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile_sheet import sheet_of_textile
from spacemap_vtk.filters.textiles.braid import Braid
from spacemap_vtk.filters.textiles.knit import Knit
from spacemap_vtk.filters.textiles.woven import Mesh
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.stiffness import FLOOR, raise_to_floor, set_stiffness
from spacemap_vtk.textile.rods.yarns import Yarn
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

MM = 1e-3


def test_straight_yarns_that_are_set_are_beams_side_by_side():
    along = np.arange(8) / 8 * 4.0
    yarn = Yarn(np.stack([along, 0 * along, 0 * along], axis=1), (1, 0))
    cell = np.array([[4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    mechanics = RodMechanics(np.array([1e3]), np.array([2.0]), 1e3, np.array([0.5]))
    found = set_stiffness([yarn], cell, mechanics)
    expected = np.zeros((3, 3))
    expected[0, 0] = 1e3 / 3.0
    # sheared yarns turn by half of the angle, and bend back and forth to second order only
    assert found.membrane == pytest.approx(expected, abs=1e-5)
    assert found.bending == pytest.approx(np.diag([2.0 / 3.0, 0.0]), rel=1e-4, abs=1e-9)


def test_a_mesh_of_stiff_wires_has_peirce_s_poisson_ratio():
    mesh = Mesh(diameter=MM, spacing=2 * MM, weft_spacing=3 * MM, tension=1e4, bending=1e-9)
    rest = mesh.rest()
    mechanics = mesh.mechanics_of_sheet(rest)._replace(contact=1e9)
    membrane = set_stiffness(rest.yarns, rest.cell, mechanics).membrane
    tangents = []
    for yarns, room in ((rest.yarns[:2], 3.0), (rest.yarns[2:], 2.0)):
        # Peirce's angle, from the height of the wires' axes; D is 2
        height = np.mean([np.ptp(yarn.points[:, 2]) for yarn in yarns])
        straight = math.sqrt(room**2 - height * (4.0 - height))
        tangents.append(math.tan(2 * math.atan2(height, room + straight)) / room)
    assert membrane[0, 1] / membrane[0, 0] == pytest.approx(tangents[1] / tangents[0], rel=0.1)
    assert membrane[0, 1] ** 2 == pytest.approx(membrane[0, 0] * membrane[1, 1], rel=2e-3)


def test_a_plain_mesh_is_as_stiff_as_by_crimp_interchange():
    mesh = Mesh(diameter=MM, spacing=3 * MM, weft_spacing=3 * MM, tension=1.0, bending=1e-9)
    threads = Threads(diameter=MM, spacing=3 * MM)
    cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads, density=1e3)
    other = cloth_stiffness(cloth, YarnMechanics((1.0, 1.0), np.inf, (1e-9, 1e-9)))
    found = sheet_of_textile(mesh).plate
    # its wires flatten where they cross, and those of the other model do not
    assert found.membrane[0, 0] == pytest.approx(other.membrane[0, 0], rel=0.15)
    assert found.membrane[0, 1] < other.membrane[0, 1]


def test_a_stiffness_without_resistance_is_raised_to_the_floor():
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    found, raised = raise_to_floor(turn @ np.diag([5.0, -1e-3]) @ turn.T)
    assert raised
    assert np.linalg.eigvalsh(found) == pytest.approx([5.0 * FLOOR, 5.0])
    assert not raise_to_floor(np.eye(3))[1]


def test_a_knit_is_softer_along_its_courses_and_curls_to_back_and_face():
    knit = Knit(diameter=MM, tension=60.0, bending=2e-8)
    plate = sheet_of_textile(knit).plate
    assert plate.membrane[0, 0] < plate.membrane[1, 1]
    assert plate.curvature[0] < 0.0 < plate.curvature[1]
    # in the same shape, twice the size: membrane 1/8, bending 1/2, curvature 1/2
    large = sheet_of_textile(Knit(diameter=2 * MM, tension=15.0, bending=2e-8, set_share=0.5)).plate
    assert large.membrane == pytest.approx(plate.membrane / 8, rel=1e-6, abs=1e-6)
    assert large.bending == pytest.approx(plate.bending / 2, rel=1e-6, abs=1e-15)
    assert large.curvature == pytest.approx(plate.curvature / 4, rel=1e-6)


def test_what_is_no_sheet_is_refused():
    with pytest.raises(InputError, match="bending is missing"):
        sheet_of_textile(Knit(tension=60.0))
    with pytest.raises(InputError, match="tubular braid is no sheet"):
        sheet_of_textile(Braid(tension=60.0, bending=1e-9))


def test_a_strip_of_a_plait_says_what_it_assumes():
    found = sheet_of_textile(Braid(form="flat", carriers=3, tension=60.0, bending=2e-8))
    assert "a strip has one period" in found.notes[0]
    assert found.plate.membrane[0, 0] == pytest.approx(found.plate.membrane[1, 1])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_strip_with_a_natural_curvature_becomes_an_arc(side):
    length, width, radius = 0.06, 0.004, 0.02
    points, cells = build_lattice((0, length, 0, width, -1e-4, 1e-4), (60, 2, 1))
    plate = Plate(
        np.diag([1e3, 1e3, 400.0]),
        np.diag([1e-6, 1e-6, 4e-7]),
        curvature=np.array([side / radius, 0.0, 0.0]),
    )
    held = np.repeat((points[:, 0] < 1e-9)[:, None], 3, axis=1)
    model = Model(points, cells, plate, 1.0, held)
    moved = points + model.solve_equilibrium(np.zeros(points.size))[0]
    end = moved[points[:, 0] > length - 1e-9].mean(axis=0)
    angle = length / radius
    arc = [radius * math.sin(angle), width / 2, side * radius * (1.0 - math.cos(angle))]
    assert end == pytest.approx(arc, abs=5e-4 * length)
