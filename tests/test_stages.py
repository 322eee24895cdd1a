"""What a stage says of itself is all that scenes, command line and ParaView's plugin know of it."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Generator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersSources import vtkSphereSource

import spacemap_vtk
from spacemap_vtk import CrimpInterchange, ModalSolver, TetraCage, WeaveSource, connect
from spacemap_vtk.app.plots.curves import CurveRequest, compute_curves
from spacemap_vtk.cli.main import main
from spacemap_vtk.datasets.arrays import add_array, points_of, tetrahedra_of, to_points
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters import crimp_interchange
from spacemap_vtk.filters.algorithm import SAME_AS_INPUT
from spacemap_vtk.filters.base import ROLES, ProvidedArray, Stage
from spacemap_vtk.mechanics.response.cage_response import Motion
from spacemap_vtk.parameters import Real
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.pipeline import section_classes, switch_section
from spacemap_vtk.scenes.scene import Scene

SMALL = {"weave": {"ends": 2, "picks": 2}, "surface": {"subdivisions": 1}}


class Shearing:
    """The motion of a cage that is sheared: no modes, no forces."""

    def __init__(self, cage: Any, rate: float) -> None:
        self.points, self.cells, self.rate = points_of(cage), tetrahedra_of(cage), rate

    def at_time(self, time: float) -> np.ndarray:
        speed = np.zeros((3, len(self.points), 3))
        speed[:, :, 2] = np.outer((self.rate * time, self.rate, 0.0), self.points[:, 1])
        return speed

    def history(self, weights: np.ndarray, times: np.ndarray) -> np.ndarray:
        return np.stack([weights @ self.at_time(time) for time in times], axis=1)

    def energies(self, times: np.ndarray) -> np.ndarray:
        return np.full((len(times), 4), np.nan)

    def potential(self, times: np.ndarray) -> np.ndarray:
        return np.full(len(times), np.nan)


class Shear(Stage):
    """Shear a cage, more and more."""

    section = "shear"
    role = "mover"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"
    provides: ClassVar = {"displacement": ProvidedArray("point", "m")}

    rate = Real(0.5, "How fast it shears.", unit="1/s", minimum=0.0)

    @property
    def motion(self) -> Shearing | None:
        return None if self.output is None else Shearing(self.output, self.rate)

    def time_range(self, inputs: list[Any]) -> tuple[float, float]:
        return 0.0, 1.0

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        output.ShallowCopy(inputs[0])
        moved = np.zeros((output.GetNumberOfPoints(), 3))
        moved[:, 2] = self.rate * time * points_of(output)[:, 1]
        add_array(output.GetPointData(), "displacement", moved)


class Doubled(Stage):
    """Double what the cage does."""

    section = "doubled"
    role = "rotation"
    inputs = ("vtkUnstructuredGrid",)
    takes = ("cage",)
    makes = "cage"

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        output.ShallowCopy(inputs[0])
        moved = vtk_to_numpy(inputs[0].GetPointData().GetArray("displacement"))
        add_array(output.GetPointData(), "displacement", 2.0 * moved)


class Tightened(Stage):
    """Look at the cage, and hand the object on."""

    section = "tightened"
    role = "crimp"
    inputs = ("vtkPointSet", "vtkUnstructuredGrid")
    input_names = ("Input", "Cage")
    takes = ("object", "cage")
    output_type = SAME_AS_INPUT

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        assert inputs[1].GetPointData().GetArray("displacement") is not None
        output.ShallowCopy(inputs[0])


class Moved(Stage):
    """Move the points of an object along z."""

    inputs = ("vtkPointSet",)
    takes = ("object",)
    output_type = SAME_AS_INPUT

    by = Real(1.0, "How far.", unit="m")

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        output.ShallowCopy(inputs[0])
        output.SetPoints(to_points(np.add(points_of(inputs[0]), [0.0, 0.0, self.by])))


class MovedFirst(Moved):
    """Move the object before a cage is made round it."""

    section = "first"
    role, after = "first", "source"


class MovedLast(Moved):
    """Move the object after the cage has moved it."""

    section = "last"
    role, after = "last", "warp"


class Halved(Doubled):
    """Halve what the cage does, once it has been doubled."""

    section = "halved"
    role, after = "halved", "rotation"

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        output.ShallowCopy(inputs[0])
        moved = vtk_to_numpy(inputs[0].GetPointData().GetArray("displacement"))
        add_array(output.GetPointData(), "displacement", 0.5 * moved)


class PatchTessellator(spacemap_vtk.PatchTessellator):
    """Turn patches into polygons, and shift them."""

    shift = Real(0.0, "How far the surface is shifted along z.", unit="m")

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        super().run(inputs, output, time)
        vtk_to_numpy(output.GetPoints().GetData())[:, 2] += self.shift


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line of the program's table for each toy."""
    for toy in (Shear, Doubled, Tightened, MovedFirst, MovedLast, Halved, PatchTessellator):
        monkeypatch.setitem(spacemap_vtk.FILTERS, toy.__name__, __name__)


def run_through(work: Generator[None, None, Any]) -> Any:
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


def height(scene: Scene) -> np.ndarray:
    return vtk_to_numpy(scene.polygons.GetPointData().GetArray("displacement"))[:, 2]


@pytest.mark.usefixtures("toys")
def test_new_mover_becomes_a_scene_section(tmp_path: Path) -> None:
    file = tmp_path / "sheared.toml"
    file.write_text('[weave]\nends = 2\npicks = 2\n[shear]\nrate = "2 Hz"\n', "utf-8")
    scene = Scene.read(file)
    assert scene.stage("mover") is scene.part(Shear)
    scene.update(time=0.5)
    moved = scene.polygons
    rest = points_of(moved) - vtk_to_numpy(moved.GetPointData().GetArray("displacement"))
    np.testing.assert_allclose(height(scene), rest[:, 1], atol=1e-9)
    assert "displacement" in scene.colorings
    assert not {"velocity", "strain", "stress"} & set(scene.colorings)
    scene.set("shear.rate=4")
    scene.update()
    np.testing.assert_allclose(height(scene), 2 * rest[:, 1], atol=1e-9)
    with pytest.raises(InputError, match=r"response: cannot be combined with \[shear\]"):
        Scene({"shear": {}, "response": {}})
    with pytest.raises(InputError, match=r"\[shear\]"):
        Scene({"sheer": {}})
    with pytest.raises(InputError, match=r"shear\.rate.*at least 0"):
        scene.set("shear.rate=-1")


@pytest.mark.usefixtures("toys")
def test_new_stages_appear_on_the_command_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def stated(*words: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 0, capsys.readouterr().err
        return capsys.readouterr().out

    assert "[shear]  Shear a cage, more and more." in stated("keys")
    assert 'rate = "0.5 1/s"\n    How fast it shears.' in stated("keys", "shear")
    assert "shift = " in stated("keys", "surface")
    output = str(tmp_path / "sheared.vtp")
    words = [f"--set={word}" for word in ("shear.rate=2", "surface.shift=1 m", "weave.ends=2")]
    stated("export", "plain_weave", *words, "--set=weave.picks=2", "--time=1", "-o", output, "-q")
    low, high = pv.read(output).bounds[4:]
    assert low > 0.9
    assert high < 1.1


@pytest.mark.usefixtures("toys")
def test_new_stages_appear_in_paraview() -> None:
    from spacemap_vtk.paraview.stages import make_proxies

    made = make_proxies()
    xml = made["Shear"]._pvsm_proxy_xml
    assert 'name="Shear"' in xml
    assert 'command="set_rate"' in xml
    assert "How fast it shears." in xml
    assert "TimeRangeInformationHelper" in xml
    assert 'command="set_shift"' in made["PatchTessellator"]._pvsm_proxy_xml
    assert 'name="Cage"' in made["Tightened"]._pvsm_proxy_xml


@pytest.mark.usefixtures("toys")
def test_new_motion_model_is_plotted_like_the_built_in_one() -> None:
    scene = Scene({**SMALL, "shear": {"rate": 2.0}})
    scene.update(time=0.1)
    motion = scene.cage_stage.motion
    assert isinstance(motion, Motion)
    curves = run_through(compute_curves(scene, CurveRequest("a", ((0.0, 1e-4, 0.0),), 0.0, 1.0)))
    assert curves is not None
    assert curves.balance is None
    np.testing.assert_allclose(curves.motion[0, 0, :, 2], 2e-4 * curves.times, atol=1e-12)
    np.testing.assert_allclose(curves.motion[1, 0, :, 2], 2e-4, atol=1e-12)
    assert curves.frequencies.size == 0
    # With no point asked for, the one that moves most.
    curves = run_through(compute_curves(scene, CurveRequest("b", (), 0.0, 1.0)))
    assert curves is not None
    assert abs(curves.points[0, 1]) == abs(motion.points[:, 1]).max()
    swing = Scene({**SMALL, "response": {}})
    swing.update(time=0.1)
    assert isinstance(swing.cage_stage.motion, Motion)


@pytest.mark.usefixtures("toys")
def test_optional_stages_are_placed_by_their_roles() -> None:
    scene = Scene({**SMALL, "shear": {}, "doubled": {}, "tightened": {}})
    kinds = [type(stage).__name__ for stage in scene.stages]
    assert kinds == [
        *("WeaveSource", "TetraCage", "ModalSolver", "Shear", "Doubled", "Tightened"),
        *("BarycentricWarp", "PatchTessellator"),
    ]
    scene.update(time=1.0)
    assert [stage.executions for stage in scene.stages] == [1] * 8
    simple = Scene({**SMALL, "shear": {}})
    simple.update(time=1.0)
    np.testing.assert_allclose(height(scene), 2 * height(simple), atol=1e-9)
    assert scene.deformed_cage is scene.part(Doubled).output
    scene.update(time=0.5)
    assert [stage.executions for stage in scene.stages] == [1, 1, 1, 2, 2, 2, 2, 2]


@pytest.mark.usefixtures("toys")
def test_stage_can_declare_a_new_role() -> None:
    rest = Scene(SMALL)
    rest.update()
    low, high = rest.polygons.GetBounds()[4:]
    # Before the surface alone: nothing moves.
    still = Scene({**SMALL, "last": {"by": "2 m"}, "first": {}})
    assert [stage.section for stage in still.stages] == ["weave", "first", "last", "surface"]
    assert not still.moves
    still.update()
    np.testing.assert_allclose(still.polygons.GetBounds()[4:], [low + 3.0, high + 3.0], atol=1e-6)
    assert still.patches is still.part(MovedLast).output

    scene = Scene({**SMALL, "shear": {}, "doubled": {}, "halved": {}, "first": {}, "last": {}})
    assert [stage.section for stage in scene.stages] == [
        *("weave", "first", "cage", "modal", "shear", "doubled", "halved"),
        *("warp", "last", "surface"),
    ]
    scene.update(time=1.0)
    assert scene.object_at_rest is scene.part(MovedFirst)
    simple = Scene({**SMALL, "shear": {}})
    simple.update(time=1.0)
    np.testing.assert_allclose(height(scene), height(simple), atol=1e-6)
    expected = np.array(simple.polygons.GetBounds()[4:]) + 2.0
    np.testing.assert_allclose(scene.polygons.GetBounds()[4:], expected, atol=1e-6)
    scene.update(time=0.5)
    assert [stage.executions for stage in scene.stages] == [1, 1, 1, 1, 2, 2, 2, 2, 2, 2]
    given = {"weave", "shear", "first"}
    assert switch_section(scene.parts, given, "shear", False) == {"weave", "first"}
    assert switch_section(scene.parts, given, "first", False) == {"weave", "shear"}


@pytest.mark.usefixtures("toys")
def test_role_without_a_position_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Halved, "after", "nothing")
    with pytest.raises(InputError, match=r'Halved cannot be placed.*"halved", after "nothing"'):
        Scene(SMALL)


def test_sections_choose_the_stages_of_a_scene() -> None:
    still = Scene(SMALL)
    assert [stage.role for stage in still.stages] == ["source", "surface"]
    assert not still.moves
    assert still.stage("mover") is None
    still.set("modal.modes=6")
    assert tuple(stage.role for stage in still.stages) == ROLES
    still.assign("motion", "file", "sheet.pvd")
    assert [stage.section for stage in still.stages] == ["weave", "motion", "warp", "surface"]
    still.assign("object", "file", "model.ply")
    assert still.source is still.object
    assert "yarn" not in still.arrays


@pytest.mark.parametrize(
    "make", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))]
)
def test_copies_of_a_stage_have_its_parameters_and_no_connections(make: Any) -> None:
    ball = {"shape": "sphere", "radius": "2 mm", "center": (0, 0, "-9 mm")}
    solver = ModalSolver(
        elements="sheet", material="yarns", obstacles=[ball], fixed=["-x", "+y:z"], modes=3
    )
    solver.yarns = CrimpInterchange(inextensible=False, tension=90.0, bending=2e-9, flattest=1.0)
    connect(WeaveSource(ends=3, picks=3), TetraCage(divisions=(2, 2, 1)), solver)
    copied = make(solver)
    assert copied.settings == solver.settings
    assert copied.yarns.settings == solver.yarns.settings
    assert [s.GetNumberOfInputConnections(0) for s in (solver, copied)] == [1, 0]
    connect(WeaveSource(ends=3, picks=3), TetraCage(divisions=(2, 2, 1)), copied)
    frequencies = [pv.wrap(s.update().output)["frequencies"] for s in (solver, copied)]
    np.testing.assert_array_equal(*frequencies)


def test_stages_are_shown_with_their_parameters() -> None:
    shown = repr(TetraCage(divisions=(2, 2, 1), order=2))
    assert eval(shown).settings == TetraCage(divisions=(2, 2, 1), order=2).settings


def test_yarns_of_a_solver_must_be_a_stiffness() -> None:
    with pytest.raises(InputError, match="a float is not the stiffness of yarns"):
        ModalSolver().yarns = 90.0  # type: ignore[assignment]


def test_yarn_stiffness_is_shared_with_the_solver() -> None:
    scene = Scene({**SMALL, "modal": {"elements": "sheet", "modes": 1}})
    assert scene.modal.yarns is None
    scene.set("yarns.bending=2 mN.mm2")
    scene.update(0.0)
    scene.set("yarns.flattest=1")
    assert [scene.update(0.0), scene.modal.executions] == [None, 1]
    for assignment in ("inextensible=false", "tension=90 N"):
        scene.set(f"yarns.{assignment}")
    scene.set("modal.material=yarns")
    scene.check()
    assert [scene.update(0.0), scene.modal.executions] == [None, 2]
    scene.set("yarns.bending=3 mN.mm2")
    assert [scene.update(0.0), scene.modal.executions] == [None, 3]
    # of another scene's values, without the section
    scene.apply_settings({"modal": {"material": "denim"}}, {"weave", "modal"})
    assert scene.modal.yarns is None


def test_every_registered_stage_has_its_declarations() -> None:
    for name in spacemap_vtk.FILTERS:
        stage = getattr(spacemap_vtk, name)
        assert stage.role in ROLES or stage.after, name
        assert section_classes()[stage.section] is stage
        assert len(stage.takes) == len(stage.inputs) == len(stage.input_names) * bool(stage.inputs)


@pytest.fixture(scope="module")
def updated() -> dict[str, Stage]:
    """Every stage of the table, run."""
    root = Path(__file__).parent.parent / "scenes"
    unused = {"contact": {"self": False}}
    swing = Scene(SMALL | {"response": {}, "rotation": {}, "yarns": {}} | unused)
    swing.update(time=0.1)
    stepped = Scene(SMALL | {"transient": {"max_step": 1e-4}})
    stepped.update(time=1e-4)
    read = Scene({"object": {}, "motion": {"array": "U"}})
    read.object.file = next((root / "objects").glob("*.ply"))
    read.motion.file = root / "calculix" / "sheet.pvd"
    read.object.update()
    read.motion.update(time=0.01)
    knit = Scene({"textile": {"wales": 2, "courses": 2}})
    knit.update()
    cell = connect(spacemap_vtk.WeaveSource(), spacemap_vtk.UnitCell(voxels=8))
    cell.update()
    stages = [*swing.stages, stepped.stage("mover"), read.object, read.motion, knit.source, cell]
    return {type(stage).__name__: stage for stage in stages}


@pytest.mark.parametrize("name", spacemap_vtk.FILTERS)
def test_provided_arrays_are_in_the_output(updated: dict[str, Stage], name: str) -> None:
    stage = updated[name]
    data = {
        "point": stage.output.GetPointData(),
        "cell": stage.output.GetCellData(),
        "field": stage.output.GetFieldData(),
    }
    for array, provided in stage.arrays.items():
        assert data[provided.association].GetAbstractArray(array) is not None, array
    # Colourings name arrays that there are, in their own units.
    for word, coloring in COLORINGS.items():
        if coloring.has_scale and coloring.array in stage.arrays:
            assert stage.arrays[coloring.array].unit == coloring.unit, word


def test_every_numeric_array_has_a_colouring() -> None:
    stages = (getattr(spacemap_vtk, name) for name in spacemap_vtk.FILTERS)
    arrays = {
        name
        for stage in stages
        for name, array in stage.provides.items()
        if array.association != "field"
    }
    # What is not: colours as they are, what is of single vertices, what BarycentricWarp uses up.
    of_vertices = {"fixed", "fixed_components", "rigid_body", "spring_stiffness", "point_mass"}
    of_vertices |= {"reaction"}
    of_voxels = {"fraction", "direction", "packing"}
    others = {
        *of_voxels,
        "color",
        "nodal_mass",
        *of_vertices,
        crimp_interchange.FOOT,
        crimp_interchange.OFFSET,
    }
    assert arrays - others == {coloring.array for coloring in COLORINGS.values()} - {""}


@pytest.mark.parametrize("name", spacemap_vtk.FILTERS)
def test_pyvista_wraps_every_output(updated: dict[str, Stage], name: str) -> None:
    wrapped = pv.wrap(updated[name].output)
    assert isinstance(wrapped, pv.DataSet)
    assert wrapped.n_points == updated[name].output.GetNumberOfPoints() > 0


def test_provided_arrays_depend_on_parameters() -> None:
    response = spacemap_vtk.ModalResponse(stress=False)
    assert "stress" not in response.arrays
    assert "kinetic_energy" in response.arrays
    response.configure(stress=True, energy=False)
    assert "von_mises" in response.arrays
    assert "kinetic_energy" not in response.arrays


def test_connect_accepts_stages_and_vtk_algorithms() -> None:
    ball, surface = vtkSphereSource(), spacemap_vtk.PatchTessellator()
    cage = spacemap_vtk.TetraCage(divisions=(1, 1, 1))
    modal, response = spacemap_vtk.ModalSolver(modes=6), spacemap_vtk.ModalResponse()
    warp = spacemap_vtk.BarycentricWarp()
    last = connect((ball, connect(ball, cage, modal, response)), warp, surface)
    assert last is surface
    surface.update(time=0.1)
    assert [stage.executions for stage in (cage, modal, response, warp, surface)] == [1] * 5
    # Data, too; and again, in place of what was there.
    connect((ball, response.output), warp)
    assert warp.update().output.GetNumberOfPoints() == ball.GetOutput().GetNumberOfPoints()
    assert warp.GetNumberOfInputConnections(1) == 1
    with pytest.raises(InputError, match="too many inputs for TetraCage: 2"):
        connect((ball, ball), cage)


@pytest.mark.parametrize(
    ("given", "section", "on", "then"),
    [
        ("weave view", "response", True, "weave view response"),
        ("weave cage response", "transient", True, "weave cage transient"),
        ("weave transient", "rotation", True, "weave rotation"),
        ("weave cage modal rotation", "motion", True, "weave motion rotation"),
        ("weave motion rotation", "cage", True, "weave cage rotation"),
        ("weave modal rotation", "rotation", False, "weave modal"),
        ("weave modal rotation view", "cage", False, "weave view"),
        ("weave rotation", "rotation", False, "weave cage modal response warp"),
    ],
)
def test_switching_a_stage_also_switches_dependent_stages(
    given: str, section: str, on: bool, then: str
) -> None:
    parts = Scene({"weave": {}}).parts
    assert switch_section(parts, given.split(), section, on) == set(then.split())
