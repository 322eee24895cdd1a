"""Data model of an animated surface with morph targets, as animation files (glTF, USD) store it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import AnyInts, Bools, Floats
from spacemap_vtk.parallel import blocks

#: Largest number of materials. With more colours than this, each point stores its colour.
_MAX_MATERIALS = 32
#: Number of points that are processed in one block.
_BLOCK = 2**14


class SurfaceMaterial(NamedTuple):
    """A material and the points that have it."""

    name: str
    #: Red, green and blue in linear light, 0 to 1; white if each point stores its colour.
    color: tuple[float, ...]
    points: Bools


@dataclass(frozen=True)
class Clip:
    """The weights of the targets over time, interpolated linearly."""

    name: str
    #: Playback times [s], ascending from 0, (T,).
    times: NDArray[np.floating]
    #: Weight of each of K targets at each time, (T, K).
    weights: NDArray[np.floating]
    #: Time of the motion at the first playback time [s].
    start: float = 0.0
    #: Seconds of motion in one second of playback.
    speed: float = 1.0


class ScaledNumbers(NamedTuple):
    """Numbers that are shown as colours, in the unit of their scale."""

    #: Title of the scale; it may have several lines.
    title: str
    span: tuple[float, float]
    #: Colours of the scale as ``"#rrggbb"``, at equal intervals from the lowest number to the
    #: highest.
    ramp: Sequence[str]
    #: Number at each point, (N,).
    values: NDArray[np.floating]
    #: Number that each of L changes adds to each point at full weight, (L, N).
    changes: NDArray[np.floating]
    #: Weights of the changes at the times of the first clip, (T, L).
    weights: NDArray[np.floating]


class InitialView(NamedTuple):
    """The initial view of an animated surface."""

    #: For each camera name, the direction from the centre to the camera and the up direction.
    cameras: Mapping[str, Sequence[Sequence[float]]]
    #: Name of the initial camera.
    camera: str
    #: Zoom factor of the initial camera.
    zoom: float
    #: Background colours as ``"#rrggbb"``, at the bottom and at the top; None for the default ones.
    background: tuple[str, str] | None
    #: Depth of the surface's folds [m].
    relief: float
    #: Whether folds are darkened.
    shadows: bool


class YarnCurves(NamedTuple):
    """Yarn axes as cubic Bézier curves, or plies or fibres as B-splines, one after another."""

    #: Control points [m] at each time of the first clip, (T, R, 3).
    points: NDArray[np.floating]
    #: Number of control points of each curve: three for each segment, plus one.
    counts: AnyInts
    #: For each curve, the diameter of a round yarn with the same area of section [m].
    widths: NDArray[np.floating]
    #: Colour of each curve.
    colors: NDArray[np.uint8]
    #: Basis of the curves in USD's terms: ``"bezier"`` or ``"bspline"``.
    basis: str = "bezier"


class FarCloth(NamedTuple):
    """A woven cloth as a sheet, to be drawn where its yarns are too thin to be seen."""

    #: Number of the surface's triangles, from the first one, that belong to yarns.
    triangles: int
    #: Texture coordinates of its columns, from 0 to 1, (C,), and of its rows, (R,).
    columns: NDArray[np.floating]
    rows: NDArray[np.floating]
    #: Positions [m], row by row, (R C, 3).
    points: NDArray[np.floating]
    #: Displacements of each of K targets at full weight [m], (K, R C, 3).
    targets: NDArray[np.floating]
    #: Numbers of each point, as in `ScaledNumbers`, (R C,), and their changes, (L, R C); or None.
    values: NDArray[np.floating] | None
    changes: NDArray[np.floating] | None
    #: Mean distance from yarn to yarn [m].
    spacing: float
    #: Yarns closer than this number of pixels are not drawn one by one; None: none is.
    least_pixels: float | None
    #: Textures of bytes by the names that the shaders use, and the number of mip levels that the
    #: shaders use besides the textures; the colours are sRGB values.
    colors: Mapping[str, NDArray[np.uint8]]
    levels: int
    tiles: Mapping[str, NDArray[np.uint8]]
    tile_levels: int
    #: Shares and exposures of normals, (views, N, 4).
    views: NDArray[np.floating]
    #: Values of uniforms, by their names in the shaders.
    uniforms: Mapping[str, float | Sequence[float]]
    #: GLSL functions: `lightYarns` for the vertex shader, `sheetLight` for the fragment shader.
    vertex: str
    fragment: str


class Shading(NamedTuple):
    """How pictures shade a surface, for files that contain their own renderer."""

    #: GLSL functions: `reflectedLight`, `shadedLight`, `visibleColor`, `decoded` and `encoded`.
    light: str
    #: GLSL function `outlineAt`, for fragment shaders.
    outline: str
    #: Share of each point's surroundings that yarns leave open, 0 to 255, (N,); None: unknown.
    exposures: NDArray[np.uint8] | None
    #: None for anything but woven cloth.
    far: FarCloth | None = None


class QuantisedTargets(NamedTuple):
    """Targets quantised to small integers, with one step size for each target."""

    #: Length that the number 1 in the file stands for [m].
    unit: float
    #: Factor by which each target's weights are multiplied in the file, (K,).
    factors: Floats
    #: Displacements, where 32767 stands for the unit, (K, N, 3).
    targets: NDArray[np.int16]
    #: Changes of the normals, where 127 stands for 1, (K, N, 3).
    normals: NDArray[np.int8] | None


@dataclass(frozen=True)
class MovingSurface:
    """A triangle mesh whose motion is a weighted sum of morph targets."""

    title: str
    #: Positions [m], (N, 3).
    points: NDArray[np.float32]
    #: Displacements of each of K targets at full weight [m], (K, N, 3).
    targets: NDArray[np.float32]
    #: Unit normals (N, 3); None if the surface has no normals.
    normals: NDArray[np.float32] | None
    #: Changes of the normals by each target at full weight, before they are normalised, (K, N, 3).
    normal_targets: NDArray[np.float32] | None
    #: Point indices, counter-clockwise seen from outside, (M, 3).
    triangles: AnyInts
    #: Red, green and blue in sRGB, (N, 3).
    colors: NDArray[np.uint8]
    #: Part of each point, as an index into `part_names`, (N,).
    parts: AnyInts
    part_names: Sequence[str]
    view: InitialView
    #: Largest allowed distance of a point from its exact position [m].
    tolerance: float
    target_names: Sequence[str] = ()
    clips: Sequence[Clip] = ()
    #: Yarn curves of a woven cloth, with its motion.
    curves: YarnCurves | None = None
    numbers: ScaledNumbers | None = None
    shading: Shading | None = None
    #: The targets in quantised form, if there are so many points that their size matters.
    quantised: QuantisedTargets | None = None
    #: Number of points, the last ones, that belong to obstacles, and to planes among them.
    obstacle_points: int = 0
    plane_points: int = 0
    #: Metadata of the file, for people and programs.
    metadata: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_z_up(self) -> bool:
        """Whether the up axis is z instead of y."""
        return tuple(self.view.cameras[self.view.camera][1]) == (0.0, 0.0, 1.0)

    @property
    def has_point_colors(self) -> bool:
        """Whether each point stores its colour, because there are too many for materials."""
        return len(np.unique(self.colors, axis=0)) > _MAX_MATERIALS

    @property
    def materials(self) -> list[SurfaceMaterial]:
        """The materials: one for each colour of each part."""
        if self.has_point_colors:
            every = np.ones(len(self.points), np.bool_)
            return [SurfaceMaterial("colours of points", (1.0, 1.0, 1.0), every)]
        table = np.column_stack([self.parts, self.colors])
        found, own = np.unique(table, axis=0, return_inverse=True)
        return [
            SurfaceMaterial(
                f"{self.part_names[part]} #{bytes(rgb).hex()}",
                tuple(to_linear_light(np.array(rgb, np.uint8)).tolist()),
                own.reshape(-1) == number,
            )
            for number, (part, *rgb) in enumerate(found.tolist())
        ]


def quantise_targets(
    targets: NDArray[np.float32], normals: NDArray[np.float32] | None, weights: NDArray[np.floating]
) -> tuple[QuantisedTargets, float]:
    """Quantise targets; also return the largest error of a point's position [m]."""
    sizes = np.array([np.abs(target).max() for target in targets], np.float64)
    turns = 0.0 if normals is None else np.array([np.abs(each).max() for each in normals])
    # A smaller unit makes positions finer and normals coarser. With half the largest size, normals
    # of the largest target have steps of less than a degree.
    unit = sizes.max() / 2
    factors = np.maximum(sizes / unit, turns)
    places = np.empty(targets.shape, np.int16)
    facing = None if normals is None else np.empty(normals.shape, np.int8)
    for k, factor in enumerate(factors):
        places[k] = np.rint(targets[k] * (32767 / (unit * factor)))
        if facing is not None and normals is not None:
            facing[k] = np.rint(normals[k] * (127 / factor))
    error, steps = 0.0, unit * factors / 32767
    for part in blocks(targets.shape[1], _BLOCK):
        off = targets[:, part] - places[:, part] * steps[:, None, None]
        sums = np.tensordot(weights, off, 1)
        error = max(error, float(np.sqrt(np.einsum("tnk,tnk->tn", sums, sums).max())))
    return QuantisedTargets(unit, factors, places, facing), error


def to_linear_light(colors: NDArray[np.uint8]) -> Floats:
    """Convert sRGB bytes to linear light, 0 to 1 (IEC 61966-2-1); renderers add linear light."""
    shares = colors / 255.0
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
