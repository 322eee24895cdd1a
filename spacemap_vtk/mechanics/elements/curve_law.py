"""The law of a membrane from measured curves of force."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.errors import InputError, add_key_to_errors
from spacemap_vtk.mechanics.elements.force_curve import ForceCurve
from spacemap_vtk.mechanics.elements.membrane_law import StretchLaw, StretchResponse, shear_angle
from spacemap_vtk.ndarrays import Floats

#: Stiffness of a slack direction, over that at the beginning of its curve.
SLACK = 1e-3
#: Largest force at rest, over the largest one of the curve.
_REST = 1e-6


class CurveLaw(StretchLaw):
    """Law of a membrane whose forces along both directions and in shear were measured.

    The energy is the sum of three integrals: the directions and the shear do not affect each other,
    as in tests in which the width was held.

    Parameters
    ----------
    warp, weft : (n, 2) array_like
        Points of stretch (1 at rest) and force per undeformed width [N/m]. Below the first point,
        usually that at rest, a direction is slack: it resists with a thousandth of its stiffness at
        the beginning of the curve.
    shear : (n, 2) array_like
        Points of shear angle [rad], from 0 on, and shear force per width [N/m]; the same to both
        sides.

    Raises
    ------
    InputError
        A curve does not ascend, or there is a force at rest.

    Examples
    --------
    >>> law = CurveLaw([[1, 0], [1.1, 100]], [[1, 0], [1.1, 200]], [[0, 0], [0.2, 4]])
    >>> (law.stiffness_at_rest / 10).round(6).tolist()
    [[200.0, 0.0, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, 2.0]]
    """

    kind = "curves"

    def __init__(self, warp: ArrayLike, weft: ArrayLike, shear: ArrayLike) -> None:
        given = {"warp": warp, "weft": weft, "shear": shear}
        self.arrays = {name: np.array(points, np.float64) for name, points in given.items()}
        for name, points in self.arrays.items():
            if points.ndim != 2 or points.shape[1] != 2:
                raise InputError(f"the points of the {name} curve must be pairs of numbers")
        with add_key_to_errors("warp_curve"):
            self._warp = _tension_curve(self.arrays["warp"])
        with add_key_to_errors("weft_curve"):
            self._weft = _tension_curve(self.arrays["weft"])
        with add_key_to_errors("shear_curve"):
            self._shear = _shear_curve(self.arrays["shear"])

    @property
    def stiffness_at_rest(self) -> Floats:
        """Stiffness of taut directions at rest [N/m], (3, 3)."""
        slopes = [
            curve.evaluate(np.array([rest]))[2][0]
            for curve, rest in ((self._weft, 1.0), (self._warp, 1.0), (self._shear, 0.0))
        ]
        return np.diag(slopes)

    def respond(self, first: Floats, second: Floats, sine: Floats) -> StretchResponse:
        """Compute the energy and its derivatives; axis 1 is the weft."""
        one, two = _pull(self._weft, first), _pull(self._warp, second)
        angle, slope, bend = shear_angle(sine)
        energy, force, steep = self._shear.evaluate(np.abs(angle))
        force = np.copysign(force, angle)
        zero = np.zeros_like(energy)
        turned = steep * slope * slope + force * bend
        return StretchResponse(
            one[0] + two[0] + energy,
            np.stack([one[1], two[1], force * slope]),
            np.stack([one[2], two[2], turned, zero, zero, zero]),
        )


def _pull(curve: ForceCurve, stretch: Floats) -> tuple[Floats, Floats, Floats]:
    """Evaluate a curve of tension; below rest the direction is slack, unless it was measured."""
    energy, force, slope = curve.evaluate(np.maximum(stretch, curve.first))
    under = np.minimum(stretch - curve.first, 0.0)
    soft = np.where(under < 0.0, SLACK * slope, slope)
    return energy + (force + 0.5 * soft * under) * under, force + soft * under, soft


def _tension_curve(points: Floats) -> ForceCurve:
    """Make a curve of tension that begins at rest or before."""
    stretch, force = points.T
    if stretch[0] <= 0.0:
        raise InputError(
            "a curve of tension states stretches: lengths over the length at rest",
            value=f"{stretch[0]:g}",
            allowed="more than 0; 1 at rest",
            cure="Add 1 to strains",
        )
    if stretch[0] > 1.0:
        stretch, force = np.append(1.0, stretch), np.append(0.0, force)
    curve = ForceCurve(stretch, force)
    _require_rest(float(curve.evaluate(np.ones(1))[1][0]), force, "a stretch of 1")
    return curve


def _shear_curve(points: Floats) -> ForceCurve:
    """Make a curve of shear force over the angle, from 0 on."""
    angle, force = points.T
    if angle[0] > 0.0:
        angle, force = np.append(0.0, angle), np.append(0.0, force)
    if angle[0] < 0.0:
        raise InputError("a curve of shear begins at the angle 0", value=f"{angle[0]:g}")
    curve = ForceCurve(angle, force)
    _require_rest(float(force[0]), force, "the angle 0")
    return curve


def _require_rest(force: float, forces: Floats, where: str) -> None:
    if abs(force) > _REST * float(np.abs(forces).max()):
        raise InputError(
            f"the curve has a force at {where}, where the cloth rests",
            value=f"{force:g} N/m",
            allowed="0",
            cure="Subtract the pretension, and measure the stretch from the length under it",
        )
