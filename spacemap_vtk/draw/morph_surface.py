"""Convert the motion or the mode shapes of a scene's surface to morph targets.

The points of a fabric depend linearly on the cage's vertices, and the points of a surface on the
fabric's. So the targets of a motion are computed on the cage, which has few vertices, and passed on
through the stages like any displacement of the cage. Crimp interchange is not linear: with it, the
targets are computed on the fabric's points. In both cases, the surface at every frame is compared
with the sum of its targets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from spacemap_vtk.datasets.arrays import add_array, array_of, points_of, shallow_copy, to_points
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.datasets.moving_surface import Clip, InitialView, MovingSurface, quantise_targets
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.actors.surface_actor import (
    CLASSES,
    Span,
    natural_span,
    own_colors,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.draw.detail.yarn_recorder import SurfaceRecorder
from spacemap_vtk.draw.frame import camera_of, relief_of
from spacemap_vtk.embedding.morph_targets import find_morph_targets
from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.io.polygons import require_writer_memory
from spacemap_vtk.io.registry import SMALLER_FILE_CURE
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import (
    AnyFloats,
    AnyInts,
    Bytes,
    Floats,
    Ints,
    MessageCallback,
    Singles,
    StepProgress,
)
from spacemap_vtk.parallel import blocks
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import DrawnCloth, sides_in_file
from spacemap_vtk.scenes.memory_estimates import frame_bytes, mesh_bytes, patch_bytes
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import CAMERAS, View

#: Default tolerance: _OF_YARN as a share of the thinnest yarn's diameter, or _OF_SIZE as a share of
#: the size of an object without yarns.
_OF_YARN, _OF_SIZE = 0.02, 2e-4
#: Least tolerance as a share of the largest coordinate, because of rounding.
_ROUNDING = 2.0**-21
#: Largest number of attempts on one stage, with smaller and smaller tolerances: the error of the
#: fabric can be larger than the error of the cage.
_TRIES = 4
#: Animation of a mode. _AMPLITUDE: largest displacement as a share of the cage's longest side.
#: _PERIOD: duration of a period in s. _STEPS: number of steps of a period.
_AMPLITUDE, _PERIOD, _STEPS = 0.1, 1.2, 24
#: Resolution with which equal points are found. _PLACES: number of steps over the object's size, up
#: to 21 bits. _DIRECTIONS: number of steps over the unit length of a normal.
_PLACES, _DIRECTIONS = 2**19, 100
#: _TOGETHER: number of frames whose normals are summed together. _PART: number of points in a block
#: of this sum.
_TOGETHER, _PART = 8, 2**14
#: Size of a file in bytes from which on the user is warned before it is made.
_LARGE = 2**26
#: Number of points from which on targets are quantised to save space.
_MANY_POINTS = 100_000
#: Advice for a smaller file: of a still surface, and below of a motion and of modes.
_COARSER = "Lower --subdivisions (surface.subdivisions), or weave.ends and weave.picks."
_SMALLER = {
    "tolerance": SMALLER_FILE_CURE,
    "modes": "Take fewer modes (modal.modes), or lower --subdivisions.",
}
#: Normal of points without a normal.
_NOWHERE = np.array([0.0, 0.0, 1.0], np.float32)


def make_moving_surface(
    scene: Scene,
    times: Sequence[float],
    tolerance: float | None,
    tell: StepProgress,
    span: Span | None = None,
    most: int = 2**32,
    numbers: bool = False,
    strands: str = "yarns",
    sides: int | None = 0,
    say: MessageCallback | None = None,
) -> MovingSurface:
    """Return a scene's surface at the first of the times, with its motion over all of them."""
    # With a single time, colours may be those of a scale with the ends `span`. With `numbers`, the
    # numbers that colours show are recorded at all times. `most` limits the size in bytes, in
    # single precision. Patches are subdivided by `sides`; 0: as much as the file's size permits;
    # None: as in a picture.
    say = say or scene.warn
    tell(0, 2 * len(times))
    lasts = scene.moves and len(times) > 1
    if lasts and not numbers:
        _use_constant_colors(scene)
    if sides is not None:
        _subdivide(scene, sides, say)
    _require_patches(scene, most)
    scene.update(times[0])
    still, rows = _make_still_surface(scene, scene.polygons, most, span, numbers)
    seen = SurfaceRecorder(scene, rows, len(times) if lasts else 1, numbers, strands)
    if not lasts:
        seen.record(0)
        return replace(still, curves=seen.curves, numbers=seen.numbers)
    usual, tolerance = tolerance is None, still.tolerance if tolerance is None else tolerance
    least = _ROUNDING * float(np.abs(still.points).max())
    if tolerance < least:
        raise _tolerance_error(tolerance, least)
    error = np.inf
    for stage in _linear_stages(scene):
        # For large surfaces, a part of the tolerance is reserved for quantisation.
        large = _is_large(still)
        places, aim = _displacements(scene, stage, times, tell), tolerance * (0.9 if large else 1.0)
        for _ in range(_TRIES):
            scene.update(times[0])
            found = find_morph_targets(places, aim)
            cut = usual and len(found.shapes) > (room := max(8, 2 * _LARGE // (12 * len(rows))))
            if cut:
                count = len(found.shapes)
                say(f"{room} of {count} targets are taken: all would be too large (--tolerance)")
                found = found._replace(shapes=found.shapes[:room], weights=found.weights[:, :room])
            targets = _surface_targets(scene, stage, found.shapes, still, rows, most, say)[0]
            weights = found.weights.astype(np.float32)
            error, normals = _compare_frames(
                scene, times, still, rows, targets, weights, seen, tell
            )
            if error <= tolerance or cut:
                tolerance = max(tolerance, 1.1 * error) if cut else tolerance
                # Playback times: a film may be slower or faster than the motion.
                seconds = (np.array(times) - times[0]) / scene.animation.speed
                clip = Clip("motion", seconds, weights, times[0], scene.animation.speed)
                short, more = None, 0.0
                if large and len(targets):
                    short, more = quantise_targets(targets, normals, weights)
                if error + more > tolerance:
                    short, more = None, 0.0
                error += more
                about = {"targets": len(targets), "tolerance": tolerance, "largest_error": error}
                return replace(
                    still,
                    targets=targets,
                    normal_targets=normals,
                    target_names=[f"shape {k}" for k in range(len(targets))],
                    clips=[clip],
                    curves=seen.curves,
                    numbers=seen.numbers,
                    quantised=short,
                    tolerance=tolerance,
                    metadata={**still.metadata, **about, "frames": len(times)},
                )
            aim *= 0.5 * tolerance / error
    raise _tolerance_error(tolerance, 2.0 * error)


def make_mode_surface(
    scene: Scene,
    tell: StepProgress,
    most: int = 2**32,
    sides: int = 0,
    say: MessageCallback | None = None,
) -> MovingSurface:
    """Return a scene's surface in equilibrium, with a target and a clip for each mode."""
    say = say or scene.warn
    _use_constant_colors(scene)
    _subdivide(scene, sides, say)
    _require_patches(scene, most)
    scene.assign("warp", "carried", "")  # modes have no velocity to interpolate
    figures = report_modes(scene)["modes"]
    tell(0, len(figures))
    stage, solver = scene.cage_stage, scene.stage("solver")
    assert solver is not None
    cage = shallow_copy(solver.output)
    data, points = cage.GetPointData(), points_of(cage)
    names = [MODE_NAME.format(number) for number in range(len(figures))]
    shapes = np.array([array_of(data, name, "a mode's shape") for name in names])
    largest = _AMPLITUDE * np.ptp(points, axis=0).max()
    shapes *= largest / np.linalg.norm(shapes, axis=2).max(axis=1)[:, None, None]
    hung = array_of(data, "equilibrium", "") if data.HasArray("equilibrium") else 0 * points
    add_array(data, "displacement", hung)
    still, rows = _make_still_surface(scene, _run_later_stages(scene, stage, cage), most)
    targets, normals = _surface_targets(scene, stage, shapes, still, rows, most, say, cage)
    frequencies = [mode["frequency_hz"] for mode in figures]
    labels = [f"mode {k} {frequency:.4g} Hz" for k, frequency in enumerate(frequencies, 1)]
    seconds = np.linspace(0.0, _PERIOD, _STEPS + 1)
    swing = np.sin(2 * np.pi * seconds / _PERIOD)
    clips = [
        Clip(label, seconds, swing[:, None] * one, speed=1.0 / (f * _PERIOD) if f > 0.0 else 1.0)
        for label, f, one in zip(labels, frequencies, np.eye(len(labels)), strict=True)
    ]
    about = {"modes": [{"frequency_hz": frequency} for frequency in frequencies]}
    tell(len(figures), len(figures))
    return replace(
        still,
        targets=targets,
        normal_targets=normals,
        target_names=labels,
        clips=clips,
        metadata={**still.metadata, **about, "seconds_of_a_swing": _PERIOD},
    )


def _is_large(still: MovingSurface) -> bool:
    return len(still.points) > _MANY_POINTS


def _tolerance_error(tolerance: float, least: float) -> InputError:
    return InputError(
        "no number of targets, in single precision, brings the surface so near to its motion",
        key="tolerance",
        value=f"{tolerance:g} m",
        allowed=f"{least:.1e} m or more",
    )


def _linear_stages(scene: Scene) -> list[Stage]:
    """Return stages on whose output the surface may depend linearly, the fastest first."""
    return [scene.warp] if scene.stage("crimp") else [scene.cage_stage, scene.warp]


def _displacements(
    scene: Scene, stage: Stage, times: Sequence[float], tell: StepProgress
) -> AnyFloats:
    """Return the displacements of a stage's points since the first time, (T, n, 3)."""
    found: AnyFloats = np.empty(0)
    for number, time in enumerate(times):
        scene.update_stage(stage, time)
        now = _moving_array(stage, stage.output)
        if not number:
            # Large motions are stored in single precision, whose rounding is far below tolerances.
            kind = np.float64 if len(times) * now.size < 2**22 else np.float32
            # The targets that are made of it need memory too.
            size = (np.dtype(kind).itemsize + 4) * len(times) * now.size
            require_memory(size, f"the motion at {len(times)} times", cure="Take fewer of them.")
            found, first = np.empty((len(times), *now.shape), kind), now.astype(np.float64)
        np.subtract(now, first, out=found[number], casting="same_kind")
        tell(number + 1, 2 * len(times))
    return found


def _moving_array(stage: Stage, data: Any) -> NDArray[Any]:
    """Return the moving quantity of a stage's output: the cage's displacement, or the points."""
    if stage.makes == "cage":
        return array_of(data.GetPointData(), "displacement", type(stage).__name__)
    return points_of(data)


def _run_later_stages(scene: Scene, stage: Stage, data: Any) -> vtkPolyData:
    """Return the surface that the later stages make if `data` replaces a stage's output."""
    made = {"object": scene.object_at_rest.output, stage.makes: data}
    for each in scene.stages[scene.stages.index(stage) + 1 :]:
        made[each.makes] = each(*(made[kind] for kind in each.takes))
    return made["object"]


def _surface_targets(
    scene: Scene,
    stage: Stage,
    shapes: Floats,
    still: MovingSurface,
    rows: AnyInts,
    most: int,
    say: MessageCallback,
    data: Any = None,
) -> tuple[Singles, Singles | None]:
    """Return displacements of surface and normals for a stage's shapes, by central differences."""
    kinds = 1 if still.normals is None else 2
    size = 12 * kinds * len(shapes) * len(still.points)
    what = f"{len(shapes)} targets of {len(still.points)} points"
    cure = _SMALLER["tolerance" if data is None else "modes"]
    _require_file_size(12 * kinds * len(still.points) + size, what, most, cure)
    if size > _LARGE:
        whole = 12 * kinds * len(still.points) + 12 * len(still.triangles) + size
        less = "with fewer --subdivisions, a larger --tolerance, or a smaller --fps less"
        say(f"{what} make up to {whole / 1e6:.0f} MB; {less}")
    # Targets of many points are also stored in quantised form: nine bytes for each 24.
    few = 3 * size // 8 if data is None and _is_large(still) else 0
    require_memory(size + few + frame_bytes(len(still.points)), what, cure=cure)
    # For a motion, `_compare_frames` computes the targets of normals from the frames.
    faces = data is not None and still.normals is not None
    data = stage.output if data is None else data
    at = _moving_array(stage, data).astype(np.float64)
    targets = np.empty((len(shapes), *still.points.shape), np.float32)
    turned = np.empty_like(targets) if faces else None
    for number, shape in enumerate(shapes):
        ends = []
        for side in (1.0, -1.0):
            moved = shallow_copy(data)
            if stage.makes == "cage":
                add_array(moved.GetPointData(), "displacement", at + side * shape)
            else:
                moved.SetPoints(to_points(at + side * shape))
            ends.append(_points_and_normals(_run_later_stages(scene, stage, moved), rows, faces))
        (there, facing), (back, away) = ends
        np.subtract(there, back, out=targets[number])
        if turned is not None and facing is not None and away is not None:
            np.subtract(facing, away, out=turned[number])
    targets *= 0.5
    if turned is not None:
        turned *= 0.5
    return targets, turned


def _compare_frames(
    scene: Scene,
    times: Sequence[float],
    still: MovingSurface,
    rows: AnyInts,
    targets: Singles,
    weights: Singles,
    seen: SurfaceRecorder,
    tell: StepProgress,
) -> tuple[float, Singles | None]:
    """Return the largest distance between sum of targets and surface, and normals' targets."""
    error, turned = 0.0, None if still.normals is None else np.zeros_like(targets)
    # Least squares fit of the normals over time; it is this simple because weights are orthogonal.
    shares = weights / np.square(weights).sum(axis=0)
    waiting = np.empty((min(_TOGETHER, len(times)), *still.points.shape), np.float32)
    for number, time in enumerate(times):
        scene.update(time)
        seen.record(number)
        points, normals = _points_and_normals(scene.polygons, rows, turned is not None)
        off = points - still.points - np.tensordot(weights[number], targets, 1)
        error = max(error, float(np.sqrt(np.einsum("nk,nk->n", off, off).max())))
        if turned is not None and normals is not None and still.normals is not None:
            last = number % len(waiting)
            np.subtract(normals, still.normals, out=waiting[last])
            if last == len(waiting) - 1 or number == len(times) - 1:
                rows_now = shares[number - last : number + 1]
                for part in blocks(len(points), _PART):  # blocks avoid a copy of all targets
                    turned[:, part] += np.tensordot(rows_now, waiting[: last + 1, part], (0, 0))
        tell(len(times) + number + 1, 2 * len(times))
    return error, turned


def _points_and_normals(
    surface: vtkPolyData, rows: AnyInts, faces: bool = True
) -> tuple[Singles, Singles | None]:
    """Return the points of a surface that are written, and their unit normals if wanted."""
    normals = surface.GetPointData().GetNormals() if faces else None
    points = points_of(surface)[rows].astype(np.float32, copy=False)
    if normals is None:
        return points, None
    facing = vtk_to_numpy(normals)[rows].astype(np.float32, copy=False)
    lengths = np.linalg.norm(facing, axis=1, keepdims=True)
    return points, np.where(lengths > 0.0, facing / np.maximum(lengths, 1e-30), _NOWHERE)


def _subdivide(scene: Scene, sides: int, say: MessageCallback) -> None:
    """Set the subdivisions of patches as given, or as in the scene if the file permits."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is not None and scene.stages[-1] is scene.surface:
        usual = scene.surface.sides
        chosen = sides or sides_in_file(cloth, usual)
        if not sides and chosen < usual:
            say(
                f"patches are subdivided by {chosen}, not by {usual} as a picture's: "
                f"{cloth.patches * usual**2 / 1e6:.1f} million points would be many to show "
                f"(--subdivisions {usual})"
            )
        scene.assign("surface", "subdivisions", chosen)


def _require_patches(scene: Scene, most: int) -> None:
    """Raise an error if a weave would not fit into memory or a file, before it is made."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is None or scene.stages[-1] is not scene.surface:
        return
    sides = scene.surface.sides
    points, quads = cloth.patches * (sides + 1) ** 2, cloth.patches * sides**2
    # Closed tubes have as many points as quadrilaterals, after coincident points are merged.
    least = int(0.9 * quads)
    _require_file_size(24 * least + 24 * quads, f"{least} points", most, _COARSER)
    require_memory(
        patch_bytes(scene, cloth.patches) + mesh_bytes(points),
        f"a surface of {points / 1e6:.3g} million points, as triangles with colours,",
        cure=_COARSER,
    )


def _use_constant_colors(scene: Scene) -> None:
    """Replace colours that change with time by the scene's own colours, with a warning."""
    color = scene.view.color
    if COLORINGS[color].shows_numbers:
        scene.warn(f'colours of "{color}" change with time, which they cannot here: own ones stay')
        scene.assign("view", "color", "own")


def _require_file_size(size: int, what: str, most: int, cure: str) -> None:
    if size > most:
        raise SizeError(
            f"{what} do not fit into a file: in single precision they take {size / 2**30:.2g} GiB",
            allowed=f"up to {most // 2**30} GiB",
            cure=cure,
        )


def _make_still_surface(
    scene: Scene, surface: vtkPolyData, most: int, span: Span | None = None, numbers: bool = False
) -> tuple[MovingSurface, AnyInts]:
    """Return a surface without its motion, and the indices of its points that are written."""
    require_writer_memory(
        surface, mesh_bytes(surface.GetNumberOfPoints()), "triangles with colours"
    )
    triangles, cells = _triangles(surface)
    points, normals = _points_and_normals(surface, np.arange(surface.GetNumberOfPoints()))
    names, parts, colors, of_points = _parts_and_colors(scene, surface)
    about: dict[str, Any] = {"scene": scene.title, "units": "m"}
    color = scene.view.color
    if not numbers and (values := color_values(surface, color)) is not None:
        low, high = span or natural_span(values)
        colors, of_points = ramp_colors(values, (low, high)), True
        shown = COLORINGS[color]
        about["colors"] = f"{shown.label}, {low:g} to {high:g} {shown.unit}"
    # Points of different materials are not merged, so that materials do not blend.
    look: AnyInts = (
        parts.astype(np.int64)[:, None] if of_points else np.column_stack([parts, colors])
    )
    if numbers and surface.GetCellData().HasArray(COLORINGS[color].array or " "):
        # Points of different cells are not merged either, so that cells' numbers do not blend.
        look = np.arange(surface.GetNumberOfCells())[:, None]
    kinds = np.unique(look, axis=0, return_inverse=True)[1].reshape(-1, 1)[cells]
    del look
    one = _first_equal_points(points, normals, colors if of_points else None)
    keys, places = np.unique(kinds * len(points) + one[triangles], return_inverse=True)
    rows, triangles = keys % len(points), places.reshape(-1, 3)
    cell = np.empty(len(rows), np.int64)
    cell[triangles] = cells[:, None]
    size = 24 * len(rows) + 12 * len(triangles)
    _require_file_size(size, f"{len(rows)} points", most, _COARSER)
    points, normals = _points_and_normals(surface, rows)
    first, second, third = points[triangles].transpose(1, 0, 2)
    if normals is not None:
        across = np.cross(second - first, third - first)
        back = np.einsum("nk,nk->n", across, normals[triangles].sum(axis=1)) < 0.0
        triangles[back] = triangles[back][:, ::-1]
    twice = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    still = MovingSurface(
        scene.title,
        points,
        np.empty((0, *points.shape), np.float32),
        normals,
        None if normals is None else np.empty((0, *points.shape), np.float32),
        triangles[~twice],
        colors[rows if of_points else cell],
        parts[cell],
        names,
        _initial_view(scene),
        _default_tolerance(scene),
        metadata=about,
    )
    return still, rows


def _initial_view(scene: Scene) -> InitialView:
    view, look, usual = scene.view, scene.view.resolved_style, View().resolved_style
    shadows = view.shadows and not COLORINGS[view.color].shows_numbers
    back = f"#{bytes(look.bottom_color).hex()}", f"#{bytes(look.top_color).hex()}"
    own = (
        back
        if (look.bottom_color, look.top_color) != (usual.bottom_color, usual.top_color)
        else None
    )
    return InitialView(CAMERAS, camera_of(scene), view.zoom, own, relief_of(scene), shadows)


def _triangles(surface: vtkPolyData) -> tuple[Ints, Ints]:
    """Cut a surface's polygons into triangles; return their points and the cell of each."""
    bare, cutter = vtkPolyData(), vtkTriangleFilter()
    bare.CopyStructure(surface)
    add_array(bare.GetCellData(), "cell", np.arange(surface.GetNumberOfCells()))
    cutter.SetInputData(bare)
    cutter.PassLinesOff()
    cutter.PassVertsOff()
    cutter.Update()
    cut = cutter.GetOutput()
    if not cut.GetNumberOfPolys():
        raise InputError("there is no polygon to write", key="what", cure="Write a .vtu.")
    corners = vtk_to_numpy(cut.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return corners.astype(np.int64), vtk_to_numpy(cut.GetCellData().GetArray("cell"))


def _parts_and_colors(
    scene: Scene, surface: vtkPolyData
) -> tuple[list[str], NDArray[Any], Bytes, bool]:
    """Return names of parts, part of each cell, colours, and whether colours belong to points."""
    cells, color = surface.GetCellData(), scene.view.color
    family = cells.GetArray("family")
    names = ["surface"] if family is None else ["warp", "weft"]
    count = surface.GetNumberOfCells()
    parts = np.zeros(count, np.int64) if family is None else vtk_to_numpy(family)
    if color in CLASSES and cells.GetArray(color) is not None:
        table = rgb_table(CLASSES[color])
        return names, parts, table[vtk_to_numpy(cells.GetArray(color)) % len(table)], False
    if scene.picture is not None:
        scene.warn("the picture that the object is painted with is not written")
    own = own_colors(surface)
    if own is None:
        plain = np.array(scene.view.object_color, np.uint8)
        return names, parts, np.broadcast_to(plain, (count, 3)), False
    of_points, name = own
    data = surface.GetPointData() if of_points else cells
    return names, parts, vtk_to_numpy(data.GetArray(name))[:, :3], of_points


def _first_equal_points(points: Singles, normals: Singles | None, colors: Bytes | None) -> Ints:
    """Return for each point the first point with the same position, normal and colour."""
    # Neighbouring patches have separate points on their common border, although the surface is
    # smooth there.
    look = np.zeros(len(points), np.int64)
    for value in () if normals is None else np.round(_DIRECTIONS * normals.T):
        look = 256 * look + _DIRECTIONS + value.astype(np.int64)
    for value in () if colors is None else colors.T:
        look = 256 * look + value
    size = float(np.ptp(points, axis=0).max()) or 1.0
    scaled = (points - points.min(axis=0)) * (_PLACES / size)
    one = np.arange(len(points))
    for shift in (0.25, 0.75):  # two grids, in case rounding puts equal points into two cells
        x, y, z = (scaled[one] + shift).astype(np.int64).T
        place = (x << 42) + (y << 21) + z
        order = np.lexsort((one, look, place))
        same = (np.diff(place[order]) == 0) & (np.diff(look[order]) == 0)
        first = np.where(np.concatenate(([False], same)), 0, np.arange(len(order)))
        one[order] = one[order[np.maximum.accumulate(first)]]
    return one


def _default_tolerance(scene: Scene) -> float:
    """Return a tolerance [m] that is too small to be seen."""
    if scene.textile is not None:
        return _OF_YARN * float(scene.textile.yarn_diameters.min())
    return _OF_SIZE * float(np.ptp(points_of(scene.polygons), axis=0).max())
