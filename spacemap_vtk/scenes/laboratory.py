"""The cloth of a scene in the laboratory: its stiffness, its tests, and their data sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from spacemap_vtk.applicability import LIMITS
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.cage_material import WOVEN
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.textile_sheet import content_of
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.io.output import format_csv
from spacemap_vtk.laboratory.catalogue import TESTS, LaboratoryTest, find_test
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import Measurement
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.ndarrays import Progress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.crimp.cloth_law import cloth_law
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.weave.figures import fabric_figures

#: Name that stands for all tests.
ALL = "all"
#: Stiffness of spun cotton yarns of 30 tex whose crossings do not flatten, for [yarns].
COTTON = {
    "inextensible": False,
    "modulus": "300 cN/tex",
    "bending": "2 mN.mm2",
    "flattest": 1,
}
#: Cure of a fabric without stiffness.
GIVE_STIFFNESS = (
    "Give the stiffness of the yarns, for example --set yarns.inextensible=false --set "
    'yarns.modulus="300 cN/tex" --set yarns.bending="2 mN.mm2" --set yarns.flattest=1 (spun '
    "cotton of 30 tex whose crossings do not flatten), or choose a measured fabric, as --set "
    "modal.material=denim"
)
#: The same for a knit or another textile.
_GIVE_TEXTILE = (
    'Give the stiffness of the yarns, for example --set textile.tension="300 N" --set '
    'textile.bending="10 mN.mm2" --set modal.material=yarns'
)


class TestResult(NamedTuple):
    """A test and what came of it."""

    test: LaboratoryTest
    measurement: Measurement | None
    #: Why the test cannot be made with this cloth; empty if it was made.
    refusal: str = ""


def choose_tests(name: str) -> tuple[LaboratoryTest, ...]:
    """Return the test of a name, or all tests."""
    return TESTS if name == ALL else (find_test(name),)


def measure_scene(scene: Scene, name: str, progress: Progress | None = None) -> list[TestResult]:
    """Run one test, or all that can be made, with the cloth of a scene."""
    tests, fabric = choose_tests(name), fabric_of(scene)
    results = []
    for number, test in enumerate(tests):

        def report(share: float, number: int = number) -> None:
            if progress is not None:
                progress((number + share) / len(tests))

        try:
            with scene.add_file_to_errors():
                results.append(TestResult(test, test.measure(fabric, report)))
        except InputError as error:
            if name != ALL:
                raise
            results.append(TestResult(test, None, error.message))
    return results


def fabric_of(scene: Scene) -> Fabric:
    """Return the cloth of a scene for the laboratory; solves nothing."""
    # Its stiffness is that of a sheet of a measured fabric or of yarns in [modal], with what is
    # measured there; without such a sheet, that of the yarns in [yarns]; else that of the sheet.
    solver, yarns = scene.stage("solver"), scene.stage("crimp")
    solver = solver if isinstance(solver, ModalSolver) else None
    elastic = yarns if isinstance(yarns, YarnParameters) and not yarns.inextensible else None
    found = None
    if solver is not None and solver.material in (WOVEN, *FABRICS):
        found = _from_sheet(scene, solver, elastic)
    elif elastic is not None and scene.woven is not None:
        found = _from_yarns(scene, elastic)
    elif solver is not None:
        found = _from_sheet(scene, solver, None)
    if found is None:
        raise InputError(
            f"{scene.file or scene.title}: this scene gives the stiffness of neither yarns nor "
            "sheet",
            cure=_GIVE_TEXTILE if scene.textile and scene.woven is None else GIVE_STIFFNESS,
        )
    return found


def _from_yarns(scene: Scene, yarns: YarnParameters) -> Fabric:
    assert scene.woven is not None
    with scene.add_file_to_errors():
        cloth = scene.woven.cloth
        mechanics, figures = yarns.yarns(cloth), fabric_figures(cloth)
        law = cloth_law(cloth, mechanics)
        plate = replace(cloth_stiffness(cloth, mechanics), law=law)
        if law.kinds_error > (limit := LIMITS["kinds"]).most:
            scene.warn(limit.warning(law.kinds_error))
    mass = figures["areal_mass"]
    return Fabric(plate, figures["thickness"], mass, "its yarns", cloth, mechanics, yarns.friction)


def _from_sheet(scene: Scene, solver: ModalSolver, yarns: YarnParameters | None) -> Fabric | None:
    """Return the sheet of a cage; None if it is a solid that stands for no measured fabric."""
    stage = scene.stage("cage")
    assert stage is not None
    scene.update_stage(stage)
    with scene.add_file_to_errors():
        sheet = solver.sheet_of_cage(stage.output)
        if sheet is not None:
            plate, mass, thickness = sheet
        elif solver.material in FABRICS:
            thickness = FABRICS[solver.material].plate_thickness
            plate, mass = solver.sheet_stiffness(thickness)
        else:
            return None
    if scene.woven is None:
        content = content_of(stage.output) if solver.material == WOVEN else None
        loops = isinstance(content, TextileKind) and content.loops
        origin = "the sheet in [modal]" if content is None else "its yarns"
        return Fabric(plate, thickness, mass, origin, loops=loops)
    cloth = scene.woven.cloth
    thickness = fabric_figures(cloth)["thickness"]
    if solver.material == WOVEN and yarns is not None:
        mechanics = yarns.yarns(cloth)
        return Fabric(plate, thickness, mass, "its yarns", cloth, mechanics, yarns.friction)
    origin = solver.material if solver.material in FABRICS else "the sheet in [modal]"
    return Fabric(plate, thickness, mass, origin)


def results_as_json(results: Sequence[TestResult]) -> dict[str, Any]:
    """Return results for programs: a table for each test, with figures, curves and notes."""
    tables: dict[str, Any] = {}
    for test, measurement, refusal in results:
        table: dict[str, Any] = {
            "title": test.title,
            "instrument": test.instrument,
            "specimen": test.specimen,
        }
        if measurement is None:
            table["refused"] = refusal
        else:
            table["figures"] = [reading.as_json() for reading in measurement.readings]
            table["notes"] = list(measurement.notes)
        tables[test.name] = table
    return tables


def figures_as_csv(results: Sequence[TestResult]) -> str:
    """Return the figures of tests as a table."""
    rows: list[Sequence[object]] = [
        (
            *("test", "instrument", "symbol", "figure", "direction", "value", "unit", "SI value"),
            *("SI unit", "error", "note"),
        )
    ]
    for test, measurement, _ in results:
        for reading in () if measurement is None else measurement.readings:
            figure = reading.as_json()
            numbers = {key: _format(figure[key]) for key in ("value", "si_value", "error")}
            if reading.exact:
                numbers["error"] = "exact"
            rows.append(
                (
                    *(test.name, test.instrument, reading.symbol, reading.name, reading.direction),
                    *(numbers["value"], reading.unit.name, numbers["si_value"], reading.unit.si),
                    *(numbers["error"], reading.note),
                )
            )
    return format_csv(rows)


def curves_as_csv(measurement: Measurement) -> str:
    """Return the curves of a test as a table."""
    axes = measurement.x_axis, measurement.y_axis
    headings = [axis.label for axis in axes]
    headings += [f"{axis.name} [{axis.unit.si}]" for axis in axes]
    rows: list[Sequence[object]] = [("curve", *headings)]
    for curve in measurement.curves:
        for x, y in zip(curve.x, curve.y, strict=True):
            own = x / axes[0].unit.size, y / axes[1].unit.size
            rows.append((curve.name, *(_format(value) for value in (*own, x, y))))
    return format_csv(rows)


def _format(value: Any) -> str:
    return "" if value is None else f"{value:.9g}"
