"""Trace rays through a cloth, fibre by fibre, with Mitsuba 3 and its model of hair.

Fibres are B-spline curves. Light passes through them and is scattered from one to the next. The
gloss of floats and the dark crossings follow from this without further parameters.
"""

from __future__ import annotations

import math
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.datasets.modal_model import bodies_of
from spacemap_vtk.datasets.moving_surface import to_linear_light
from spacemap_vtk.draw.camera import Viewpoint, aim_camera, pixels_per_metre, project_points
from spacemap_vtk.draw.compose import gradient_background
from spacemap_vtk.draw.depth_of_field import distance_in_focus
from spacemap_vtk.draw.detail.yarn_recorder import YarnRecorder
from spacemap_vtk.draw.frame import camera_of
from spacemap_vtk.draw.picture import Image, motion_extent
from spacemap_vtk.errors import InputError, MissingLibraryError
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import AnyFloats, Bools, Floats, StepProgress
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import View
from spacemap_vtk.scenes.styles import LIGHTS, STYLES
from spacemap_vtk.temporary_files import temporary_folder
from spacemap_vtk.textile.geometry.strand_curves import StrandCurves, fibre_count

#: Parameters of a view that ray tracing ignores.
_IGNORED = [
    "color",
    "style",
    "clip_normal",
    "ghost",
    "loads",
    "ground",
    "scale_bar",
    "triad",
    "time_stamp",
    "transparent",
    "irregularity",
    "irregularity_seed",
    "insets",
]
#: Number of passes of ray tracing; progress is reported after each.
_PASSES = 8
#: Longitudinal roughness of fibres.
_ALONG = 0.45
#: Azimuthal roughness of fibres.
_AROUND = 0.6
#: Largest number of scatterings of a ray.
_BOUNCES = 14
#: Number of tones of fibres of one colour.
_TONES = 3
#: Relative difference in brightness from one tone to the next.
_TONE_STEP = 0.10
#: Strength of lamps relative to those that light surfaces: fibres absorb more light.
_EXPOSURE = 1.7
#: Exponent that saturates a fibre's colour relative to its yarn's, because white reflections of
#: fibres make the colour paler.
_SATURATION = 1.3
#: Margin around the picture that is traced too, as a share of the picture: it casts shadows into
#: the picture.
_MARGIN = 0.15
#: Bytes that Mitsuba itself takes.
_MITSUBA = 120_000_000
#: Bytes of each control point, with its part of the acceleration structure (170 measured).
_POINT = 190
#: Bytes of each pixel.
_PIXEL = 400
#: Least width of a fibre in pixels. Yarns with thinner fibres get fewer and thicker ones, because
#: thinner ones appear as noise.
_LEAST_WIDTH = 0.7

#: Installation of system libraries that Mitsuba's wheel needs but does not contain.
_PACKAGES = {
    "libatomic.so.1": 'On Debian or Ubuntu: "apt-get install libatomic1"; '
    'on Fedora: "dnf install libatomic"'
}


def require_mitsuba() -> None:
    """Raise MissingLibraryError if Mitsuba, or a system library that it needs, is missing."""
    if find_spec("mitsuba") is None:
        raise MissingLibraryError(
            "--raytrace needs the package mitsuba",
            cure="Run: pip install 'spacemap_vtk[raytrace]', or omit --raytrace.",
        )
    try:
        import_module("mitsuba")
    except Exception as error:
        # Mitsuba's modules turn the original error into a NameError, so the first one is reported.
        first: BaseException = error
        while first.__context__ is not None:
            first = first.__context__
        package = _PACKAGES.get(str(first).partition(":")[0])
        raise MissingLibraryError(
            f"--raytrace: mitsuba cannot be loaded: {first}",
            cure=f"{package}, or omit --raytrace." if package else "Omit --raytrace.",
        ) from None


def raytrace(
    scene: Scene, time: float, size: tuple[int, int], samples: int, report_progress: StepProgress
) -> Image:
    """Return a picture of a scene's cloth at a time, traced with `samples` rays per pixel."""
    require_mitsuba()
    if scene.woven is None:
        raise InputError("ray tracing needs a woven fabric", key="raytrace")
    requested, default = scene.view.settings, View().settings
    if ignored := [f"view.{key}" for key in _IGNORED if requested[key] != default[key]]:
        scene.warn(f"ray tracing ignores {', '.join(ignored)}")
    report_progress(0, _PASSES + 1)
    scene.update(time)
    if scene.view.obstacles and scene.moves and bodies_of(scene.deformed_cage):
        scene.warn("ray tracing leaves out obstacles")
    camera, aspect = vtkCamera(), size[0] / size[1]
    aim_camera(camera, motion_extent(scene, [time])[0], aspect, camera_of(scene), scene.view.zoom)
    curves, colors = _visible_fibres(scene, camera, size)
    require_memory(
        _MITSUBA + _POINT * len(curves.points) + _PIXEL * size[0] * size[1],
        f"ray tracing {len(curves.counts)} fibres",
        cure="Increase view.zoom, or draw a smaller picture.",
    )
    report_progress(1, _PASSES + 1)
    light = _trace(curves, colors, camera, size, samples, scene.view, report_progress)
    background = gradient_background(
        size, scene.view.resolved_style.bottom_color, scene.view.resolved_style.top_color
    )
    return _compose_light(light, np.asarray(background))


def _visible_fibres(
    scene: Scene, camera: vtkCamera, size: tuple[int, int]
) -> tuple[StrandCurves, Floats]:
    """Return the fibres in sight, and the colour of each in linear light."""
    assert scene.woven is not None
    cloth = scene.woven.cloth

    def is_visible(places: NDArray[Any]) -> Bools:
        clip = project_points(camera, places, size[0] / size[1])
        edge = (1.0 + 2.0 * _MARGIN) * clip[:, 3]
        return np.asarray((np.abs(clip[:, 0]) < edge) & (np.abs(clip[:, 1]) < edge))

    scale = pixels_per_metre(camera, points_of(scene.patches).astype(np.float64), size[1])
    diameter_pixels = scale * float(cloth.strands[2].mean())
    fibres = min(fibre_count(cloth), max(20, round(0.75 * (diameter_pixels / _LEAST_WIDTH) ** 2)))
    recorder = YarnRecorder(scene, 1)
    curves = recorder.strands(fibres, is_visible)
    if not len(curves.counts):
        raise InputError("no part of the cloth is visible", key="zoom", value=scene.view.zoom)
    return curves, to_linear_light(recorder.colors)[curves.yarn]


def _trace(
    curves: StrandCurves,
    colors: Floats,
    camera: vtkCamera,
    size: tuple[int, int],
    samples: int,
    view: View,
    report_progress: StepProgress,
) -> Floats:
    """Return linear light and coverage of each pixel, (height, width, 4)."""
    import mitsuba as mi

    # LLVM 14 crashes the process when it compiles hair for AVX-512. This variant needs no compiler.
    mi.set_variant("scalar_rgb")
    # The unit is a millimetre: the offset of new rays from a surface does not scale with the scene,
    # and would be too large in metres.
    scale = 1e3
    with temporary_folder() as folder:
        shapes = _shapes(curves, colors, scale, folder)
        world = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": _BOUNCES, "hide_emitters": True},
                "sensor": _sensor(mi, camera, size, scale, view, curves.points),
                **_lights(mi, camera, scale, view.light),
                **shapes,
            }
        )
    total: Floats = np.zeros((size[1], size[0], 4))
    passes = min(_PASSES, samples)
    for number in range(passes):
        spp = samples * (number + 1) // passes - samples * number // passes
        total += spp * np.array(mi.render(world, spp=spp, seed=mi.UInt32(number)))[..., :4]
        report_progress(2 + number * _PASSES // passes, _PASSES + 1)
    report_progress(_PASSES + 1, _PASSES + 1)
    return total / samples


def _shapes(curves: StrandCurves, colors: Floats, scale: float, folder: Path) -> dict[str, Any]:
    """Return one Mitsuba shape for each colour and tone of fibres."""
    tones = np.arange(len(colors)) % _TONES - (_TONES - 1) / 2
    full = (colors * (1.0 + _TONE_STEP * tones[:, None])) ** _SATURATION
    shown = np.round(np.clip(full, 0.004, 0.92), 3)
    materials, material = np.unique(shown, axis=0, return_inverse=True)
    starts = np.cumsum(curves.counts) - curves.counts
    shapes = {}
    for number, color in enumerate(materials):
        which, file = np.flatnonzero(material.reshape(-1) == number), folder / f"{number}.txt"
        with open(file, "w", encoding="ascii") as out:
            for curve in which:
                own = curves.points[starts[curve] : starts[curve] + curves.counts[curve]] * scale
                row = np.column_stack([own, np.full(len(own), curves.radii[curve] * scale)])
                np.savetxt(out, row, "%.6g")
                out.write("\n")
        shapes[f"fibres_{number}"] = {
            "type": "bsplinecurve",
            "filename": str(file),
            "bsdf": {
                "type": "hair",
                "longitudinal_roughness": _ALONG,
                "azimuthal_roughness": _AROUND,
                "scale_tilt": 0.0,
                "sigma_a": {"type": "rgb", "value": _absorption(color).tolist()},
            },
        }
    return shapes


def _absorption(color: Floats) -> Floats:
    """Return the absorption of a fibre with which a mass of fibres has the given colour."""
    # Source: M. J.-Y. Chiang et al., "A Practical and Controllable Hair and Fur Model for
    # Production Path Tracing", Computer Graphics Forum 35 (2016), equation 9, for the colour after
    # multiple scattering.
    b = _AROUND
    fit = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    return np.asarray((np.log(color) / fit) ** 2)


def _sensor(
    mi: Any,
    camera: vtkCamera,
    size: tuple[int, int],
    scale: float,
    view: View,
    points: AnyFloats,
) -> dict[str, Any]:
    position, focus = (scale * np.array(p) for p in (camera.GetPosition(), camera.GetFocalPoint()))
    transform = mi.ScalarTransform4f().look_at(
        position.tolist(), focus.tolist(), list(camera.GetViewUp())
    )
    film = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "pixel_format": "rgba",
        "rfilter": {"type": "gaussian"},
    }
    distance = float(np.linalg.norm(position - focus))
    if camera.GetParallelProjection():
        half = scale * camera.GetParallelScale() * size[0] / size[1]
        transform = transform @ mi.ScalarTransform4f().scale([half, half, 1.0])
        return {
            "type": "orthographic",
            "to_world": transform,
            "film": film,
            "far_clip": 10 * distance,
        }
    lens: dict[str, Any] = {"type": "perspective"}
    if view.aperture:
        sharp = scale * distance_in_focus(Viewpoint.from_camera(camera), view, points)
        lens = {
            "type": "thinlens",
            "aperture_radius": 0.5 * view.aperture * sharp,
            "focus_distance": sharp,
        }
    return {
        **lens,
        "to_world": transform,
        "fov": camera.GetViewAngle(),
        "fov_axis": "y",
        "near_clip": 1e-3 * distance,
        "far_clip": 10 * distance,
        "film": film,
    }


def _lights(mi: Any, camera: vtkCamera, scale: float, light: str | None) -> dict[str, Any]:
    """Return the lamps of a light, by default of the studio style, as area lights, and its sky."""
    focus, position = np.array(camera.GetFocalPoint()), np.array(camera.GetPosition())
    back = position - focus
    distance = float(np.linalg.norm(back))
    back /= distance
    up = np.array(camera.GetViewUp()) - np.dot(camera.GetViewUp(), back) * back
    up /= np.linalg.norm(up)
    right = np.cross(up, back)
    style = STYLES["studio"] if light is None else LIGHTS[light].apply_to(STYLES["studio"])
    sky = {
        "type": "constant",
        "radiance": {"type": "rgb", "value": [_EXPOSURE * 0.5 * c for c in style.sky]},
    }
    lights: dict[str, Any] = {"sky": sky}
    for number, lamp in enumerate(style.lamps):
        towards = np.array(lamp.place) / np.linalg.norm(lamp.place)
        lamp_position = scale * (focus + 2.0 * distance * (towards @ np.array([right, up, back])))
        half = scale * 2.0 * distance * 0.3
        # Strength is given as for light from the whole sky; it is converted to the lamp's size.
        value = [_EXPOSURE * lamp.strength * c * math.pi / (4 * 0.3**2) for c in lamp.color]
        transform = mi.ScalarTransform4f().look_at(
            lamp_position.tolist(), (scale * focus).tolist(), up.tolist()
        )
        lights[f"lamp_{number}"] = {
            "type": "rectangle",
            "to_world": transform @ mi.ScalarTransform4f().scale([half, half, 1.0]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": value}},
        }
    return lights


def _compose_light(light: Floats, background: NDArray[Any]) -> Image:
    """Compose linear light over a background; a square root as gamma, as in the styles."""
    cover = np.clip(light[..., 3:], 0.0, 1.0)
    own = np.sqrt(np.clip(light[..., :3], 0.0, 1.0) / np.maximum(cover, 1e-6))
    shown = np.clip(own, 0.0, 1.0) * cover + background / 255.0 * (1.0 - cover)
    return np.asarray(np.round(255.0 * shown), dtype=np.uint8)
