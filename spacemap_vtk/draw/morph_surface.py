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
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from spacemap_vtk.datasets.arrays import add_array, array_of, points_of, shallow_copy, to_points
from spacemap_vtk.datasets.modal_model import MODE_NAME
from spacemap_vtk.datasets.moving_surface import (
    Clip,
    FarCloth,
    InitialView,
    MovingSurface,
    quantise_targets,
)
from spacemap_vtk.draw.actors.color_values import color_values
from spacemap_vtk.draw.actors.surface_actor import (
    CLASSES,
    Span,
    natural_span,
    own_colors,
    ramp_colors,
    rgb_table,
)
from spacemap_vtk.draw.camera import Viewpoint, camera_up_axis
from spacemap_vtk.draw.detail.far_cloth import FarClothRecorder, make_shading, measure_exposures
from spacemap_vtk.draw.detail.yarn_recorder import SurfaceRecorder
from spacemap_vtk.draw.frame import camera_of, relief_of
from spacemap_vtk.draw.obstacles_in_files import add_obstacles
from spacemap_vtk.embedding.morph_targets import find_morph_targets
from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.patch_tessellator import brighten, point_brightness
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
from spacemap_vtk.scenes.cameras import CAMERAS
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.level_of_detail import FILE_POINTS, DrawnCloth, sides_in_file
from spacemap_vtk.scenes.memory_estimates import frame_bytes, mesh_bytes, patch_bytes
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import View

#: Default tolerance as a share of the thinnest yarn's diameter.
_YARN_TOLERANCE = 0.02
#: Default tolerance as a share of the size of an object without yarns.
_SIZE_TOLERANCE = 2e-4
#: Least tolerance as a share of the largest coordinate, because of rounding.
_ROUNDING = 2.0**-21
#: Largest number of attempts on one stage, with smaller and smaller tolerances: the error of the
#: fabric can be larger than the error of the cage.
_TRIES = 4
#: Largest displacement of an animated mode, as a share of the cage's longest side.
_AMPLITUDE = 0.1
#: Duration of a period of an animated mode, in s.
_PERIOD = 1.2
#: Number of steps of a period.
_STEPS = 24
#: Equal points are found with this number of steps over the object's size, up to 21 bits.
_POSITION_STEPS = 2**19
#: Equal normals are found with this number of steps over the unit length.
_NORMAL_STEPS = 100
#: Number of frames whose normals are summed together.
_FRAMES_PER_SUM = 8
#: Number of points in a block of this sum.
_POINTS_PER_BLOCK = 2**14
#: Size of a file in bytes from which on the user is warned before it is made.
_LARGE_FILE = 2**26
#: Number of points from which on targets are quantised to save space.
_MANY_POINTS = 100_000
#: Advice for a smaller file: of a still surface, and below of a motion and of modes.
_COARSER_SURFACE = "Lower --subdivisions (surface.subdivisions), or weave.ends and weave.picks."
_SMALLER_FILE = {
    "tolerance": SMALLER_FILE_CURE,
    "modes": "Use fewer modes (modal.modes), or lower --subdivisions.",
}
#: Most crossings of a cloth that is written as a sheet: its textures have 16 bytes for each.
_MOST_CROSSINGS = 4_000_000
#: Normal of points without a normal.
_DEFAULT_NORMAL = np.array([0.0, 0.0, 1.0], np.float32)


def make_moving_surface(
    scene: Scene,
    times: Sequence[float],
    tolerance: float | None,
    report_progress: StepProgress,
    span: Span | None = None,
    max_bytes: int = 2**32,
    numbers: bool = False,
    strands: str = "yarns",
    sides: int | None = 0,
    warn: MessageCallback | None = None,
    shaded: bool = False,
) -> MovingSurface:
    """Return a scene's surface at the first of the times, with its motion over all of them."""
    warn = warn or scene.warn
    if shaded and sides == 0 and _has_too_many_yarns(scene, warn):
        made = _make_sheet_surface(scene, times, tolerance, report_progress)
    else:
        options = span, max_bytes, numbers, strands, sides, warn, shaded
        made = _make_moving_surface(scene, times, tolerance, report_progress, *options)
    return add_obstacles(made, scene, warn)


def _has_too_many_yarns(scene: Scene, warn: MessageCallback) -> bool:
    """Test whether a file had better show a cloth as a sheet; then also warn."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is None or COLORINGS[scene.view.color].shows_numbers:
        return False
    if cloth.patches <= FILE_POINTS or cloth.ends * cloth.picks > _MOST_CROSSINGS:
        return False
    warn(
        f"the cloth is written as a sheet, which shows no round yarns near by, because "
        f"{cloth.patches / 1e6:.1f} million patches would be slow to show; "
        "--subdivisions 1 writes them all"
    )
    return True


def _make_sheet_surface(
    scene: Scene, times: Sequence[float], tolerance: float | None, report_progress: StepProgress
) -> MovingSurface:
    """Return a scene's cloth as a sheet without yarns: its points, but no triangles."""
    report_progress(0, len(times))
    times = times if scene.moves else times[:1]
    recorder = FarClothRecorder(scene, len(times))
    for number, time in enumerate(times):
        recorder.record_at(number, time)
        report_progress(number + 1, len(times))
    tolerance = tolerance or _default_tolerance(scene)
    found = find_morph_targets(recorder.displacements, tolerance)
    far = recorder.make(found.weights)
    count, weights = len(far.points), found.weights.astype(np.float32)
    seconds = (np.array(times) - times[0]) / scene.animation.speed
    clip = Clip("motion", seconds, weights, times[0], scene.animation.speed)
    assert scene.woven is not None
    about = {"scene": scene.title, "units": "m", "yarns": sum(scene.woven.cloth.size)}
    moved = {"targets": len(far.targets), "tolerance": tolerance, "largest_error": found.error}
    return MovingSurface(
        scene.title,
        far.points.astype(np.float32),
        far.targets.astype(np.float32),
        None,
        None,
        np.empty((0, 3), np.int64),
        np.zeros((count, 3), np.uint8),
        np.zeros(count, np.int64),
        ["cloth"],
        _initial_view(scene),
        tolerance,
        [f"shape {k}" for k in range(len(far.targets))],
        [clip] if len(times) > 1 else [],
        shading=make_shading(scene, far),
        metadata={**about, **moved, "frames": len(times)},
    )


def _make_moving_surface(
    scene: Scene,
    times: Sequence[float],
    tolerance: float | None,
    report_progress: StepProgress,
    span: Span | None,
    max_bytes: int,
    numbers: bool,
    strands: str,
    sides: int | None,
    warn: MessageCallback,
    shaded: bool,
) -> MovingSurface:
    """Return the surface of `make_moving_surface`, without obstacles."""
    # With a single time, colours may be those of a scale with the ends `span`. With `numbers`, the
    # numbers that colours show are recorded at all times. `max_bytes` limits the size, in
    # single precision. Patches are subdivided by `sides`; 0: as much as the file's size permits;
    # None: as in a picture. With `shaded`, the surface has the shading of pictures.
    report_progress(0, 2 * len(times))
    moves = scene.moves and len(times) > 1
    if moves and not numbers:
        _use_constant_colors(scene)
    if sides is not None:
        _subdivide(scene, sides, warn)
    if shaded:
        measure_exposures(scene)
    _require_patches(scene, max_bytes)
    scene.update(times[0])
    still, rows = _make_still_surface(scene, scene.polygons, max_bytes, span, numbers)
    count = len(times) if moves else 1
    recorder = SurfaceRecorder(scene, rows, count, numbers, strands, shaded)
    if not moves:
        recorder.record(0)
        return recorder.complete(still, np.empty((1, 0)))
    is_default, tolerance = tolerance is None, still.tolerance if tolerance is None else tolerance
    least = _ROUNDING * float(np.abs(still.points).max())
    if tolerance < least:
        raise _tolerance_error(tolerance, least)
    error = np.inf
    for stage in _linear_stages(scene):
        # For large surfaces, a part of the tolerance is reserved for quantisation.
        large = _is_large(still)
        target_error = tolerance * (0.9 if large else 1.0)
        displacements = _displacements(scene, stage, times, report_progress)
        for _ in range(_TRIES):
            scene.update(times[0])
            sums = find_morph_targets(displacements, target_error)
            max_targets = max(8, 2 * _LARGE_FILE // (12 * len(rows)))
            truncated = is_default and len(sums.shapes) > max_targets
            if truncated:
                warn(
                    f"{max_targets} of {len(sums.shapes)} targets are written, because the file "
                    "would be too large; set --tolerance to write all that it needs"
                )
                sums = sums._replace(
                    shapes=sums.shapes[:max_targets], weights=sums.weights[:, :max_targets]
                )
            targets = _surface_targets(scene, stage, sums.shapes, still, rows, max_bytes, warn)[0]
            weights = sums.weights.astype(np.float32)
            error, normals = _compare_frames(
                scene, times, still, rows, targets, weights, recorder, report_progress
            )
            if error <= tolerance or truncated:
                tolerance = max(tolerance, 1.1 * error) if truncated else tolerance
                # Playback times: a film may be slower or faster than the motion.
                seconds = (np.array(times) - times[0]) / scene.animation.speed
                clip = Clip("motion", seconds, weights, times[0], scene.animation.speed)
                quantized, quantization_error = None, 0.0
                if large and len(targets):
                    quantized, quantization_error = quantise_targets(targets, normals, weights)
                if error + quantization_error > tolerance:
                    quantized, quantization_error = None, 0.0
                error += quantization_error
                about = {"targets": len(targets), "tolerance": tolerance, "largest_error": error}
                moving = replace(
                    still,
                    targets=targets,
                    normal_targets=normals,
                    target_names=[f"shape {k}" for k in range(len(targets))],
                    clips=[clip],
                    quantised=quantized,
                    tolerance=tolerance,
                    metadata={**still.metadata, **about, "frames": len(times)},
                )
                return recorder.complete(moving, weights)
            target_error *= 0.5 * tolerance / error
    raise _tolerance_error(tolerance, 2.0 * error)


def make_mode_surface(
    scene: Scene,
    report_progress: StepProgress,
    max_bytes: int = 2**32,
    sides: int = 0,
    warn: MessageCallback | None = None,
    shaded: bool = False,
) -> MovingSurface:
    """Return a scene's surface in equilibrium, with a target and a clip for each mode."""
    warn = warn or scene.warn
    _use_constant_colors(scene)
    _subdivide(scene, sides, warn)
    if shaded:
        measure_exposures(scene)
    _require_patches(scene, max_bytes)
    scene.assign("warp", "carried", "")  # modes have no velocity to interpolate
    figures = report_modes(scene)["modes"]
    report_progress(0, len(figures))
    stage, solver = scene.cage_stage, scene.stage("solver")
    assert solver is not None
    cage = shallow_copy(solver.output)
    data, points = cage.GetPointData(), points_of(cage)
    names = [MODE_NAME.format(number) for number in range(len(figures))]
    shapes = np.array([array_of(data, name, "a mode's shape") for name in names])
    largest = _AMPLITUDE * np.ptp(points, axis=0).max()
    shapes *= largest / np.linalg.norm(shapes, axis=2).max(axis=1)[:, None, None]
    equilibrium = array_of(data, "equilibrium", "") if data.HasArray("equilibrium") else 0 * points
    add_array(data, "displacement", equilibrium)
    surface = _run_later_stages(scene, stage, cage)
    still, rows = _make_still_surface(scene, surface, max_bytes)
    if shaded:
        far = None if scene.woven is None else _record_modes(scene, cage, shapes, still)
        still = replace(still, shading=make_shading(scene, far, surface, rows))
    targets, normals = _surface_targets(scene, stage, shapes, still, rows, max_bytes, warn, cage)
    frequencies = [mode["frequency_hz"] for mode in figures]
    labels = [f"mode {k} {frequency:.4g} Hz" for k, frequency in enumerate(frequencies, 1)]
    seconds = np.linspace(0.0, _PERIOD, _STEPS + 1)
    swing = np.sin(2 * np.pi * seconds / _PERIOD)
    clips = [
        Clip(label, seconds, swing[:, None] * unit, speed=1.0 / (f * _PERIOD) if f > 0.0 else 1.0)
        for label, f, unit in zip(labels, frequencies, np.eye(len(labels)), strict=True)
    ]
    about = {"modes": [{"frequency_hz": frequency} for frequency in frequencies]}
    report_progress(len(figures), len(figures))
    made = replace(
        still,
        targets=targets,
        normal_targets=normals,
        target_names=labels,
        clips=clips,
        metadata={**still.metadata, **about, "seconds_of_a_swing": _PERIOD},
    )
    return add_obstacles(made, scene, warn)


def _record_modes(
    scene: Scene, cage: vtkUnstructuredGrid, shapes: Floats, still: MovingSurface
) -> FarCloth:
    """Return the cloth of a scene as a sheet, with a target for each displacement of the cage."""
    recorder = FarClothRecorder(scene, 1 + 2 * len(shapes))
    recorder.record(0, cage)
    center = array_of(cage.GetPointData(), "displacement", "")
    for number, shape in enumerate(shape for each in shapes for shape in (each, -each)):
        moved = shallow_copy(cage)
        add_array(moved.GetPointData(), "displacement", center + shape)
        recorder.record(1 + number, moved)
    weights = np.zeros((1 + 2 * len(shapes), len(shapes)))
    weights[1::2], weights[2::2] = np.eye(len(shapes)), -np.eye(len(shapes))
    return recorder.make(weights, still)


def _is_large(still: MovingSurface) -> bool:
    return len(still.points) > _MANY_POINTS


def _tolerance_error(tolerance: float, least: float) -> InputError:
    return InputError(
        "the tolerance is too small for the single precision of the file",
        key="tolerance",
        value=f"{tolerance:g} m",
        allowed=f"{least:.1e} m or more",
    )


def _linear_stages(scene: Scene) -> list[Stage]:
    """Return stages on whose output the surface may depend linearly, the fastest first."""
    return [scene.warp] if scene.stage("crimp") else [scene.cage_stage, scene.warp]


def _displacements(
    scene: Scene, stage: Stage, times: Sequence[float], report_progress: StepProgress
) -> AnyFloats:
    """Return the displacements of a stage's points since the first time, (T, n, 3)."""
    displacements: AnyFloats = np.empty(0)
    for number, time in enumerate(times):
        scene.update_stage(stage, time)
        values = _moving_array(stage, stage.output)
        if not number:
            # Large motions are stored in single precision, whose rounding is far below tolerances.
            kind = np.float64 if len(times) * values.size < 2**22 else np.float32
            # The targets that are made of it need memory too.
            size = (np.dtype(kind).itemsize + 4) * len(times) * values.size
            require_memory(size, f"the motion at {len(times)} times", cure="Use fewer times.")
            displacements, first = (
                np.empty((len(times), *values.shape), kind),
                values.astype(np.float64),
            )
        np.subtract(values, first, out=displacements[number], casting="same_kind")
        report_progress(number + 1, 2 * len(times))
    return displacements


def _moving_array(stage: Stage, data: Any) -> NDArray[Any]:
    """Return the moving quantity of a stage's output: the cage's displacement, or the points."""
    if stage.makes == "cage":
        return array_of(data.GetPointData(), "displacement", type(stage).__name__)
    return points_of(data)


def _run_later_stages(scene: Scene, stage: Stage, data: Any) -> vtkPolyData:
    """Return the surface that the later stages make if `data` replaces a stage's output."""
    results = {"object": scene.object_at_rest.output, stage.makes: data}
    for each in scene.stages[scene.stages.index(stage) + 1 :]:
        results[each.makes] = each(*(results[kind] for kind in each.takes))
    return results["object"]


def _surface_targets(
    scene: Scene,
    stage: Stage,
    shapes: Floats,
    still: MovingSurface,
    rows: AnyInts,
    max_bytes: int,
    warn: MessageCallback,
    data: Any = None,
) -> tuple[Singles, Singles | None]:
    """Return displacements of surface and normals for a stage's shapes, by central differences."""
    kinds = 1 if still.normals is None else 2
    size = 12 * kinds * len(shapes) * len(still.points)
    what = f"{len(shapes)} targets of {len(still.points)} points"
    cure = _SMALLER_FILE["tolerance" if data is None else "modes"]
    _require_file_size(12 * kinds * len(still.points) + size, what, max_bytes, cure)
    if size > _LARGE_FILE:
        file_size = 12 * kinds * len(still.points) + 12 * len(still.triangles) + size
        warn(
            f"{what} need up to {file_size / 1e6:.0f} MB; for a smaller file use fewer "
            "--subdivisions, a larger --tolerance or a smaller --fps"
        )
    # Targets of many points are also stored in quantised form: nine bytes for each 24.
    quantized_size = 3 * size // 8 if data is None and _is_large(still) else 0
    require_memory(size + quantized_size + frame_bytes(len(still.points)), what, cure=cure)
    # For a motion, `_compare_frames` computes the targets of normals from the frames.
    with_normals = data is not None and still.normals is not None
    data = stage.output if data is None else data
    center = _moving_array(stage, data).astype(np.float64)
    targets = np.empty((len(shapes), *still.points.shape), np.float32)
    normal_targets = np.empty_like(targets) if with_normals else None
    for number, shape in enumerate(shapes):
        ends = []
        for side in (1.0, -1.0):
            moved = shallow_copy(data)
            if stage.makes == "cage":
                add_array(moved.GetPointData(), "displacement", center + side * shape)
            else:
                moved.SetPoints(to_points(center + side * shape))
            ends.append(
                _points_and_normals(_run_later_stages(scene, stage, moved), rows, with_normals)
            )
        (forward, normals_forward), (back, normals_back) = ends
        np.subtract(forward, back, out=targets[number])
        if normal_targets is not None and normals_forward is not None and normals_back is not None:
            np.subtract(normals_forward, normals_back, out=normal_targets[number])
    targets *= 0.5
    if normal_targets is not None:
        normal_targets *= 0.5
    return targets, normal_targets


def _compare_frames(
    scene: Scene,
    times: Sequence[float],
    still: MovingSurface,
    rows: AnyInts,
    targets: Singles,
    weights: Singles,
    recorder: SurfaceRecorder,
    report_progress: StepProgress,
) -> tuple[float, Singles | None]:
    """Return the largest distance between sum of targets and surface, and normals' targets."""
    error, normal_targets = 0.0, None if still.normals is None else np.zeros_like(targets)
    # Least squares fit of the normals over time; it is this simple because weights are orthogonal.
    fit = weights / np.square(weights).sum(axis=0)
    normal_changes = np.empty((min(_FRAMES_PER_SUM, len(times)), *still.points.shape), np.float32)
    for number, time in enumerate(times):
        scene.update(time)
        recorder.record(number)
        points, normals = _points_and_normals(scene.polygons, rows, normal_targets is not None)
        off = points - still.points - np.tensordot(weights[number], targets, 1)
        error = max(error, float(np.sqrt(np.einsum("nk,nk->n", off, off).max())))
        if normal_targets is not None and normals is not None and still.normals is not None:
            last = number % len(normal_changes)
            np.subtract(normals, still.normals, out=normal_changes[last])
            if last == len(normal_changes) - 1 or number == len(times) - 1:
                rows_now = fit[number - last : number + 1]
                for part in blocks(
                    len(points), _POINTS_PER_BLOCK
                ):  # blocks avoid a copy of all targets
                    normal_targets[:, part] += np.tensordot(
                        rows_now, normal_changes[: last + 1, part], (0, 0)
                    )
        report_progress(len(times) + number + 1, 2 * len(times))
    return error, normal_targets


def _points_and_normals(
    surface: vtkPolyData, rows: AnyInts, with_normals: bool = True
) -> tuple[Singles, Singles | None]:
    """Return the points of a surface that are written, and their unit normals if wanted."""
    normals = surface.GetPointData().GetNormals() if with_normals else None
    points = points_of(surface)[rows].astype(np.float32, copy=False)
    if normals is None:
        return points, None
    chosen = vtk_to_numpy(normals)[rows].astype(np.float32, copy=False)
    lengths = np.linalg.norm(chosen, axis=1, keepdims=True)
    return points, np.where(lengths > 0.0, chosen / np.maximum(lengths, 1e-30), _DEFAULT_NORMAL)


def _subdivide(scene: Scene, sides: int, warn: MessageCallback) -> None:
    """Set the subdivisions of patches as given, or as in the scene if the file permits."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is not None and scene.stages[-1] is scene.surface:
        usual = scene.surface.sides
        chosen = sides or sides_in_file(cloth, usual)
        if not sides and chosen < usual:
            warn(
                f"patches are subdivided by {chosen}, not by {usual} as in pictures, because "
                f"{cloth.patches * usual**2 / 1e6:.1f} million points would be slow to show; "
                f"--subdivisions {usual} writes them all"
            )
        scene.assign("surface", "subdivisions", chosen)


def _require_patches(scene: Scene, max_bytes: int) -> None:
    """Raise an error if a weave would not fit into memory or a file, before it is made."""
    cloth = DrawnCloth.from_scene(scene)
    if cloth is None or scene.stages[-1] is not scene.surface:
        return
    sides = scene.surface.sides
    points, quads = cloth.patches * (sides + 1) ** 2, cloth.patches * sides**2
    # Closed tubes have as many points as quadrilaterals, after coincident points are merged.
    least = int(0.9 * quads)
    _require_file_size(24 * least + 24 * quads, f"{least} points", max_bytes, _COARSER_SURFACE)
    require_memory(
        patch_bytes(scene, cloth.patches) + mesh_bytes(points),
        f"a surface of {points / 1e6:.3g} million points, as triangles with colours,",
        cure=_COARSER_SURFACE,
    )


def _use_constant_colors(scene: Scene) -> None:
    """Replace colours that change with time by the scene's own colours, with a warning."""
    color = scene.view.color
    if COLORINGS[color].shows_numbers:
        scene.warn(
            f'colours of "{color}" change with time, which this file cannot store: '
            "the fabric's own colours are written"
        )
        scene.assign("view", "color", "own")


def _require_file_size(size: int, what: str, max_bytes: int, cure: str) -> None:
    if size > max_bytes:
        raise SizeError(
            f"{what} need {size / 2**30:.2g} GiB in single precision, too much for one file",
            allowed=f"up to {max_bytes // 2**30} GiB",
            cure=cure,
        )


def _make_still_surface(
    scene: Scene,
    surface: vtkPolyData,
    max_bytes: int,
    span: Span | None = None,
    numbers: bool = False,
) -> tuple[MovingSurface, AnyInts]:
    """Return a surface without its motion, and the indices of its points that are written."""
    require_writer_memory(
        surface, mesh_bytes(surface.GetNumberOfPoints()), "triangles with colours"
    )
    triangles, cells = _triangles(surface)
    points, normals = _points_and_normals(surface, np.arange(surface.GetNumberOfPoints()))
    names, parts, colors, of_points = _parts_and_colors(scene, surface)
    if (bright := point_brightness(surface)) is not None:
        # Points belong to one patch each, so that the brightness varies smoothly along a yarn.
        corners = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 4)
        of_point = np.zeros((len(points), 3), np.uint8)
        of_point[corners] = colors[:, None]
        colors, of_points = brighten(of_point, bright[:, None]), True
    about: dict[str, Any] = {"scene": scene.title, "units": "m"}
    color = scene.view.color
    if not numbers and (values := color_values(surface, color)) is not None:
        low, high = span or natural_span(values)
        colors, of_points = ramp_colors(values, (low, high)), True
        shown = COLORINGS[color]
        about["colors"] = f"{shown.label}, {low:g} to {high:g} {shown.unit}"
    # Points of different materials are not merged, so that materials do not blend.
    material: AnyInts = (
        parts.astype(np.int64)[:, None] if of_points else np.column_stack([parts, colors])
    )
    if numbers and surface.GetCellData().HasArray(COLORINGS[color].array or " "):
        # Points of different cells are not merged either, so that cells' numbers do not blend.
        material = np.arange(surface.GetNumberOfCells())[:, None]
    materials = np.unique(material, axis=0, return_inverse=True)[1].reshape(-1, 1)[cells]
    del material
    first_equal = _first_equal_points(points, normals, colors if of_points else None)
    keys, places = np.unique(materials * len(points) + first_equal[triangles], return_inverse=True)
    rows, triangles = keys % len(points), places.reshape(-1, 3)
    cell = np.empty(len(rows), np.int64)
    cell[triangles] = cells[:, None]
    size = 24 * len(rows) + 12 * len(triangles)
    _require_file_size(size, f"{len(rows)} points", max_bytes, _COARSER_SURFACE)
    points, normals = _points_and_normals(surface, rows)
    first, second, third = points[triangles].transpose(1, 0, 2)
    if normals is not None:
        across = np.cross(second - first, third - first)
        reversed_ = np.einsum("nk,nk->n", across, normals[triangles].sum(axis=1)) < 0.0
        triangles[reversed_] = triangles[reversed_][:, ::-1]
    degenerate = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    still = MovingSurface(
        scene.title,
        points,
        np.empty((0, *points.shape), np.float32),
        normals,
        None if normals is None else np.empty((0, *points.shape), np.float32),
        triangles[~degenerate],
        colors[rows if of_points else cell],
        parts[cell],
        names,
        _initial_view(scene),
        _default_tolerance(scene),
        metadata=about,
    )
    return still, rows


def _initial_view(scene: Scene) -> InitialView:
    view, style, default = scene.view, scene.view.resolved_style, View().resolved_style
    shadows = view.shadows and not COLORINGS[view.color].shows_numbers
    colors = f"#{bytes(style.bottom_color).hex()}", f"#{bytes(style.top_color).hex()}"
    background = (
        colors
        if (style.bottom_color, style.top_color) != (default.bottom_color, default.top_color)
        else None
    )
    aim, cameras, name = camera_of(scene), CAMERAS, str(view.camera)
    if not isinstance(aim, Viewpoint):
        name = aim
    else:
        # The page aims at the whole surface, in the saved camera's direction.
        axis = np.eye(3)[camera_up_axis(aim)]
        back = np.subtract(aim.position, aim.focus)
        cameras = {**CAMERAS, name: (tuple(back.tolist()), tuple(axis.tolist()))}
    return InitialView(cameras, name, view.zoom, background, relief_of(scene), shadows)


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
        raise InputError("the object has no polygons", key="what", cure="Export it to a .vtu file.")
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
        scene.warn("the object's texture image is not written")
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
    appearance = np.zeros(len(points), np.int64)
    for value in () if normals is None else np.round(_NORMAL_STEPS * normals.T):
        appearance = 256 * appearance + _NORMAL_STEPS + value.astype(np.int64)
    for value in () if colors is None else colors.T:
        appearance = 256 * appearance + value
    size = float(np.ptp(points, axis=0).max()) or 1.0
    scaled = (points - points.min(axis=0)) * (_POSITION_STEPS / size)
    first_equal = np.arange(len(points))
    for shift in (0.25, 0.75):  # two grids, in case rounding puts equal points into two cells
        x, y, z = (scaled[first_equal] + shift).astype(np.int64).T
        place = (x << 42) + (y << 21) + z
        order = np.lexsort((first_equal, appearance, place))
        same = (np.diff(place[order]) == 0) & (np.diff(appearance[order]) == 0)
        first = np.where(np.concatenate(([False], same)), 0, np.arange(len(order)))
        first_equal[order] = first_equal[order[np.maximum.accumulate(first)]]
    return first_equal


def _default_tolerance(scene: Scene) -> float:
    """Return a tolerance [m] that is too small to be seen."""
    if scene.textile is not None:
        return _YARN_TOLERANCE * float(scene.textile.yarn_diameters.min())
    return _SIZE_TOLERANCE * float(np.ptp(points_of(scene.polygons), axis=0).max())
