"""A scene's figures as plain dictionaries, for the commands ``modes`` and ``info``."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.applicability import LIMITS, REFUSED_ROTATION
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.modal_model import ModesReader, contact_of, sheet_of
from spacemap_vtk.datasets.reactions import reactions_of
from spacemap_vtk.errors import (
    GeometryError,
    InputError,
    SolverError,
    SpacemapError,
    add_section_to_errors,
)
from spacemap_vtk.filters.cage_material import WOVEN
from spacemap_vtk.filters.error_estimates import estimate_errors
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.mechanics.boundary.places import parse_places
from spacemap_vtk.mechanics.contact.opening import resting_contacts
from spacemap_vtk.mechanics.elements.plates import DataSheet
from spacemap_vtk.mechanics.equilibrium.drape import drape_coefficient, shadow_area
from spacemap_vtk.mechanics.modal.cage_modes import CageModes
from spacemap_vtk.mechanics.modal.damping import Damping, HasDamping
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.resolution import describe_unresolved_modes, mode_errors
from spacemap_vtk.mechanics.response.linear_range import measure_extremes
from spacemap_vtk.mechanics.response.oscillator import classify_regimes, damping_ratio
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.figure_errors import add_errors, describe_unconverged
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.valid_ranges import collect_findings
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import bending_bounds
from spacemap_vtk.textile.drafts import drawdown
from spacemap_vtk.textile.geometry.weave import build_weave, count_patches
from spacemap_vtk.textile.geometry.yarn_clearance import (
    Clearance,
    find_contact,
    measure_clearance,
    measure_in_steps,
)
from spacemap_vtk.textile.weave.cloth import FAMILIES
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.threads import Threads
from spacemap_vtk.textile.weave.yarn import section_factor

#: For cloth with more crossings these are not computed: the clearance of splines, the clearance of
#: a deformed cloth, and its motion.
MOST_CROSSINGS = 20_000
#: Largest number of times of a motion that are examined.
SAMPLES = 61
#: Least number of times of a motion that are examined.
FEWEST = 13
#: Cells times number of times that are examined; they take 0.2 s.
LOOKED_AT = 120_000
#: Most cells of a cage whose motion is reported.
MANY_CELLS = 20_000
#: Cosine of the largest slope of a cloth that is draped over a disc.
COSINE_OF_LEVEL = 0.999
#: Figures of a fabric, and of its warp or weft, that are unknown if the yarns do not fit.
_NO_FIGURES: dict[str, Any] = dict.fromkeys(
    (
        "thickness",
        "cover",
        "volume_fraction",
        "areal_mass",
        "fibre_volume_fraction",
        "feasible_height",
        "radial_error",
        "patches",
        "control_points",
        "memory_bytes",
        "least_clearance",
    )
)
_NO_YARN_FIGURES = dict.fromkeys(
    ("theta_deg", "length", "crimp", "height", "mean_crimp", "cover", "yarn_length")
)


def report_modes(scene: Scene, errors: bool | None = False) -> dict[str, Any]:
    """Return the modes of a scene's cage, and other figures of its state at rest, by name."""
    # `errors` asks for the error of each figure by solutions on coarser cages; None: unless these
    # take long to make. ``error`` of a mode is relative; other errors have the unit of their
    # figure. One that is not estimated is None, and ``errors_missing`` says why.
    solver, mover = scene.stage("solver"), scene.stage("mover")
    if solver is None:
        missing, cure = "a motion from a file", "Replace [motion] by [modal]."
        if not scene.moves:
            missing = "no cage"
            cure = (
                "Let it move, for example with --hang, or add a section [modal], as by "
                "--set cage.divisions=[5,5,1]."
            )
        raise InputError(f"{scene.file}: the scene has {missing} and therefore no modes", cure=cure)
    scene.check()  # check the damping before the modes are solved
    scene.update_stage(solver)
    grid = solver.output
    cage = ModesReader().read(grid)
    eigenvalues, rounding = cage.eigenvalues, cage.eigenvalue_rounding
    damping = mover.damping if isinstance(mover, HasDamping) else Damping()
    rates = damping.mass_damping(eigenvalues), damping.beta
    shares = cage.mass_shares
    columns = {
        "eigenvalue": eigenvalues,
        "frequency_hz": np.sqrt(eigenvalues) / (2 * math.pi),
        "damping_ratio": damping_ratio(eigenvalues, *rates),
        "regime": classify_regimes(eigenvalues, *rates, rounding),
        "digits": [int(-math.log10(max(share, 1e-15))) for share in rounding],
        "effective_mass": cage.effective_masses,
        "effective_mass_share": shares,
        "cumulative_mass_share": shares.cumsum(axis=0),
        "opening_amplitude": _opening_amplitudes(cage),
    }
    rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    figures = {
        "modes": [dict(zip(columns, row, strict=True)) for row in rows],
        **_report_state(scene.modal, cage.model),
    }
    added = _add_errors(scene, figures, errors)
    if added["errors_missing"]:
        doubts = describe_unresolved_modes(list(mode_errors(cage.model, eigenvalues, cage.shapes)))
        if doubts:
            scene.warn(f"{doubts}; increase cage.divisions")
    return {
        "vertices": grid.GetNumberOfPoints(),
        "tetrahedra": grid.GetNumberOfCells(),
        "dof": cage.model.pencil.size,
        **report_sheet(sheet_of(grid)),
        **report_law(scene, sheet_of(grid) is not None),
        "mass": float(cage.nodal_mass.sum()),
        "movable_mass": cage.model.movable_mass.tolist(),
        "alpha": damping.alpha,
        "beta": damping.beta,
        **figures,
        "path": report_path(scene.modal),
        **added,
        "applicability": [finding.as_json() for finding in collect_findings(scene)],
        "warnings": scene.warnings,
    }


def _add_errors(scene: Scene, figures: dict[str, Any], errors: bool | None) -> dict[str, Any]:
    """Add the errors of a cage's figures to them, and return what is missing or not converged."""
    missing = "further cages would take long to make" if errors is None else "none were asked for"
    estimates, wider = None, []
    if errors or (errors is None and scene.cage.method != "tetwild"):
        try:
            estimates, missing = estimate_errors(scene.modal), ""
            solved = zip(estimates.wider, estimates.wider_modes, strict=True)
            wider = [_report_state(solver, modes.model) for solver, modes in solved]
        except (InputError, SolverError) as error:
            missing = error.message
            if isinstance(error, SolverError):
                scene.warn(f"how far the figures depend on the cage's cells is unknown: {missing}")
    add_errors(figures, wider, estimates)
    doubts = "" if estimates is None else describe_unconverged(figures, scene.cage)
    if doubts:
        scene.warn(doubts)
    return {"errors_missing": missing or None, "unconverged": doubts or None}


def _report_state(solver: ModalSolver, model: Model) -> dict[str, Any]:
    """Return the figures of a solver's equilibrium whose errors can be estimated."""
    return {
        "hung": _report_equilibrium(solver, model),
        "contact": report_obstacles(solver.output),
        "reactions": report_reactions(solver.output),
    }


def _opening_amplitudes(cage: CageModes) -> list[float | None]:
    """Return the amplitude of each mode's largest motion at which a contact would open [m]."""
    shapes = cage.shapes.reshape(len(cage.shapes), -1, 3)
    openings = [contact.find_openings(shapes) for contact in resting_contacts(cage.model)]
    if not openings:
        return [None] * len(shapes)
    least = np.minimum.reduce([multiples for opening in openings for multiples in opening])
    found = least * np.linalg.norm(shapes, axis=2).max(axis=1)
    return [amplitude if math.isfinite(amplitude) else None for amplitude in found.tolist()]


def report_obstacles(grid: vtkUnstructuredGrid) -> list[dict[str, Any]]:
    """Return the contact of a cage in equilibrium with each of its obstacles."""
    return [
        {
            "obstacle": number,
            "force": float(np.linalg.norm(found.force)),
            "direction": (found.force / (np.linalg.norm(found.force) or 1.0)).tolist(),
            "points": found.points,
            "penetration": found.penetration,
            "sliding": found.sliding,
        }
        for number, found in enumerate(contact_of(grid))
    ]


def report_reactions(grid: vtkUnstructuredGrid) -> list[dict[str, Any]]:
    """Return force [N] and moment [N m] on a cage at rest of each body that holds it."""
    return [
        {
            "kind": found.kind,
            "name": found.name,
            "force": found.force.tolist(),
            "moment": found.moment.tolist(),
            "point": found.about.tolist(),
        }
        for found in reactions_of(grid)
    ]


def report_path(solver: ModalSolver) -> dict[str, Any] | None:
    """Return how the equilibrium on obstacles and in grips was reached; None without these."""
    if not solver.is_hung or not (solver.obstacles or solver.grips or solver.start):
        return None
    return {
        "start": None if solver.start is None else solver.start.name,
        "moved": [n for n, obstacle in enumerate(solver.obstacles) if obstacle.path],
        "moved_grips": [n for n, grip in enumerate(solver.grips) if grip.path or grip.turns],
        "states": 1 + solver.path_lines * solver.path_steps,
    }


def report_sheet(sheet: DataSheet | None) -> dict[str, Any]:
    """Return whether a cage is a sheet, with its figures, or tetrahedra."""
    if sheet is None:
        return {"elements": "tetrahedra", "sheet": None, "poissons_ratios": None}
    warp, weft = sheet.tensile_rigidity
    ratio = sheet.poissons_ratio_in_plane
    return {
        "elements": "sheet",
        "sheet": sheet._asdict(),
        # For a pull along the warp, and along the weft.
        "poissons_ratios": [ratio, ratio * weft / warp],
    }


def report_law(scene: Scene, sheet: bool) -> dict[str, Any]:
    """Return the law of a sheet, and bounds of its bending if it is made from yarns."""
    woven, solver = scene.woven, scene.stage("solver")
    if not isinstance(solver, ModalSolver) or not sheet:
        return {}
    found: dict[str, Any] = {"law": solver.law_in_use()}
    if woven is None or solver.material != WOVEN:
        return found
    yarns = solver.yarns
    known = yarns.yarns(woven.cloth) if isinstance(yarns, YarnParameters) else yarns
    if isinstance(known, YarnMechanics):
        found["bending_bounds"] = bending_bounds(woven.cloth, known)._asdict()
    return found


#: What is said of a motion that is too large to be drawn.
_NOT_SHOWN = "which a linear motion cannot show"


def report_motion(scene: Scene) -> dict[str, Any] | None:
    """Return how far a scene's linear motion turns and stretches its cage; None if it has none."""
    mover = scene.stage("mover")
    if not isinstance(mover, ModalResponse):
        return None
    try:
        mover.update(0.0)  # its warnings do not concern the figures that were asked for
    except SpacemapError:  # drawing the motion raises this error and reports it
        return None
    return report_last_motion(scene)


def report_last_motion(scene: Scene) -> dict[str, Any] | None:
    """Return the figures of `report_motion` as of the last update."""
    mover = scene.stage("mover")
    response = mover.motion if isinstance(mover, ModalResponse) else None
    if response is None or mover is None or len(response.cells) > MANY_CELLS:
        return None
    rest = response.points + response.rest
    samples = max(FEWEST, min(SAMPLES, LOOKED_AT // len(response.cells)))
    times = np.linspace(0.0, mover.duration, samples)
    surface = response.modes.model.pencil.surface
    found = measure_extremes(response, rest, times, response.modes.gradient, surface)
    return {
        "largest_rotation_deg": math.degrees(found.rotation),
        "largest_stretch": found.stretch,
        "largest_volume_change": found.volume,
        "period_factor": found.pendulum_period,
        "rebuilt": scene.stage("rotation") is not None,
        "large": bool(found.rotation > LIMITS["rotation"].most),
    }


def is_refused(figures: dict[str, Any]) -> bool:
    """Return whether a motion turns the cage so far that it is not drawn."""
    turn = math.radians(figures["largest_rotation_deg"])
    return bool(not figures["rebuilt"] and turn > REFUSED_ROTATION)


def describe_motion(figures: dict[str, Any]) -> str:
    """Return the figures of `report_motion` as a sentence, with cures if they are out of range."""
    angle = math.radians(figures["largest_rotation_deg"])
    text = f"turns by up to {figures['largest_rotation_deg']:.3g}°"
    if is_refused(figures):
        return f"{summarise_motion(figures)}: hang the cloth in one step (--hang)"
    if not figures["rebuilt"]:
        text += f", lengths change by {100 * figures['largest_stretch']:.3g} %"
        text += f", volumes by {100 * figures['largest_volume_change']:.3g} %"
    rebuilt = LIMITS["swing"]
    limit = rebuilt if figures["rebuilt"] or angle > rebuilt.most else LIMITS["rotation"]
    if angle > limit.most:
        text += f"; {limit.model} is valid up to {limit.format(limit.most)}: {limit.cure}"
    if figures["large"] and math.isfinite(figures["period_factor"]):
        text += (
            f"; a swing of this size takes {figures['period_factor']:.3g} times as long: "
            "[transient] shows it"
        )
    return text


def summarise_motion(figures: dict[str, Any]) -> str:
    """Return the most important part of `describe_motion`, without the cures."""
    text = f"turns by up to {figures['largest_rotation_deg']:.3g}°"
    if is_refused(figures):
        return f"would turn by {figures['largest_rotation_deg']:.3g}°, {_NOT_SHOWN}"
    if not figures["rebuilt"]:
        return f"{text}, lengths change by {100 * figures['largest_stretch']:.3g} %"
    if math.isfinite(figures["period_factor"]):
        return f"{text}, and takes {figures['period_factor']:.3g} times as long as shown"
    return text


def _report_equilibrium(solver: ModalSolver, model: Model) -> dict[str, Any] | None:
    """Return the figures of a cage that hangs under gravity: its sag, and a sheet's shadow."""
    gravity = np.array(solver.gravity)
    if model.displacement is None or not gravity.any():
        return None
    down = gravity / np.linalg.norm(gravity)
    figures: dict[str, Any] = {
        "sag": float((model.displacement @ down).max()),
        "shadow_area": None,
        "cloth_area": None,
        "drape_coefficient": None,
    }
    if model.pencil.surface is None:
        return figures
    cast, area, disc = _shadow_areas(solver, model, down)
    figures |= {"shadow_area": cast, "cloth_area": area}
    if disc is None:
        return figures
    figures["drape_coefficient"] = drape_coefficient(cast, area, disc)
    return figures


def _shadow_areas(
    solver: ModalSolver, model: Model, down: Floats
) -> tuple[float, float, float | None]:
    """Return the areas of a hanging sheet's shadow, of the sheet, and of the disc below it."""
    surface = model.pencil.surface
    assert surface is not None
    assert model.displacement is not None
    flat, draped = (
        surface.to_nodes(points)[: len(surface.pairs)]
        for points in (model.points, model.points + model.displacement)
    )
    triangles = surface.quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    across = np.eye(3)[surface.normal]
    cast, area = shadow_area(draped, triangles, down), shadow_area(flat, triangles, across)
    held = parse_places(" ".join(solver.fixed or solver.values_in_use.get("fixed", ())))
    if len(held) == 1 and held[0].shape == "sphere" and abs(across @ down) > COSINE_OF_LEVEL:
        *centre, radius = held[0].numbers
        height = float((flat.mean(axis=0) - centre) @ across)
        disc = math.pi * max(radius**2 - height**2, 0.0)
        if disc < area:
            return cast, area, disc
    return cast, area, None


def report_fabric(
    scene: Scene, time: float | None = None, errors: bool | None = False
) -> dict[str, Any]:
    """Return a fabric's figures; `errors` as in `report_modes`, of the forces on its cage."""
    woven = scene.woven
    if woven is None:
        raise InputError(
            f"{scene.file}: the scene is not woven",
            cure="Use `spacemap_vtk.scenes.object_report.report_object`.",
        )
    if time is not None and not scene.moves:
        raise InputError("the scene does not move", key="time", cure="Add a section [response].")
    figures, over = report_cloth(scene), woven.cloth.drawdown
    yarns_fit = figures["thickness"] is not None
    solver, made = scene.stage("solver"), scene.stage("cage")
    if yarns_fit and over.size <= MOST_CROSSINGS and isinstance(solver, ModalSolver) and made:
        scene.update_stage(made)
        with add_section_to_errors(solver.section):
            sheet = solver.sheet_figures(made.output)
            figures |= report_sheet(sheet) | report_law(scene, sheet is not None)
            if made.output.GetNumberOfCells() <= MANY_CELLS:
                figures["motion"] = report_motion(scene)
                if solver.is_hung:
                    scene.update_stage(solver)
                    figures["reactions"] = report_reactions(solver.output)
                if solver.obstacles or solver.grips:
                    figures["contact"] = report_obstacles(solver.output)
                    figures["path"] = report_path(solver)
                if figures.get("reactions") or figures.get("contact"):
                    figures |= _add_errors(scene, figures, errors)
    for _ in add_clearance(scene, figures):
        pass
    if over.size > MOST_CROSSINGS:
        if figures["least_clearance"] is None:
            scene.warn(f"the least clearance is not computed: over {MOST_CROSSINGS} crossings")
    elif yarns_fit and time is not None:
        scene.update_stage(scene.warp, time)
        moved = points_of(scene.patches)
        figures["deformed_clearance"] = _report_clearance(
            measure_clearance(build_weave(woven.cloth), moved)
        )
    findings = collect_findings(scene, figures.get("motion"))
    figures["applicability"] = [finding.as_json() for finding in findings]
    figures["warnings"] = scene.warnings
    return figures


def report_cloth(scene: Scene) -> dict[str, Any]:
    """Return the figures of a fabric that are quick to compute, without clearance or cage."""
    yarns_fit = not isinstance(scene.find_obstacle(), GeometryError)
    textile = scene.woven
    assert textile is not None
    woven, over = textile.cloth, textile.cloth.drawdown
    figures = _NO_FIGURES | {"ends": over.shape[1], "picks": over.shape[0]}
    if yarns_fit:
        figures |= fabric_figures(woven)
        figures["fibre_volume_fraction"] = textile.fibre_share * figures["volume_fraction"]
        figures["feasible_height"] = list(woven.feasible_heights)
        counts, figures["radial_error"] = count_patches(woven)
        figures["patches"], figures["control_points"] = counts.patches, counts.points
        figures["memory_bytes"] = counts.estimate_bytes(woven.exact)
    loom = textile.source.find_loom(over)
    floats, means = drawdown.longest_floats(over), drawdown.mean_floats(over)
    densities = woven.densities or (None, None)
    for number, (family, threads) in enumerate(zip(FAMILIES, woven.threads, strict=True)):
        colors = np.unique(threads.colors, axis=0)
        figures[family] = figures.get(family, dict(_NO_YARN_FIGURES)) | {
            "yarns": over.shape[1 - number],
            **_report_yarns(threads, densities[number]),
            "longest_float": floats[number],
            "mean_float": means[number],
            "colors": ["#{:02x}{:02x}{:02x}".format(*color) for color in colors.tolist()],
        }
    figures |= {
        "drawdown": drawdown.to_rows(over),
        "repeat": list(drawdown.repeat_size(over)),
        "shafts": loom.shafts,
        "treadles": loom.treadles,
        "threading": [list(shafts) for shafts in loom.threading],
        "feasible": {name: list(ends) for name, ends in textile.feasible.items()},
    }
    return figures


def add_clearance(scene: Scene, figures: dict[str, Any]) -> Generator[None, None, None]:
    """Add the least clearance to the figures of a cloth whose yarns fit, in many short steps."""
    if figures["thickness"] is None:
        return
    assert scene.woven is not None
    woven = scene.woven.cloth
    if woven.axis == "arcs":
        figures["least_clearance"] = _report_clearance(find_contact(woven))
    elif woven.drawdown.size <= MOST_CROSSINGS:
        figures["least_clearance"] = _report_clearance((yield from measure_in_steps(woven)))


def _report_yarns(threads: Threads, density: float | None) -> dict[str, Any]:
    """Return the figures of a family's yarns, whether or not they fit."""
    height, aspect, section = np.asarray(threads.diameter), threads.aspect, threads.shape
    diameter = float(height.mean())
    tex = None
    if density is not None:
        tex = 1e6 * density * section_factor(aspect, section) * float((height**2).mean())
    spacing = threads.mean_spacing(aspect * diameter)
    return {
        "diameter": diameter,
        "width": aspect * diameter,
        "sett": 1.0 / spacing,
        "spacing": spacing,
        "section": section,
        "tex": tex,
        "size": threads.size,
    }


def _report_clearance(found: Clearance) -> dict[str, Any]:
    return {"distance": found.distance, "yarns": list(found.yarns), "place": found.place.tolist()}
