"""Cloth that touches itself, against an elastica and conservation laws."""

from __future__ import annotations

import importlib.util
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from test_contact import LENGTH, PLATE, WIDTH, middle, rest
from test_contact_steps import MASS, drift, motion_of
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from spacemap_vtk import LayerContact, ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import add_array, points_of
from spacemap_vtk.errors import InputError, MissingLibraryError
from spacemap_vtk.mechanics.contact import self_contact
from spacemap_vtk.mechanics.contact.obstacle_term import ObstacleTerm, contact_stiffness
from spacemap_vtk.mechanics.contact.obstacles import Plane
from spacemap_vtk.mechanics.contact.resting import Resting
from spacemap_vtk.mechanics.contact.samples import sample_sheet
from spacemap_vtk.mechanics.contact.self_contact import SelfContact
from spacemap_vtk.mechanics.elements.shell import find_mid_surface
from spacemap_vtk.mechanics.equilibrium.energy_terms import assemble_tangent
from spacemap_vtk.mechanics.modal.damping import Damping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.transient.stepper import COLUMNS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.point_clearance import point_clearances

has_library = pytest.mark.skipif(
    importlib.util.find_spec("ipctk") is None, reason="ipctk is not installed"
)


def folded_strip(
    length: float, cells: int, thick: float, held: float, angle: Any, ground: bool = False
) -> tuple[Model, SelfContact, Resting]:
    """Return a strip along x, held up to a length, and a state of given angles without stretch."""
    points, tetrahedra = build_lattice((0, length, 0, WIDTH, -thick / 2, thick / 2), (cells, 1, 1))
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    stiffness = contact_stiffness(PLATE, length / cells)
    own = SelfContact(points, surface, thick, stiffness)
    terms: list[Any] = [own]
    if ground:
        below = Plane((0, 0, -thick / 2)), sample_sheet(points, surface), stiffness, thick / 2
        terms.append(ObstacleTerm(*below, surface=surface))
    fixed = np.zeros(points.shape, dtype=bool)
    fixed[:, 1] = True
    fixed[points[:, 0] < held + 1e-9] = True
    model = Model(points, tetrahedra, PLATE, MASS / thick, fixed, terms=terms)
    x, z = curve(length, cells, angle)
    here = np.rint(points[:, 0] * cells / length).astype(int)
    turned, above = angle(points[:, 0]), points[:, 2]
    place = [x[here] - above * np.sin(turned), points[:, 1], z[here] + above * np.cos(turned)]
    return model, own, Resting(np.stack(place, axis=1) - points, np.empty((0, 3)))


def curve(length: float, cells: int, angle: Any) -> Any:
    """Return x and z at the ends of the cells of a polygon of given angles."""
    between = angle((np.arange(cells) + 0.5) * length / cells)
    way = np.stack([np.cos(between), np.sin(between)]) * length / cells
    return np.concatenate([np.zeros((2, 1)), np.cumsum(way, axis=1)], axis=1)


def hairpin(cells: int = 20, thick: float = 3e-4) -> tuple[Model, SelfContact, Resting]:
    """Return a strip whose free end is bent back above the end that is held."""
    length, radius = 0.1, 8e-3
    begin = 0.4 * length

    def angle(along: Any) -> Any:
        return np.clip((along - begin) / radius, 0.0, math.pi)

    return folded_strip(length, cells, thick, begin, angle)


def distance_of_layers(own: SelfContact, positions: Any) -> float:
    """Return the least distance between the mid-surface's parts that do not meet at rest."""
    found = self_contact.load_library().NormalCollisions()
    where = own.to_middle(positions)
    found.build(own._mesh, where, 10 * own._thickness)
    return math.sqrt(found.compute_minimum_distance(own._mesh, where))


@has_library
def test_forces_and_tangent_are_derivatives_of_the_energy() -> None:
    model, own, start = hairpin(thick=1e-3)
    random = np.random.default_rng(0)
    place = model.points + start.displacement
    # The end comes down until it is within reach.
    place[:, 2] -= np.where(model.points[:, 0] > 0.07, place[:, 2].max() - 1.75e-3, 0.0)
    place = place + 1e-5 * random.normal(size=place.shape)
    way = random.normal(size=place.shape)
    own.follow(place)
    assert own.energy(place) > 0.0
    ahead, behind = place + 1e-8 * way, place - 1e-8 * way
    slope = (own.energy(ahead) - own.energy(behind)) / 2e-8
    assert slope == pytest.approx(float(np.vdot(own.forces(place), way)), rel=1e-5)
    change = (own.forces(ahead) - own.forces(behind)) / 2e-8
    expected = (assemble_tangent([own], place) @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(change, expected, atol=1e-5 * abs(expected).max())


@has_library
def test_strip_that_falls_onto_itself_keeps_its_distance_and_its_energy() -> None:
    model, own, start = hairpin()
    motion = motion_of(
        model,
        (0, 0, -60.0),
        displacement=start.displacement,
        tolerance=1.0,
        damping=Damping(beta=5e-4),
    )
    motion.step_until(0.03)
    size = (motion.states.shape[1] - COLUMNS) // 2
    surface = model.pencil.surface
    assert surface is not None
    places = motion.states[:, COLUMNS : COLUMNS + size]
    nearest = min(
        distance_of_layers(own, surface.to_vertices(motion._integrator._nodal(place)))
        for place in places
    )
    assert own._thickness < nearest < 1.5 * own._thickness
    assert drift(motion) < 1e-8


@has_library
@pytest.mark.parametrize(
    ("cells", "thick", "error"),
    [(60, 5e-5, 5e-3), pytest.param(160, 2e-5, 1e-3, marks=pytest.mark.nightly)],
)
def test_strip_folded_back_onto_itself_on_the_ground(
    cells: int, thick: float, error: float
) -> None:
    """The loop of a heavy elastica; lengths in units of (D/q)^(1/3)."""
    front, loop, summit = 3.0, 4.68, 3.3
    length = (front + loop + 1.5) * LENGTH

    def angle(along: Any, steepest: float) -> Any:
        since = along / LENGTH - front
        rise = (1 - np.cos(math.pi * np.clip(since / summit, 0, 1))) / 2
        fall = (1 - np.cos(math.pi * np.clip((since - summit) / (loop - summit), 0, 1))) / 2
        return steepest * rise - (steepest - math.pi) * fall

    steepest = brentq(
        lambda a: curve(length, cells, lambda x: angle(x, a))[1, -1] - 1.35 * thick, math.pi, 5
    )
    model, own, start = folded_strip(
        length, cells, thick, 0.0, lambda x: angle(x, steepest), ground=True
    )
    own.check_start(model.points + start.displacement)
    model, found = rest(model, start=start)
    assert distance_of_layers(own, model.points + found.displacement) > thick
    line = middle(model) / LENGTH
    assert line[:, 2].max() == pytest.approx(0.90660, rel=error)
    edges = np.diff(line, axis=0)
    slope = np.unwrap(np.arctan2(edges[:, 2], edges[:, 0]))
    assert math.degrees(slope.max()) == pytest.approx(212.39, rel=error)
    bent = np.diff(slope) / np.linalg.norm(edges[1:], axis=1)
    assert bent.max() == pytest.approx(2.53374, rel=error)


@has_library
def test_layers_that_pass_through_each_other_at_the_start_are_refused() -> None:
    """Though no vertex or edge of one is near one of the other."""
    model, own, start = hairpin(cells=21, thick=3e-5)
    place = model.points + start.displacement
    beyond = model.points[:, 0] > 0.09
    place[beyond] += [0.0, 3e-3, -24e-3]
    with pytest.raises(InputError, match="passes through itself"):
        own.check_start(place)


@has_library
def test_start_that_overlaps_is_refused_with_its_place() -> None:
    model, _, start = hairpin()
    moved = start.displacement.copy()
    moved[:, 2] -= np.where(model.points[:, 0] > 0.07, 16.2e-3, 0.0)
    with pytest.raises(InputError, match=r"overlaps itself at \(.*\) m"):
        motion_of(model, displacement=moved)


@has_library
def test_cells_whose_diagonal_would_touch_a_corner_are_refused() -> None:
    """A corner of a square of 1 mm is 0.707 mm from it; contact reaches 1.5 thicknesses."""
    points, tetrahedra = build_lattice((0, 1e-2, 0, 1e-2, 0, 1e-4), (10, 10, 1))
    surface = find_mid_surface(points, tetrahedra)
    assert surface is not None
    assert SelfContact(points, surface, 0.46e-3, 1e6).energy(points) == 0.0
    with pytest.raises(InputError, match=r"a corner is 0.000707 m away from the diagonal"):
        SelfContact(points, surface, 0.48e-3, 1e6)


def test_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ipctk", None)
    with pytest.raises(MissingLibraryError, match=r"spacemap_vtk\[contact\]"):
        self_contact.load_library()


def test_solids_that_should_touch_themselves_are_refused() -> None:
    solver = ModalSolver(elements="tetrahedra")
    with pytest.raises(InputError, match="only a sheet can touch itself"):
        connect(WeaveSource(), TetraCage(), LayerContact(), solver).update()


SCENE = """
[weave]
pattern = "plain"
ends = 40
picks = 4
warp_spacing = "0.5 mm"
weft_spacing = "0.5 mm"
warp_diameter = "0.24 mm"
weft_diameter = "0.24 mm"

[cage]
divisions = [20, 1, 1]
"""


def fold_scene(folder: Path, gap: float, rest: str) -> Scene:
    """Write a cage whose end is folded back, its mid-surfaces some thicknesses apart."""
    (folder / "flat.toml").write_text(SCENE, encoding="utf-8")
    flat = Scene.read(folder / "flat.toml")
    flat.cage.update()
    cage, cloth = flat.cage.output, flat.woven.cloth  # type: ignore[union-attr]
    points = points_of(cage).astype(np.float64)
    along = points[:, 0] - points[:, 0].min()
    length, thickness = np.ptp(along), 2 * cloth.level + cloth.sheet_thickness
    turned = np.where(along < 0.5 * length, 0.0, math.pi)
    above = points[:, 2] - points[:, 2].mean()
    # The middle cell is left out of the fold: all others lie flat.
    moved = np.zeros(points.shape)
    upper = turned > 0
    moved[upper, 0] = length - 2 * along[upper]
    moved[upper, 2] = gap * thickness - 2 * above[upper]
    state = vtkUnstructuredGrid()
    state.CopyStructure(cage)
    add_array(state.GetPointData(), "displacement", moved)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(folder / "state.vtu"))
    writer.SetInputData(state)
    assert writer.Write() == 1
    (folder / "scene.toml").write_text(rest, encoding="utf-8")
    return Scene.read(folder / "scene.toml")


def test_yarns_of_layers_that_lie_flat_on_each_other_do_not_overlap(tmp_path: Path) -> None:
    """Where the mid-surfaces are as far apart as contact lets them come."""
    weave = SCENE.split("[cage]")[0]
    scene = fold_scene(tmp_path, 1.0, weave + '[motion]\nfile = "state.vtu"\n')
    scene.update(0.0)
    points = points_of(scene.polygons).astype(np.float64)
    moved = vtk_to_numpy(scene.polygons.GetPointData().GetArray("displacement"))
    normals = vtk_to_numpy(scene.polygons.GetPointData().GetNormals())
    rest = points[:, 0] - moved[:, 0]
    width = 0.5e-3 * 2
    flat = abs(rest - rest.mean()) > 2 * width
    layer = (rest[flat] > rest.mean()).astype(int)
    found = point_clearances(points[flat], normals[flat], layer, reach=2e-5)
    assert -1e-3 * 0.24e-3 < found.min() < 0.05 * 0.24e-3


@has_library
@pytest.mark.parametrize("part", ["equilibrium", "steps"])
def test_a_scene_whose_start_overlaps_is_refused_with_its_place(
    part: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    modal = '[contact]\nself = true\n[modal]\nelements = "sheet"\nfixed = "-x"\nmodes = 1\n'
    cage, more, *command = {
        "equilibrium": (
            "divisions = [20, 1, 1]",
            'gravity = [0, 0, -9.81]\nstart = "state.vtu"\n',
            "modes",
        ),
        "steps": (
            'method = "file"\nfile = "state.vtu"',
            '[transient]\ninitial_displacement_array = "displacement"\n',
            *("render", "-o", str(tmp_path / "a.png")),
        ),
    }[part]
    weave = SCENE.split("divisions")[0]
    fold_scene(tmp_path, 0.5, weave + cage + "\n" + modal + more)
    with pytest.raises(SystemExit) as stopped:
        main([*command, str(tmp_path / "scene.toml"), "-q"])
    code = stopped.value.code
    del stopped  # its traceback holds the stages
    assert code == 2
    shown = " ".join(capsys.readouterr().err.split())
    assert re.search(r"overlaps itself at \(.*\) m: its layers are 0.000\d+ m apart", shown)
    assert "allowed: at least 0.00048 m between mid-surfaces" in shown
