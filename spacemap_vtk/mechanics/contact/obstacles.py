"""Rigid obstacles as signed distances: negative inside, with gradient and curvature.

Two kernels suffice. A box with rounded edges is a core, a smaller box, that is thickened by the
rounding; a sphere is one whose core is a point. A cylinder or disc is the same in the plane of its
axis and radius, turned about the axis. Within the core the nearest face counts.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.boundary.time_functions import TimeFunction
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import Floats


class Distance(NamedTuple):
    """Signed distance of points from an obstacle, and its derivatives."""

    gap: Floats
    """(n,), distance [m], negative inside."""
    gradient: Floats
    """(n, 3), ∇g: the outward normal."""
    curvature: Floats
    """(n, 3, 3), ∇∇g [1/m]."""


class BodyMotion(NamedTuple):
    """Motion of a body in time: a displacement times a function."""

    displacement: Floats
    """(3,), displacement where the function is 1 [m]."""
    function: TimeFunction
    """Factor over time, which is continuous and begins with 0."""

    def at_time(self, time: float) -> Floats:
        """Compute the displacement at a time.

        Parameters
        ----------
        time : float
            Time [s].

        Returns
        -------
        ndarray of float64, shape (3,)
            Displacement [m].
        """
        return self.displacement * self.function.value(time)


class Obstacle(ABC):
    """Rigid body at a place; in its own frame its centre is the origin and its axis z.

    Parameters
    ----------
    center : array_like of float, shape (3,)
        Centre of the body; for a plane, any of its points [m].
    axis : array_like of float, shape (3,)
        Direction of the body's z axis, of any length but zero.

    Raises
    ------
    InputError
        If the axis is zero.
    """

    #: Largest depth from which the surface passed through is still the nearest one [m].
    depth: float = math.inf

    def __init__(self, center: ArrayLike = (0, 0, 0), axis: ArrayLike = (0, 0, 1)) -> None:
        self.center = np.asarray(center, dtype=np.float64)
        #: (3, 3), axes of the body as rows.
        self.frame = frame_along(axis)

    def distance(self, points: Floats) -> Distance:
        """Compute the signed distance of points, with its first two derivatives.

        Parameters
        ----------
        points : ndarray of float64, shape (n, 3)
            Points [m].

        Returns
        -------
        Distance
            In the axes of the points.
        """
        gap, gradient, curvature = self._local_distance((points - self.center) @ self.frame.T)
        return Distance(gap, gradient @ self.frame, self.frame.T @ curvature @ self.frame)

    def gap(self, points: Floats) -> Floats:
        """Compute the signed distance of points alone.

        Parameters
        ----------
        points : ndarray of float64, shape (n, 3)
            Points [m].

        Returns
        -------
        ndarray of float64, shape (n,)
            Distances [m].
        """
        return self._local_gap((points - self.center) @ self.frame.T)

    def moved(self, shift: Floats) -> Obstacle:
        """Return the same body at another place.

        Parameters
        ----------
        shift : ndarray of float64, shape (3,)
            Move of the centre [m].

        Returns
        -------
        Obstacle
            A copy; this body if it does not move.
        """
        if not shift.any():
            return self
        found = copy(self)
        found.center = self.center + shift
        return found

    @property
    def digest(self) -> str:
        """Digest of shape and place."""
        return digest_of(type(self).__name__, *vars(self).values())

    @abstractmethod
    def _local_gap(self, points: Floats) -> Floats:
        """Compute the distance in the body's own frame, without derivatives."""

    @abstractmethod
    def _local_distance(self, points: Floats) -> Distance:
        """Compute the distance in the body's own frame."""


class Plane(Obstacle):
    """Half-space below a plane, whose normal is the axis."""

    def _local_gap(self, points: Floats) -> Floats:
        return points[:, 2]

    def _local_distance(self, points: Floats) -> Distance:
        normal = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
        return Distance(points[:, 2].copy(), normal, np.zeros((len(points), 3, 3)))


class RoundedBox(Obstacle):
    """Box with rounded edges.

    Parameters
    ----------
    size : array_like of float, shape (3,)
        Lengths of the sides [m].
    rounding : float
        Radius of the edges [m], at most half of the shortest side.
    center : array_like of float, shape (3,)
        Centre of the body [m].
    axis : array_like of float, shape (3,)
        Direction of the body's z axis, of any length but zero.

    Examples
    --------
    >>> box = RoundedBox((2, 2, 2), rounding=0.5)
    >>> [float(g) for g in box.distance(np.array([[0.0, 0, 3], [0, 0, 0.75]])).gap]
    [2.0, -0.25]
    """

    def __init__(
        self,
        size: ArrayLike,
        rounding: float = 0.0,
        center: ArrayLike = (0, 0, 0),
        axis: ArrayLike = (0, 0, 1),
    ) -> None:
        super().__init__(center, axis)
        half = np.asarray(size, dtype=np.float64) / 2
        self._core, self._rounding = half - rounding, rounding
        self.depth = float(half.min())

    def _local_gap(self, points: Floats) -> Floats:
        return _gap_of_box(points, self._core, self._rounding)

    def _local_distance(self, points: Floats) -> Distance:
        return _thickened_box(points, self._core, self._rounding)


class Sphere(RoundedBox):
    """Sphere: a box of rounding only."""

    def __init__(self, radius: float, *args: ArrayLike) -> None:
        super().__init__((2 * radius,) * 3, radius, *args)


class Cylinder(Obstacle):
    """Cylinder along the axis, with rounded rims; a low one is a disc.

    Parameters
    ----------
    radius : float
        Outer radius [m].
    height : float
        Length along the axis [m]; infinite by default.
    rounding : float
        Radius of the rims [m], at most the radius and half of the height.
    center : array_like of float, shape (3,)
        Centre of the body [m].
    axis : array_like of float, shape (3,)
        Direction of the body's z axis, of any length but zero.
    """

    def __init__(
        self,
        radius: float,
        height: float = math.inf,
        rounding: float = 0.0,
        center: ArrayLike = (0, 0, 0),
        axis: ArrayLike = (0, 0, 1),
    ) -> None:
        super().__init__(center, axis)
        self._core = np.array([radius, height / 2]) - rounding
        self._rounding = rounding
        self.depth = min(radius, height / 2)

    def _local_gap(self, points: Floats) -> Floats:
        plane = np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])
        return _gap_of_box(plane, self._core, self._rounding)

    def _local_distance(self, points: Floats) -> Distance:
        radius = np.hypot(points[:, 0], points[:, 1])
        away = np.divide(
            points[:, :2],
            radius[:, None],
            out=np.tile([1.0, 0.0], (len(points), 1)),
            where=radius[:, None] > 0,
        )
        plane = np.column_stack([radius, points[:, 2]])
        gap, slope, bend = _thickened_box(plane, self._core, self._rounding)
        axes = np.zeros((len(points), 2, 3))  # outwards and along the axis
        axes[:, 0, :2], axes[:, 1, 2] = away, 1.0
        around = np.column_stack([-away[:, 1], away[:, 0], np.zeros(len(points))])
        hoop = np.divide(slope[:, 0], radius, out=np.zeros_like(radius), where=radius > 0)
        curvature = axes.swapaxes(1, 2) @ bend @ axes
        curvature += hoop[:, None, None] * around[:, :, None] * around[:, None, :]
        return Distance(gap, (slope[:, None] @ axes)[:, 0], curvature)


class SampledBody(Obstacle):
    """Body of any shape, whose distance is sampled on a grid and interpolated by cubic splines.

    Parameters
    ----------
    values : ndarray of float64, shape (nx, ny, nz)
        Signed distances at the nodes of the grid [m].
    origin : array_like of float, shape (3,)
        First node [m].
    spacing : float
        Distance between nodes [m]; edges sharper than it are rounded.
    center : array_like of float, shape (3,)
        Centre of the body [m].
    axis : array_like of float, shape (3,)
        Direction of the body's z axis, of any length but zero.
    """

    def __init__(
        self,
        values: Floats,
        origin: ArrayLike,
        spacing: float,
        center: ArrayLike = (0, 0, 0),
        axis: ArrayLike = (0, 0, 1),
    ) -> None:
        from scipy.ndimage import spline_filter

        super().__init__(center, axis)
        self._coefficients = spline_filter(values, 3, mode="mirror")
        self._origin, self._spacing = np.asarray(origin, dtype=np.float64), spacing
        self.depth = max(float(-values.min()), spacing)

    def _local_gap(self, points: Floats) -> Floats:
        from scipy.ndimage import map_coordinates

        places, inside = self._in_grid(points)
        gap = map_coordinates(self._coefficients, inside.T, prefilter=False, mode="mirror")
        return np.asarray(gap + self._spacing * np.linalg.norm(places - inside, axis=1))

    def _in_grid(self, points: Floats) -> tuple[Floats, Floats]:
        """Return points in units of the grid, and the nearest places within it."""
        # Outside of the grid the distance to it is added: no contact is there.
        places = (points - self._origin) / self._spacing
        return places, places.clip(1.0, np.array(self._coefficients.shape) - 2.0)

    def _local_distance(self, points: Floats) -> Distance:
        places, inside = self._in_grid(points)
        cell = np.minimum(inside.astype(np.int64), np.array(self._coefficients.shape) - 3)
        weights = [_spline_weights(inside[:, k] - cell[:, k]) for k in range(3)]
        near = cell[:, :, None] + np.arange(-1, 3)
        table = self._coefficients[
            near[:, 0, :, None, None], near[:, 1, None, :, None], near[:, 2, None, None, :]
        ]

        def derivative(*orders: int) -> Floats:
            x, y, z = (weights[k][orders.count(k)] for k in range(3))
            found = np.einsum("nijk,ni,nj,nk->n", table, x, y, z, optimize=True)
            return np.asarray(found / self._spacing ** len(orders))

        gap, out = derivative(), (places - inside) * self._spacing
        far = np.linalg.norm(out, axis=1)
        gradient = np.column_stack([derivative(k) for k in range(3)])
        curvature = np.empty((len(points), 3, 3))
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)):
            curvature[:, i, j] = curvature[:, j, i] = derivative(i, j)
        return Distance(gap + far, gradient, curvature)


def frame_along(axis: ArrayLike) -> Floats:
    """Compute the frame whose z is an axis and which is turned from x, y, z as little as possible.

    Parameters
    ----------
    axis : array_like of float, shape (3,)
        Any length but zero.

    Returns
    -------
    ndarray of float64, shape (3, 3)
        Unit vectors as rows.

    Raises
    ------
    InputError
        If the axis is zero.
    """
    given = np.asarray(axis, dtype=np.float64)
    length = float(np.linalg.norm(given))
    if not length > 0.0:
        raise InputError("the axis of an obstacle must not be zero", key="axis", value=axis)
    x, y, z = given / length
    if z < -0.5:  # first half a turn about x, as the formula below divides by zero at -z
        return frame_along((x, -y, -z)) * [1.0, -1.0, -1.0]
    share = 1.0 / (1.0 + z)
    return np.array(
        [
            [1.0 - x * x * share, -x * y * share, -x],
            [-x * y * share, 1.0 - y * y * share, -y],
            [x, y, z],
        ]
    )


def _gap_of_box(points: Floats, core: Floats, rounding: float) -> Floats:
    """Compute the distance from a box, of half sides `core` (d,), that is thickened all round."""
    beyond = abs(points) - core
    out = np.sqrt((np.maximum(beyond, 0.0) ** 2).sum(axis=1))
    return out + np.minimum(beyond.max(axis=1), 0.0) - rounding


def _thickened_box(points: Floats, core: Floats, rounding: float) -> Distance:
    """Compute the same distance with its derivatives."""
    sign = np.where(points < 0, -1.0, 1.0)
    beyond = abs(points) - core
    out = np.maximum(beyond, 0.0)
    length = np.linalg.norm(out, axis=1)
    within = length == 0
    nearest = np.eye(len(core))[beyond.argmax(axis=1)]
    safe = np.where(within, 1.0, length)[:, None]
    normal = np.where(within[:, None], nearest, out / safe) * sign
    gap = np.where(within, beyond.max(axis=1), length) - rounding
    # On a rounded edge or corner the surface is a part of a cylinder or sphere.
    across = (out > 0)[:, :, None] * np.eye(len(core)) - normal[:, :, None] * normal[:, None, :]
    return Distance(gap, normal, np.where(within, 0.0, 1.0 / safe[:, 0])[:, None, None] * across)


def _spline_weights(t: Floats) -> Sequence[Floats]:
    """Compute weights of the cubic B-spline at t in [0, 1], and their derivatives, (n, 4) each."""
    s = 1.0 - t
    value = [s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3]
    slope = [-(s**2), 3 * t**2 - 4 * t, 4 * s - 3 * s**2, t**2]
    bend = [s, 3 * t - 2, 3 * s - 2, t]
    return [
        np.column_stack(value) / 6,
        np.column_stack(slope) / 2,
        np.column_stack(bend),
    ]
